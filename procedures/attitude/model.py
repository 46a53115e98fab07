"""The attitude models of NASA/TP-1999-209835, eqs. (1), (2), (4), (5), in linear form.

Every sensor measures v = b + m . g_M: offset, plus gravity in package axes projected on its sensitive axis times its
sensitivity. Least squares for (b, m) is linear, and S, Omega and A follow from m by an exact change of variables: along
and across the nominal axis i of a sensor

    m_i = S cos Omega,   m_j = S sin Omega cos A,   m_k = S sin Omega sin A,   (i, j, k) cyclic in x, y, z.

At Omega = 0 the azimuth is undefined, but the linear form stays regular.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rig.fitter import LinearFit, least_squares, ties
from rig.fitter.arrays import FloatArray
from rig.fitter.quantiles import t_limit
from rig.procedures.attitude.angles import sin_cos

COLUMNS = ("1", "sin(pitch)", "cos(pitch)*sin(roll)", "cos(pitch)*cos(roll)")
COLUMNS_NO_ROLL = ("1", "sin(pitch)", "cos(pitch)")
AXES = {"x": 0, "y": 1, "z": 2}
LEAST = 3e-4
"""Root mean square below which one of the columns above counts as zero: 0.02 deg, closer than two settings of
a head.
"""
DIRECTION_KNOWN = 5.0
"""Minimum coning angle, in its standard deviations, for a determined azimuth and valid intervals."""
_GRAVITY_SIGN = np.array([1.0, -1.0, -1.0])


def attitude_columns(pitch_deg: FloatArray, roll_deg: FloatArray, *, roll: bool = True) -> FloatArray:
    """(n, 4) rows h = [1, sin a, cos a sin R, cos a cos R] of the linear model; (n, 3) without roll.

    Args:
        pitch_deg: (n,).
        roll_deg: (n,); not used without roll.
        roll: whether the sensor is calibrated with roll (eqs. 2, 4, 5) or without (eq. 1).

    """
    sin_a, cos_a = sin_cos(pitch_deg)
    ones = np.ones_like(sin_a)
    if not roll:
        return np.column_stack([ones, sin_a, cos_a])
    sin_r, cos_r = sin_cos(roll_deg)
    return np.column_stack([ones, sin_a, cos_a * sin_r, cos_a * cos_r])


def mounting_matrix(x_deg: float, y_deg: float, z_deg: float) -> FloatArray:
    """(3, 3) rotation from axes of the head's table to those of a turned package.

    Args:
        x_deg: rotation about the package's x axis, first; adds to the roll of the package.
        y_deg: about its y axis, second; at zero roll it adds to pitch.
        z_deg: about its z axis, last; 180 deg is end for end.
    """
    (sx, cx), (sy, cy), (sz, cz) = (np.ravel(sin_cos(np.array([angle]))) for angle in (x_deg, y_deg, z_deg))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, sx], [0.0, -sx, cx]])
    about_y = np.array([[cy, 0.0, -sy], [0.0, 1.0, 0.0], [sy, 0.0, cy]])
    about_z = np.array([[cz, sz, 0.0], [-sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)


def variance_function(design: FloatArray, at: FloatArray) -> FloatArray:
    """(m,) variance of a predicted output over the variance of one observation, h' (H'H)^-1 h.

    It depends only on the measured and the predicted points (Theorems I to III).

    Args:
        design: (n, k) rows h of every planned observation, with replications.
        at: (m, k) rows h of predictions.

    Raises:
        rig.fitter.linear.RankError: the design does not determine the model; the message names the undetermined
            coefficients.
    """
    return fit_columns(design, np.zeros(len(design))).variance_function(at)


Interval = tuple[float, float]


@dataclass(frozen=True)
class AttitudeParameters:
    """The paper's parameters of a sensor with roll, and its sensitive axis.

    Attributes:
        b_V: offset.
        S_V: sensitivity, volts per g, positive.
        Omega_deg: coning angle, in [0, 180); above 90 deg the sensor is mounted backwards.
        A_deg: azimuth, in (-180, 180]; NaN at Omega = 0.
        covariance: (4, 4) of (b_V, S_V, Omega_deg, A_deg); NaN in the row and column of an undefined azimuth.
        axis: nominal axis of the sensor, 0, 1, 2 for x, y, z.
        m_V: (3,) sensitive axis times sensitivity, V/g in package axes.
        m_covariance: (3, 3) of it.
    """

    b_V: float
    S_V: float
    Omega_deg: float
    A_deg: float
    covariance: FloatArray
    axis: int
    m_V: FloatArray
    m_covariance: FloatArray

    @property
    def stderr(self) -> FloatArray:
        """(4,) standard errors of (b_V, S_V, Omega_deg, A_deg)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def direction_known(self) -> bool:
        """Whether the coning angle (or its difference from 180 deg) exceeds `DIRECTION_KNOWN` standard deviations.
        Otherwise the sensitive axis is too near its nominal axis to determine its direction. Omega and A then have no
        valid errors; the axis itself, `m_V`, has.
        """
        return bool(min(self.Omega_deg, 180.0 - self.Omega_deg) > DIRECTION_KNOWN * self.stderr[2])

    def intervals(self, df: float, level: float = 0.95) -> tuple[Interval, Interval, Interval | None, Interval | None]:
        """Confidence intervals of b_V, S_V, Omega_deg and A_deg; None for the last two if the direction is
        undetermined. That of A is Fieller's interval. It is exact for normal transverse components, and its ends may be
        beyond +-180 deg.
        """
        t = t_limit(level, df)
        b, S, Omega = _around((self.b_V, self.S_V, self.Omega_deg), self.stderr[:3], t)
        if not self.direction_known:
            return b, S, None, None
        across = [*_cyclic(self.axis)[1:]]
        m = self.m_V[across]
        values, vectors = np.linalg.eigh(np.outer(m, m) - t**2 * self.m_covariance[np.ix_(across, across)])
        if not values[0] < 0 < values[1]:
            return b, S, None, None
        half = float(np.degrees(np.arctan(np.sqrt(-values[0] / values[1]))))
        lean = vectors[:, 1] * np.sign(vectors[:, 1] @ m)
        # the set is symmetric about its own axis, which differs slightly from the estimate's if the errors are unequal
        middle = np.degrees(np.arctan2(lean[1], lean[0]))
        middle = self.A_deg + (middle - self.A_deg + 180.0) % 360.0 - 180.0
        return b, S, Omega, (float(middle - half), float(middle + half))


