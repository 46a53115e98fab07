"""How much of a drift a table of few whole plots shows: nothing found does not mean that nothing is there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.engine.judge import TableJudge
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.general.trace.run import Found, TableData

FEW = 12
"""Whole plots up to which it is said."""
DRIFT = "drift"
STEPS, WIDEST = 7, 64.0
"""Halvings in the search of the smallest drift, and the largest one tried, in its standard errors by whole plots."""
TOLD = 0.05
"""Probability by chance, by the means of the whole plots, below which the drift of the run itself is told."""
_CONSTANT = 1e-6


def few_plots(found: Found, data: TableData) -> Iterator[str]:
    """A sentence, where effects in time were looked for by few whole plots and none was found.

    The drift is the change over the run, of a straight line in time. The smallest one that counts is searched on these
    data: with the drift that they have in place of it.
    """
    judge, chosen = found.judge, found.chosen
    drift = next((j for j, one in enumerate(judge.candidates) if one.effect.kind.name == DRIFT), None)
    timed = any(judge.candidates[j].effect.source == "time" for j in chosen)
    if data.shared is None or data.shares != "whole plots" or drift is None or timed:
        return
    plot = np.unique(data.shared, return_inverse=True)[1]
    count = int(plot.max()) + 1
    line = judge.problem.of((drift,))[:, 0]
    line = line / np.ptp(line)
    size, error, df = _by_plots(data, np.hstack([data.columns, judge.problem.of(chosen)]), line, plot)
    if count > FEW or df < 1:
        return
    unit = spelled(unit_of(data.response))
    least = _smallest(judge, chosen, drift, line, (size, error))
    p = float(2.0 * special.stdtr(df, -abs(size) / error)) if error > 0.0 else 0.0
    smallest = "larger than any that was tried" if least is None else f"about {least:.2g} {unit}".rstrip()
    told = (
        f"{count} whole plots are few for effects that change from one to the next: the smallest drift that counts as "
        f"found here is {smallest} over the run, and more whole plots show smaller ones"
    )
    own = f". The means of these drift by {abs(size):.2g} {unit}".rstrip()
    chance = f"{own} (p {p:.2g} by themselves): among all causes that are tried, chance gives as much"
    yield f"{told}{chance if p < TOLD else ''}"


def _by_plots(data: TableData, beside: FloatArray, line: FloatArray, plot: IntArray) -> tuple[float, float, int]:
    """Change over the run by the means of whole plots, its standard error, and the degrees of freedom."""
    sizes = np.bincount(plot)

    def means(columns: FloatArray) -> FloatArray:
        return np.column_stack([np.bincount(plot, column) / sizes for column in columns.T])

    basis = np.linalg.qr(beside)[0]
    both = np.column_stack([data.y, line])
    y, t = means(both - basis @ (basis.T @ both)).T
    inside = beside - means(beside)[plot]
    between = beside[:, np.max(np.abs(inside), axis=0) <= _CONSTANT * np.max(np.abs(beside), axis=0)]
    df = len(sizes) - 1 - int(np.linalg.matrix_rank(means(between))) if between.size else len(sizes) - 1
    if df < 1 or not t.any():
        return 0.0, 0.0, 0
    slope = float(t @ y / (t @ t))
    rest = y - slope * t
    return slope, float(np.sqrt(rest @ rest / df / (t @ t))), df


def _smallest(
    judge: TableJudge, chosen: tuple[int, ...], drift: int, line: FloatArray, own: tuple[float, float]
) -> float | None:
    """Smallest change over the run that counts as found, within a few percent; None if the largest one does not."""
    size, error = own
    sign = 1.0 if size >= 0.0 else -1.0

    def found(change: float) -> bool:
        moved = judge.problem.y + (sign * change - size) * line
        return TableJudge(judge.problem.given(y=moved), judge.families).significant(chosen, drift)

    low, high = error, WIDEST * error
    if not found(high):
        return None
    for _ in range(STEPS):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if found(middle) else (middle, high)
    return high
