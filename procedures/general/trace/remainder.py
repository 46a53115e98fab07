"""The remainder after the effects, and its place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.drawn import drawn, drawn_period
from rig.fitter.trace.engine.both import Both
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.noise import Wandering
from rig.fitter.trace.engine.score import NOTHING_LEFT
from rig.fitter.trace.limits import limit
from rig.fitter.trace.lines import CLEAR, Line
from rig.fitter.trace.outcome import Finding, remains
from rig.fitter.trace.shape import Shape
from rig.fitter.trace.unmodelled import ResidualShape
from rig.procedures.general.trace.parts import in_parts
from rig.procedures.general.trace.smooth import Smooth, curve, offered
from rig.procedures.general.trace.unmodelled import UnmodelledSmooth

UNEXPLAINED = limit("unexplained", "general")
"""Probability below which there is a remainder, over all tested places."""
SUSPECTS, MOST_OF_A_SUSPECT = 2, 0.5
"""Most effects that are named as nearest to an explanation, and the largest p of one."""
BINS, FEWEST_IN_BIN = 8, 4


def pure_error(y: FloatArray, points: IntArray | None, effects: FloatArray) -> float | None:
    """Standard deviation of rows that repeat one setting; None without repeats.

    Args:
        y: (n,) response.
        points: (n,) setting of each row; None without settings.
        effects: (n, d) columns of effects that may differ within a setting; they are fitted first.
    """
    if points is None:
        return None
    count = np.maximum(np.bincount(points), 1)[:, None]
    both = np.column_stack([y, effects])
    sums = np.zeros((len(count), both.shape[1]))
    np.add.at(sums, points, both)
    within = both - (sums / count)[points]
    basis = orthonormal(within[:, 1:], np.linalg.norm(effects, axis=0), NOTHING_LEFT)
    df = len(y) - len(np.unique(points)) - basis.shape[1]
    if df < 1:
        return None
    left = within[:, 0] - basis @ (basis.T @ within[:, 0])
    return float(np.sqrt(left @ left / df))


def unnamed(unmodelled: UnmodelledSmooth, variables: Mapping[str, FloatArray]) -> tuple[Finding, ...]:
    """Shapes that the residual follows: a slow wander, a period, jumps between two levels, or the clearest place."""
    judge, chosen = unmodelled.judge, unmodelled.chosen
    rest = list[Finding](_slow(judge, chosen))
    clearest = next(iter(unmodelled.left), None)
    line, jumps = _period(unmodelled), unmodelled.jumps
    if line is not None:
        rest.append(remains(line.where, line.share, shape=drawn_period(unmodelled, line)))
    if jumps is not None:
        levels = f"along the run: jumps between two levels {jumps.apart:.3g} apart, {jumps.stay:.3g} rows at the rarer"
        rest.append(remains(levels, jumps.share, shape=_along_the_run(unmodelled)))
    elif clearest is not None and clearest.p < UNEXPLAINED and not (clearest.place.timed and len(rest) > 0):
        rest.append(_at(unmodelled, clearest, variables))
    part = in_parts(unmodelled) if all(one.stratum == "noise" for one in rest) else None
    return tuple(rest) if part is None else (*rest, part)


def _period(unmodelled: UnmodelledSmooth) -> Line | None:
    """The clearest period in order or time; where there is none, one of a few waits, or a fine one over a setting."""
    found = unmodelled.line
    if found is not None and found.p < CLEAR:
        return found
    others = [one for one in (unmodelled.repeats, unmodelled.fine) if one is not None and one.p < UNEXPLAINED]
    return ties.least(others, key=lambda one: one.p) if others else None


def _at(unmodelled: UnmodelledSmooth, left: ResidualShape, variables: Mapping[str, FloatArray]) -> Finding:
    """The remainder at a place, with an available curve if it is over one variable."""
    place, share, name = left.place, left.remainder.share, left.place.curve
    if name is None or not curve(variables[name]).shape[1]:
        return remains(f"{place.text}{left.detail}", share, shape=drawn(unmodelled, left))
    residual = unmodelled.left_under(0)
    where = f"{place.text}{_most(variables[name], residual)}"
    smooth = _told(offered(unmodelled.judge, unmodelled.chosen, name, variables[name], share, where=where))
    return replace(smooth, shape=drawn(unmodelled, left))


def _along_the_run(unmodelled: UnmodelledSmooth) -> Shape | None:
    """The course along the run, where one is seen."""
    course = next((one for one in unmodelled.left if one.place.curve is not None and one.place.timed), None)
    return None if course is None else drawn(unmodelled, course)


def _slow(judge: TableJudge, chosen: tuple[int, ...]) -> tuple[Smooth, ...]:
    """A walk so slow that it is as likely an effect in time as noise, with the effects nearest to it."""
    noise, beside = judge.problem.noise, judge.beside(chosen)
    at = beside.best
    if not isinstance(noise, Wandering | Both) or not noise.slow[at]:
        return ()
    still = float(beside.reml[noise.correlation == 0].max())
    if special.chdtrc(2, 2.0 * max(float(beside.reml[at]) - still, 0.0)) > UNEXPLAINED:
        return ()
    names = [f"{name} (p {p:.2g})" for name, p in judge.suspects(chosen, MOST_OF_A_SUSPECT)[:SUSPECTS]]
    near = f"; nearest to it come {' and '.join(names)}" if names else ""
    share = 1.0 - float(np.min(beside.sigma2 * np.exp(noise.log_det / judge.problem.n)) / beside.sigma2[0])
    where = f"along the rows, as a wander so slow that it may be noise or an effect in time{near}"
    share = float(np.clip(share, 0.0, 1.0))
    return (_told(offered(judge, chosen, "row", noise.when, share, where=where, stratum="noise")),)


def _told(rest: Smooth) -> Smooth:
    """The same with the available curve, in words."""
    period = f" (period {rest.period:.4g})" if rest.period is not None else ""
    text = (
        f"{rest.cause}; a smooth curve of order {rest.order} over {rest.variable}{period} would take the standard "
        f"error from {rest.sigma_E[0]:.4g} to {rest.sigma_E[1]:.4g}, at random rows left out from "
        f"{rest.left_out[0]:.4g} to {rest.left_out[1]:.4g}"
    )
    return replace(rest, cause=text)


def _most(v: FloatArray, left: FloatArray) -> str:
    """The part of a variable's range where the mean residual is farthest from zero, in words."""
    count = min(BINS, len(v) // FEWEST_IN_BIN, len(np.unique(v)))
    if count < 3:
        return ""
    edges = np.unique(np.quantile(v, np.arange(1, count) / count))
    index = np.searchsorted(edges, v, side="left")
    rows = np.maximum(np.bincount(index), 1)
    worst = ties.highest(np.abs(np.bincount(index, left) / rows) * np.sqrt(rows), 0.0)
    own = v[index == worst]
    low, high = f"{own.min():.4g}", f"{own.max():.4g}"
    return f", most at {low}" if low == high else f", most between {low} and {high}"