@dataclass(frozen=True)
class NoRollParameters:
    """The paper's parameters of a sensor calibrated without roll, eq. (1).

    Attributes:
        b_V: offset.
        S_V: sensitivity, volts per g, positive.
        phi_deg: pitch misalignment, in (-180, 180].
        covariance: (3, 3) of (b_V, S_V, phi_deg).

    """

    b_V: float
    S_V: float
    phi_deg: float
    covariance: FloatArray

    @property
    def stderr(self) -> FloatArray:
        """(3,) standard errors of (b_V, S_V, phi_deg)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def intervals(self, df: float, level: float = 0.95) -> tuple[Interval, Interval, Interval]:
        """Confidence intervals of b_V, S_V and phi_deg."""
        b, S, phi = _around((self.b_V, self.S_V, self.phi_deg), self.stderr, t_limit(level, df))
        return b, S, phi


def sensitive_axis(coefficients: FloatArray) -> FloatArray:
    """(3,) sensitive axis times sensitivity, V/g in package axes, from the 4 (or, without roll, 3) coefficients."""
    if len(coefficients) == len(COLUMNS_NO_ROLL):
        return np.array([coefficients[1], 0.0, -coefficients[2]])
    return np.asarray(_GRAVITY_SIGN * coefficients[1:4])


def linear_coefficients(axis: int, b_V: float, S_V: float, Omega_deg: float, A_deg: float) -> FloatArray:
    """(4,) coefficients of `COLUMNS` for the paper's parameters of a sensor along `axis` (0, 1, 2 for x, y, z)."""
    Omega, A = np.radians(Omega_deg), np.radians(A_deg)
    m = np.empty(3)
    i, j, k = _cyclic(axis)
    m[i], m[j], m[k] = np.cos(Omega), np.sin(Omega) * np.cos(A), np.sin(Omega) * np.sin(A)
    return np.array([b_V, *(_GRAVITY_SIGN * S_V * m)])


