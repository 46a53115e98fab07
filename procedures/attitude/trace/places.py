"""Places for a shape without a name in a pitch-roll run: blocks of smooth columns over recorded quantities."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.flexible import halves, orders_of, rough_turns, turns, waves
from rig.fitter.trace.latches import faded, latches
from rig.fitter.trace.limits import limit
from rig.fitter.trace.places import TRIED, Axes, Place, as_one, products, since
from rig.fitter.trace.shape import Axis
from rig.procedures.attitude.effects import Scene
from rig.procedures.attitude.trace.levels import Level

PITCH, ROLL, TIME, TEMPERATURE, GRAVITY = 8, 6, 12, 5, 12
"""Maximum number of waves over each."""
BOTH = 4
"""Maximum number of waves of pitch and of roll in their products."""
FINE = int(limit("waves of a curve", "pitch-roll"))
"""Waves of a curve that is drawn over one variable: more than are tested, and as smooth as is likeliest."""
TIPPED = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "x + y": (1.0, 1.0, 0.0),
    "x - y": (1.0, -1.0, 0.0),
    "x + z": (1.0, 0.0, 1.0),
    "x - z": (1.0, 0.0, -1.0),
    "y + z": (0.0, 1.0, 1.0),
    "y - z": (0.0, 1.0, -1.0),
}
"""Directions in the package along which something loose may tip."""
MEMORIES = (0.3, 4.0, 16.0)
"""How long the attitudes before are remembered, in usual times from row to row."""


def places_of(scene: Scene) -> tuple[Place, ...]:
    """All places of a run."""
    return (*_between_points(scene), *_within_points(scene))


def _each(
    scene: Scene,
    level: Level,
    text: str,
    columns: Callable[[int], FloatArray] | FloatArray,
    axes: Callable[[int], Axes | None],
    rough: FloatArray | None = None,
    finer: Callable[[int], FloatArray] | None = None,
    **more: Any,
) -> Iterator[Place]:
    """A place of each sensor, or one of the package: of columns (n, m) by sensor, or the same in all; `more` are
    attributes.
    """
    count, tried = len(scene.data.sensors), (*TRIED, 40) if level == "replications" else TRIED
    make = columns if callable(columns) else partial(_same, columns)
    each = [partial(make, i) for i in range(count)]
    at: list[tuple[int | None, Callable[[], FloatArray]]] = list(enumerate(each))
    if text.startswith("package"):
        at = [(None, lambda: np.concatenate([own() for own in each]))]
    for i, own in at:
        some = own()
        roughness = (halves(some) if rough is None else rough)[: some.shape[1]]
        more_waves = None if finer is None else partial(finer, i or 0)
        yield Place(text, own, orders_of(some, tried), roughness, axes, level, i, more_waves, **more)


def between_replications(scene: Scene) -> tuple[Place, ...]:
    """Offsets and sensitivities that differ from one replication to the next, without a course."""
    own = np.eye(scene.data.replicates.size)[scene.data.replicate_index]
    over, found = _Over(scene), []
    for i, sensor in enumerate(scene.data.sensors):
        gain = _times(scene.along(sensor), own)
        found += [
            as_one("with an offset of each replication", own, over.only(over.number), level="points", sensor=i),
            as_one("with a sensitivity of each", gain, over.with_gravity(over.number), level="points", sensor=i),
        ]
    return tuple(found)


class _Over:
    """What places of a run are drawn over."""

    def __init__(self, scene: Scene) -> None:
        self.scene, data = scene, scene.data
        self.pitch = Axis("pitch_deg", "pitch", "deg", data.pitch_deg, settable=True)
        self.roll = Axis("roll_deg", "roll", "deg", data.roll_deg, settable=True)
        self.hours = Axis("elapsed_s", "bench time", "h", data.elapsed_s / 3600.0)
        began = since(data.replicate_index, data.elapsed_s) / 3600.0
        self.since = Axis("since_s", "time in the replication", "h", began)
        number = data.replicates[data.replicate_index].astype(np.float64)
        self.number = Axis("replicate", "replication", "", number)

    def only(self, one: Axis, other: Axis | None = None) -> Callable[[int], Axes | None]:
        """Over one variable or two, in any sensor."""
        return lambda _i: (one, other)

    def with_gravity(self, one: Axis) -> Callable[[int], Axes]:
        """Over a variable and gravity along the sensor."""
        return lambda i: (one, self.gravity(i))

    def gravity(self, i: int) -> Axis:
        """Along a sensor."""
        along = self.scene.along(self.scene.data.sensors[i])
        return Axis("gravity", "gravity along the sensor", "g", along, settable=True)

    def moves(self) -> list[Axis]:
        """Moves of the axes before each row, of those that move."""
        data = self.scene.data
        moves = [Axis("pitch_move_deg", "move of pitch before", "deg", data.pitch_deg - data.previous_pitch_deg, True)]
        if self.scene.roll:
            move = _wrapped(data.roll_deg - data.previous_roll_deg)
            moves.append(Axis("roll_move_deg", "move of roll before", "deg", move, True))
        return [one for one in moves if np.ptp(one.values) > 0]


def _between_points(scene: Scene) -> Iterator[Place]:
    data, sensors, over = scene.data, scene.data.sensors, _Over(scene)
    at = partial(_each, scene, "replications")
    pitch, ones = waves(data.pitch_deg, PITCH), np.ones((len(data), 1))
    with_one = np.column_stack([ones, pitch])
    along = [waves(scene.along(s), GRAVITY) for s in sensors]
    more_of_pitch = partial(_same, waves(data.pitch_deg, FINE))
    yield from at("over the pitch angle", pitch, over.only(over.pitch), finer=more_of_pitch)
    yield from at(
        "over gravity along the sensor",
        along.__getitem__,
        lambda i: (over.gravity(i), None),
        finer=lambda i: waves(scene.along(sensors[i]), FINE),
    )
    yield from at(
        "package: an error of pitch over the pitch angle",
        lambda i: _times(scene.per_pitch(sensors[i]), with_one),
        over.only(over.pitch, over.roll if scene.roll else None),
        np.append(1.0, halves(pitch)),
    )
    if scene.roll:
        roll, few = turns(data.roll_deg, ROLL), turns(data.roll_deg, BOTH)
        some = waves(data.pitch_deg, BOTH)
        rough, rolled = rough_turns(roll), np.column_stack([ones, roll])
        yield from at("over the roll angle", roll, over.only(over.roll), rough)
        yield from at(
            "package: an error of roll over the roll angle",
            lambda i: _times(scene.per_roll(sensors[i]), rolled),
            over.only(over.roll, over.pitch),
            np.append(1.0, rough),
        )
        yield from at(
            "package: an error of pitch over the roll angle",
            lambda i: _times(scene.per_pitch(sensors[i]), roll),
            over.only(over.roll, over.pitch),
            rough,
        )
        both, of_both = products(some, few, (halves(some), rough_turns(few)))
        yield from at("over pitch and roll", both, over.only(over.pitch, over.roll), of_both)
    yield from _tipped(scene, over)
    yield from _faded(scene, over)


def _tipped(scene: Scene, over: _Over) -> Iterator[Place]:
    """Latches of gravity along directions of the package, alone and times gravity along each sensor."""
    data = scene.data
    executed, known = np.lexsort((data.order, data.replicate_index)), dict[str, tuple[FloatArray, FloatArray]]()
    for text, axis in TIPPED.items():
        along = np.asarray(scene.g @ (np.array(axis) / np.linalg.norm(axis)))
        state = latches(along, executed)
        if np.any(state) and not any(np.array_equal(state, one) for _, one in known.values()):
            known[text] = along, state
    for text, (along, state) in known.items():
        yield from _each(
            scene,
            "replications",
            f"after the last strong tip along {text}",
            partial(_with_gravity, scene, state),
            over.with_gravity(Axis("gravity_along", f"gravity along {text}", "g", along, settable=True)),
            np.ones(2 * state.shape[1]),
            alternatives=len(known),
            remembers=True,
        )


def _faded(scene: Scene, over: _Over) -> Iterator[Place]:
    """Gravity along the package's axes in rows before, less that of this row; and how far the axes moved before it."""
    data, executed = scene.data, np.lexsort((scene.data.order, scene.data.replicate_index))
    stretches = np.split(executed, np.flatnonzero(np.diff(data.replicate_index[executed])) + 1)
    waits = np.concatenate([np.diff(data.elapsed_s[rows]) for rows in stretches])
    if not np.any(waits > 0.0):
        return
    usual = float(np.median(waits[waits > 0.0]))
    moved = [np.abs(data.pitch_deg - data.previous_pitch_deg)]
    if scene.roll:
        moved.append(np.abs(_wrapped(data.roll_deg - data.previous_roll_deg)))
    every = np.column_stack([scene.g, *(one / max(float(one.max()), 1.0) for one in moved)])
    each = [faded(every, data.elapsed_s, stretches, tau * usual) - every for tau in MEMORIES]
    columns = np.column_stack([each[0][:, :3], *each[1:]])
    moves = over.moves()
    axes = over.only(*moves) if moves else lambda _i: None
    text, rough = "after the attitudes before, as they fade", np.ones(columns.shape[1])
    yield from _each(scene, "replications", text, columns, axes, rough, remembers=True)


