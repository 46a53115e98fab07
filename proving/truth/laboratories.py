"""Simulated laboratories whose instruments truly err as their certificates say: heads, voltmeters, gravity, standards.

Everything is drawn and applied here in plain numbers, many laboratories at once: nothing of registers, influences or
evaluations is used. A reading is what an instrument with its own error shows; its certificate states a distribution
that this error is drawn from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rng = np.random.Generator


@dataclass(frozen=True)
class AttitudeCertificates:
    """Standard uncertainties of a laboratory for attitude sensors; `half_drift` is a limit of error.

    Attributes:
        pitch_turn_deg: error of the pitch axis once per turn, at any angle.
        roll_turn_deg: the same of the roll axis.
        zero_deg: error of the zero of pitch.
        tilt_deg: of each of the two tilts of the base.
        gravity: of local gravity, m/s2; its value is `local`.
        offset_V: of the voltmeter.
        gain_V: of the voltmeter, relative.
        half_drift: of its gain since its calibration.
        noise_V: scatter of readings.
    """

    pitch_turn_deg: float = 4e-4
    roll_turn_deg: float = 6e-4
    zero_deg: float = 2e-4
    tilt_deg: float = 3e-4
    gravity: float = 4e-4
    local: float = 9.8123
    offset_V: float = 2e-5
    gain_V: float = 2e-5
    half_drift: float = 2e-5
    noise_V: float = 3e-5


@dataclass(frozen=True)
class AttitudeLaboratory:
    """One laboratory's run, and the truth about its sensors.

    Attributes:
        outputs: (n, 3) recorded volts.
        b_V: (3,) true offsets.
        m_V: (3, 3) true sensitive axes times sensitivities, V per local g.
        gravity: true local gravity, m/s2.
        readings: (p, 3) volts of a later use at true angles, by a perfect voltmeter.
        same: (p, 3) the same by the voltmeter of the run.
        exact: (p, 3) outputs at these angles without scatter.
    """

    outputs: Array
    b_V: Array
    m_V: Array
    gravity: float
    readings: Array
    same: Array
    exact: Array


def gravity_seen(pitch_deg: Array, roll_deg: Array, lean_deg: float = 0.0) -> Array:
    """(n, 3) gravity in axes of a package turned by pitch, then by roll, on a base that leans sideways.

    By rotation of a vector, step by step: down is -z.
    """
    a, r, t = np.radians(pitch_deg), np.radians(roll_deg), np.radians(lean_deg)
    x, y, z = np.zeros_like(a), np.full_like(a, -np.sin(t)), np.full_like(a, -np.cos(t))
    x, z = np.cos(a) * x - np.sin(a) * z, np.sin(a) * x + np.cos(a) * z
    y, z = np.cos(r) * y + np.sin(r) * z, -np.sin(r) * y + np.cos(r) * z
    return np.column_stack([x, y, z])


def attitude(
    says: AttitudeCertificates, pitch_deg: Array, roll_deg: Array, use_deg: Array, rng: Rng
) -> AttitudeLaboratory:
    """Draw a laboratory, calibrate at (n,) recorded angles, and read the package at (p, 2) true angles later."""
    axes = np.eye(3) + rng.normal(0.0, 5e-3, (3, 3))
    m = axes / np.linalg.norm(axes, axis=1)[:, None] * rng.uniform(4.5, 5.5, 3)[:, None]
    b = rng.normal(0.0, 5e-3, 3)
    turn, roll_turn = rng.normal(0.0, says.pitch_turn_deg, 2), rng.normal(0.0, says.roll_turn_deg, 2)
    ahead = rng.normal(0.0, says.zero_deg) + rng.normal(0.0, says.tilt_deg)
    lean = rng.normal(0.0, says.tilt_deg)
    offset = rng.normal(0.0, says.offset_V)
    gain = rng.normal(0.0, says.gain_V) + rng.uniform(-says.half_drift, says.half_drift)
    p, r = np.radians(pitch_deg), np.radians(roll_deg)
    true_pitch = pitch_deg + turn[0] * np.sin(p) + turn[1] * np.cos(p) + ahead
    true_roll = roll_deg + roll_turn[0] * np.sin(r) + roll_turn[1] * np.cos(r)
    volts = b + gravity_seen(true_pitch, true_roll, lean) @ m.T
    volts = volts + rng.normal(0.0, says.noise_V, volts.shape)
    exact = b + gravity_seen(use_deg[:, 0], use_deg[:, 1]) @ m.T
    later = exact + rng.normal(0.0, says.noise_V, exact.shape)
    local = says.local + rng.normal(0.0, says.gravity)
    return AttitudeLaboratory(volts * (1.0 + gain) + offset, b, m, local, later, later * (1.0 + gain) + offset, exact)


@dataclass(frozen=True)
class PressureCertificates:
    """Standard uncertainties of a laboratory for pressure transducers.

    Attributes:
        gain: relative, of the pressure standard.
        offset_psi: of the pressure standard.
        height_m: of the transducers above its reference level.
        sensor_K: of the thermometer at the transducers.
        offset_mV: of the voltmeter.
        gain_V: of the voltmeter, relative.
    """

    gain: float = 3e-4
    offset_psi: float = 1e-3
    height_m: float = 0.3
    sensor_K: float = 0.2
    offset_mV: float = 2e-3
    gain_V: float = 2e-4


AIR_PER_M = 1.2041 * 9.80665 / 101325.0
"""Share of the pressure by which a metre of air at 20 degC changes it, from its density at 101 325 Pa."""


@dataclass(frozen=True)
class PressureErrors:
    """Errors of one laboratory."""

    gain: float
    offset_psi: float
    height_m: float
    sensor_K: float
    meter_gain: float
    meter_mV: float

    @classmethod
    def drawn(cls, says: PressureCertificates, rng: Rng) -> PressureErrors:
        """As its certificates say."""
        return cls(
            rng.normal(0.0, says.gain),
            rng.normal(0.0, says.offset_psi),
            rng.normal(0.0, says.height_m),
            rng.normal(0.0, says.sensor_K),
            rng.normal(0.0, says.gain_V),
            rng.normal(0.0, says.offset_mV),
        )

    def true_pressure(self, recorded: Array) -> Array:
        """Pressure at the transducers where the standard shows `recorded`."""
        at_standard = (recorded - self.offset_psi) / (1.0 + self.gain)
        return np.asarray(at_standard * (1.0 - AIR_PER_M * self.height_m))

    def read(self, mV: Array) -> Array:
        """What the voltmeter shows."""
        return np.asarray(mV * (1.0 + self.meter_gain) + self.meter_mV)


@dataclass(frozen=True)
class ForceCertificates:
    """A stand for load cells: weights with a common error and errors of their own, a voltmeter.

    Attributes:
        gain: relative, of all weights together.
        own_kN: of each weight.
        half_V: offset of the voltmeter.
        gain_V: relative standard uncertainty of its gain, from `df` degrees of freedom.
        df: of it.
        noise_V: scatter of readings.
    """

    gain: float = 2e-4
    own_kN: float = 4e-4
    half_V: float = 1.5e-4
    gain_V: float = 1.5e-4
    df: int = 8
    noise_V: float = 2e-4


@dataclass(frozen=True)
class ForceLaboratory:
    """One stand's run of a cell, and the truth.

    Attributes:
        outputs: (n,) recorded volts.
        said: standard uncertainty of the voltmeter's gain that its certificate states; it was estimated from a sample.
        start: true output at no force.
        slope: true slope, V per kN.
        readings: (p,) volts of a later use by a perfect voltmeter.
    """

    outputs: Array
    said: float
    start: float
    slope: float
    readings: Array


def force(says: ForceCertificates, forces: Array, use: Array, rng: Rng) -> ForceLaboratory:
    """Draw a stand, calibrate at (n,) nominal forces, and read at (p,) true forces later."""
    levels, which = np.unique(forces, return_inverse=True)
    true = forces * (1.0 + rng.normal(0.0, says.gain)) + rng.normal(0.0, says.own_kN, len(levels))[which]
    start, slope = rng.normal(0.0, 0.01), rng.uniform(0.45, 0.55)
    gain, offset = rng.normal(0.0, says.gain_V), rng.uniform(-says.half_V, says.half_V)
    said = says.gain_V * np.sqrt(rng.chisquare(says.df) / says.df)
    volts = start + slope * true + rng.normal(0.0, says.noise_V, len(forces))
    later = start + slope * use + rng.normal(0.0, says.noise_V, len(use))
    return ForceLaboratory(volts * (1.0 + gain) + offset, float(said), float(start), float(slope), later)
