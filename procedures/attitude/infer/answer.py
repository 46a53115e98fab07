"""Result for each reading: value, standard deviation, interval, and a flag for problems."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.infer.calibration import AttitudeCalibration
from rig.procedures.attitude.infer.known_roll import wrap
from rig.procedures.attitude.infer.package import DEGREE

HALF_TURN = 180.0
RANGE_ROOM_DEG = 0.1
"""Tolerance of the calibrated range for an angle: readbacks of the head and the inferred angle have errors."""

FAR_FROM_1_G = 0.1
"""Maximum deviation of three axes from 1 g for a flagged result; beyond it there is no attitude."""

BAD_READING = "not a finite number"
NO_ATTITUDE = "no attitude gives these outputs"
NOT_1_G = "the outputs do not add up to 1 g: the package accelerates, or a sensor has changed"
ROLL_OPEN = "roll is undetermined: pitch is at +-90 deg"
PITCH_OPEN = "pitch is undetermined: the outputs hardly change with it here"
TWO_FIT = "pitch is undetermined: measured roll is too uncertain to tell two attitudes apart"
BOTH_OPEN = "pitch and roll are undetermined: the part of gravity that neither sensor sees is near zero"


@dataclass(frozen=True, eq=False)
class InferredAttitude:
    """Attitudes, one per reading.

    An undetermined angle is NaN, its standard deviation is infinite, its interval covers all possible values, and
    `flag` gives the reason. Intervals may exceed the range of an angle; roll's may include +-180 deg.

    Attributes:
        pitch_deg: (n,).
        pitch_sd_deg: (n,) standard deviation: calibration, new reading and measured roll together.
        pitch_lo95_deg: (n,) 95 % interval.
        pitch_hi95_deg: (n,).
        roll_deg: (n,), as given if roll was measured.
        roll_sd_deg: (n,).
        roll_lo95_deg: (n,).
        roll_hi95_deg: (n,).
        df: (n,) degrees of freedom of `pitch_sd_deg` (Satterthwaite).
        roll_df: (n,) the same of `roll_sd_deg`; infinite if roll was measured.
        assumed: (n,) whether the outputs fit another attitude as well, and the result is the one nearest to `near_deg`.
        flag: (n,) empty without problems.
    """

    pitch_deg: FloatArray
    pitch_sd_deg: FloatArray
    pitch_lo95_deg: FloatArray
    pitch_hi95_deg: FloatArray
    roll_deg: FloatArray
    roll_sd_deg: FloatArray
    roll_lo95_deg: FloatArray
    roll_hi95_deg: FloatArray
    df: FloatArray
    roll_df: FloatArray
    assumed: NDArray[np.bool_]
    flag: NDArray[Any]


def empty(n: int) -> InferredAttitude:
    """Empty results for n readings, without flags."""
    numbers = {f.name: np.empty(n) for f in fields(InferredAttitude) if f.name not in ("assumed", "flag")}
    made = InferredAttitude(**numbers, assumed=np.zeros(n, bool), flag=np.empty(n, object))
    made.flag.fill("")
    return made


def reason(flag: NDArray[np.object_], where: NDArray[np.bool_], text: str) -> None:
    """Add a reason to the flags of some rows, in place."""
    if where.any():
        flag[where] = [f"{old}; {text}" if old else text for old in flag[where]]


def put(out: InferredAttitude, angle: str, value: FloatArray, sd: FloatArray, limit: FloatArray) -> None:
    """Set value, sd and interval of one angle, given in rad."""
    value_deg = np.multiply(value, DEGREE, out=getattr(out, f"{angle}_deg"))
    half = limit * np.multiply(sd, DEGREE, out=getattr(out, f"{angle}_sd_deg"))
    np.subtract(value_deg, half, out=getattr(out, f"{angle}_lo95_deg"))
    np.add(value_deg, half, out=getattr(out, f"{angle}_hi95_deg"))


def leave_open(
    out: InferredAttitude, angle: str, rows: NDArray[np.bool_], low: FloatArray | float, high: FloatArray | float
) -> None:
    """Mark one angle of some rows as undetermined between `low` and `high` deg."""
    getattr(out, f"{angle}_deg")[rows] = np.nan
    getattr(out, f"{angle}_sd_deg")[rows] = np.inf
    getattr(out, f"{angle}_lo95_deg")[rows] = low
    getattr(out, f"{angle}_hi95_deg")[rows] = high


def nowhere(out: InferredAttitude, rows: NDArray[np.bool_], text: str = NO_ATTITUDE) -> None:
    """Mark the attitude of some rows as unknown."""
    if rows.any():
        leave_open(out, "pitch", rows, -np.inf, np.inf)
        leave_open(out, "roll", rows, -np.inf, np.inf)
        out.flag[rows] = text


def turn_over(out: InferredAttitude, over: NDArray[np.bool_]) -> None:
    """Write the attitudes of some rows, which have two names, with pitch beyond +-90 deg."""
    half_turn = np.where(out.pitch_deg[over] >= 0, HALF_TURN, -HALF_TURN)
    low, high = half_turn - out.pitch_hi95_deg[over], half_turn - out.pitch_lo95_deg[over]
    out.pitch_deg[over] = half_turn - out.pitch_deg[over]
    out.pitch_lo95_deg[over], out.pitch_hi95_deg[over] = low, high
    shift = np.where(out.roll_deg[over] > 0, -HALF_TURN, HALF_TURN)
    known = np.isfinite(out.roll_deg[over])
    for name in ("roll_deg", "roll_lo95_deg", "roll_hi95_deg"):
        getattr(out, name)[over] += np.where(known, shift, 0.0)


def flag_ranges(calibration: AttitudeCalibration, out: InferredAttitude, degC: FloatArray | None) -> None:
    """Flag attitudes outside the calibrated range; an attitude is inside if one of its two pairs of angles is."""
    (low, high), (left, right) = calibration.pitch_range_deg, calibration.roll_range_deg
    all_rolls = not calibration.roll or right - left >= 2 * HALF_TURN - 2 * RANGE_ROOM_DEG
    if not (all_rolls and low <= -90.0 and high >= 90.0 and calibration.roll):
        inside = np.zeros(len(out.flag), bool)
        ways = ((0.0, 1.0),) if not calibration.roll else ((0.0, 1.0), (HALF_TURN, -1.0))
        for turn, sign in ways:
            pitch = _degrees(turn + sign * out.pitch_deg)
            pitched = (pitch >= low - RANGE_ROOM_DEG) & (pitch <= high + RANGE_ROOM_DEG)
            rolled = np.mod(out.roll_deg + turn - left + RANGE_ROOM_DEG, 360.0) <= right - left + 2 * RANGE_ROOM_DEG
            inside |= pitched & (all_rolls | rolled | np.isnan(out.roll_deg))
        text = f"outside the calibrated {low:g} to {high:g} deg of pitch"
        text += f" and {left:g} to {right:g} deg of roll" if not all_rolls else ""
        reason(out.flag, ~inside & np.isfinite(out.pitch_deg), text)
    if degC is not None and calibration.degC_range is not None:
        cold, warm = calibration.degC_range
        room = max(0.02 * (warm - cold), 0.1)
        text = f"sensor temperature is outside the calibrated {cold:g} to {warm:g} degC"
        reason(out.flag, ~((degC >= cold - room) & (degC <= warm + room)), text)


def _degrees(angle: FloatArray) -> FloatArray:
    return np.asarray(np.degrees(wrap(np.radians(angle))))
