"""The run list: every point of a run, in order, fixed before any motion.

Points are added one by one and stored packed. Questions about all points are answered from the few different settings.
So a run list of a million points takes a few megabytes, also while it is made or checked.
"""

from __future__ import annotations

import copy
import hashlib
import itertools
import json
from array import array
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar, overload

from rig.procedures.column_names import spelled, split_unit, with_word

if TYPE_CHECKING:
    from rig.procedures.plan.hand_steps import HandStep

Level = TypeVar("Level", bound=Hashable)

_WIDER = {"B": "H", "H": "I", "I": "Q"}


class Coded(Generic[Level]):
    """Values in order, each stored as the number of its level.

    Attributes:
        levels: the different values, in order of first appearance.
    """

    def __init__(self) -> None:
        self.levels: list[Level] = []
        self._code_of: dict[Level, int] = {}
        self._codes = array("B")

    def extend(self, values: Sequence[Level]) -> None:
        """Append values."""
        for value in dict.fromkeys(values):
            if value not in self._code_of:
                self._code_of[value] = len(self.levels)
                self.levels.append(value)
        while len(self.levels) > 1 << 8 * self._codes.itemsize:
            self._codes = array(_WIDER[self._codes.typecode], self._codes)
        self._codes.extend(map(self._code_of.__getitem__, values))

    def first(self, code: int) -> int:
        """Index of the first value of this level."""
        return self._codes.index(code)

    def count(self, code: int) -> int:
        """Number of values of this level."""
        return self._codes.count(code)

    def __len__(self) -> int:
        return len(self._codes)

    def __getitem__(self, index: int) -> Level:
        return self.levels[self._codes[index]]

    def __iter__(self) -> Iterator[Level]:
        return map(self.levels.__getitem__, self._codes)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Coded):
            return NotImplemented
        return self.levels == other.levels and self._codes == other._codes

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True, slots=True)
class Factor:
    """A setting of the bench that the procedure varies.

    Attributes:
        name: with its unit, as in tables ("pitch_deg").
        axis: the instrument's name for it ("pitch").
        overtravel: distance beyond the planned side of approach, if the axis cannot arrive from that side directly; in
            the factor's unit, more than backlash and hysteresis together.
        hard: whether it is hard to change: it is constant in a whole plot, and every change draws a new whole-plot
            error.
        stays: whether an axis already at a point's setpoint is not moved; if the error belongs to the setting, as with
            a pressure, it is set again.
    """

    name: str
    axis: str
    overtravel: float = 0.0
    hard: bool = False
    stays: bool = True

    @property
    def set_name(self) -> str:
        """Name of its setpoint if there is also a measured value ("pressure_set_psia")."""
        return with_word(self.name, "set")


@dataclass(frozen=True, slots=True)
class Settle:
    """Criterion for the arrival of a quantity; in its own unit, drift per second."""

    band: float
    dwell_s: float
    drift_per_s: float
    timeout_s: float


@dataclass(frozen=True, slots=True)
class Point:
    """One setting of all factors at which the sensors are read once.

    Attributes:
        index: position in the run list, from 0.
        replication: number of the pass over the design, from 1.
        whole_plot: number of its group of points with common hard-to-change factors; None if no factor is hard to
            change.
        setpoints: one value per factor, in the factors' units.
        sides: direction of approach per factor: +1 upwards, -1 downwards, 0 for any.
    """

    index: int
    replication: int
    whole_plot: int | None
    setpoints: tuple[float, ...]
    sides: tuple[int, ...]


_AT_ONCE = 256
"""Number of points added together: more would burden the garbage collector."""

_TEXTS_KEPT = 10_000


