"""Which chains of records the pages of a run file still prove, and which of them is the run.

Pages may hold several: a log of another run lies beside the file, or of a copy that was resumed elsewhere, or what was
begun and not committed when the power went. A record's hash covers its number and the hash of the one before, so that
the records that hold form trees; every path from a first record on is a chain.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rig.run_file.chain import GENESIS, Record, link
from rig.run_file.events.sessions import Ended, RunCreated
from rig.run_file.pages import Pages, Place, Row

_COLUMNS = 12
Chained = tuple[int, Record, bytes, bytes]
"""Number, record, hash of the one before, own hash."""


class _Node(NamedTuple):
    seq: int
    previous: bytes
    place: Place
    ends: bool


@dataclass(frozen=True)
class Other:
    """A chain that was found and not restored.

    Attributes:
        run: the run's id, "" if its first record does not say.
        records: how many.
        head: hash of its last one, hexadecimal.
        same_until: the last record that it has in common with the restored one, 0 if it is of another run.
        ended: whether its last record ends the run.

    """

    run: str
    records: int
    head: str
    same_until: int
    ended: bool


@dataclass
class Chains:
    """Every record that has its hash, by that, and what they form.

    Attributes:
        documents: where the texts are, by name and digest.

    """

    documents: dict[tuple[str, str], list[Place]] = field(default_factory=lambda: defaultdict(list))
    _nodes: dict[bytes, _Node] = field(default_factory=dict)
    _claims: dict[bytes, bytes] = field(default_factory=dict)
    _first: dict[bytes, bytes] = field(default_factory=dict)

    @classmethod
    def found_in(cls, pages: Pages) -> Chains:
        """Look through all pages. Raises RunFileError if they lead in circles."""
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
        """Whether the cell needs no other reading."""
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
        """The last record of every chain that begins with a first one, the longest first, ended before not ended.

        Args:
            head: only of chains with a record whose hash begins so.

        """
        inner = {self._nodes[own].previous for own in self._first}
        tips = [own for own in self._first if own not in inner]
        if head:
            having: set[bytes] = set()
            for own in self._first:  # those before come first
                if own.hex().startswith(head) or self._nodes[own].previous in having:
                    having.add(own)
            tips = [own for own in tips if own in having]
        return sorted(tips, key=lambda own: (-self._nodes[own].seq, not self._nodes[own].ends, self._nodes[own].place))

    def first(self, own: bytes) -> bytes:
        """The first record of the chain that a record is in."""
        return self._first[own]

    def path(self, tip: bytes) -> list[bytes]:
        """The hashes of a chain, from its last record back to the first."""
        path = [tip]
        while (previous := self._nodes[path[-1]].previous) != GENESIS:
            path.append(previous)
        return path

    def read(self, own: bytes, pages: Pages) -> Chained:
        """A record, from where it was found."""
        for row in pages.rows(self._nodes[own].place):
            chained = proven(row)
            if chained is not None and chained[3] == own:
                return chained
        raise OSError("the file changed while it was read")

    def known(self, first: bytes, last: tuple[int, bytes] | None) -> int:
        """The highest number of a record that is known to be of a run, whether its chain holds or not.

        Args:
            first: the run's first record.
            last: number and hash of a last record, as said elsewhere.

        """
        alone = len(set(self._first.values())) == 1  # what leads nowhere is this run's if there is no other
        belongs: dict[bytes, bytes | None] = dict(self._first)
        said = {last[1]: last[0]} if last is not None and last[1] not in self._nodes else {}
        highest = 0
        for own, seq in [*((own, node.seq) for own, node in self._nodes.items()), *said.items()]:
            way, at = [], own
            while at not in belongs:
                belongs[at] = None  # a way that comes back leads nowhere
                way.append(at)
                at = self._nodes[at].previous if at in self._nodes else self._claims.get(at, GENESIS)
            of = belongs[at]
            belongs.update(dict.fromkeys(way, of))
            if of == first or (of is None and alone):
                highest = max(highest, seq)
        return highest

    def others(self, chosen: bytes, pages: Pages, most: int) -> list[Other]:
        """Chains beside the chosen one: of its run every one, of other runs the longest."""
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
    """A row as a record of a run file that has its hash; None if it is none."""
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
    """Whether every column is of the type that the table asks for."""
    session, kind, elapsed_s, utc_s, index, whole_plot, attempt, status, body = record
    return (
        type(session) is int
        and type(elapsed_s) is type(utc_s) is float
        and type(kind) is type(body) is str
        and all(value is None or type(value) is int for value in (index, whole_plot, attempt))
        and (status is None or type(status) is str)
    )


def _real(value: object) -> object:
    """A column of real numbers, where whole ones are stored as such."""
    return float(value) if isinstance(value, int) else value
