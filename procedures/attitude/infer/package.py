"""Gravity on the sphere, and propagation of errors from outputs to angles; arrays are (3, n) and (S, n) throughout.

Uncertainty is computed along two directions that are orthogonal at every attitude: up the meridian (pitch) and along
the parallel (roll times the cosine of pitch). Roll alone has a pole at +-90 deg of pitch; these have none.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy import special

from fitter.arrays import FloatArray
from procedures.attitude.infer.calibration import AttitudeCalibration

NORMAL_95 = 1.959963984540054
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
    """Pitch within +-90 deg, and roll, in rad, of (3, n) gravity of any length; `across` (n,) is its part across the
    first axis, if known.
    """
    level = np.sqrt(g[1] * g[1] + g[2] * g[2]) if across is None else across
    return np.arctan2(g[0], level), np.arctan2(-g[1], -g[2])


def directions(g: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(3, n) up the meridian, (3, n) along the parallel, (n,) cosine of pitch, of (3, n) gravity of unit length.

    At the pole itself, where every direction is up, zero roll is used.
    """
    c = np.sqrt(g[1] * g[1] + g[2] * g[2])
    up, along, pole = np.empty((3, c.size)), np.zeros((3, c.size)), c == 0.0
    safe = np.where(pole, 1.0, c) if pole.any() else c
    along[1], along[2] = g[2] / safe, -g[1] / safe
    along[1][pole] = -1.0
    up[0], up[1], up[2] = c, along[2] * g[0], -along[1] * g[0]
    return up, along, c


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
        variance: (n,) total variance.
        df: (n,) degrees of freedom.
    """

    variance: FloatArray
    df: FloatArray


@dataclass(frozen=True, eq=False)
class Propagation:
    """Propagation of errors of calibration and readings to angles at given attitudes (eqs. 73, 74, 81, 90, 104).

    Attributes:
        calibration: of the package.
        noise: of new readings.
        rows: S arrays (k_s, n), the columns of each sensor's model at the attitudes.
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
        base = calibration.sensors[0].rows(g, warmth)
        pairs = np.empty((10, g.shape[1]))
        at = 0
        for i, row in enumerate(base):
            np.multiply(row, base[i:], out=pairs[at : at + 4 - i])
            at += 4 - i
        return Propagation(calibration, noise, (base,) * len(calibration.sensors), calibration.products @ pairs)

    def _calibrated(self, gains: FloatArray) -> FloatArray:
        """(n,) variance of gains @ errors of the calibration."""
        if self.shared is not None:
            found = gains[0] * gains[0] * self.shared[0]
            pairs = itertools.combinations_with_replacement(gains, 2)
            for (one, other), covariance in itertools.islice(zip(pairs, self.shared, strict=True), 1, None):
                found += one * other * covariance
            return np.asarray(found)
        moved = np.concatenate([k * h for k, h in zip(gains, self.rows, strict=True)])
        turned = self.calibration.root.T @ moved
        return np.asarray(np.einsum("kn,kn->n", turned, turned))

    def spread(self, gains: FloatArray, of_roll: FloatArray | None = None, *, weighed: bool = False) -> Spread:
        """Variance of gains @ errors of outputs.

        Args:
            gains: (S, n) change per volt of each output.
            of_roll: (n,) further variance, known, from measured roll.
            weighed: whether the gains use weights estimated from the noise. These favour a sensor whose noise was
                estimated too small, so the variance is larger by a factor 1 + 4 sum p (1 - p) / df, where p is each
                sensor's share of it (P. Meier, Biometrics 9, 59, 1953).
        """
        noise = gains * gains
        noise *= self.noise.variance[:, None]
        calibrated = self._calibrated(gains)
        total = noise.sum(axis=0)
        df, drift = self.calibration.sigma_df, self.calibration.drift
        if weighed and self.noise.of_fit:
            with np.errstate(invalid="ignore", divide="ignore"):
                share = noise / total
                squares = np.einsum("sn,sn,s->n", share, share, 1.0 / df)
                more = 1.0 + 4.0 * (np.einsum("sn,s->n", share, 1.0 / df) - squares)
                if of_roll is None and drift is None:  # sigma_E^2 of each sensor scales its noise and its calibration
                    return Spread((total + calibrated) * more, 1.0 / squares)
            noise, total, calibrated = noise * more, total * more, calibrated * more
        variance = total + calibrated
        from_fit = variance if self.noise.of_fit else calibrated
        if of_roll is not None:
            variance = variance + of_roll
        if drift is not None:
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                inverse = (calibrated / variance) ** 2 / drift.df
                if self.noise.of_fit:
                    inverse = inverse + np.einsum("sn,s->n", (noise / variance) ** 2, 1.0 / df)
                if drift.df < _FEW:
                    of_noise = float(df.min()) if self.noise.of_fit else np.inf
                    inverse = inverse_df_of_two(calibrated / variance, drift.df, of_noise)
                return Spread(variance, 1.0 / inverse)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            # sigma_E^2 of each sensor scales both its noise and its calibration: their shares are those of the noise
            share = from_fit / (total * variance)
            return Spread(variance, 1.0 / np.einsum("sn,s->n", (noise * share) ** 2, 1.0 / df))


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


def tangent(
    matrix: FloatArray, weights: FloatArray, up: FloatArray, along: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(S, n) gains of weighted least squares, up the meridian and along the parallel, rad/V (eqs. 89, 103).

    Args:
        matrix: (S, 3) V/g.
        weights: (S,) inverse variances of the outputs.
        up: (3, n).
        along: (3, n).

    """
    f_up, f_along = matrix @ up, matrix @ along
    w_up, w_along = weights[:, None] * f_up, weights[:, None] * f_along
    a, b, d = (np.einsum("sn,sn->n", p, q) for p, q in ((w_up, f_up), (w_up, f_along), (w_along, f_along)))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        over = 1.0 / (a * d - b * b)
        a, b, d = a * over, b * over, d * over
        return d * w_up - b * w_along, a * w_along - b * w_up


def t_limits(df: FloatArray) -> FloatArray:
    """(n,) 95 % limits of |t|, for (n,) degrees of freedom, also infinite ones.

    By its expansion in 1/df (Fisher and Cornish), to 2e-7 of the value; as `fitter.quantiles.t_limit` for few.
    """
    x = 1.0 / df
    limits = NORMAL_95 + x * (_T_1 + x * (_T_2 + x * (_T_3 + x * _T_4)))
    few = ~(df >= _MANY)
    if few.any():
        limits[few] = special.stdtrit(df[few], 0.975)
    return np.asarray(limits)
