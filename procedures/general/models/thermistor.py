"""Thermistors by the equation of Steinhart and Hart."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.general.models.entry import Parameter, Quantity, StandardModel, straight

_ICE_K, _STEPS = 273.15, 6


def _steinhart_hart(b: Sequence[Any], t: Any) -> Any:
    """R with 1/T = a + b ln R + c (ln R)^3: the real root in closed form, then Newton's steps.

    The steps carry a complex step along, and replace digits that the closed form loses for small c.
    """
    a, slope, c = b
    y = 1.0 / (np.asarray(t) + _ICE_K) - a
    p, q = np.real(slope), np.real(y)
    third = np.maximum(np.real(c), 1e-300)
    half = 0.5 * q / third
    root = np.sqrt(half**2 + (p / (3.0 * third)) ** 3)
    L: Any = np.cbrt(half + root) + np.cbrt(half - root)
    L = np.where(np.abs(np.real(c)) * L**2 < 1e-9 * np.abs(p), q / p, L)
    for _ in range(_STEPS):
        L = L - (slope * L + c * L**3 - y) / (slope + 3.0 * c * L**2)
    return np.exp(L)


def _start(t: FloatArray, R: FloatArray) -> FloatArray:
    L = np.log(np.where(R > 0.0, R, np.nan))
    return straight(np.ones_like(t), L, L**3, y=1.0 / (t + _ICE_K))


MODELS = (
    StandardModel(
        "steinhart-hart",
        "thermistor: 1/T = a + b ln(R / ohm) + c ln(R / ohm)^3",
        "J. S. Steinhart and S. R. Hart, Deep-Sea Research 15 (1968) 497",
        Quantity("temperature", "degC"),
        Quantity("resistance", "ohm"),
        (-200.0, 400.0),
        (
            Parameter("a", "1/K", "constant"),
            Parameter("b", "1/K", "coefficient of ln R"),
            Parameter("c", "1/K", "coefficient of (ln R)^3"),
        ),
        _steinhart_hart,
        _start,
        hint="it takes resistances at three temperatures or more",
    ),
)