class Points(Sequence[Point]):
    """Points in order, packed; each is created again at every access.

    Args:
        points: any number of them, numbered from 0.
        width: number of factors.

    Raises:
        ValueError: a point has a wrong number, or not one setpoint and one side for each factor.
    """

    def __init__(self, points: Iterable[Point], width: int) -> None:
        self.places: Coded[tuple[int, int | None]] = Coded()
        self.settings: tuple[Coded[tuple[float, int]], ...] = tuple(Coded() for _ in range(width))
        points = iter(points)
        while some := list(itertools.islice(points, _AT_ONCE)):
            if not _in_order(some, len(self), width):
                _refuse(some, len(self), width)
            self.places.extend([(point.replication, point.whole_plot) for point in some])
            for at, column in enumerate(self.settings):  # no -0.0, which a run file does not store
                column.extend([(point.setpoints[at] + 0.0, point.sides[at]) for point in some])

    def __len__(self) -> int:
        return len(self.places)

    @overload
    def __getitem__(self, index: int) -> Point: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Point, ...]: ...

    def __getitem__(self, index: int | slice) -> Point | tuple[Point, ...]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        if not 0 <= index < len(self.places):
            index = range(len(self))[index]
        replication, whole_plot = self.places[index]
        at = [column[index] for column in self.settings]
        return Point(index, replication, whole_plot, tuple([v for v, _ in at]), tuple([s for _, s in at]))

    def __iter__(self) -> Iterator[Point]:
        for index, (replication, whole_plot), *at in zip(itertools.count(), self.places, *self.settings, strict=False):
            yield Point(index, replication, whole_plot, tuple([v for v, _ in at]), tuple([s for _, s in at]))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Points):
            return NotImplemented
        return self.places == other.places and self.settings == other.settings

    __hash__ = None  # type: ignore[assignment]

    def span(self, whole_plot: int) -> tuple[int, int]:
        """First index and number of the points of a whole plot. Raises `KeyError`."""
        codes = [code for code, (_, number) in enumerate(self.places.levels) if number == whole_plot]
        if not codes:
            raise KeyError(f"the run list has no whole plot {whole_plot}")
        return min(self.places.first(code) for code in codes), sum(self.places.count(code) for code in codes)

    def rows(self) -> Iterator[tuple[Any, ...]]:
        """Every point as (index, replication, whole plot, setpoints..., sides...)."""
        for index, place, *at in zip(itertools.count(), self.places, *self.settings, strict=False):
            yield (index, *place, *[value for value, _ in at], *[side for _, side in at])


def _in_order(points: list[Point], first: int, width: int) -> bool:
    widths = {len(point.setpoints) for point in points} | {len(point.sides) for point in points}
    return widths == {width} and [point.index for point in points] == list(range(first, first + len(points)))


def _refuse(points: list[Point], first: int, width: int) -> None:
    for position, point in enumerate(points, first):
        if point.index != position:
            raise ValueError(f"point {position} of the run list is numbered {point.index}")
        if len(point.setpoints) != width or len(point.sides) != width:
            raise ValueError(f"point {position} does not have one setpoint and one side for each factor")


