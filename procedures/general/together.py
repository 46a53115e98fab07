"""Runs of any laboratory as one problem: the declared model of every sensor, and the effects found in any."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.confirm import Question, Together
from rig.fitter.confirm.runs import Later, changes, numbers
from rig.fitter.confirm.together import Candidates, Own
from rig.fitter.errors import FitError
from rig.fitter.trace.growing_noise import Growth
from rig.procedures.column_names import read_at
from rig.procedures.errors import DataError
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.effects.literal import Rows
from rig.procedures.general.effects.of_time import WARM_UP
from rig.procedures.general.effects.time_columns import BLOCK, MOST_INTERRUPTIONS, interruptions
from rig.procedures.general.own_time import TIME, seen_by
from rig.procedures.general.run_terms import RunTerm
from rig.procedures.general.trace import TableData, TableTrace
from rig.procedures.general.trace.places import places_of
from rig.procedures.tables.table import Table

_NUMBERED = ("replicate", "order", "block", "whole_plot")
"""Columns of numbers that go on in a later run."""
One = TypeVar("One")


@dataclass(frozen=True, eq=False)
class Observations:
    """Rows of a run in order of time; every column is an attribute, for plots.

    Attributes:
        table: the run.
    """

    table: Table

    @classmethod
    def of(cls, table: Table) -> Observations:
        """The rows of a run, sorted by time."""
        order = np.argsort(table.columns[TIME], kind="stable")
        return cls(replace(table, columns={name: v[order] for name, v in table.columns.items()}, rows=()))

    def __getattr__(self, name: str) -> FloatArray:
        if name.startswith("_") or name == "table" or name not in self.table.columns:
            raise AttributeError(name)
        return self.table.columns[name]

    def __len__(self) -> int:
        return len(self.table)


def join(first: Table, later: Table, after_s: float, needed: Sequence[str]) -> Table:
    """Rows of both runs, those of the first one first.

    Args:
        first: the traced run, in order of time.
        later: the confirming run, in order of time.
        after_s: seconds from the first run's zero of elapsed time to the later one's.
        needed: columns that both must have.

    Raises:
        FitError: the later run lacks one of them.
    """
    missing = next((name for name in needed if name not in later.columns), None)
    if missing is not None:
        raise FitError(f"the confirming run has no {missing}, which the traced run has")
    columns, times = {}, {TIME, *map(read_at, first.outputs)}
    for name in first.columns:
        if name not in later.columns:
            continue
        a, b = first.columns[name], later.columns[name]
        if name in _NUMBERED:
            b = b - b.min() + a.max() + 1
        elif name in times:
            b = b + after_s
        columns[name] = np.concatenate([a, b])
    return replace(first, columns=columns, rows=())


@dataclass(frozen=True)
class Remembered:
    """Memory of earlier settings in the explanations of a sensor.

    Attributes:
        constants: their time constants.
        sides: columns with a direction of approach.
    """

    constants: tuple[float, ...] = ()
    sides: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Whole:
    """All runs, prepared for every sensor.

    Attributes:
        table: all rows, in order of time: a replication may have been added to the first run after a further one.
        data: of all rows, by output.
        later: of the later runs' rows alone, by output; without sensors whose model has too many columns for them.
        traces: findings in the first run, by output.
        begins: first row of each run, and of what was added to the first one after a further run.
        remembered: what explanations remember of earlier settings, by output.
        fresh: rows of the later runs.
    """

    table: Table
    data: Mapping[str, TableData]
    later: Mapping[str, TableData]
    traces: Mapping[str, TableTrace]
    begins: tuple[int, ...]
    remembered: Mapping[str, Remembered]
    fresh: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    _kept: dict[tuple[str, str, tuple[float, ...]], FloatArray] = field(default_factory=dict)

    def of(self, outputs: Collection[str]) -> Whole:
        """These runs with some of the sensors only."""
        return replace(
            self,
            data=_some(self.data, outputs),
            later=_some(self.later, outputs),
            traces=_some(self.traces, outputs),
            remembered=_some(self.remembered, outputs),
        )

    def columns(self, term: RunTerm) -> FloatArray:
        """(n,) the column of a term in all rows, as its formula says."""
        key = term.sensor, term.block.labels[term.at], term.slope
        if key not in self._kept:
            self._kept[key] = term.column(self._rows(term.sensor, anew=term.effect.kind.name == WARM_UP.name))
        return self._kept[key]

    def _rows(self, output: str, *, anew: bool) -> Rows:
        """The rows at the times of an output; `anew` with a time that begins anew in every run."""
        columns = seen_by(self.table, output).columns
        t = columns[TIME]
        if anew:
            later = np.isin(self.begins, self.fresh)
            every = zip(np.split(t, self.begins[1:]), later, strict=True)
            t = np.concatenate([rows - rows[0] + t[0] if fresh else rows for rows, fresh in every])
        return Rows({**columns, TIME: t}, t, self.begins)

    def started(self, output: str) -> FloatArray:
        """(n, c) decays from the first row of every later session on: it is not known what stood before, for how long.

        And the first rows of every run, as long as the side of their approach is unknown, if an explanation needs it.
        """
        t, known = self.table.columns[TIME], self.remembered.get(output, Remembered())
        inside = interruptions(self.table.columns.get(BLOCK), MOST_INTERRUPTIONS + len(self.begins) - 1)
        begins = sorted({0, *self.begins, *inside})
        session = np.searchsorted(begins, np.arange(len(t)), side="right") - 1
        since = t - t[begins][session]
        every = itertools.product(range(1, len(begins)), known.constants)
        columns = [np.where(session == k, np.exp(-since / tau), 0.0) for k, tau in every]
        sides = [self.table.columns[name] for name in known.sides if name in self.table.columns]
        run = np.searchsorted(self.begins, np.arange(len(t)), side="right") - 1
        unknown = [(side == 0.0) & (run == k) for side in sides for k in range(len(self.begins))]
        columns += [rows.astype(np.float64) for rows in unknown if rows.any()]
        return np.column_stack([np.zeros((len(t), 0)), *columns])


def _some(every: Mapping[str, One], outputs: Collection[str]) -> Mapping[str, One]:
    return {name: one for name, one in every.items() if name in outputs}


def _those_that_can(table: Table, roles: Mapping[str, Roles]) -> Iterator[tuple[str, TableData]]:
    """Sensors whose declared model a run's rows suffice for, with these rows."""
    for output, own in roles.items():
        try:
            yield output, roles_of(table, own)[0]
        except DataError:
            continue


