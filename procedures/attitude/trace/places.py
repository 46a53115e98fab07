"""Places for a shape without a name in a pitch-roll run: blocks of smooth columns over recorded quantities."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

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


class _Made(NamedTuple):
    """A place before its columns are made: by sensor, unless it is of the package."""

    text: str
    columns: Callable[[int], FloatArray]
    rough: FloatArray
    axes: Callable[[int], Axes | None]
    finer: Callable[[int], FloatArray] | None = None
    more: Mapping[str, Any] = {}


def places_of(scene: Scene) -> tuple[Place, ...]:
    """All places of a run."""
    found, count = list[Place](), len(scene.data.sensors)
    makers: tuple[tuple[Level, Callable[[Scene], list[_Made]]], ...] = (
        ("replications", _between_points),
        ("points", _within_points),
    )
    for level, make in makers:
        tried = (*TRIED, 40) if level == "replications" else TRIED
        for made in make(scene):
            each = [partial(made.columns, i) for i in range(count)]
            at: list[tuple[int | None, Callable[[], FloatArray]]] = list(enumerate(each))
            if made.text.startswith("package"):
                at = [(None, lambda each=each: np.concatenate([own() for own in each]))]  # type: ignore[misc]
            for i, own in at:
                some = own()
                orders, rough = orders_of(some, tried), made.rough[: some.shape[1]]
                finer = None if made.finer is None else partial(made.finer, i or 0)
                found.append(Place(made.text, own, orders, rough, made.axes, level, i, finer, **made.more))
    return tuple(found)


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


def _between_points(scene: Scene) -> list[_Made]:
    data, sensors, over = scene.data, scene.data.sensors, _Over(scene)
    pitch, ones = waves(data.pitch_deg, PITCH), np.ones((len(data), 1))
    with_one = np.column_stack([ones, pitch])
    along = [waves(scene.along(s), GRAVITY) for s in sensors]
    roll_axis = over.roll if scene.roll else None
    found = [
        _Made(
            "over the pitch angle",
            lambda _i: pitch,
            halves(pitch),
            over.only(over.pitch),
            lambda _i: waves(data.pitch_deg, FINE),
        ),
        _Made(
            "over gravity along the sensor",
            lambda i: along[i],
            halves(max(along, key=np.size)),
            lambda i: (over.gravity(i), None),
            lambda i: waves(scene.along(sensors[i]), FINE),
        ),
        _Made(
            "package: an error of pitch over the pitch angle",
            lambda i: _times(scene.per_pitch(sensors[i]), with_one),
            np.append(1.0, halves(pitch)),
            over.only(over.pitch, roll_axis),
        ),
    ]
    if scene.roll:
        roll, few = turns(data.roll_deg, ROLL), turns(data.roll_deg, BOTH)
        some = waves(data.pitch_deg, BOTH)
        both = products(some, few, (halves(some), rough_turns(few)))
        rough = rough_turns(roll)
        rolled = np.column_stack([ones, roll])
        found += [
            _Made("over the roll angle", lambda _i: roll, rough, over.only(over.roll)),
            _Made(
                "package: an error of roll over the roll angle",
                lambda i: _times(scene.per_roll(sensors[i]), rolled),
                np.append(1.0, rough),
                over.only(over.roll, over.pitch),
            ),
            _Made(
                "package: an error of pitch over the roll angle",
                lambda i: _times(scene.per_pitch(sensors[i]), roll),
                rough,
                over.only(over.roll, over.pitch),
            ),
            _Made("over pitch and roll", lambda _i: both[0], both[1], over.only(over.pitch, over.roll)),
        ]
    return [*found, *_tipped(scene, over), *_faded(scene, over)]


def _tipped(scene: Scene, over: _Over) -> list[_Made]:
    """Latches of gravity along directions of the package, alone and times gravity along each sensor."""
    data = scene.data
    executed, known = np.lexsort((data.order, data.replicate_index)), dict[str, tuple[FloatArray, FloatArray]]()
    for text, axis in TIPPED.items():
        along = np.asarray(scene.g @ (np.array(axis) / np.linalg.norm(axis)))
        state = latches(along, executed)
        if np.any(state) and not any(np.array_equal(state, one) for _, one in known.values()):
            known[text] = along, state
    return [
        _Made(
            f"after the last strong tip along {text}",
            partial(_with_gravity, scene, state),
            np.ones(2 * state.shape[1]),
            over.with_gravity(Axis("gravity_along", f"gravity along {text}", "g", along, settable=True)),
            more={"alternatives": len(known), "remembers": True},
        )
        for text, (along, state) in known.items()
    ]


def _faded(scene: Scene, over: _Over) -> Iterator[_Made]:
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
    axes = (*over.moves(), None, None)[:2]
    yield _Made(
        "after the attitudes before, as they fade",
        lambda _i: columns,
        np.ones(columns.shape[1]),
        lambda _i: None if axes[0] is None else (axes[0], axes[1]),
        more={"remembers": True},
    )


def _within_points(scene: Scene) -> list[_Made]:
    data, sensors, g, over = scene.data, scene.data.sensors, scene.g, _Over(scene)
    time, ones = waves(data.elapsed_s, TIME), np.ones((len(data), 1))
    began = waves(since(data.replicate_index, data.elapsed_s), 6)
    in_time = {"timed": True}
    found = [
        _Made("along the run", lambda _i: time, halves(time), over.only(over.hours), more=in_time),
        _times_gravity("along the run", g, time[:, :6], over.with_gravity(over.hours)),
        _Made("along each replication", lambda _i: began, halves(began), over.only(over.since), more=in_time),
        _times_gravity("along each replication", g, began[:, :3], over.with_gravity(over.since)),
        _Made(
            "package: an error of pitch along the run",
            lambda i: _times(scene.per_pitch(sensors[i]), time),
            halves(time),
            over.only(over.hours, over.pitch),
        ),
    ]
    sides = [("pitch", over.pitch, data.pitch_side, waves(data.pitch_deg, 6))]
    if scene.roll:
        found.append(
            _Made(
                "package: an error of roll along the run",
                lambda i: _times(scene.per_roll(sensors[i]), time),
                halves(time),
                over.only(over.hours, over.roll),
            )
        )
        sides.append(("roll", over.roll, data.roll_side, turns(data.roll_deg, 4)))
    if scene.temperature_degC is not None and data.sensor_temperature_degC is not None:
        warm = waves(data.sensor_temperature_degC, TEMPERATURE)
        axis = Axis("sensor_temperature_degC", "sensor temperature", "degC", data.sensor_temperature_degC, True)
        found += [
            _Made("over the temperature", lambda _i: warm, halves(warm), over.only(axis)),
            _times_gravity("over the temperature", g, warm[:, :3], over.with_gravity(axis)),
        ]
    for name, axis, side, some in sides:
        if np.ptp(side) > 0:
            warmth = [] if scene.temperature_degC is None else [scene.warmth()[:, None]]
            both = _times(side.astype(np.float64), np.column_stack([ones, some, g, *warmth]))
            rough = np.concatenate([np.ones(1), halves(some), np.ones(3 + len(warmth))])
            of = Axis(f"{name}_side", "side of approach", "", side.astype(np.float64), settable=True)
            text = f"over the side from which {name} was approached"
            found.append(_Made(text, partial(_same, both), rough, over.only(axis, of)))
    moves = over.moves()
    if moves:
        moved = [waves(np.arcsinh(move.values), 5) for move in moves]
        columns, rough = np.column_stack(moved), np.concatenate([halves(one) for one in moved])
        found.append(_Made("over the move before", lambda _i: columns, rough, over.only(*moves)))
    return found


def _same(columns: FloatArray, _i: int) -> FloatArray:
    return columns


def _with_gravity(scene: Scene, state: FloatArray, i: int) -> FloatArray:
    return np.column_stack([state, _times(scene.along(scene.data.sensors[i]), state)])


def _times(one: FloatArray, columns: FloatArray) -> FloatArray:
    return np.asarray(one[:, None] * columns)


def _times_gravity(text: str, g: FloatArray, columns: FloatArray, axes: Callable[[int], Axes]) -> _Made:
    """(n, 3 m) products with the three components of gravity, the slowest wave first."""

    def make(_i: int) -> FloatArray:
        return np.asarray((columns[:, :, None] * g[:, None, :]).reshape(len(g), -1))

    return _Made(f"{text}, times gravity", make, np.repeat(halves(columns), 3), axes)


def _wrapped(angle_deg: FloatArray) -> FloatArray:
    return np.asarray(np.mod(angle_deg + 180.0, 360.0) - 180.0)
