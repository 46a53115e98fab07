"""Values for the columns of effects in a table: settings, covariates, groups, time, direction."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil, log
from typing import NamedTuple

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.effects.entry import Entry
from rig.fitter.errors import FitError

_TEMPERATURE = re.compile(r"temp|deg_?c$|(^|[_.])t_?c$|_c$|_k$|oven|ambient|^t[0-9]?$", re.IGNORECASE)
_ANGLE = re.compile(r"deg(?!_?[cfk]$)|angle|azimuth|theta|phi$", re.IGNORECASE)
_UNITS = (
    (re.compile(r"year|(^|_)yr$|(^|_)a$", re.IGNORECASE), 365.25 * 86400.0),
    (re.compile(r"day|(^|_)d$|date", re.IGNORECASE), 86400.0),
    (re.compile(r"hour|(^|_)hr?$", re.IGNORECASE), 3600.0),
    (re.compile(r"min(utes?)?$", re.IGNORECASE), 60.0),
    (re.compile(r"sec|(^|_)s$", re.IGNORECASE), 1.0),
)
APART, WITHIN, ROWS_OF_LEVEL = 1.0 / 200.0, 1.0 / 100.0, 3
"""Levels of a setting: least distance and largest deviation, as shares of its range, and fewest rows of one on
average."""
_STEP = 1e-3
"""Step of a searched constant for derivatives, as a share of it; near zero, of a quarter of what the search leaves
open."""
CYCLES = {"annual": 365.25 * 86400.0, "daily": 86400.0}
"""Periods with names, tested if the time covers them, seconds."""


def is_temperature(name: str) -> bool:
    """Whether a column is a temperature, by its name."""
    return bool(_TEMPERATURE.search(name))


def is_angle(name: str, values: FloatArray) -> bool:
    """Whether a column is an angle in degrees over most of a turn, by its name and range."""
    return bool(_ANGLE.search(name)) and 270.0 <= float(np.ptp(values)) <= 4000.0


def at_levels(v: FloatArray) -> FloatArray:
    """(n,) values of a setting (n,); where they scatter a little about a few levels, the mean of each level.

    What has few levels resolves few waves, however finely its values were read.
    """
    step = np.diff(np.sort(v))
    number = np.searchsorted(np.sort(v)[1:][step > APART * np.ptp(v)], v, side="right")
    count = np.bincount(number)
    if count.size > len(v) // ROWS_OF_LEVEL:
        return v
    means = (np.bincount(number, v) / count)[number]
    off = np.abs(v - means).max()
    return v if off > WITHIN * np.ptp(v) or off <= 1e-9 * np.ptp(v) else np.asarray(means)


def seconds_per_unit(name: str) -> float | None:
    """Unit of a column of time in seconds, by its name; None if unknown."""
    return next((unit for pattern, unit in _UNITS if pattern.search(name)), None)


@dataclass(frozen=True, eq=False)
class Grouping:
    """A column of groups of rows.

    Attributes:
        levels: ascending.
        index: (n,) level of each row.
        declared: whether the declared model has it as a category.
    """

    levels: tuple[str, ...]
    index: IntArray
    declared: bool = False

    @cached_property
    def indicators(self) -> FloatArray:
        """(n, levels) one where a row is at that level."""
        return np.asarray(self.index[:, None] == np.arange(len(self.levels)), np.float64)


@dataclass(frozen=True, eq=False)
class Timeline:
    """Times of the rows, ascending.

    Attributes:
        name: of the column, or "row" if the order of rows replaces it.
        values: (n,) in units of the column.
        unit_s: seconds per unit; None where unknown.
        presumed: whether the order of measurement is only assumed, or the column only counts rows; then drift and
            correlation of neighbours can be tested, but no effects that need a clock.
    """

    name: str
    values: FloatArray
    unit_s: float | None = None
    presumed: bool = False


class Stood(NamedTuple):
    """How a setting came to be: what it came from, and how long it had stood when each row was read.

    Attributes:
        since: (n,) time, in seconds or the unit of the time.
        start: (n,) the value before the move; None if it is that of the row before.
    """

    since: FloatArray
    start: FloatArray | None

    def on(self, origin: float, unit: float = 1.0) -> Stood:
        """With all values on another scale."""
        return self if self.start is None else self._replace(start=(self.start - origin) / unit)


@dataclass(frozen=True, eq=False)
class TableScene:
    """A table by the roles of its columns.

    Attributes:
        settings: (n,) variables of the declared model, and functions of them in it, such as logarithms.
        covariates: (n,) other columns of numbers.
        groups: groupings whose offset or gain may be missing, and the declared model's categories.
        time: None if the times are unknown.
        direction: name and (n,) +1, -1 or 0 for the direction of approach of a setting; None if unknown.
        speed: name and (n,) velocity, if the direction is given by one.
        setpoints: (n,) what was asked for, of settings whose value a reference standard read.
        own: the laboratory's own effects that the table can be tested for.
        labels: columns of text without a role, whose levels repeat; shapes without a name and coarse rounding are
            looked for by them, but no effects.
        moves: how each variable came to its setting, in seconds, where that is known.
        constant: whether the declared model has a constant, in whatever columns.
        functions: settings that are functions of columns in the declared model; these columns are settings, too.
    """

    settings: Mapping[str, FloatArray]
    covariates: Mapping[str, FloatArray]
    groups: Mapping[str, Grouping]
    time: Timeline | None
    direction: tuple[str, FloatArray] | None
    speed: tuple[str, FloatArray] | None = None
    setpoints: Mapping[str, FloatArray] = field(default_factory=dict)
    own: tuple[Entry, ...] = ()
    labels: Mapping[str, Grouping] = field(default_factory=dict)
    moves: Mapping[str, Stood] = field(default_factory=dict)
    constant: bool = True
    functions: frozenset[str] = frozenset()

    @property
    def variables(self) -> dict[str, FloatArray]:
        """Settings and covariates."""
        return {**self.settings, **self.covariates}

    @property
    def quantities(self) -> dict[str, FloatArray]:
        """(n,) recorded numbers that differ between rows, without functions of them."""
        return {name: v for name, v in self.variables.items() if name not in self.functions and np.ptp(v) > 0}

    def stood(self, name: str) -> Stood | None:
        """How a variable came to its setting, in the unit of the time; None if it is not known."""
        if name not in self.moves or self.time is None or self.time.unit_s is None:
            return None
        since, start = self.moves[name]
        return Stood(since / self.time.unit_s, start)

    def of(self, name: str) -> FloatArray:
        """(n,) values of a setting, a covariate or the time."""
        if self.time is not None and name == self.time.name:
            return self.time.values
        return self.variables[name]

    @cached_property
    def bits(self) -> tuple[str, ...]:
        """Settings and covariates with values zero or one; () for fewer than two."""
        names = tuple(name for name, v in self.variables.items() if set(np.unique(v)) == {0.0, 1.0})
        return names if len(names) > 1 else ()

    @property
    def n(self) -> int:
        """Number of rows."""
        for values in (*self.variables.values(), *(g.index for g in self.groups.values())):
            return len(values)
        if self.time is None:
            raise FitError("the table has nothing but its response")
        return len(self.time.values)


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
        return self.priced(int(np.sum(np.count_nonzero(self.columns, axis=0) == 1)))

    def priced(self, of_one_row: int) -> int:
        """`price` of a term of which so many columns are of one row."""
        n, width = (int(size) for size in self.columns.shape)
        if self.of_levels and width > 0 and n > 1:
            own = max(n / (width + 1), 2.0)
            return max(ceil(width * log(own) / log(n)), 1)
        return max(width - of_one_row, min(width, 1)) + (0 if self.profile is None else self.profile.constants)
