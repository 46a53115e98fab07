"""The audit of a run file: every defect, its place, and the change behind it as far as it can be found.

A hash shows that something was changed, not what. But a record is mostly short words and numbers. If another possible
value of one column restores the hash, the change and the original value are known.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

import apsw

from rig.errors import RunFileError
from rig.procedures.plan.run_list import RunList
from rig.run_file.bodies import COUNT, ContentsError
from rig.run_file.chain import GENESIS, Record, StoredRow, followed, link
from rig.run_file.contents import senseless
from rig.run_file.damage.what_changed import changed_column
from rig.run_file.events.corrections import Corrected
from rig.run_file.events.event import Event
from rig.run_file.events.sessions import Ended, RunCreated
from rig.run_file.schema import Guarded, Stored, differences
from rig.version import VERSION

_SEARCHED = 10
"""Maximum number of changed records in which the change is searched for."""

Row = tuple[int, Record, bytes, bytes]
End = tuple[int, Record, bytes]
Expand = Callable[[Mapping[str, str]], RunList | None]


@dataclass(frozen=True)
class Finding:
    """One defect.

    Attributes:
        where: "file", "schema", "record", "document", "run list", "log", "head" or "sense".
        what: a sentence.
        record: sequence number of its record, if any.
        kind: kind of that record.
        point: its point of the run list, if any.
        column: the changed column, if known.
        name: name of the document or object of the schema.

    """

    where: str
    what: str
    record: int | None = None
    kind: str | None = None
    point: int | None = None
    column: str | None = None
    name: str | None = None

    def __str__(self) -> str:
        at = "" if self.point is None else f" of point {self.point}"
        if self.where == "record":
            return f"record {self.record} ({self.kind}{at}) {self.what}"
        if self.where == "sense":
            return f"record {self.record} ({self.kind}{at}) makes no sense: {self.what}"
        return f"{self.where}: {self.what}" if self.name is None else f"{self.name} {self.what}"


class Contents(Protocol):
    """Methods of a reader that the audit uses."""

    @property
    def guarded(self) -> Guarded:
        """Runs statements."""

    def documents(self) -> dict[str, str]:
        """File texts by name."""

    def run_list(self) -> RunList:
        """Every point."""

    def run_list_sha256(self) -> str:
        """Hash of the points as they are stored."""

    def chained(self, where: str = "1", values: tuple[Stored, ...] = ()) -> Iterator[Row]:
        """Rows in order."""

    def record_rows(self) -> Iterator[list[StoredRow]]:
        """All rows in order, a few hundred at a time."""

    def head(self) -> tuple[int, bytes]:
        """Number of records and the last one's hash."""


def findings(
    run: Contents,
    *,
    thorough: bool,
    expand: Expand = lambda _: None,
    each: Callable[[Record], object] = lambda _: None,
) -> Iterator[Finding]:
    """Yield the defects, one after the other; none if the file is sound.

    Args:
        run: the file.
        thorough: check every index entry, and search for the change in each changed record.
        expand: generates the run list from the stored documents, to find the changed points.
        each: called with every record that follows its predecessor and has the right hash.

    """
    ends: list[End] = []
    parts = (
        _file(run, thorough),
        _records(run, thorough, each, ends),
        _genesis(run, thorough, expand, ends),
        _schema(run),
    )
    for part in parts:
        try:
            yield from part
        except RunFileError as error:
            yield Finding("file", str(error).split(". ", 1)[0])
        except (apsw.Error, UnicodeDecodeError) as error:
            yield Finding("file", f"it cannot be read: {type(error).__name__}: {str(error)[:200]}")


def _file(run: Contents, thorough: bool) -> Iterator[Finding]:
    check = "PRAGMA integrity_check(100)" if thorough else "PRAGMA quick_check(1)"
    for (answer,) in run.guarded.rows(check):
        if answer != "ok":
            yield Finding("file", f"SQLite finds it damaged: {str(answer)[:300]}")


def _schema(run: Contents) -> Iterator[Finding]:
    for what, about in differences(run.guarded):
        yield Finding("schema", about, name=what)


def _points(run: Contents) -> int:
    return int(next(run.guarded.rows("SELECT count(*) FROM point"))[0])


