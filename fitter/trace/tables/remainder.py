"""What is left beside the effects, and where it lives."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import special

from fitter.arrays import FloatArray, IntArray
from fitter.quantiles import f_tail
from fitter.trace.result import Unnamed
from fitter.trace.tables.judge import TableJudge
from fitter.trace.tables.noise import Wandering
from fitter.trace.tables.score import NOTHING_LEFT, blocks

UNEXPLAINED = 1e-3
"""What is left counts as left below this probability, over all places looked at."""
SUSPECTS = 2
BINS, FEWEST_IN_BIN = 8, 4


def pure_error(y: FloatArray, points: IntArray | None) -> tuple[float, int] | None:
    """Standard deviation of rows that repeat one setting, and its degrees of freedom; None where none do."""
    if points is None:
        return None
    count = np.bincount(points)
    df = len(y) - int(np.sum(count > 0))
    if df < 1:
        return None
    means = np.bincount(points, y) / np.maximum(count, 1)
    return float(np.sqrt(np.sum((y - means[points]) ** 2) / df)), df


def unnamed(judge: TableJudge, chosen: tuple[int, ...], variables: Mapping[str, FloatArray]) -> tuple[Unnamed, ...]:
    """Variables over whose range the residual's mean still changes, the clearest only.

    The residual is averaged over eight parts of a variable's range; its noise is that found beside the effects.
    """
    at = judge.beside(chosen).best
    view, white = judge.view(at), judge.white(at, chosen)
    problem, taken = judge.problem, view.taken(chosen)
    left = white - taken @ (taken.T @ white)
    df = problem.n - taken.shape[1]
    rss = float(left @ left)
    if rss <= view.rounding:
        return ()
    found: list[tuple[float, str, float]] = []
    for name, v in variables.items():
        member = _bins(v)
        if member.shape[1] < 3:
            continue
        whitened = problem.noise.whiten(np.array([at]), member / problem.sd[:, None])[0]
        start, length = np.array([0, member.shape[1]]), np.linalg.norm(whitened, axis=0)
        own = blocks(whitened, start, length, taken)
        gain, rank = float(own.gains(left)[0]), int(own.rank[0])
        if rank < 1 or df - rank < 2 or gain <= NOTHING_LEFT * rss:
            continue
        p = f_tail(gain / rank / ((rss - gain) / (df - rank)), rank, df - rank)
        means = (member.T @ left) / np.maximum(member.sum(axis=0), 1.0)
        worst = int(np.argmax(np.abs(means)))
        rows = v[member[:, worst] > 0]
        found.append((p, f"over {name}, most between {rows.min():.4g} and {rows.max():.4g}", gain / rss))
    slow = _slow(judge, chosen)
    if not found:
        return slow
    p, where, share = min(found)
    return (*slow, Unnamed(where, share)) if p * len(found) < UNEXPLAINED else slow


def _slow(judge: TableJudge, chosen: tuple[int, ...]) -> tuple[Unnamed, ...]:
    """A wander so slow that it is as likely an effect in time as noise, with the effects that come nearest to it."""
    noise, beside = judge.problem.noise, judge.beside(chosen)
    at = beside.best
    if not isinstance(noise, Wandering) or not noise.slow[at]:
        return ()
    if special.chdtrc(2, 2.0 * max(float(beside.reml[at] - beside.reml[0]), 0.0)) > UNEXPLAINED:
        return ()
    names = [f"{name} (p {p:.2g})" for name, p in judge.suspects(chosen)[:SUSPECTS] if p < 0.5]
    near = f"; nearest to it come {' and '.join(names)}" if names else ""
    share = 1.0 - float(np.min(beside.sigma2 * np.exp(noise.log_det / judge.problem.n)) / beside.sigma2[0])
    return (Unnamed(f"in the order of taking, as a slow wander{near}", float(np.clip(share, 0.0, 1.0))),)


def _bins(v: FloatArray) -> FloatArray:
    """(n, bins) one where a row is in a part of the range; parts hold about as many rows each."""
    count = min(BINS, len(v) // FEWEST_IN_BIN, len(np.unique(v)))
    if count < 3:
        return np.empty((len(v), 0))
    edges = np.unique(np.quantile(v, np.arange(1, count) / count))
    index = np.searchsorted(edges, v, side="left")
    return np.asarray(index[:, None] == np.unique(index)[None, :], np.float64)
