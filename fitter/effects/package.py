"""Effects that turn the package, so that all its sensors see them together.

A small rotation w of the package, in package axes, changes gravity there by -w x g and a sensor's output by
-m . (w x g); an error of a head angle changes it by dv/d(angle) times the error. One coefficient, in degrees, holds
for all sensors at once.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fitter.arrays import FloatArray
from fitter.effects.effect import Alias, Effect, Scene, Term, fixed
from fitter.effects.sizes import amplitude, arcsec, each

_DEGREE = np.radians(1.0)

_BOTH_SIDES = "visit some points twice in one replication, once from each side"
_OTHER_INDEX = (
    "start the scale from another index, turned a quarter turn against the sensor: an error of the head moves"
)
_REVERSED = (
    "mount the package reversed, turned half a turn about its own x axis: what a sag adds to the x output in sin 2a "
    "changes sign, what the head adds does not"
)
_REMOUNTED = "remount the package turned by a known roll angle: an error of the head stays with the head"

_PRODUCTS = {
    (0, 0): ("sin(pitch)^2", 1.0),
    (1, 1): ("cos(pitch)^2*sin(roll)^2", 1.0),
    (2, 2): ("cos(pitch)^2*cos(roll)^2", 1.0),
    (0, 1): ("sin(2*pitch)*sin(roll)", -0.5),
    (0, 2): ("sin(2*pitch)*cos(roll)", -0.5),
    (1, 2): ("cos(pitch)^2*sin(2*roll)", 0.5),
}
_PRODUCTS_NO_ROLL = {(0, 0): ("sin(pitch)^2", 1.0), (2, 2): ("cos(pitch)^2", 1.0), (0, 2): ("sin(2*pitch)", -0.5)}


def product_formula(i: int, j: int, *, roll: bool) -> tuple[str, float]:
    """g_i g_j of gravity's components in package axes as a formula in pitch and roll, and its factor."""
    table = _PRODUCTS if roll else _PRODUCTS_NO_ROLL
    return table.get((min(i, j), max(i, j)), ("0", 0.0))


def _sag(about: int, along: int) -> Term:
    """The package turns about one of its axes in proportion to its weight along another (or the same)."""
    axis = np.eye(3)[about]

    def column(scene: Scene, sensor: str) -> FloatArray:
        turned = np.cross(axis, scene.g) @ scene.axes[sensor]
        return np.asarray(-_DEGREE * turned * scene.g[:, along])

    def shown(scene: Scene, sensor: str) -> tuple[str, float]:
        m = np.where(np.arange(3) == about, 0.0, scene.axes[sensor])
        main = int(np.argmax(np.abs(m)))
        other = 3 - main - about
        text, factor = product_formula(other, along, roll=scene.roll)
        return text, float(-_DEGREE * m[main] * np.cross(axis, np.eye(3)[other])[main] * factor)

    return Term(f"about {'xyz'[about]} by weight along {'xyz'[along]}", column, shown)


def _pitch_error(name: str, error: Callable[[Scene], FloatArray]) -> Term:
    """The head stands at another pitch than it says, by `error` (n,) degrees for a coefficient of one."""
    return Term(
        f"dv/dpitch*{name}",
        lambda scene, sensor: np.asarray(_DEGREE * (scene.g_per_pitch @ scene.axes[sensor]) * error(scene)),
    )


def _roll_error(name: str, error: Callable[[Scene], FloatArray]) -> Term:
    """The head stands at another roll than it says, by `error` (n,) degrees for a coefficient of one."""
    return Term(
        f"dv/droll*{name}",
        lambda scene, sensor: np.asarray(_DEGREE * (scene.g_per_roll @ scene.axes[sensor]) * error(scene)),
    )


ISOLATION_PADS = Effect(
    name="isolation-pad-deflection",
    cause="the isolation pads give way under the weight of the package, which turns by compliance times the "
    "component of its weight along one of its own axes",
    source="package",
    scope="package",
    stratum="between-point",
    unit="V",
    size=each("deg/g"),
    against="pitch_deg",
    # about y first: the sag in the pitch plane that the paper shows, sin 2a cos R on an x sensor
    terms=fixed(*(_sag(about, along) for about in (1, 2, 0) for along in range(3))),
    separate_by="lock the pads and repeat a few points: the sag goes",
    usual_size="4e-4 deg",
    known_aliases={
        "cross-axis": Alias(
            "always, if each sensor has the products of gravity's components that a sag would give it",
            "lock the pads and repeat a few points: a sag goes, a sensor's own product stays",
        ),
        "head-once-per-turn": Alias(
            "without roll, exactly (sin 2a); with roll its cosine phase is two equal sags",
            _REVERSED,
        ),
        "sensor-third-order": Alias("without roll, within +-30 deg of pitch", "go beyond +-60 deg of pitch"),
    },
)

