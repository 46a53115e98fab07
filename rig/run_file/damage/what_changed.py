"""Search for the change in a record: the original value is the one that restores the hash."""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from rig.run_file.chain import Record, link
from rig.run_file.events.event import kinds

_STATUS = (None, "accepted", "rejected", "retry", "skip", "final", "later", "hold", "abort", "complete", "prepared")
_LONGEST_BODY = 6000
"""Maximum number of characters of a body that is searched for a flipped bit."""


@dataclass(frozen=True)
class Change:
    """A change in a record.

    Attributes:
        column: changed column, None if unknown; "predecessor" if the record itself is sound.
        what: a sentence.

    """

    column: str | None
    what: str


def changed_column(
    row: tuple[int, Record, bytes, bytes], expected: bytes, claimed: bytes | None, points: int, search: bool
) -> Change | None:
    """The defect of a record by its hashes; None if there is none.

    Args:
        row: number, record, the predecessor's hash and its own, as stored.
        expected: the predecessor's hash.
        claimed: this record's hash according to the record after it, None for the last one.
        points: number of points of the run list.
        search: try possible original values.

    """
    seq, record, previous, own = row
    hashed = link(previous, seq, record)
    if hashed == own:
        if previous == expected:
            return None
        return Change("predecessor", "does not follow the record before it")
    if previous != expected and link(expected, seq, record) == own:
        return Change("previous", "was changed after it was written: its column previous")
    if claimed is not None and claimed == hashed != own:
        return Change("hash", "was changed after it was written: its column hash")
    if search and len(record.body) < 3 * _LONGEST_BODY:
        for base in {previous, expected}:
            for column, was, tried_seq, tried in _candidates(seq, record, points):
                if link(base, tried_seq, tried) in (own, claimed):
                    return Change(column, f"was changed after it was written: {column} was {was}")
            place = _flipped_bit(base, seq, record, own)
            if place is not None:
                return Change("body", f"was changed after it was written: one bit of body, in character {place + 1}")
        return Change(None, "was changed after it was written: elapsed_s, utc_s or body, or several columns")
    return Change(None, "was changed after it was written")


def _candidates(seq: int, record: Record, points: int) -> Iterator[tuple[str, str, int, Record]]:
    """Records that differ in one column from the given one."""
    for other in range(max(1, seq - 5), seq + 6):
        yield "seq", f"{other}, so records were removed or inserted before it", other, record
    tries: dict[str, Any] = {
        "kind": kinds(),
        "status": _STATUS,
        "run_index": (None, *range(min(points, 20_000))),
        "whole_plot": (None, *range(300)),
        "attempt": (None, *range(50)),
        "session": range(300),
    }
    for column, values in tries.items():
        for value in values:
            yield column, repr(value), seq, record._replace(**{column: value})
    for column in ("elapsed_s", "utc_s"):
        number = getattr(record, column)
        near = [round(number + step, 6) for step in (*range(-100, 101), 3600, -3600, 86400, -86400)]
        for value in (*_flipped_float(number), *near):
            yield column, repr(value), seq, record._replace(**{column: value})


def _flipped_float(number: float) -> Iterator[float]:
    (bits,) = struct.unpack(">Q", struct.pack(">d", number))
    for bit in range(64):
        (value,) = struct.unpack(">d", struct.pack(">Q", bits ^ 1 << bit))
        if value - value == 0:  # finite
            yield value


def _flipped_bit(previous: bytes, seq: int, record: Record, own: bytes) -> int | None:
    """Index of the character of the body with one flipped bit; None if there is none."""
    body = record.body
    if len(body) > _LONGEST_BODY or not body.isascii():
        return None
    mark = "\x00"
    text = json.dumps([seq, *record._replace(body=mark)], separators=(",", ":"), allow_nan=False)
    start, end = text.split(json.dumps(mark)[1:-1], 1)
    pieces = [json.dumps(character)[1:-1].encode() for character in body]
    hashed = hashlib.sha256(previous + start.encode())
    for place, piece in enumerate(pieces):
        rest = b"".join(pieces[place + 1 :]) + end.encode()
        for bit in range(7):
            tried = hashed.copy()
            tried.update(json.dumps(chr(ord(body[place]) ^ 1 << bit))[1:-1].encode() + rest)
            if tried.digest() == own:
                return place
        hashed.update(piece)
    return None
