"""The least-squares solution of a problem that is not linear, and what a linear fit says at it.

`scipy.optimize.least_squares` (a trust region, which steps back from where the curve is undefined) finds the minimum;
Gauss-Newton steps with exact derivatives then remove what its tolerances leave. Covariances are those of the linear
model that touches the curve at the minimum (Bates and Watts, Nonlinear Regression Analysis, 1988, section 2.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.linear import LinearFit, least_squares
from rig.fitter.nonlinear.problems import Problem

CONVERGED = 1e-5
"""Maximum relative offset of Bates and Watts (1981): how far the residuals are from orthogonal to the tangent plane, in
standard errors."""
_POLISH, _WAIT, _EVALUATIONS, _ROBUST = 30, 2, 2000, 4
_TOLERANCE = 1e-15
_ROUNDING, _LOST = 1e-13, 1e-9
_LARGEST = 1e150
"""Maximum residual of the search: its square is still a double."""


@dataclass(frozen=True, eq=False)
class Solved:
    """The solution.

    Attributes:
        fit: of the linear model at the solution, with the coefficients and the residual sum of squares of the problem.
        columns: (m, k) of that linear model.
        residuals: (m,).
    """

    fit: LinearFit
    columns: FloatArray
    residuals: FloatArray


def solve(
    problem: Problem, start: Sequence[float] | FloatArray, *, robust: bool = False, tolerance: float = _TOLERANCE
) -> Solved:
    """The parameters with the least sum of squared residuals, from a start.

    Args:
        problem: m residuals, k parameters.
        start: (k,) where to begin; another minimum may be nearer to another start.
        robust: with a loss that grows linearly beyond the scatter, for a few gross errors; its fit is no least squares.
        tolerance: relative, of the search before the last Gauss-Newton steps. By default rounding; problems whose
            residuals are expensive leave more to those steps.

    Raises:
        RankError: the rows do not determine every parameter.
        FitError: there is no solution that can be reached from this start.
    """
    names = problem.parameters
    b = np.array(start, np.float64)
    if len(problem.residuals(b)) < len(names):
        raise FitError(f"{len(problem.residuals(b))} rows cannot determine {len(names)} parameters: {', '.join(names)}")
    b = _search(problem, b, robust=robust, tolerance=tolerance)
    if robust:
        return solved_at(problem, b)
    found = solved_at(problem, _polished(problem, b))
    if _offset(found, problem.size) > CONVERGED:
        said = ", ".join(f"{name} = {value:.4g}" for name, value in zip(names, start, strict=True))
        raise FitError(f"no fit was found from the start {said}; give start values nearer to the solution")
    return found


def _search(problem: Problem, b: FloatArray, *, robust: bool, tolerance: float) -> FloatArray:
    """(k,) near the minimum."""
    from scipy.optimize import least_squares  # noqa: PLC0415 - 0.1 s, for curves alone

    scale = float(np.median(np.abs(problem.residuals(b)))) if robust else 1.0
    size = len(problem.residuals(b))

    def residuals(at: FloatArray) -> FloatArray:
        try:
            left = problem.residuals(at)
        except FitError:
            left = np.full(size, np.inf)
        return left if np.abs(left).max() < _LARGEST else np.full(size, np.nan)  # the search steps back

    def slopes(at: FloatArray) -> FloatArray:
        return -problem.columns(at)

    for _ in range(_ROBUST if robust else 1):
        soft = robust and scale > 0.0
        try:
            found = least_squares(
                residuals,
                b,
                slopes,
                x_scale="jac",
                xtol=tolerance,
                ftol=tolerance,
                gtol=tolerance,
                max_nfev=_EVALUATIONS,
                loss="soft_l1" if soft else "linear",
                f_scale=1.5 * scale if soft else 1.0,
            )
        except (ValueError, np.linalg.LinAlgError) as fault:  # a derivative that is not finite
            raise FitError(f"the search for {', '.join(problem.parameters)} left the curve's domain") from fault
        b = np.asarray(found.x)
        scale = 1.4826 * float(np.median(np.abs(residuals(b))))
    return b


def _polished(problem: Problem, b: FloatArray) -> FloatArray:
    """(k,) at the minimum: where the next Gauss-Newton step is shortest.

    Where residuals are large, steps shorten by a factor, and turn: one may be longer than the one before it.
    """
    square, found, shortest, waited = _square(problem, b), b, float("inf"), 0
    for _ in range(_POLISH):
        step = least_squares(problem.columns(b), problem.residuals(b), problem.parameters).coefficients
        length, further = float(np.linalg.norm(step / np.where(b == 0.0, 1.0, b))), _square(problem, b + step)
        waited = 0 if length < shortest else waited + 1
        if waited == 0:
            found, shortest = b, length
        if not further <= square * (1.0 + _LOST) or waited > _WAIT:
            break
        b, square = b + step, further
    return found


def _square(problem: Problem, b: FloatArray) -> float:
    try:
        return float(np.sum(problem.residuals(b) ** 2))
    except FitError:
        return float("inf")


def solved_at(problem: Problem, b: FloatArray) -> Solved:
    """Result of a linear fit at (k,) parameters that were found. Raises `RankError` as `solve`."""
    columns, residuals = problem.columns(b), problem.residuals(b)
    fit = least_squares(columns, residuals, problem.parameters)
    return Solved(replace(fit, coefficients=b, rss=float(np.sum(residuals**2))), columns, residuals)


def _offset(found: Solved, size: float) -> float:
    """Relative offset; 0 if the curve goes through every row within rounding."""
    basis = np.linalg.qr(found.columns / np.linalg.norm(found.columns, axis=0))[0]
    along = basis.T @ found.residuals
    rest = found.residuals - basis @ along
    k, df = len(along), max(found.fit.df, 1)
    least = max(np.linalg.norm(rest) / np.sqrt(df), size * _ROUNDING / CONVERGED, 1e-300)
    return float(np.linalg.norm(along) / np.sqrt(k) / least)
