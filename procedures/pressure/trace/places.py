"""Places for a shape without a name in a whole-plot run: blocks of smooth columns over recorded quantities."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.constant import ENDS
from rig.fitter.trace.flexible import halves, waves
from rig.fitter.trace.latches import latches
from rig.fitter.trace.limits import limit
from rig.fitter.trace.places import Place, centred, finer, products, smooth
from rig.fitter.trace.shape import Axis
from rig.procedures.pressure.effects.scene import PressureScene

PRESSURE, TEMPERATURE, TIME = 10, 5, 8
"""Maximum number of waves over each."""
FEW, FEWER = 6, 2
"""Waves of the pressure and of a temperature in their products."""
REMEMBERED_H = (0.03, 0.3)
"""Time constants of elements that lag behind the pressure: the remainder of the last step, and of several."""
WITHIN = (2, 4, 8, 12)
BETWEEN = (1, 2, 4)
"""Tried orders of blocks."""
FINE = int(limit("waves of a curve", "whole-plot"))
"""Waves of a curve that is drawn over the pressure."""


OF_PLOTS = ("with the transducer's temperature", "with the electronics' temperature", "along the run")
"""Variables of whole plots: a coefficient that changes with them looks like a sensitivity that each plot draws anew."""


def places_of(scene: PressureScene) -> tuple[Place, ...]:
    """All places of a run."""
    return (*_within(scene), *_between(scene))


def _temperatures(scene: PressureScene) -> tuple[tuple[str, Axis, Axis], ...]:
    """Words of each temperature, what is drawn over it, and over its step before the whole plot."""
    data = scene.data
    sensor, sse = data.sensor_temperature_degC, data.sse_temperature_degC
    return (
        (
            "the transducer's temperature",
            Axis("sensor_temperature_degC", "transducer's temperature", "degC", sensor, settable=True),
            Axis("sensor_step_degC", "step of the transducer's temperature", "degC", scene.step(sensor), True),
        ),
        (
            "the electronics' temperature",
            Axis("sse_temperature_degC", "electronics' temperature", "degC", sse, settable=True),
            Axis("sse_step_degC", "step of the electronics' temperature", "degC", scene.step(sse), True),
        ),
    )


def _within(scene: PressureScene) -> Iterator[Place]:
    data, ones = scene.data, np.ones((len(scene.data), 1))
    over, each = _place(scene, "subplot"), _temperatures(scene)
    pressure = Axis("pressure_psia", "pressure", "psia", data.pressure_psia, settable=True)
    since_axis = Axis("since_s", "time in the whole plot", "h", scene.since_h)
    p = scene.p / max(float(np.max(np.abs(scene.p))), np.finfo(float).tiny)
    low = waves(np.sqrt(np.maximum(p, 0.0)), PRESSURE)
    sensor, sse = (waves(axis.values, TEMPERATURE) for _, axis, _ in each)
    slope = p[:, None]
    yield over("over the pressure", low, pressure, finer=finer(np.sqrt(np.maximum(scene.p, 0.0)), FINE))
    each_value = _levels(data.pressure_levels[1])
    yield over("over the pressure, each value by itself", each_value, pressure, rough=np.ones(each_value.shape[1]))
    for (text, axis, _), of in zip(each, (sensor, sse), strict=True):
        both, rough = products(low[:, :FEW], of[:, :FEWER])
        yield over(f"over the pressure, times {text}", both, pressure, axis, rough)
    for (text, axis, _), of in zip(each, (sensor, sse), strict=True):
        yield over(f"with the sensitivity, over {text}", slope * of, pressure, axis, slopes=True)
    side = data.pressure_side.astype(np.float64)
    by = np.column_stack([ones, low[:, :4], sensor[:, :2], sse[:, :1], p[:, None] * sensor[:, :1]])
    rough = np.ones(by.shape[1])
    rough[1 : 1 + low[:, :4].shape[1]] = halves(low[:, :4])
    approach = Axis("pressure_side", "side of approach", "", side, settable=True)
    yield over("over the side from which a pressure was reached", side[:, None] * by, pressure, approach, rough)
    change = scene.change_psia
    step = Axis("pressure_change_psia", "change of the pressure", "psi", change, settable=True)
    moved = np.column_stack([change, *(scene.behind(tau) for tau in REMEMBERED_H), waves(change, 4), np.abs(change)])
    yield over("after the pressures before", moved, step, rough=np.ones(moved.shape[1]))
    state = latches(scene.p, np.argsort(data.order, kind="stable"))
    if np.any(state):
        yield over("after the last extreme of the pressure", state, pressure, step, np.ones(state.shape[1]))
    since = waves(scene.since_h, TIME)
    yield over("along each whole plot", since, since_axis)
    yield over("along each whole plot, times the pressure", slope * since, since_axis, pressure)
    for text, axis, moves in each:
        of, few = moves.values[:, None] / max(float(np.ptp(axis.values)), np.finfo(float).tiny), since[:, :4]
        both = np.column_stack([of * few, of * slope, of * slope * few])
        rough = np.concatenate([halves(few), [1.0], halves(few)])
        yield over(f"along each whole plot, times the step of {text} before it", both, since_axis, moves, rough)
    ended = Axis("ended_psia", "pressure with which the whole plot before ended", "psia", scene.ended_psia, True)
    columns = centred(scene.ended_psia)[:, None] * since[:, :4]
    yield over("along each whole plot, times the pressure at which the one before ended", columns, since_axis, ended)
    time = waves(scene.hours, TIME)
    yield over("with the sensitivity, along the run", slope * time, _hours(scene), pressure, slopes=True)


def _between(scene: PressureScene) -> Iterator[Place]:
    over, each = _place(scene, "whole-plot"), _temperatures(scene)
    sensor, sse = (waves(np.round(v), TEMPERATURE) for v in (scene.sensor, scene.sse))  # readbacks scatter
    for (text, axis, _), of in zip(each, (sensor, sse), strict=True):
        yield over(f"over {text}", of, axis)
    both, rough = products(sensor[:, :3], sse[:, :FEWER])
    yield over("over both temperatures", both, each[0][1], each[1][1], rough)
    yield over("along the run", waves(scene.hours, TIME), _hours(scene))
    for text, axis, moves in each:
        sides = (scene.displaced(axis.values, side, tau) for tau in (4.0, 24.0) for side in (-1.0, 1.0))
        before = np.column_stack([moves.values, *sides])
        yield over(f"after {text}s before", before, moves, rough=np.ones(before.shape[1]))


def _levels(level: IntArray) -> FloatArray:
    """(n, m - 1) indicators of all levels but the first; none of as many as there are rows."""
    every = np.unique(level)
    return (
        np.asarray(level[:, None] == every[1:], np.float64)
        if 2 < every.size <= level.size // 2
        else np.empty((level.size, 0))
    )


def changing_with(scene: PressureScene) -> dict[str, FloatArray]:
    """(n, m) smooth functions of what a coefficient within whole plots may change with, by words."""
    data = scene.data
    side = data.pressure_side.astype(np.float64)[:, None]
    return {
        "with the pressure": waves(data.pressure_psia, ENDS),
        OF_PLOTS[0]: waves(np.round(data.sensor_temperature_degC), ENDS),
        OF_PLOTS[1]: waves(np.round(data.sse_temperature_degC), ENDS),
        OF_PLOTS[2]: waves(scene.hours, ENDS),
        "along each whole plot": waves(scene.since_h, ENDS),
        "with the side from which a pressure was reached": side if np.ptp(side) > 0 else side[:, :0],
    }


def _hours(scene: PressureScene) -> Axis:
    return Axis("elapsed_s", "bench time", "h", scene.hours)


def _place(scene: PressureScene, level: str) -> partial[Place]:
    return partial(_at, scene, level)


def _at(
    scene: PressureScene,
    level: str,
    text: str,
    columns: FloatArray,
    over: Axis,
    beside: Axis | None = None,
    rough: FloatArray | None = None,
    **more: object,
) -> Place:
    """A place of readings, or of whole plots; those are drawn over their means. Levels are tried all together."""
    index = scene.data.whole_plot_index

    def mean(axis: Axis | None) -> Axis | None:
        if axis is None or level == "subplot":
            return axis
        values = np.round(np.bincount(index, axis.values) / np.bincount(index), 1)
        return Axis(axis.variable, axis.label, axis.unit, values, axis.settable)

    def axes(_i: int) -> tuple[Axis, Axis | None]:
        return mean(over) or over, mean(beside)

    tried = BETWEEN if level == "whole-plot" else (columns.shape[1],) if text.endswith("by itself") else WITHIN
    return smooth(text, columns, axes, rough, tried, level=level, **more)
