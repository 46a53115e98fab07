"""Reading error by pressure."""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.pressure.data import WholePlotData


def reading_error_pct(data: WholePlotData, residual: FloatArray, slope: FloatArray) -> dict[str, float | None]:
    """Largest residual at each nominal pressure over the pressure read, in percent; None at zero pressure.

    Args:
        data: the run.
        residual: (n,) of one transducer, including whole-plot errors, mV.
        slope: (n,) dV/dP there, mV/psi.
    """
    psia, level = data.pressure_levels
    positive = data.pressure_psia > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.where(positive, np.abs(100.0 * residual / (slope * data.pressure_psia)), 0.0)
    largest = np.zeros(psia.size)
    np.maximum.at(largest, level, error)
    names = (f"{round(float(p), 3):g}" for p in psia)  # differences of levels are larger
    return {name: float(e) if p > 0 else None for name, p, e in zip(names, psia, largest, strict=True)}
