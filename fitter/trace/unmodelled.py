"""Shapes without a name in a run of any kind, and a comparison of each name found with them.

A kind says where a residual is looked at, in which metric, and what it weighs for a name and for a shape without one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.trace.doubts import BUNDLE, DOUBT, bundle, in_several, no_better, several_values, something_left
from rig.fitter.trace.flexible import Block, Remainder, remainders
from rig.fitter.trace.limits import Kind, limit
from rig.fitter.trace.lines import Line
from rig.fitter.trace.places import Place
from rig.fitter.trace.search import names_of
from rig.fitter.trace.shape import Name

LEAST_DF = 3
"""Degrees of freedom of a residual in which shapes are looked for, at least."""


class Seen(NamedTuple):
    """A residual where a place is judged.

    Attributes:
        y: (m,) in the metric of its errors.
        df: its degrees of freedom.
        project: removes the model from columns, and gives them in that metric.

    """

    y: FloatArray
    df: int
    project: Callable[[FloatArray], FloatArray]

    def remainder(self, block: Block) -> Remainder | None:
        """Its part along a block; None where nothing is left of that."""
        found = remainders(self.y, self.df, [block], self.project) if self.df >= LEAST_DF else []
        return next(iter(found), None)


class Phase(NamedTuple):
    """Rows of a period, to draw it.

    Attributes:
        left: (n,) residual.
        at: (n,) time, number or setting of each row.
        period: in the unit of `at`.
        unit: of `at`.
        level: at which it is judged.

    """

    left: FloatArray
    at: FloatArray
    period: float
    unit: str
    level: str = ""


@dataclass(frozen=True, eq=False)
class ResidualShape:
    """A shape that a residual still follows.

    Attributes:
        place: its place.
        remainder: its part of the residual; without the basis: those of all places would be a fifth of all memory.
        p: over all places, orders and sensors.
        where: its place in words, with its level.
        sensor: index of the sensor that follows it; None for all.
        sensors: how many are in the remainder, one after the other.
        detail: more about it, in words behind its place.

    """

    place: Place
    remainder: Remainder
    p: float
    where: str
    sensor: int | None = None
    sensors: int = 1
    detail: str = ""

    def shows_in(self, i: int) -> bool:
        """Whether sensor `i` has a part in it."""
        if self.sensor is not None:
            return self.sensor == i
        square = np.sum(self.remainder.shape.reshape(self.sensors, -1) ** 2, axis=1)
        return self.sensors == 1 or bool(square[i] > 0.1 * square.max())


class Group(NamedTuple):
    """Names found that are seen together, at a level and in a sensor, where a kind has several."""

    names: tuple[str, ...]
    level: str = ""
    sensor: int | None = None


class Unmodelled(ABC):
    """A run beside what was found.

    Attributes:
        chosen: candidates in the model.
        kind: of the limits.
        unit: of the response.
        alone: whether each of several names is also compared by itself.

    """

    chosen: tuple[int, ...]
    kind: ClassVar[Kind]
    unit: ClassVar[str]
    alone: ClassVar[bool] = True

    @property
    @abstractmethod
    def candidates(self) -> Sequence[Any]:
        """All candidates."""

    @property
    @abstractmethod
    def able(self) -> bool:
        """Whether the residual is more than rounding."""

    @property
    @abstractmethod
    def places(self) -> tuple[Place, ...]:
        """All places for a remainder."""

    def asked(self, place: Place) -> Iterable[int]:
        """Sensors in which a place is looked at; of one that all share, the first stands for all."""
        return (place.sensor or 0,)

    @abstractmethod
    def seen(self, place: Place, i: int) -> Seen:
        """The residual of a sensor, or of all, at a place."""

    @abstractmethod
    def plain(self, place: Place, i: int) -> tuple[FloatArray, FloatArray]:
        """(n,) residual of a sensor and (n, m) columns of a place as the model leaves them, in the response's unit."""

    @abstractmethod
    def phase(self, found: Line, i: int) -> Phase | None:
        """Rows of a period of a sensor, to draw it; None without their times."""

    @property
    def harmonics(self) -> int:
        """Harmonics of a period that its shape may have."""
        return int(limit("harmonics", self.kind))

    @abstractmethod
    def near(self, place: Place, i: int) -> Iterator[Name]:
        """Names that a shape at a place may be, beside what was found."""

    @abstractmethod
    def held_against(self, place: Place, i: int, one: Remainder) -> float:
        """P by chance beside errors that are slower than the likeliest."""

    def worded(self, place: Place) -> str:
        """A place in words, with its level."""
        return place.text

    @abstractmethod
    def stratum(self, place: Place) -> str:
        """Where a shape at a place is seen."""

    @abstractmethod
    def without(self, names: tuple[str, ...]) -> Self:
        """The same run beside all effects found but those of some names."""

    @cached_property
    def tests(self) -> int:
        """Number of tests of all places."""
        return sum(len(place.orders) for place in self.places for _ in self.asked(place))

    @cached_property
    def left(self) -> tuple[ResidualShape, ...]:
        """Places that the residual follows, the most significant first."""
        found = ties.ordered(self._followed() if self.able else (), key=lambda one: -one.remainder.share, unit=1.0)
        return tuple(ties.ordered(found, key=lambda one: one.p))

    def _followed(self) -> Iterator[ResidualShape]:
        again = limit("asked again", self.kind)
        for place in self.places:
            for i in self.asked(place):
                seen = self.seen(place, i)
                found = remainders(seen.y, seen.df, [place.block], seen.project) if seen.df >= LEAST_DF else []
                for one in found:
                    p = one.p if one.p * self.tests >= again else max(one.p, self.held_against(place, i, one))
                    yield self._shape(place, i, replace(one, basis=np.empty((0, 0))), min(p * self.tests, 1.0))

    def _shape(self, place: Place, i: int, one: Remainder, p: float) -> ResidualShape:
        return ResidualShape(place, one, p, self.worded(place), i)

    def left_in(self, i: int, level: str | None = None) -> ResidualShape | None:
        """The most significant remainder of one sensor, at one level or any."""
        return next((one for one in self.left if level in (None, one.place.level) and one.shows_in(i)), None)

    def of(self, name: str) -> list[int]:
        """Candidates in the model of one name."""
        return [j for j in self.chosen if self.candidates[j].effect.name == name]

    def owners(self, mine: Iterable[Any]) -> tuple[str, ...]:
        """Sensors that have some candidates each for itself."""
        return tuple(dict.fromkeys(c.sensor for c in mine if c.sensor is not None))

    # Reasons for doubt: what a kind weighs.

    def groups(self) -> Iterable[Group]:
        """Names found, those together that are seen together."""
        return [Group(tuple(names_of(self.candidates, self.chosen)))] if self.chosen else []

    @abstractmethod
    def left_beside(self, name: str, group: Group) -> str | None:
        """Sentence about a shape that is left where a name is seen; None where none is."""

    def of_kind(self, group: Group) -> Iterator[tuple[Sequence[str], str]]:
        """Names and reasons that only one kind of run has."""
        return iter(())

    def of_levels(self, name: str) -> bool:
        """Whether a name says that levels of a recorded group differ: each of them is seen in its own rows."""
        return False

    def values_of(self, name: str) -> int:
        """Number of values of a searched constant, if a name has too many for one cause; else 0."""
        return 0

    def over_one(self, group: Group) -> Iterator[tuple[str, str]]:
        """Pairs of names over one variable that together take any shape."""
        return iter(())

    def several(self, name: str) -> tuple[str, ...]:
        """Sensors that have a name each for itself, where one cause of all is likelier; () elsewhere."""
        return ()

    def plain_names(self, names: Sequence[str]) -> bool:
        """Whether names together have no searched constant, and no function that many others are like."""
        return False

    def lead(self, names: Sequence[str]) -> float:
        """Minimum lead of some names over a shape without one, nats."""
        return limit(f"lead of a {'plain ' * self.plain_names(names)}name", self.kind)

    @abstractmethod
    def earned(self, names: Sequence[str], group: Group) -> tuple[float, float, str]:
        """Evidence for names of a group, nats; the best for one shape without a name; and where that lives."""

    def each(self, group: Group) -> dict[str, str]:
        """Reasons for doubt about single names of several, each beside the others."""
        out = {}
        for name in group.names:
            named, nameless, where = self.earned([name], group)
            if named - nameless < self.lead([name]):
                out[name] = no_better([name], where)
        return out

    @cached_property
    def doubts(self) -> dict[str, str]:
        """Reasons for doubt about the names found, by name."""
        out: dict[str, str] = {}
        for group in self.groups() if self.able else ():
            out |= self.doubts_in(group)
        return out

    def doubts_in(self, group: Group) -> dict[str, str]:
        """Reasons for doubt about the names of a group: of each the first in this order, in every kind of run."""
        names, out = group.names, dict[str, str]()
        for name in names:
            if (why := self.left_beside(name, group)) is not None:
                out[name] = why
        for some, why in self.of_kind(group):
            out = dict.fromkeys(some, why) | out
        for name in names:
            if (count := self.values_of(name)) > 1:
                out.setdefault(name, several_values(count))
        for pair in self.over_one(group):
            out = dict.fromkeys(pair, bundle(pair)) | out
        for name in names:
            if len(sensors := self.several(name)) > 1:
                out.setdefault(name, in_several(sensors))
        parts = [name for name in names if not self.of_levels(name)]
        if len(parts) >= BUNDLE:
            out = dict.fromkeys(parts, bundle(parts)) | out
        if any(name not in out for name in names):
            named, nameless, where = self.earned(names, group)
            if named - nameless < self.lead(names):
                out = dict.fromkeys(names, no_better(names, where)) | out
        return self.each(group) | out if self.alone and len(names) > 1 else out


def told(found: ResidualShape | None) -> str | None:
    """Sentence about a shape that is left; None where that is no doubt."""
    return something_left(found.place.text, found.p) if found is not None and found.p < DOUBT else None


def nameless(
    groups: Sequence[Sequence[tuple[Place, int]]], evidence: Callable[[Place, int], float]
) -> tuple[float, str]:
    """The best evidence, in nats, for one shape without a name, and where that lives.

    Args:
        groups: places and sensors, together those of one shape.
        evidence: for a place in a sensor.

    """
    kinds, best, where = sum(1.0 / group[0][0].alternatives for group in groups), -np.inf, ""
    for group in groups:
        first = group[0][0]
        total = -float(np.log(kinds * first.alternatives))
        for place, i in group:
            total += evidence(place, i)
        if ties.below(best, total):
            best, where = total, first.text
    return float(best), where
