"""Gross errors where settings are repeated: against the declared model if it holds, otherwise against the repeats.

Repeats of a setting show a bad reading whatever the model lacks, but only if most of them are good, and each setting
costs a degree of freedom. The declared model has neither limit. Whether it holds is known from the readings that it
does not name: the lack-of-fit test compares the settings' levels with the scatter of repeats (Draper and Smith, Applied
Regression Analysis, 3rd ed. 1998, section 2.1).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import special

from rig.fitter.arrays import IntArray
from rig.fitter.gross.forward_search import GrossErrors, gross_errors
from rig.fitter.gross.rows import Rows

HOLDS = 0.05
"""Minimum probability of such a lack of fit by chance, if the declared model is to decide."""
APART = 3.0
"""Minimum distance, in standard deviations, between the named and the other readings of a setting that is mostly named:
nearer ones are one level, which the model lacks."""
CLEARLY = 0.5
"""Ratio of standard deviations below which one set of rows explains the scatter clearly better than another."""
NEAR = 2.0
"""Maximum distance of the other readings from the declared model, if that one outvotes most of a setting."""


def with_repeats(declared: Rows, levels: Rows, setting: IntArray, **asked: Any) -> GrossErrors:
    """Rows that deviate, of a table whose settings are repeated.

    Args:
        declared: rows of the declared model.
        levels: the same rows, with a level for each setting beside the model.
        setting: (n,) number of the setting; negative for a row whose setting is not repeated.
        asked: further arguments of `gross_errors`.
    """
    found = gross_errors(declared.y, declared.columns, rows=declared, **asked)
    if not np.any(setting >= 0):
        return found
    first = together = found.rows[:0]
    if found.rows.size:
        kept = np.setdiff1d(np.arange(len(declared.y)), found.rows)
        mostly = list(_mostly_named(declared, setting, found, kept))
        if all(one.apart for one in mostly) and _fits(declared, levels, found, kept):
            return found
        # A search that begins without the rows of settings that are mostly bad does not name the good ones in their
        # place. Where all of a setting is far from the declared model, repeats say nothing against its rows.
        doubtful = [one.setting for one in mostly if not one.near]
        first = found.rows[~np.isin(setting[found.rows], doubtful)]
        whole = [one.setting for one in mostly if one.whole and not one.apart]
        together = found.rows[np.isin(setting[found.rows], whole)]
    within = gross_errors(levels.y, levels.columns, rows=levels, first=first, **asked)
    if within.not_looked:
        return within if found.not_looked or found.rows.size else found
    # Levels take all that the declared model lacks. A fit with them that scatters much more has kept bad rows.
    if np.median(found.sd) < CLEARLY * np.median(within.sd):
        return found
    return replace(within, together=np.setdiff1d(together, within.rows))


@dataclass(frozen=True)
class _MostlyNamed:
    """A setting of which half of the readings or more are named.

    Attributes:
        setting: its number.
        apart: whether the named readings are no part of one level with the others, or with one another if all are.
        near: whether the others are near the declared model.
        whole: whether there are no others.
    """

    setting: int
    apart: bool
    near: bool
    whole: bool


def _mostly_named(declared: Rows, setting: IntArray, found: GrossErrors, kept: IntArray) -> Iterator[_MostlyNamed]:
    visits, named = (
        np.bincount(numbers + 1, minlength=setting.max() + 2)[1:] for numbers in (setting, setting[found.rows])
    )
    left = np.zeros(len(declared.y))
    left[kept] = declared.some(kept).residual
    for one in np.flatnonzero((2 * named >= visits) & (visits > 1)):
        rows = np.flatnonzero(setting[found.rows] == one)
        others = kept[setting[kept] == one]
        level = float(np.mean(left[others])) if others.size else float(np.median(found.off[rows]))
        sd = found.sd[found.rows[rows]]
        far = np.abs(found.off[rows] - level) / (sd * np.sqrt(1.0 + 1.0 / max(others.size, 1)))
        near = bool(others.size) and abs(level) < NEAR * float(np.median(sd))
        yield _MostlyNamed(int(one), bool(np.median(far) > APART), near, not others.size)


def _fits(declared: Rows, levels: Rows, found: GrossErrors, kept: IntArray) -> bool:
    """Whether the declared model has no lack of fit for the rows that it does not name."""
    weight = float(np.median(found.sd)) / found.sd[kept]
    small, large = (one.some(kept) for one in (declared, levels))
    if np.ptp(weight) > 0.0:
        small, large = small.weighted(weight), large.weighted(weight)
    more = small.df - large.df
    if more < 1 or large.df < 1:
        return more < 1
    error = float(large.residual @ large.residual)
    fall = max(float(small.residual @ small.residual) - error, 0.0)
    if error <= 0.0:
        return fall <= 0.0
    return float(special.fdtrc(more, large.df, fall / more / (error / large.df))) > HOLDS
