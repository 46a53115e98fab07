"""Whole plots whose errors are correlated with the errors of their neighbours in time.

A chamber, a room or a supply that wanders over hours makes neighbouring whole plots alike, and whatever is slow, a
drift, a step, a memory, looks like that. Few whole plots do not say how alike they are: shapes without a name are
tested at several correlations.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.among_alike import Alike
from rig.fitter.trace.engine.beside import View
from rig.fitter.trace.engine.components import Components

RHO = np.array([0.0, 0.25, 0.5, 0.7, 0.85])
"""Tried correlations of neighbours."""
PRIOR = np.array([0.2, 0.15, 0.2, 0.25, 0.2])
"""Prior probability of each: chosen for 5 % of false alarms, at a correlation of 0.7 too."""
TINY = float(np.finfo(float).tiny)


def alike(view: View, in_time: IntArray, i: int) -> tuple[Alike, ...]:
    """Errors of whole plots of transducer `i` at each correlation.

    Args:
        view: whole plots beside the model.
        in_time: (W,) these in the order of running.
        i: the transducer.
    """
    errors, free = view.white.errors[i], view.free(i)
    noise = errors.noise
    assert isinstance(noise, Components)  # whoever has groups
    place = np.argsort(in_time)
    rows = np.bincount(noise.group, errors.sd**-2.0)
    shared = np.sqrt(1.0 - 1.0 / (1.0 + float(noise.grid[0, 0]) * rows))
    out = []
    for rho, prior in zip(RHO.tolist(), PRIOR.tolist(), strict=True):
        near = np.outer(shared, shared) * rho ** np.abs(np.subtract.outer(place, place))
        covariance = np.where(np.eye(place.size, dtype=bool), 1.0, near)
        triangle = np.linalg.cholesky(free.T @ covariance @ free)
        white, log = np.linalg.solve(triangle, free.T), 2.0 * float(np.sum(np.log(np.diag(triangle))))
        out.append(Alike(white, log, np.linalg.cholesky(covariance), float(np.log(prior))))
    return tuple(out)


def p_among(every: tuple[Alike, ...], basis: FloatArray, outputs: FloatArray) -> float:
    """Probability by chance of the part of outputs (W,) along a basis (W, q): the geometric mean over all correlations,
    each as likely as it is beside the basis (restricted likelihood).
    """
    ps, logs = [], []
    for one in every:
        y, x = one.white @ outputs, one.white @ basis
        own = orthonormal(x, np.ones(x.shape[1]), 1e-3)
        q, below = own.shape[1], one.white.shape[0] - own.shape[1]
        if q < 1 or below < 1:
            return 1.0
        gain, total = float(np.sum((own.T @ y) ** 2)), float(y @ y)
        rest = max(total - gain, 1e-9 * total, TINY)
        ps.append(max(float(special.fdtrc(q, below, gain / q / (rest / below))), TINY))
        fitted = 2.0 * float(np.sum(np.log(np.abs(np.diag(np.linalg.qr(x, mode="r"))) + TINY)))
        logs.append(one.log_prior - 0.5 * (below * np.log(rest) + one.log_determinant + fitted))
    weight = np.exp(np.array(logs) - max(logs))
    return float(np.exp(weight @ np.log(ps) / weight.sum()))
