"""Two runs of any laboratory as one problem: the declared model of every sensor, and the effects found in any."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fitter.arrays import FloatArray
from fitter.confirm import Together
from fitter.confirm.together import Candidates, Own
from fitter.effects.hands import Done
from fitter.errors import FitError
from procedures.general.column_roles import Roles, roles_of
from procedures.general.effects import OF_CONSTANT, TableEffect, effects_of
from procedures.general.effects.of_time import WARM_UP
from procedures.general.effects.scene import Profile, TableScene, TableTerm
from procedures.general.effects.time_columns import previous
from procedures.general.trace import TableData, TableTrace
from procedures.general.trace.places import places_of
from procedures.table import Table

TIME = "elapsed_s"
_NUMBERED = ("replicate", "order", "block", "whole_plot")
"""Columns of numbers that go on in a later run."""
_PERIODIC = "periodic"
_STEP = 1e-3


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


@dataclass(frozen=True)
class Label:
    """One column of a term.

    Attributes:
        name: its formula.
    """

    name: str


@dataclass(frozen=True, eq=False)
class RunTerm:
    """One column of an effect in one sensor.

    Attributes:
        effect: the effect.
        term: the column.
        sensor: its output.
        block: the term of the first run.
        at: number of the column in it.
        slope: whether it is the change of that column with the logarithm of its searched constant.
    """

    effect: TableEffect
    term: Label
    sensor: str
    block: TableTerm
    at: int
    slope: bool = False


def columns_of(effect: TableEffect, block: TableTerm, sensor: str) -> Iterator[RunTerm]:
    """The columns of a term in a sensor, and their slopes over its searched constant: a search knows it about only."""
    slopes = np.zeros(0) if block.profile is None else np.linalg.norm(_slopes(block.profile), axis=0)
    for at, label in enumerate(block.labels):
        yield RunTerm(effect, Label(label), sensor, block, at)
    for at, length in enumerate(slopes.tolist()):
        if length > 0.0:
            yield RunTerm(effect, Label(f"{OF_CONSTANT}{block.labels[at]}"), sensor, block, at, slope=True)


def _slopes(profile: Profile, value: float | None = None) -> FloatArray:
    """(n, d) change of a term's columns with the logarithm of its searched constant."""
    middle = profile.value if value is None else value
    above, below = (profile.at(middle * (1.0 + step)).columns for step in (_STEP, -_STEP))
    return np.asarray((above - below) / (2.0 * _STEP))


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
    columns = {}
    for name in first.columns:
        if name not in later.columns:
            continue
        a, b = first.columns[name], later.columns[name]
        if name in _NUMBERED:
            b = b - b.min() + a.max() + 1
        elif name == TIME:
            b = b + after_s
        columns[name] = np.concatenate([a, b])
    return replace(first, columns=columns, rows=())


@dataclass(frozen=True, eq=False)
class Whole:
    """Both runs, prepared for every sensor.

    Attributes:
        data: of all rows, by output.
        traces: findings in the first run, by output.
        count: number of rows of the first run.
        constants: time constants of explanations that remember earlier settings, by output.
    """

    data: Mapping[str, TableData]
    traces: Mapping[str, TableTrace]
    count: int
    constants: Mapping[str, Sequence[float]]
    _kept: dict[tuple[str, str, tuple[str, ...], bool], FloatArray] = field(default_factory=dict)

    def columns(self, term: RunTerm) -> FloatArray:
        """(n,) the column of a term in all rows."""
        key = term.sensor, term.effect.name, term.block.labels, term.slope
        if key not in self._kept:
            self._kept[key] = self._block(term)
        return self._kept[key][:, term.at]

    def _block(self, term: RunTerm) -> FloatArray:
        """(n, d) the term of the first run in the rows of both."""
        scene, profile = self.data[term.sensor].scene, term.block.profile
        if term.effect.kind.name == WARM_UP.name:
            scene = self._begun_anew(scene)
        kinds = (e for e in effects_of(scene, term.sensor) if e.name == term.effect.name)
        every = (one for effect in kinds for one in effect.terms(scene))
        same = [
            one
            for one in every
            if len(one.labels) == len(term.block.labels) and (one.profile is None) == (profile is None)
        ]
        if not same:
            raise FitError(f"{term.effect.name} cannot be computed for both runs together")
        if profile is None:
            block = next((one for one in same if one.labels == term.block.labels), same[0]).columns.copy()
            if term.effect.kind.terms is previous:
                block[self.count :][:1] = 0.0  # at rest before the first row of a run
            return block
        assert same[0].profile is not None
        value = profile.value * self._longer(term)
        return _slopes(same[0].profile, value) if term.slope else same[0].profile.at(value).columns

    def started(self, output: str) -> FloatArray:
        """(n, c) decays from the first row of the later run on: it is not known what stood before, and for how long."""
        t = self.data[output].scene.of(TIME)
        since = t - t[self.count]
        columns = [np.where(since >= 0.0, np.exp(-np.maximum(since, 0.0) / tau), 0.0) for tau in self._taus(output)]
        return np.column_stack(columns) if columns else np.zeros((len(t), 0))

    def _taus(self, output: str) -> Sequence[float]:
        return self.constants.get(output, ())

    def _longer(self, term: RunTerm) -> float:
        """Span of both runs over that of the first, for constants that count periods in the span; otherwise one."""
        if term.effect.family != _PERIODIC:
            return 1.0
        v = self.data[term.sensor].scene.of(term.effect.columns[0])
        return float(np.ptp(v) / np.ptp(v[: self.count]))

    def _begun_anew(self, scene: TableScene) -> TableScene:
        """The scene with a time that begins anew in the later run."""
        assert scene.time is not None
        t = scene.time.values
        since = np.concatenate([t[: self.count] - t[0], t[self.count :] - t[self.count]])
        return replace(scene, time=replace(scene.time, values=since + t[0]))


