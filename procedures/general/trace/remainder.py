"""The remainder after the effects, and its place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy import special

from fitter.arrays import FloatArray, IntArray
from fitter.linear import orthonormal
from fitter.quantiles import f_tail
from procedures.general.trace.judge import TableJudge
from procedures.general.trace.noise import Wandering
from procedures.general.trace.score import NOTHING_LEFT, blocks
from procedures.general.trace.smooth import Smooth, curve, offered

UNEXPLAINED = 1e-3
"""Probability below which there is a remainder, over all tested places."""
SUSPECTS = 2
ORDERS = (3, 6, 12)
"""Maximum order of curves tested over each variable."""
BINS, FEWEST_IN_BIN = 8, 4


def pure_error(y: FloatArray, points: IntArray | None, effects: FloatArray) -> float | None:
    """Standard deviation of rows that repeat one setting; None without repeats.

    Args:
        y: (n,) response.
        points: (n,) setting of each row; None without settings.
        effects: (n, d) columns of effects that may differ within a setting; they are fitted first.
    """
    if points is None:
        return None
    count = np.maximum(np.bincount(points), 1)[:, None]
    both = np.column_stack([y, effects])
    sums = np.zeros((len(count), both.shape[1]))
    np.add.at(sums, points, both)
    within = both - (sums / count)[points]
    basis = orthonormal(within[:, 1:], np.linalg.norm(effects, axis=0), NOTHING_LEFT)
    df = len(y) - len(np.unique(points)) - basis.shape[1]
    if df < 1:
        return None
    left = within[:, 0] - basis @ (basis.T @ within[:, 0])
    return float(np.sqrt(left @ left / df))


def unnamed(judge: TableJudge, chosen: tuple[int, ...], variables: Mapping[str, FloatArray]) -> tuple[Smooth, ...]:
    """The variable over which the residual most clearly follows a smooth curve, and a slow walk if any.

    Curves of a few orders are tested over each variable; the residual's noise is that estimated with the effects.
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
    tried = 0
    for name, v in variables.items():
        waves = curve(v)
        for order in dict.fromkeys(min(order, waves.shape[1]) for order in ORDERS if waves.shape[1]):
            whitened = problem.noise.whiten(np.array([at]), waves[:, :order] / problem.sd[:, None])[0]
            own = blocks(whitened, np.array([0, order]), np.linalg.norm(whitened, axis=0), taken)
            gain, rank = float(own.gains(left)[0]), int(own.rank[0])
            if rank < 1 or df - rank < 2 or gain <= NOTHING_LEFT * rss:
                continue
            tried += 1
            found.append((f_tail(gain / rank / ((rss - gain) / (df - rank)), rank, df - rank), name, gain / rss))
    slow = _slow(judge, chosen)
    if not found:
        return slow
    p, name, share = min(found)
    if p * tried >= UNEXPLAINED:
        return slow
    where = f"over {name}{_most(variables[name], left)}"
    return (*slow, _told(offered(judge, chosen, name, variables[name], share, where=where)))


def _slow(judge: TableJudge, chosen: tuple[int, ...]) -> tuple[Smooth, ...]:
    """A walk so slow that it is as likely an effect in time as noise, with the effects nearest to it."""
    noise, beside = judge.problem.noise, judge.beside(chosen)
    at = beside.best
    if not isinstance(noise, Wandering) or not noise.slow[at]:
        return ()
    if special.chdtrc(2, 2.0 * max(float(beside.reml[at] - beside.reml[0]), 0.0)) > UNEXPLAINED:
        return ()
    names = [f"{name} (p {p:.2g})" for name, p in judge.suspects(chosen)[:SUSPECTS] if p < 0.5]
    near = f"; nearest to it come {' and '.join(names)}" if names else ""
    share = 1.0 - float(np.min(beside.sigma2 * np.exp(noise.log_det / judge.problem.n)) / beside.sigma2[0])
    where = f"along the rows, as a wander so slow that it may be noise or an effect in time{near}"
    share = float(np.clip(share, 0.0, 1.0))
    return (_told(offered(judge, chosen, "row", noise.when, share, where=where, stratum="noise")),)


def _told(rest: Smooth) -> Smooth:
    """The same with the available curve, in words."""
    period = f" (period {rest.period:.4g})" if rest.period is not None else ""
    text = (
        f"{rest.where}; a smooth curve of order {rest.order} over {rest.variable}{period} would take the standard "
        f"error from {rest.sigma_E[0]:.4g} to {rest.sigma_E[1]:.4g}, at random rows left out from "
        f"{rest.left_out[0]:.4g} to {rest.left_out[1]:.4g}"
    )
    return replace(rest, where=text)


def _most(v: FloatArray, left: FloatArray) -> str:
    """The part of a variable's range where the mean residual is farthest from zero, in words."""
    count = min(BINS, len(v) // FEWEST_IN_BIN, len(np.unique(v)))
    if count < 3:
        return ""
    edges = np.unique(np.quantile(v, np.arange(1, count) / count))
    index = np.searchsorted(edges, v, side="left")
    rows = np.maximum(np.bincount(index), 1)
    worst = int(np.argmax(np.abs(np.bincount(index, left) / rows) * np.sqrt(rows)))
    own = v[index == worst]
    return f", most between {own.min():.4g} and {own.max():.4g}"