def _rows_of(table: Table, rows: NDArray[np.int64] | slice) -> Table:
    return replace(table, columns={name: v[rows] for name, v in table.columns.items()}, rows=())


def _in_time(both: Table, order: NDArray[np.int64]) -> Table:
    """All rows in order of time; sessions are counted anew where those of two runs alternate."""
    if np.all(np.diff(order) > 0):
        return both
    both = _rows_of(both, order)
    counted = {BLOCK: np.cumsum(np.diff(both.columns[BLOCK], prepend=np.nan) != 0)} if BLOCK in both.columns else {}
    return replace(both, columns={**both.columns, **{name: v.astype(np.float64) for name, v in counted.items()}})


@dataclass(frozen=True, eq=False)
class Outputs:
    """Measured outputs of both runs.

    Attributes:
        outputs: (n,) by sensor.
    """

    outputs: Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class GeneralTogether(Together):
    """Two or more runs of a table with one question, sensors by column.

    Attributes:
        whole: both runs.
        rows: (n,) rows of them that are used, those of the first run first.
    """

    whole: Whole
    rows: NDArray[np.int64]

    @classmethod
    def of(
        cls,
        traces: Mapping[str, TableTrace],
        roles: Mapping[str, Roles],
        first: Table,
        later: Sequence[Later],
        remembered: Mapping[str, Remembered] = MappingProxyType({}),
    ) -> Self:
        """A run, its traces, and later runs; all in order of time. `remembered` as in `Whole`.

        Raises:
            FitError: a later run lacks a column of the first, or too few rows.
        """
        used = [name for one in roles.values() for name in (one.response, *one.named)]
        needed = list(dict.fromkeys([*used, *first.factors]))
        both = first
        for one in later:
            both = join(both, one.data.table, one.after_s, needed)
        every = {
            output: replace(own, ignore=tuple(name for name in own.ignore if name in both.columns))
            for output, own in roles.items()
        }
        run, fresh = numbers(len(first), later), dict(_those_that_can(_rows_of(both, slice(len(first), None)), every))
        order = np.argsort(both.columns[TIME], kind="stable")
        both = _in_time(both, order)
        data = {output: roles_of(both, own)[0] for output, own in every.items()}
        begins = (0, *(np.flatnonzero(np.diff(run[order])) + 1).tolist())
        whole = Whole(both, data, fresh, traces, begins, remembered, np.flatnonzero(run[order]))
        return cls(run, whole, np.argsort(order, kind="stable"), done=changes(len(first), later))

    @property
    def data(self) -> Outputs:
        """Observations of both runs."""
        return Outputs({output: one.y[self.rows] for output, one in self.whole.data.items()})

    @property
    def df(self) -> int:
        """Degrees of freedom of the error's estimate."""
        return max(min(trace.after.fit.df for trace in self.whole.traces.values()), 1)

    @property
    def realigned(self) -> bool:
        """False: the first run's parameters are valid."""
        return False

    @property
    def own_response(self) -> bool:
        """True: a sensor may have changed from one day to the next."""
        return True

    @property
    def loose(self) -> FloatArray:
        """(n, l) what is remembered at the start of the later run; nothing else, as the sensors will be used."""
        every = [self.whole.started(output)[self.rows] for output in self.whole.remembered]
        return np.column_stack(every) if every else np.zeros((len(self.rows), 0))

    @cached_property
    def sigma(self) -> FloatArray:
        """(S, n) scatter of a row within its whole plot or replication, growing as the trace found."""
        out = []
        for output, trace in self.whole.traces.items():
            sides, growth = trace.after.shared, trace.search.growth
            same = np.full(len(self.rows), sides[0] if sides is not None else trace.after.fit.sigma_E)
            scene = self.whole.data[output].scene
            if isinstance(growth, Growth) and growth.driver in {**scene.variables, TIME: None}:
                same = growth.sd(scene.of(growth.driver)[self.rows])
            out.append(same)
        return np.stack(out)

    @property
    def slope(self) -> FloatArray:
        """(S,) one: errors are those of the outputs."""
        return np.ones(len(self.sensors))

    @cached_property
    def declared(self) -> tuple[FloatArray, ...]:
        """(n, d) columns of the declared model, for each sensor."""
        return tuple(
            np.column_stack(
                [one.columns[self.rows], self._anew(one.columns[self.rows]), self.whole.started(output)[self.rows]]
            )
            for output, one in self.whole.data.items()
        )

    def _anew(self, columns: FloatArray) -> FloatArray:
        """(n, k d) the declared model again after every change with which it changes."""
        after = [done.after.astype(np.float64)[:, None] * columns for done in self.done if done.anew]
        return np.column_stack(after) if after else np.zeros((len(columns), 0))

    @cached_property
    def own(self) -> tuple[tuple[Own, ...], ...]:
        """Errors that the rows of a whole plot or replication share."""
        out: list[tuple[Own, ...]] = []
        for i, (output, trace) in enumerate(self.whole.traces.items()):
            groups, sides = self.whole.data[output].shared, trace.after.shared
            if groups is None or sides is None or not sides[1] > 0.0:
                out.append(())
                continue
            index = groups[self.rows]
            every = [np.flatnonzero(index == k) for k in np.unique(index)]
            out.append(tuple(Own.of(rows, (sides[1] / self.sigma[i][rows])[:, None]) for rows in every))
        return tuple(out)

    def untouched(self, terms: Candidates) -> FloatArray:
        """(S, n, q) unweighted columns of effects as if nobody changed the bench, zero for sensors without the term."""
        raw = np.zeros((len(self.sensors), len(self.rows), len(terms)))
        for k, term in enumerate(terms):
            raw[self.sensors.index(term.sensor), :, k] = self.whole.columns(term)[self.rows]
        return raw

    def about(self, question: Question) -> tuple[Together, Question]:
        """The runs and a question without sensors that have no part in it; as they are if any may have one. Sensors are
        independent, so only those with a column of an explanation have a part in it.
        """
        concerned = {term.sensor for member in question.members for term in member.terms}
        if concerned >= set(self.sensors):
            return self, question
        rest = tuple(term for term in question.rest if term.sensor in concerned)
        return replace(self, whole=self.whole.of(concerned)), replace(question, rest=rest)

    def shapes(self, *, lasting: bool) -> Iterator[tuple[str, FloatArray]]:
        """(S, n, m) smooth unweighted columns over what was recorded in the later run, each place after its name. The
        places where a trace looks for shapes without a name.
        """
        fresh = np.searchsorted(self.whole.fresh, self.rows[self.fresh])
        for output, one in self.whole.later.items():
            for place in places_of(one.scene, one.shared):
                if lasting and place.timed:
                    continue
                raw = np.zeros((len(self.sensors), len(self.rows), place.block.columns.shape[1]))
                raw[self.sensors.index(output), self.fresh] = place.block.columns[fresh]
                yield place.text, raw

    def only(self, rows: NDArray[np.bool_]) -> Self:
        """These runs with some of the observations only."""
        kept = np.asarray(rows, np.bool_)
        done = tuple(one.at(kept) for one in self.done)
        return replace(self, run=self.run[kept], rows=self.rows[kept], done=done)
