"""Coefficients of a table's model, declared columns and effects together, with the estimated noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fitter import LinearFit, RankError, least_squares
from fitter.arrays import FloatArray, IntArray
from fitter.errors import FitError
from fitter.linear import orthonormal
from fitter.split_plot import fit_split_plot
from procedures.general.trace.judge import TableJudge
from procedures.general.trace.shared import Shared


@dataclass(frozen=True, eq=False)
class Estimate:
    """A fitted model.

    Attributes:
        chosen: candidates in it.
        at: covariance of the noise it was fitted with.
        coefficients: (k + d,) of the declared columns, then of the effects' columns.
        stderr: (k + d,) their standard errors; NaN if the rows do not determine them.
        dfs: (k + d,) degrees of freedom of these.
        fitted: (n,) fitted response.
        left: (n,) residuals of ordinary least squares of the same columns, whose standard error is `sigma_E`.
        sigma_E: standard error of one row, units of the response, with equal weights.
        df: degrees of freedom of that.
    """

    chosen: tuple[int, ...]
    at: int
    coefficients: FloatArray
    stderr: FloatArray
    dfs: FloatArray
    fitted: FloatArray
    left: FloatArray
    sigma_E: float
    df: int


def estimate(judge: TableJudge, chosen: tuple[int, ...], tails: FloatArray | None = None) -> Estimate:
    """Fit the declared columns and those of the `chosen` candidates to all rows.

    Coefficients are generalised least squares with the estimated noise; isolated outliers are reduced to three standard
    deviations. The standard error of a row is that of ordinary least squares, so that before and after are comparable,
    also with other programs. Beside errors of whole plots, standard errors are those of Kenward and Roger: few whole
    plots say little of their variance.

    Args:
        judge: of the table.
        chosen: candidates in the model.
        tails: (n, k) rounding errors of the doubles in the declared columns.
    """
    problem, at = judge.problem, judge.beside(chosen).best
    model = problem.model(chosen)
    plain = at == 0 and np.ptp(problem.sd) == 0.0
    if plain:
        fit = _solved(model, judge.held(chosen), tails)
    else:
        white = problem.noise.whiten(np.array([at]), model / problem.sd[:, None])[0]
        fit = _solved(white, judge.white(at, chosen), None)
    coefficients, stderr = fit if fit is not None else _smallest(model, problem.y)
    left, df = _plain(judge, chosen)
    stderr, dfs = _beside_shared(judge, chosen, model) or (stderr, np.full(len(stderr), float(df)))
    return Estimate(chosen, at, coefficients, stderr, dfs, model @ coefficients, left, _sigma(left, df), df)


def _beside_shared(
    judge: TableJudge, chosen: tuple[int, ...], model: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """(k + d,) standard errors and degrees of freedom of Kenward and Roger; None but for errors of whole plots."""
    noise = judge.problem.noise
    if type(noise) is not Shared or np.ptp(judge.problem.sd) > 0.0:  # `Both` has a wander too
        return None
    try:
        fit = fit_split_plot(model, judge.held(chosen), noise.group, [str(i) for i in range(model.shape[1])])
    except FitError:
        return None
    return fit.kenward_roger().stderr, fit.df


def error_of(judge: TableJudge, chosen: tuple[int, ...]) -> float:
    """Standard error of one row beside the `chosen` candidates, as in `Estimate`."""
    left, df = _plain(judge, chosen)
    return _sigma(left, df)


def strata_of(judge: TableJudge, chosen: tuple[int, ...], shared: IntArray | None) -> tuple[float, float] | None:
    """Standard deviations within whole plots and between them by REML, if the declared model has them."""
    if shared is None:
        return None
    basis = orthonormal(judge.problem.model(chosen))
    try:
        fit = fit_split_plot(basis, judge.problem.y, shared, [str(i) for i in range(basis.shape[1])])
    except FitError:
        return None
    return fit.sigma_subplot, fit.sigma_wholeplot


def stated(judge: TableJudge, chosen: tuple[int, ...], shared: IntArray | None) -> tuple[FloatArray, FloatArray]:
    """(1,) error that a trace states, of a row and of all strata, and (1,) sum of squares of residuals."""
    left, df = _plain(judge, chosen)
    parts = (_sigma(left, df), *(strata_of(judge, chosen, shared) or ()))
    return np.array([float(np.linalg.norm(parts))]), np.array([float(left @ left)])


def _sigma(left: FloatArray, df: int) -> float:
    return float(np.sqrt(left @ left / df)) if df > 0 else float("nan")


def _plain(judge: TableJudge, chosen: tuple[int, ...]) -> tuple[FloatArray, int]:
    """(n,) residuals of ordinary least squares, and their degrees of freedom."""
    basis = orthonormal(judge.problem.model(chosen))
    return judge.problem.y - basis @ (basis.T @ judge.problem.y), judge.problem.n - basis.shape[1]


def _solved(model: FloatArray, y: FloatArray, tails: FloatArray | None) -> tuple[FloatArray, FloatArray] | None:
    k = model.shape[1]
    wide = None if tails is None else np.hstack([tails, np.zeros((len(y), k - tails.shape[1]))])
    try:
        fit: LinearFit = least_squares(model, y, [str(i) for i in range(k)], tails=wide)
    except RankError:
        return None
    return fit.coefficients, fit.stderr


def _smallest(model: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The shortest of all solutions for dependent columns."""
    length = np.linalg.norm(model, axis=0)
    length[length == 0] = 1.0
    coefficients = np.linalg.lstsq(model / length, y, rcond=1e-10)[0] / length
    return coefficients, np.full(len(coefficients), np.nan)
