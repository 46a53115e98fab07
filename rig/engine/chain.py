"""Records and the hash chain that binds them.

A run is a sequence of records. Each carries the hash of the one before and of its own contents, so that a record
cannot be changed, removed or inserted without breaking every later one. What the recovery needs is in fields of
its own; `body` holds the evidence (readings, settling, identities) as JSON.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
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
        """The body, decoded. Raises ValueError if it is not a JSON object."""
        try:
            decoded = json.loads(self.body)
        except RecursionError:
            raise ValueError("JSON nested too deeply") from None
        if not isinstance(decoded, dict):
            raise ValueError("JSON, but not an object")
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
    r, index, whole_plot, attempt = record, record.run_index, record.whole_plot, record.attempt
    if not (
        type(r.elapsed_s) is type(r.utc_s) is float
        and isfinite(r.elapsed_s + r.utc_s)
        and type(r.session) is int
        and (index is None or type(index) is int)
        and (whole_plot is None or type(whole_plot) is int)
        and (attempt is None or type(attempt) is int)
    ):
        return json.dumps([seq, *r.fields()[:-1]], separators=(",", ":"), allow_nan=False)[:-1]
    return (
        f"[{seq},{r.session},{_word(r.kind)},{r.elapsed_s!r},{r.utc_s!r},"
        f"{'null' if index is None else index},{'null' if whole_plot is None else whole_plot},"
        f"{'null' if attempt is None else attempt},{_word(r.status)}"
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
