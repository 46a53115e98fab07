"""Score of each candidate beyond the present model, against the error of its own stratum.

A candidate's score is its coefficient over the largest of its standard errors:

- from its stratum's residual beside it, which in a balanced design is the exact t test of that stratum;
- within whole plots also from the scatter of each reading's own contribution, which holds for unequal variances, and
  from that of whole plots' contributions, which holds where the sensitivity too is drawn again in each; and
  from the scatter of whole plots' slopes with pressure, where that is more than readings explain, with as many degrees
  of freedom as there are whole plots to know it by;
- between whole plots also at several correlations of neighbours in time, averaged by how likely these are
  (`neighbours`);
- for what happens in the line also from the scatter of what all transducers together contribute, reading by reading or
  whole plot by whole plot: they may share the error, and then are not so many witnesses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.whitened import Whitened
from rig.procedures.pressure.trace.neighbours import neighbours
from rig.procedures.pressure.trace.problem import Problem
from rig.procedures.pressure.trace.strata import LEVELS, Level

NOTHING_LEFT = 0.02
"""Minimum remaining share of a candidate beside the others in its stratum: above the scatter of temperature readbacks
about their setting.
"""
CHANCE = 0.05
"""Probability of the scatter of whole plots' slopes, below which sensitivities are assumed to vary between
whole plots.
"""
SLOPES = 3
"""Terms of slopes in a declared model: P, and P times both temperatures."""
FEW = 8
"""Candidates of one transducer up to which they are scored without the others."""
TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Scores:
    """One entry per candidate, (J,); zero and one for a candidate that is in the model or cannot be judged.

    Attributes:
        gamma: coefficient, in the candidate's own unit.
        t: the same over its standard error.
        df: degrees of freedom of that.
        p: probability of a larger score by chance, for this candidate alone.
        gain: reduction of the residual sum of squares, in units of the stratum's error.
        p_plain: as `p`, from the residual's own standard error alone.
    """

    gamma: FloatArray
    t: FloatArray
    df: FloatArray
    p: FloatArray
    gain: FloatArray
    p_plain: FloatArray


@dataclass(frozen=True, eq=False)
class Beside:
    """One stratum beside the chosen candidates.

    Attributes:
        white: its residuals, over each transducer's own error.
        sigma: (S,) that error, mV.
        df: (S,) remaining degrees of freedom.
    """

    white: Whitened
    sigma: FloatArray
    df: FloatArray


def beside(problem: Problem, level: Level, chosen: Sequence[int], of: Sequence[int] | IntArray | None = None) -> Beside:
    """The stratum with the `chosen` candidates removed, those of the other stratum with coefficients from there.

    A candidate judged within whole plots enters their means with its coefficient from within; a candidate judged
    between them, such as a drift, continues within them with its coefficient from between.

    Args:
        problem: the run.
        level: the stratum.
        chosen: candidates in the model.
        of: the candidates of the columns; by default all.
    """
    stratum = problem.at[level]
    wanted = np.arange(len(problem.candidates)) if of is None else np.asarray(of, np.int64)
    here = problem.within(level, chosen)
    if level == "whole-plot":
        outputs, both = _less_subplots(problem, chosen, np.concatenate([here, wanted]))
        taken, columns = both[:, :, : here.size], both[:, :, here.size :]
    else:
        outputs = _less_whole_plots(problem, chosen)
        columns, taken = stratum.columns[:, :, wanted], stratum.columns[:, :, here]
    sigma, df = _errors(problem, level, here, outputs, taken)
    scale = sigma[:, None]
    columns /= scale[:, :, None]
    taken = taken / scale[:, :, None]
    white = Whitened(outputs / scale, columns)
    return Beside(white.beside(taken, np.linalg.norm(taken, axis=(0, 1))), sigma, df)


def score(problem: Problem, chosen: Sequence[int], of: Sequence[int] | None = None) -> Scores:
    """Score candidates (those `of` interest, or all) beside the `chosen` ones, each in its own stratum.

    Without a candidate of the line among the `chosen`, every transducer's own are scored with it alone.
    """
    sensor = problem.sensor_of
    if len(problem.sensors) == 1 or any(sensor[j] is None for j in chosen):
        return _scored(problem, chosen, of)
    wanted, in_model = _among(len(sensor), range(len(sensor)) if of is None else of), _among(len(sensor), chosen)
    line = tuple(j for j in np.flatnonzero(wanted).tolist() if sensor[j] is None)
    scores = _copied(_known(problem, tuple(chosen), line))
    for alone, mine in problem.alone:
        asked = np.flatnonzero(wanted[mine])
        if asked.size:
            beside_it = tuple(np.flatnonzero(in_model[mine]).tolist())
            few = asked.size < FEW and (beside_it, None) not in _KNOWN.get(alone, {})
            own = _known(alone, beside_it, tuple(asked.tolist()) if few else None)
            for every, part in zip(vars(scores).values(), vars(own).values(), strict=True):
                every[mine[asked]] = part[asked]
    return scores


_KNOWN: WeakKeyDictionary[Problem, dict[tuple[Any, Any], Scores]] = WeakKeyDictionary()
"""By candidates in the model and candidates scored: one more candidate changes the scores of one transducer only."""


def _known(problem: Problem, chosen: tuple[int, ...], of: tuple[int, ...] | None) -> Scores:
    known = _KNOWN.setdefault(problem, {})
    if (chosen, of) not in known:
        known[chosen, of] = _scored(problem, chosen, of)
    return known[chosen, of]


def _among(count: int, these: Sequence[int] | IntArray) -> NDArray[np.bool_]:
    """(count,) whether each index is one of these."""
    out = np.zeros(count, np.bool_)
    out[np.asarray(these, np.int64)] = True
    return out


def _copied(scores: Scores) -> Scores:
    return Scores(*(each.copy() for each in vars(scores).values()))


def _scored(problem: Problem, chosen: Sequence[int], of: Sequence[int] | None) -> Scores:
    count = len(problem.candidates)
    zero, one = np.zeros(count), np.ones(count)
    scores = Scores(zero, zero.copy(), one, one.copy(), zero.copy(), one.copy())
    for level in LEVELS:
        here = problem.within(level, of)
        if not here.size:
            continue
        stratum = beside(problem, level, chosen, here)
        white, columns = stratum.white, stratum.white.columns
        squares = columns**2
        norm2, dot = np.sum(squares, axis=1), np.einsum("smj,sm->sj", columns, white.outputs)
        total = norm2.sum(axis=0)
        length2 = np.sum((problem.length_at[level][:, here] / stratum.sigma[:, None]) ** 2, axis=0)
        concerned = norm2 > 1e-6 * total
        df = np.min(np.where(concerned, stratum.df[:, None], np.inf), axis=0) - 1.0
        can = (total > NOTHING_LEFT**2 * length2) & ~_among(count, chosen)[here] & (df > 0) & np.isfinite(df)
        total, df = np.where(can, total, 1.0), np.where(can, df, 1.0)
        gamma = np.where(can, dot.sum(axis=0), 0.0) / total
        after = np.sum(white.outputs**2, axis=1)[:, None] - 2 * gamma * dot + gamma**2 * norm2
        pooled = np.maximum(np.sum(np.where(concerned, stratum.df[:, None], 0.0), axis=0) - 1.0, 1.0)
        plain = total * np.sum(np.where(concerned, after, 0.0), axis=0) / pooled
        squares = np.sum(squares, axis=0)
        own = np.einsum("smj,sm->mj", columns, white.outputs) - gamma * squares
        single = np.sum(own**2, axis=0) * len(own) / df
        if level == "whole-plot":
            variance = np.maximum(plain, np.where(concerned.sum(axis=0) > 1, single, 0.0))
        else:
            slow = _by_whole_plot(problem, own, squares)
            drawn, drawn_df = _of_slopes(problem, columns, white.outputs)
            both = plain + drawn
            spread = plain**2 / df + drawn**2 / np.maximum(drawn_df, 1.0)
            df = np.where((drawn > 0) & (spread > 0), both**2 / np.where(spread > 0, spread, 1.0), df)
            variance = np.maximum(np.maximum(both, single), slow)
        t = np.where(can, gamma * total / np.sqrt(np.where(variance > 0, variance, np.inf)), 0.0)
        alone = np.where(can, gamma * total / np.sqrt(np.where(plain > 0, plain, np.inf)), 0.0)
        if level == "whole-plot":
            p, p_plain = neighbours(problem, chosen).p(np.stack([t, alone]), df, columns, white.outputs)
        else:
            p, p_plain = (2.0 * special.stdtr(df, -np.abs(score)) for score in (t, alone))
        scores.gamma[here], scores.t[here], scores.df[here] = gamma, t, df
        scores.p[here], scores.p_plain[here] = np.where(can, p, 1.0), np.where(can, p_plain, 1.0)
        scores.gain[here] = np.where(can, gamma * dot.sum(axis=0), 0.0)
    return scores


def _errors(
    problem: Problem, level: Level, here: IntArray, outputs: FloatArray, taken: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(S,) error of each transducer with the columns `taken` (S, m, q) of candidates `here` fitted, mV, and its df."""
    df, left = problem.at[level].df.copy(), outputs
    concerned = np.flatnonzero(np.any(problem.length_at[level][:, here] > 0, axis=1))
    if concerned.size:
        left = outputs.copy()
    for i in concerned.tolist():
        basis = orthonormal(taken[i], problem.length_at[level][i, here], NOTHING_LEFT)
        left[i] -= basis @ (basis.T @ outputs[i])
        df[i] -= basis.shape[1]
    mean = np.where(df > 0, np.sum(left**2, axis=1) / np.where(df > 0, df, 1.0), 1.0)
    return np.maximum(np.sqrt(mean), problem.rounding), df


