"""Charted parameters of one sensor of any kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.history.series import Series


@dataclass(frozen=True, eq=False)
class Charted:
    """Parameters of one sensor over m calibrations.

    Attributes:
        names: of q charted parameters, each linear in the coefficients of the model, with their units.
        series: one per parameter.
        shown: names of p parameters for people.
        parameters: (m, p) their values.
        stderr: (m, p) their standard errors within a calibration.
        sensitivity: mean of the sensor, V/g or mV/psi.
        replicated: whether errors within a calibration come from repeated measurements.
        variance_of: (m,) variance within calibrations, and its degrees of freedom, of a linear combination (q,) of the
            parameters.
    """

    names: tuple[str, ...]
    series: tuple[Series, ...]
    shown: tuple[str, ...]
    parameters: FloatArray
    stderr: FloatArray
    sensitivity: float
    replicated: bool
    variance_of: Callable[[FloatArray], tuple[FloatArray, float]]

    def combined(self, weights: FloatArray) -> Series:
        """A linear combination (q,) of the charted parameters over the calibrations, for example an output."""
        values = np.column_stack([s.values for s in self.series]) @ weights
        return Series(self.series[0].years, values, *self.variance_of(weights))
