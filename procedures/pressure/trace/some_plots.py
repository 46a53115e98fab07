"""Shapes that only some whole plots follow, or each by its own amount: a hurried shift, a valve that sticks at times.

Over the whole run such a shape looks like larger noise in some whole plots. Here each whole plot is asked by itself,
beside its own offset, slope and scatter, and the answers are put together (Fisher's method, or the clearest of them):
larger noise in one of them, or a sensitivity that is drawn again in each, does not look like a shape.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.limits import limit
from rig.fitter.trace.outcome import Finding, remains
from rig.procedures.pressure.effects.scene import PressureScene
from rig.procedures.pressure.trace.unmodelled import InTransducer

LEAST_DF = 3
"""Degrees of freedom beside the shape in a whole plot that is asked, at least."""
UNEXPLAINED = limit("unexplained", "whole-plot")
"""Probability below which there is a shape, over all shapes and transducers."""
ALIKE = 0.05
"""Remaining share of a combination of whole plots' amounts, over the largest, below which it is the model's."""
OF_ITS_OWN = 0.01
"""Probability below which a whole plot is counted among those that follow it."""


def in_some_plots(unmodelled: InTransducer) -> Finding | None:
    """The clearest shape that whole plots of a transducer follow, each by its own amount; None if there is none."""
    problem, view = unmodelled.run, unmodelled.view("subplot")
    whiten, left, n = view.white.errors[0].white, view.outputs[0], problem.whole_plot.size
    plots = np.arange(int(problem.whole_plot.max()) + 1) == problem.whole_plot[:, None]
    best: tuple[float, str, float] = (UNEXPLAINED, "", 0.0)
    every = list(_shapes(unmodelled.scene))
    for words, column, asked in every:
        # the model beside a shape of any amount in each whole plot, and beside the rows that are not asked
        own = np.column_stack([column[:, None] * plots, np.eye(n)[:, ~asked]])
        own = own / np.maximum(np.linalg.norm(whiten(own), axis=0), np.finfo(float).tiny)
        taken = view.project(own, 0)
        coefficients = np.linalg.lstsq(taken, left, rcond=ALIKE)[0]
        seen = left - taken @ coefficients + whiten(own) @ coefficients / view.sigma[0]
        white = whiten(np.column_stack([np.ones(n), unmodelled.scene.p, column]))
        each = [_alone(seen[mine], white[mine]) for mine in (plots & asked[:, None]).T]
        ps = np.array([p for p, _ in each])
        all_of_them = float(special.chdtrc(2 * ps.size, -2.0 * float(np.sum(np.log(np.maximum(ps, 1e-300))))))
        p = 2.0 * min(all_of_them, ps.size * float(ps.min()))
        if ties.below(p * len(every) * len(problem.sensors), best[0], 0.0):
            clear = ps < OF_ITS_OWN
            where = f"clearly in {np.sum(clear)} of {ps.size} whole plots, each by its own amount"
            gained = sum(gain for (_, gain), counts in zip(each, clear, strict=True) if counts)
            share = gained / max(float(left @ left), np.finfo(float).tiny)
            best = p * len(every) * len(problem.sensors), f"within whole plots, {words}, {where}", min(share, 1.0)
    return remains(best[1], best[2]) if best[1] else None


def _alone(left: FloatArray, white: FloatArray) -> tuple[float, float]:
    """P by chance of the last column beside the others in one whole plot, and the sum of squares that it takes up."""
    if left.size - white.shape[1] < LEAST_DF:
        return 1.0, 0.0
    beside = orthonormal(white[:, :-1], None, 1e-6)
    left, own = left - beside @ (beside.T @ left), white[:, -1] - beside @ (beside.T @ white[:, -1])
    length, below = float(own @ own), left.size - beside.shape[1] - 1
    if length <= 1e-4 * float(white[:, -1] @ white[:, -1]) or below < LEAST_DF:
        return 1.0, 0.0
    gain = float(own @ left) ** 2 / length
    error = max(float(left @ left) - gain, np.finfo(float).tiny) / below
    return float(special.fdtrc(1.0, float(below), gain / error)), gain


def _shapes(scene: PressureScene) -> Iterator[tuple[str, FloatArray, NDArray[np.bool_]]]:
    """Words, column (n,) and the rows that are asked."""
    known, later = ~np.isnan(scene.data.previous_pressure_psia), scene.data.position > 0
    every = np.ones(known.size, np.bool_)
    yield "after the pressure before", scene.change_psia, known
    yield "over the side from which a pressure was reached", scene.data.pressure_side.astype(np.float64), later
    yield "over the pressure", (scene.p - float(np.mean(scene.p))) ** 2, every
