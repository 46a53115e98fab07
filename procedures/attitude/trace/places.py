"""Places for a shape without a name in a pitch-roll run: blocks of smooth columns over recorded quantities."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.flexible import Block, halves, orders_of, rough_turns, turns, waves
from rig.fitter.trace.latches import faded, latches
from rig.procedures.attitude.effects import Scene
from rig.procedures.attitude.trace.levels import Level

PITCH, ROLL, TIME, TEMPERATURE, GRAVITY = 8, 6, 12, 5, 12
"""Maximum number of waves over each."""
BOTH = 4
"""Maximum number of waves of pitch and of roll in their products."""
ALONG_RUN, ALONG_REPLICATION = "along the run", "along each replication"
ALONG_TIMES_GRAVITY = "along each replication, times gravity"
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
AFTER_A_TIP = "after the last strong tip along "
MEMORIES = (0.3, 4.0, 16.0)
"""How long the attitudes before are remembered, in usual times from row to row."""
FADING = "after the attitudes before, as they fade"


@dataclass(frozen=True, eq=False)
class Place:
    """A block of one sensor, or with one set of coefficients for all.

    Its columns are made when they are used: those of all places would take 15 MB of 2,886 points.

    Attributes:
        text: in words: "over the pitch angle".
        columns: makes (n, m) columns, the slowest first; for all sensors (S n, m), those of the first sensor first.
        orders: numbers of columns that are tried together, ascending.
        roughness: (m,) number of half waves of each.
        level: level of its judgement.
        sensor: its index; None for all.
        count: number of sensors.
        alternatives: number of places that differ only in a direction that is searched.

    """

    text: str
    columns: Callable[[], FloatArray]
    orders: tuple[int, ...]
    roughness: FloatArray
    level: Level
    sensor: int | None
    count: int
    alternatives: int = 1

    @classmethod
    def of(cls, block: Block, level: Level, sensor: int | None, count: int) -> Place:
        """The place of a block that is at hand."""
        return cls(block.place, lambda: block.columns, block.orders, block.roughness, level, sensor, count)

    @property
    def block(self) -> Block:
        """Its columns, made now."""
        return Block(self.text, self.columns(), self.orders, self.roughness)

    @property
    def in_time(self) -> bool:
        """Whether it is a smooth change of the offset, similar to a random walk."""
        return self.text in (ALONG_RUN, ALONG_REPLICATION)

    @property
    def remembers(self) -> bool:
        """Whether it is of the rows before, as hysteresis and settling are, wherever it is judged."""
        return self.text == FADING or self.text.startswith(AFTER_A_TIP)


def places_of(scene: Scene) -> tuple[Place, ...]:
    """All places of a run."""
    found, count = list[Place](), len(scene.data.sensors)
    makers: tuple[tuple[Level, Callable[[Scene], list[_Made]]], ...] = (
        ("replications", _between_points),
        ("points", _within_points),
    )
    for level, make in makers:
        made = make(scene)
        tips = sum(place.startswith(AFTER_A_TIP) for place, _, _ in made)
        for place, columns, rough in made:
            each = [partial(columns, i) for i in range(count)]
            at: list[tuple[int | None, Callable[[], FloatArray]]] = list(enumerate(each))
            if place.startswith("package"):
                at = [(None, partial(_of_all, each))]
            for i, own in at:
                some = own()
                orders = orders_of(some, (3, 6, 12, 40) if level == "replications" else (3, 6, 12))
                alike = tips if place.startswith(AFTER_A_TIP) else 1
                found.append(Place(place, own, orders, rough[: some.shape[1]], level, i, count, alike))
    return tuple(found)


def _of_all(each: Sequence[Callable[[], FloatArray]]) -> FloatArray:
    return np.concatenate([own() for own in each])


def between_replications(scene: Scene) -> tuple[Place, ...]:
    """Offsets and sensitivities that differ from one replication to the next, without a course."""
    own = np.eye(scene.data.replicates.size)[scene.data.replicate_index]
    found = []
    for i, sensor in enumerate(scene.data.sensors):
        gain = _times(scene.along(sensor), own)
        for text, columns in (("with an offset of each replication", own), ("with a sensitivity of each", gain)):
            block = Block(text, columns, (columns.shape[1],), np.ones(columns.shape[1]))
            found.append(Place.of(block, "points", i, len(scene.data.sensors)))
    return tuple(found)


_Made = tuple[str, Callable[[int], FloatArray], FloatArray]


def _between_points(scene: Scene) -> list[_Made]:
    data, sensors = scene.data, scene.data.sensors
    pitch, ones = waves(data.pitch_deg, PITCH), np.ones((len(data), 1))
    with_one = np.column_stack([ones, pitch])
    along = [waves(scene.along(s), GRAVITY) for s in sensors]
    found: list[_Made] = [
        ("over the pitch angle", lambda _i: pitch, halves(pitch)),
        ("over gravity along the sensor", lambda i: along[i], halves(max(along, key=np.size))),
        (
            "package: an error of pitch over the pitch angle",
            lambda i: _times(scene.per_pitch(sensors[i]), with_one),
            np.append(1.0, halves(pitch)),
        ),
    ]
    if scene.roll:
        roll, both = turns(data.roll_deg, ROLL), _products(waves(data.pitch_deg, BOTH), turns(data.roll_deg, BOTH))
        rough = rough_turns(roll)
        rolled = np.column_stack([ones, roll])
        found += [
            ("over the roll angle", lambda _i: roll, rough),
            (
                "package: an error of roll over the roll angle",
                lambda i: _times(scene.per_roll(sensors[i]), rolled),
                np.append(1.0, rough),
            ),
            (
                "package: an error of pitch over the roll angle",
                lambda i: _times(scene.per_pitch(sensors[i]), roll),
                rough,
            ),
            ("over pitch and roll", lambda _i: both[0], both[1]),
        ]
    return [*found, *_tipped(scene), *_faded(scene)]


def _tipped(scene: Scene) -> Iterator[_Made]:
    """Latches of gravity along directions of the package, alone and times gravity along each sensor."""
    data = scene.data
    executed, known = np.lexsort((data.order, data.replicate_index)), list[FloatArray]()
    for text, axis in TIPPED.items():
        state = latches(tipped(scene, axis), executed)
        if np.any(state) and not any(np.array_equal(state, one) for one in known):
            known.append(state)
            yield AFTER_A_TIP + text, partial(_with_gravity, scene, state), np.ones(2 * state.shape[1])


def _faded(scene: Scene) -> Iterator[_Made]:
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
    yield FADING, lambda _i: columns, np.ones(columns.shape[1])


def tipped(scene: Scene, axis: tuple[float, float, float]) -> FloatArray:
    """(n,) gravity along a direction in the package, in g."""
    return np.asarray(scene.g @ (np.array(axis) / np.linalg.norm(axis)))


def _within_points(scene: Scene) -> list[_Made]:
    data, sensors, g = scene.data, scene.data.sensors, scene.g
    time, ones = waves(data.elapsed_s, TIME), np.ones((len(data), 1))
    since = waves(_since(data.replicate_index, data.elapsed_s), 6)
    found: list[_Made] = [
        (ALONG_RUN, lambda _i: time, halves(time)),
        ("along the run, times gravity", lambda _i: _times3(g, time[:, :6]), np.repeat(halves(time[:, :6]), 3)),
        (ALONG_REPLICATION, lambda _i: since, halves(since)),
        (ALONG_TIMES_GRAVITY, lambda _i: _times3(g, since[:, :3]), np.repeat(halves(since[:, :3]), 3)),
        (
            "package: an error of pitch along the run",
            lambda i: _times(scene.per_pitch(sensors[i]), time),
            halves(time),
        ),
    ]
    if scene.roll:
        found.append(
            (
                "package: an error of roll along the run",
                lambda i: _times(scene.per_roll(sensors[i]), time),
                halves(time),
            )
        )
    if scene.temperature_degC is not None and data.sensor_temperature_degC is not None:
        warm = waves(data.sensor_temperature_degC, TEMPERATURE)
        found += [
            ("over the temperature", lambda _i: warm, halves(warm)),
            (
                "over the temperature, times gravity",
                lambda _i: _times3(g, warm[:, :3]),
                np.repeat(halves(warm[:, :3]), 3),
            ),
        ]
    sides = [("pitch", data.pitch_side, waves(data.pitch_deg, 6))]
    if scene.roll:
        sides.append(("roll", data.roll_side, turns(data.roll_deg, 4)))
    for axis, side, smooth in sides:
        if np.ptp(side) > 0:
            by = [ones, smooth, g]
            rough = [np.ones(1), halves(smooth), np.ones(3)]
            if scene.temperature_degC is not None:
                by.append(scene.warmth()[:, None])
                rough.append(np.ones(1))
            both = _times(side.astype(np.float64), np.column_stack(by))
            place = f"over the side from which {axis} was approached"
            found.append((place, partial(_same, both), np.concatenate(rough)))
    moves = [data.pitch_deg - data.previous_pitch_deg]
    if scene.roll:
        moves.append(_wrapped(data.roll_deg - data.previous_roll_deg))
    moved = [waves(np.arcsinh(move), 5) for move in moves if np.ptp(move) > 0]
    if moved:
        both = np.column_stack(moved)
        found.append(("over the move before", lambda _i: both, np.concatenate([halves(one) for one in moved])))
    return found


def _same(columns: FloatArray, _i: int) -> FloatArray:
    return columns


def _with_gravity(scene: Scene, state: FloatArray, i: int) -> FloatArray:
    return np.column_stack([state, _times(scene.along(scene.data.sensors[i]), state)])


def _since(group: IntArray, values: FloatArray) -> FloatArray:
    """(n,) values since the first of each group."""
    first = np.full(int(group.max()) + 1, np.inf)
    np.minimum.at(first, group, values)
    return np.asarray(values - first[group])


def _times(one: FloatArray, columns: FloatArray) -> FloatArray:
    return np.asarray(one[:, None] * columns)


def _times3(g: FloatArray, columns: FloatArray) -> FloatArray:
    """(n, 3 m) products with the three components of gravity, the slowest wave first."""
    return np.asarray((columns[:, :, None] * g[:, None, :]).reshape(len(g), -1))


def _products(one: FloatArray, other: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, p q) products of columns, the slowest first, and their roughness."""
    pairs = sorted((i + j // 2 + 1, i, j) for i in range(one.shape[1]) for j in range(other.shape[1]))
    if not pairs:
        return np.empty((one.shape[0], 0)), np.empty(0)
    return (
        np.column_stack([one[:, i] * other[:, j] for _, i, j in pairs]),
        np.array([float(r) for r, _, _ in pairs]),
    )


def _wrapped(angle_deg: FloatArray) -> FloatArray:
    return np.asarray(np.mod(angle_deg + 180.0, 360.0) - 180.0)
