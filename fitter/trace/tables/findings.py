"""Findings about the noise: rows that follow one another, rows whose scatter differs, rows that stand alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import special

from fitter.trace.family import ALPHA
from fitter.trace.tables.judge import TableJudge
from fitter.trace.tables.noise import Wandering
from fitter.trace.tables.result import FoundTableEffect
from fitter.trace.tables.robust import scale
from fitter.trace.tables.spread import Growth

SHOWN = 8
"""Rows that are named where several stand alone."""
CLEAR = 0.01


def noise_findings(
    judge: TableJudge, chosen: tuple[int, ...], growth: Growth | None, response: str, rows: Sequence[int]
) -> tuple[FoundTableEffect, ...]:
    """What is to be said of the noise beside the `chosen` effects.

    Args:
        judge: that ended the search.
        chosen: candidates in the model.
        growth: of the noise, as it was used for weights.
        response: name.
        rows: (n,) number of each row in the file, for those that are pointed at.

    """
    every = (
        _wander(judge, chosen, response),
        _growing(judge, growth, response),
        _alone(judge, chosen, response, rows),
    )
    return tuple(finding for finding in every if finding is not None)


def _wander(judge: TableJudge, chosen: tuple[int, ...], response: str) -> FoundTableEffect | None:
    noise, beside = judge.problem.noise, judge.beside(chosen)
    if not isinstance(noise, Wandering) or beside.best == 0:
        return None
    p = float(special.chdtrc(2, 2.0 * max(float(beside.reml.max() - beside.reml[0]), 0.0)))
    if p > CLEAR:
        return None
    correlation = float(noise.correlation[beside.best])
    walk = correlation == 1.0
    size = "a random walk" if walk else f"neighbours correlate by {correlation:.2f}"
    return _finding(
        judge,
        "autocorrelation",
        f"errors of neighbouring rows of {response} are alike: something wanders slowly that was not recorded",
        ("correlation of neighbours",),
        (correlation,),
        "1",
        size,
        p,
        "record what may wander (temperature, humidity, supply), or take rows in random order with longer pauses",
    )


def _growing(judge: TableJudge, growth: Growth | None, response: str) -> FoundTableEffect | None:
    if growth is None:
        return None
    low, high = growth.noise.sd(np.array([0.0, 1.0])).tolist()
    where = f"fitted {response}" if growth.driver == "fitted" else growth.driver
    return _finding(
        judge,
        f"growing-noise:{growth.driver}",
        f"the scatter of {response} changes with {where}",
        (f"sd at {growth.span[0]:.4g}", f"sd at {growth.span[1]:.4g}"),
        (low, high),
        response,
        f"sd {low:.3g} at {where} {growth.span[0]:.4g}, {high:.3g} at {growth.span[1]:.4g}",
        growth.p,
        f"repeat readings at both ends of {where}",
    )


def _alone(judge: TableJudge, chosen: tuple[int, ...], response: str, rows: Sequence[int]) -> FoundTableEffect | None:
    problem = judge.problem
    off = problem.y - judge.held(chosen)
    alone = np.flatnonzero(off)
    if not alone.size:
        return None
    view = judge.view(0)
    taken = view.taken(chosen)
    left = view.y - taken @ (taken.T @ view.y)
    alone = alone[np.argsort(-np.abs(left[alone]))]
    z = np.abs(left[alone]) / scale(left)
    p = float(min(2.0 * special.ndtr(-z.max()) * problem.n, 1.0))
    if p > ALPHA:
        return None
    shown = alone[:SHOWN]
    more = f" and {len(alone) - SHOWN} more" if len(alone) > SHOWN else ""
    listed = ", ".join(str(rows[i]) for i in shown)
    return _finding(
        judge,
        "outliers",
        f"{len(alone)} of {problem.n} rows stand alone, by {z.min():.1f} to {z.max():.1f} sd",
        tuple(f"row {rows[i]}" for i in shown),
        tuple(float(left[i] * problem.sd[i]) for i in shown),
        response,
        f"rows {listed}{more} of the file; they stay in the table and count as three sd",
        p,
        "look in the log at these rows, and measure them again",
    )


def _finding(
    judge: TableJudge,
    name: str,
    cause: str,
    terms: tuple[str, ...],
    values: tuple[float, ...],
    unit: str,
    size: str,
    p: float,
    separate_by: str,
) -> FoundTableEffect:
    return FoundTableEffect.of_noise(
        effect=name,
        cause=cause,
        terms=terms,
        coefficients=values,
        unit=unit,
        size=size,
        p_adjusted=p,
        separate_by=separate_by,
        against="",
        family="noise",
        columns=(),
        contribution=np.zeros(judge.problem.n),
    )
