"""A change at some time: recorded interruptions are given, other times are searched."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Alias
from rig.fitter.effects.sizes import arcsec, micro, relative
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects.effect import Effect, Term
from rig.procedures.attitude.effects.head import pitch_error
from rig.procedures.attitude.effects.moments import Moment, at_boundary, blocks, boundaries, evenly, near, starts
from rig.procedures.attitude.effects.scene import Scene

_EARLIER = "repeat a few points of the earlier block"


def _step(since: Moment) -> Term:
    return Term(since.name, lambda scene, _sensor: since.passed(scene))


def _gain(since: Moment) -> Term:
    def column(scene: Scene, sensor: str) -> FloatArray:
        return since.passed(scene) * scene.along(sensor)

    return Term(f"gravity {since.name}", column)


def _sought(since: Moment) -> Term:
    def finer(data: AttitudeData) -> tuple[tuple[Term, ...], ...]:
        tried = near(data, since)
        starting = (at_boundary(data, moment) for moment in tried)
        return (
            *((_sought(moment),) for moment in tried),
            *((replace(_step(start), likelier=True),) for start in starting if start is not None),
        )

    return Term(since.name, lambda scene, _sensor: since.passed(scene), finer=finer)


_CHANGE = partial(Effect, source="interruption", scope="sensor", stratum="point-by-replication", against="elapsed_s")
"""A sensor changes at one moment."""

OFFSET_STEP = _CHANGE(
    name="offset-step",
    cause="the offset changed at an interruption of the run or when an instrument was replaced",
    unit="V",
    size=micro("uV"),
    terms=lambda data: tuple(map(_step, blocks(data))),
    separate_by=_EARLIER,
    usual_size="whatever the interruption did",
    known_aliases={
        "offset-drift": Alias("where there are few points on one side", "repeat points of the earlier block")
    },
    needs=("blocks",),
)

SENSITIVITY_STEP = _CHANGE(
    name="sensitivity-step",
    cause="the sensitivity changed at an interruption of the run or when an instrument was replaced",
    unit="V/g",
    size=relative("ppm"),
    terms=lambda data: tuple(map(_gain, blocks(data))),
    separate_by=_EARLIER,
    usual_size="whatever the interruption did",
    needs=("blocks",),
)

OFFSET_STEP_UNRECORDED = _CHANGE(
    name="offset-step-unrecorded",
    cause="the offset changed at an unrecorded moment",
    unit="V",
    size=micro("uV"),
    terms=lambda data: (*map(_step, boundaries(data)), *map(_sought, evenly(data))),
    separate_by="find out what happened in the laboratory at that time, and repeat a few earlier points",
    usual_size="whatever happened",
    needs=("time",),
    searched=True,
)

SENSITIVITY_STEP_UNRECORDED = _CHANGE(
    name="sensitivity-step-unrecorded",
    cause="the sensitivity changed between two replications, and nothing is recorded of it",
    unit="V/g",
    size=relative("ppm"),
    terms=lambda data: tuple(map(_gain, boundaries(data))),
    separate_by="find out what happened in the laboratory at that time, and repeat a few earlier points",
    usual_size="whatever happened",
    needs=("replications",),
    searched=True,
)

INDEX_SHIFT = Effect(
    name="index-shift",
    cause="the head's zero of pitch is elsewhere since it was homed again, at an interruption or between replications",
    source="pitch axis",
    scope="package",
    stratum="point-by-replication",
    unit="deg",
    size=arcsec,
    against="elapsed_s",
    terms=lambda data: tuple(pitch_error(since.name, since.passed) for since in starts(data)),
    separate_by="home the head several times and read the outputs at one point after each",
    usual_size="arc seconds, 5e-4 deg",
    needs=("starts",),
    searched=True,
)
