"""Time constants of effects of earlier settings, with their 95 % intervals, by the profile of the sum of squares."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.quantiles import t_limit
from rig.fitter.sums_of_squares import project_out
from rig.procedures.pressure.effects.scene import PressureScene
from rig.procedures.pressure.trace.problem import Problem

BEYOND, STEPS = 4.0, 81
"""The profile goes so far beyond the values of the catalogue, in so many equal steps of the logarithm."""
HOUR_S = 3600.0


def time_constant(
    problem: Problem, scene: PressureScene, chosen: Sequence[int], mine: Sequence[int]
) -> list[dict[str, Any]]:
    """The time constant of an effect as JSON values: name, estimate, standard error, unit, and 95 % interval.

    Readings are compared within whole plots, of all transducers that the effect concerns. The interval has the values
    beside which the sum of squares is higher by less than the square of Student's limit.

    Args:
        problem: of the run.
        scene: references; with the rows of the problem.
        chosen: candidates in the model.
        mine: those of the effect.

    Returns:
        One; none without a time constant, or where terms of the effect have several.
    """
    terms = [problem.candidates[j].term for j in mine]
    known = {one.constant[0] for one in terms if one.constant is not None}
    if len(known) != 1 or any(one.constant is None for one in terms):
        return []
    (found,) = known
    taus = np.geomspace(found / 6.0 / BEYOND, found * 6.0 * BEYOND, STEPS)
    sensors = [i for i in range(len(problem.sensors)) if problem.raw[i][:, list(mine)].any()]
    rise, df = np.zeros(STEPS), np.inf
    for i in sensors:
        each = 1.0 / problem.sd[i][:, None]
        plots = (problem.whole_plot[:, None] == np.unique(problem.whole_plot)).astype(np.float64)
        others = problem.raw[i][:, [j for j in chosen if j not in mine]]
        basis = orthonormal(each * np.column_stack([plots, problem.declared, others]))
        y = project_out(each[:, 0] * problem.outputs[i], basis)
        own = [_scale(problem.raw[i][:, j], one.column(scene)) for j, one in zip(mine, terms, strict=True)]
        left = np.array([_left(y, basis, each * np.column_stack([
            size * one.constant[1](tau)(scene) for size, one in zip(own, terms, strict=True) if one.constant
        ])) for tau in taus.tolist()])  # fmt: skip
        free = float(len(y) - basis.shape[1] - len(terms) - 1)
        if free < 1.0 or left.min() <= 0.0:
            return []
        rise += left / (left.min() / free)
        df = min(df, free)
    best, t = int(np.argmin(rise)), t_limit(0.95, df)
    inside = np.flatnonzero(rise - rise[best] <= t**2)
    low, high = (float(taus[k]) * HOUR_S for k in (inside.min(), inside.max()))
    closed = inside.min() > 0 and inside.max() < STEPS - 1
    told: dict[str, Any] = {"name": "time constant", "estimate": float(taus[best]) * HOUR_S, "unit": "s"}
    spread = told["estimate"] * float(np.log(high / low)) / (2.0 * t)
    return [told | {"stderr": spread if closed else None, "interval_95": [low, high] if closed else None}]


def _scale(raw: FloatArray, column: FloatArray) -> float:
    """The factor between a column of the catalogue and that in the output of a transducer."""
    length = float(column @ column)
    return float(raw @ column) / length if length > 0.0 else 0.0


def _left(y: FloatArray, basis: FloatArray, columns: FloatArray) -> float:
    """Sum of squares beside columns."""
    own = orthonormal(project_out(columns, basis), np.linalg.norm(columns, axis=0))
    return float(np.sum(project_out(y, own) ** 2))
