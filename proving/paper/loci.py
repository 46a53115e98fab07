"""Figures 9, 11 and 12: attitudes at which a package cannot tell pitch and roll (sections 6.4 to 6.6)."""

from __future__ import annotations

import numpy as np

from proving.paper.packages import Mounting, off_grid, package
from proving.paper.plots import PITCH, ROLL, Field, Figure, Line, Panel
from proving.paper.statement import Statement, above, below
from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.angles import sin_cos
from rig.procedures.attitude.infer import singularity
from rig.procedures.attitude.infer.singular import normal

_PITCH, _ROLL = off_grid(-180, 180, 1.0), off_grid(-180, 180, 2.0)
_NEARLY = 0.01
"""Level at which a locus of three sensors is drawn: its function touches zero and does not cross it."""


def x_y(coning: float, A_x: float, A_y: float = 90.0) -> tuple[Mounting, ...]:
    """Sensors of figure 9."""
    return ("x", coning, A_x, 1.0), ("y", coning, A_y, 1.0)


def x_z(coning: float, A_x: float, A_z: float = 0.0) -> tuple[Mounting, ...]:
    """Sensors of figure 11."""
    return ("x", coning, A_x, 1.0), ("z", coning, A_z, 1.0)


def x_y_z(coning: float, azimuth: float) -> tuple[Mounting, ...]:
    """Sensors of figure 12."""
    return tuple((axis, coning, azimuth, 1.0) for axis in "xyz")


_NINE = {"a": x_y(0.1, 20), "b": x_y(1, 20), "c": x_y(0.1, 90), "d": x_y(1, 90)}
_ELEVEN = {"a": x_z(0.1, 90), "b": x_z(1, 90), "c": x_z(0.1, 0), "d": x_z(1, 0)}


def figures_9_11_12() -> tuple[Figure, ...]:
    """As plots; grey is the distance from a locus."""
    return (
        Figure("9", "Where x and y cannot tell pitch and roll", tuple(_panel(k, s) for k, s in _NINE.items())),
        Figure("11", "Where x and z cannot tell pitch and roll", tuple(_panel(k, s) for k, s in _ELEVEN.items())),
        Figure(
            "12",
            "Where three sensors with coning 45 deg cannot",
            tuple(_three_axes_panel(azimuth) for azimuth in (90.0, -90.0)),
        ),
    )


def statements_9_11_12() -> tuple[Statement, ...]:
    """What sections 6.4 to 6.6 say of them."""
    within = np.linspace(-60, 60, 121)
    at_poles = np.abs(singularity(package(*x_y(1, 20)), np.array([-90.0, 90.0])[:, None], off_grid(-180, 180, 5.0)))
    shift = _departure(x_y(1, 20, 90), within, 90.0) - _departure(x_y(1, 20, 0), within, 90.0)
    by_A_x = _departure(x_y(1, 90), np.array([80.0]), 90.0) - _departure(x_y(1, 0), np.array([80.0]), 90.0)
    least = min(
        float(np.min(singularity(package(*x_y_z(10, a)), 0.0, off_grid(-180, 180, 5.0)))) for a in range(-180, 180, 15)
    )
    mixed = min(_least_mixed(10.0, seed) for seed in range(200))
    return (
        below("6.4", "singular at +-90 deg of pitch", float(at_poles.max()), 1e-12),
        below("9(a), (b)", "nearly coincides with +-90 deg of roll for coning <= 1 deg, pitch to 60 deg",
              _most(x_y(1, 20), within, 90.0), 3, "deg", "A_x = 20 deg as captioned; the text has 0"),
        below("9(a)", "... for coning 0.1 deg, pitch to 85 deg", _most(x_y(0.1, 20), 85 / 60 * within, 90.0), 3, "deg"),
        above("9(c)", "A_x = 90 deg: significant departure as pitch approaches 90: at 89 deg, coning 0.1",
              _most(x_y(0.1, 90), np.array([89.0]), 90.0), 5, "deg"),
        above("9(d)", "... coning 1 deg", _most(x_y(1, 90), np.array([89.0]), 90.0), 5, "deg"),
        below("6.4", "loci are nearly independent of A_y: shift from A_y 0 to 90 deg, pitch to 60",
              float(np.abs(shift).max()), 3, "deg"),
        above("6.4", "... and depend on A_x: shift from A_x 0 to 90 deg at pitch 80",
              float(np.abs(by_A_x).max()), 5, "deg"),
        below("11(a), (b)", "nearly coincides with roll 0 and 180 for coning <= 1 deg, pitch to 60 deg",
              _most(x_z(1, 90), within, 0.0), 3, "deg"),
        above("11(c), (d)", "A_x = 0: significant departure as pitch approaches 90: at 89 deg, coning 0.1",
              _most(x_z(0.1, 0), np.array([89.0]), 0.0), 5, "deg", "departure from 0 and 180 deg; the text has +-90"),
        above("6.6", "three axes are nonsingular for all roll and azimuth at coning < 10 deg: least singularity "
              "function / cos(pitch), all azimuths equal", least, 0.5),
        above("6.6", "... the same, 200 random sets of azimuths, pitch and roll", mixed, 0.5),
        below("12", "coning 45 deg, all azimuths 90 deg: a locus; least of the same",
              _least(x_y_z(45, 90)), _NEARLY,
              note="with the signs of eqs. (87), (88), (95) only +-90 deg of pitch is singular"),
        below("12", "... azimuths of -90 deg give the locus", _least(x_y_z(45, -90)), _NEARLY),
    )  # fmt: skip