def _within_points(scene: Scene) -> Iterator[Place]:
    data, sensors, g, over = scene.data, scene.data.sensors, scene.g, _Over(scene)
    at = partial(_each, scene, "points")
    time, ones = waves(data.elapsed_s, TIME), np.ones((len(data), 1))
    began = waves(since(data.replicate_index, data.elapsed_s), 6)

    def times_gravity(text: str, columns: FloatArray, axis: Axis) -> Iterator[Place]:
        """(n, 3 m) products with the three components of gravity, the slowest wave first."""
        rough, more = np.repeat(halves(columns), 3), f"{text}, times gravity"

        def make(_i: int) -> FloatArray:
            return np.asarray((columns[:, :, None] * g[:, None, :]).reshape(len(g), -1))

        return at(more, make, over.with_gravity(axis), rough)

    yield from at("along the run", time, over.only(over.hours), timed=True)
    yield from times_gravity("along the run", time[:, :6], over.hours)
    yield from at("along each replication", began, over.only(over.since), timed=True)
    yield from times_gravity("along each replication", began[:, :3], over.since)
    axes = over.only(over.hours, over.pitch)
    of_pitch = "package: an error of pitch along the run"
    yield from at(of_pitch, lambda i: _times(scene.per_pitch(sensors[i]), time), axes, halves(time))
    sides = [("pitch", over.pitch, data.pitch_side, waves(data.pitch_deg, 6))]
    if scene.roll:
        axes, of_roll = over.only(over.hours, over.roll), "package: an error of roll along the run"
        yield from at(of_roll, lambda i: _times(scene.per_roll(sensors[i]), time), axes, halves(time))
        sides.append(("roll", over.roll, data.roll_side, turns(data.roll_deg, 4)))
    if scene.temperature_degC is not None and data.sensor_temperature_degC is not None:
        warm = waves(data.sensor_temperature_degC, TEMPERATURE)
        axis = Axis("sensor_temperature_degC", "sensor temperature", "degC", data.sensor_temperature_degC, True)
        yield from at("over the temperature", warm, over.only(axis))
        yield from times_gravity("over the temperature", warm[:, :3], axis)
    for name, axis, side, some in sides:
        if np.ptp(side) > 0:
            warmth = [] if scene.temperature_degC is None else [scene.warmth()[:, None]]
            both = _times(side.astype(np.float64), np.column_stack([ones, some, g, *warmth]))
            rough = np.concatenate([np.ones(1), halves(some), np.ones(3 + len(warmth))])
            of = Axis(f"{name}_side", "side of approach", "", side.astype(np.float64), settable=True)
            yield from at(f"over the side from which {name} was approached", both, over.only(axis, of), rough)
    if moves := over.moves():
        moved = [waves(np.arcsinh(move.values), 5) for move in moves]
        columns, rough = np.column_stack(moved), np.concatenate([halves(one) for one in moved])
        yield from at("over the move before", columns, over.only(*moves), rough)


def _same(columns: FloatArray, _i: int) -> FloatArray:
    return columns


def _with_gravity(scene: Scene, state: FloatArray, i: int) -> FloatArray:
    return np.column_stack([state, _times(scene.along(scene.data.sensors[i]), state)])


def _times(one: FloatArray, columns: FloatArray) -> FloatArray:
    return np.asarray(one[:, None] * columns)


def _wrapped(angle_deg: FloatArray) -> FloatArray:
    return np.asarray(np.mod(angle_deg + 180.0, 360.0) - 180.0)
