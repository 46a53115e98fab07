"""Readings that a person takes at a point: which is wanted next, and what was typed.

What was typed for a point stays until the point has been observed, also after a kill: the rest is asked for.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median

from rig.bench.typed import TypedColumn, typed_columns
from rig.drivers.roles import Typing
from rig.engine.journal import Journal
from rig.instruments.opening import Bench
from rig.procedures.column_names import spelled, split_unit
from rig.procedures.plan.conduct import Conduct
from rig.procedures.plan.run_list import Point, RunList
from rig.run_file.events.points import Observed
from rig.run_file.state.own_scatter import KEPT

_FAR_RESOLUTIONS, _FAR_OF_RANGE = 5.0, 0.02
"""A reading is far from the others at its setting beyond the larger of these: in resolutions, and as a part of the
range of all readings of its column."""


@dataclass
class ToRead:
    """One reading that a person is asked for.

    Attributes:
        column: what is read.
        number: ordinal of the reading of this column at this point, from 1.
        instruction: what to do, without a full stop.
        others: values of the column at the same setting, of earlier observations.
        far: largest difference from their median that needs no confirmation, in the column's unit.
        confirmed: whether the last accepted answer was far from these, and given twice.
    """

    column: TypedColumn
    number: int
    instruction: str
    others: Sequence[float]
    far: float
    confirmed: bool = False
    _doubtful: float | None = field(default=None, init=False)

    def refuses(self, value: str | None) -> str:
        """Why an answer is refused, as a sentence; "" if it is accepted. One that is far off has to be given twice."""
        number = self.column.number(value)
        if isinstance(number, str):
            return number
        found, self.confirmed = self.column.value(number), False
        if not self.others or abs(found - median(self.others)) <= self.far:
            return ""
        self.confirmed = number == self._doubtful
        self._doubtful = number
        name, middle = self.column.name, median(self.others)
        near = f"{name} was {middle:.6g} at this setting before ({len(self.others)} readings)"
        return "" if self.confirmed else f"{number:.12g} is far off: {near}; if it is right, give it once more"


class ReadByHand:
    """Readings by hand in this session.

    Args:
        bench: opened instruments.
        run_list: every point.
        conduct: has limits of scatter.
        journal: has what was typed and observed before.

    Attributes:
        columns: what a person reads, by name.
    """

    def __init__(self, bench: Bench, run_list: RunList, conduct: Conduct, journal: Journal) -> None:
        self._bench, self._run_list, self._journal = bench, run_list, journal
        self.columns = typed_columns(bench.config, conduct)
        self._anew: set[str] = set()
        self._seen: dict[tuple[str, tuple[float, ...]], list[float]] = defaultdict(list)
        for record in journal.recent(KEPT) if self.columns else ():
            if isinstance(record.event, Observed) and record.run_index is not None:
                self.observed(run_list.points[record.run_index], record.event.every_reading)

    def observed(self, point: Point, readings: Mapping[str, Sequence[float]]) -> None:
        """A point was observed; its readings, by column."""
        for name in self.columns:
            self._seen[name, self._setting(point)].extend(readings.get(name, ()))

    def _setting(self, point: Point) -> tuple[float, ...]:
        return tuple(self._run_list.setting(point).values())

    def begin_anew(self, columns: Sequence[str]) -> None:
        """These columns are to be read again at the present point."""
        self._anew.update(columns)

    def _typed(self, point: Point, name: str) -> Sequence[float]:
        return () if name in self._anew else self._journal.fold.typed.get(point.index, {}).get(name, ())

    def missing(self, point: Point) -> ToRead | None:
        """The next reading that a person has to take at a point; None if all are there."""
        for name, column in self.columns.items():
            typed = self._typed(point, name)
            if not column.complete(typed):
                values = [value for (seen, _), group in self._seen.items() if seen == name for value in group]
                step = abs(column.value(column.resolution) - column.value(0.0))
                far = max(_FAR_RESOLUTIONS * step, _FAR_OF_RANGE * (max(values) - min(values)) if values else 0.0)
                others = tuple(self._seen.get((name, self._setting(point)), ()))
                return ToRead(column, len(typed) + 1, self._instruction(column, typed, point), others, far)
        return None

    def _instruction(self, column: TypedColumn, typed: Sequence[float], point: Point) -> str:
        parts = ((split_unit(name), value) for name, value in self._run_list.setting(point).items())
        where = ", ".join(f"{stem.replace('_', ' ')} {value:.12g} {spelled(unit)}" for (stem, unit), value in parts)
        unit = spelled(column.unit)
        task = f"read {column.name} ({column.channel}) in {unit} at {where}"
        if not typed:
            return task
        if len(typed) == 1:
            return f"{task}, a second time: look away first, and read it anew"
        return f"{task}, a third time: {typed[0]:.12g} and {typed[1]:.12g} {unit} differ"

    def read(self, column: TypedColumn) -> None:
        """A reading of a column was recorded."""
        self._anew.discard(column.name)

    def hand_over(self, point: Point) -> Sequence[str]:
        """Give the instruments what was typed for a point. Returns columns of which no two readings agree."""
        by_reader: dict[str, dict[str, Sequence[float]]] = defaultdict(dict)
        apart = []
        for name, column in self.columns.items():
            counting = column.counting(self._typed(point, name))
            by_reader[column.reader][column.channel] = counting
            if len(counting) > 2:
                apart.append(name)
        for reader, typed in by_reader.items():
            person = self._bench.instruments[reader]
            assert isinstance(person, Typing)
            person.take(typed)
        return apart