def _of_slopes(problem: Problem, columns: FloatArray, left: FloatArray) -> tuple[FloatArray, float]:
    """Contribution of sensitivities that vary between whole plots to the variance of columns' products, and its df.

    Slopes of whole plots' residuals with pressure, beside the candidate's contribution, are compared with the readings'
    scatter; nothing is added if chance explains them.

    Args:
        problem: the run.
        columns: (S, n, J) over each transducer's error.
        left: (S, n) residual outputs, over the same.
    """
    df = float(max(len(problem.members) - SLOPES - 1, 1))
    if "P" not in problem.names or len(problem.members) <= SLOPES + 2:
        return np.zeros(columns.shape[2]), df
    rows = _slopes_of(problem)
    slopes, own = (rows @ left[:, :, None])[:, :, 0], rows @ columns
    squares = np.sum(own**2, axis=1)
    explained = (slopes[:, None] @ own)[:, 0] ** 2 / np.maximum(squares, TINY)
    ratio = (np.sum(slopes**2, axis=1)[:, None] - explained) / df
    # the difference above may be negative in its last bit, and the tail of a negative ratio is not a number
    clear = special.fdtrc(df, problem.at["subplot"].df[:, None], np.maximum(ratio, 0.0)) < CHANCE
    return np.sum(np.where(clear, (ratio - 1.0) * squares, 0.0), axis=0), df