def _records(run: Contents, thorough: bool, each: Callable[[Record], object], ends: list[End]) -> Iterator[Finding]:
    """Defects of records and chain; end records are added to `ends`."""
    points = _points(run)
    sound, expected, broken_at = _sound(run, points, each, ends)
    if broken_at is None:
        if not sound:
            yield Finding("file", "it holds no records")
        return
    expected_seq, searched = sound + 1, 0
    before = (sound, False) if sound else None
    rows = run.chained("seq >= ?", (broken_at,))
    here = next(rows, None)
    while here is not None:
        after = next(rows, None)
        seq, record, previous, own = here
        if record.kind == Ended.kind:
            ends.append((seq, record, previous))
        if seq == expected_seq and previous == expected and _holds(here, points):
            each(record)
            before = (seq, False)
            expected_seq, expected = seq + 1, own
            here = after
            continue
        if seq != expected_seq:
            gone = f"records {expected_seq} to {seq - 1} are" if seq - expected_seq > 1 else f"record {seq - 1} is"
            yield Finding("record", f"follows record {expected_seq - 1}: {gone} missing", seq, _kind(record))
            broken = True
        else:
            search = thorough and searched < _SEARCHED
            broken = False
            for found in _record(here, expected, after, points, search, before):
                searched += search
                broken = True
                yield found
        before = (seq, broken)
        expected_seq, expected = seq + 1, own
        here = after


def _sound(
    run: Contents, points: int, each: Callable[[Record], object], ends: list[End]
) -> tuple[int, bytes, int | None]:
    """Follow the chain up to its first defect; a sound file has none.

    Returns:
        Number of sound records, hash of the last one, and number of the first defective record (None: no defect).

    """
    sound, head = 0, GENESIS
    for rows in run.record_rows():
        good = followed(rows, sound + 1, head)
        for row in rows[:good]:
            record = Record._make(row[1:10])
            if senseless(record, points) is not None:
                return sound, head, row[0]
            each(record)
            if record.kind == Ended.kind:
                ends.append((row[0], record, row[10]))
            sound, head = row[0], row[11]
        if good < len(rows):
            return sound, head, rows[good][0]
    return sound, head, None


def _holds(row: Row, points: int) -> bool:
    """Whether a record that follows its predecessor has valid contents and the right hash."""
    seq, record, previous, own = row
    return senseless(record, points) is None and link(previous, seq, record) == own


def _record(
    row: Row, expected: bytes, after: Row | None, points: int, search: bool, before: tuple[int, bool] | None
) -> Iterator[Finding]:
    seq, record = row[:2]

    def finding(what: str, column: str | None = None) -> Finding:
        return Finding("record", what, seq, _kind(record), _point(record), column)

    wrong, change = senseless(record, points), None
    with contextlib.suppress(TypeError, ValueError):  # a value of a type that no record has cannot be hashed
        change = changed_column(row, expected, None if after is None else after[2], points, search)
    if change is not None and change.column == "predecessor":
        if before is None or before[1]:
            return  # the defect is in the record before, and has been reported
        yield finding(
            f"does not follow the record before it: record {before[0]} was replaced with a hash of its own, or "
            f"something was removed or inserted there"
        )
    elif change is not None:
        yield finding(change.what, change.column)
    elif wrong is not None:
        yield finding(f"makes no sense: {wrong[1]}", wrong[0])


def _kind(record: Record) -> str:
    """The stored kind, of any type, as text."""
    return str(record.kind)[:40]


def _point(record: Record) -> int | None:
    return record.run_index if COUNT.holds(record.run_index) else None


def _genesis(run: Contents, thorough: bool, expand: Expand, ends: list[End]) -> Iterator[Finding]:
    first = next(run.chained("seq = 1"), None)
    if first is None:
        yield Finding("file", "its first record, which says what the run is, is missing")
        return
    if first[1].kind != RunCreated.kind:
        yield Finding("file", f"its first record is of kind {_kind(first[1])}, not what a run begins with")
        return
    declared = _event(first[1])
    if not isinstance(declared, RunCreated):
        return  # its defect has been reported
    documents = run.documents()
    intact = dict(documents)
    for name, digest in declared.documents.items():
        if name not in documents:
            yield Finding("document", "is missing: the run began with it", name=f"document {name}")
        elif hashlib.sha256(documents[name].encode()).hexdigest() != digest:
            del intact[name]
            yield Finding("document", "is not the one the run began with", name=f"document {name}")
    for name in sorted(documents.keys() - declared.documents.keys()):
        yield Finding("document", "was added: the run began without it", name=f"document {name}")
    yield from _run_list(run, declared, expand(intact) if thorough else None)
    yield from _twice(run)
    yield from _end(run, ends)


