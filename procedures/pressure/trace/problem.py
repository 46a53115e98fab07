"""A whole-plot run prepared for the search: every candidate's column for every transducer, in both strata."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.split_plot import SplitPlotDesign
from rig.fitter.trace.limits import limit
from rig.fitter.trace.not_kept import NotKept, overflows
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects.scene import PressureEffect, PressureScene, PressureTerm
from rig.procedures.pressure.trace.strata import LEVELS, Level, Strata

IS_THE_MODEL = limit("declared", "whole-plot")
"""Minimum remaining share of a column beside the declared model."""

RESOLVED = 1e-12
"""Relative size of an output's range below which differences are rounding; data without noise are not tested against
it.
"""


@dataclass(frozen=True)
class Candidate:
    """One term of one effect, on one transducer or (None) on the line or the supply, and with it on all."""

    effect: PressureEffect
    term: PressureTerm
    sensor: str | None


@dataclass(frozen=True, eq=False)
class Stratum:
    """Residuals of the declared model at one level.

    Attributes:
        outputs: (S, m), m readings or whole plots.
        columns: (S, m, J).
        df: (S,) degrees of freedom.
    """

    outputs: FloatArray
    columns: FloatArray
    df: FloatArray


@dataclass(frozen=True, eq=False)
class Problem:
    """Arrays over S transducers, n observations and J candidates.

    Attributes:
        sensors: names of the transducers.
        names: of the declared model's columns.
        declared: (n, k) declared model.
        outputs: (S, n) mV.
        raw: (S, n, J) original columns, mV per unit coefficient.
        candidates: J of them, in catalogue order.
        whole_plot: (n,) index of the whole plot, from 0.
        replicate: (n,) index of the replication, from 0.
        order: (n,) executed position.
        weight: (S, n) of each reading, mean one: the inverse of its variance if that grows with pressure.
        ratio: (S,) variance of the whole-plot error over that of a reading.
        rho: (S,) correlation of a reading's error with that of the previous one in its whole plot.
        left_out: candidates that cannot be used in computation.
    """

    sensors: tuple[str, ...]
    names: tuple[str, ...]
    declared: FloatArray
    outputs: FloatArray
    raw: FloatArray
    candidates: tuple[Candidate, ...]
    whole_plot: IntArray
    replicate: IntArray
    order: IntArray
    weight: FloatArray
    ratio: FloatArray
    rho: FloatArray
    left_out: tuple[NotKept, ...] = ()

    @cached_property
    def sensor_of(self) -> tuple[str | None, ...]:
        """(J,) sensor of each candidate."""
        return tuple(c.sensor for c in self.candidates)

    @cached_property
    def estimates(self) -> dict[tuple[int, ...], Any]:
        """Cache of fits, by the candidates in them: `estimate`."""
        return {}

    @cached_property
    def designs(self) -> dict[tuple[tuple[str, ...], bytes], SplitPlotDesign]:
        """Cache of their designs: `estimate.design_of`."""
        return {}

    @cached_property
    def strata(self) -> tuple[Strata, ...]:
        """Projections of each transducer; shared for equal weights."""
        made: list[Strata] = []
        for weight, ratio, rho in zip(self.weight, self.ratio, self.rho, strict=True):
            same = (s for s in made if np.array_equal(s.weight, weight) and (s.ratio, s.rho) == (ratio, rho))
            made.append(next(same, None) or self.stratified(weight, float(ratio), float(rho)))
        return tuple(made)

    @cached_property
    def members(self) -> FloatArray:
        """(W, n) one where a reading is of a whole plot, else zero."""
        return np.asarray(np.arange(int(self.whole_plot.max()) + 1)[:, None] == self.whole_plot, np.float64)

    @cached_property
    def plots_in_time(self) -> IntArray:
        """(W,) whole plots in the order of running; replications follow one another."""
        begun = np.full(int(self.whole_plot.max()) + 1, np.iinfo(np.int64).max)
        np.minimum.at(begun, self.whole_plot, self.order)
        return np.argsort(begun)

    def stratified(self, weight: FloatArray, ratio: float, rho: float) -> Strata:
        """Projections for autocorrelated readings with these weights."""
        return Strata(self.declared, self.whole_plot, self.replicate, weight, ratio, self.before, rho)

    @cached_property
    def before(self) -> IntArray:
        """(n,) row of the previous reading in its whole plot; the row itself at the first."""
        executed = np.lexsort((self.order, self.whole_plot))
        behind = np.concatenate([executed[:1], executed[:-1]])
        behind = np.where(self.whole_plot[behind] == self.whole_plot[executed], behind, executed)
        return behind[np.argsort(executed)]

    @cached_property
    def at(self) -> Mapping[Level, Stratum]:
        """Both strata of all transducers."""
        return {level: self._at(level) for level in LEVELS}

    @cached_property
    def rounding(self) -> FloatArray:
        """(S,) least error of each transducer, mV: smaller differences of its outputs are rounding."""
        return np.asarray(np.maximum(RESOLVED * np.ptp(self.outputs, axis=1), np.finfo(float).tiny))

    @cached_property
    def length_at(self) -> Mapping[Level, FloatArray]:
        """(S, J) length of each raw column at each level: of readings by weight, or of whole plots' means."""
        readings, means = np.zeros((2, len(self.sensors), len(self.candidates)))
        for i, (strata, mine) in enumerate(zip(self.strata, self._concerned, strict=True)):
            of_means = self._means[i][:, 1:]
            readings[i, mine] = np.linalg.norm(strata.whiten(self._own[i][:, 1:]), axis=0)
            means[i, mine] = np.linalg.norm(of_means * strata.precision[:, None], axis=0)
        return {"subplot": readings, "whole-plot": means}

    @cached_property
    def judged_at(self) -> tuple[Level, ...]:
        """For each candidate the level of its test: its own stratum's, if it varies there."""
        return tuple("subplot" if within else "whole-plot" for within in self._judged_within.tolist())

    def within(self, level: Level, of: Sequence[int] | IntArray | None = None) -> IntArray:
        """Indices of the candidates (of the given ones) of a level."""
        here = self._judged_within if level == "subplot" else ~self._judged_within
        if of is None:
            return np.flatnonzero(here)
        every = np.asarray(of, np.int64)
        return every[here[every]]

    @cached_property
    def _judged_within(self) -> NDArray[np.bool_]:
        """(J,) whether a candidate is judged within whole plots."""
        varies = np.zeros(len(self.candidates), np.bool_)
        for strata, own, mine in zip(self.strata, self._own, self._concerned, strict=True):
            varies[mine] |= strata.varies_within(own[:, 1:])
        return varies & np.array([c.effect.stratum == "subplot" for c in self.candidates], np.bool_)

    @cached_property
    def own(self) -> tuple[IntArray, ...]:
        """Candidates that each transducer has for itself."""
        return tuple(np.flatnonzero(self._owner == i) for i in range(len(self.sensors)))

    @cached_property
    def alone(self) -> tuple[tuple[Problem, IntArray], ...]:
        """Each transducer by itself with its own candidates, and their indices here.

        Beside a model without candidates of the line they are judged there as they are here, with fewer numbers.
        """
        return tuple(self._alone(i) for i in range(len(self.sensors)))

    def _alone(self, i: int) -> tuple[Problem, IntArray]:
        mine = self.own[i]
        one = slice(i, i + 1)
        problem = replace(
            self,
            sensors=self.sensors[one],
            outputs=self.outputs[one],
            raw=self.raw[one][:, :, mine],
            candidates=tuple(self.candidates[j] for j in mine),
            weight=self.weight[one],
            ratio=self.ratio[one],
            rho=self.rho[one],
        )
        known = {
            "strata": self.strata[one],
            "at": {
                level: Stratum(of.outputs[one], np.ascontiguousarray(of.columns[one][:, :, mine]), of.df[one])
                for level, of in self.at.items()
            },
            "length_at": {level: length[one][:, mine] for level, length in self.length_at.items()},
            "_judged_within": self._judged_within[mine],
        }
        vars(problem).update(known)  # what is known already is not computed again
        return problem, mine

    def among(self, chosen: Sequence[int]) -> tuple[Problem, tuple[int, ...]]:
        """The problem with the `chosen` candidates alone, and their indices there."""
        few = tuple(self.candidates[j] for j in chosen)
        return replace(self, raw=self.raw[:, :, list(chosen)], candidates=few), tuple(range(len(few)))

    def take(self, rows: IntArray) -> Problem:
        """The problem of some of the rows, with the columns of the whole."""
        if len(rows) == len(self.declared):
            return self
        return replace(
            self,
            declared=self.declared[rows],
            outputs=self.outputs[:, rows],
            raw=self.raw[:, rows],
            whole_plot=np.unique(self.whole_plot[rows], return_inverse=True)[1],
            replicate=np.unique(self.replicate[rows], return_inverse=True)[1],
            order=self.order[rows],
            weight=self.weight[:, rows],
        )

    def _at(self, level: Level) -> Stratum:
        count = self.outputs.shape[1] if level == "subplot" else int(self.whole_plot.max()) + 1
        outputs, columns = np.zeros((len(self.sensors), count)), np.zeros((len(self.sensors), count, self.raw.shape[2]))
        for i, (strata, mine) in enumerate(zip(self.strata, self._concerned, strict=True)):
            left = strata.leave(self._own[i], level, self._means[i])
            outputs[i], columns[i][:, mine] = left[:, 0], left[:, 1:]
        return Stratum(outputs, columns, np.array([float(strata.df(level)) for strata in self.strata]))

    @cached_property
    def _means(self) -> tuple[FloatArray, ...]:
        """(W, q + 1) `Strata.means` of each transducer's output and of its candidates."""
        return tuple(strata.means(own) for strata, own in zip(self.strata, self._own, strict=True))

    @cached_property
    def _own(self) -> tuple[FloatArray, ...]:
        """(n, q + 1) each transducer's output and its candidates."""
        return tuple(
            np.column_stack([y, raw[:, mine]])
            for y, raw, mine in zip(self.outputs, self.raw, self._concerned, strict=True)
        )

    @cached_property
    def _concerned(self) -> tuple[IntArray, ...]:
        """The candidates of each transducer."""
        return tuple(np.flatnonzero((self._owner == i) | (self._owner < 0)) for i in range(len(self.sensors)))

    @cached_property
    def _owner(self) -> IntArray:
        """(J,) index of each candidate's transducer; below zero for the line's."""
        index = {sensor: i for i, sensor in enumerate(self.sensors)}
        return np.array([-1 if sensor is None else index[sensor] for sensor in self.sensor_of], np.int64)


