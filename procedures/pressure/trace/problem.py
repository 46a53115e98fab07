"""A whole-plot run prepared for the search: every candidate's column for every transducer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.split_plot import SplitPlotDesign
from rig.fitter.trace.engine.beside import Level
from rig.fitter.trace.limits import limit
from rig.fitter.trace.not_kept import NotKept, overflows
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects.scene import PressureEffect, PressureScene, PressureTerm

IS_THE_MODEL = limit("declared", "whole-plot")
"""Minimum remaining share of a column beside the declared model."""
VARIES = 0.005
"""Maximum share of a column's variation within whole plots for a column of whole plots: temperatures are read with
every observation, and their scatter there has no information about their effect.
"""


@dataclass(frozen=True)
class Candidate:
    """One term of one effect, on one transducer or (None) on the line or the supply, and with it on all."""

    effect: PressureEffect
    term: PressureTerm
    sensor: str | None


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
        pressure_psia: (n,) over which whole plots may have slopes.
        weight: (S, n) of each reading, mean one: the inverse of its variance if that grows with pressure.
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
    pressure_psia: FloatArray
    weight: FloatArray
    left_out: tuple[NotKept, ...] = ()

    @cached_property
    def designs(self) -> dict[tuple[tuple[str, ...], bytes], SplitPlotDesign]:
        """Cache of designs of the declared model with further columns: `estimate.design_of`."""
        return {}

    @cached_property
    def sd(self) -> FloatArray:
        """(S, n) standard deviation of each reading over the usual one."""
        sd = 1.0 / np.sqrt(self.weight)
        return np.asarray(sd / np.exp(np.mean(np.log(sd), axis=1))[:, None])

    @cached_property
    def model(self) -> FloatArray:
        """(n, k + r) declared model, with an offset of each replication after the first."""
        return np.hstack([self.declared, np.eye(int(self.replicate.max()) + 1)[self.replicate][:, 1:]])

    @cached_property
    def plots_in_time(self) -> IntArray:
        """(W,) whole plots in the order of running; replications follow one another."""
        begun = np.full(int(self.whole_plot.max()) + 1, np.iinfo(np.int64).max)
        np.minimum.at(begun, self.whole_plot, self.order)
        return np.argsort(begun)

    @cached_property
    def judged_at(self) -> tuple[Level, ...]:
        """For each candidate the level of its effect: its own stratum's, if it varies there."""
        varies = np.any([_varies_within(raw, self.whole_plot) for raw in self.raw], axis=0)
        each = zip(self.candidates, varies.tolist(), strict=True)
        return tuple("subplot" if within and c.effect.stratum == "subplot" else "whole-plot" for c, within in each)

    def within(self, level: Level, of: Sequence[int]) -> tuple[int, ...]:
        """Those of some candidates that are judged at a level."""
        return tuple(j for j in of if self.judged_at[j] == level)

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
            pressure_psia=self.pressure_psia[rows],
            weight=self.weight[:, rows],
        )


def _varies_within(columns: FloatArray, group: IntArray) -> NDArray[np.bool_]:
    """(q,) whether columns (n, q) vary within groups by more than rounding and readback noise."""
    sums = np.zeros((int(group.max()) + 1, columns.shape[1]))
    np.add.at(sums, group, columns)
    within = np.linalg.norm(columns - (sums / np.bincount(group)[:, None])[group], axis=0)
    about = np.linalg.norm(columns - columns.mean(axis=0), axis=0)
    return np.asarray(within > VARIES * about + 1e-9 * np.linalg.norm(columns, axis=0))


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
    SplitPlotDesign(declared, data.whole_plot, names).fit_many(outputs.T)  # raises where errors are not determined
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
        pressure_psia=data.pressure_psia,
        weight=np.ones_like(outputs),
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
