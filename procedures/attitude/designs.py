"""Pitch-roll experimental designs of NASA/TP-1999-209835, sections 4.1 and 7.

A design is a grid of pitch rows and roll columns of which some cells are kept; the order of visits is in
`rig.procedures.attitude.orders`.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import overload


class Cells(Sequence[tuple[int, int]]):
    """(row, column) of cells of a grid, row by row, packed: a full grid takes no memory, a part of it a few bytes per
    cell.

    Args:
        columns: of the grid.
        numbers: of the kept cells, counted row by row from 0.
    """

    def __init__(self, columns: int, numbers: range | Iterable[int]) -> None:
        self.columns = columns
        self.numbers = numbers if isinstance(numbers, range) else array("Q", numbers)

    def __len__(self) -> int:
        return len(self.numbers)

    @overload
    def __getitem__(self, index: int) -> tuple[int, int]: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[tuple[int, int], ...]: ...

    def __getitem__(self, index: int | slice) -> tuple[int, int] | tuple[tuple[int, int], ...]:
        if isinstance(index, slice):
            return tuple(divmod(number, self.columns) for number in self.numbers[index])
        return divmod(self.numbers[index], self.columns)

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return (divmod(number, self.columns) for number in self.numbers)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Cells):
            return NotImplemented
        return (self.columns, list(self.numbers)) == (other.columns, list(other.numbers))

    def __hash__(self) -> int:
        return hash((self.columns, len(self)))


LISTED = "points"
"""Name of designs whose points are visited in the order of their list."""


@dataclass(frozen=True)
class Design:
    """Angles to visit.

    Attributes:
        name: the paper's name for it: D, D0, D1, T6, T4; or `LISTED`.
        pitch_deg: the pitch rows, ascending.
        roll_deg: the roll columns, ascending.
        cells: (row, column) of each kept point, row by row; of listed points in the order of the list.
    """

    name: str
    pitch_deg: tuple[float, ...]
    roll_deg: tuple[float, ...]
    cells: Sequence[tuple[int, int]]

    def __len__(self) -> int:
        return len(self.cells)

    def points_deg(self) -> list[tuple[float, float]]:
        """(pitch, roll) of each point, in the order of `cells`."""
        return [(self.pitch_deg[row], self.roll_deg[column]) for row, column in self.cells]


def uniform(low: float, high: float, count: int) -> tuple[float, ...]:
    """`count` equally spaced values from `low` to `high`, both included, without accumulated rounding."""
    if count < 1:
        raise ValueError(f"a design needs at least one value, not {count}")
    if count == 1:
        if low != high:
            raise ValueError(f"one value cannot span {low:g} to {high:g}")
        return (low,)
    return tuple(round(low + (high - low) * i / (count - 1), 9) for i in range(count))


def roll_circle(count: int, *, repeat_180: bool) -> tuple[float, ...]:
    """`count` roll angles uniform over the circle from -180 deg (design D0).

    Args:
        count: number of angles, the repeated one included.
        repeat_180: whether the last angle is +180 deg, the same attitude as -180 deg (the paper's figure 5: easier to
            run and insignificantly different).
    """
    if repeat_180:
        return uniform(-180.0, 180.0, count)
    return tuple(round(-180.0 + 360.0 * i / count, 9) for i in range(count))


def grid(name: str, pitch_deg: Sequence[float], roll_deg: Sequence[float]) -> Design:
    """Full design: every pitch with every roll (eq. 11).

    Raises:
        ValueError: an angle occurs twice in one list; +180 and -180 deg count as two commands.
    """
    for what, values in (("pitch", pitch_deg), ("roll", roll_deg)):
        if len(set(values)) != len(values):
            raise ValueError(f"the {what} angles of a design must differ from one another")
        if not values:
            raise ValueError(f"a design needs at least one {what} angle")
    rows, columns = tuple(sorted(pitch_deg)), tuple(sorted(roll_deg))
    return Design(name, rows, columns, Cells(len(columns), range(len(rows) * len(columns))))


def listed(points_deg: Sequence[tuple[float, float]]) -> Design:
    """The given (pitch, roll) in this order, cells of a grid of all angles. Raises ValueError if one is there twice."""
    if len(set(points_deg)) != len(points_deg):
        raise ValueError("a point is listed twice: more replications visit every point again")
    rows, columns = (tuple(sorted({point[axis] for point in points_deg})) for axis in (0, 1))
    row, column = ({angle: k for k, angle in enumerate(angles)} for angles in (rows, columns))
    numbers = [row[pitch] * len(columns) + column[roll] for pitch, roll in points_deg]
    return Design(LISTED, rows, columns, Cells(len(columns), numbers))


def tumble(*, roll: bool) -> Design:
    """Design T: the cardinal angles only, six points with roll (eq. 56) or four without (eq. 57)."""
    rows, columns = (-90.0, 0.0, 90.0, 180.0), (-90.0, 0.0, 90.0)
    upright = tuple((row, 1) for row in range(4))
    if not roll:
        return Design("T4", rows, (0.0,), tuple((row, 0) for row in range(4)))
    return Design("T6", rows, columns, tuple(sorted((*upright, (1, 0), (1, 2)))))


def fraction(full: Design, *, pitch_every: int, roll_every: int) -> Design:
    """Decimate the interior of a full grid (eq. 109, figure 21): boundaries and every k-th line are complete.

    Args:
        full: an N x M grid.
        pitch_every: keep every K_alpha-th pitch row whole; N - 1 must be a multiple of it.
        roll_every: keep every K_R-th roll column whole; M - 1 must be a multiple of it.

    Returns:
        The N((M-1)/K_R + 1) + (M-1)(1 - 1/K_R)((N-1)/K_alpha + 1) points of eq. (109).
    """
    n, m = len(full.pitch_deg), len(full.roll_deg)
    if len(full) != n * m:
        raise ValueError("only a full grid can be decimated")
    for what, lines, every in (("pitch", n, pitch_every), ("roll", m, roll_every)):
        if every < 1 or (lines - 1) % every:
            raise ValueError(
                f"cannot keep every {every}th of {lines} {what} angles with both ends: {lines} - 1 is not a multiple"
            )
    kept = (i * m + j for i, j in full.cells if i % pitch_every == 0 or j % roll_every == 0)
    return replace(full, cells=Cells(m, kept))
