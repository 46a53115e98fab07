"""Vapour pressure by Antoine's equation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.general.models.entry import Derived, Parameter, Quantity, StandardModel, straight


def _antoine(b: Sequence[Any], t: Any) -> Any:
    A, B, C = b
    return np.exp(np.log(10.0) * (A - B / (C + t)))


def _start(t: FloatArray, p: FloatArray) -> FloatArray:
    """From t lg p = A t + (A C - B) - C lg p, linear in A, A C - B and C."""
    lg = np.log10(np.where(p > 0.0, p, np.nan))
    seen = np.isfinite(lg)
    A, mixed, C = straight(t[seen], np.ones(seen.sum()), -lg[seen], y=t[seen] * lg[seen])
    return np.asarray([A, A * C - mixed, C])


MODELS = (
    StandardModel(
        "antoine",
        "vapour pressure: lg(p / Pa) = A - B / (C + t)",
        "C. Antoine, Comptes Rendus 107 (1888) 681, 836",
        Quantity("temperature", "degC"),
        Quantity("pressure", "Pa"),
        (-273.15, 5000.0),
        (
            Parameter("A", "", "lg of the pressure, in Pa, far above the range"),
            Parameter("B", "degC", "steepness"),
            Parameter("C", "degC", "offset of the temperature"),
        ),
        _antoine,
        _start,
        (Derived("t_normal", "degC", "temperature at 101325 Pa", lambda b: b[1] / (b[0] - np.log10(101325.0)) - b[2]),),
        "it takes pressures at three temperatures or more",
    ),
)
