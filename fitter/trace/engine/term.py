"""Columns of an effect, and their searched constants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, log

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray

_STEP = 1e-3
"""Step of a searched constant for derivatives, as a share of it; near zero, of a quarter of what the search leaves
open."""


@dataclass(frozen=True, eq=False)
class Profile:
    """A searched constant of a term.

    Attributes:
        value: of this term.
        low: and
        high: limits beyond which the neighbouring terms of the search are used.
        at: the term for another value.
        constants: number of constants that are searched in this way, one after the other.
        what: name of the constant for people, if it has one: "time constant".
    """

    value: float
    low: float
    high: float
    at: Callable[[float], TableTerm]
    constants: int = 1
    what: str = ""

    def rows(self, kept: IntArray) -> Profile:
        """The same for some of the rows."""
        return replace(self, at=lambda value: self.at(value).rows(kept))

    @property
    def each(self) -> tuple[Profile, ...]:
        """The profile of every constant of the term, this one first: that of the other is in the term that it gives."""
        other = self.at(self.value).profile if self.constants > 1 else None
        return (self,) if other is None else (self, other)

    @cached_property
    def around(self) -> tuple[TableTerm, TableTerm, float]:
        """The terms for a value a little above and a little below this one, and the difference of these values."""
        step = _STEP * max(abs(self.value), 0.25 * (self.high - self.low))
        return self.at(self.value + step), self.at(self.value - step), 2.0 * step

    @property
    def slopes(self) -> FloatArray:
        """(n, d) change of the term's columns with the constant."""
        above, below, step = self.around
        return np.asarray((above.columns - below.columns) / step)


@dataclass(frozen=True, eq=False)
class TableTerm:
    """One block of columns.

    Attributes:
        labels: a formula for each column.
        columns: (n, d).
        profile: the constant it was searched over; None where it has none.
        of_levels: each column is of one level of a group, and only rows of that level tell its coefficient.

    """

    labels: tuple[str, ...]
    columns: FloatArray
    profile: Profile | None = None
    of_levels: bool = False

    @property
    def name(self) -> str:
        """All its formulas."""
        return ", ".join(self.labels)

    def rows(self, kept: IntArray, columns: FloatArray | None = None) -> TableTerm:
        """The same for some of the rows, with these `columns` if they are known."""
        columns = self.columns[kept] if columns is None else columns
        return replace(self, columns=columns, profile=self.profile and self.profile.rows(kept))

    @cached_property
    def price(self) -> int:
        """Columns it spends, a searched constant counted as one.

        Schwarz' price of a column is the logarithm of the rows that tell its coefficient. Of a level these are its own
        and not all: as random effects levels cost no more (Pauler, Biometrika 85 (1998) 13). So a column of one row,
        beside others, costs nothing.
        """
        n, width = (int(size) for size in self.columns.shape)
        of_one_row = int(np.sum(np.count_nonzero(self.columns, axis=0) == 1))
        if self.of_levels and width > 0 and n > 1:
            own = max(n / (width + 1), 2.0)
            return max(ceil(width * log(own) / log(n)), 1)
        return max(width - of_one_row, min(width, 1)) + (0 if self.profile is None else self.profile.constants)
