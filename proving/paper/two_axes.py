"""Figure 10: pitch and roll from x and y (section 6.4); x and z at measured roll (section 6.5)."""

from __future__ import annotations

import numpy as np

from proving.paper.packages import normalised_sd, off_grid, package, percent, worst
from proving.paper.plots import ROLL, Figure, Line, Panel
from proving.paper.statement import SMALL, Statement, above, below
from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.angles import sin_cos
from rig.procedures.attitude.infer import AttitudeCalibration

CASES = {
    "a": (("x", 1.0, 90.0, 1.0), ("y", 1.0, 0.0, 1.0)),
    "b": (("x", 0.1, 90.0, 1.0), ("y", 0.1, 0.0, 10.0)),
    "c": (("x", 1.0, 90.0, 1.0), ("y", 1.0, 0.0, 10.0)),
    "d": (("x", 1.0, 0.0, 1.0), ("y", 0.1, 0.0, 10.0)),
}
"""Sensors of figures 10(a) to (d)."""
PITCHES = (0.0, 20.0, 40.0, 60.0, 80.0)
_BOUNDED = 100.0
"""Normalised sd up to which an attitude counts as measurable: 1e-4 deg of output is 0.01 deg of angle."""
_ROLL = off_grid(-180, 180, 1.0)


def figure_10() -> Figure:
    """As plots."""
    panels = []
    for letter, sensors in CASES.items():
        pitch_lines, roll_lines = [], []
        for pitch in PITCHES:
            of_pitch, of_roll = normalised_sd(package(*sensors), pitch, _ROLL)
            pitch_lines.append(Line(_ROLL, of_pitch, f"pitch {pitch:g}"))
            roll_lines.append(Line(_ROLL, of_roll, f"pitch {pitch:g}"))
        panels.append(Panel(f"({letter}) pitch", ROLL, "sd of pitch / sd of x", tuple(pitch_lines), (0.0, 10.0)))
        panels.append(Panel(f"({letter}) roll", ROLL, "sd of roll / sd of y", tuple(roll_lines), (0.0, 20.0)))
    return Figure("10", "Pitch and roll from x and y sensors", tuple(panels))


def statements_10() -> tuple[Statement, ...]:
    """What sections 6.4 and 6.5 say."""
    a, b, c, d = (package(*sensors) for sensors in CASES.values())
    b_alike = package(*((axis, coning, azimuth, 1.0) for axis, coning, azimuth, _ in CASES["b"]))
    of_roll = normalised_sd(b, 20.0, _ROLL)[1]
    widths = [_width(package_, 40.0) for package_ in (b, c)]
    use_pitch, use_roll = off_grid(-80, 80, 2.0)[:, None], off_grid(-60, 60, 2.0)
    usable_pitch, usable_roll = normalised_sd(a, use_pitch, use_roll)
    x_z = package(("x", 0.0, 0.0, 1.0), ("z", 0.0, 0.0, 1.0))
    everywhere = off_grid(-180, 180, 7.0)[:, None]
    every_roll = off_grid(-180, 180, 7.0)
    (_, cos_p), (_, cos_q) = sin_cos(everywhere), sin_cos(every_roll)
    eq_98 = (1.0 - cos_q**2) * cos_p**2 + cos_q**2
    measured = normalised_sd(x_z, everywhere, every_roll, measured_roll_sd=0.0)[0]
    side_roll = off_grid(30, 150, 2.0)
    side = normalised_sd(x_z, use_pitch, side_roll)[1]
    return (
        above("10", "roll is singular near 90 deg of roll: sd of roll at 89.5 over 0.5 deg", _ratio(of_roll), 50),
        below("10", "roll is best near 0 and 180 deg: distance of the minimum", _from_level(of_roll), 1.0, "deg"),
        _worse("10(a), (c)", "coning 1 deg", a, c),
        _worse("10(b)", "coning 0.1 deg", b_alike, b),
        above("10(b), (c)", "the singularity widens as coning goes from 0.1 to 1 deg: ratio", widths[1] / widths[0], 2),
        below(
            "10(b), (d)",
            "pitch is least affected by roll for A_x = 0: rise to roll 60, pitch 40 deg, over the rise in (c)",
            _rise(d) / _rise(c),
            1.0,
        ),
        below("6.4", "x-y is suitable for |pitch| < 80, |roll| < 60 deg: largest sd of pitch / sd of x",
              worst(usable_pitch), _BOUNDED),
        below("6.4", "... largest sd of roll / sd of y", worst(usable_roll), _BOUNDED),
        below("6.5", "eq. (98): x-z at measured roll, largest difference", _off(measured**-2.0, eq_98), 1e-6),
        below("6.5", "x-z is usable for |pitch| < 80, 30 < |roll| < 150 deg: largest sd of roll / sd of z",
              worst(side), _BOUNDED),
    )  # fmt: skip


def _worse(where: str, what: str, alike: AttitudeCalibration, worse_y: AttitudeCalibration) -> Statement:
    pitch, roll = off_grid(-60, 60, 2.0)[:, None], off_grid(0, 85, 1.0)
    gain = percent(normalised_sd(worse_y, pitch, roll)[0], normalised_sd(alike, pitch, roll)[0]).max(axis=0)
    says = f"a ten times worse y does not significantly worsen pitch for |pitch| < 60, |roll| < 85 deg; {what}"
    kept = roll[gain < SMALL].max() + 0.5
    note = "" if kept >= 85 else f"holds for |roll| < {kept:.0f} deg"
    return below(where, says, worst(gain), SMALL, "%", note)


def _ratio(of_roll: FloatArray) -> float:
    return float(of_roll[np.argmin(np.abs(_ROLL - 89.5))] / of_roll[np.argmin(np.abs(_ROLL - 0.5))])


def _from_level(of_roll: FloatArray) -> float:
    least = _ROLL[np.argsort(of_roll)[:4]]
    return float(np.max(np.minimum(np.abs(least), 180 - np.abs(least))))


def _width(calibration: AttitudeCalibration, pitch_deg: float) -> float:
    """Degrees of roll about 90 in which pitch is more than twice as uncertain as upright."""
    roll = off_grid(0, 180, 0.1)
    of_pitch = normalised_sd(calibration, pitch_deg, roll)[0]
    return 0.1 * float(np.sum(of_pitch > 2.0 * of_pitch[0]))


def _rise(calibration: AttitudeCalibration) -> float:
    roll = off_grid(-60, 60, 1.0)
    of_pitch = normalised_sd(calibration, 40.0, roll)[0]
    return float(of_pitch.max() / of_pitch.min() - 1.0)


def _off(values: FloatArray, than: FloatArray) -> float:
    return worst(np.abs(values - than))
