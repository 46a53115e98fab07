"""Places for a shape without a name in a whole-plot run: blocks of smooth columns over recorded quantities."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.engine.beside import Level
from rig.fitter.trace.flexible import Block, halves, orders_of, waves
from rig.fitter.trace.latches import latches
from rig.procedures.pressure.effects.scene import PressureScene

PRESSURE, TEMPERATURE, TIME = 10, 5, 8
"""Maximum number of waves over each."""
REMEMBERED_H = (0.03, 0.3)
"""Time constants of elements that lag behind the pressure: the remainder of the last step, and of several."""
WITHIN = (2, 4, 8, 12)
BETWEEN = (1, 2, 4)
"""Tried orders of blocks."""


@dataclass(frozen=True, eq=False)
class Place:
    """A block at a level.

    Attributes:
        block: its columns are (n, m).
        level: level of its judgement.
        line: whether it may be an error of the pressure too, with one set of coefficients, in psi, for all transducers.
        slopes: whether it is a shape of sensitivities, which may be new in each whole plot.

    """

    block: Block
    level: Level
    line: bool = False
    slopes: bool = False


def places_of(scene: PressureScene) -> tuple[Place, ...]:
    """All places of a run."""
    return (*_within(scene), *_between(scene))


def _within(scene: PressureScene) -> Iterator[Place]:
    data, ones = scene.data, np.ones((len(scene.data), 1))
    p = scene.p / max(float(np.max(np.abs(scene.p))), np.finfo(float).tiny)
    low = waves(np.sqrt(np.maximum(p, 0.0)), PRESSURE)
    sensor, sse = (waves(v, TEMPERATURE) for v in (data.sensor_temperature_degC, data.sse_temperature_degC))
    slope = p[:, None]
    yield _place("over the pressure", "subplot", (low, halves(low)), line=True)
    yield _place("over the pressure, times the transducer's temperature", "subplot", _products(low, sensor), line=True)
    yield _place("over the pressure, times the electronics' temperature", "subplot", _products(low, sse), line=True)
    for text, of in (("the transducer's temperature", sensor), ("the electronics' temperature", sse)):
        yield _place(f"with the sensitivity, over {text}", "subplot", (slope * of, halves(of)), slopes=True)
    side = data.pressure_side.astype(np.float64)[:, None]
    by = np.column_stack([ones, low[:, :4], sensor[:, :2], sse[:, :1], p[:, None] * sensor[:, :1]])
    rough = np.array(
        [1.0, *range(1, low[:, :4].shape[1] + 1), *(1.0 for _ in range(by.shape[1] - 1 - low[:, :4].shape[1]))]
    )
    yield _place("over the side from which a pressure was reached", "subplot", (side * by, rough))
    change = scene.change_psia
    moved = np.column_stack([change, *(scene.behind(tau) for tau in REMEMBERED_H), waves(change, 4), np.abs(change)])
    yield _place("after the pressures before", "subplot", (moved, np.ones(moved.shape[1])), line=True)
    state = latches(scene.p, np.argsort(data.order, kind="stable"))
    if np.any(state):
        yield _place("after the last extreme of the pressure", "subplot", (state, np.ones(state.shape[1])), line=True)
    since = waves(scene.since_h, TIME)
    yield _place("along each whole plot", "subplot", (since, halves(since)), line=True)
    yield _place("along each whole plot, times the pressure", "subplot", (slope * since, halves(since)), line=True)
    for text, of in (
        ("the transducer's temperature", data.sensor_temperature_degC),
        ("the electronics' temperature", data.sse_temperature_degC),
    ):
        step, few = scene.step(of)[:, None] / max(float(np.ptp(of)), np.finfo(float).tiny), since[:, :4]
        both = np.column_stack([step * few, step * slope, step * slope * few])
        rough = np.concatenate([halves(few), [1.0], halves(few)])
        yield _place(f"along each whole plot, times the step of {text} before it", "subplot", (both, rough))
    ended = _centred(scene.ended_psia)[:, None] * since[:, :4]
    text = "along each whole plot, times the pressure at which the one before ended"
    yield _place(text, "subplot", (ended, halves(ended)))
    time = waves(scene.hours, TIME)
    yield _place("with the sensitivity, along the run", "subplot", (slope * time, halves(time)), line=True, slopes=True)


def _between(scene: PressureScene) -> Iterator[Place]:
    data = scene.data
    sensor, sse = (waves(v, TEMPERATURE) for v in map(_coarse, (scene.sensor, scene.sse)))
    yield _place("over the transducer's temperature", "whole-plot", (sensor, halves(sensor)))
    yield _place("over the electronics' temperature", "whole-plot", (sse, halves(sse)))
    yield _place("over both temperatures", "whole-plot", _products(sensor[:, :3], sse[:, :3]))
    time = waves(scene.hours, TIME)
    yield _place("along the run", "whole-plot", (time, halves(time)), line=True)
    for text, of in (
        ("the transducer's temperatures", data.sensor_temperature_degC),
        ("the electronics' temperatures", data.sse_temperature_degC),
    ):
        step = scene.step(of)
        before = np.column_stack(
            [step, *(scene.displaced(of, side, tau) for tau in (4.0, 24.0) for side in (-1.0, 1.0))]
        )
        yield _place(f"after {text} before", "whole-plot", (before, np.ones(before.shape[1])))


def _place(
    text: str, level: Level, made: tuple[FloatArray, FloatArray], *, line: bool = False, slopes: bool = False
) -> Place:
    columns, rough = made
    orders = orders_of(columns, WITHIN if level == "subplot" else BETWEEN)
    return Place(Block(text, columns, orders, rough), level, line, slopes)


def _coarse(values: FloatArray) -> FloatArray:
    """(n,) rounded to a degree: the scatter of readbacks does not make another temperature."""
    return np.asarray(np.round(values))


def _centred(values: FloatArray) -> FloatArray:
    """(n,) between -1 and 1; zero where it is constant."""
    half = 0.5 * float(np.ptp(values))
    return np.asarray((values - values.min() - half) / half if half > 0 else np.zeros_like(values))


def _products(one: FloatArray, other: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, p q) products of columns, the smoothest first, and their roughness."""
    pairs = sorted((i + j + 1, i, j) for i in range(min(one.shape[1], 6)) for j in range(min(other.shape[1], 2)))
    if not pairs:
        return np.empty((one.shape[0], 0)), np.empty(0)
    return np.column_stack([one[:, i] * other[:, j] for _, i, j in pairs]), np.array([float(r) for r, _, _ in pairs])
