"""Readings that a person takes and types: units, limits, and which of several readings of one point count."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from rig.bench.bench_file import of_reading
from rig.bench.config import BenchConfig
from rig.bench.scatter_limits import declared_scatter
from rig.drivers.person import Person
from rig.procedures.column_names import spelled
from rig.procedures.plan.conduct import Conduct
from rig.units.of_instruments import per_volt, scale

_ROUNDED = 1.0 + 1e-9


@dataclass(frozen=True)
class TypedColumn:
    """A column that a person reads.

    Attributes:
        name: the column.
        reader: the person.
        channel: the person's channel.
        unit: in which it is typed, as at the end of column names.
        resolution: how finely it can be read, in that unit.
        readings: how many are asked for at a point, unless two differ.
        max_sd: limit of the standard deviation that the procedure declares, in the column's unit; 0 for none.
        value: the column's value from a typed number.
        limits: (low, high) of the bench for the column.
        per_twin: number of the typed units in what the simulated bench gives: volts for outputs of voltage.
    """

    name: str
    reader: str
    channel: str
    unit: str
    resolution: float
    readings: int
    max_sd: float
    value: Callable[[float], float]
    limits: tuple[float, float]
    per_twin: float

    def agree(self, one: float, other: float) -> bool:
        """Whether two typed numbers differ by no more than the resolution, or than the procedure's limit of scatter."""
        apart = abs(self.value(one) - self.value(other))
        return abs(one - other) <= self.resolution * _ROUNDED or apart <= math.sqrt(2.0) * self.max_sd * _ROUNDED

    def complete(self, typed: Sequence[float]) -> bool:
        """Whether no further reading is asked for."""
        return len(typed) > 2 or (len(typed) >= self.readings and self.agree(typed[0], typed[-1]))

    def counting(self, typed: Sequence[float]) -> Sequence[float]:
        """The readings that count: of three the two that agree best, or all three if no two agree."""
        if len(typed) < 3:
            return typed
        closest = min(combinations(typed, 2), key=lambda pair: abs(pair[0] - pair[1]))
        return closest if self.agree(*closest) else typed

    def seen(self, reading: float) -> str:
        """Text that a simulated person types for a true reading: a multiple of the resolution.

        Args:
            reading: as a twin gets it: an output of a sensor in volts if it is one of voltage.
        """
        steps = round(reading * self.per_twin / self.resolution)
        return f"{steps * self.resolution:.12g}"

    def number(self, text: str | None) -> float | str:
        """A typed text as a number, or why it is refused, as a sentence.

        Args:
            text: `12.3`, `12.3 bar` or `gauge_bar=12.3`.
        """
        what = f"{self.name} in {spelled(self.unit)}"
        if text is None:
            return f"the reading is missing: --value V, where V is {what}"
        name, equals, value = text.rpartition("=")
        if equals and name.strip() != self.name:
            return f"--value {text!r:.60} names {name.strip():.60}, and {self.name} is asked for"
        value = value.strip()
        for unit in sorted({self.unit, spelled(self.unit)}, key=len, reverse=True):
            if value.endswith(unit):
                value = value.removesuffix(unit).rstrip()
                break
        try:
            number = float(value.replace("_", " _"))  # Python's own digits_groups are no numbers of a person
        except ValueError:
            return f"--value {text!r:.60} is not a number; it is {what}, with a point as its decimal sign"
        if not math.isfinite(number):
            return f"--value {text:.60} is not a finite number; it is {what}"
        low, high = self.limits
        if not low <= self.value(number) <= high:
            return f"--value {text:.60} is outside the limits of {self.name}, {low:g} to {high:g}"
        return number


def typed_columns(config: BenchConfig, conduct: Conduct) -> Mapping[str, TypedColumn]:
    """Columns that a person reads, by name, in the order of the bench file."""
    most, found = declared_scatter(conduct, config), {}
    units = {f"{name}_{one.unit}": one.unit for name, one in config.sensors.items()}
    for name, (reader, channel) in config.typed.items():
        options = Person.Options.model_validate(config.instruments[reader].options)
        unit = options.reads[channel]
        if name in config.references:
            value = of_reading(config.references[name].formula)
        else:
            value = _times(scale(unit, units[name]) or 1.0) if name in units else of_reading(None)
        limits = config.limits.get(name, (-math.inf, math.inf))
        sd = most[name].sd if name in most else 0.0
        readings = 2 if options.twice else 1
        resolution = options.resolution[channel]
        per_twin = (per_volt(unit) if name in units else None) or 1.0
        found[name] = TypedColumn(name, reader, channel, unit, resolution, readings, sd, value, limits, per_twin)
    return found


def _times(factor: float) -> Callable[[float], float]:
    return lambda reading: reading if factor == 1.0 else reading * factor