def attitude_parameters(axis: int, coefficients: FloatArray, covariance: FloatArray) -> AttitudeParameters:
    """The paper's (b, S, Omega, A) and their covariance, from the linear fit.

    Args:
        axis: nominal axis of the sensor, 0, 1, 2 for x, y, z.
        coefficients: (4,) of `COLUMNS`, V.
        covariance: (4, 4) of them.

    """
    m = sensitive_axis(coefficients)
    i, j, k = _cyclic(axis)
    S, across = float(np.linalg.norm(m)), float(np.hypot(m[j], m[k]))
    defined = across > 1e-12 * S
    jacobian = np.zeros((4, 4))
    jacobian[0, 0] = 1.0
    by_m = np.zeros((3, 3))
    by_m[0] = m / S
    if defined:
        by_m[1, i] = -across / S**2
        by_m[1, j], by_m[1, k] = m[i] * m[j] / (across * S**2), m[i] * m[k] / (across * S**2)
        by_m[2, j], by_m[2, k] = -m[k] / across**2, m[j] / across**2
    else:
        by_m[2] = np.nan
        by_m[1, j] = by_m[1, k] = np.sqrt(0.5) / S
    by_m[1:] = np.degrees(by_m[1:])
    jacobian[1:, 1:] = by_m * _GRAVITY_SIGN
    return AttitudeParameters(
        b_V=float(coefficients[0]),
        S_V=S,
        Omega_deg=float(np.degrees(np.arctan2(across, m[i]))),
        A_deg=float(np.degrees(np.arctan2(m[k], m[j]))) if defined else float("nan"),
        covariance=jacobian @ covariance @ jacobian.T,
        axis=axis,
        m_V=m,
        m_covariance=_GRAVITY_SIGN[:, None] * covariance[1:, 1:] * _GRAVITY_SIGN,
    )


def no_roll_parameters(coefficients: FloatArray, covariance: FloatArray) -> NoRollParameters:
    """The paper's (b, S, phi) of eq. (1) and their covariance, from the linear fit without roll.

    Args:
        coefficients: (3,) of `COLUMNS_NO_ROLL`, V.
        covariance: (3, 3) of them.

    """
    b, s, c = (float(value) for value in coefficients)
    S = float(np.hypot(s, c))
    jacobian = np.array([[1.0, 0.0, 0.0], [0.0, s / S, c / S], [0.0, c / S**2, -s / S**2]])
    jacobian[2] = np.degrees(jacobian[2])
    return NoRollParameters(b, S, float(np.degrees(np.arctan2(-c, s))), jacobian @ covariance @ jacobian.T)


def nominal_axis(sensor: str, coefficients: FloatArray, axes: Mapping[str, str] | None = None) -> int:
    """Nominal axis of a sensor, 0, 1, 2.

    Args:
        sensor: column name of its output.
        coefficients: of the declared model.
        axes: "x", "y" or "z" by column name, if known. Otherwise the first letter of the name, and for another letter
            the axis of the largest sensitivity.
    """
    if axes is not None and sensor in axes:
        return AXES[axes[sensor]]
    return AXES.get(sensor[:1].lower(), ties.highest(np.abs(sensitive_axis(coefficients))))


def sigma_deg(sigma_V: float, S_V: float) -> float:
    """Degrees of a small angle about the axis of greatest slope that change the output by `sigma_V` (Table 2)."""
    return float(np.degrees(sigma_V / S_V))


def fit_columns(columns: FloatArray, output_V: FloatArray) -> LinearFit:
    """Least squares of one output on `attitude_columns`, with or without roll.

    Raises:
        rig.fitter.linear.RankError: the points do not determine every coefficient.

    """
    names = COLUMNS if columns.shape[1] == len(COLUMNS) else COLUMNS_NO_ROLL
    return least_squares(columns, output_V, names, LEAST)


def _around(values: Sequence[float], errors: FloatArray, t: float) -> list[Interval]:
    return [(float(v - t * error), float(v + t * error)) for v, error in zip(values, errors, strict=True)]


def _cyclic(axis: int) -> tuple[int, int, int]:
    return axis, (axis + 1) % 3, (axis + 2) % 3
