"""Doubtful names of a pitch-roll run that one shape without a name outdoes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.flexible import halves, rough_turns, turns, waves
from rig.fitter.trace.limits import limit
from rig.fitter.trace.lines import CLEAR, over_phase
from rig.fitter.trace.outdone import Shape, outdone
from rig.fitter.trace.places import Place
from rig.fitter.trace.search import names_of
from rig.procedures.attitude.trace.levels import Level
from rig.procedures.attitude.trace.unmodelled import UnmodelledSmooth
from rig.procedures.attitude.trace.view import View

LEVEL: Level = "replications"
"""Where names are weighed against shapes: beside each replication's own parameters."""
FINE = int(limit("waves of a curve", "pitch-roll"))
"""Waves over pitch, and periods per turn of roll: a step and a narrow peak have as many."""
FINER = ", finer"
"""Tells such a place from the one that is looked for."""
ROOM = 12
"""Waves over pitch of what acts from one side of the room, and turns with the package once per turn of roll."""


def outdone_in(run: UnmodelledSmooth, doubtful: Iterable[str]) -> dict[str, str]:
    """Doubtful names that one shape without a name outdoes, each with the place of that shape.

    Names of what happens between replications are seen in their parameters only, and stay.

    Args:
        run: beside all that was found.
        doubtful: names.

    """
    problem, doubtful = run.problem, set(doubtful)
    names = [
        name
        for name in names_of(run.candidates, run.chosen)
        if name in doubtful and run.candidates[run.of(name)[0]].effect.stratum != "replication"
    ]
    if not names or not run.able:
        return {}
    rest = tuple(j for j in run.chosen if run.candidates[j].effect.name not in names)
    view = View(problem, LEVEL, rest, run.sigma)

    def white(columns: FloatArray) -> FloatArray:
        return view.white(columns, None, run.memory)

    columns = {name: white(view.of(run.of(name))) for name in names}
    y = white(view.outputs.reshape(-1, 1))[:, 0]
    found = outdone(y, columns, {name: _price(run, name) for name in names}, _shapes(run, view, white))
    return {name: place.removesuffix(FINER) for name, place in found.items()}


def _price(run: UnmodelledSmooth, name: str) -> float:
    """Price in nats of the choice of a name, and of its terms or values in each sensor."""
    problem, units = run.problem, dict[str | None, set[int]]()
    for j, candidate in enumerate(run.candidates):
        if candidate.effect.name == name:
            units.setdefault(candidate.sensor, set()).add(problem.unit_of[j])
    taken = {(run.candidates[j].sensor, problem.unit_of[j]) for j in run.of(name)}
    names = len({candidate.effect.name for candidate in run.candidates})
    return float(np.log(names) + sum(np.log(len(units[sensor])) for sensor, _ in taken))


def _shapes(run: UnmodelledSmooth, view: View, white: Callable[[FloatArray], FloatArray]) -> Iterator[Shape]:
    """Shapes of all sensors together, at each place."""
    by_text = dict[str, list[Place]]()
    for place in (*run.places, *_wider(run)):
        by_text.setdefault(place.text, []).append(place)
    kinds = sum(1.0 / some[0].alternatives for some in by_text.values())
    for text, some in by_text.items():
        parts = list[FloatArray]()
        for place in some:
            own = view.project(place.columns(), place.sensor)
            part = np.zeros((view.outputs.size, own.shape[1]))
            part[run.rows(place.sensor)] = own
            parts.append(part)
        roughness = np.concatenate([place.roughness for place in some])
        price = float(np.log(kinds * some[0].alternatives))
        yield Shape(text, white(np.column_stack(parts)), roughness, price)


def _wider(run: UnmodelledSmooth) -> Iterator[Place]:
    """Shapes that are too fine, or of too many columns, to be looked for: they are only weighed against names."""
    scene = run.problem.scene
    data, sensors = scene.data, scene.data.sensors
    ones, pitch = np.ones((len(data), 1)), waves(data.pitch_deg, FINE)

    def of_head(text: str, per: Callable[[str], FloatArray], error: FloatArray, rough: FloatArray) -> Place:
        both = np.column_stack([ones, error])
        columns = np.concatenate([per(sensor)[:, None] * both for sensor in sensors])
        return _place(f"package: an error of {text}", columns, np.append(1.0, rough), None)

    yield of_head(f"pitch over the pitch angle{FINER}", scene.per_pitch, pitch, halves(pitch))
    for i in range(len(sensors)):
        yield _place(f"over the pitch angle{FINER}", pitch, halves(pitch), i)
    if scene.roll:
        roll, once, few = turns(data.roll_deg, FINE), turns(data.roll_deg, 1), waves(data.pitch_deg, ROOM)
        rough, own = rough_turns(roll), np.append(1.0, halves(few))
        yield of_head(f"pitch over the roll angle{FINER}", scene.per_pitch, roll, rough)
        yield of_head(f"roll over the roll angle{FINER}", scene.per_roll, roll, rough)
        turned = [np.column_stack([ones, few]) * one[:, None] for one in once.T]
        columns, rough_room = np.column_stack([few, *turned]), np.concatenate([halves(few), *(own for _ in turned)])
        for i in range(len(sensors)):
            yield _place(f"over the roll angle{FINER}", roll, rough, i)
            yield _place("over pitch, times roll once a turn", columns, rough_room, i)
    line = next((one for one in run.lines if one is not None and one.p < CLEAR), None)
    if line is not None:
        phase = run.phase(line, 0)
        block = over_phase(line, phase.left, phase.at, phase.period, phase.unit, run.harmonics)[0]
        yield of_head("pitch, periodic along the run", scene.per_pitch, block.columns, block.roughness)
        if scene.roll:
            yield of_head("roll, periodic along the run", scene.per_roll, block.columns, block.roughness)


def _place(text: str, columns: FloatArray, rough: FloatArray, sensor: int | None) -> Place:
    return Place(text, lambda: columns, (), rough[: columns.shape[1]], lambda _i: None, LEVEL, sensor)
