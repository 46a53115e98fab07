"""A shape without a name in a whole-plot run, drawn over what it follows, with the names nearest to it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.doubts import DOUBT
from rig.fitter.trace.engine.beside import Level
from rig.fitter.trace.flexible import Block, halves, waves
from rig.fitter.trace.limits import limit
from rig.fitter.trace.lines import Line, over_phase
from rig.fitter.trace.outcome import Instead
from rig.fitter.trace.shape import Axis, Name, ResidualAndWaves, Shape, shape_of, standing_for
from rig.procedures.pressure.effects.scene import PressureScene
from rig.procedures.pressure.trace.places import Place
from rig.procedures.pressure.trace.unmodelled import ResidualShape, UnmodelledSmooth

UNIT = "mV"
PLACES = int(limit("places", "whole-plot"))
"""Clearest places at which a shape in place of doubtful names is looked for."""
HARMONICS, FINE = int(limit("harmonics", "whole-plot")), int(limit("waves of a curve", "whole-plot"))
"""Harmonics of a period that its shape may have; waves of a curve that is drawn over the pressure."""


def drawn(unmodelled: UnmodelledSmooth, left: ResidualShape) -> Shape | None:
    """The shape that a transducer follows; None where the likeliest is nothing."""
    place, scene = left.place, unmodelled.scene
    if place.block.place == "over the pressure":
        columns = waves(np.sqrt(np.maximum(scene.p, 0.0)), FINE)
        fine = Block(place.block.place, columns, place.block.orders, halves(columns))
        place = replace(place, block=fine)
    return _drawn(unmodelled, place, left.sensor, left.p, axes_of(scene, place.block.place))


def drawn_instead(unmodelled: UnmodelledSmooth, names: tuple[str, ...], i: int) -> Instead | None:
    """One shape of transducer `i` in place of all effects of some names; None without names, or where there is none."""
    if not names:
        return None
    candidates = unmodelled.problem.candidates
    rest = replace(unmodelled, chosen=tuple(j for j in unmodelled.chosen if candidates[j].effect.name not in names))
    own = [one for one in rest.left if one.sensor == i and one.p < DOUBT]
    found = standing_for(names, ((one.unnamed().where, drawn(rest, one)) for one in own[:PLACES]))
    return None if found is None else Instead(names, *found)


def drawn_period(unmodelled: UnmodelledSmooth, found: Line, i: int) -> Shape | None:
    """A period of transducer `i` within whole plots, over its phase."""
    problem, data = unmodelled.problem, unmodelled.scene.data
    if found.unit == "readings":
        at, period, unit = np.argsort(np.argsort(problem.order)).astype(np.float64), found.period, "readings"
    else:
        at, period, unit = data.elapsed_s / 60.0, found.period / 60.0, "min"
    block, axis = over_phase(found, unmodelled.view("subplot").outputs[i], at, period, unit, HARMONICS)
    return _drawn(unmodelled, Place(block, "subplot"), i, found.p, (axis, None))


def _drawn(
    unmodelled: UnmodelledSmooth, place: Place, i: int, p: float, axes: tuple[Axis, Axis | None] | None
) -> Shape | None:
    if axes is None:
        return None
    view = unmodelled.view(place.level)
    y, columns = view.outputs[i], view.project(place.block.columns, i)
    errors = view.white.errors[i]
    scale = view.sigma[i] * (errors.sd if place.level == "subplot" else 1.0 / errors.length)
    over, beside = (None if one is None else _at(one, unmodelled, place.level) for one in axes)
    if over is None:
        return None
    seen = ResidualAndWaves(y * scale, columns * scale[:, None], y, columns, place.block.roughness, int(view.df[i]))
    return shape_of(seen, over, beside, _names(unmodelled, place.level, i), unit=UNIT, p=p, stratum=place.level)


def _at(axis: Axis, unmodelled: UnmodelledSmooth, level: Level) -> Axis:
    """The same with one value a row of the stratum: of readings, or of whole plots."""
    if level == "subplot":
        return axis
    index = unmodelled.problem.whole_plot
    return replace(axis, values=np.round(np.bincount(index, axis.values) / np.bincount(index), 1))


def _names(unmodelled: UnmodelledSmooth, level: Level, i: int) -> Iterator[Name]:
    """Every cause that is judged in the stratum, beside what was found; each value of a constant by itself."""
    problem, view, sensor = unmodelled.problem, unmodelled.view(level), unmodelled.problem.sensors[i]
    every = [
        j
        for j in problem.within(level, range(len(problem.candidates)))
        if j not in unmodelled.chosen
        and problem.candidates[j].sensor in (None, sensor)
        and not problem.candidates[j].effect.of_noise
    ]
    columns, length = view.of(every, [i]), view.length(problem.raw[i][:, every], i)
    for k, j in enumerate(every):
        yield problem.candidates[j].effect.name, columns[:, [k]], length[[k]]


def axes_of(scene: PressureScene, place: str) -> tuple[Axis, Axis | None] | None:
    """The variable, and the second one, over which a place is drawn; None for a place that is not known."""
    data = scene.data
    pressure = Axis("pressure_psia", "pressure", "psia", data.pressure_psia, settable=True)
    sensor = Axis(
        "sensor_temperature_degC", "transducer's temperature", "degC", data.sensor_temperature_degC, settable=True
    )
    sse = Axis("sse_temperature_degC", "electronics' temperature", "degC", data.sse_temperature_degC, settable=True)
    side = Axis("pressure_side", "side of approach", "", data.pressure_side.astype(np.float64), settable=True)
    change = Axis("pressure_change_psia", "change of the pressure", "psi", scene.change_psia, settable=True)
    since = Axis("since_s", "time in the whole plot", "h", scene.since_h)
    ended = Axis("ended_psia", "pressure with which the whole plot before ended", "psia", scene.ended_psia, True)
    hours = Axis("elapsed_s", "bench time", "h", scene.hours)
    steps = {
        "sensor": Axis("sensor_step_degC", "step of the transducer's temperature", "degC", _step(scene, sensor), True),
        "sse": Axis("sse_step_degC", "step of the electronics' temperature", "degC", _step(scene, sse), True),
    }
    known: dict[str, tuple[Axis, Axis | None]] = {
        "over the pressure": (pressure, None),
        "over the pressure, times the transducer's temperature": (pressure, sensor),
        "over the pressure, times the electronics' temperature": (pressure, sse),
        "with the sensitivity, over the transducer's temperature": (pressure, sensor),
        "with the sensitivity, over the electronics' temperature": (pressure, sse),
        "over the side from which a pressure was reached": (pressure, side),
        "after the pressures before": (change, None),
        "after the last extreme of the pressure": (pressure, change),
        "along each whole plot": (since, None),
        "along each whole plot, times the pressure": (since, pressure),
        "along each whole plot, times the step of the transducer's temperature before it": (since, steps["sensor"]),
        "along each whole plot, times the step of the electronics' temperature before it": (since, steps["sse"]),
        "along each whole plot, times the pressure at which the one before ended": (since, ended),
        "with the sensitivity, along the run": (hours, pressure),
        "over the transducer's temperature": (sensor, None),
        "over the electronics' temperature": (sse, None),
        "over both temperatures": (sensor, sse),
        "along the run": (hours, None),
        "after the transducer's temperatures before": (steps["sensor"], None),
        "after the electronics' temperatures before": (steps["sse"], None),
    }
    return known.get(place)


def _step(scene: PressureScene, of: Axis) -> FloatArray:
    return scene.step(of.values)
