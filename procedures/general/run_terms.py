"""Columns of effects found in a run: as formulas, so that a later run has them too."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf, isfinite

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.sizes import each, size_with_95
from rig.fitter.trace.engine.term import TableTerm
from rig.procedures.general.effects import TableEffect
from rig.procedures.general.effects.columns import without_side
from rig.procedures.general.effects.literal import Rows, column
from rig.procedures.general.effects.time_columns import TIME_CONSTANT, of_start


@dataclass(frozen=True)
class Label:
    """One column of a term.

    Attributes:
        name: its formula.
    """

    name: str


@dataclass(frozen=True, eq=False)
class RunTerm:
    """One column of an effect in one sensor.

    Attributes:
        effect: the effect.
        term: the column.
        sensor: its output.
        block: the term of the first run.
        at: number of the column in it.
        slope: if not empty, it is the change of the whole block with the logarithm of its searched constant, its
            columns having these coefficients (in the first run).
    """

    effect: TableEffect
    term: Label
    sensor: str
    block: TableTerm
    at: int
    slope: tuple[float, ...] = ()

    def with_constant(self, value: float) -> RunTerm:
        """This column with another value of its searched constant."""
        assert self.block.profile is not None
        block = self.block.profile.at(value)
        return replace(self, term=Label(block.labels[self.at]), block=block, slope=())

    def constant_text(self, value: float, ends: tuple[float, float]) -> str:
        """A value of its searched constant with its 95 % interval, for people; open where the data set no end."""
        assert self.block.profile is not None
        name = self.block.profile.what or "constant"
        size = each("s" if name == TIME_CONSTANT else "")  # of runs, whose time is elapsed_s
        low, high = ends[0] or -inf, ends[1]
        known = [end for end in (low, high) if isfinite(end)]
        if not known:
            return f"{name} not determined: no value is too small or too large for these data"
        if isfinite(value) and value:
            return f"{name} {size_with_95(size, {name: value}, {name: (low, high)}, 1.0)}"
        word = "at least" if isfinite(low) else "at most"
        return f"{name} {word} {size({name: known[0]}, 1.0, {name: 0.1 * abs(known[0])})}"

    def column(self, rows: Rows) -> FloatArray:
        """(n,) its values in some rows."""
        if not self.slope:
            return column(self.block.labels[self.at], rows)
        assert self.block.profile is not None
        above, below, step = self.block.profile.around
        every = zip(self.slope, above.labels, below.labels, strict=True)
        change = np.asarray(sum(size * (column(a, rows) - column(b, rows)) for size, a, b in every))
        return change * (self.block.profile.value / step)


def columns_of(effect: TableEffect, block: TableTerm, sensor: str, sizes: FloatArray) -> Iterator[RunTerm]:
    """The columns of a term in a sensor, and its change with its searched constant: a search knows it about only.

    Args:
        effect: the effect.
        block: the term.
        sensor: its output.
        sizes: (d,) coefficients of its columns: one constant changes them all.
    """
    own = np.array([not (of_start(label) or without_side(label)) for label in block.labels])
    for at in np.flatnonzero(own).tolist():
        yield RunTerm(effect, Label(block.labels[at]), sensor, block, at)
    sizes = sizes * own
    if block.profile is not None and np.any(block.profile.value * block.profile.slopes @ sizes):
        label = Label(f"change with the constant of {block.labels[0]}")
        yield RunTerm(effect, label, sensor, block, 0, slope=tuple(sizes.tolist()))
