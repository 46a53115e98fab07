"""Influence of the estimated noise on the intervals of the declared model's coefficients."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.engine.judge import TableJudge

UNDETERMINED = 1e-10
NOTABLE = 0.05
"""Relative change of a standard error below which there is no report."""
_TINY = np.finfo(float).tiny


def understated(judge: TableJudge, chosen: tuple[int, ...], *, at: int, weighted: bool) -> FloatArray | None:
    """(k,) ratio of true to stated standard errors of least-squares coefficients.

    Least squares with equal weights and independent rows, of the declared model and the effects: its estimates have the
    covariance A X'VX A, A = (X'X)^-1, and it states s^2 A with E s^2 = tr(MV)/(n - k).

    Args:
        judge: of the table.
        chosen: effects in the model.
        at: covariance of the common errors of rows.
        weighted: whether each row also has its own standard deviation.

    Returns:
        For the declared columns; None if rows do not determine them.
    """
    problem = judge.problem
    model = problem.model(chosen)
    length = np.linalg.norm(model, axis=0)
    if not length.all():
        return None
    scaled = model / length
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    if values[0] < UNDETERMINED * values[-1]:
        return None
    inverse = (vectors / values) @ vectors.T
    sd = problem.sd if weighted else np.ones(problem.n)
    noise, sd = problem.noise.over(sd), sd[:, None]
    sums = noise.root(at, sd * (scaled @ inverse))
    basis = orthonormal(model)
    total = float(np.sum(noise.variances(at) * sd[:, 0] ** 2))
    taken = float(np.sum(noise.root(at, sd * basis) ** 2))
    stated = max(total - taken, _TINY) / (problem.n - basis.shape[1]) * np.diag(inverse)
    k = problem.declared.shape[1]
    return np.asarray(np.sqrt(np.sum(sums**2, axis=0) / stated)[:k])


def moved(judge: TableJudge, chosen: tuple[int, ...]) -> tuple[FloatArray, float] | None:
    """Influence of isolated outliers on least squares with equal weights.

    Returns:
        (k,) changes of the declared coefficients, in standard errors, and factor of the width of intervals; None if
        rows do not determine the coefficients.
    """
    problem = judge.problem
    model = problem.model(chosen)
    length = np.linalg.norm(model, axis=0)
    if not length.all() or problem.n <= model.shape[1]:
        return None
    scaled = model / length
    solved, _, rank, _ = np.linalg.lstsq(scaled, np.column_stack([problem.y, judge.held(chosen)]), rcond=UNDETERMINED)
    if rank < model.shape[1]:
        return None
    left = np.column_stack([problem.y, judge.held(chosen)]) - scaled @ solved
    s = np.sqrt(np.sum(left**2, axis=0) / (problem.n - rank))
    errors = s[1] * np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled)))
    shift = (solved[:, 0] - solved[:, 1]) / np.maximum(errors, _TINY)
    return shift[: problem.declared.shape[1]], float(s[0] / max(s[1], _TINY))


def in_words(names: Sequence[str], factor: FloatArray | None) -> str:
    """The result of `understated`, as part of a sentence; "" without a result."""
    if factor is None or not len(factor):
        return ""
    factor = factor[: len(names)]  # columns of rows that are apart have no name
    far = np.flatnonzero(np.abs(factor - 1.0) > NOTABLE)
    if not len(far):
        return "least squares of independent rows of one scatter states standard errors right to 5 %"
    few = [i for i in far.tolist() if names[i] != "1"][:3] if len(far) > 3 else far.tolist()
    listed = ", ".join(f"{names[i] if names[i] != '1' else 'the intercept'} {factor[i]:.2g}" for i in few)
    return f"true standard errors over those of least squares of independent rows: {listed}"
