"""Effects inside one sensor, each with its own coefficient."""

from __future__ import annotations

from functools import partial

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Alias, Largest
from rig.fitter.effects.sizes import micro, relative
from rig.procedures.attitude.effects.effect import Effect, Term, fixed
from rig.procedures.attitude.effects.package import product_formula
from rig.procedures.attitude.effects.scene import Scene
from rig.procedures.attitude.effects.thermal import OTHER_TEMPERATURE

_ONE_WAY = "if the temperature rose or fell all night"
_END_FOR_END = (
    "mount the package end for end: a sensor's own square keeps its sign in the output, an error of the head changes "
    "it with the slope"
)
_TENTH = Largest(0.1, "10 % of the sensitivity at 1 g", relative=True)

OFFSET_DRIFT = Effect(
    name="offset-drift",
    cause="the offset drifts steadily with time",
    source="time",
    scope="sensor",
    stratum="point-by-replication",
    unit="V/h",
    size=micro("uV/h"),
    against="elapsed_s",
    terms=fixed(Term("time", lambda scene, _sensor: scene.hours())),
    separate_by="go on for some hours at constant temperature",
    usual_size="1e-5 g a day",
    known_aliases={"offset-temperature": Alias(_ONE_WAY, OTHER_TEMPERATURE)},
    needs=("time",),
)

SENSITIVITY_DRIFT = Effect(
    name="sensitivity-drift",
    cause="the sensitivity drifts steadily with time",
    source="time",
    scope="sensor",
    stratum="point-by-replication",
    unit="V/g/h",
    size=relative("ppm/h"),
    against="elapsed_s",
    terms=fixed(Term("time*gravity", lambda scene, sensor: scene.hours() * scene.along(sensor))),
    separate_by="go on for some hours at constant temperature",
    usual_size="1e-5 of the sensitivity a day",
    known_aliases={"sensitivity-temperature": Alias(_ONE_WAY, OTHER_TEMPERATURE)},
    needs=("time",),
)


DAILY_CYCLE = Effect(
    name="daily-cycle",
    cause="the offset follows a daily cycle in the laboratory that was not recorded",
    source="time",
    scope="sensor",
    stratum="point-by-replication",
    unit="V",
    size=micro("uV"),
    against="elapsed_s",
    terms=fixed(
        Term("sin(time/day)", lambda scene, _sensor: np.sin(np.pi / 12 * scene.hours()), group="day"),
        Term("cos(time/day)", lambda scene, _sensor: np.cos(np.pi / 12 * scene.hours()), group="day"),
    ),
    separate_by="go on for a second day",
    usual_size="1e-5 g",
    known_aliases={"offset-temperature": Alias("where the temperature follows the day", OTHER_TEMPERATURE)},
    needs=("a night",),
)

_OF_SENSOR = partial(Effect, source="sensor", scope="sensor", stratum="between-point")
"""A sensor's own error at the points of the design."""

SECOND_ORDER = _OF_SENSOR(
    name="sensor-second-order",
    cause="the accelerometer's output has a term in the square of the acceleration along its axis",
    unit="V/g^2",
    size=relative("ug/g^2"),
    against="pitch_deg",
    terms=fixed(Term("gravity^2", lambda scene, sensor: scene.along(sensor) ** 2)),
    largest=_TENTH,
    separate_by=_END_FOR_END,
    usual_size="2e-5 of the range",
    known_aliases={"head-once-per-turn": Alias("its cosine phase, for an x sensor by itself", _END_FOR_END)},
)

THIRD_ORDER = _OF_SENSOR(
    name="sensor-third-order",
    cause="the accelerometer's output has a term in the cube of the acceleration along its axis",
    unit="V/g^3",
    size=relative("ug/g^3"),
    against="pitch_deg",
    terms=fixed(Term("gravity^3", lambda scene, sensor: scene.along(sensor) ** 3)),
    largest=_TENTH,
    separate_by="go beyond +-60 deg of pitch, or compare two sensors of different axes on the same head",
    usual_size="2e-5 of the range",
    known_aliases={
        "head-twice-per-turn": Alias(
            "its sine phase, for an x sensor by itself",
            "start the head's scale from another index: an error of the head moves with it",
        ),
        "isolation-pad-deflection": Alias("without roll, within +-30 deg of pitch", "go beyond +-60 deg of pitch"),
    },
)


