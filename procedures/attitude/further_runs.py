"""Further runs of an attitude calibration: other angles, another order, another temperature, the package turned."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from rig.procedures.attitude.designs import uniform
from rig.procedures.attitude.model import mounting_matrix
from rig.procedures.attitude.settings import DesignSettings, MountingSettings, PitchRollProcedure
from rig.procedures.plan.further_runs import Limits, Variation, named

LEAST_PITCH, LEAST_ROLL = 9, 5
"""Minimum number of angles of a thinned design: fewer do not show a shape."""


WARMER_DEGC = 3.0


WHOLE_TURN_DEG, LEAST_WHOLE_TURN, MOST_WHOLE_TURN = 180.0, 13, 37


_ROLLS = -135.0, -90.0, -45.0, 0.0, 45.0, 90.0, 135.0, 180.0


_TURNS = (
    ("x", 180.0, "half a turn about its own x axis"),
    ("z", 180.0, "end for end, half a turn about its own z axis"),
    ("y", 90.0, "a quarter turn about its own y axis"),
    ("x", 90.0, "a quarter turn about its own x axis"),
    ("z", 90.0, "a quarter turn about its own z axis"),
)


def further_runs(first: PitchRollProcedure, limits: Limits, *, chamber: bool) -> Iterator[Variation]:
    """Runs after `first`, for `rig.procedures.plan.further_runs.possible`."""
    design, pitches = first.design, _pitches(first.design)
    yield from _sizes("the same again", first, varies="again")
    if first.order.type != "random":
        order = first.order.model_copy(update={"type": "random"})
        shuffled = first.model_copy(update={"order": order})
        yield from _sizes("in random order, from random sides", shuffled, varies="order")
    if _rolls(design) == 1:
        yield from _sizes("at roll 0 and 180 deg", _over(first, pitches, [0.0, 180.0]))
        yield from _sizes("at roll 0, 90 and 180 deg", _over(first, pitches, [0.0, 90.0, 180.0]))
        yield from _sizes("at any roll", _over(first, pitches, _ROLLS))
    rolls = design.build().roll_deg
    if (between := _half_way(pitches)) is not None:
        yield from _sizes("at pitches half-way between those of the design", _over(first, between, rolls))
    if (between := _half_way(rolls)) is not None:
        yield from _sizes("at rolls half-way between those of the design", _over(first, pitches, between))
    if max(map(abs, pitches)) < WHOLE_TURN_DEG:
        count = min(max(len(pitches), LEAST_WHOLE_TURN), MOST_WHOLE_TURN)
        around = uniform(-WHOLE_TURN_DEG, WHOLE_TURN_DEG, count)
        yield from _sizes("over the whole turn in pitch", _over(first, around, design.build().roll_deg))
    if not chamber or first.environment is None:
        warmer = f"on a night {WARMER_DEGC:g} degC warmer"
        yield from _sizes(warmer, first, warmer_degC=WARMER_DEGC, by_weather=True, varies="temperature")
    else:
        low, high = limits.get("enclosure_degC", (-80.0, 200.0))
        for by in (WARMER_DEGC, -WARMER_DEGC):
            setpoint = first.environment.setpoint_degC + by
            if low <= setpoint <= high:
                environment = first.environment.model_copy(update={"setpoint_degC": setpoint})
                at = first.model_copy(update={"environment": environment})
                yield from _sizes(f"with the enclosure at {setpoint:g} degC", at, warmer_degC=by, varies="temperature")
    for axis, turn, words in _TURNS:
        mounting = _turned(first.mounting, axis, turn)
        turned = first.model_copy(update={"mounting": mounting})
        yield from _sizes(f"with the package turned {words}", turned, turned=True)
        if _rolls(design) == 1:
            rolled = _over(turned, pitches, [0.0, 90.0, 180.0])
            yield from _sizes(f"at roll 0, 90 and 180 deg with the package turned {words}", rolled, turned=True)


def _sizes(what: str, whole: PitchRollProcedure, **more: Any) -> Iterator[Variation]:
    """A run with fewer points or replications and with all, the shortest first."""
    designs = {len(d.build()): d for d in _thinned(whole.design)}
    runs = [
        whole.model_copy(update={"design": design, "replications": n, "name": named(whole.name, what)})
        for design in designs.values()
        for n in (1, 2, 4)
    ]
    runs.sort(key=lambda run: run.replications * len(run.design.build()))
    for run in runs:
        yield Variation(what, run, **more)


def _thinned(design: DesignSettings) -> Iterator[DesignSettings]:
    """The design, and every second or fourth of its angles with both ends, if they are on a uniform grid."""
    for every in (1, 2, 4):
        pitch, roll = _pitches(design)[::every], _rolls(design)
        if every > 1 and len(pitch) < LEAST_PITCH:
            return
        thin = (roll - 1) // 2 + 1 if every > 1 and roll % 2 and roll > LEAST_ROLL else roll
        if design.type == "D1" and (len(_pitches(design)) - 1) % every == 0:
            yield design.model_copy(update={"pitch_count": len(pitch), "roll_count": thin, "fraction": None})
        elif design.type in ("D", "D0") and every < len(_pitches(design)):
            yield design.model_copy(update={"pitch_deg": list(pitch), "fraction": None})
        elif every == 1:
            yield design


def _half_way(angle_deg: Sequence[float]) -> tuple[float, ...] | None:
    """Angles half-way between those of a design, to distinguish periods that look alike on it; None for few."""
    at = sorted(set(angle_deg))
    if len(at) < LEAST_ROLL:
        return None
    return tuple((low + high) / 2.0 for low, high in pairwise(at))


def _over(first: PitchRollProcedure, pitch_deg: Sequence[float], roll_deg: Sequence[float]) -> PitchRollProcedure:
    design = DesignSettings(type="D", pitch_deg=list(pitch_deg), roll_deg=list(roll_deg))
    return first.model_copy(update={"design": design})


def _pitches(design: DesignSettings) -> tuple[float, ...]:
    return design.build().pitch_deg


def _rolls(design: DesignSettings) -> int:
    return len(design.build().roll_deg)


def _turned(mounting: MountingSettings, axis: str, turn: float) -> MountingSettings:
    """The mounting after one more rotation about the package's present axis."""
    before = mounting_matrix(mounting.x_deg, mounting.y_deg, mounting.z_deg)
    m = mounting_matrix(*(turn if axis == own else 0.0 for own in "xyz")) @ before
    y = np.arcsin(np.clip(m[2, 0], -1.0, 1.0))
    if abs(m[2, 0]) < 1.0 - 1e-9:
        x, z = np.arctan2(-m[2, 1], m[2, 2]), np.arctan2(-m[1, 0], m[0, 0])
    else:  # x and z rotate about the same axis: the whole rotation is assigned to z
        x, z = 0.0, np.arctan2(m[0, 1], m[1, 1])
    x_deg, y_deg, z_deg = (_half_turn(float(np.degrees(angle))) for angle in (x, y, z))
    return MountingSettings(x_deg=x_deg, y_deg=y_deg, z_deg=z_deg)


def _half_turn(angle: float) -> float:
    """Angle in (-180, 180], without rounding errors."""
    rounded = round(angle, 6) + 0.0
    return 180.0 if rounded <= -180.0 else rounded
