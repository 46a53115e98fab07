"""Share of each effect in the whole error beyond scatter: additive shares, in every kind of run.

The part that two effects could both explain is divided: the share is Shapley's value of the fall of the residual sum of
squares over all orders in which effects can enter the model (Lindeman, Merenda and Gold, 1980; Groemping, J. Stat.
Softw. 17 (2006) 1). It does not depend on the order of the search, is never negative, and all shares together are the
part of the whole that is explained.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import factorial

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.outcome import Finding

SAME = 1e-12
"""Relative squared length below which the remainder beside others is rounding."""


def shares(parts: Sequence[FloatArray], residual: FloatArray, scatter: float) -> FloatArray:
    """Share of each of q effects in the error beyond scatter, each in 0 to 1 and at most 1 together.

    Args:
        parts: (n,) contribution of each effect, beyond the part absorbed by the declared model.
        residual: (n,) residual of the declared model, in the unit of `parts`.
        scatter: sum of squares of scatter alone, in the square of that unit.
    """
    if not parts:
        return np.zeros(0)
    explained = _divided(np.column_stack(parts), residual)
    beyond = max(float(residual @ residual) - scatter, float(explained.sum()))
    return np.asarray(explained / beyond) if beyond > 0 else explained


def of_rest(found: FloatArray, rest: Sequence[Finding]) -> tuple[Finding, ...]:
    """The remainder, with its shares converted to shares of the whole, together with those `found`."""
    whole = max(1.0 - float(np.sum(found)), 0.0) / max(sum(one.share for one in rest), 1.0)
    return tuple(replace(one, share=one.share * whole) for one in rest)


def unnamed_part(rest: Sequence[Finding]) -> float:
    """Part of the residual that is neither scatter nor explained, at most one."""
    return min(sum(one.share for one in rest), 1.0)


def _divided(columns: FloatArray, residual: FloatArray) -> FloatArray:
    """(q,) reduction of the residual's sum of squares by each of (n, q) columns, averaged over all orders of adding."""
    q = columns.shape[1]
    rss = _left(columns, residual)
    subset = np.arange(rss.size)
    size = np.array([s.bit_count() for s in range(rss.size)])
    weight = np.array([factorial(s) * factorial(q - s - 1) / factorial(q) for s in range(q)])
    without = [subset[(subset >> k) & 1 == 0] for k in range(q)]
    falls = [weight[size[s]] @ (rss[s] - rss[s | 1 << k]) for k, s in enumerate(without)]
    return np.asarray(np.maximum(np.array(falls), 0.0))


def _left(columns: FloatArray, residual: FloatArray) -> FloatArray:
    """(2^q,) residual sum of squares beside every subset of the columns; bit k says that column k is in it."""
    length = np.linalg.norm(columns, axis=0)
    both = np.column_stack([columns / np.where(length > 0, length, 1.0), residual])
    gram = (both.T @ both)[None]
    for _ in range(columns.shape[1]):
        pivot, cross, rest = gram[:, 0, 0], gram[:, 0, 1:], gram[:, 1:, 1:]
        known = np.where(pivot > SAME, 1.0 / np.where(pivot > SAME, pivot, 1.0), 0.0)
        taken = rest - known[:, None, None] * cross[:, :, None] * cross[:, None, :]
        gram = np.concatenate([rest, taken])
    return np.asarray(np.maximum(gram[:, 0, 0], 0.0))
