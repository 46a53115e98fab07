"""Quantities that had not settled: their readings go on inside the points, the way of the last change of a setting."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.column_names import spelled, unit_of

_ERRORS, _FEWEST = 5.0, 3
"""Standard errors from which on a movement counts as seen; fewest points, and fewest readings of one.

The trend inside one point may be noise with a memory; the same trend the way of each step is not.
"""


@dataclass(frozen=True)
class Moving:
    """How far the readings of a column go inside a point.

    Attributes:
        change: from the first reading to the last, the way of the last change of `of`; mean of the points.
        readings: of a point, at most.
        of: the factor that was changed; "" for a movement the same way in every point, whatever was changed.
    """

    change: float
    readings: int
    of: str

    @classmethod
    def seen(cls, points: Sequence[FloatArray], steps: FloatArray, of: str) -> Moving | None:
        """From the readings of each point and the change of the factor before it; None if they do not move visibly.

        Visibly is by more than one reading scatters beside its trend, and by five standard errors of the mean.

        Args:
            points: (k,) readings of one point each, in order.
            steps: (n,) changes of the factor before the points; 0 for none.
            of: the factor.
        """
        known = [(y, np.sign(step)) for y, step in zip(points, steps, strict=True) if step and y.size >= _FEWEST]
        if len(known) < _FEWEST:
            return None
        changes, left, df = [], 0.0, 0
        for y, way in known:
            x = np.arange(y.size) - (y.size - 1) / 2.0
            slope = float(x @ y / (x @ x))
            changes.append(slope * (y.size - 1) * way)
            left += float(np.sum((y - y.mean() - slope * x) ** 2))
            df += y.size - 2
        mean, error = float(np.mean(changes)), float(np.std(changes, ddof=1)) / np.sqrt(len(changes))
        if mean <= np.sqrt(left / df) or mean <= _ERRORS * error:
            return None
        return cls(mean, max(y.size for y, _ in known), of)

    def by(self, column: str) -> str:
        """How far it goes, in words."""
        size = f"{self.change:.2g} {spelled(unit_of(column))}".rstrip()
        way = f"the way of the last change of {self.of}" if self.of else "the same way in every point"
        return f"by {size} on average from the first to the last of {self.readings} readings, {way}"


def sentences(moving: Mapping[str, Moving], output: str, settings: Collection[str]) -> dict[str, str]:
    """What had not settled while an output was read, with a sentence; the output itself, if nothing else says why.

    Args:
        moving: by column.
        output: the response.
        settings: columns of what was set, as standards read it.
    """
    found = {
        name: f"{name} still moved while it was read: {one.by(name)}. It had not settled, and what is read later reads "
        f"another value: wait longer ([settle] dwell_s), or let all meters start together"
        for name, one in moving.items()
        if name in settings
    }
    if found or output not in moving:
        return found
    one = moving[output]
    if not one.of:
        return {
            output: f"{output} drifts inside the points: {one.by(output)}. It warms up or creeps while it is read, or "
            f"what is set does: the means are of the middle of a point, and no effect of the trace has it"
        }
    return {
        output: f"{output} still moved while it was read: {one.by(output)}. It follows late, or {one.of} had not "
        f"settled and no standard shows it: wait longer ([settle] dwell_s)"
    }
