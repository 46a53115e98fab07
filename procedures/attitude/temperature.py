"""Temperature dependence of offset and sensitivity, as part of the declared model.

The temperature correction of NASA/TP-1999-209835, section 9, which takes row 28(a) of Table 2 to row 28(b):

    v = b + b' (T - T_0) + S (1 + S'/S (T - T_0)) (sensitive axis . g_M)

Along a given sensitive axis this is linear in b' and S'; the axis comes from the fit, by a few iterations from that of
the model without temperature. T_0 is the mean temperature of the calibration, so b and S are those at T_0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from rig.fitter import LinearFit, least_squares
from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.attitude.data import AttitudeData

TERMS = ("temperature", "temperature*gravity")
ROUNDS, SETTLED = 8, 1e-10
CHANGES_degC = 1e-3
"""Minimum variation of temperature for an estimate of its influence."""


@dataclass(frozen=True, eq=False)
class Temperature:
    """Temperature terms of a sensor's output, per degC above the reference.

    Attributes:
        reference_degC: temperature T_0 of the other parameters.
        direction: (k - 1,) sensitive axis as a unit vector, over the columns of the model beside the offset.
        coefficients: (2,) b' in V/degC and S' in V/g/degC.
        covariance: (2, 2) of them.
    """

    reference_degC: float
    direction: FloatArray
    coefficients: FloatArray
    covariance: FloatArray

    @classmethod
    def of(cls, data: AttitudeData, h: FloatArray, output: FloatArray, plain: LinearFit) -> Self:
        """Temperature terms about the data's mean temperature, along the sensitive axis of the output; fitted to it.

        Args:
            data: the run.
            h: (n, k) rows of the model without temperature.
            output: (n,) volts.
            plain: the model without temperature, fitted to it.

        Raises:
            rig.fitter.linear.RankError: the observations do not determine every coefficient.
            FitError: no sensor temperature was recorded, or it never changed.
        """
        degC = data.sensor_temperature_degC
        if degC is None:
            raise FitError("no sensor temperature was recorded: its effect cannot be fitted")
        if np.ptp(degC) < CHANGES_degC:
            raise FitError(f"the sensor temperature never changed ({degC[0]:g} degC): its effect cannot be fitted")
        m = plain.coefficients[1:]
        own = cls(float(np.mean(degC)), m / np.linalg.norm(m), np.full(2, np.nan), np.full((2, 2), np.nan))
        for _ in range(ROUNDS):
            fit, own = own.fitted(h, data, output, plain.names)
            m = fit.coefficients[1:] / np.linalg.norm(fit.coefficients[1:])
            if np.linalg.norm(m - own.direction) < SETTLED:
                break
            own = replace(own, direction=m)
        return own

    def moved(self, degC: float) -> FloatArray:
        """(k, 2) derivative of the model's coefficients by those of temperature, for a change of reference, times that
        change in degC.
        """
        away = degC - self.reference_degC
        return away * np.column_stack([np.eye(1, self.direction.size + 1)[0], np.r_[0.0, self.direction]])

    def columns(self, h: FloatArray, data: AttitudeData) -> FloatArray:
        """(n, 2) columns of `TERMS`: warmth in degC, and warmth times gravity along the sensitive axis in degC g.

        Args:
            h: (n, k) rows of the model without temperature.
            data: the observations they are of.

        Raises:
            FitError: no sensor temperature was recorded.

        """
        if data.sensor_temperature_degC is None:
            raise FitError("no sensor temperature was recorded: its effect cannot be computed")
        warmth = data.sensor_temperature_degC - self.reference_degC
        return np.column_stack([warmth, warmth * (h[:, 1:] @ self.direction)])

    def volts(self, h: FloatArray, data: AttitudeData) -> FloatArray:
        """(n,) contribution of temperature to the outputs; arguments and errors as for `columns`."""
        return np.asarray(self.columns(h, data) @ self.coefficients)

    def fitted(
        self, h: FloatArray, data: AttitudeData, output: FloatArray, names: Sequence[str]
    ) -> tuple[LinearFit, Self]:
        """Fit the model and its temperature terms together; returns the model's fit, and these terms with coefficients.

        Args:
            h: (n, k) rows of the model without temperature.
            data: the observations they are of.
            output: (n,) volts.
            names: k names of the model's columns.

        Raises:
            rig.fitter.linear.RankError: the observations do not determine every coefficient.
        """
        k = h.shape[1]
        joint = least_squares(np.column_stack([h, self.columns(h, data)]), output, (*names, *TERMS))
        own = replace(self, coefficients=joint.coefficients[k:], covariance=joint.covariance[k:, k:])
        return joint.first(k), own
