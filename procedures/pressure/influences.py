"""How constants of the place displace recorded pressures: the head of gas in the line."""

from __future__ import annotations

from rig.fitter.arrays import FloatArray

COLUMN_PER_M = 0.0289652 * 9.80665 / (8.314462618 * 293.15)
"""Share of an absolute pressure by which a metre of height changes it: M g / (R T) of air at 20 degC, 1.17e-4 per m.

Nitrogen has 0.967 times that: a difference of 4e-6 per m.
"""


def line_head(pressure_psia: FloatArray, height_m: float) -> FloatArray:
    """(n,) pressure at sensors `height_m` above the reference level, for pressures there."""
    return pressure_psia * (1.0 - COLUMN_PER_M * height_m)