_SLOPES: WeakKeyDictionary[Problem, FloatArray] = WeakKeyDictionary()


def _slopes_of(problem: Problem) -> FloatArray:
    """(S, W, n) unit rows whose products with whitened readings are slopes of whole plots with pressure."""
    if problem not in _SLOPES:
        p = problem.declared[:, problem.names.index("P")]
        p = p - ((problem.members @ p) / problem.members.sum(axis=1))[problem.whole_plot]
        rows = problem.members * np.stack([strata.whiten(p[:, None])[:, 0] for strata in problem.strata])[:, None]
        _SLOPES[problem] = rows / np.sqrt(np.maximum(np.sum(rows**2, axis=2, keepdims=True), TINY))
    return _SLOPES[problem]


def _by_whole_plot(problem: Problem, own: FloatArray, norm2: FloatArray) -> FloatArray:
    """(J,) variance of each column's product with the outputs from the scatter of whole plots' contributions.

    Each contribution is corrected for its share absorbed by the fit (Bell and McCaffrey, Survey Methodology 28 (2002)
    169, for one column).

    Args:
        problem: the run.
        own: (n, J) contribution of each reading to the products.
        norm2: (n, J) the columns' squares.
    """
    mass = problem.members @ norm2
    share = mass / np.maximum(mass.sum(axis=0), TINY)
    return np.asarray(np.sum((problem.members @ own) ** 2 / np.maximum(1.0 - share, 0.01), axis=0))


def _less_subplots(problem: Problem, chosen: Sequence[int], of: IntArray) -> tuple[FloatArray, FloatArray]:
    """Whole plots' means of outputs (S, W) and of the columns `of` (S, W, q), minus contributions of `chosen` known
    from subplots.
    """
    means, known = problem.at["whole-plot"], problem.within("subplot", chosen)
    outputs, columns = means.outputs, means.columns[:, :, of]
    if not known.size:
        return outputs, columns
    stratum = problem.at["subplot"]
    both = np.concatenate([stratum.outputs[:, :, None], stratum.columns[:, :, of]], axis=2)
    share = means.columns[:, :, known] @ _fitted(problem, "subplot", known, both)
    return outputs - share[:, :, 0], columns - share[:, :, 1:]


def _less_whole_plots(problem: Problem, chosen: Sequence[int]) -> FloatArray:
    """(S, n) outputs within whole plots, minus contributions of `chosen` known from whole plots' means."""
    stratum, known = problem.at["subplot"], problem.within("whole-plot", chosen)
    if not known.size:
        return stratum.outputs
    means = _less_subplots(problem, chosen, known)[0]
    share = stratum.columns[:, :, known] @ _fitted(problem, "whole-plot", known, means[:, :, None])
    return np.asarray(stratum.outputs - share[:, :, 0])


def _fitted(problem: Problem, level: Level, known: IntArray, to: FloatArray) -> FloatArray:
    """(q, r) coefficients of the candidates `known` fitted to (S, m, r) at a level, all transducers together."""
    taken = problem.at[level].columns[:, :, known]
    scale = _errors(problem, level, known, to[:, :, 0], taken)[0][:, None, None]
    count = to.shape[0] * to.shape[1]
    solved = np.linalg.lstsq((taken / scale).reshape(count, -1), (to / scale).reshape(count, -1), rcond=1e-9)
    return np.asarray(solved[0])
