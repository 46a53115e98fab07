"""Resistance thermometers by the Callendar-Van Dusen equation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.general.models.entry import Derived, Parameter, Quantity, StandardModel, straight

_SOURCE = "IEC 60751:2008, 4.2 (equation and nominal A, B, C); Callendar 1887, Van Dusen 1925"
_T, _R = Quantity("temperature", "degC"), Quantity("resistance", "ohm")


def _callendar(b: Sequence[Any], t: Any) -> Any:
    R0, A, B = b
    return R0 * (1.0 + A * t + B * t**2)


def _van_dusen(b: Sequence[Any], t: Any) -> Any:
    R0, A, B, C = b
    return R0 * (1.0 + A * t + B * t**2 + np.where(np.real(t) < 0.0, C * (t - 100.0) * t**3, 0.0))


def _start(t: FloatArray, R: FloatArray) -> FloatArray:
    found = straight(np.ones_like(t), t, t**2, y=R)
    return np.asarray([found[0], *(found[1:] / found[0])])


def _start_below(t: FloatArray, R: FloatArray) -> FloatArray:
    found = straight(np.ones_like(t), t, t**2, np.where(t < 0.0, (t - 100.0) * t**3, 0.0), y=R)
    return np.asarray([found[0], *(found[1:] / found[0])])


_PARAMETERS = (
    Parameter("R0", "ohm", "resistance at 0 degC"),
    Parameter("A", "1/degC", "linear coefficient"),
    Parameter("B", "1/degC^2", "quadratic coefficient"),
)
_C = Parameter("C", "1/degC^4", "coefficient below 0 degC")
_DERIVED = (
    Derived("alpha", "1/degC", "(R(100 degC) - R0) / (100 degC R0)", lambda b: b[1] + 100.0 * b[2]),
    Derived("delta", "degC", "Callendar's delta", lambda b: -1e4 * b[2] / (b[1] + 100.0 * b[2])),
)
_BETA = Derived("beta", "degC", "Van Dusen's beta", lambda b: -1e8 * b[3] / (b[1] + 100.0 * b[2]))

MODELS = (
    StandardModel(
        "callendar",
        "resistance thermometer from 0 degC: R0 (1 + A t + B t^2)",
        _SOURCE,
        _T,
        _R,
        (0.0, 850.0),
        _PARAMETERS,
        _callendar,
        _start,
        _DERIVED,
        "readings at three temperatures or more determine it",
    ),
    StandardModel(
        "callendar-van-dusen",
        "resistance thermometer: R0 (1 + A t + B t^2 + C (t - 100 degC) t^3), C only below 0 degC",
        _SOURCE,
        _T,
        _R,
        (-200.0, 850.0),
        (*_PARAMETERS, _C),
        _van_dusen,
        _start_below,
        (*_DERIVED, _BETA),
        "C needs readings below 0 degC; without them, --model callendar",
    ),
)
