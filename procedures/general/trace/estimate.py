"""Coefficients of a table's model, declared columns and effects together, with the estimated noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rig.fitter import LinearFit, RankError, least_squares
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError
from rig.fitter.linear import orthonormal
from rig.fitter.split_plot import fit_split_plot
from rig.fitter.trace.engine.components import Components
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.shared import Shared
from rig.fitter.trace.engine.term import Profile


class Constant(NamedTuple):
    """A searched constant as found.

    Attributes:
        what: its name for people, such as "time constant"; "" for one without.
        value: in the unit of its column.
        stderr: its standard error; NaN if the rows do not determine it.
        df: degrees of freedom of that.
    """

    what: str
    value: float
    stderr: float
    df: float


@dataclass(frozen=True, eq=False)
class Estimate:
    """A fitted model.

    Attributes:
        chosen: candidates in it.
        at: covariance of the noise it was fitted with.
        coefficients: (k + d,) of the declared columns, then of the effects' columns.
        stderr: (k + d,) their standard errors, with the errors of searched constants by the delta method; NaN if the
            rows do not determine them.
        given: (k + d,) the same with searched constants as found.
        taken: effects of which a searched constant is taken as found in both, as the date of a step.
        dfs: (k + d,) degrees of freedom of these.
        fitted: (n,) fitted response.
        left: (n,) residuals of ordinary least squares of the same columns, whose standard error is `sigma_E`.
        sigma_E: standard error of one row, units of the response, with equal weights.
        df: degrees of freedom of that.
        constants: searched constants by candidate.
    """

    chosen: tuple[int, ...]
    at: int
    coefficients: FloatArray
    stderr: FloatArray
    given: FloatArray
    taken: tuple[str, ...]
    dfs: FloatArray
    fitted: FloatArray
    left: FloatArray
    sigma_E: float
    df: int
    constants: Mapping[int, tuple[Constant, ...]]


def estimate(
    judge: TableJudge, chosen: tuple[int, ...], tails: FloatArray | None = None, beside: tuple[int, ...] | None = None
) -> Estimate:
    """Fit the declared columns and those of the `chosen` candidates to all rows.

    Coefficients are generalised least squares with the estimated noise; isolated outliers are reduced to three standard
    deviations. The standard error of a row is that of ordinary least squares, so that before and after are comparable,
    also with other programs. Beside errors of whole plots, standard errors are those of Kenward and Roger: few whole
    plots say little of their variance.

    Args:
        judge: of the table.
        chosen: candidates in the model.
        tails: (n, k) rounding errors of the doubles in the declared columns.
        beside: candidates beside which a row is isolated for the standard error of a row; those chosen by default.
    """
    problem, at = judge.problem, judge.beside(chosen).best
    model = problem.model(chosen)
    k = model.shape[1]

    def errors(columns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """Coefficients, standard errors and degrees of freedom for a model whose first columns are these."""
        if at == 0 and np.ptp(problem.sd) == 0.0:
            fit = _solved(columns, judge.held(chosen), tails)
        else:
            white = problem.noise.whiten(np.array([at]), columns / problem.sd[:, None])[0]
            fit = _solved(white, judge.white(at, chosen), None)
        if fit is None:
            return None
        plain = fit[1], np.full(columns.shape[1], float(judge.problem.n - columns.shape[1]))
        return fit[0], *(_beside_shared(judge, chosen, columns, at, fit[1]) or plain)

    left, df = _plain(judge, chosen, problem.y)
    alone = errors(model) or (*_smallest(model, problem.y), np.full(k, float(df)))
    slopes, taken, found = of_constants(judge, chosen, alone[0][problem.declared.shape[1] :])
    with_them = errors(np.hstack([model, slopes])) if slopes.shape[1] else alone
    if with_them is None:
        names = (judge.candidates[j].effect.name for j in _searched(judge, chosen))
        with_them, taken, found = alone, tuple(dict.fromkeys(names)), ()
    (coefficients, given, _), (_, stderr, dfs) = alone, with_them
    fitted = model @ coefficients
    constants: dict[int, tuple[Constant, ...]] = {}
    for (j, profile, length), error, its_df in zip(found, stderr[k:].tolist(), dfs[k:].tolist(), strict=True):
        constants[j] = (*constants.get(j, ()), Constant(profile.what, profile.value, error / length, its_df))
    sigma_E = error_of(judge, chosen, chosen if beside is None else beside)
    stderr, dfs = stderr[:k], dfs[:k]
    return Estimate(chosen, at, coefficients, stderr, given, taken, dfs, fitted, left, sigma_E, df, constants)


def _searched(judge: TableJudge, chosen: Sequence[int]) -> list[int]:
    """Those of the candidates that have searched constants."""
    profiles = ((j, judge.candidates[j].term.profile) for j in chosen)
    return [j for j, profile in profiles if profile is not None and profile.low < profile.high]


def of_constants(
    judge: TableJudge, chosen: Sequence[int], sizes: FloatArray
) -> tuple[FloatArray, tuple[str, ...], Sequence[tuple[int, Profile, float]]]:
    """(n, c) change of the response with each searched constant of the chosen candidates, whose columns have these
    coefficients (d,), as columns of length 1; the effects of which the change is zero between rows; and of each column
    the candidate, the constant, and its length.
    """
    searched, columns, taken, start = set(_searched(judge, chosen)), [], [], 0
    found: list[tuple[int, Profile, float]] = []
    for j in chosen:
        term = judge.candidates[j].term
        own = sizes[start : start + term.columns.shape[1]]
        start += len(own)
        for profile in () if j not in searched or term.profile is None else term.profile.each:
            change = profile.slopes @ own
            length = float(np.linalg.norm(change))
            if np.count_nonzero(change) > 1:
                columns.append(change / length)
                found.append((j, profile, length))
            else:
                taken.append(judge.candidates[j].effect.name)
    return np.column_stack([np.zeros((judge.problem.n, 0)), *columns]), tuple(dict.fromkeys(taken)), found


def _beside_shared(
    judge: TableJudge, chosen: tuple[int, ...], model: FloatArray, at: int, stderr: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """(k + d,) standard errors and degrees of freedom of Kenward and Roger; None but for errors of whole plots.

    Where whole plots differ in their slopes too, or rows in them are alike, the standard errors (k + d,) of generalised
    least squares stay, with no more degrees of freedom than whole plots have: that these errors concern some terms only
    is not used.
    """
    noise = judge.problem.noise
    if not (type(noise) is Shared or isinstance(noise, Components)) or np.ptp(judge.problem.sd) > 0.0:
        return None  # `Both` has a wander too
    try:
        fit = fit_split_plot(model, judge.held(chosen), noise.group, [str(i) for i in range(model.shape[1])])
    except FitError:
        return None
    if isinstance(noise, Components) and np.any(noise.grid[at, 1:] > 0.0):
        return stderr, np.full(model.shape[1], min(float(np.min(fit.df)), float(noise.group.max())))
    return fit.kenward_roger().stderr, fit.df


def error_of(judge: TableJudge, chosen: tuple[int, ...], beside: tuple[int, ...]) -> float:
    """Standard error of one row beside the `chosen` candidates, as in `Estimate`.

    Rows that are isolated beside candidates count as three sd, with and without an effect as far beside the same: a
    gross error would hide what an effect takes away.
    """
    left, df = _plain(judge, chosen, judge.held(beside))
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


def stated(
    judge: TableJudge, chosen: tuple[int, ...], shared: IntArray | None, beside: tuple[int, ...]
) -> tuple[FloatArray, FloatArray]:
    """(1,) error that a trace states, of a row and of all strata, and (1,) sum of squares of residuals; `beside` as for
    `error_of`.
    """
    left, df = _plain(judge, chosen, judge.held(beside))
    parts = (_sigma(left, df), *(strata_of(judge, chosen, shared) or ()))
    return np.array([float(np.linalg.norm(parts))]), np.array([float(left @ left)])


def _sigma(left: FloatArray, df: int) -> float:
    return float(np.sqrt(left @ left / df)) if df > 0 else float("nan")


def _plain(judge: TableJudge, chosen: tuple[int, ...], y: FloatArray) -> tuple[FloatArray, int]:
    """(n,) residuals of a response (n,) by ordinary least squares, and their degrees of freedom."""
    basis = orthonormal(judge.problem.model(chosen))
    return y - basis @ (basis.T @ y), judge.problem.n - basis.shape[1]


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
