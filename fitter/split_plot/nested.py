"""Two variance ratios: whole plots nested in replications.

A response's coordinates u in the whole-plot spectrum have covariance diag(1 + w xi) + r F F' in units of the subplot
variance, with w and r the ratios and F the replications seen in that spectrum. The restricted likelihood is searched on
a grid of both ratios, maximised by Newton steps in their logarithms from every local maximum of the grid, and compared
with the maxima on the boundaries where one ratio, or both, are zero; those are scalar searches.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.split_plot.profile import Profile
from rig.fitter.split_plot.spectrum import Spectrum

GRID = np.geomspace(1e-3, 1e9, 49)
"""Grid of ratios times the largest eigenvalue of their own error; neighbours differ by a factor of 1.78."""

NOTHING = 1e-9
"""A ratio times its largest eigenvalue that counts as zero."""

CLOSE = 1e-9
"""Size of a Newton step, in the logarithms, after which the next would be rounding."""

FLAT = 1e-9
"""A gain in -2 log L that is negligible."""

LONGEST_STEP = 2.0
MOST_STEPS = 100


@dataclass(frozen=True, eq=False)
class NestedProfile:
    """Restricted likelihood as a function of the two ratios.

    Attributes:
        wholeplot: spectrum with one effect per whole plot.
        replicate: spectrum with one effect per replication.
        seen: (r, R) F, the replications' indicators in the whole plots' spectrum.
    """

    wholeplot: Spectrum
    replicate: Spectrum
    seen: FloatArray

    def maximise(self, y: FloatArray) -> tuple[float, float]:
        """Ratios of whole-plot and replication variance of the highest restricted likelihood for (n,) `y`."""
        _, u, rest = self.wholeplot.parts(y)
        rest_ss = float(rest @ rest)
        edges = [(self._edge(self.wholeplot, y), 0.0), (0.0, self._edge(self.replicate, y))]
        inside = [self._climb(np.log(start), u, rest_ss) for start in self._summits(u, rest_ss)]

        def deviance(ratios: tuple[float, float]) -> float:
            # a search towards a boundary ends on a flat region before it; the boundary itself is then the maximum
            return self._at(np.array(ratios), u, rest_ss).deviance + (FLAT if min(ratios) > 0.0 else 0.0)

        return ties.least([*edges, *(ratios for ratios in inside if ratios is not None)], key=deviance, unit=1.0)

    @staticmethod
    def _edge(spectrum: Spectrum, y: FloatArray) -> float:
        _, u, rest = spectrum.parts(y)
        return Profile(spectrum.xi, spectrum.fixed.df).maximise(u**2, float(rest @ rest))

    @cached_property
    def _scale(self) -> FloatArray:
        return np.array([self.wholeplot.xi[0], self.replicate.xi[0]])

    @cached_property
    def _axes(self) -> tuple[FloatArray, FloatArray]:
        return GRID / self._scale[0], GRID / self._scale[1]

    @cached_property
    def _rotations(self) -> tuple[FloatArray, FloatArray]:
        """Eigenvalues (grid, R) and vectors (grid, R, R) of F' diag(1 + w xi)^-1 F along the grid of w."""
        shrinkage = 1.0 / (1.0 + np.outer(self._axes[0], self.wholeplot.xi))
        eta, vectors = np.linalg.eigh(np.einsum("ga,ai,aj->gij", shrinkage, self.seen, self.seen))
        return np.maximum(eta, 0.0), vectors

    def _summits(self, u: FloatArray, rest: float) -> list[tuple[float, float]]:
        """Points of the grid that none of their eight neighbours exceeds."""
        w, r = self._axes
        eta, vectors = self._rotations
        grown = 1.0 + np.outer(w, self.wholeplot.xi)
        along = np.einsum("ga,ai,gij->gj", u / grown, self.seen, vectors)
        lifted = 1.0 + r[:, None] * eta[:, None]  # (w, r, R)
        q = rest + (u**2 / grown).sum(axis=1)[:, None] - (r[:, None] * along[:, None] ** 2 / lifted).sum(axis=2)
        log_det = np.log(grown).sum(axis=1)[:, None] + np.log(lifted).sum(axis=2)
        deviance = self.wholeplot.fixed.df * np.log(np.maximum(q, rest)) + log_det
        padded = np.pad(deviance, 1, constant_values=np.inf)
        around = np.lib.stride_tricks.sliding_window_view(padded, (3, 3)).min(axis=(2, 3))
        return [(float(w[i]), float(r[j])) for i, j in np.argwhere(deviance <= around)]

    def _climb(self, x: FloatArray, u: FloatArray, rest: float) -> tuple[float, float] | None:
        """The maximum from logarithms x, or None if the search ends at a boundary."""
        here = self._at(np.exp(x), u, rest)
        for _ in range(MOST_STEPS):
            if np.any(np.exp(x) * self._scale < NOTHING):
                return None
            values, vectors = np.linalg.eigh(here.curvature)
            step = vectors @ (vectors.T @ here.slope / np.maximum(np.abs(values), 1e-12))
            step *= min(1.0, LONGEST_STEP / max(float(np.max(np.abs(step))), 1e-300))
            if np.max(np.abs(step)) <= CLOSE:
                x = x + step
                break
            there = self._at(np.exp(x + step), u, rest)
            while there.deviance > here.deviance + 1e-12 * abs(here.deviance) and np.max(np.abs(step)) > CLOSE:
                step *= 0.5
                there = self._at(np.exp(x + step), u, rest)
            x, here = x + step, there
        return float(np.exp(x[0])), float(np.exp(x[1]))

    def _at(self, ratios: FloatArray, u: FloatArray, rest: float) -> _Height:
        """The likelihood at two ratios: V = D^-1 + r F F' with D diagonal is inverted by its few replications.

        With F'D F = T diag(eta) T' and B = D F T, V^-1 = D - B diag(r m) B' with m = 1 / (1 + r eta) (Woodbury). All
        traces are sums over the replications. A dense V would be inverted by threads that take a hundred times as long
        to begin as this takes.
        """
        nu, xi, f = self.wholeplot.fixed.df, self.wholeplot.xi, self.seen
        w, r = float(ratios[0]), float(ratios[1])
        d = 1.0 / (1.0 + w * xi)
        b = d[:, None] * f
        eta, turn = np.linalg.eigh(f.T @ b)
        eta = np.maximum(eta, 0.0)
        b = b @ turn
        m = 1.0 / (1.0 + r * eta)
        a = d * u - b @ (r * m * (u @ b))
        q = rest + float(u @ a)
        log_det = float(np.log1p(r * eta).sum() - np.log(d).sum())
        c, dx, seen = (xi[:, None] * b).T @ b, d * xi, r * eta * m
        weighed = m[:, None] * c
        pulled = np.stack([w * xi * a, r * (f @ (a @ f))])
        solved = pulled * d - (pulled @ b * (r * m)) @ b.T
        drop = pulled @ a / q
        slope = 0.5 * (nu * drop - np.array([w * (dx.sum() - r * np.trace(weighed)), seen.sum()]))
        within = dx @ dx - 2.0 * r * float(dx @ (xi[:, None] * b * b @ m)) + r * r * np.vdot(weighed.T, weighed)
        crossed = w * r * float(m * m @ np.diag(c))
        second = np.array([[w * w * within, crossed], [crossed, seen @ seen]]) - nu * (
            2.0 * pulled @ solved.T / q - np.outer(drop, drop)
        )
        return _Height(nu * float(np.log(q / nu)) + log_det, slope, 0.5 * second + np.diag(slope))


@dataclass(frozen=True, eq=False)
class _Height:
    """-2 log L except for constants, and the first and second derivatives of log L by the logarithms of the ratios."""

    deviance: float
    slope: FloatArray
    curvature: FloatArray
