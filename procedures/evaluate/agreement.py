"""Whether several sensors of one quantity agree: each pair of inferred values within its joint uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.evaluate.inference import Inference

LEVEL = 0.05
"""Probability that chance alone says anything of a whole table."""
_MANY = 1e10
"""Degrees of freedom from which Student's distribution is the normal one."""
DIFFER = "_differ"
"""Behind the name of a quantity: the column that names pairs of sensors, row by row."""


def compared(found: Inference) -> Inference:
    """An inference with what its sensors of one quantity do not agree on: a column of words, and a note.

    The joint standard deviation of two values is that of their difference: the root of the sum of squares of what is
    each one's own, and of the difference of what an influence on both does to each. A standard that calibrated both
    cancels. Degrees of freedom are those of Welch and Satterthwaite (JCGM 100, annex G.4). The limit is Student's, for
    all pairs and rows together 5 % (Bonferroni).
    """
    for quantity, sensors in found.alike.items():
        found = _compared(found, quantity, sensors)
    return found


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two sensors over all rows.

    Attributes:
        names: of both, in words.
        apart: (n,) absolute difference; NaN where a value is missing.
        ratio: (n,) the same in joint standard deviations.
        limit: (n,) largest ratio that chance makes.
    """

    names: str
    apart: FloatArray
    ratio: FloatArray
    limit: FloatArray

    @property
    def beyond(self) -> NDArray[np.bool_]:
        """(n,) whether the difference is beyond its limit."""
        return self.ratio > self.limit


def _compared(found: Inference, quantity: str, sensors: Mapping[str, str]) -> Inference:
    rows = len(next(iter(found.columns.values())))
    names = list(combinations(sensors, 2))
    pairs = [_pair(found, one, other, sensors, LEVEL / (rows * len(names))) for one, other in names]
    pairs = [one for one in pairs if one.beyond.any()]
    if not pairs:
        return found
    unit = spelled(unit_of(quantity))
    words = np.full(rows, "", dtype=object)
    for pair in pairs:
        for row in map(int, np.flatnonzero(pair.beyond)):
            told = f"{pair.names} differ by {pair.apart[row]:.3g} {unit}"
            words[row] = f"{words[row]}; {told}" if words[row] else told
    worst = ties.least(pairs, key=lambda one: -float(one.apart[one.beyond].max()))
    row = ties.highest(np.where(worst.beyond, worst.apart, -1.0), 0.0)
    name = f"{quantity}{DIFFER}"
    while name in found.columns:
        name += "_"
    many = f"{int(np.sum(words != ''))} of {rows} rows"
    sizes = f"{worst.apart[row]:.3g} {unit}, {worst.ratio[row]:.3g} joint standard deviations"
    note = (
        f"sensors do not agree on {quantity} in {many} (column {name}): {worst.names} differ by up to {sizes} (limit "
        f"{worst.limit[row]:.1f}). They are at different values, or one of them has changed since its calibration: "
        f"these data do not say which"
    )
    return replace(
        found, columns={**found.columns, name: words}, added=(*found.added, name), notes=(note, *found.notes)
    )


def _pair(found: Inference, one: str, other: str, sensors: Mapping[str, str], level: float) -> _Pair:
    values = [np.asarray(found.columns[name], np.float64) for name in (one, other)]
    own = [found.own_sd.get(name, found.columns[f"{name}_sd"]) for name in (one, other)]
    variances = np.square(np.array(own, np.float64))
    df = np.array([found.df[name] for name in (one, other)], np.float64)
    if found.shifts:
        variances = np.vstack([variances, np.square(found.shifts[one] - found.shifts[other])])
        of_shifts = np.broadcast_to(np.array(found.shifts_df, np.float64)[:, None], found.shifts[one].shape)
        df = np.vstack([df, of_shifts])
    apart = np.abs(values[0] - values[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(apart > 0.0, apart / np.sqrt(variances.sum(axis=0)), 0.0)
        joint = np.square(variances.sum(axis=0)) / np.sum(np.square(variances) / df, axis=0)
    known = np.isfinite(joint) & (joint < _MANY)
    limit = np.where(
        known, special.stdtrit(np.where(known, joint, 1.0), 1.0 - level / 2.0), special.ndtri(1.0 - level / 2.0)
    )
    return _Pair(f"{sensors[one]} and {sensors[other]}", apart, np.where(np.isfinite(apart), ratio, 0.0), limit)
