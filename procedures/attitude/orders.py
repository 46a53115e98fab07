"""Order of the points of a design, and direction of approach to each angle.

The order determines the separable effects. With the same path in every replication, time and direction are functions of
the point and are confounded with lack of fit. So the path is walked forwards and backwards in the pattern A B B A,
which balances both against the replications. A random order removes all such confounding, but only if the direction of
approach is random too and controlled, instead of given by the previous point.
"""

from __future__ import annotations

import random
from array import array
from collections.abc import Iterator
from dataclasses import dataclass

from rig.procedures.attitude.designs import LISTED, Design


@dataclass(frozen=True, slots=True)
class Visit:
    """One visit of a pass over a design: the cell, and the direction of approach of each axis (+1 upwards)."""

    row: int
    column: int
    pitch_side: int
    roll_side: int


def reversed_pass(replication: int, pattern: str) -> bool:
    """Whether a replication follows the path backwards.

    Args:
        replication: from 1.
        pattern: "abba" (forwards, backwards, backwards, forwards, and again), "alternate" (a, b, a, b) or "same"
            (never).
    """
    if pattern == "same":
        return False
    if pattern == "alternate":
        return replication % 2 == 0
    if pattern == "abba":
        return replication % 4 in (2, 3)
    raise ValueError(f"unknown pattern {pattern!r}: use abba, alternate or same")


def walk(design: Design, *, backwards: bool, up_and_down: bool) -> Iterator[Visit]:
    """Boustrophedon pass: pitch row after row, roll to and fro (recommendation 4 of the paper); or the list of points.

    Args:
        design: the points.
        backwards: the same path from its end, with every axis arriving from the other side.
        up_and_down: return to the first row, with a second visit to every point from its other side; otherwise one pass
            goes up and reversed replications go down. Backwards it is the same path.
    """
    if up_and_down or not backwards:
        yield from _sweep(design, 1)
    if up_and_down or backwards:
        yield from _sweep(design, -1)


def _listed(design: Design, way: int) -> Iterator[Visit]:
    """Listed points in their order (way 1), or from the end; an axis is approached in the direction of its motion."""
    cells = design.cells[::way]
    sides = (way, way)
    for before, cell in zip((cells[0], *cells), cells, strict=False):
        moves = (cell[0] - before[0], cell[1] - before[1])
        sides = (_side(moves[0], sides[0]), _side(moves[1], sides[1]))
        yield Visit(*cell, *sides)


def _side(move: int, before: int) -> int:
    """Direction of a motion; without one that of the motion before."""
    return before if move == 0 else (1 if move > 0 else -1)


def _sweep(design: Design, way: int) -> Iterator[Visit]:
    """From the first row to the last (way 1), or the same path from its end (way -1)."""
    if design.name == LISTED:
        yield from _listed(design, way)
        return
    by_row: dict[int, array[int]] = {}
    for row, column in design.cells:
        by_row.setdefault(row, array("L")).append(column)
    rows: list[tuple[int, bool]] = []
    right = True
    for row in sorted(by_row):
        rows.append((row, right))
        right ^= len(by_row[row]) > 1
    for row, right in rows[::way]:
        forwards = right == (way == 1)
        side = 1 if forwards else -1
        for column in sorted(by_row[row], reverse=not forwards):
            yield Visit(row, column, way, side)


def random_order(design: Design, rng: random.Random) -> Iterator[Visit]:
    """Every point once in random order, each axis approached from a random side, with equal numbers of both sides."""
    cells = array("L", range(len(design)))
    rng.shuffle(cells)
    pitch_sides, roll_sides = (array("b", (1 if i % 2 else -1 for i in range(len(cells)))) for _ in range(2))
    rng.shuffle(pitch_sides)
    rng.shuffle(roll_sides)
    for number, pitch_side, roll_side in zip(cells, pitch_sides, roll_sides, strict=True):
        row, column = design.cells[number]
        yield Visit(row, column, pitch_side, roll_side)
