"""Chains of records that the pages of a run file still prove, and the choice of the run's chain.

Pages may hold several chains: from a log of another run beside the file, from a copy that was resumed elsewhere, or
from records that were not committed before a power cut. A record's hash covers its number and its predecessor's hash,
so records with correct hashes form trees. Every path from a first record is a chain.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rig.run_file.chain import GENESIS, Record, link
from rig.run_file.damage.pages import Pages, Place, Row
from rig.run_file.events.sessions import Ended, RunCreated

_COLUMNS = 12
Chained = tuple[int, Record, bytes, bytes]
"""Number, record, predecessor's hash, own hash."""


class _Node(NamedTuple):
    seq: int
    previous: bytes
    place: Place
    ends: bool


@dataclass(frozen=True)
class Other:
    """A chain that was found and not restored.

    Attributes:
        run: the run's id, "" if it is not in its first record.
        records: number of records.
        head: hash of the last record, hexadecimal.
        same_until: number of the last record in common with the restored chain, 0 for another run.
        ended: whether its last record ends the run.

    """

    run: str
    records: int
    head: str
    same_until: int
    ended: bool


@dataclass
class Chains:
    """Every record with a correct hash, by hash, and the chains they form.

    Attributes:
        documents: places of the texts, by name and digest.

    """

    documents: dict[tuple[str, str], list[Place]] = field(default_factory=lambda: defaultdict(list))
    _nodes: dict[bytes, _Node] = field(default_factory=dict)
    _claims: dict[bytes, bytes] = field(default_factory=dict)
    _first: dict[bytes, bytes] = field(default_factory=dict)

    @classmethod
    def found_in(cls, pages: Pages) -> Chains:
        """Read all pages. Raises RunFileError if they form a loop."""
        found = cls()
        for place, rows in pages.cells():
            for row in rows:
                if found._take(place, row):
                    break
        for own, (seq, previous, _, _) in sorted(found._nodes.items(), key=lambda item: item[1].seq):
            if seq == 1:
                if previous == GENESIS:
                    found._first[own] = own
            elif previous in found._first and found._nodes[previous].seq == seq - 1:
                found._first[own] = found._first[previous]
        return found

    def _take(self, place: Place, row: Row) -> bool:
        """Whether the cell needs no other way of reading."""
        _, c = row
        if len(c) == 2 and isinstance(c[0], str) and isinstance(c[1], str):
            self.documents[c[0], hashlib.sha256(c[1].encode()).hexdigest()].append(place)
        elif (chained := proven(row)) is not None:
            seq, record, previous, own = chained
            self._nodes.setdefault(own, _Node(seq, previous, place, record.kind == Ended.kind))
            return True
        elif len(c) == _COLUMNS and isinstance(c[10], bytes) and isinstance(c[11], bytes):
            self._claims.setdefault(c[11], c[10])
        return False

    def tips(self, head: str = "") -> list[bytes]:
        """The last record of every chain that has a first record; the longest first, ended chains before others.

        Args:
            head: only chains with a record whose hash begins with these digits.

        """
        inner = {self._nodes[own].previous for own in self._first}
        tips = [own for own in self._first if own not in inner]
        if head:
            having: set[bytes] = set()
            for own in self._first:  # predecessors come first
                if own.hex().startswith(head) or self._nodes[own].previous in having:
                    having.add(own)
            tips = [own for own in tips if own in having]
        return sorted(tips, key=lambda own: (-self._nodes[own].seq, not self._nodes[own].ends, self._nodes[own].place))

    def first(self, own: bytes) -> bytes:
        """The first record of a record's chain."""
        return self._first[own]

    def path(self, tip: bytes) -> list[bytes]:
        """The hashes of a chain, from its last record back to the first."""
        path = [tip]
        while (previous := self._nodes[path[-1]].previous) != GENESIS:
            path.append(previous)
        return path

    def read(self, own: bytes, pages: Pages) -> Chained:
        """A record, read from its place."""
        for row in pages.rows(self._nodes[own].place):
            chained = proven(row)
            if chained is not None and chained[3] == own:
                return chained
        raise OSError("the file changed while it was read")

    def known(self, first: bytes, last: tuple[int, bytes] | None) -> int:
        """The highest known record number of a run, even if its chain is broken.

        Args:
            first: the run's first record.
            last: number and hash of a last record, from another source.

        """
        alone = len(set(self._first.values())) == 1  # a broken chain belongs to this run if there is no other run
        belongs: dict[bytes, bytes | None] = dict(self._first)
        said = {last[1]: last[0]} if last is not None and last[1] not in self._nodes else {}
        highest = 0
        for own, seq in [*((own, node.seq) for own, node in self._nodes.items()), *said.items()]:
            way, at = [], own
            while at not in belongs:
                belongs[at] = None  # a loop counts as a broken chain
                way.append(at)
                at = self._nodes[at].previous if at in self._nodes else self._claims.get(at, GENESIS)
            of = belongs[at]
            belongs.update(dict.fromkeys(way, of))
            if of == first or (of is None and alone):
                highest = max(highest, seq)
        return highest

    def others(self, chosen: bytes, pages: Pages, most: int) -> list[Other]:
        """Chains besides the chosen one: all of its run, the longest of each other run."""
        own_path, told = set(self.path(chosen)), {self._first[chosen]}
        found: list[Other] = []
        for tip in self.tips():
            first, node = self._first[tip], self._nodes[tip]
            same = first == self._first[chosen]
            if tip == chosen or (not same and first in told) or len(found) == most:
                continue
            told.add(first)
            run = ""
            with contextlib.suppress(ValueError, KeyError):
                event = self.read(first, pages)[1].event
                run = event.run_id if isinstance(event, RunCreated) else ""
            common = next(self._nodes[one].seq for one in self.path(tip) if one in own_path) if same else 0
            found.append(Other(run, node.seq, tip.hex(), common, node.ends))
        return found


def proven(row: Row) -> Chained | None:
    """A row as a record with a correct hash; None for any other row."""
    seq, c = row
    if len(c) != _COLUMNS or c[0] is not None or not (isinstance(c[10], bytes) and isinstance(c[11], bytes)):
        return None
    values: list[Any] = [*c[1:3], _real(c[3]), _real(c[4]), *c[5:10]]
    record = Record(*values)
    if seq < 1 or not _typed(record):
        return None
    with contextlib.suppress(TypeError, ValueError, OverflowError):
        if link(c[10], seq, record) == c[11]:
            return seq, record, c[10], c[11]
    return None


def _typed(record: Record) -> bool:
    """Whether every column has the type of the table."""
    session, kind, elapsed_s, utc_s, index, whole_plot, attempt, status, body = record
    return (
        type(session) is int
        and type(elapsed_s) is type(utc_s) is float
        and type(kind) is type(body) is str
        and all(value is None or type(value) is int for value in (index, whole_plot, attempt))
        and (status is None or type(status) is str)
    )


def _real(value: object) -> object:
    """A column of real numbers, in which SQLite stores whole numbers as integers."""
    return float(value) if isinstance(value, int) else value
