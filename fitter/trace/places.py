"""Places for a shape without a name: columns over recorded quantities, and what they are drawn over."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.flexible import Block, halves, orders_of, waves
from rig.fitter.trace.shape import Axis

TRIED = (3, 6, 12)
"""Numbers of columns that are tried together."""
Axes = tuple[Axis, Axis | None]
"""The variable over which a place is drawn, and a second one."""


@dataclass(frozen=True, eq=False)
class Place:
    """Columns that a residual may follow.

    Columns are made when they are used: those of all places would take 15 MB of 2,886 points.

    Attributes:
        text: in words: "over the pitch angle".
        columns: makes (n, m) columns, the slowest first; for all sensors (S n, m), those of the first sensor first.
        orders: numbers of columns that are tried together, ascending.
        roughness: (m,) number of half waves of each.
        axes: what it is drawn over in a sensor.
        level: level of its judgement; "" where there is one only.
        sensor: index of the sensor that has these columns; None for all, or for each.
        finer: makes more waves (n, M) of a curve over one variable, to draw it.
        variables: names of the variables in these columns, where they have names.
        curve: the variable of a curve; None for other shapes.
        timed: whether it uses the order of rows.
        remembers: whether it is of the rows before, as hysteresis and settling are, wherever it is judged.
        slopes: whether it is a shape of sensitivities, which may be new in each group of rows.
        alternatives: number of places that differ only in a direction or a level that is picked.

    Example:
        >>> u = np.linspace(0.0, 1.0, 9)
        >>> place = smooth("over u", waves(u, 4), lambda _i: (Axis("u", "u", "", u), None))
        >>> place.orders, place.roughness.tolist()
        ((3, 4), [1.0, 2.0, 3.0, 4.0])

    """

    text: str
    columns: Callable[[], FloatArray]
    orders: tuple[int, ...]
    roughness: FloatArray
    axes: Callable[[int], Axes | None]
    level: str = ""
    sensor: int | None = None
    finer: Callable[[], FloatArray] | None = None
    variables: frozenset[str] = frozenset()
    curve: str | None = None
    timed: bool = False
    remembers: bool = False
    slopes: bool = False
    alternatives: int = 1

    @classmethod
    def of(cls, block: Block, axes: Callable[[int], Axes | None], **more: Any) -> Place:
        """The place of a block that is at hand; `more` are attributes."""
        return cls(block.place, lambda: block.columns, block.orders, block.roughness, axes, **more)

    @property
    def block(self) -> Block:
        """Its columns, made now."""
        return Block(self.text, self.columns(), self.orders, self.roughness)

    @property
    def fine(self) -> Place:
        """The same with as many waves as it is drawn with: more than are tested."""
        if self.finer is None:
            return self
        columns = self.finer()
        return replace(self, columns=lambda: columns, roughness=halves(columns))


def smooth(
    text: str,
    columns: FloatArray,
    axes: Callable[[int], Axes | None],
    rough: FloatArray | None = None,
    tried: Sequence[int] = TRIED,
    **more: Any,
) -> Place:
    """A place of smooth columns (n, m), by default waves, in the usual orders; `more` are attributes."""
    rough = halves(columns) if rough is None else rough
    return Place.of(Block(text, columns, orders_of(columns, tried), rough), axes, **more)


def as_one(text: str, columns: FloatArray, axes: Callable[[int], Axes | None], **more: Any) -> Place:
    """A place of columns (n, m) that are tried all together."""
    count = columns.shape[1]
    return Place.of(Block(text, columns, orders_of(columns, (count,)), np.ones(count)), axes, **more)


def products(
    one: FloatArray, other: FloatArray, rough: tuple[FloatArray, FloatArray] | None = None
) -> tuple[FloatArray, FloatArray]:
    """(n, p q) products of columns (n, p) and (n, q), the slowest first, and their roughness.

    Args:
        one: columns.
        other: columns.
        rough: roughness of both, by default that of waves.

    """
    first, second = (halves(one), halves(other)) if rough is None else rough
    pairs = sorted((first[i] + second[j] - 1.0, i, j) for i in range(one.shape[1]) for j in range(other.shape[1]))
    if not pairs:
        return np.empty((len(one), 0)), np.empty(0)
    return np.column_stack([one[:, i] * other[:, j] for _, i, j in pairs]), np.array([r for r, _, _ in pairs])


def since(group: IntArray, values: FloatArray) -> FloatArray:
    """(n,) values less the first, that is the smallest, of each group."""
    first = np.full(int(group.max()) + 1, np.inf)
    np.minimum.at(first, group, values)
    return np.asarray(values - first[group])


def centred(v: FloatArray) -> FloatArray:
    """(n,) between -1 and 1; zero where it is constant."""
    half = 0.5 * float(np.ptp(v))
    return np.asarray((v - 0.5 * (v.min() + v.max())) / half if half > 0 else np.zeros_like(v))


def finer(values: FloatArray, most: int) -> Callable[[], FloatArray]:
    """Makes so many waves over a variable (n,)."""
    return lambda: waves(values, most)
