"""Records and the hash chain that binds them.

A run is a sequence of records. Each carries the hash of the one before and of its own contents, so that a record
cannot be changed, removed or inserted without breaking every later one. What the recovery needs is in fields of
its own; `body` holds the evidence (readings, settling, identities) as JSON.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from math import isfinite
from typing import Any, NamedTuple

from rig.run_file.bodies import shown
from rig.run_file.events.event import Event, body_of, decode
from rig.run_file.events.points import ACCEPTED, Observed

GENESIS = bytes(32)
"""What the first record names as its predecessor."""

StoredRow = tuple[Any, ...]
"""A record as stored: its number, its own columns, its predecessor's hash and its own."""


class _Columns(NamedTuple):
    session: int
    kind: str
    elapsed_s: float
    utc_s: float
    run_index: int | None = None
    whole_plot: int | None = None
    attempt: int | None = None
    status: str | None = None
    body: str = "{}"


class Record(_Columns):
    """One thing that happened.

    Attributes:
        session: which start of the controller, from 1; 0 for what was written when the run was created.
        kind: "run", "session", "identity", "event", "observation"...: see `rig.run_file.events`.
        elapsed_s: bench seconds since the run was created; UTC-based across a reboot.
        utc_s: seconds since 1970-01-01.
        run_index: the point it belongs to, if any.
        whole_plot: the whole plot it belongs to, if any.
        attempt: which attempt at that point, from 1.
        status: for an observation "accepted" or "rejected"; for others a word of their own.
        body: JSON text.

    A tuple of them in the order of the table's columns: a hundred thousand are made whenever a run is resumed.

    """

    seq = 0
    """Its number, where it was read from a file."""

    @cached_property
    def data(self) -> dict[str, Any]:
        """The body, decoded and checked. Raises `ContentsError`."""
        return body_of(self.body, self.kind, self.status, self.named)

    @cached_property
    def event(self) -> Event:
        """What it tells. Raises `ContentsError`."""
        return decode(self.kind, self.status, self.data)

    @property
    def accepted(self) -> bool:
        """Whether it is an observation that counts; its body is not looked into."""
        return self.kind == Observed.kind and self.status == ACCEPTED

    def sentence(self) -> str:
        """It, in a person's words."""
        return self.event.sentence(self)

    def named(self) -> str:
        """It, in a sentence."""
        at = "" if self.run_index is None else f" of point {shown(self.run_index)}"
        number = "the record to be written" if not self.seq else f"record {self.seq}"
        return f"{number} ({str(self.kind)[:40]}{at})"


def encode(body: Mapping[str, Any]) -> str:
    """Body as compact JSON. Raises ValueError on NaN or infinity, which JSON does not have."""
    return json.dumps(body, separators=(",", ":"), allow_nan=False)


def link(previous: bytes, seq: int, record: Record) -> bytes:
    """Hash of a record given its predecessor's."""
    text = b"%b%b,%b]" % (previous, _fields(seq, record).encode(), _quoted(record.body))
    return hashlib.sha256(text).digest()


def followed(rows: Sequence[StoredRow], seq: int, previous: bytes) -> int:
    """How many rows, from the first on, are records that follow one another and have their hashes.

    A record whose numbers and body are of the kinds they should be, with a body of ASCII, as nearly all are, is hashed
    here and not by `link`, in half the time: nothing but quotation marks and backslashes of its body is escaped. No two
    bodies come out alike that way, and none comes out as another does by `link`: control characters, which `link`
    escapes as well, are left in and show. So what holds here is what was hashed.

    Args:
        rows: as stored.
        seq: the number that the first should have.
        previous: hash of the record before it.

    """
    sha256 = hashlib.sha256
    for count, row in enumerate(rows):
        number, session, kind, elapsed_s, utc_s, index, whole_plot, attempt, status, body, before, own = row
        if number != seq or before != previous:
            return count
        held = False
        if (
            type(elapsed_s) is type(utc_s) is float
            and type(session) is type(index) is type(attempt) is int
            and (whole_plot is None or type(whole_plot) is int)
            and type(kind) is type(status) is type(body) is str
            and body.isascii()
        ):
            head = (
                f"[{seq},{session},{_word(kind)},{elapsed_s!r},{utc_s!r},{index},"
                f"{'null' if whole_plot is None else whole_plot},{attempt},{_word(status)}"
            )
            quoted = body.encode().replace(b"\\", b"\\\\").replace(b'"', b'\\"')
            held = sha256(b'%b%b,"%b"]' % (previous, head.encode(), quoted)).digest() == own
        if not held and not _holds(row):
            return count
        seq, previous = seq + 1, own
    return len(rows)


def _holds(row: StoredRow) -> bool:
    try:
        return bool(link(row[10], row[0], Record._make(row[1:10])) == row[11])
    except (TypeError, ValueError):  # what no record has, JSON may not have either
        return False


def _fields(seq: int, record: Record) -> str:
    """A record but for its body, as JSON without the closing bracket."""
    session, kind, elapsed_s, utc_s, index, whole_plot, attempt, status, _ = record
    if not (
        type(elapsed_s) is type(utc_s) is float
        and isfinite(elapsed_s + utc_s)
        and type(session) is int
        and (index is None or type(index) is int)
        and (whole_plot is None or type(whole_plot) is int)
        and (attempt is None or type(attempt) is int)
    ):
        return json.dumps([seq, *record[:-1]], separators=(",", ":"), allow_nan=False)[:-1]
    return (
        f"[{seq},{session},{_word(kind)},{elapsed_s!r},{utc_s!r},"
        f"{'null' if index is None else index},{'null' if whole_plot is None else whole_plot},"
        f"{'null' if attempt is None else attempt},{_word(status)}"
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
