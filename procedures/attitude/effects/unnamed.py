"""Smooth terms without a cause, for the remainder that no effect of the catalogue explains.

Low harmonics of the angles, and of the time: they show the place of a remainder and can absorb it; they do not name a
cause. They are not part of the catalogue, and come after everything in it.
"""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.sizes import micro
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects.effect import Effect, Term
from rig.procedures.attitude.effects.scene import Scene

HARMONICS = 4
"""Maximum number of periods per turn of each angle."""
PERIODS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
"""Maximum number of periods over the run."""


def _wave(k: float, phase: str, of: FloatArray) -> FloatArray:
    return np.asarray(np.sin(k * of) if phase == "sin" else np.cos(k * of))


def where(k: int, m: int, *, roll: bool) -> str:
    """Place of k periods per turn in pitch and m in roll, in words."""
    return f"{k} periods a turn in pitch" + (f" and {m} in roll" if roll else "")


def _product(k: int, m: int, pitch: str, roll: str, group: str) -> Term:
    def column(scene: Scene, _sensor: str) -> FloatArray:
        return _wave(k, pitch, scene.pitch) * _wave(m, roll, scene.rolled)

    return Term(f"{pitch}({k}*pitch)*{roll}({m}*roll)", column, group=group)


def _shapes(data: AttitudeData) -> tuple[Term, ...]:
    found: list[Term] = []
    for k in range(HARMONICS + 1):
        for m in range(HARMONICS + 1 if data.has_roll else 1):
            group = where(k, m, roll=data.has_roll)
            phases = [(p, r) for p in (("sin", "cos") if k else ("cos",)) for r in (("sin", "cos") if m else ("cos",))]
            found += [_product(k, m, pitch, roll, group) for pitch, roll in phases if k or m]
    return tuple(found)


def _courses(data: AttitudeData) -> tuple[Term, ...]:
    start, length = float(data.elapsed_s.min()), float(np.ptp(data.elapsed_s))

    def course(k: float, phase: str) -> Term:
        def column(scene: Scene, _sensor: str) -> FloatArray:
            return _wave(k, phase, 2 * np.pi * (scene.data.elapsed_s - start) / length)

        return Term(f"{phase}({k:g}*2*pi*time/run)", column, group=f"{k:g} periods over the run")

    return tuple(course(k, phase) for k in PERIODS for phase in ("sin", "cos"))


UNNAMED_SHAPE = Effect(
    name="unnamed-shape",
    cause="something that no effect of the catalogue explains is a function of the angles",
    source="sensor",
    scope="sensor",
    stratum="between-point",
    unit="V",
    size=micro("uV"),
    against="pitch_deg",
    terms=_shapes,
    separate_by="visit points between those of the design",
    usual_size="unknown",
)

UNNAMED_COURSE = Effect(
    name="unnamed-course",
    cause="something that no effect of the catalogue explains goes on in time",
    source="time",
    scope="sensor",
    stratum="point-by-replication",
    unit="V",
    size=micro("uV"),
    against="elapsed_s",
    terms=_courses,
    separate_by="read one point through a night",
    usual_size="unknown",
    needs=("time",),
)

UNNAMED: tuple[Effect, ...] = (UNNAMED_SHAPE, UNNAMED_COURSE)
NAMELESS = frozenset(effect.name for effect in UNNAMED)
