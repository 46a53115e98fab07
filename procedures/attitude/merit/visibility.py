"""Visibility of undeclared effects in a design.

A design must not only be precise. If the declared model can imitate an effect over the calibrated range, there is no
residual: the coefficients absorb it, and are wrong outside that range. T_bias, the test of lack of fit, uses the part
that the model cannot imitate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.quantiles import f_limit
from rig.procedures.attitude.angles import sin_cos
from rig.procedures.attitude.merit.design_points import DesignPoints
from rig.procedures.attitude.model import fit_columns

POWER = 0.9
"""Probability of detection of the smallest visible effect."""


@dataclass(frozen=True)
class Visibility:
    """Visible part of an effect in the residuals.

    Attributes:
        rms: root mean square of the residual of an effect with amplitude one.
        share: its ratio to the effect's own root mean square; 0 if the effect is zero at every point.
        smallest: amplitude, in standard deviations of one observation, that T_bias at 5 % detects with probability 0.9;
            infinite if there is no residual, or no replication and so no pure error.
    """

    rms: float
    share: float
    smallest: float


def visibility(design: DesignPoints, effect: FloatArray) -> Visibility:
    """Part of an undeclared effect that remains in the residuals of the declared model.

    Args:
        design: calibration points.
        effect: (K,) the effect at its points, for an amplitude of one.
    """
    basis = orthonormal(design.columns())
    left = effect - basis @ (basis.T @ effect)
    size, rest = float(np.linalg.norm(effect)), float(np.linalg.norm(left))
    if rest <= 1e-9 * np.sqrt(design.points):
        return Visibility(0.0, 0.0, float("inf"))
    df_lof, df_pe = design.points - design.parameters, design.observations - design.points
    smallest = float("inf")
    if df_lof > 0 and df_pe > 0:
        needed = float(special.ncfdtrinc(df_lof, df_pe, 1.0 - POWER, f_limit(0.95, df_lof, df_pe)))
        smallest = float(np.sqrt(needed / design.replications)) / rest
    return Visibility(rest / float(np.sqrt(design.points)), rest / size, smallest)


def pad_visibility(design: DesignPoints) -> Visibility:
    """Visibility of soft isolation pads under the package: sin 2a cos R in an x sensor, section 9.1.

    Without roll it is sin 2a, which within +-30 deg of pitch the model [1, sin a, cos a] imitates to 4 %.
    """
    sin, cos = sin_cos(design.pitch_deg)
    upright = sin_cos(design.roll_deg)[1] if design.roll else np.ones(design.points)
    return visibility(design, 2.0 * sin * cos * upright)


def smallest_offset_drift(design: DesignPoints) -> float:
    """Smallest variation of the offset between replications that the drift test T_b at 5 % detects with probability
    0.9.

    As a standard deviation, in standard deviations of one observation. It increases the mean square between
    replications by the factor 1 + drift^2 / c, where c sigma^2 is the variance of one replication's own offset.
    Infinite for one replication, or without degrees of freedom within replications.

    Raises:
        rig.fitter.linear.RankError: the design does not determine the model.
    """
    df_between = design.replications - 1
    df_within = design.replications * (design.points - design.parameters)
    if df_between <= 0 or df_within <= 0:
        return float("inf")
    own = float(np.sum(fit_columns(design.columns(), np.zeros(design.points)).root[0] ** 2))
    needed = f_limit(0.95, df_between, df_within) / f_limit(1.0 - POWER, df_between, df_within)
    return float(np.sqrt(own * (needed - 1.0)))
