"""Effects inside one sensor, each with its own coefficient."""

from __future__ import annotations

import numpy as np

from fitter.arrays import FloatArray
from fitter.effects.entry import Alias, Largest
from fitter.effects.sizes import micro, relative
from procedures.attitude.effects.effect import Effect, Term, fixed
from procedures.attitude.effects.package import product_formula
from procedures.attitude.effects.scene import Scene
from procedures.attitude.effects.thermal import OTHER_TEMPERATURE

_ONE_WAY = "where the temperature went one way all night"
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
    cause="the offset follows something of the laboratory that comes back every day, and was not recorded",
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

SECOND_ORDER = Effect(
    name="sensor-second-order",
    cause="the accelerometer's output has a term in the square of the acceleration along its axis",
    source="sensor",
    scope="sensor",
    stratum="between-point",
    unit="V/g^2",
    size=relative("ug/g^2"),
    against="pitch_deg",
    terms=fixed(Term("gravity^2", lambda scene, sensor: scene.along(sensor) ** 2)),
    largest=_TENTH,
    separate_by=_END_FOR_END,
    usual_size="2e-5 of the range",
    known_aliases={"head-once-per-turn": Alias("its cosine phase, for an x sensor by itself", _END_FOR_END)},
)

THIRD_ORDER = Effect(
    name="sensor-third-order",
    cause="the accelerometer's output has a term in the cube of the acceleration along its axis",
    source="sensor",
    scope="sensor",
    stratum="between-point",
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


CROSS_AXIS = Effect(
    name="cross-axis",
    cause="the accelerometer's output has a term in the product of accelerations along and across its axis",
    source="sensor",
    scope="sensor",
    stratum="between-point",
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
            "lock the pads and repeat a few points: a deflection of the pads disappears, a sensor's own product stays",
        )
    },
    needs=("roll",),
)
