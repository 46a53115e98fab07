"""Records and the hash chain that binds them.

A run is a sequence of records. Each has the hash of its predecessor and of its own contents, so a record
cannot be changed, removed or inserted without breaking every later one. Values needed for recovery have columns of
their own; `body` holds the evidence (readings, settling, identities) as JSON.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from math import isfinite
from typing import Any

from rig.run_file.bodies import shown
from rig.run_file.columns import Columns
from rig.run_file.events.event import Event, body_of, decode
from rig.run_file.events.points import ACCEPTED, Observed

GENESIS = bytes(32)
"""Predecessor's hash in the first record."""

StoredRow = tuple[Any, ...]
"""A record as stored: number, own columns, predecessor's hash, own hash."""


class Record(Columns):
    """One record.

    Attributes:
        session: number of the controller's start, from 1; 0 for records written when the run was created.
        kind: "run", "session", "identity", "event", "observation"...: see `rig.run_file.events`.
        elapsed_s: bench seconds since the run was created; UTC-based across a reboot.
        utc_s: seconds since 1970-01-01.
        run_index: its point, if any.
        whole_plot: its whole plot, if any.
        attempt: number of the attempt at this point, from 1.
        status: for an observation "accepted" or "rejected"; for other kinds a word of their own.
        body: JSON text.

    A tuple in the order of the table's columns, for speed: resuming a run may create a hundred thousand of them.

    """

    seq = 0
    """Its number, if it was read from a file."""

    @cached_property
    def data(self) -> dict[str, Any]:
        """The body, decoded and checked. Raises `ContentsError`."""
        return body_of(self.body, self.kind, self.status, self.named)

    @cached_property
    def event(self) -> Event:
        """Its event. Raises `ContentsError`."""
        return decode(self.kind, self.status, self.data)

    @property
    def accepted(self) -> bool:
        """Whether it is an accepted observation; the body is not read."""
        return self.kind == Observed.kind and self.status == ACCEPTED

    def sentence(self) -> str:
        """The record in words."""
        return self.event.sentence(self)

    def named(self) -> str:
        """The record's name, for sentences."""
        at = "" if self.run_index is None else f" of point {shown(self.run_index)}"
        number = "the record to be written" if not self.seq else f"record {self.seq}"
        return f"{number} ({str(self.kind)[:40]}{at})"


def encode(body: Mapping[str, Any]) -> str:
    """Body as compact JSON. Raises ValueError for NaN or infinity, which JSON cannot represent."""
    return _COMPACT.encode(body)


_COMPACT = json.JSONEncoder(separators=(",", ":"), allow_nan=False, check_circular=False)  # an eighth faster


def link(previous: bytes, seq: int, record: Record) -> bytes:
    """Hash of a record, given its predecessor's hash."""
    # The number is hashed too: two records that swap their places break the chain even if `previous` is swapped.
    text = b"%b%b,%b]" % (previous, _fields(seq, record).encode(), _quoted(record.body))
    return hashlib.sha256(text).digest()


def followed(rows: Sequence[StoredRow], seq: int, previous: bytes) -> int:
    """Number of rows, from the first, that are consecutive records with correct hashes.

    Nearly all records have values of the right types and an ASCII body. They are hashed here instead of by `link`,
    in half the time: only quotation marks and backslashes of the body are escaped. No two bodies get the same text
    in this way, and none gets the text of another body by `link`: control characters, which `link` escapes too,
    stay visible. So a hash that is correct here is correct by `link`.

    Args:
        rows: rows as stored.
        seq: expected number of the first.
        previous: hash of the record before it.

    """
    sha256 = hashlib.sha256
    for count, row in enumerate(rows):
        number, session, kind, elapsed_s, utc_s, index, whole_plot, attempt, status, body, before, own = row
        if number != seq or before != previous:
            return count
        held = False
        # `type(...) is` and not isinstance: True is an int to Python, and another text in JSON.
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
    except (TypeError, ValueError):  # values that no record has may not be valid in JSON either
        return False


def _fields(seq: int, record: Record) -> str:
    """A record without its body, as JSON without the closing bracket."""
    session, kind, elapsed_s, utc_s, index, whole_plot, attempt, status, _ = record
    if not (
        type(elapsed_s) is type(utc_s) is float
        and isfinite(elapsed_s + utc_s)  # JSON has no NaN: those go the slow way, which refuses them
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
    """Body as a JSON string. It is long and mostly plain, so searching it is faster than going through its
    characters.
    """
    if isinstance(body, str) and body.isascii():
        plain = body.encode()
        if not plain.translate(None, _PLAIN):
            return b'"%b"' % plain.replace(b'"', b'\\"')
    return json.dumps(body).encode()
