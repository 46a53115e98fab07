"""Figures 13 to 20: pitch and roll from three sensors, section 6.6.

The figures are said to be of weighted least squares; eqs. (104) to (108) are those of least squares that weigh all
sensors alike. Both are drawn, and where a statement depends on it both are computed.
"""

from __future__ import annotations

import numpy as np

from proving.paper.packages import normalised_sd, off_grid, package, percent, worst
from proving.paper.plots import PITCH, ROLL, Figure, Line, Panel
from proving.paper.statement import SMALL, Statement, about, below, digits
from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.angles import sin_cos
from rig.procedures.attitude.infer import AttitudeCalibration

CASES = {13: (0.1, 10.0), 15: (1.0, 10.0), 17: (1.0, 1.0), 19: (5.0, 10.0)}
"""Coning angle, and noise of y and z over that of x, by the first of two figures: over pitch, and over roll."""
_PITCH, _ROLL = off_grid(-90, 90, 1.0), off_grid(-180, 180, 2.0)
_WAYS = ((True, "weighted", "-"), (False, "unweighted", "--"))


def three(coning_deg: float, noise: float) -> AttitudeCalibration:
    """The package of figures 13 to 20: A_x = 90, A_y = A_z = 0 deg."""
    return package(("x", coning_deg, 90.0, 1.0), ("y", coning_deg, 0.0, noise), ("z", coning_deg, 0.0, noise))


def figures_13_to_20() -> tuple[Figure, ...]:
    """As plots: pitch beside roll, at several angles of the other kind."""
    figures = []
    for number, (coning, noise) in CASES.items():
        what = f"three sensors, coning {coning:g} deg, y and z {noise:g} times as noisy as x"
        over_pitch = _panels(three(coning, noise), PITCH, _PITCH, "roll", (0.0, 45.0, 90.0, 180.0))
        over_roll = _panels(three(coning, noise), ROLL, np.arange(0.0, 181.0, 2.0), "pitch", (0.0, 30.0, 60.0, 80.0))
        figures.append(Figure(str(number), f"Pitch and roll over pitch, {what}", over_pitch))
        figures.append(Figure(str(number + 1), f"Pitch and roll over roll, {what}", over_roll))
    return tuple(figures)


def statements_13_to_20() -> tuple[Statement, ...]:
    """What section 6.6, its summary and section 10 say."""
    return (*_equations(), *_figures())


def _equations() -> tuple[Statement, ...]:
    """Eq. (108) and what is said of it, without misalignment."""
    unlike, alike = three(0.0, 10.0), three(0.0, 1.0)
    sin_a, cos_a = sin_cos(_PITCH[:, None])
    plain, plain_roll = _sd(unlike, weighted=False)
    weighted, weighted_roll = _sd(unlike)
    at_0, at_90 = (float(normalised_sd(unlike, a, 20.0, weighted=False)[0]) for a in (0.0, 89.999))
    at_45 = [float(normalised_sd(unlike, 45.0, 20.0, weighted=way)[0]) for way in (False, True)]
    added = np.sqrt(1.0 / (cos_a**2 + sin_a**2 / 100.0))
    return (
        below("6.6", "eq. (108), pitch: largest relative difference, unweighted",
              _off(plain, np.hypot(cos_a, 10.0 * sin_a)), 1e-6),
        below("6.6", "eq. (108), roll: the same", _off(plain_roll * cos_a, 1.0), 1e-6),
        below("6.6", "... weighted, information is added: 1/sd^2 = cos^2 a / sd_x^2 + sin^2 a / sd_y^2",
              _off(weighted, added), 1e-6, note=f"at 45 deg {at_45[1]:.3f}; eq. (108) {at_45[0]:.3f}"),
        below("6.6", "sd of pitch = sd of x everywhere if all sensors are equal", _off(_sd(alike)[0], 1.0), 1e-6),
        digits("6.6", "least sd of pitch, at 0 deg: sd of x", 1.0, at_0, 3),
        digits("6.6", "greatest sd of pitch, at +-90 deg: sd of y", 10.0, at_90, 3),
        below("6.6", "independent of roll: pitch", _over_roll(weighted), 1e-6, "%"),
        below("6.6", "independent of roll: roll", _over_roll(weighted_roll), 1e-6, "%"),
    )  # fmt: skip