def locus_roll(sensors: tuple[Mounting, ...], pitch_deg: FloatArray) -> FloatArray:
    """(2, n) roll in deg at which two sensors are singular at (n,) pitch; NaN where there is none.

    With n square to both axes n . g_M = n_x sin a - cos a (n_y sin R + n_z cos R) = 0.
    """
    n = normal(package(*sensors).matrix)
    with np.errstate(invalid="ignore"):
        half = np.degrees(np.arccos(n[0] * np.tan(np.radians(pitch_deg)) / np.hypot(n[1], n[2])))
    middle = np.degrees(np.arctan2(n[1], n[2]))
    return np.stack([middle + half, middle - half])


def _departure(sensors: tuple[Mounting, ...], pitch_deg: FloatArray, nominal_deg: float) -> FloatArray:
    """(2, n) degrees from `nominal_deg` or half a turn from it; a locus that has ended counts as 90 deg off."""
    off = locus_roll(sensors, pitch_deg) - nominal_deg
    return np.nan_to_num(off - 180.0 * np.round(off / 180.0), nan=90.0)


def _most(sensors: tuple[Mounting, ...], pitch_deg: FloatArray, nominal_deg: float) -> float:
    return float(np.abs(_departure(sensors, pitch_deg, nominal_deg)).max())


def _least(sensors: tuple[Mounting, ...]) -> float:
    """Least of the singularity function over the sphere, without its factor cos(pitch)."""
    pitch, roll = off_grid(-90, 90, 1.0)[:, None], off_grid(-180, 180, 1.0)[None, :]
    return float(np.min(singularity(package(*sensors), pitch, roll) / np.cos(np.radians(pitch))))


def _least_mixed(coning: float, seed: int) -> float:
    azimuths = np.random.default_rng(seed).uniform(-180, 180, 3)
    sensors = tuple((axis, coning, float(a), 1.0) for axis, a in zip("xyz", azimuths, strict=True))
    pitch, roll = off_grid(-90, 90, 15.0)[:, None], off_grid(-180, 180, 15.0)[None, :]
    return float(np.min(singularity(package(*sensors), pitch, roll) / np.cos(np.radians(pitch))))


def _panel(name: str, sensors: tuple[Mounting, ...]) -> Panel:
    """Two sensors: their loci in closed form, since a grid would miss two that are closer together than its step."""
    values = singularity(package(*sensors), _PITCH[None, :], _ROLL[:, None])
    title = f"({name}) coning {sensors[0][1]:g}, A_x {sensors[0][2]:g}, A_{sensors[1][0]} {sensors[1][2]:g} deg"
    n = normal(package(*sensors).matrix)
    pitch = np.linspace(-180, 180, 3601)
    roll = locus_roll(sensors, pitch)
    around = np.linspace(-180, 180, 1441)
    sin_r, cos_r = sin_cos(around)
    steep = np.degrees(np.arctan2(n[1] * sin_r + n[2] * cos_r, n[0]))
    lines = [_locus(np.array([side, side]), np.array([-180.0, 180.0])) for side in (-90.0, 90.0)]
    lines += [_locus(pitch, each) for each in roll]
    lines += [_locus(each, around) for each in (steep, steep + 180.0)]
    return Panel(title, PITCH, ROLL, tuple(lines), (-180.0, 180.0), Field(_PITCH, _ROLL, values))


def _three_axes_panel(azimuth: float) -> Panel:
    values = singularity(package(*x_y_z(45, azimuth)), _PITCH[None, :], _ROLL[:, None])
    return Panel(f"all azimuths {azimuth:g} deg", PITCH, ROLL, (), None, Field(_PITCH, _ROLL, values, _NEARLY))


def _locus(pitch_deg: FloatArray, roll_deg: FloatArray) -> Line:
    """A curve on the map, broken where it leaves at one edge and comes back at the other."""
    wrapped = [np.mod(angle + 180.0, 360.0) - 180.0 if angle.size > 2 else angle for angle in (pitch_deg, roll_deg)]
    torn = np.any([np.abs(np.diff(angle, prepend=angle[0])) > 180.0 for angle in wrapped], axis=0) & (
        pitch_deg.size > 2
    )
    return Line(np.where(torn, np.nan, wrapped[0]), wrapped[1], "", "-", "C3")
