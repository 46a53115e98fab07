"""Refinement of a design whose factors may have any setting in a range: smaller and smaller steps of one coordinate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.designs.best_design import GAIN
from rig.fitter.designs.plots import share
from rig.fitter.designs.region import Region

TRIED = np.array([-4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0])
FIRST = 1.0 / 32.0
"""First step, as a share of the range."""
LAST = 1e-5
FINER = 4.0
SWEEPS = 30


@dataclass(eq=False)
class Polish:
    """A design that is being refined.

    Attributes:
        region: factors and model.
        points: (n, k), changed in place.
        whole_plot: (n,) from 0.
        hard: indices of the hard factors.
        eta: variance between whole plots over that within.
        known: (p, p) information of points that stay.
        target: (p, p) of the criterion tr(M^-1 target); None for |M|.
    """

    region: Region
    points: FloatArray
    whole_plot: IntArray
    hard: tuple[int, ...]
    eta: float
    known: FloatArray
    target: FloatArray | None

    def run(self) -> FloatArray:
        """(n, k) points after refinement."""
        self._plots = [np.flatnonzero(self.whole_plot == plot) for plot in range(int(self.whole_plot.max()) + 1)]
        rows = self.region.rows(self.points)
        self._parts = np.stack([self._of_plots(rows[None, members])[0] for members in self._plots])
        self._total = self.known + self._parts.sum(axis=0)
        free = [i for i, factor in enumerate(self.region.factors) if factor.free]
        step = FIRST
        while free and step >= LAST:
            for _ in range(SWEEPS):
                if not self._sweep(free, step):
                    break
            step /= FINER
        return self.points

    def _sweep(self, free: list[int], step: float) -> bool:
        changed = False
        for plot, members in enumerate(self._plots):
            for factor in free:
                for moved in [members] if factor in self.hard else members[:, None]:
                    changed |= self._move(plot, moved, factor, step)
        return changed

    def _move(self, plot: int, moved: IntArray, factor: int, step: float) -> bool:
        """Try other settings of one factor at these points of a whole plot; True if one was better."""
        f, members = self.region.factors[factor], self._plots[plot]
        now = self.points[moved[0], factor]
        settings = np.unique(np.clip(now + TRIED * step * (f.high - f.low), f.low, f.high))
        settings = np.concatenate([[now], settings[settings != now]])
        trial = np.repeat(self.points[None, members], settings.size, axis=0)
        trial[:, np.isin(members, moved), factor] = settings[:, None]
        flat = trial.reshape(-1, trial.shape[2])
        parts = self._of_plots(self.region.rows(flat).reshape(*trial.shape[:2], -1))
        value = self._value(self._total - self._parts[plot] + parts)
        value[~self.region.may(flat).reshape(trial.shape[:2]).all(axis=1)] = -np.inf
        best = int(np.argmax(np.round(value, 10)))  # the first of equal ones, whatever the processor rounds
        if value[best] <= value[0] + GAIN * max(1.0, abs(value[0])):
            return False
        self.points[moved, factor] = settings[best]
        self._parts[plot] = parts[best]
        self._total = self.known + self._parts.sum(axis=0)
        return True

    def _of_plots(self, rows: FloatArray) -> FloatArray:
        """(q, p, p) information of whole plots with (q, m, p) rows."""
        rows = rows - float(share(rows.shape[1], self.eta)) * rows.mean(axis=1, keepdims=True)
        return np.asarray(np.matmul(rows.transpose(0, 2, 1), rows))

    def _value(self, m: FloatArray) -> FloatArray:
        if self.target is None:
            sign, value = np.linalg.slogdet(m)
            return np.asarray(np.where(sign > 0, value, -np.inf))
        return np.asarray(-np.log(np.sum(np.linalg.inv(m) * self.target, axis=(1, 2))))
