"""The stratum of replications: effects that are nearly constant within one and vary from one to the next.

Each replication's own parameters are one observation here, and there are only n of them. What a candidate would do
to them is a direction in the space of parameters and a size for each replication; the parameters along that
direction are regressed on that size twice, as if replications wandered independently and as if they took a random
walk. The less favourable answer counts: a trend in six offsets that a random walk explains is no trend.

A package that slips turns all sensors alike. What their axes do beside that, 9 numbers a replication for three sensors,
is error enough to judge it by.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fitter.arrays import FloatArray
from fitter.attitude import attitude_columns
from fitter.linear import orthonormal
from fitter.quantiles import f_tail, t_tail
from fitter.trace.problem import Problem
from fitter.trace.score import errors, rounding

FEWEST = 4
"""Replications without which nothing can be said at this level."""


def p_between_replications(problem: Problem, chosen: tuple[int, ...], gamma: FloatArray) -> FloatArray:
    """(U,) probability of so good a relation between replications by chance; one where there is none to test.

    Tested are single columns, of searched ones those of temperature, and units of stratum "replication".

    Args:
        problem: the run.
        chosen: candidates already in the model.
        gamma: their coefficients.

    """
    p = np.ones(len(problem.units))
    data = problem.scene.data
    tested = [u for u, unit in enumerate(problem.units) if _tested(problem, unit) and not set(unit) & set(chosen)]
    if data.replicates.size < FEWEST or not tested:
        return p
    e = problem.outputs - problem.columns_at("declared", chosen) @ gamma
    scale = np.maximum(e.std(axis=1), rounding(problem))
    picked = [j for u in tested for j in problem.units[u]]
    both = np.concatenate([e[:, :, None], problem.columns_at("declared", picked)], axis=2) / scale[:, None, None]
    own = _own(problem, both)
    y, own_columns = own[:, :, 0], own[:, :, 1:]
    length2 = np.sum((problem.length[:, picked] / scale[:, None]) ** 2, axis=0)
    pure = errors(problem, chosen) / scale
    first = 0
    for u in tested:
        at = slice(first, first + len(problem.units[u]))
        first = at.stop
        moves = own_columns[:, :, at] - own_columns[:, :, at].mean(axis=0)
        if np.sum(moves**2) < 1e-4 * np.max(length2[at]):
            continue
        if problem.candidates[problem.units[u][0]].effect.stratum == "replication":
            p[u] = _p_turn(moves, y - y.mean(axis=0), np.repeat(pure, y.shape[1] // pure.size))
            continue
        moves = moves[:, :, 0]
        direction = np.linalg.svd(moves)[2][0]
        x, v = moves @ direction, y @ direction
        df = x.size - 2
        p[u] = max(_p_slope(x - x.mean(), v - v.mean(), df), _p_slope(np.diff(x), np.diff(v), df))
    return p


def _tested(problem: Problem, unit: tuple[int, ...]) -> bool:
    effect = problem.candidates[unit[0]].effect
    if effect.stratum == "replication":
        return problem.judged_at[unit[0]] == "replications"
    slow = not effect.searched or effect.source == "temperature"
    return effect.stratum != "between-point" and slow and len(unit) == 1


def _p_turn(moves: FloatArray, y: FloatArray, pure: FloatArray) -> float:
    """P of a unit that moves several parameters of all sensors in a common proportion from one replication on.

    What else those parameters do is the error, if it is more than the scatter of readings explains. Tested on the
    parameters themselves, as if replications differed independently, and on their changes, as if they took a random
    walk; the worse counts.

    Args:
        moves: (n_rep, m, q) what each of the unit's columns does to the m parameters, centred.
        y: (n_rep, m) the parameters, in units that readings know them by, centred.
        pure: (m,) scatter of readings in the same units.

    """
    moved = np.linalg.norm(moves, axis=(0, 2))
    concerned = moved > 0.05 * moved.max()
    worst = 0.0
    for columns, values, each in (
        (moves, y, y.shape[0] - 1),
        (np.diff(moves, axis=0) / np.sqrt(2), np.diff(y, axis=0) / np.sqrt(2), y.shape[0] - 1),
    ):
        x = (columns / pure[:, None])[:, concerned].reshape(-1, columns.shape[2])
        v = (values / pure)[:, concerned].reshape(-1)
        basis = orthonormal(x)
        explained, df = float(np.sum((basis.T @ v) ** 2)), each * int(concerned.sum()) - basis.shape[1]
        if df <= 0 or not basis.shape[1]:
            return 1.0
        error = max((float(v @ v) - explained) / df, 1.0)
        worst = max(worst, f_tail(explained / basis.shape[1] / error, basis.shape[1], df))
    return worst


def _own(problem: Problem, columns: FloatArray) -> FloatArray:
    """(n_rep, S L, q) parameters of each replication's own fit to `columns` (S, n, q), scaled alike."""
    data = problem.scene.data
    h = attitude_columns(data.pitch_deg, data.roll_deg, roll=problem.scene.roll)
    metric = np.linalg.qr(h, mode="r") / np.sqrt(data.replicates.size)
    rows: list[NDArray[np.bool_]] = [data.replicate_index == r for r in range(data.replicates.size)]
    own = [metric @ np.linalg.pinv(h[picked]) @ columns[:, picked] for picked in rows]
    return np.stack([block.reshape(-1, columns.shape[2]) for block in own])


def _p_slope(x: FloatArray, u: FloatArray, df: int) -> float:
    """Two-tailed p of the slope of u on x through the origin."""
    xx = float(np.sum(x**2))
    if xx <= 0:
        return 1.0
    slope = float(x @ u) / xx
    rss = max(float(np.sum((u - slope * x) ** 2)), np.finfo(float).tiny)
    return t_tail(slope * float(np.sqrt(xx * df / rss)), df)
