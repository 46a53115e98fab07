"""Gravity on the sphere, and propagation of errors from outputs to angles; arrays are (3, n) and (S, n) throughout.

Uncertainty is computed along two directions that are orthogonal at every attitude: up the meridian (pitch) and along
the parallel (roll times the cosine of pitch). Roll alone has a pole at +-90 deg of pitch; these have none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from fitter.arrays import FloatArray
from procedures.attitude.infer.calibration import AttitudeCalibration

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

    By half angles, tan(b/2) = sin b / (1 + cos b): an arctangent of at most one takes half the time of `arctan2`.
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
    # roll: its tangent is -y/-z; of |z| first, then on its side
    roll = np.abs(z)
    roll += level
    np.maximum(roll, _TINY, out=roll)
    np.divide(y, roll, out=roll)
    np.arctan(roll, out=roll)
    side = np.copysign(1.0, z)
    roll *= 2.0
    roll *= side
    side += 1.0
    side *= np.pi / 2.0
    roll -= np.copysign(side, y, out=side)
    return pitch, roll


def directions(g: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(3, 2, n) directions up the meridian and along the parallel, (n,) cosine of pitch, of (3, n) gravity of unit
    length.

    At the pole itself, where every direction is up, zero roll is used.
    """
    x, y, z = g
    c = y * y
    c += z * z
    np.sqrt(c, out=c)
    turns = np.empty((3, 2, c.size))
    up, along = turns[:, 0], turns[:, 1]
    along[0] = 0.0
    with np.errstate(invalid="ignore", divide="ignore"):
        np.divide(z, c, out=along[1])
        np.divide(y, c, out=along[2])
    np.negative(along[2], out=along[2])
    if not c.all():
        pole = c == 0.0
        along[1, pole], along[2, pole] = -1.0, 0.0
    up[0] = c
    np.multiply(along[2], x, out=up[1])
    np.multiply(along[1], x, out=up[2])
    np.negative(up[2], out=up[2])
    return turns, c


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
        rows: S arrays (k_s, n), the columns of each sensor's model at the attitudes; none where `shared` serves.
        shared: (S (S + 1) / 2, n) covariance of the parts of each pair of sensors, twice that of two different ones, if
            no sensor has further terms; otherwise None.
    """

    calibration: AttitudeCalibration
    noise: Noise
    rows: tuple[FloatArray, ...]
    shared: FloatArray | None = None

    @staticmethod
    def at(calibration: AttitudeCalibration, noise: Noise, g: FloatArray, warmth: FloatArray) -> Propagation:
        """At (3, n) gravity of unit length and (n,) temperature above the reference."""
        if any(s.terms for s in calibration.sensors):
            return Propagation(calibration, noise, tuple(s.rows(g, warmth) for s in calibration.sensors))
        pairs = np.empty((10, g.shape[1]))
        pairs[0], pairs[1:4] = 1.0, g
        np.multiply(g[0], g, out=pairs[4:7])
        np.multiply(g[1], g[1:], out=pairs[7:9])
        np.multiply(g[2], g[2], out=pairs[9])
        return Propagation(calibration, noise, (), calibration.products @ pairs)

    def _calibrated(self, gains: FloatArray) -> FloatArray:
        """(...) variance of (S, ...) gains times errors of the calibration; the last axis is that of the attitudes."""
        between = (1,) * (gains.ndim - 2)
        if self.shared is not None:
            found, at = np.zeros(gains.shape[1:]), 0
            for i in range(len(gains)):
                shared = self.shared[at : at + len(gains) - i]
                row = gains[i:] * shared.reshape(len(shared), *between, -1)
                part = row.sum(axis=0)
                part *= gains[i]
                found += part
                at += len(shared)
            return found
        moved = [k * h.reshape(len(h), *between, -1) for k, h in zip(gains, self.rows, strict=True)]
        turned = self.calibration.root.T @ np.concatenate(moved).reshape(len(self.calibration.root), -1)
        return np.asarray(np.einsum("kn,kn->n", turned, turned)).reshape(gains.shape[1:])

    def spread(self, gains: FloatArray, of_roll: FloatArray | None = None, *, weighed: bool = False) -> Spread:
        """Variance of gains @ errors of outputs.

        Args:
            gains: (S, ...) change per volt of each output; the last axis is that of the attitudes.
            of_roll: (...) further variance, known, from measured roll.
            weighed: whether the gains use weights estimated from the noise. These favour a sensor whose noise was
                estimated too small, so the variance is larger by a factor 1 + 4 sum p (1 - p) / df, where p is each
                sensor's share of it (P. Meier, Biometrics 9, 59, 1953).
        """
        calibrated = self._calibrated(gains)
        noise = gains * gains
        noise *= self.noise.variance.reshape(-1, *(1,) * (gains.ndim - 1))
        total = noise.sum(axis=0)
        per_df, drift = 1.0 / self.calibration.sigma_df, self.calibration.drift
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            if weighed and self.noise.of_fit:
                share = noise / total
                more = _over_sensors(per_df, share)
                share *= share
                squares = _over_sensors(per_df, share)
                more -= squares
                more *= 4.0
                more += 1.0
                if of_roll is None and drift is None:  # sigma_E^2 of each sensor scales its noise and its calibration
                    calibrated += total
                    more *= calibrated
                    return Spread(more, np.divide(1.0, squares, out=squares))
                noise, total, calibrated = noise * more, total * more, calibrated * more
            variance = total + calibrated
            from_fit = variance if self.noise.of_fit else calibrated
            if of_roll is not None:
                variance = variance + of_roll
            if drift is None:
                # sigma_E^2 of each sensor scales its noise and its calibration: their shares are those of the noise
                inverse = _over_sensors(per_df, (noise * (from_fit / (total * variance))) ** 2)
            elif drift.df < _FEW:
                of_noise = float(self.calibration.sigma_df.min()) if self.noise.of_fit else np.inf
                inverse = inverse_df_of_two(calibrated / variance, drift.df, of_noise)
            else:
                inverse = (calibrated / variance) ** 2 / drift.df
                if self.noise.of_fit:
                    inverse = inverse + _over_sensors(per_df, (noise / variance) ** 2)
            return Spread(variance, 1.0 / inverse)


def _over_sensors(factors: FloatArray, values: FloatArray) -> FloatArray:
    """(...) sum of (S, ...) values with (S,) factors."""
    return np.asarray((factors @ values.reshape(len(values), -1)).reshape(values.shape[1:]))


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

    By its expansion in 1/df (Fisher and Cornish), to 2e-7 of the value; as `fitter.quantiles.t_limit` for few.
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
