"""Gravity on the sphere, and propagation of errors from outputs to angles; arrays are (3, n) and (S, n) throughout.

Uncertainty is computed along two directions that are orthogonal at every attitude: up the meridian (pitch) and along
the parallel (roll times the cosine of pitch). Roll alone has a pole at +-90 deg of pitch; these have none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.infer.calibration import AttitudeCalibration

DEGREE = 180.0 / np.pi
"""Degrees of a radian: `np.degrees` is the same number in six times the time."""

NORMAL_95 = 1.959963984540054
_TINY = np.finfo(float).tiny
_MANY = 20.0
_FEW = 4.0
"""Degrees of freedom below which Satterthwaite's limits hold with less than 94 %, if parameters drift much."""
_Z = NORMAL_95
_T_1 = (_Z**3 + _Z) / 4.0
_T_2 = (5.0 * _Z**5 + 16.0 * _Z**3 + 3.0 * _Z) / 96.0
_T_3 = (3.0 * _Z**7 + 19.0 * _Z**5 + 17.0 * _Z**3 - 15.0 * _Z) / 384.0
_T_4 = (79.0 * _Z**9 + 776.0 * _Z**7 + 1482.0 * _Z**5 - 1920.0 * _Z**3 - 945.0 * _Z) / 92160.0


def gravity(pitch: FloatArray, roll: FloatArray) -> FloatArray:
    """(3, n) gravity in package axes at (n,) angles in rad (eq. 113)."""
    cos_a = np.cos(pitch)
    return np.stack([np.sin(pitch), -np.sin(roll) * cos_a, -np.cos(roll) * cos_a])


