"""How much each candidate removes beyond the present model, against the error of its own stratum.

A candidate's score is its coefficient over the largest of its standard errors:

- from its stratum's residual beside it, which in a balanced design is the exact t test of that stratum;
- within whole plots also from the scatter of each reading's own contribution, which holds for unequal variances, and
  from that of whole plots' contributions, which holds where the sensitivity too is drawn anew in each;
- for what happens in the line also from the scatter of what all transducers together contribute, reading by reading or
  whole plot by whole plot: they may share the error, and then are not so many witnesses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from fitter.arrays import FloatArray, IntArray
from fitter.linear import orthonormal
from fitter.trace.whitened import Whitened
from fitter.trace.whole_plots.problem import Problem
from fitter.trace.whole_plots.strata import LEVELS, Level

NOTHING_LEFT = 0.02
"""A candidate of which less than this share is left beside the others in its stratum cannot be judged there: as little
as readbacks of temperatures scatter about what was set."""
RESOLVED = 1e-12
"""Of an output's swing: what is smaller than this is rounding, and data without noise are not tested against it."""


@dataclass(frozen=True, eq=False)
class Scores:
    """One entry a candidate, (J,); zero and one where a candidate is in the model or cannot be judged.

    Attributes:
        gamma: coefficient, in the candidate's own unit.
        t: the same over its standard error.
        df: degrees of freedom of that.
        p: probability of a larger score by chance, this candidate taken alone.
        gain: fall of the residual sum of squares, in units of the stratum's error.

    """

    gamma: FloatArray
    t: FloatArray
    df: FloatArray
    p: FloatArray
    gain: FloatArray


@dataclass(frozen=True, eq=False)
class Beside:
    """One stratum beside the candidates chosen.

    Attributes:
        white: what is left there, over each transducer's own error.
        sigma: (S,) that error, mV.
        df: (S,) degrees of freedom left.

    """

    white: Whitened
    sigma: FloatArray
    df: FloatArray


def beside(problem: Problem, level: Level, chosen: Sequence[int], of: Sequence[int] | IntArray | None = None) -> Beside:
    """The stratum with the `chosen` candidates taken out, those of the other stratum too.

    What is judged within whole plots is known from there, and enters their means with that coefficient.

    Args:
        problem: the run.
        level: the stratum.
        chosen: candidates in the model.
        of: the candidates whose columns are wanted; all of them if left out.

    """
    stratum = problem.at[level]
    wanted = np.arange(len(problem.candidates)) if of is None else np.asarray(of, np.int64)
    here = _present(problem, level, chosen) if level == "subplot" else problem.within(level, chosen)
    outputs, columns = stratum.outputs, stratum.columns[:, :, np.concatenate([here, wanted])]
    if level == "whole-plot":
        outputs, columns = _less_subplots(problem, chosen, np.concatenate([here, wanted]))
    taken, columns = columns[:, :, : here.size], columns[:, :, here.size :]
    sigma, df = _errors(problem, level, here, outputs, taken)
    scale = sigma[:, None]
    taken = taken / scale[:, :, None]
    white = Whitened(outputs / scale, columns / scale[:, :, None])
    return Beside(white.beside(taken, np.linalg.norm(taken, axis=(0, 1))), sigma, df)


