"""Pitch with measured roll, or without roll: eqs. (76) to (82) and (96) to (98), for any number of sensors.

At known roll every output is C sin a + D cos a. One sensor gives two pitches in closed form. Several give one by least
squares, weighted by readings and measured roll together: an error of roll changes all outputs, each by its own amount,
so sensors that depend less on roll have more weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.fitter import ties
from rig.fitter.arrays import FloatArray

STEPS = 40
DECISIVE = 25.0
"""Difference of weighted squares by which one of two pitches is preferred: five standard deviations."""
_SAME = 1e-6
_POLISHING = 4
_STILL = 1e-12
_REACH = np.geomspace(1e-9, np.pi, 400)


@dataclass(frozen=True, eq=False)
class KnownRoll:
    """Outputs at known roll.

    Attributes:
        C: (S, n) or (S, 1) V, coefficient of sin a.
        D: (S, n) V, coefficient of cos a.
        D_roll: (S, n) V/rad, its derivative by roll.
        noise: (S,) variance of a reading, V^2.
        roll_variance: (n,) rad^2.

    """

    C: FloatArray
    D: FloatArray
    D_roll: FloatArray
    noise: FloatArray
    roll_variance: FloatArray

    @staticmethod
    def of(matrix: FloatArray, roll: FloatArray, roll_variance: FloatArray, noise: FloatArray) -> KnownRoll:
        """From sensors (S, 3) `matrix` at (n,) roll in rad."""
        sin_r, cos_r = np.sin(roll), np.cos(roll)
        D = -(matrix[:, 1:2] * sin_r + matrix[:, 2:3] * cos_r)
        D_roll = -(matrix[:, 1:2] * cos_r - matrix[:, 2:3] * sin_r)
        return KnownRoll(matrix[:, :1] + 0.0 * D, D, D_roll, noise, roll_variance)

    def take(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> KnownRoll:
        """Those of some rows."""
        return KnownRoll(self.C[:, rows], self.D[:, rows], self.D_roll[:, rows], self.noise, self.roll_variance[rows])

    def slope(self, pitch: FloatArray) -> FloatArray:
        """(S, n) derivative of the outputs by pitch, V/rad."""
        return self.C * np.cos(pitch) - self.D * np.sin(pitch)

    def roll_slope(self, pitch: FloatArray) -> FloatArray:
        """(S, n) derivative of the outputs by roll, V/rad (eq. 75)."""
        return self.D_roll * np.cos(pitch)

    def residual(self, y: FloatArray, pitch: FloatArray) -> FloatArray:
        """(S, n) outputs minus those at `pitch`."""
        return y - self.C * np.sin(pitch) - self.D * np.cos(pitch)

    def whiten(self, values: FloatArray, pitch: FloatArray) -> FloatArray:
        """(S, n) inverse of the covariance of readings and roll at `pitch`, times (S, n) `values`."""
        weights = 1.0 / self.noise[:, None]
        by_roll = self.roll_slope(pitch)
        weighted, heavy = weights * values, weights * by_roll
        share = np.einsum("sn,sn->n", heavy, values) * self.roll_variance
        return np.asarray(weighted - heavy * share / (1.0 + self.roll_variance * np.einsum("sn,sn->n", heavy, by_roll)))

    def cost(self, y: FloatArray, pitch: FloatArray) -> FloatArray:
        """(n,) weighted sum of squares at `pitch`."""
        left = self.residual(y, pitch)
        return np.asarray(np.einsum("sn,sn->n", left, self.whiten(left, pitch)))

    def gains(self, pitch: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(S, n) change of pitch per volt of each output, rad/V (eq. 96), and (n,) information, rad^-2."""
        slope = self.slope(pitch)
        heavy = self.whiten(slope, pitch)
        information = np.einsum("sn,sn->n", slope, heavy)
        return heavy / np.maximum(information, np.finfo(float).tiny), information

    def roll_errors(self, pitch: FloatArray, gains: FloatArray, information: FloatArray) -> FloatArray:
        """(n,) variance of pitch from that of measured roll, rad^2 (eq. 81), with its curvature.

        To first order gains @ dv/dR times the error of roll; to second order half of d2v/dR2 times the square of its
        remaining error given the outputs, whose mean square is 3/4 of the square of its variance.
        """
        by_roll = self.roll_slope(pitch)
        heavy = self.whiten(by_roll, pitch)
        seen = np.einsum("sn,sn->n", heavy, by_roll)
        seen = seen - np.einsum("sn,sn->n", heavy, self.slope(pitch)) ** 2 / np.maximum(
            information, np.finfo(float).tiny
        )
        left = self.roll_variance * np.maximum(1.0 - self.roll_variance * seen, 0.0)
        bend = np.einsum("sn,sn->n", gains, self.D * np.cos(pitch)) * left
        return np.asarray(np.einsum("sn,sn->n", gains, by_roll) ** 2 * self.roll_variance + 0.75 * bend**2)

    def solve(self, y: FloatArray, near: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """(n,) pitch in rad from (S, n) outputs minus offsets, and (n,) whether `near` had to select it.

        Args:
            y: (S, n).
            near: (n,) pitch in rad near the expected branch.
        """
        if len(y) == 1:
            turned, phase = self._alone(y, 0)
            return wrap(np.where(np.cos(near + phase) >= 0, turned, np.pi - turned) - phase), np.ones(y.shape[1], bool)
        # if pitch is determined at all, one sensor alone determines it nearly, except for its branch
        starts = [
            start for i in range(len(y)) for turned, phase in [self._alone(y, i)] for start in _both(turned, phase)
        ]
        found = np.stack([self._refine(y, start) for start in starts])
        costs = np.stack([self.cost(y, pitch) for pitch in found])
        best = ties.highest_of_each(-costs)[None]
        first, least = np.take_along_axis(found, best, 0)[0], np.take_along_axis(costs, best, 0)[0]
        others = np.where(np.abs(wrap(found - first)) > _SAME, costs, np.inf)
        other = ties.highest_of_each(-others)[None]
        second, next_least = np.take_along_axis(found, other, 0)[0], np.take_along_axis(others, other, 0)[0]
        unsure = next_least - least < DECISIVE
        nearer = np.abs(wrap(first - near)) <= np.abs(wrap(second - near))
        return wrap(np.where(unsure & ~nearer, second, first)), unsure

    def _alone(self, y: FloatArray, sensor: int) -> tuple[FloatArray, FloatArray]:
        """(n,) arcsine of one sensor's output over its amplitude, and (n,) phase to subtract (eqs. 76, 79)."""
        C, D = self.C[sensor], self.D[sensor]
        amplitude = np.maximum(np.hypot(C, D), np.finfo(float).tiny)
        return np.arcsin(np.clip(y[sensor] / amplitude, -1.0, 1.0)), np.arctan2(D, C)

    def _refine(self, y: FloatArray, pitch: FloatArray) -> FloatArray:
        """Gauss-Newton steps, shortened if they increase the sum of squares: at a maximum there is no slope."""
        pitch, cost, scale = pitch.copy(), self.cost(y, pitch), np.ones(len(pitch))
        rows = np.arange(len(pitch))
        for _ in range(STEPS):
            part, out = self.take(rows), y[:, rows]
            at = pitch[rows]
            step = scale[rows] * np.clip(np.einsum("sn,sn->n", part.gains(at)[0], part.residual(out, at)), -0.5, 0.5)
            there = part.cost(out, at + step)
            down = there <= cost[rows]
            pitch[rows], cost[rows] = np.where(down, at + step, at), np.where(down, there, cost[rows])
            scale[rows] *= np.where(down, np.where(scale[rows] < 1.0, 2.0, 1.0), 0.25)
            rows = rows[np.abs(step) >= _STILL]
            if not rows.size:
                break
        return pitch

    def reach(self, y: FloatArray, pitch: FloatArray, limit: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) distance below and above `pitch` within which the outputs still fit, in rad, up to half a turn.

        Args:
            y: (S, n).
            pitch: (n,) best fit.
            limit: (n,) maximum excess of weighted squares over the minimum.
        """
        least = self.cost(y, pitch)
        out = []
        for sign in (-1.0, 1.0):
            fits = np.stack([self.cost(y, pitch + sign * step) - least <= limit for step in _REACH])
            first_miss = np.where(fits.all(0), len(_REACH) - 1, np.argmin(fits, axis=0))
            out.append(_REACH[first_miss])
        return out[0], out[1]


def polish(
    matrix: FloatArray, problem: KnownRoll, y: FloatArray, roll: FloatArray, pitch: FloatArray
) -> tuple[FloatArray, FloatArray, KnownRoll, FloatArray]:
    """Correct the measured roll by several outputs within its error, so that the error need not be small.

    Args:
        matrix: (S, 3).
        problem: at the measured roll.
        y: (S, n) outputs minus offsets.
        roll: (n,) measured, rad.
        pitch: (n,) found at it, rad.

    Returns:
        (n,) pitch and (n,) roll of the best fit to outputs and measured roll, the problem at that roll, and (S, n)
        outputs for that roll.
    """
    if len(y) == 1 or not np.any(problem.roll_variance > 0):
        return pitch, roll, problem, y
    start, at_measured, corrected = problem, pitch, roll
    for _ in range(_POLISHING):
        problem = KnownRoll.of(matrix, corrected, problem.roll_variance, problem.noise)
        by_roll = problem.roll_slope(pitch)
        shifted = y - by_roll * (roll - corrected)
        gains, _ = problem.gains(pitch)
        left = problem.residual(shifted, pitch)
        step = np.einsum("sn,sn->n", gains, left)
        left = left - problem.slope(pitch) * step
        pitch = pitch + np.clip(step, -0.5, 0.5)
        share = problem.roll_variance * np.einsum("sn,sn->n", by_roll, problem.whiten(left, pitch))
        corrected = roll + np.where(np.isfinite(share), np.clip(share, -0.5, 0.5), 0.0)
    again = KnownRoll.of(matrix, corrected, start.roll_variance, start.noise)
    uncorrected = np.einsum("sn,s->n", start.residual(y, at_measured) ** 2, 1.0 / start.noise)
    better = again.cost(y - again.roll_slope(pitch) * (roll - corrected), pitch) <= uncorrected
    pitch, corrected = np.where(better, wrap(pitch), at_measured), np.where(better, corrected, roll)
    problem = KnownRoll.of(matrix, corrected, start.roll_variance, start.noise)
    return pitch, corrected, problem, y - problem.roll_slope(pitch) * (roll - corrected)


def _both(turned: FloatArray, phase: FloatArray) -> tuple[FloatArray, FloatArray]:
    return turned - phase, np.pi - turned - phase


def wrap(angle: FloatArray) -> FloatArray:
    """Angle in (-pi, pi]."""
    return np.asarray(np.pi - np.mod(np.pi - angle, 2 * np.pi))
