"""Effects that turn the package in its mounting, so that they act on all its sensors together.

A small rotation w of the package, in package axes, changes gravity there by -w x g and a sensor's output by -m . (w x
g). One coefficient, in degrees, holds for all sensors at once.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Alias, Largest, Signed
from rig.fitter.effects.manual_changes import removed_by
from rig.fitter.effects.sizes import arcsec, each
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects.effect import Effect, Term, fixed
from rig.procedures.attitude.effects.head import REVERSED
from rig.procedures.attitude.effects.manual_changes import PADS_LOCKED
from rig.procedures.attitude.effects.moments import Moment, evenly, near, starts
from rig.procedures.attitude.effects.scene import Scene

_DEGREE = np.radians(1.0)

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
        turned = scene.crossed(about) @ scene.axes[sensor]
        return np.asarray(-_DEGREE * turned * scene.g[:, along])

    def shown(scene: Scene, sensor: str) -> tuple[str, float]:
        m = np.where(np.arange(3) == about, 0.0, scene.axes[sensor])
        main = ties.highest(np.abs(m))
        other = 3 - main - about
        text, factor = product_formula(other, along, roll=scene.roll)
        return text, float(-_DEGREE * m[main] * np.cross(axis, np.eye(3)[other])[main] * factor)

    return Term(f"about {'xyz'[about]} by weight along {'xyz'[along]}", column, shown)


ISOLATION_PADS = Effect(
    name="isolation-pad-deflection",
    cause="the isolation pads give way under the weight of the package, or the roll axis under an off-centre mass: the "
    "package turns by compliance times the component of its weight along one of its own axes",
    source="package",
    scope="package",
    stratum="between-point",
    unit="V",
    size=each("deg/g"),
    against="pitch_deg",
    # about y first: the sag in the pitch plane in the paper, sin 2a cos R in an x sensor
    terms=fixed(*(_sag(about, along) for about in (1, 2, 0) for along in range(3))),
    # a centre of mass above the pads increases the tilt; a lateral one has either sign
    signed=Signed(
        "compliance",
        {"about y by weight along x": +1, "about x by weight along y": -1},
        "a package that hangs below its pads or is mounted otherwise than declared, or a mass below the roll axis",
    ),
    largest=Largest(1.0, "1 deg/g"),
    separate_by="lock the pads and repeat a few points: the deflection disappears",
    usual_size="4e-4 deg",
    known_aliases={
        "cross-axis": Alias(
            "always, if each sensor has the products of gravity's components that the pads would give it",
            "lock the pads and repeat a few points: pad deflection disappears, cross-axis response remains",
        ),
        "head-once-per-turn": Alias(
            "without roll, exactly (sin 2a); with roll its cosine phase is two equal deflections of the pads",
            REVERSED,
        ),
        "sensor-third-order": Alias("without roll, within +-30 deg of pitch", "go beyond +-60 deg of pitch"),
    },
    manual_changes=(removed_by(PADS_LOCKED),),
)


def _turns(data: AttitudeData) -> tuple[Term, ...]:
    return tuple(_turn(axis, since) for since in starts(data) for axis in range(3))


SLIPS = 24
"""Moments at which a slip within a replication is tried over a run, before it is placed between two observations."""


def _slips(data: AttitudeData) -> tuple[Term, ...]:
    return tuple(term for since in evenly(data, SLIPS) for term in _slip(since))


def _slip(since: Moment) -> tuple[Term, ...]:
    def finer(data: AttitudeData) -> tuple[tuple[Term, ...], ...]:
        return tuple(_slip(moment) for moment in near(data, since, SLIPS))

    return tuple(replace(_turn(axis, since), finer=finer) for axis in range(3))


def _turn(axis: int, since: Moment) -> Term:
    """The package is turned about one of its axes from some time on; all three axes are judged together."""

    def column(scene: Scene, sensor: str) -> FloatArray:
        return np.asarray(-_DEGREE * scene.turned_about(sensor)[axis] * since.passed(scene))

    return Term(f"about {'xyz'[axis]} {since.name}", column, group=since.name, part=axis)


MOUNTING_SLIP = Effect(
    name="mounting-slip",
    cause="the package slipped in its mounting between two replications or at an interruption, and stays turned",
    source="package",
    scope="package",
    stratum="replication",
    unit="deg",
    size=arcsec,
    against="elapsed_s",
    terms=_turns,
    separate_by="read an autocollimator on the package before and after the run",
    usual_size="1e-3 deg",
    needs=("starts",),
    searched=True,
)

MOUNTING_SLIP_UNRECORDED = Effect(
    name="mounting-slip-unrecorded",
    cause="the package slipped in its mounting at an unrecorded moment, and stays turned",
    source="package",
    scope="package",
    stratum="point-by-replication",
    unit="deg",
    size=arcsec,
    against="elapsed_s",
    terms=_slips,
    largest=Largest(1.0, "1 deg"),
    separate_by="find out what happened in the laboratory then; read an autocollimator on the package through the run",
    usual_size="1e-3 deg",
    needs=("time",),
    searched=True,
)


def _scaled(axis: int) -> Term:
    """All outputs change in proportion to the weight along one axis of the package."""

    def column(scene: Scene, sensor: str) -> FloatArray:
        return np.asarray(scene.g[:, axis] * (scene.g @ scene.axes[sensor]))

    def shown(scene: Scene, sensor: str) -> tuple[str, float]:
        m = scene.axes[sensor]
        main = ties.highest(np.abs(m))
        text, factor = product_formula(main, axis, roll=scene.roll)
        return text, float(m[main] * factor)

    return Term(f"output * weight along {'xyz'[axis]}", column, shown)


SCALE_ATTITUDE = Effect(
    name="scale-attitude",
    cause="the sensitivity of all sensors changes alike with the attitude of the package: a common supply or reference "
    "whose cooling depends on it, or gravity that is not what was declared",
    source="package",
    scope="package",
    stratum="between-point",
    unit="V",
    size=each("per g"),
    against="pitch_deg",
    terms=fixed(*(_scaled(axis) for axis in range(3))),
    largest=Largest(0.1, "10 % per g"),
    separate_by="read the common supply or reference at several attitudes",
    usual_size="1e-5 per g",
    known_aliases={
        "isolation-pad-deflection": Alias(
            "with several of their compliances",
            "lock the pads and repeat a few points: a deflection of the pads disappears, a change of the scale stays",
        ),
        "sensor-second-order": Alias("for a sensor by itself", "read the common supply at several attitudes"),
        "cross-axis": Alias("for a sensor by itself", "read the common supply at several attitudes"),
    },
    needs=("several sensors",),
    manual_changes=(),
)