@dataclass(frozen=True, init=False)
class RunList:
    """Points in order, with the data to generate the same list again.

    Attributes:
        factors: factors of `Point.setpoints`, in that order.
        points: the points, in running order.
        seed: of every random choice in the order.
        steps: what a person does by hand, in the order of their points.

    Example:
        >>> up = [Point(0, 1, None, (-1.0,), (+1,)), Point(1, 1, None, (1.0,), (+1,))]
        >>> RunList([Factor("pitch_deg", "pitch")], up, seed=1).points[1].setpoints
        (1.0,)
    """

    factors: tuple[Factor, ...]
    points: Points
    seed: int
    steps: tuple[HandStep, ...]

    def __init__(
        self, factors: Iterable[Factor], points: Iterable[Point], seed: int, steps: Iterable[HandStep] = ()
    ) -> None:
        """Add points one by one.

        Raises:
            ValueError: they are not numbered from 0, or lack a factor; or a step is out of order.
        """
        object.__setattr__(self, "factors", tuple(factors))
        object.__setattr__(self, "points", Points(points, len(self.factors)))
        object.__setattr__(self, "seed", seed)
        self._take(steps)

    def _take(self, steps: Iterable[HandStep]) -> None:
        steps = tuple(steps)
        before = [step.before for step in steps]
        if before != sorted(before) or not all(0 <= index < len(self.points) for index in before):
            raise ValueError("a step by hand is not before a point of the run list, or the steps are out of order")
        object.__setattr__(self, "steps", steps)

    def with_steps(self, steps: Iterable[HandStep]) -> Self:
        """This run list with other steps by hand. Raises ValueError if they are out of order."""
        made = copy.copy(self)
        made._take(steps)
        return made

    def __len__(self) -> int:
        return len(self.points)

    @property
    def easy(self) -> tuple[Factor, ...]:
        """The factors that change from point to point."""
        return tuple(f for f in self.factors if not f.hard)

    @property
    def hard(self) -> tuple[Factor, ...]:
        """The factors common to a whole plot."""
        return tuple(f for f in self.factors if f.hard)

    @cached_property
    def sided(self) -> tuple[Factor, ...]:
        """The factors whose side of approach is recorded: easy ones, and hard ones that have one planned."""
        columns = zip(self.factors, self.points.settings, strict=True)
        return tuple(f for f, column in columns if not f.hard or any(side for _, side in column.levels))

    @cached_property
    def whole_plots(self) -> int:
        """Number of planned whole plots; 0 if no factor is hard to change."""
        return len({whole_plot for _, whole_plot in self.points.places.levels} - {None})

    def factor(self, name: str) -> Factor:
        """The factor of that name. Raises `KeyError`."""
        return {f.name: f for f in self.factors}[name]

    def setting(self, point: Point) -> dict[str, float]:
        """Setpoints of a point by factor name."""
        return {f.name: value for f, value in zip(self.factors, point.setpoints, strict=True)}

    def told(self, point: Point) -> str:
        """Setpoints of a point for people.

        Example:
            >>> run_list = RunList([Factor("force_kN", "force")], [Point(0, 1, None, (3.0,), (0,))], seed=1)
            >>> run_list.told(run_list.points[0])
            'force 3 kN'
        """
        parts = ((*split_unit(name), value) for name, value in self.setting(point).items())
        return ", ".join(f"{stem.replace('_', ' ')} {value:g} {spelled(unit)}" for stem, unit, value in parts)

    def largest(self) -> dict[str, float]:
        """Largest magnitude of the setpoints, by factor name."""
        levels = zip(self.factors, self.points.settings, strict=True)
        return {f.name: max((abs(value) for value, _ in column.levels), default=0.0) for f, column in levels}

    def column(self, name: str) -> list[float]:
        """Setpoints of a factor, in order of the points."""
        at = [factor.name for factor in self.factors].index(name)
        return [value for value, _ in self.points.settings[at]]

    def replications(self) -> list[int]:
        """Replication of each point, in order of the points."""
        return [replication for replication, _ in self.points.places]

    def levels(self, factor: Factor) -> list[float]:
        """The different setpoints of a factor, in order of first appearance."""
        column = self.points.settings[self.factors.index(factor)]
        return list(dict.fromkeys(value for value, _ in column.levels))

    def sha256(self) -> str:
        """Hash of everything that determines the bench's actions; equal lists have equal hashes."""
        rows = self.points.rows()
        slices = iter(lambda: list(itertools.islice(rows, _AT_ONCE)), [])
        return rows_sha256(self.factors, self.seed, slices, self.steps)

    def extremes(self) -> Mapping[str, tuple[float, float]]:
        """Lowest and highest commanded value of each factor, with overtravel, by factor name."""
        found = {}
        for factor, column in zip(self.factors, self.points.settings, strict=True):
            reach = [at for value, side in column.levels for at in (value, value - side * factor.overtravel)]
            found[factor.name] = (min(reach), max(reach))
        return found

    def beyond(self, limits: Mapping[str, tuple[float, float]]) -> Iterator[str]:
        """Sentences for every factor that the list would command outside `limits` (low, high), by factor name."""
        for factor, column in zip(self.factors, self.points.settings, strict=True):
            if factor.name not in limits:
                continue
            low, high = limits[factor.name]
            for code, (value, side) in enumerate(column.levels):  # in order of first appearance
                start = value - side * factor.overtravel
                if not low <= value <= high:
                    at = column.first(code)
                    yield f"point {at} asks for {factor.name} = {value:g}, outside {low:g} to {high:g}"
                    break
                if not low <= start <= high:
                    yield (
                        f"point {column.first(code)} ({factor.name} = {value:g}) is approached from {start:g} "
                        f"(overtravel {factor.overtravel:g}), outside {low:g} to {high:g}"
                    )
                    break


def rows_sha256(
    factors: Sequence[Factor],
    seed: int,
    slices: Iterable[Sequence[tuple[Any, ...]]],
    steps: Sequence[HandStep] = (),
) -> str:
    """The hash of a run list with these points: of the JSON of [index, replication, whole plot, [setpoints], [sides]].

    Args:
        factors: factors of the setpoints, in that order.
        seed: of every random choice in the order.
        slices: the points in slices, each as (index, replication, whole plot, setpoints..., sides...).
        steps: what a person does by hand. A list without them has the hash of versions that knew none.
    """
    width = len(factors)
    places, settings = _Texts(_place_text), _Texts(lambda row: _setting_text(row, width))
    listed = [[f.name, f.axis, f.overtravel, f.hard, f.stays] for f in factors]
    head: dict[str, Any] = {"factors": listed, "seed": seed}
    if steps:
        head["by_hand"] = [step.as_json() for step in steps]
    digest = hashlib.sha256(json.dumps(head, sort_keys=True).encode())
    for rows in slices:
        text = "".join([f"[{row[0]}, {places[row[1:3]]}, {settings[row[3:]]}" for row in rows])
        digest.update(text.encode())
    return digest.hexdigest()


class _Texts(dict[tuple[Any, ...], str]):
    """Texts of different rows, created once and cached while they are few."""

    def __init__(self, text: Callable[[tuple[Any, ...]], str]) -> None:
        self._text = text

    def __missing__(self, row: tuple[Any, ...]) -> str:
        if len(self) >= _TEXTS_KEPT:
            self.clear()
        made = self[row] = self._text(row)
        return made


def _place_text(row: tuple[Any, ...]) -> str:
    return json.dumps(row)[1:-1]


def _setting_text(row: tuple[Any, ...], width: int) -> str:
    return json.dumps((row[:width], row[width:]))[1:]
