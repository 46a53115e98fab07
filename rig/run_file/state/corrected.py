"""Corrections of typed entries. Readings of instruments stay as they were recorded."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

from rig.bench.typed import TypedColumn
from rig.errors import UsageError
from rig.procedures.plan.run_list import RunList
from rig.run_file.bodies import ContentsError
from rig.run_file.chain import Record
from rig.run_file.events.by_hand import ReadByHand
from rig.run_file.events.corrections import Corrected
from rig.run_file.events.event import Event
from rig.run_file.events.points import Observed
from rig.run_file.read.reader import RunReader

_Place = tuple[int | None, int | None, str]
"""Point, whole plot and column."""


class Entries:
    """Typed entries of accepted observations as they stand, in the typed units, by point, whole plot and column.

    Args:
        columns: what a person reads.
    """

    def __init__(self, columns: Mapping[str, TypedColumn]) -> None:
        self._columns = columns
        self._typed: dict[tuple[int | None, str], list[float]] = {}
        self.stands: dict[_Place, list[float]] = {}

    def look(self, record: Record, event: Event, _fold: object = None) -> Iterator[str]:
        """Take the next record. Yields why a correction is none of these entries, as ends of sentences."""
        match event:
            case ReadByHand():
                typed = self._typed.setdefault((record.run_index, event.column), [])
                typed[max(event.number - 1, 0) :] = [event.typed]
            case Observed():
                for name, column in self._columns.items():
                    typed = self._typed.pop((record.run_index, name), [])
                    if event.accepted:
                        self.stands[record.run_index, record.whole_plot, name] = list(column.counting(typed))
            case Corrected() if self._columns:
                yield from self._corrected(record, event)

    def _corrected(self, record: Record, event: Corrected) -> Iterator[str]:
        stands = self.stands.get((record.run_index, record.whole_plot, event.column), [])
        if not 1 <= event.number <= len(stands):
            yield f"no entry {event.number} of {event.column} was typed at its point"
            return
        if stands[event.number - 1] != event.old:
            yield f"the entry that it corrects is {stands[event.number - 1]!r}, not {event.old!r}"
        stands[event.number - 1] = event.new
        value = self._columns[event.column].value
        if [*event.readings] != [value(one) for one in stands]:
            yield f"its readings of {event.column} do not follow from the entries"


def correction(
    reader: RunReader, columns: Mapping[str, TypedColumn], point: int, said: str, which: int | None
) -> tuple[int | None, Corrected]:
    """A correction of the last accepted observation of a point: its whole plot, and the event without its reason.

    Args:
        reader: the run.
        columns: what a person reads.
        point: index of the point.
        said: `gauge_bar=12.3`.
        which: ordinal of the entry, if several were typed.

    Raises:
        UsageError: there is no such entry, or the value is refused.
    """
    name = said.partition("=")[0].strip()
    if name not in columns:
        known = ", ".join(columns) or "nothing in this run"
        raise UsageError(
            f"{name!r:.60} was not typed: only what a person read can be corrected ({known}); readings of instruments "
            f"stay as they are"
        )
    entries = Entries(columns)
    for record in reader.records():
        for _ in entries.look(record, record.event):
            pass
    places = [place for place in entries.stands if place[0] == point and place[2] == name]
    if not places:
        raise UsageError(f"point {point} has no accepted observation with {name}")
    column, stands = columns[name], entries.stands[places[-1]]
    if which is None and len(stands) > 1:
        typed = ", ".join(f"{number}: {one:.12g}" for number, one in enumerate(stands, 1))
        raise UsageError(f"{name} was typed {len(stands)} times at point {point} ({typed}): say which, --reading N")
    number = which or 1
    if not 1 <= number <= len(stands):
        raise UsageError(f"--reading {number}: {name} has {len(stands)} entries at point {point}")
    new = column.number(said if "=" in said else None)
    if isinstance(new, str):
        raise UsageError(new.replace("--value ", ""))
    old = stands[number - 1]
    if new == old:
        raise UsageError(f"{name} at point {point} is {old:.12g} {column.unit} already; nothing was recorded")
    stands[number - 1] = new
    readings = [column.value(one) for one in stands]
    event = Corrected(column=name, number=number, unit=column.unit, old=old, new=new, readings=readings, why="", who="")
    return places[-1][1], event


class Corrections:
    """Corrections of a run, by its records.

    Args:
        records: of the run; others than corrections are left out, and those that a damaged file cannot tell.
        run_list: its points.

    Attributes:
        told: one sentence for each, with the day, and the setting of the point.
    """

    def __init__(self, records: Iterable[Record], run_list: RunList) -> None:
        self._by_place: dict[tuple[int | None, int | None], dict[str, Sequence[float]]] = {}
        self.told: list[str] = []
        for record in records:
            with contextlib.suppress(ContentsError):
                event = record.event if record.kind == Corrected.kind else None
                if isinstance(event, Corrected):
                    self._by_place.setdefault((record.run_index, record.whole_plot), {})[event.column] = event.readings
                    day = datetime.fromtimestamp(record.utc_s, UTC).date()
                    self.told.append(f"{record.sentence()} ({_setting(run_list, record.run_index)}on {day})")

    def seen(self, record: Record) -> Observed:
        """An observation with its corrected values; the channels of instruments as they were recorded."""
        observed = record.event
        assert isinstance(observed, Observed)
        found = self._by_place.get((record.run_index, record.whole_plot)) if record.accepted else None
        if not found:
            return observed
        return replace(
            observed,
            outputs=_with(observed.outputs, found),
            temperatures=_with(observed.temperatures, found),
            references=_with(observed.references, found),
        )


def _with(
    group: Mapping[str, Mapping[str, Any]], readings: Mapping[str, Sequence[float]]
) -> Mapping[str, Mapping[str, Any]]:
    return {name: _channel(readings[name]) if name in readings else one for name, one in group.items()}


def _channel(readings: Sequence[float]) -> Mapping[str, Any]:
    n, mean = len(readings), math.fsum(readings) / len(readings)
    sd = math.sqrt(math.fsum((one - mean) ** 2 for one in readings) / (n - 1)) if n > 1 else 0.0
    return {"mean": mean, "sd": sd, "readings": [*readings]}


def _setting(run_list: RunList, point: int | None) -> str:
    """The setting of a point, for people, before what follows; "" for a point that a damaged file cannot tell."""
    if point is None or not 0 <= point < len(run_list):
        return ""
    told = run_list.told(run_list.points[point])
    return f"{told}; " if told else ""
