"""Whole-plot runs as one problem: one declared model, and a separate error for every whole plot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.confirm import Together
from rig.fitter.confirm.runs import Later, changes, join_all, numbers
from rig.fitter.confirm.together import Candidates, Own
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects.scene import PressureScene
from rig.procedures.pressure.trace import WholePlotTrace
from rig.procedures.pressure.trace.places import places_of
from rig.procedures.pressure.trace.problem import raw_columns


@dataclass(frozen=True, eq=False)
class WholePlotTogether(Together):
    """Runs of whole plots that are fitted together.

    Attributes:
        scene: of all observations; its references are those of the first run's trace.
        found: findings in the first run.
    """

    scene: PressureScene
    found: WholePlotTrace

    @classmethod
    def of(cls, found: WholePlotTrace, first: WholePlotData, later: Sequence[Later]) -> Self:
        """A run, its trace, and later runs.

        Raises:
            FitError: a later run lacks a transducer of the first.
        """
        scene = replace(found.scene, data=join_all(first, later))
        return cls(numbers(len(first), later), scene, found, done=changes(len(first), later))

    @property
    def data(self) -> WholePlotData:
        """Observations of both runs."""
        return self.scene.data

    @property
    def df(self) -> int:
        """Degrees of freedom of the error's estimate."""
        return max(min(s.after.residual_mV.size - len(s.after.fit.names) for s in self.found.sensors.values()), 1)

    @property
    def realigned(self) -> bool:
        """False: a transducer is not moved, so the first run's parameters are valid."""
        return False

    @property
    def loose(self) -> FloatArray:
        """(n, W) an offset of every whole plot, as if each were zeroed once (the papers' in-flight zero), and a
        sensitivity after every change by a person.
        """
        return np.column_stack([np.eye(self.data.whole_plots.size)[self.data.whole_plot_index], self._anew])

    @cached_property
    def _anew(self) -> FloatArray:
        """(n, 2 k) offset and sensitivity after each of k changes with which they change."""
        after = [done.after.astype(np.float64) for done in self.done if done.anew]
        columns = [column for own in after for column in (own, own * self.data.pressure_psia)]
        return np.column_stack(columns) if columns else np.zeros((len(self.data), 0))

    @property
    def own_response(self) -> bool:
        """False: a transducer keeps its response; whole plots draw their errors anyway."""
        return False

    @cached_property
    def sigma(self) -> FloatArray:
        """(S, n) mV, growing with pressure if the trace found growth."""
        out = []
        for name in self.sensors:
            sensor = self.found.sensors[name]
            grows = any(effect.stratum == "noise" for effect in sensor.effects)
            same = np.full(len(self.data), sensor.after.fit.sigma_subplot)
            out.append(sensor.noise_within.sd(self.data.pressure_psia) if grows else same)
        return np.stack(out)

    @property
    def slope(self) -> FloatArray:
        """(S,) mV/psi."""
        return np.array([self.scene.sensitivity[s] for s in self.sensors])

    @cached_property
    def declared(self) -> tuple[FloatArray, ...]:
        """(n, d) columns of the declared model for each transducer."""
        formula = self.found.formula
        columns = formula.columns(self.data.table, formula.levels(self.found.scene.data.table))[1]
        return (np.column_stack([columns, self._anew]),) * len(self.sensors)

    @cached_property
    def own(self) -> tuple[tuple[Own, ...], ...]:
        """Whole-plot errors for each transducer."""
        index = self.data.whole_plot_index
        plots = [np.flatnonzero(index == k) for k in range(self.data.whole_plots.size)]
        out = []
        for i, name in enumerate(self.sensors):
            spread = self.found.sensors[name].after.fit.sigma_wholeplot
            out.append(tuple(Own.of(rows, (spread / self.sigma[i][rows])[:, None]) for rows in plots))
        return tuple(out)

    def untouched(self, terms: Candidates) -> FloatArray:
        """(S, n, q) mV per unit coefficient."""
        return raw_columns(self.scene, self.sensors, terms)

    def shapes(self, *, lasting: bool) -> Iterator[tuple[str, FloatArray]]:
        """(S, n, m) smooth unweighted columns over what was recorded in the later run, each place after its name: the
        places inside whole plots where a trace looks for shapes without a name.
        """
        for place in places_of(self.scene):
            if place.level != "subplot" or (lasting and not place.text.startswith("over the pressure")):
                continue
            for i in range(len(self.sensors)):
                raw = np.zeros((len(self.sensors), len(self.data), place.block.columns.shape[1]))
                raw[i] = place.block.columns * self.fresh[:, None]
                yield place.text, raw

    def only(self, rows: NDArray[np.bool_]) -> Self:
        """These runs with some of the observations only."""
        part = replace(self.scene, data=self.data.take(np.flatnonzero(rows)))
        return replace(self, scene=part, run=self.run[rows], done=tuple(one.at(rows) for one in self.done))