def _event(record: Record) -> Event | None:
    with contextlib.suppress(ContentsError):
        return record.event
    return None


def _run_list(run: Contents, declared: RunCreated, planned: RunList | None) -> Iterator[Finding]:
    yield from _factors(run)
    stored = ""
    with contextlib.suppress(ValueError, TypeError):
        stored = run.run_list_sha256()
    if stored == declared.run_list:
        points = _points(run)
        if points != declared.points:
            yield Finding("run list", f"it has {points} points, the run was created with {declared.points}")
        elif planned is not None and declared.software.get("calibration-rig") == VERSION and planned.sha256() != stored:
            yield Finding("run list", "the run list is not the one that the stored procedure makes")
            yield from _points_changed(run, planned)
        return
    told = False
    if planned is not None and planned.sha256() == declared.run_list:
        for finding in _points_changed(run, planned):
            told = True
            yield finding
    if not told:
        yield Finding("run list", "the run list is not the one the run began with")


def _factors(run: Contents) -> Iterator[Finding]:
    """Changes that the hash of the run list does not cover, because their meaning is the same: gaps in positions, a
    true value other than 1.
    """
    for at, row in enumerate(run.guarded.rows("SELECT name, position, hard, stays FROM factor ORDER BY position")):
        name, position, *answers = row
        if position != at:
            yield Finding("run list", f"factor {str(name)[:40]}: position is {position}, the run began with {at}")
        for column, stored in zip(("hard", "stays"), answers, strict=True):
            if stored not in (0, 1):
                yield Finding("run list", f"factor {str(name)[:40]}: {column} is {stored}, which is neither 0 nor 1")


def _points_changed(run: Contents, planned: RunList) -> Iterator[Finding]:
    names = [f.name for f in planned.factors]
    columns = ["run_index", "replication", "whole_plot", *names, *(f"{name}_side" for name in names)]
    quoted = ", ".join(f'"{column}"' for column in columns)
    rows = {row[0]: row for row in run.guarded.rows(f"SELECT {quoted} FROM point")}
    for point in planned.points:
        row = rows.pop(point.index, None)
        if row is None:
            yield Finding("run list", f"point {point.index} is missing", point=point.index)
            continue
        expected = (point.index, point.replication, point.whole_plot, *point.setpoints, *point.sides)
        for column, was, is_now in zip(columns, expected, row, strict=True):
            if was != is_now:
                yield Finding(
                    "run list",
                    f"point {point.index}: {column} is {str(is_now)[:40]}, the run began with {was}",
                    point=point.index,
                    column=column,
                )
    for index in sorted(rows):
        yield Finding("run list", f"point {index} was added", point=index)
    factors = run.guarded.rows("SELECT name, axis, overtravel, hard, stays FROM factor ORDER BY position")
    for factor, stored in zip(planned.factors, factors, strict=False):
        began = (factor.name, factor.axis, factor.overtravel, int(factor.hard), int(factor.stays))
        if began != stored:
            yield Finding("run list", f"factor {factor.name} is {str(stored)[:80]}, the run began with {began}")


def _twice(run: Contents) -> Iterator[Finding]:
    grouped = (
        "FROM record WHERE kind = 'observation' AND status = 'accepted' "
        "GROUP BY run_index, ifnull(whole_plot, 0) HAVING count(*) > 1"
    )
    if not list(run.guarded.rows(f"SELECT run_index {grouped} LIMIT 1")):  # answered by the index alone
        return
    for index, whole_plot, numbers in run.guarded.rows(f"SELECT run_index, whole_plot, group_concat(seq) {grouped}"):
        where = "" if whole_plot is None else f" in whole plot {whole_plot}"
        point = index if COUNT.holds(index) else None
        yield Finding(
            "record", f"is one of several accepted observations{where}: records {numbers}", None, "observation", point
        )


def _end(run: Contents, ends: list[End]) -> Iterator[Finding]:
    last, _ = run.head()
    for seq, record, previous in ends:
        end = _event(record)
        if not isinstance(end, Ended) or (end.records, end.head) != (seq - 1, previous.hex()):
            yield Finding("record", "does not count the records before it: some were added or removed", seq, "end")
    if ends and ends[-1][0] != last:
        later = [r for _, r, _, _ in run.chained("seq > ?", (ends[-1][0],)) if r.kind != Corrected.kind]
        if later:
            yield Finding("record", f"is the end of the run, and {len(later)} record(s) follow", ends[-1][0], "end")
