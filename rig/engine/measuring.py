"""Statistics of a point's readings. Whether they are repeated is decided in `rig.engine.at_point`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rig.drivers.roles import OneAfterAnother, Reader, any_overload, is_overload, plays


class Channel:
    """All readings of one quantity at one point; what follows from them is calculated once.

    Attributes:
        readings: as the instrument gave them, in its unit.
        overload: whether any reading was out of the instrument's range.

    """

    __slots__ = ("_mean", "_sd", "overload", "readings")

    def __init__(self, readings: tuple[float, ...]) -> None:
        self.readings, self.overload = readings, any_overload(readings)
        self._mean: float | None = None
        self._sd: float | None = None

    @property
    def mean(self) -> float:
        """Mean of the readings."""
        if self._mean is None:
            self._mean = math.fsum(self.readings) / len(self.readings)  # exact: microvolts beside volts add up
        return self._mean

    @property
    def sd(self) -> float:
        """Standard deviation of one reading; 0 if there is only one."""
        if self._sd is None:
            n, mean = len(self.readings), self.mean
            self._sd = math.sqrt(math.fsum([(r - mean) ** 2 for r in self.readings]) / (n - 1)) if n > 1 else 0.0
        return self._sd

    def as_json(self) -> dict[str, Any]:
        """Values for the run file."""
        return {"mean": self.mean, "sd": self.sd, "readings": list(self.readings)}


@dataclass
class Observation:
    """Readings captured at a point.

    Attributes:
        outputs: by column name, `x_V`, in the column's unit.
        temperatures: by column name, `sensor_temperature_degC`.
        references: readbacks of the reference during the readings, by column name.
        taken_s: by column, when its readings began and ended, seconds after those of the point began.
        flags: remarks for readers of the data ("noisy", "contradictory").
        missing: by output column without a reading, why.

    """

    outputs: dict[str, Channel]
    temperatures: dict[str, Channel]
    references: dict[str, Channel] = field(default_factory=dict)
    taken_s: dict[str, tuple[float, float]] = field(default_factory=dict)
    flags: list[str] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)

    def overloaded(self) -> list[str]:
        """Names of the quantities that were out of range."""
        every = (self.outputs, self.temperatures, self.references)
        return [name for group in every for name, c in group.items() if c.overload]

    @property
    def readings(self) -> dict[str, list[float]]:
        """Readings of outputs and references, by column."""
        return {name: list(c.readings) for name, c in (*self.references.items(), *self.outputs.items())}

    @property
    def every_reading(self) -> dict[str, Sequence[float]]:
        """Readings of outputs, temperatures and references, by column."""
        every = (self.outputs, self.temperatures, self.references)
        return {name: channel.readings for group in every for name, channel in group.items()}

    def in_range(self) -> dict[str, list[float | None]]:
        """All readings by column; overloads are null, so that nobody can average them."""
        every = (self.outputs, self.temperatures, self.references)
        return {n: [None if is_overload(r) else r for r in c.readings] for group in every for n, c in group.items()}

    def as_json(self) -> dict[str, Any]:
        """Its fields for the run file. Overloads are written as null, so that nobody can average them."""
        overloaded = self.overloaded()
        if overloaded:
            return {
                "overload": overloaded,
                "readings": {n: r for n, r in self.in_range().items() if n not in self.references or None in r},
            }
        return {
            "outputs": {name: c.as_json() for name, c in self.outputs.items()},
            "temperatures": {name: c.as_json() for name, c in self.temperatures.items()},
            **({"references": {n: c.as_json() for n, c in self.references.items()}} if self.references else {}),
            "taken_s": self.taken_s,
            "flags": self.flags,
            **({"missing": self.missing} if self.missing else {}),
        }


def assemble(
    fetched: Mapping[str, Mapping[str, Sequence[float]]],
    sensors: Mapping[str, tuple[str, str]],
    scales: Mapping[str, float],
    temperatures: Mapping[str, tuple[str, str]],
    references: Mapping[str, Sequence[float]],
) -> Observation:
    """Sort readings of several instruments and channels into quantities.

    Args:
        fetched: readings by instrument and channel, volts and degrees Celsius.
        sensors: by output column, (instrument, channel).
        scales: by output column, its unit per volt.
        temperatures: by temperature column, (instrument, channel).
        references: readings by column.

    """

    def pick(source: tuple[str, str], scale: float = 1.0) -> Channel:
        reader, channel = source
        readings = tuple(map(float, fetched[reader][channel]))
        # an overload is not scaled
        return Channel(readings if scale == 1.0 else tuple([r if is_overload(r) else r * scale for r in readings]))

    return Observation(
        outputs={name: pick(source, scales[name]) for name, source in sensors.items()},
        temperatures={name: pick(source) for name, source in temperatures.items()},
        references={name: Channel(tuple(values)) for name, values in references.items()},
    )


def standards(
    fetched: Mapping[str, Mapping[str, Sequence[float]]],
    sources: Mapping[str, tuple[str, str]],
    values: Mapping[str, Callable[[float], float]],
) -> dict[str, Channel]:
    """Readings of reference standards, as factors.

    Args:
        fetched: readings by instrument and channel.
        sources: by factor, (instrument, channel).
        values: by factor, its value from a reading; an overload stays one.

    """
    return {
        factor: Channel(tuple(r if is_overload(r) else values[factor](r) for r in fetched[reader][channel]))
        for factor, (reader, channel) in sources.items()
    }


def spans_of(
    reader: Reader, began: float, due: float, asked: float, answered: float
) -> Mapping[str, tuple[float, float]]:
    """When the readings of each channel began and ended.

    An instrument that keeps its readings takes them from `start` on; any other takes them when they are asked for.

    Args:
        reader: the instrument.
        began: time of its `start`.
        due: duration that this returned.
        asked: time before its `fetch`.
        answered: time after it.
    """
    first, last = (began, began + due) if due > 0.0 else (asked, answered)
    names = reader.channels()
    each = reader.sweep_s() / len(names) if plays(reader, OneAfterAnother) else 0.0
    spare = [min(each * k, last - first) for k in range(len(names))]
    return {name: (first + before, last - after) for name, before, after in zip(names, spare, spare[::-1], strict=True)}