def _cross(first: int, second: int) -> Term:
    """Product of gravity's components `first` and `second` axes after the sensor's own, cyclically."""

    def pair(scene: Scene, sensor: str) -> tuple[int, int]:
        own = scene.nominal[sensor]
        return (own + first) % 3, (own + second) % 3

    def column(scene: Scene, sensor: str) -> FloatArray:
        i, j = pair(scene, sensor)
        return scene.g[:, i] * scene.g[:, j]

    def shown(scene: Scene, sensor: str) -> tuple[str, float]:
        return product_formula(*pair(scene, sensor), roll=scene.roll)

    return Term(f"axis+{first} * axis+{second}", column, shown)


CROSS_AXIS = _OF_SENSOR(
    name="cross-axis",
    cause="the accelerometer's output has a term in the product of accelerations along and across its axis",
    unit="V/g^2",
    size=relative("ug/g^2"),
    against="roll_deg",
    terms=fixed(_cross(0, 1), _cross(0, 2), _cross(1, 2), _cross(1, 1)),
    largest=_TENTH,
    separate_by="read a second sensor of the package: a package that turns moves all of them, a cross-axis term one",
    usual_size="2e-5 of the range",
    known_aliases={
        "isolation-pad-deflection": Alias(
            "for a sensor by itself",
            "lock the pads and repeat a few points: pad deflection disappears, cross-axis response remains",
        )
    },
    needs=("roll",),
)


def _null(at: float) -> Term:
    """The output lags behind by the coefficient, on either side of a point of its axis."""

    def column(scene: Scene, sensor: str) -> FloatArray:
        return np.sign(scene.along(sensor) - at)

    return Term(f"sign(gravity - {at:g} g)" if at else "sign(gravity)", column)


DEAD_ZONE = _OF_SENSOR(
    name="dead-zone",
    cause="the sensor sticks: about its null it does not answer, and lags by half of that zone elsewhere",
    unit="V",
    size=micro("uV"),
    against="pitch_deg",
    terms=fixed(*(_null(at) for at in (0.0, -0.1, 0.1, -0.03, 0.03))),
    separate_by="tilt the sensor in small steps through its null, up and down",
    usual_size="1e-6 g",
    searched=True,
)

ASYMMETRY = _OF_SENSOR(
    name="sensor-asymmetry",
    cause="the sensitivity is not the same for both signs of the acceleration",
    unit="V/g",
    size=relative("ppm"),
    against="pitch_deg",
    terms=fixed(Term("|gravity|", lambda scene, sensor: np.abs(scene.along(sensor)))),
    largest=_TENTH,
    separate_by="compare the slopes at small positive and small negative acceleration",
    usual_size="1e-5 of the sensitivity",
)


def _beyond(share: float) -> Term:
    """The part beyond a share of 1 g, on either side."""

    def column(scene: Scene, sensor: str) -> FloatArray:
        along = scene.along(sensor)
        return np.asarray(np.sign(along) * np.maximum(np.abs(along) - share, 0.0))

    return Term(f"gravity beyond {share:g} g", column)


SATURATION = _OF_SENSOR(
    name="saturation",
    cause="the sensitivity is smaller near the end of the range: the sensor or its amplifier saturates",
    unit="V/g",
    size=relative("ppm"),
    against="pitch_deg",
    terms=fixed(*(_beyond(share) for share in (0.5, 0.7, 0.8, 0.9, 0.95))),
    largest=_TENTH,
    separate_by="look at more points between 0.8 g and 1 g, on both sides",
    usual_size="1e-5 of the sensitivity",
    searched=True,
)


def _field(axis: int, lab: str) -> Term:
    """A field that is level in the laboratory, seen along one axis of the package."""

    def column(scene: Scene, _sensor: str) -> FloatArray:
        level = scene.sideways if lab == "along the pitch axis" else scene.g_ahead
        return level[:, axis]

    return Term(f"level field {lab}, axis {'xyz'[axis]}", column, group=lab)


MAGNETIC = _OF_SENSOR(
    name="magnetic-heading",
    cause="the sensor answers to a field that is level in the laboratory: the Earth's magnetic field",
    unit="V",
    size=micro("uV"),
    against="roll_deg",
    terms=fixed(*(_field(axis, lab) for lab in ("along the pitch axis", "across the pitch axis") for axis in range(3))),
    separate_by="turn the head to another heading, or bring a magnet near",
    usual_size="1e-6 g",
    needs=("roll",),
)