BACKLASH_PITCH = Effect(
    name="backlash-pitch",
    cause="the pitch axis stops short by half the backlash, on the side it arrived from",
    source="pitch axis",
    scope="package",
    stratum="point-by-replication",
    unit="deg",
    size=arcsec,
    against="pitch_deg",
    terms=fixed(_pitch_error("side/2", lambda scene: scene.data.pitch_side.astype(np.float64) / 2)),
    separate_by=_BOTH_SIDES,
    usual_size="arc seconds, 1e-3 deg",
    known_aliases={
        "offset-drift": Alias("where direction alternates with the replication and there is no roll", _BOTH_SIDES)
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
    terms=fixed(_roll_error("side/2", lambda scene: scene.data.roll_side.astype(np.float64) / 2)),
    separate_by=_BOTH_SIDES,
    usual_size="arc seconds, 1e-3 deg",
    known_aliases={"roll-head-once-per-turn": Alias("where every replication walks the same path", _BOTH_SIDES)},
    needs=("roll sides",),
)

HEAD_ONCE = Effect(
    name="head-once-per-turn",
    cause="eccentric scale of the pitch axis, or an overhung load that bends it: an error with one period a turn",
    source="pitch axis",
    scope="package",
    stratum="between-point",
    unit="deg",
    size=amplitude,
    against="pitch_deg",
    terms=fixed(
        _pitch_error("sin(pitch)", lambda scene: np.sin(scene.pitch)),
        _pitch_error("cos(pitch)", lambda scene: np.cos(scene.pitch)),
    ),
    separate_by="compare commands that share an attitude, (a, R) and (180 - a, R + 180), or two sensors on the head",
    usual_size="seconds of arc, 5e-4 deg",
    known_aliases={
        "sensor-second-order": Alias(
            "the cosine phase, for an x sensor by itself",
            "mount the package end for end: a sensor's own square keeps its sign in the output, an error of the head "
            "changes it with the slope",
        ),
        "isolation-pad-deflection": Alias(
            "the sine phase without roll; the cosine phase is two equal sags",
            f"{_REVERSED}; lock the pads",
        ),
    },
)

HEAD_TWICE = Effect(
    name="head-twice-per-turn",
    cause="elliptic scale of the pitch axis: an error with two periods a turn",
    source="pitch axis",
    scope="package",
    stratum="between-point",
    unit="deg",
    size=amplitude,
    against="pitch_deg",
    terms=fixed(
        _pitch_error("sin(2*pitch)", lambda scene: np.sin(2 * scene.pitch)),
        _pitch_error("cos(2*pitch)", lambda scene: np.cos(2 * scene.pitch)),
    ),
    separate_by=_OTHER_INDEX,
    usual_size="seconds of arc, 5e-4 deg",
    known_aliases={"sensor-third-order": Alias("the sine phase, for an x sensor by itself", _OTHER_INDEX)},
)

ROLL_HEAD_ONCE = Effect(
    name="roll-head-once-per-turn",
    cause="eccentric scale of the roll axis: an error with one period a turn",
    source="roll axis",
    scope="package",
    stratum="between-point",
    unit="deg",
    size=amplitude,
    against="roll_deg",
    terms=fixed(
        _roll_error("sin(roll)", lambda scene: np.sin(scene.rolled)),
        _roll_error("cos(roll)", lambda scene: np.cos(scene.rolled)),
    ),
    separate_by=_REMOUNTED,
    usual_size="seconds of arc, 5e-4 deg",
    known_aliases={"cross-axis": Alias("for a y or z sensor near zero pitch", _REMOUNTED)},
    needs=("roll",),
)

ROLL_HEAD_TWICE = Effect(
    name="roll-head-twice-per-turn",
    cause="elliptic scale of the roll axis: an error with two periods a turn",
    source="roll axis",
    scope="package",
    stratum="between-point",
    unit="deg",
    size=amplitude,
    against="roll_deg",
    terms=fixed(
        _roll_error("sin(2*roll)", lambda scene: np.sin(2 * scene.rolled)),
        _roll_error("cos(2*roll)", lambda scene: np.cos(2 * scene.rolled)),
    ),
    separate_by=_REMOUNTED,
    usual_size="seconds of arc, 5e-4 deg",
    known_aliases={"sensor-third-order": Alias("for a y or z sensor near zero pitch", _REMOUNTED)},
    needs=("roll",),
)
