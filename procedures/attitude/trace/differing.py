"""What replications that differ add to the errors of coefficients that were fitted to all observations as one.

A drift, a temperature that changes from night to night and a step between replications are known no better than the
replications agree, however many readings they contain. Whether they do agree is seen in their own parameters beside
the effects. A difference that is too small for the test of drift may still be larger than the error by scatter alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.trace.problem import Problem

FEWEST_DF = 0.5
"""Minimum degrees of freedom for a variance between replications; with fewer they are taken to agree."""


def as_replications_differ(
    problem: Problem, chosen: Sequence[int], gamma: FloatArray, spread: FloatArray, sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(q, q) what is added to a covariance by scatter, and (q,) degrees of freedom (Satterthwaite, 1946).

    Each parameter of each sensor's own fits to the replications has its variance between them beside the effects. Where
    that is no larger than by scatter of readings, nothing is added, and the degrees of freedom are infinite.

    Args:
        problem: the run.
        chosen: the q candidates.
        gamma: (q,) their coefficients, fitted to all observations as one.
        spread: (q, q) covariance of these by scatter.
        sigma: (S,) standard error of an observation of each sensor, V.
    """
    moves = problem.own[..., list(chosen)] / sigma[:, None, None]
    own = problem.own_outputs / sigma[:, None] - moves @ gamma
    meat = np.einsum("nslj,nslk->sljk", moves, moves)
    df = len(own) - 1 - np.einsum("jk,sljk->sl", spread, meat)
    square = np.where(df > FEWEST_DF, np.sum(own**2, axis=0) / np.maximum(df, FEWEST_DF), 1.0)
    excess = np.maximum(square - 1.0, 0.0)
    variance = np.maximum(np.diag(spread), np.finfo(float).tiny)
    share = np.einsum("ij,sljk,ki->sli", spread, meat, spread) / variance
    ratio = 1.0 + np.einsum("sl,sli->i", excess, share)
    known = np.where(excess > 0.0, square**2 / np.maximum(df, FEWEST_DF), 0.0)
    uncertain = np.maximum(np.einsum("sl,sli->i", known, share**2), np.finfo(float).tiny)
    added = spread @ np.einsum("sl,sljk->jk", excess, meat) @ spread
    return np.asarray(added), np.asarray(ratio**2 / uncertain)