def pose(
    data: WholePlotData,
    names: tuple[str, ...],
    declared: FloatArray,
    scene: PressureScene,
    catalogue: Sequence[PressureEffect],
) -> Problem:
    """Prepare a run for the search.

    Raises:
        rig.fitter.linear.RankError: the observations do not determine the declared model.
        FitError: they do not determine its errors.

    """
    candidates = tuple(
        Candidate(effect, term, sensor)
        for effect in catalogue
        for sensor in (data.transducers if effect.scope == "sensor" else (None,))
        for term in effect.terms(data)
    )
    with np.errstate(over="ignore", invalid="ignore"):
        raw = raw_columns(scene, data.transducers, candidates)
    large = [j for j in range(len(candidates)) if overflows(raw[:, :, j])]
    raw[:, :, large] = 0.0
    basis = orthonormal(declared)
    left = np.linalg.norm(raw - np.einsum("nk,mk,smj->snj", basis, basis, raw, optimize=True), axis=(0, 1))
    useful = np.flatnonzero(left > IS_THE_MODEL * np.linalg.norm(raw, axis=(0, 1)))
    outputs = np.stack([data.outputs[s] for s in data.transducers])
    fitted = SplitPlotDesign(declared, data.whole_plot, names).fit_many(outputs.T)
    return Problem(
        sensors=data.transducers,
        names=names,
        declared=declared,
        outputs=outputs,
        raw=raw[:, :, useful],
        candidates=tuple(candidates[j] for j in useful),
        whole_plot=data.whole_plot_index,
        replicate=np.unique(data.replicate, return_inverse=True)[1].astype(np.int64),
        order=data.order,
        weight=np.ones_like(outputs),
        ratio=fitted.ratio,
        rho=np.zeros(len(outputs)),
        left_out=tuple(NotKept(candidates[j].effect.name, candidates[j].sensor, "overflow") for j in large),
    )


def raw_columns(scene: PressureScene, sensors: Sequence[str], candidates: Sequence[Candidate]) -> FloatArray:
    """(S, n, J) columns of `candidates`, mV: zero for the transducers a candidate does not concern."""
    out = np.zeros((len(sensors), len(scene.data), len(candidates)))
    made: dict[tuple[str, str], FloatArray] = {}
    for j, candidate in enumerate(candidates):
        key = candidate.effect.name, candidate.term.name
        if key not in made:
            made[key] = candidate.term.column(scene)
        for i, sensor in enumerate(sensors):
            if candidate.effect.scope == "voltmeter":
                out[i, :, j] = made[key] * (scene.zero[sensor] + scene.sensitivity[sensor] * scene.p)
            elif candidate.sensor is None:
                out[i, :, j] = made[key] * scene.sensitivity[sensor]
            elif candidate.sensor == sensor:
                out[i, :, j] = made[key]
    return out
