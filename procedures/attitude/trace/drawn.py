"""A shape without a name in a pitch-roll run, drawn over what it follows, with the names nearest to it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.doubts import DOUBT
from rig.fitter.trace.flexible import Block, halves, rough_turns, turns, waves
from rig.fitter.trace.limits import limit
from rig.fitter.trace.lines import Line, over_phase
from rig.fitter.trace.outcome import Instead
from rig.fitter.trace.shape import Axis, Name, ResidualAndWaves, Shape, shape_of, standing_for
from rig.procedures.attitude.effects import Scene
from rig.procedures.attitude.trace.levels import Level
from rig.procedures.attitude.trace.places import (
    AFTER_A_TIP,
    ALONG_REPLICATION,
    ALONG_RUN,
    ALONG_TIMES_GRAVITY,
    FADING,
    TIPPED,
    Place,
    between_replications,
    tipped,
)
from rig.procedures.attitude.trace.problem import AT_ONCE, raw_columns
from rig.procedures.attitude.trace.unmodelled import ResidualShape, UnmodelledSmooth

STRATA: dict[Level, str] = {"declared": "replication", "replications": "between-point", "points": "within-point"}
UNIT, PER_DEG = "mdeg", 1e3
HARMONICS = int(limit("harmonics", "pitch-roll"))
"""Harmonics of a period that its shape may have."""
PLACES = int(limit("places", "pitch-roll"))
"""Clearest places at which a shape in place of doubtful names is looked for."""
WAVES = 4
"""A turn of pitch and of roll, of a lack of fit that no place shows clearly."""
FINE = int(limit("waves of a curve", "pitch-roll"))
"""Waves of a curve that is drawn over one variable: more than are tested, and as smooth as is likeliest."""


def drawn(unmodelled: UnmodelledSmooth, left: ResidualShape, i: int) -> Shape | None:
    """The shape that sensor `i` follows; None where the likeliest is nothing."""
    place, axes = left.place, axes_of(unmodelled.problem.scene, left.place.text, i)
    if axes is not None and place.text in ("over the pitch angle", "over gravity along the sensor"):
        columns = waves(axes[0].values, FINE)
        place = replace(place, columns=lambda: columns, roughness=halves(columns))
    return _drawn(unmodelled, place, i, left.p, axes)


def drawn_instead(unmodelled: UnmodelledSmooth, names: tuple[str, ...], i: int) -> Instead | None:
    """One shape of sensor `i` in place of all effects of some names; None without names, or where there is none."""
    if not names:
        return None
    rest = unmodelled.without(names)
    own = [one for one in rest.left if one.place.sensor in (None, i) and one.p < DOUBT and one.shows_in(i)]
    found = standing_for(names, ((one.where, drawn(rest, one, i)) for one in own[:PLACES]))
    return None if found is None else Instead(names, *found)


def drawn_period(unmodelled: UnmodelledSmooth, found: Line, i: int) -> Shape | None:
    """A period of sensor `i`, over its phase."""
    problem, data = unmodelled.problem, unmodelled.problem.scene.data
    rows, level = problem.levels.executed, problem.levels.of_error
    if found.over:
        at = data.pitch_deg if found.over == "pitch" else np.mod(data.roll_deg, 360.0)
        period, unit, level = found.period, found.unit, "replications"
    elif found.unit == "readings":
        count = np.empty(rows.size)
        count[rows] = np.arange(rows.size)
        at, period, unit = count, found.period, "readings"
    else:
        at, period, unit = data.elapsed_s / 60.0, found.period / 60.0, "min"
    block, axis = over_phase(found, unmodelled.view(level).outputs[i], at, period, unit, HARMONICS)
    return _drawn(unmodelled, Place.of(block, level, i, len(problem.sensors)), i, found.p, (axis, None))


def drawn_points(unmodelled: UnmodelledSmooth, left: ResidualShape | None, p: float, i: int) -> Shape | None:
    """A lack of fit of sensor `i`: the clearest shape between points, else waves of pitch and roll.

    Args:
        unmodelled: the run beside what was found.
        left: the clearest shape.
        p: of the lack of fit.
        i: the sensor.

    """
    shape = drawn(unmodelled, left, i) if left is not None and left.p < DOUBT else None
    scene = unmodelled.problem.scene
    text = "over pitch and roll" if scene.roll else "over the pitch angle"
    axes = axes_of(scene, text, i)
    if shape is not None or axes is None:
        return shape
    each = [(np.ones((len(scene.data), 1)), np.zeros(1))]
    for angle in (scene.data.pitch_deg, *([scene.data.roll_deg] if scene.roll else [])):
        own = turns(angle, WAVES)
        rough = rough_turns(own)
        each = [
            (
                np.column_stack([one, *(one * own[:, [k]] for k in range(own.shape[1]))]),
                np.append(r, np.add.outer(rough, r)),
            )
            for one, r in each
        ]
    columns, rough = each[0][0][:, 1:], each[0][1][1:]
    place = Place.of(
        Block(text, columns, (columns.shape[1],), rough), "replications", i, len(unmodelled.problem.sensors)
    )
    return _drawn(unmodelled, place, i, p, axes)


def drawn_drift(unmodelled: UnmodelledSmooth, p: float, i: int) -> Shape | None:
    """Offsets of the replications of sensor `i`."""
    place = next(one for one in between_replications(unmodelled.problem.scene) if one.sensor == i)
    return _drawn(unmodelled, replace(place, level="declared"), i, p, axes_of(unmodelled.problem.scene, place.text, i))


def _drawn(
    unmodelled: UnmodelledSmooth, place: Place, i: int, p: float, axes: tuple[Axis, Axis | None] | None
) -> Shape | None:
    if axes is None:
        return None
    problem, n = unmodelled.problem, len(unmodelled.problem.scene.data)
    view, rho = unmodelled.view(place.level), unmodelled.memory
    at = slice(None) if place.sensor is None else slice(place.sensor * n, (place.sensor + 1) * n)
    own = slice(i * n, (i + 1) * n) if place.sensor is None else slice(None)
    y, columns = view.outputs.reshape(-1)[at], view.project(place.columns(), place.sensor)
    scale = float(view.sigma[i] * np.degrees(1.0 / problem.fits[problem.sensors[i]].parameters.S_V) * PER_DEG)
    seen = ResidualAndWaves(
        plain=y[own] * scale,
        plain_columns=columns[own] * scale,
        white=view.white(y, place.sensor, rho),
        white_columns=view.white(columns, place.sensor, rho),
        roughness=place.roughness,
        df=y.size // n * problem.levels.df(place.level) - len(unmodelled.chosen),
    )
    return shape_of(seen, *axes, _names(unmodelled, place, i), unit=UNIT, p=p, stratum=STRATA[place.level])


def _names(unmodelled: UnmodelledSmooth, place: Place, i: int) -> Iterator[Name]:
    """Every cause of which something is left where the shape is seen, beside what was found.

    Of a shape between points only what is judged there: pitch may go with the time of day by the order of running.
    """
    problem, view, rho = unmodelled.problem, unmodelled.view(place.level), unmodelled.memory
    mine = set(problem.concerned[i].tolist()) - set(unmodelled.chosen)
    units = [
        unit
        for unit in problem.units
        if mine.issuperset(unit)
        and (place.level != "replications" or problem.judged_at[unit[0]] == place.level)
        and (place.sensor is not None or problem.candidates[unit[0]].sensor is None)
    ]
    n = len(problem.scene.data)
    for start in range(0, len(units), AT_ONCE):
        some = units[start : start + AT_ONCE]
        picked = [j for unit in some for j in unit]
        raw = raw_columns(problem.scene, [problem.candidates[j] for j in picked])
        raw = raw.reshape(-1, len(picked)) if place.sensor is None else raw[place.sensor]
        columns = view.white(view.project(raw, place.sensor), place.sensor, rho)
        sigma = np.repeat(view.sigma, n)[:, None] if place.sensor is None else view.sigma[place.sensor]
        length, k = np.linalg.norm(raw / sigma, axis=0), 0
        for unit in some:
            own = slice(k, k + len(unit))
            yield problem.candidates[unit[0]].effect.name, columns[:, own], length[own]
            k += len(unit)


def axes_of(scene: Scene, place: str, i: int) -> tuple[Axis, Axis | None] | None:
    """The variable, and the second one, over which a place is drawn; None for a place that is not known."""
    data = scene.data
    pitch = Axis("pitch_deg", "pitch", "deg", data.pitch_deg, settable=True)
    roll = Axis("roll_deg", "roll", "deg", data.roll_deg, settable=True) if scene.roll else None
    hours = Axis("elapsed_s", "bench time", "h", data.elapsed_s / 3600.0)
    gravity = Axis("gravity", "gravity along the sensor", "g", scene.along(data.sensors[i]), settable=True)
    number = Axis("replicate", "replication", "", data.replicates[data.replicate_index].astype(np.float64))
    since = Axis("since_s", "time in the replication", "h", _since(scene))
    known: dict[str, tuple[Axis, Axis | None]] = {
        "over the pitch angle": (pitch, None),
        "over gravity along the sensor": (gravity, None),
        "package: an error of pitch over the pitch angle": (pitch, roll),
        ALONG_RUN: (hours, None),
        "along the run, times gravity": (hours, gravity),
        ALONG_REPLICATION: (since, None),
        ALONG_TIMES_GRAVITY: (since, gravity),
        "package: an error of pitch along the run": (hours, pitch),
        "with an offset of each replication": (number, None),
        "with a sensitivity of each": (number, gravity),
    }
    moves = [Axis("pitch_move_deg", "move of pitch before", "deg", data.pitch_deg - data.previous_pitch_deg, True)]
    sides = [("pitch", pitch, data.pitch_side)]
    if roll is not None:
        known |= {
            "over the roll angle": (roll, None),
            "package: an error of roll over the roll angle": (roll, pitch),
            "package: an error of pitch over the roll angle": (roll, pitch),
            "over pitch and roll": (pitch, roll),
            "package: an error of roll along the run": (hours, roll),
        }
        move = np.mod(data.roll_deg - data.previous_roll_deg + 180.0, 360.0) - 180.0
        moves.append(Axis("roll_move_deg", "move of roll before", "deg", move, True))
        sides.append(("roll", roll, data.roll_side))
    for name, over, side in sides:
        of = Axis(f"{name}_side", "side of approach", "", side.astype(np.float64), settable=True)
        known[f"over the side from which {name} was approached"] = (over, of)
    for text, axis in TIPPED.items():
        across = Axis("gravity_along", f"gravity along {text}", "g", tipped(scene, axis), settable=True)
        known[AFTER_A_TIP + text] = (across, gravity)
    moved = [one for one in moves if np.ptp(one.values) > 0]
    if moved:
        known["over the move before"] = known[FADING] = (moved[0], moved[1] if len(moved) > 1 else None)
    if data.sensor_temperature_degC is not None:
        warm = Axis("sensor_temperature_degC", "sensor temperature", "degC", data.sensor_temperature_degC, True)
        known |= {"over the temperature": (warm, None), "over the temperature, times gravity": (warm, gravity)}
    return known.get(place)


def _since(scene: Scene) -> FloatArray:
    """(n,) hours since the first observation of the replication."""
    data = scene.data
    first = np.full(data.replicates.size, np.inf)
    np.minimum.at(first, data.replicate_index, data.elapsed_s)
    return np.asarray((data.elapsed_s - first[data.replicate_index]) / 3600.0)
