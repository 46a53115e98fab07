"""Errors of the head: its angles differ from its readback, for a cause in the head.

An error of an angle changes an output by dv/d(angle) times the error: one coefficient, in degrees, for all sensors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.effects.entry import Alias, Largest, Signed
from rig.fitter.effects.manual_changes import resized_by
from rig.fitter.effects.sizes import amplitude, arcsec, each
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects.effect import Effect, Term, fixed
from rig.procedures.attitude.effects.manual_changes import OTHER_CABLE
from rig.procedures.attitude.effects.scene import Scene

_BOTH_SIDES = "visit some points twice in one replication, once from each side"
_OTHER_INDEX = (
    "start the scale from another index, turned a quarter turn against the sensor: an error of the head moves"
)
REVERSED = (
    "mount the package reversed, turned half a turn about its own x axis: what the pads add to the x output in sin 2a "
    "changes sign, what the head adds does not"
)
_REMOUNTED = "remount the package turned by a known roll angle: an error of the head stays with the head"
_LEVEL = "put a spirit level on the base of the head, and read its zero against an autocollimator"
_DEGREE = np.radians(1.0)

ONE_DEGREE = Largest(1.0, "1 deg")
"""Heads and gears that are worth a calibration are hundreds of times better: docs/reference/effects.md."""

Error = Callable[[Scene], FloatArray]


def pitch_error(name: str, error: Error, group: str = "") -> Term:
    """The true pitch differs from the readback by `error` (n,) degrees for a coefficient of one."""
    return Term(f"dv/dpitch*{name}", lambda scene, sensor: scene.per_pitch(sensor) * error(scene), group=group)


def roll_error(name: str, error: Error, group: str = "") -> Term:
    """The true roll differs from the readback by `error` (n,) degrees for a coefficient of one."""
    return Term(f"dv/droll*{name}", lambda scene, sensor: scene.per_roll(sensor) * error(scene), group=group)


def waves(of: Callable[..., Term], angle: str, k: float) -> tuple[Term, Term]:
    """Sine and cosine of k periods per turn in "pitch" or "roll", judged together."""
    text = angle if k == 1 else f"{k:g}*{angle}"

    return (
        of(f"sin({text})", lambda scene: scene.turns(angle, k)[0], group=text),
        of(f"cos({text})", lambda scene: scene.turns(angle, k)[1], group=text),
    )


_PLAY = Signed(
    "backlash",
    +1,
    "an axis that goes beyond where it was sent, as one does whose controller corrects backlash by too much",
)


def _late(side: IntArray) -> FloatArray:
    """(n,) error of an angle for a backlash of one: the axis stops before its target."""
    return np.asarray(side / -2.0)


BACKLASH_PITCH = Effect(
    name="backlash-pitch",
    cause="the pitch axis stops short by half the backlash, on the side it arrived from",
    source="pitch axis",
    scope="package",
    stratum="point-by-replication",
    unit="deg",
    size=arcsec,
    against="pitch_deg",
    terms=fixed(pitch_error("(-side/2)", lambda scene: _late(scene.data.pitch_side))),
    signed=_PLAY,
    largest=ONE_DEGREE,
    separate_by=_BOTH_SIDES,
    usual_size="arc seconds, 1e-3 deg",
    known_aliases={
        "offset-drift": Alias("where direction alternates with the replication and there is no roll", _BOTH_SIDES),
        "hysteresis-pitch": Alias(
            "without roll, near zero pitch",
            "read both sides where the output hardly depends on pitch: backlash is gone there, hysteresis is not",
        ),
    },
    needs=("pitch sides",),
)

BACKLASH_ROLL = Effect(
    name="backlash-roll",
    cause="the roll axis stops short by half the backlash, on the side it arrived from",
    source="roll axis",
    scope="package",
    stratum="point-by-replication",
    unit="deg",
    size=arcsec,
    against="roll_deg",
    terms=fixed(roll_error("(-side/2)", lambda scene: _late(scene.data.roll_side))),
    signed=_PLAY,
    largest=ONE_DEGREE,
    separate_by=_BOTH_SIDES,
    usual_size="arc seconds, 1e-3 deg",
    known_aliases={"roll-head-once-per-turn": Alias("where every replication walks the same path", _BOTH_SIDES)},
    needs=("roll sides",),
)

_AT_POINTS = partial(Effect, scope="package", stratum="between-point", unit="deg", largest=ONE_DEGREE)
"""An axis errs by an angle at the points of the design."""

HEAD_ONCE = _AT_POINTS(
    name="head-once-per-turn",
    cause="eccentric scale of the pitch axis, or an overhung load or an off-centre mass that bends it: an error with "
    "one period a turn",
    source="pitch axis",
    size=amplitude,
    against="pitch_deg",
    terms=fixed(*waves(pitch_error, "pitch", 1)),
    separate_by="compare commands that share an attitude, (a, R) and (180 - a, R + 180), or two sensors on the head",
    usual_size="seconds of arc, 5e-4 deg",
    known_aliases={
        "sensor-second-order": Alias(
            "the cosine phase, for an x sensor by itself",
            "mount the package end for end: a sensor's own square keeps its sign in the output, an error of the head "
            "changes it with the slope",
        ),
        "isolation-pad-deflection": Alias(
            "the sine phase without roll; the cosine phase is two equal deflections of the pads",
            f"{REVERSED}; lock the pads",
        ),
    },
)

HEAD_TWICE = _AT_POINTS(
    name="head-twice-per-turn",
    cause="elliptic scale of the pitch axis: an error with two periods a turn",
    source="pitch axis",
    size=amplitude,
    against="pitch_deg",
    terms=fixed(*waves(pitch_error, "pitch", 2)),
    separate_by=_OTHER_INDEX,
    usual_size="seconds of arc, 5e-4 deg",
    known_aliases={"sensor-third-order": Alias("the sine phase, for an x sensor by itself", _OTHER_INDEX)},
)

ROLL_HEAD_ONCE = _AT_POINTS(
    name="roll-head-once-per-turn",
    cause="eccentric scale of the roll axis: an error with one period a turn",
    source="roll axis",
    size=amplitude,
    against="roll_deg",
    terms=fixed(*waves(roll_error, "roll", 1)),
    separate_by=_REMOUNTED,
    usual_size="seconds of arc, 5e-4 deg",
    known_aliases={"cross-axis": Alias("for a y or z sensor near zero pitch", _REMOUNTED)},
    needs=("roll",),
)

ROLL_HEAD_TWICE = _AT_POINTS(
    name="roll-head-twice-per-turn",
    cause="elliptic scale of the roll axis: an error with two periods a turn",
    source="roll axis",
    size=amplitude,
    against="roll_deg",
    terms=fixed(*waves(roll_error, "roll", 2)),
    separate_by=_REMOUNTED,
    usual_size="seconds of arc, 5e-4 deg",
    known_aliases={"sensor-third-order": Alias("for a y or z sensor near zero pitch", _REMOUNTED)},
    needs=("roll",),
)


INDEX_ERROR = _AT_POINTS(
    name="index-error",
    cause="the head's zero of pitch does not agree with gravity: the scale's index or the base is off along pitch",
    source="pitch axis",
    size=arcsec,
    against="pitch_deg",
    terms=fixed(pitch_error("1", lambda scene: np.ones(len(scene.data)))),
    separate_by=_LEVEL,
    usual_size="1e-3 deg",
    needs=("roll",),
)


def _sideways(name: str, arm: Callable[[Scene], FloatArray]) -> Term:
    """Gravity appears to tilt along the pitch axis by `arm` (n,) degrees for a coefficient of one."""

    def column(scene: Scene, sensor: str) -> FloatArray:
        return np.asarray(_DEGREE * arm(scene) * (scene.sideways @ scene.axes[sensor]))

    return Term(name, column)


HEAD_TILT = _AT_POINTS(
    name="head-tilt",
    cause="the pitch axis is not level: the base of the head leans sideways",
    source="pitch axis",
    size=arcsec,
    against="roll_deg",
    terms=fixed(_sideways("m_y*cos(roll) - m_z*sin(roll)", lambda scene: np.ones(len(scene.data)))),
    separate_by="put a spirit level along the pitch axis",
    usual_size="1e-3 deg",
    needs=("roll",),
)

AXES_NOT_SQUARE = _AT_POINTS(
    name="axes-not-square",
    cause="the roll axis is not at right angles to the pitch axis",
    source="roll axis",
    size=arcsec,
    against="pitch_deg",
    terms=fixed(_sideways("(m_z*sin(roll) - m_y*cos(roll))*sin(pitch)", lambda scene: -np.sin(scene.pitch))),
    separate_by="sight the roll axis with an autocollimator while the pitch axis turns",
    usual_size="1e-3 deg",
    needs=("roll",),
)

ROLL_WOBBLE = _AT_POINTS(
    name="roll-wobble",
    cause="the bearing of the roll axis wobbles: pitch errs with one or two periods a turn of roll",
    source="roll axis",
    size=amplitude,
    against="roll_deg",
    terms=fixed(
        *(term for k in (1, 2) for term in waves(pitch_error, "roll", k)),
    ),
    separate_by=_REMOUNTED,
    usual_size="seconds of arc, 3e-4 deg",
    needs=("roll",),
)


def _leans(name: str, course: Error, group: str = "") -> tuple[Term, Term]:
    """The base of the head leans along pitch, and sideways, by `course` (n,) degrees for coefficients of one."""
    return (
        pitch_error(name, course, group=group),
        replace(_sideways(f"sideways*{name}", course), group=f"sideways {group}" if group else ""),
    )


TILT_DRIFT = Effect(
    name="tilt-drift",
    cause="the base of the head tilts steadily with time: the floor or the pier sinks to one side",
    source="time",
    scope="package",
    stratum="point-by-replication",
    unit="deg/h",
    size=each("deg/h"),
    against="elapsed_s",
    terms=fixed(*_leans("time", lambda scene: scene.hours())),
    separate_by="read an electronic level on the base of the head through a night",
    usual_size="1e-4 deg/h",
    needs=("time", "roll"),
)

TILT_DAILY = Effect(
    name="tilt-daily",
    cause="the base of the head tilts with the time of day: the sun or the heating warms one side of the pier",
    source="time",
    scope="package",
    stratum="point-by-replication",
    unit="deg",
    size=arcsec,
    against="elapsed_s",
    terms=fixed(
        *_leans("sin(time/day)", lambda scene: np.sin(np.pi / 12 * scene.hours()), group="day"),
        *_leans("cos(time/day)", lambda scene: np.cos(np.pi / 12 * scene.hours()), group="day"),
    ),
    separate_by="read an electronic level on the base of the head through a day and a night",
    usual_size="1e-3 deg",
    needs=("a night", "roll"),
)

CABLE = Effect(
    name="cable-wind-up",
    cause="the cable to the package winds up as the head rolls: its torque turns the package in proportion to the roll",
    source="roll axis",
    scope="package",
    stratum="between-point",
    unit="deg/turn",
    size=each("deg/turn"),
    against="roll_deg",
    terms=fixed(
        roll_error("roll/turn", lambda scene: scene.data.roll_deg / 360.0),
        pitch_error("roll/turn", lambda scene: scene.data.roll_deg / 360.0),
    ),
    largest=ONE_DEGREE,
    separate_by="free the cable, or lead it another way, and repeat a few points at both ends of the roll",
    usual_size="1e-3 deg/turn",
    needs=("roll",),
    manual_changes=(resized_by(OTHER_CABLE),),
)


def _warm_play(data: AttitudeData) -> tuple[Term, ...]:
    found: list[Term] = []
    if np.ptp(data.pitch_side) > 0:
        name = "(-side/2)*temperature"
        found.append(pitch_error(name, lambda scene: _late(scene.data.pitch_side) * scene.warmth()))
    if data.has_roll and np.ptp(data.roll_side) > 0:
        found.append(roll_error("(-side/2)*temperature", lambda scene: _late(scene.data.roll_side) * scene.warmth()))
    return tuple(found)


BACKLASH_TEMPERATURE = Effect(
    name="backlash-temperature",
    cause="the backlash of an axis changes with the temperature",
    source="pitch axis",
    scope="package",
    stratum="point-by-replication",
    unit="deg/degC",
    size=each("deg/degC"),
    against="sensor_temperature_degC",
    terms=_warm_play,
    largest=Largest(0.1, "0.1 deg/degC"),
    separate_by="visit some points from both sides at another temperature",
    usual_size="1e-5 deg/degC",
    needs=("temperature",),
)
