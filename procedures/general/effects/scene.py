"""Values for the columns of effects in a table: settings, covariates, groups, time, direction."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.effects.entry import Entry
from rig.fitter.effects.history import History
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
        history: how often the laboratory found which effect.
        labels: columns of text without a role, whose levels repeat; shapes without a name and coarse rounding are
            looked for by them, but no effects.
        moves: how each variable came to its setting, in seconds, where that is known.
        constant: whether the declared model has a constant, in whatever columns.
        functions: settings that are functions of columns in the declared model; these columns are settings, too.
        curved: settings that the declared model has in curves only: no sum of its terms is a straight line over them.
    """

    settings: Mapping[str, FloatArray]
    covariates: Mapping[str, FloatArray]
    groups: Mapping[str, Grouping]
    time: Timeline | None
    direction: tuple[str, FloatArray] | None
    speed: tuple[str, FloatArray] | None = None
    setpoints: Mapping[str, FloatArray] = field(default_factory=dict)
    own: tuple[Entry, ...] = ()
    history: History = field(default_factory=History)
    labels: Mapping[str, Grouping] = field(default_factory=dict)
    moves: Mapping[str, Stood] = field(default_factory=dict)
    constant: bool = True
    functions: frozenset[str] = frozenset()
    curved: frozenset[str] = frozenset()

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
