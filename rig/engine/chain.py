"""Records and the hash chain that binds them.

A run is a sequence of records. Each carries the hash of the one before and of its own contents, so that a record
cannot be changed, removed or inserted without breaking every later one. What the recovery needs is in fields of
its own; `body` holds the evidence (readings, settling, identities) as JSON.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import isfinite
from typing import Any

GENESIS = bytes(32)
"""What the first record names as its predecessor."""


@dataclass(frozen=True)
class Record:
    """One thing that happened.

    Attributes:
        session: which start of the controller, from 1; 0 for what was written when the run was created.
        kind: "run", "session", "identity", "event", "observation", "skip", "fault", "hold", "release", "end".
        elapsed_s: bench seconds since the run was created; UTC-based across a reboot.
        utc_s: seconds since 1970-01-01.
        run_index: the point it belongs to, if any.
        whole_plot: the whole plot it belongs to, if any.
        attempt: which attempt at that point, from 1.
        status: for an observation "accepted" or "rejected"; for others a word of their own.
        body: JSON text.

    """

    session: int
    kind: str
    elapsed_s: float
    utc_s: float
    run_index: int | None = None
    whole_plot: int | None = None
    attempt: int | None = None
    status: str | None = None
    body: str = "{}"

    @cached_property
    def data(self) -> dict[str, Any]:
        """The body, decoded."""
        decoded: dict[str, Any] = json.loads(self.body)
        return decoded

    def fields(self) -> tuple[object, ...]:
        """The record as a row, in the order of the table's columns."""
        return (
            self.session,
            self.kind,
            self.elapsed_s,
            self.utc_s,
            self.run_index,
            self.whole_plot,
            self.attempt,
            self.status,
            self.body,
        )


def encode(body: Mapping[str, Any]) -> str:
    """Body as compact JSON. Raises ValueError on NaN or infinity, which JSON does not have."""
    return json.dumps(body, separators=(",", ":"), allow_nan=False)


def link(previous: bytes, seq: int, record: Record) -> bytes:
    """Hash of a record given its predecessor's."""
    return hashlib.sha256(b"%b%b,%b]" % (previous, _fields(seq, record).encode(), _quoted(record.body))).digest()


def _fields(seq: int, record: Record) -> str:
    """A record but for its body, as JSON without the closing bracket."""
    r = record
    if not (type(r.elapsed_s) is type(r.utc_s) is float and isfinite(r.elapsed_s + r.utc_s)):
        return json.dumps([seq, *r.fields()[:-1]], separators=(",", ":"), allow_nan=False)[:-1]
    place = "null" if r.run_index is None else r.run_index
    whole_plot = "null" if r.whole_plot is None else r.whole_plot
    attempt = "null" if r.attempt is None else r.attempt
    return (
        f"[{seq},{r.session},{_word(r.kind)},{r.elapsed_s!r},{r.utc_s!r},"
        f"{place},{whole_plot},{attempt},{_word(r.status)}"
    )


@lru_cache(maxsize=1000)
def _word(text: str | None) -> str:
    return json.dumps(text)


_PLAIN = bytes(code for code in range(0x20, 0x7F) if code != ord("\\"))


def _quoted(body: object) -> bytes:
    """Body as a JSON string. Long and mostly plain, it is sooner searched as a whole than looked at by letters."""
    if isinstance(body, str) and body.isascii():
        plain = body.encode()
        if not plain.translate(None, _PLAIN):
            return b'"%b"' % plain.replace(b'"', b'\\"')
    return json.dumps(body).encode()


def first_break(
    rows: Iterable[tuple[int, Record, bytes, bytes]], each: Callable[[Record], object] = lambda _: None
) -> str | None:
    """Where a chain is broken, None if it holds.

    Args:
        rows: (seq, record, previous, hash) in order of seq.
        each: called with every record up to there.

    """
    expected_seq, expected = 1, GENESIS
    for seq, record, previous, own in rows:
        if seq != expected_seq:
            return f"record {expected_seq} is missing: record {seq} follows record {expected_seq - 1}"
        if previous != expected or link(previous, seq, record) != own:
            of = "" if record.run_index is None else f" of point {record.run_index}"
            if previous == expected:
                return f"record {seq} ({record.kind}{of}) was changed after it was written"
            return (
                f"record {seq} ({record.kind}{of}) does not follow the record before it: something was changed, "
                f"removed or inserted there"
            )
        each(record)
        expected_seq, expected = seq + 1, own
    return None
