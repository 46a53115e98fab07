"""Points that a loop adds for its goal: those at which the declared model tells most of the aimed values.

An aimed value is linear in the observations, so its variance by scatter is c' M^-1 c: M is the information of all
observations, c its change with each coefficient of the declared model. Chosen are the settings whose observations make
the largest of these variances, over its goal, smallest: a c-optimal design, or a minimax one of several values
(Atkinson, Donev and Tobias, Optimum Experimental Designs, with SAS, 2007, section 10.3), beside the observations made.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.confirm.together import Together
from rig.loop.goal_of_results import Made
from rig.procedures.plan.further_runs import Variation
from rig.verbs.confirm import First
from rig.verbs.confirm.choosing import groups_of

PART = 0.25
"""Points added at once, as a part of those of a replication; of a run with whole plots one whole plot."""
_PRIOR = 1e-9
"""Part of the information that makes parameters computable which no observation determines."""
_MOVED = 1e-3
"""Standard deviations of a reading by which outputs are moved to find what a value is made of."""


@dataclass(frozen=True, eq=False)
class BestPoints:
    """Points that are added.

    Attributes:
        run: with these points.
        hours: its bench time.
        left: part of the variance by scatter that they leave, of the value that is farthest from its goal.
    """

    run: Variation
    hours: float
    left: float

    @property
    def worth(self) -> float:
        """Number of such additions to which the observations so far are equal."""
        return self.left / max(1.0 - self.left, 1e-9)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Points that can be added to a run: its own settings, in units that are set together.

    Attributes:
        first: the run so far, traced.
        group: the run again, in several sizes.
        whole: with every unit once.
        units: (n,) number of the unit of each of its points.
        replication: number of points of a replication.
    """

    first: First
    group: Sequence[Variation]
    whole: Variation
    units: IntArray
    replication: float

    @cached_property
    def rows(self) -> IntArray:
        """(U,) number of points of each unit."""
        return np.bincount(self.units)

    @cached_property
    def least(self) -> int:
        """Minimum number of units: a kind adds others to fewer than its model can be fitted to."""
        alone = self.first.confirming.chosen(self.whole, [0])
        needed = len(set(self.first.confirming.units(alone.run_list).tolist()))
        return min(max(self.first.confirming.least_added, needed), len(self.rows))

    @property
    def step(self) -> int:
        """Number of points that are added at once: of a run with whole plots those of one."""
        of_unit = int(self.rows.min())
        few = of_unit if self.whole.run_list.whole_plots > 1 else math.ceil(PART * self.replication)
        return max(few, self.least * of_unit)

    @property
    def part(self) -> float:
        """The same as a part of a replication."""
        return self.step / self.replication

    @cached_property
    def both(self) -> Together:
        """The run so far and the whole of the candidates."""
        return self.first.confirming.ways(self.whole, self.whole.run_list, (), self.first.later_s)[0]

    def best(self, wanted: FloatArray, weights: FloatArray) -> BestPoints:
        """The best points.

        Args:
            wanted: (m, d) changes of the aimed values with the coefficients of the declared model.
            weights: (m,) their variances by scatter, over what their goals allow.
        """
        before, each = self._information(wanted.shape[1])
        start = _variances(before, wanted)
        chosen, found = list(range(len(self.rows))), list[tuple[float, tuple[int, ...], int]]()

        def worst(units: Sequence[int]) -> tuple[float, int]:
            times = max(1, self.step // int(self.rows[units].sum()))
            variances = _variances(before + times * each[units].sum(axis=0), wanted)
            return float(np.max(weights * variances / start)), times

        while True:
            value, times = worst(chosen)
            if times * int(self.rows[chosen].sum()) <= self.step or len(chosen) <= self.least:
                found.append((value, tuple(chosen), times))
            if len(chosen) <= self.least:
                break
            without = [[one for one in chosen if one != unit] for unit in chosen]
            chosen = without[ties.lowest(np.array([worst(units)[0] for units in without]))]
        value, units, times = found[ties.lowest(np.array([one[0] for one in found]))]
        whole = self.first.confirming.whole(self.group, times) or self.whole
        run = self.first.confirming.chosen(whole, units)
        return BestPoints(run, self.first.confirming.hours(run, run.run_list), value / float(np.max(weights)))

    def _information(self, count: int) -> tuple[FloatArray, FloatArray]:
        """(d, d) information of the run so far, and (U, d, d) of each unit, mean over the sensors."""
        both, units = self.both, len(self.rows)
        before, each = np.zeros((count, count)), np.zeros((units, count, count))
        for i, own in enumerate(both.declared):
            columns = both.weigh(i, own)
            before += columns[~both.fresh].T @ columns[~both.fresh]
            fresh = columns[both.fresh]
            for unit in range(units):
                part = fresh[self.units == unit]
                each[unit] += part.T @ part
        before += _PRIOR * np.diag(np.diag(before + each.sum(axis=0)) + np.finfo(np.float64).tiny)
        return before / len(both.declared), each / len(both.declared)


def _variances(information: FloatArray, wanted: FloatArray) -> FloatArray:
    """(m,) variances of values, in units of the error's."""
    scale = 1.0 / np.sqrt(np.diag(information))
    scaled = wanted * scale
    return np.asarray(np.sum(scaled * np.linalg.solve(information * np.outer(scale, scale), scaled.T).T, axis=1))


def candidates(first: First) -> Candidates | None:
    """Points that can be added to a run; None if its kind chooses none, or it has too few or too many settings."""
    for group in groups_of(first, lambda one: one.varies in ("again", "order") and one.untouched):
        whole = first.confirming.whole(group, 1)
        if whole is not None:
            units = first.confirming.units(whole.run_list)
            each = len(first.procedure.expand()) / first.procedure.replications
            return Candidates(first, group, whole, units, each)
    return None


def chosen_points(of: Candidates, made: Made, over: Mapping[str, float]) -> BestPoints | None:
    """The best points for a goal; None if its values are not known to be made of the declared model's coefficients.

    Args:
        of: the candidates.
        made: the observations so far.
        over: variances by scatter of the aimed values, over what their goals allow, by name.
    """
    both = of.both
    if len({own.shape[1] for own in both.declared}) > 1:
        return None  # sensors have different models, and one choice of points is made for all
    if len(made.table) != int((~both.fresh).sum()) or not set(both.sensors) <= set(made.table.columns):
        return None
    start = made.values(made.table)
    names = [name for name, value in start.items() if math.isfinite(value)]
    columns = []
    for moved, by in _moved(made, both):
        values = made.values(replace(made.table, columns=moved))
        columns.append([(values[name] - start[name]) / by for name in names])
    wanted = np.array(columns).T
    told = np.array([bool(np.any(np.abs(row) > 0.0)) for row in wanted])
    if not names or not told.any():
        return None
    most = max(over.values())
    weights = np.array([max(over.get(name, most), 0.0) for name in names])
    with contextlib.suppress(np.linalg.LinAlgError):
        return of.best(wanted[told], weights[told])
    return None


def _moved(made: Made, both: Together) -> Iterator[tuple[dict[str, FloatArray], float]]:
    """The table's columns with the outputs moved along each column of the declared model, and by how much of it."""
    for j in range(both.declared[0].shape[1]):
        length = max(float(np.max(np.abs(own[~both.fresh, j] / both.sigma[i][~both.fresh])))
                     for i, own in enumerate(both.declared))  # fmt: skip
        by = _MOVED / length if length > 0.0 else 1.0
        columns = dict(made.table.columns)
        for i, sensor in enumerate(both.sensors):
            columns[sensor] = columns[sensor] + by * both.declared[i][~both.fresh, j]
        yield columns, by
