"""The stratum of replications: effects that are nearly constant within one and vary from one to the next.

Each replication's own parameters are one observation here, and there are only n of them. What a candidate would do
to them is a direction in the space of parameters and a size for each replication; the parameters along that
direction are regressed on that size twice, as if replications wandered independently and as if they took a random
walk. The less favourable answer counts: a trend in six offsets that a random walk explains is no trend.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fitter.arrays import FloatArray
from fitter.attitude import attitude_columns
from fitter.quantiles import t_tail
from fitter.trace.problem import Problem
from fitter.trace.score import rounding

FEWEST = 4
"""Replications without which nothing can be said at this level."""


def p_between_replications(problem: Problem, chosen: tuple[int, ...], gamma: FloatArray) -> FloatArray:
    """(J,) probability of so good a relation between replications by chance; one where there is none to test.

    Args:
        problem: the run.
        chosen: candidates already in the model.
        gamma: their coefficients.

    """
    p = np.ones(len(problem.candidates))
    data = problem.scene.data
    if data.replicates.size < FEWEST:
        return p
    e = problem.outputs["declared"] - problem.columns["declared"][:, :, list(chosen)] @ gamma
    scale = np.maximum(e.std(axis=1), rounding(problem))[:, None]
    own_outputs, own_columns = (
        _own(problem, (e / scale)[:, :, None]),
        _own(problem, problem.columns["declared"] / scale[:, :, None]),
    )
    y = own_outputs[:, :, 0]
    length2 = np.sum((problem.length / scale) ** 2, axis=0)
    for j, candidate in enumerate(problem.candidates):
        if j in chosen or candidate.effect.stratum == "between-point":
            continue
        moves = own_columns[:, :, j] - own_columns[:, :, j].mean(axis=0)
        if np.sum(moves**2) < 1e-4 * length2[j]:
            continue
        direction = np.linalg.svd(moves)[2][0]
        x, u = moves @ direction, y @ direction
        df = x.size - 2
        p[j] = max(_p_slope(x - x.mean(), u - u.mean(), df), _p_slope(np.diff(x), np.diff(u), df))
    return p


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
