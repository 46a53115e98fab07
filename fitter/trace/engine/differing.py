"""What groups of rows have of their own beside an offset: slopes, or memory within them."""

from __future__ import annotations

import numpy as np

from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.engine.components import Components
from rig.fitter.trace.engine.family import of_all
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.likelihood import Grid
from rig.fitter.trace.engine.shared import scale_of

SLOPES, MEMORY = 1, 2
"""Columns of `Components.grid`."""
CLEAR = 0.01
"""The largest p of slopes that differ: something acts on them, and no column of the table says what."""


def component(judge: TableJudge, chosen: tuple[int, ...], which: int) -> tuple[float, float]:
    """The likeliest slopes or memory of groups beside some effects, and p by chance over all sensors.

    Args:
        judge: whose errors have such components.
        chosen: candidates in the model.
        which: `SLOPES` or `MEMORY`.

    Returns:
        The standard deviation of slopes, in the response's unit for a variable whose spread within groups is one, or
        the correlation of neighbouring rows; and p.
    """
    problem, noise, beside = judge.problem, judge.problem.noise, judge.beside(chosen)
    assert isinstance(noise, Components)
    value, p = noise.likeliest(beside.reml, which)
    if p <= ALPHA:  # the search leaves out covariances that are not near the best; the best of all others counts here
        noise = noise.whole(scale_of(noise.group, problem.y, problem.declared))
        model = problem.model(chosen) / problem.sd[:, None]
        beside = Grid.of(noise, judge.held(chosen) / problem.sd, model).beside()
        value, p = noise.likeliest(beside.reml, which)
    size = float(np.sqrt(value * beside.sigma2[beside.best])) if which == SLOPES else value
    return size, of_all(p, problem.sensors)
