"""Readings of a point and what they amount to."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from drivers.roles import is_overload


@dataclass(frozen=True)
class Channel:
    """All readings of one quantity at one point.

    Attributes:
        readings: as the instrument gave them, in its unit.

    """

    readings: tuple[float, ...]

    @property
    def overload(self) -> bool:
        """Whether any reading was out of the instrument's range."""
        return any(is_overload(r) for r in self.readings)

    @property
    def mean(self) -> float:
        """Mean of the readings."""
        return math.fsum(self.readings) / len(self.readings)

    @property
    def sd(self) -> float:
        """Standard deviation of one reading; 0 where there is only one."""
        n = len(self.readings)
        if n < 2:
            return 0.0
        mean = self.mean
        return math.sqrt(math.fsum((r - mean) ** 2 for r in self.readings) / (n - 1))

    def as_json(self) -> dict[str, Any]:
        """For the run file."""
        return {"mean": self.mean, "sd": self.sd, "readings": list(self.readings)}


@dataclass
class Observation:
    """What was captured at a point, on its way to the run file.

    Attributes:
        outputs: by column name, `x_V`.
        temperatures: by column name, `sensor_temperature_degC`.
        flags: what a reader of the data should know of it ("noisy").

    """

    outputs: dict[str, Channel]
    temperatures: dict[str, Channel]
    flags: list[str] = field(default_factory=list)

    def overloaded(self) -> list[str]:
        """Names of the quantities that were out of range."""
        return [name for name, c in (*self.outputs.items(), *self.temperatures.items()) if c.overload]

    def noisiest(self) -> tuple[str, float]:
        """The output with the largest standard deviation, and that."""
        name = max(self.outputs, key=lambda n: self.outputs[n].sd)
        return name, self.outputs[name].sd

    def as_json(self) -> dict[str, Any]:
        """For the run file; overloads are written as null, which no mean can be made of."""
        if self.overloaded():
            return {
                "overload": self.overloaded(),
                "readings": {
                    name: [None if is_overload(r) else r for r in c.readings]
                    for name, c in (*self.outputs.items(), *self.temperatures.items())
                },
            }
        return {
            "outputs": {name: c.as_json() for name, c in self.outputs.items()},
            "temperatures": {name: c.as_json() for name, c in self.temperatures.items()},
            "flags": self.flags,
        }


def assemble(
    fetched: Mapping[str, Mapping[str, Sequence[float]]],
    sensors: Mapping[str, tuple[str, str]],
    temperatures: Mapping[str, tuple[str, str]],
) -> Observation:
    """Readings of several instruments, by instrument and channel, sorted into quantities.

    Args:
        fetched: readings by instrument and channel.
        sensors: output column to (instrument, channel).
        temperatures: temperature column to (instrument, channel).

    """

    def pick(source: Mapping[str, tuple[str, str]]) -> dict[str, Channel]:
        return {name: Channel(tuple(fetched[reader][channel])) for name, (reader, channel) in source.items()}

    return Observation(pick(sensors), pick(temperatures))
