"""The error of a reading in use: predicted by other readings, with the in-flight zero's own error.

Residuals are too small for a method that fits an intercept to every whole plot. If one reading determines its whole
plot's intercept, such as the lowest pressure with weights 1/P^2, its residual is zero for any reading. And in flight
the intercept comes from one reading in vacuum, whose own error is then in every pressure. So here

- methods that know the whole plot's error are judged as they are used: one reading at the lowest pressure of a whole
  plot is its zero, and every other reading is judged by its difference to that one;
- for the other methods each reading is predicted by a fit without its whole plot w, (1 - H_ww)^-1 e_w.

The same error has an interval from the estimated errors of readings and coefficients; with sd s of a reading and of its
zero alone and no error of the coefficients it is 1.96 sqrt(2) s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from rig.procedures.pressure.fit.problem import Problem

OWN = 1e-6
"""Smallest singular value of 1 - H_ww for which other whole plots predict whole plot w."""


@dataclass(frozen=True, eq=False)
class InUse:
    """One row for each nominal pressure, in percent of it; NaN at zero pressure and if undetermined.

    Attributes:
        max_pct: (m,) largest measured error.
        count: (m,) number of these errors.
        half95_pct: (m,) half-width of the 95 % interval of one reading in use, mean over the temperatures.
        chance_pct: (m, 2) 95 % interval of the largest of this number of errors, for independent normal errors of the
            interval's size.
    """

    max_pct: FloatArray
    count: IntArray
    half95_pct: FloatArray
    chance_pct: FloatArray

    def to_dict(self) -> dict[str, object]:
        """JSON values; missing numbers are None."""
        return {
            "max_pct": _known(self.max_pct),
            "count": self.count.tolist(),
            "half95_pct": _known(self.half95_pct),
            "max_by_chance_pct": [_known(pair) for pair in self.chance_pct],
        }


def in_use(
    problem: Problem,
    hat: FloatArray,
    residual_mV: FloatArray,
    half_width_mV: FloatArray,
    slope_mV_per_psi: FloatArray,
    zeroed: tuple[FloatArray, FloatArray, FloatArray] | None,
) -> InUse:
    """Errors in use of the readings of a problem, by one method.

    Args:
        problem: readings and model.
        hat: (n, n) H of the method: its fitted outputs are H V.
        residual_mV: (n,) of the method.
        half_width_mV: (n,) of its prediction interval at each reading, without a zero.
        slope_mV_per_psi: (n,) dV/dP there.
        zeroed: for a method that estimates the whole plot's error the (k,) coefficients, their (k, k) covariance and
            its (p, k, k) derivatives by the parameters of the errors; None for others.
    """
    data = problem.data
    nominal, level = data.pressure_levels
    pressure = np.where(problem.without_pressure, 0.0, data.pressure_psia)
    with np.errstate(divide="ignore"):
        pct = np.where(pressure > 0, 100.0 / np.abs(slope_mV_per_psi * pressure), np.nan)
    if zeroed is None:
        rows, sizes, half = np.arange(len(data)), np.abs(_left_out(problem, hat, residual_mV)), half_width_mV
    else:
        rows, sizes = _beside_zero(problem, zeroed[0])
        half = _zeroed_half_width(problem, zeroed)
    largest, count, wide, chance = [], [], [], []
    for i in range(nominal.size):
        own = sizes[level[rows] == i] * pct[rows[level[rows] == i]]
        own = own[np.isfinite(own)]
        reach = float(np.mean((half * pct)[level == i]))
        largest.append(own.max() if own.size else np.nan)
        count.append(own.size)
        wide.append(reach)
        chance.append(_largest_of(own.size, reach / float(special.ndtri(0.975))))
    return InUse(np.array(largest), np.array(count, np.int64), np.array(wide), np.array(chance))


def _left_out(problem: Problem, hat: FloatArray, residual_mV: FloatArray) -> FloatArray:
    """(n,) errors of readings predicted by a fit without their whole plot, mV; NaN if there is no such fit."""
    error = np.full(len(residual_mV), np.nan)
    for plot in range(len(problem.data.whole_plots)):
        own = np.flatnonzero(problem.data.whole_plot_index == plot)
        left = np.eye(own.size) - hat[np.ix_(own, own)]
        if np.linalg.svd(left, compute_uv=False)[-1] > OWN:
            error[own] = np.linalg.solve(left, residual_mV[own])
    return error


def _beside_zero(problem: Problem, coefficients: FloatArray) -> tuple[IntArray, FloatArray]:
    """Rows, and the size of the error of each against each reading at the lowest pressure of its whole plot, mV."""
    data = problem.data
    off = data.outputs[problem.output] - problem.columns @ coefficients
    at_zero = data.pressure_levels[1] == 0
    same = data.whole_plot_index[:, None] == data.whole_plot_index[None, at_zero]
    zeros = np.flatnonzero(at_zero)
    row, zero = np.nonzero(same & (np.arange(len(data))[:, None] != zeros[None, :]))
    return row.astype(np.int64), np.abs(off[row] - off[zeros[zero]])


def _zeroed_half_width(problem: Problem, zeroed: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
    """(n,) half-width of the 95 % interval of a reading minus a zero read once at the lowest pressure, mV."""
    data, errors = problem.data, problem.errors
    _, covariance, derivatives = zeroed
    lowest = np.full(len(data), data.pressure_levels[0][0])
    step = problem.columns - problem.formula.columns({**data.table, "P": lowest, "pressure_psia": lowest})[1]
    one, by_one = errors.of_reading(data.pressure_psia, new_whole_plot=False)
    zero, by_zero = errors.of_reading(lowest, new_whole_plot=False)
    fixed = np.einsum("ni,ij,nj->n", step, covariance, step)
    by_fixed = np.einsum("ni,pij,nj->np", step, derivatives, step)
    variance = one + zero + fixed
    limit = special.stdtrit(errors.df(variance, by_one + by_zero + by_fixed), 0.975)
    return np.asarray(limit * np.sqrt(variance))


def _largest_of(count: int, sd: float) -> tuple[float, float]:
    """95 % interval of the largest size of this number of independent normal errors."""
    if count == 0 or not np.isfinite(sd):
        return float("nan"), float("nan")
    low, high = (sd * float(special.ndtri(0.5 + 0.5 * p ** (1.0 / count))) for p in (0.025, 0.975))
    return low, high


def _known(values: FloatArray) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]