def angles(g: FloatArray, across: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Pitch within +-90 deg, and roll, in rad, of (3, ...) gravity of any length; `across` (...) is its part
    across the first axis, if known.

    By half angles, tan(b/2) = sin b / (1 + cos b) = (1 - cos b) / sin b: two divisions and two arctangents take less
    time than `arctan2`.
    """
    x, y, z = g
    level = np.sqrt(y * y + z * z) if across is None else across
    pitch = x * x
    pitch += level * level
    np.sqrt(pitch, out=pitch)
    pitch += level
    np.maximum(pitch, _TINY, out=pitch)
    np.divide(x, pitch, out=pitch)
    np.arctan(pitch, out=pitch)
    pitch *= 2.0
    reach = np.abs(z)
    reach += level
    np.maximum(reach, _TINY, out=reach)
    beyond = ~np.signbit(z)
    roll = np.where(beyond, reach, y)
    with np.errstate(divide="ignore"):
        roll /= np.where(beyond, y, reach)
    np.arctan(roll, out=roll)
    roll *= -2.0
    return pitch, roll


def on_parallel(g: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n,) second and third component of (3, n) gravity of unit length, over (n,) their length, the cosine of pitch.

    At the pole itself, where every direction is up, zero roll is used.
    """
    _, y, z = g
    c = y * y
    c += z * z
    np.sqrt(c, out=c)
    with np.errstate(invalid="ignore", divide="ignore"):
        y, z = y / c, z / c
    if not c.all():
        pole = c == 0.0
        y[pole], z[pole] = 0.0, -1.0
    return y, z, c


def directions(g: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(3, 2, n) directions up the meridian and along the parallel, (n,) cosine of pitch, of (3, n) gravity of unit
    length.
    """
    y, z, c = on_parallel(g)
    return np.stack([np.stack([c, -y * g[0], -z * g[0]]), np.stack([np.zeros_like(c), z, -y])], axis=1), c


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of new readings.

    Attributes:
        variance: (S,) V^2.
        of_fit: whether it is the calibration's sigma_E^2, with its degrees of freedom, instead of a given value.
    """

    variance: FloatArray
    of_fit: bool


@dataclass(frozen=True, eq=False)
class Spread:
    """Variance of a linear function of the outputs with known gains.

    Attributes:
        variance: (...) total variance, of the gains' shape without that of the sensors.
        df: (...) degrees of freedom.
    """

    variance: FloatArray
    df: FloatArray


@dataclass(frozen=True, eq=False)
class Propagation:
    """Propagation of errors of calibration and readings to angles at given attitudes (eqs. 73, 74, 81, 90, 104).

    Attributes:
        calibration: of the package.
        noise: of new readings.
        calibrated: (...) variance of (S, ...) gains times errors of the calibration; the last axis is that of the
            attitudes.
    """

    calibration: AttitudeCalibration
    noise: Noise
    calibrated: Callable[[FloatArray], FloatArray]

    @staticmethod
    def at(calibration: AttitudeCalibration, noise: Noise, g: FloatArray, warmth: FloatArray) -> Propagation:
        """At (3, n) gravity of unit length and (n,) temperature above the reference."""
        if any(s.terms for s in calibration.sensors):
            rows = [s.rows(g, warmth) for s in calibration.sensors]
            return Propagation(calibration, noise, partial(_by_root, calibration.root, rows))
        if calibration.alike is not None:
            between, own = calibration.alike
            each = own[1:].T @ g
            each += own[0][:, None]
            return Propagation(calibration, noise, partial(_alike, between, np.einsum("kn,kn->n", each, each)))
        pairs = np.empty((10, g.shape[1]))
        pairs[0], pairs[1:4] = 1.0, g
        np.multiply(g[0], g, out=pairs[4:7])
        np.multiply(g[1], g[1:], out=pairs[7:9])
        np.multiply(g[2], g[2], out=pairs[9])
        return Propagation(calibration, noise, partial(_by_pairs, calibration.products @ pairs))

    def spread(self, gains: FloatArray, of_roll: FloatArray | None = None, *, weighed: bool = False) -> Spread:
        """Variance of gains @ errors of outputs.

        Args:
            gains: (S, ...) change per volt of each output; the last axis is that of the attitudes.
            of_roll: (...) further variance, known, from measured roll.
            weighed: whether the gains use weights estimated from the noise. These favour a sensor whose noise was
                estimated too small, so the variance is larger by a factor 1 + 4 sum p (1 - p) / df, where p is each
                sensor's share of it (P. Meier, Biometrics 9, 59, 1953).
        """
        calibrated = self.calibrated(gains)
        own, per_df, drift = self.noise.variance, 1.0 / self.calibration.sigma_df, self.calibration.drift
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            squares = gains * gains
            total, by_df = _over_sensors(np.stack([own, own * per_df]), squares)
            squares *= squares
            one = 1.0 / total
            inverse = _over_sensors(own * own * per_df, squares)  # one over the degrees of freedom of the noise
            inverse *= one
            inverse *= one
            if weighed and self.noise.of_fit:
                by_df *= one
                by_df -= inverse
                by_df *= 4.0
                by_df += 1.0
                total *= by_df
                calibrated *= by_df
            variance = total + calibrated
            from_fit = variance if self.noise.of_fit else calibrated
            if of_roll is not None:
                variance = variance + of_roll
            if drift is None:
                # sigma_E^2 of each sensor scales its noise and its calibration: their shares are those of the noise
                if from_fit is not variance:
                    inverse *= (from_fit / variance) ** 2
            elif drift.df < _FEW:
                of_noise = float(self.calibration.sigma_df.min()) if self.noise.of_fit else np.inf
                inverse = inverse_df_of_two(calibrated / variance, drift.df, of_noise)
            else:
                of_fit = inverse * (total / variance) ** 2 if self.noise.of_fit else 0.0
                inverse = (calibrated / variance) ** 2 / drift.df + of_fit
            return Spread(variance, 1.0 / inverse)


def _by_root(root: FloatArray, rows: Sequence[FloatArray], gains: FloatArray) -> FloatArray:
    """(...) variance of (S, ...) gains, by the (K, K) root of the covariance and S (k_s, n) columns of the models."""
    moved = [k * _between(h, gains) for k, h in zip(gains, rows, strict=True)]
    turned = root.T @ np.concatenate(moved).reshape(len(root), -1)
    return np.asarray(np.einsum("kn,kn->n", turned, turned)).reshape(gains.shape[1:])


def _alike(between: FloatArray, own: FloatArray, gains: FloatArray) -> FloatArray:
    """(...) variance of (S, ...) gains, by the (S, S) root of factors and (n,) variance of a sensor of factor one."""
    turned = between.T @ gains.reshape(len(gains), -1)
    return np.asarray(np.einsum("kn,kn->n", turned, turned)).reshape(gains.shape[1:]) * own


def _by_pairs(shared: FloatArray, gains: FloatArray) -> FloatArray:
    """(...) variance of (S, ...) gains, by (S (S + 1) / 2, n) covariances of pairs of sensors, twice that of two
    different ones.
    """
    found, at = np.zeros(gains.shape[1:]), 0
    for i in range(len(gains)):
        part = (gains[i:] * _between(shared[at : at + len(gains) - i], gains)).sum(axis=0)
        part *= gains[i]
        found += part
        at += len(gains) - i
    return found


def _between(values: FloatArray, gains: FloatArray) -> FloatArray:
    """(k, n) values as (k, ..., n), for (S, ..., n) gains."""
    return values.reshape(len(values), *(1,) * (gains.ndim - 2), -1)


def _over_sensors(factors: FloatArray, values: FloatArray) -> FloatArray:
    """(..., ...) sum of (S, ...) values with (..., S) factors."""
    return np.asarray(factors @ values.reshape(len(values), -1)).reshape(*factors.shape[:-1], *values.shape[1:])


def inverse_df_of_two(share: FloatArray, df: float, df_of_rest: float) -> FloatArray:
    """One over the degrees of freedom at which Student's t is the limit for a sum of two errors.

    The limit is that of Banerjee (Calcutta Statistical Association Bulletin 10, 1960): squares of the parts' own limits
    are added. It holds with 95 % at least. Satterthwaite's does not with few degrees of freedom: where a variance that
    is known badly happens to be found small, it also counts as unimportant.

    Args:
        share: (n,) of the variance, of the error that is known with `df` degrees of freedom.
        df: of that error.
        df_of_rest: of the other one.
    """
    of_error, of_rest = t_limits(np.array([df, df_of_rest]))
    inverse = np.linspace(0.0, 1.0 / df, 2001)
    limits = np.concatenate([[NORMAL_95], t_limits(1.0 / inverse[1:])])
    return np.asarray(np.interp(np.sqrt(of_error**2 * share + of_rest**2 * (1.0 - share)), limits, inverse))


def t_limits(df: FloatArray) -> FloatArray:
    """(...) 95 % limits of |t|, for (...) degrees of freedom, also infinite ones.

    By its expansion in 1/df (Fisher and Cornish), to 2e-7 of the value; as `rig.fitter.quantiles.t_limit` for few.
    """
    x = 1.0 / df
    limits = x * _T_4
    for term in (_T_3, _T_2, _T_1):
        limits += term
        limits *= x
    limits += NORMAL_95
    few = df < _MANY
    if few.any():
        limits[few] = special.stdtrit(df[few], 0.975)
    return limits