def _figures() -> tuple[Statement, ...]:
    """What is said of the figures: computed weighted, as they are said to be, and unweighted in the note."""
    base, thirteen, fifteen, seventeen = (
        [_sd(package_, weighted=way)[0] for way, _, _ in _WAYS]
        for package_ in (three(0.0, 10.0), *(three(*CASES[n]) for n in (13, 15, 17)))
    )
    steep = off_grid(-60, 60, 2.0)[:, None]
    rise = [_rise_at_90(steep, weighted=way) for way, _, _ in _WAYS]
    kept = [normalised_sd(three(2.0, 10.0), steep, _ROLL[None, :], weighted=way)[0] for way, _, _ in _WAYS]

    def either(values: list[float], unit: str = "") -> str:
        return f"unweighted {values[1]:.3g}{unit}"

    negligible, insignificant = ([_change(a, b) for a, b in zip(*pair, strict=True)] for pair in
                                 ((thirteen, base), (fifteen, thirteen)))  # fmt: skip
    constant, largest, precise = ([worst(f) for f in each] for each in ([_spread(s) for s in seventeen], rise, kept))
    return (
        below("13, 14", "negligible deviation from no misalignment", negligible[0], SMALL, "%",
              either(negligible, " %")),
        below("15, 16", "insignificant change from figures 13, 14", insignificant[0], SMALL, "%",
              either(insignificant, " %")),
        below("17, 18", "pitch nearly constant over pitch and roll", constant[0], SMALL, "%", either(constant, " %")),
        about("19, 20", "pitch worsens by approximately 50 percent at roll 90 deg: most within +-60 deg, from roll 0",
              50, largest[0], 10, "%", f"{rise[0][len(steep) // 2]:.0f} % at pitch 0; {either(largest, ' %')}"),
        below("6.7", "precision is kept within +-60 deg, y and z ten times worse, coning 2 deg: sd of pitch / sd of x",
              precise[0], 2.2, note=f"x alone has 1/cos 60 = 2; {either(precise)}"),
    )  # fmt: skip


def _sd(calibration: AttitudeCalibration, *, weighted: bool = True) -> tuple[FloatArray, FloatArray]:
    return normalised_sd(calibration, _PITCH[:, None], _ROLL[None, :], weighted=weighted)


def _rise_at_90(pitch_deg: FloatArray, *, weighted: bool) -> FloatArray:
    """(n,) how much worse pitch of figure 19 is at roll 90 than at 0 deg, percent, at (n, 1) pitch."""
    level, side = normalised_sd(three(*CASES[19]), pitch_deg, np.array([0.0, 90.0]), weighted=weighted)[0].T
    return percent(side, level)


def _panels(
    calibration: AttitudeCalibration, label: str, x: FloatArray, other: str, at: tuple[float, ...]
) -> tuple[Panel, Panel]:
    lines: tuple[list[Line], list[Line]] = ([], [])
    for weighted, name, style in _WAYS:
        for i, value in enumerate(at):
            pitch, roll = (x, value) if label == PITCH else (value, x)
            for each, sd in zip(lines, normalised_sd(calibration, pitch, roll, weighted=weighted), strict=True):
                each.append(Line(x, sd, f"{other} {value:g}, {name}", style, f"C{i}"))
    return (
        Panel("pitch", label, "sd of pitch / sd of x", tuple(lines[0]), (0.0, 11.0)),
        Panel("roll", label, "sd of roll / sd of y", tuple(lines[1]), (0.0, 10.0)),
    )


def _off(values: FloatArray, than: FloatArray | float) -> float:
    return worst(np.abs(values / than - 1.0))


def _over_roll(values: FloatArray) -> float:
    """Largest change over roll, in percent."""
    return worst(percent(values.max(axis=1), values.min(axis=1)))


def _spread(values: FloatArray) -> FloatArray:
    return percent(values.max(), values.min())


def _change(values: FloatArray, than: FloatArray) -> float:
    return worst(np.abs(percent(values, than)))