def score(problem: Problem, chosen: Sequence[int], of: Sequence[int] | None = None) -> Scores:
    """Score candidates (those `of` interest, or all) beside the `chosen` ones, each in its own stratum."""
    count = len(problem.candidates)
    scores = Scores(np.zeros(count), np.zeros(count), np.ones(count), np.ones(count), np.zeros(count))
    for level in LEVELS:
        here = problem.within(level, of)
        if not here.size:
            continue
        stratum = beside(problem, level, chosen, here)
        white, columns = stratum.white, stratum.white.columns
        norm2, dot = np.sum(columns**2, axis=1), np.einsum("smj,sm->sj", columns, white.outputs)
        total = norm2.sum(axis=0)
        length2 = np.sum((problem.length_at[level][:, here] / stratum.sigma[:, None]) ** 2, axis=0)
        concerned = norm2 > 1e-6 * total
        df = np.min(np.where(concerned, stratum.df[:, None], np.inf), axis=0) - 1.0
        can = (total > NOTHING_LEFT**2 * length2) & ~np.isin(here, list(chosen)) & (df > 0) & np.isfinite(df)
        total, df = np.where(can, total, 1.0), np.where(can, df, 1.0)
        gamma = np.where(can, dot.sum(axis=0), 0.0) / total
        after = np.sum(white.outputs**2, axis=1)[:, None] - 2 * gamma * dot + gamma**2 * norm2
        pooled = np.maximum(np.sum(np.where(concerned, stratum.df[:, None], 0.0), axis=0) - 1.0, 1.0)
        plain = total * np.sum(np.where(concerned, after, 0.0), axis=0) / pooled
        own = np.einsum("smj,sm->mj", columns, white.outputs) - gamma * np.sum(columns**2, axis=0)
        variance = np.maximum(plain, _scatter(problem, level, own, df, concerned.sum(axis=0)))
        t = np.where(can, gamma * total / np.sqrt(np.maximum(variance, np.finfo(float).tiny)), 0.0)
        scores.gamma[here], scores.t[here], scores.df[here] = gamma, t, df
        scores.p[here] = np.where(can, 2.0 * special.stdtr(df, -np.abs(t)), 1.0)
        scores.gain[here] = np.where(can, gamma * dot.sum(axis=0), 0.0)
    return scores


def _errors(
    problem: Problem, level: Level, here: IntArray, outputs: FloatArray, taken: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(S,) error of each transducer with the columns `taken` (S, m, q) of candidates `here` fitted, mV, and its df."""
    sigma, df = np.empty(len(problem.sensors)), np.empty(len(problem.sensors))
    floor = RESOLVED * np.ptp(problem.outputs, axis=1)
    for i, (y, own) in enumerate(zip(outputs, taken, strict=True)):
        basis = orthonormal(own, problem.length_at[level][i, here], NOTHING_LEFT)
        left = y - basis @ (basis.T @ y)
        df[i] = problem.at[level].df[i] - basis.shape[1]
        sigma[i] = max(np.sqrt(np.sum(left**2) / df[i]) if df[i] > 0 else 1.0, floor[i], np.finfo(float).tiny)
    return sigma, df


def _scatter(problem: Problem, level: Level, own: FloatArray, df: FloatArray, witnesses: IntArray) -> FloatArray:
    """(J,) variance of each column's product with the outputs, from the scatter of its parts (m, J)."""
    m = len(own)
    single = np.sum(own**2, axis=0) * m / df
    if level == "whole-plot":
        return np.asarray(np.where(witnesses > 1, single, 0.0))
    plots = int(problem.whole_plot.max()) + 1
    by_plot = (np.arange(plots)[:, None] == problem.whole_plot).astype(np.float64) @ own
    return np.asarray(np.maximum(single, np.sum(by_plot**2, axis=0) * plots / max(plots - 1, 1)))


def _present(problem: Problem, level: Level, chosen: Sequence[int]) -> IntArray:
    """Those of the `chosen` that something is left of at a level."""
    picked = np.array(list(chosen), np.int64)
    left = np.linalg.norm(problem.at[level].columns[:, :, picked], axis=(0, 1))
    return np.asarray(picked[left > NOTHING_LEFT * np.linalg.norm(problem.length_at[level][:, picked], axis=0)])


def _less_subplots(problem: Problem, chosen: Sequence[int], of: IntArray) -> tuple[FloatArray, FloatArray]:
    """Whole plots' means of the outputs (S, W) and of the columns `of` (S, W, q), less what subplots say of `chosen`.

    The coefficients of the chosen candidates come from readings within whole plots; those of them that are judged
    there take their share out of the means.
    """
    means = problem.at["whole-plot"]
    outputs, columns = means.outputs, means.columns[:, :, of]
    here, stratum = _present(problem, "subplot", chosen), problem.at["subplot"]
    known = np.isin(here, problem.within("subplot", chosen))
    if not np.any(known):
        return outputs, columns
    taken = stratum.columns[:, :, here]
    scale = _errors(problem, "subplot", here, stratum.outputs, taken)[0][:, None, None]
    both = np.concatenate([stratum.outputs[:, :, None], stratum.columns[:, :, of]], axis=2) / scale
    count = both.shape[0] * both.shape[1]
    gamma = np.linalg.lstsq((taken / scale).reshape(count, -1), both.reshape(count, -1), rcond=1e-9)[0]
    share = means.columns[:, :, here[known]] @ gamma[known]
    return outputs - share[:, :, 0], columns - share[:, :, 1:]
