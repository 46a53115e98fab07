"""Short periods in time with overtones: pulses, of one sign or both, that come again within a few waits for a reading.

Readings whose waits are all alike do not tell a period from its alias of two waits or more, and show a sine of it at
most (`rig.fitter.trace.lines`). Waits that differ tell periods down to a usual wait (Eyer and Bartholdi, Astron.
Astrophys. Suppl. 135 (1999) 1), and then a row's place in the period shows what happens within it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray

HARMONICS = 3
"""Sines of a period, its half and its third."""
ORDERS = (2, 2 * HARMONICS)
"""Numbers of columns that are asked together."""
FEWEST = 48
"""Rows, at least."""
FROM, TO = 0.25, 1.0
"""Periods in a usual wait that are tried."""
UNEQUAL = 0.1
"""Mean deviation of waits over a usual one, from which they tell a period from its alias."""
FINE = 4
"""Frequencies that are tried for each one that the length of the run tells apart."""
BETWEEN = 2
"""Tests that frequencies between those that the length tells apart are worth, over these."""
MOST = 16_000
"""Frequencies, overtones included, at most: of longer runs only the slower ones are tried."""
LIKELIEST = 4
"""Periods that are asked about."""
AT_ONCE = 128


@dataclass(frozen=True)
class Repeats:
    """Short periods that a series may have.

    Attributes:
        periods: the likeliest, in the unit of its times.
        count: of independent tests among all periods and orders, about.

    """

    periods: tuple[float, ...]
    count: int


def repeats(left: FloatArray, at: FloatArray) -> Repeats | None:
    """The likeliest short periods of a residual; None where the waits for a reading do not tell them from others.

    Args:
        left: (n,) residual in the order of running.
        at: (n,) time of each row, ascending, any unit.

    """
    waits, length = np.diff(at), float(np.ptp(at))
    usual = float(np.median(waits)) if waits.size else 0.0
    if left.size < FEWEST or usual <= 0.0 or np.median(np.abs(waits - usual)) < UNEQUAL * usual:
        return None
    slowest = int(np.ceil(FROM / usual * length * FINE))
    fastest = min(int(TO / usual * length * FINE), MOST // HARMONICS)
    if fastest <= slowest:
        return None
    tried = np.arange(slowest, fastest + 1)
    power = _power(left, (at - at[0]) / (length * FINE), HARMONICS * fastest)
    sums = [sum(power[k * tried] for k in range(1, most + 1)) for most in (1, HARMONICS)]
    found = [int(tried[k]) for each in sums for k in ties.top(np.asarray(each), LIKELIEST)]
    cycles = sorted(dict.fromkeys(found))
    return Repeats(tuple(length * FINE / one for one in cycles), len(ORDERS) * BETWEEN * (fastest - slowest) // FINE)


def _power(left: FloatArray, turns: FloatArray, most: int) -> FloatArray:
    """(most + 1,) power of a residual at whole numbers of turns (n,), from none."""
    waves = np.exp(2j * np.pi * np.outer(np.arange(AT_ONCE), turns))
    turned, along = np.exp(2j * np.pi * AT_ONCE * turns), left.astype(np.complex128)
    parts = []
    for _ in range(0, most + 1, AT_ONCE):
        parts.append(np.abs(waves @ along) ** 2)
        along = along * turned
    return np.concatenate(parts)[: most + 1]
