"""What is charted of one sensor, whatever kind it is."""

from __future__ import annotations

from dataclasses import dataclass

from fitter.arrays import FloatArray
from fitter.history.series import Series


@dataclass(frozen=True, eq=False)
class Charted:
    """Parameters of one sensor over m calibrations.

    Attributes:
        names: of q charted parameters, each linear in the coefficients of the model, with their units.
        series: one each.
        shown: names of p parameters for people.
        parameters: (m, p) their values.
        stderr: (m, p) their standard errors within a calibration.
        sensitivity: mean of the sensor, V/g or mV/psi.
        replicated: whether errors within a calibration come from something that was repeated in it.

    """

    names: tuple[str, ...]
    series: tuple[Series, ...]
    shown: tuple[str, ...]
    parameters: FloatArray
    stderr: FloatArray
    sensitivity: float
    replicated: bool