@dataclass(frozen=True, eq=False)
class Outputs:
    """Measured outputs of both runs.

    Attributes:
        outputs: (n,) by sensor.
    """

    outputs: Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class GeneralTogether(Together):
    """See `Together`.

    Attributes:
        whole: both runs.
        rows: (n,) rows of them that are used.
    """

    whole: Whole
    rows: NDArray[np.int64]

    @classmethod
    def of(
        cls,
        traces: Mapping[str, TableTrace],
        roles: Mapping[str, Roles],
        first: Table,
        later: Table,
        after_s: float,
        done: Sequence[Done] = (),
        constants: Mapping[str, Sequence[float]] = MappingProxyType({}),
    ) -> Self:
        """A run, its traces, and a later run; both in order of time. `constants` as in `Whole`.

        Raises:
            FitError: the later run lacks a column of the first, or too few rows.
        """
        used = [name for one in roles.values() for name in (one.response, *one.named)]
        both = join(first, later, after_s, list(dict.fromkeys([*used, *first.factors])))
        data = {}
        for output, own in roles.items():
            ignored = tuple(name for name in own.ignore if name in both.columns)
            data[output] = roles_of(both, replace(own, ignore=ignored))[0]
        n, count = len(both), len(first)
        changes = tuple(one.after_first(count) for one in done)
        return cls(np.arange(n) >= count, Whole(data, traces, count, constants), np.arange(n), done=changes)

    @property
    def data(self) -> Outputs:
        """See `Together`."""
        return Outputs({output: one.y[self.rows] for output, one in self.whole.data.items()})

    @property
    def df(self) -> int:
        """See `Together`."""
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
        every = [self.whole.started(output)[self.rows] for output in self.whole.constants]
        return np.column_stack(every) if every else np.zeros((len(self.rows), 0))

    @cached_property
    def sigma(self) -> FloatArray:
        """(S, n) scatter of a row within its whole plot or replication, growing as the trace found."""
        out = []
        for output, trace in self.whole.traces.items():
            sides, growth = trace.after.shared, trace.search.growth
            same = np.full(len(self.rows), sides[0] if sides is not None else trace.after.fit.sigma_E)
            scene = self.whole.data[output].scene
            known = growth is not None and growth.driver in {**scene.variables, TIME: None}
            out.append(growth.sd(scene.of(growth.driver)[self.rows]) if growth is not None and known else same)
        return np.stack(out)

    @property
    def slope(self) -> FloatArray:
        """(S,) one: errors are those of the outputs."""
        return np.ones(len(self.sensors))

    @cached_property
    def declared(self) -> tuple[FloatArray, ...]:
        """See `Together`."""
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
        """See `Together`."""
        raw = np.zeros((len(self.sensors), len(self.rows), len(terms)))
        for k, term in enumerate(terms):
            raw[self.sensors.index(term.sensor), :, k] = self.whole.columns(term)[self.rows]
        return raw

    def shapes(self, *, lasting: bool) -> Iterator[FloatArray]:
        """See `Together`: the places where a trace looks for shapes without a name."""
        for i, one in enumerate(self.whole.data.values()):
            for place in places_of(one.scene, one.shared):
                if lasting and place.timed:
                    continue
                columns = place.block.columns[self.rows] * self.fresh[:, None]
                raw = np.zeros((len(self.sensors), *columns.shape))
                raw[i] = columns
                yield raw

    def only(self, rows: NDArray[np.bool_]) -> Self:
        """See `Together`."""
        kept = np.asarray(rows, np.bool_)
        done = tuple(one.at(kept) for one in self.done)
        return replace(self, fresh=self.fresh[kept], rows=self.rows[kept], done=done)
