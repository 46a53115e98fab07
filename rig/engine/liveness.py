"""Whether readings are alive: a meter that hangs repeats what it read, and so does one that is coarse and quiet.

Two things tell them apart. What was read before, at another setting, does not come again to the last digit. And where
readings of a point hardly ever were all the same number, they are not so now on several channels at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from procedures.run_list import Point
from rig.engine.measuring import Observation

_TOO_STILL = 3e-3
"""Chance below which channels of one instrument are not believed to stand still."""
_STILL, _SEEN = 0.5, 4.0
"""What is assumed before anything was read: half of four observations stood still."""


@dataclass
class _Output:
    """How often readings of a point were all the same number; counted once the output has shown that it lives.

    Attributes:
        seen: observations.
        still: of them, those that stood still.
        doubted: the number of the last one that did, until another is read.

    """

    seen: int = 0
    still: int = 0
    doubted: float | None = None

    def chance(self, readings: Sequence[float]) -> float:
        """How likely it is that these stand still, by what is known of earlier ones; 1 where they do not."""
        if self.doubted is not None and set(readings) != {self.doubted}:
            self.seen, self.still, self.doubted = self.seen + 1, self.still + 1, None
        if len(set(readings)) > 1:
            self.seen += 1
            return 1.0
        if len(readings) < 2:
            return 1.0
        self.doubted = readings[0]
        return (self.still + _STILL) / (self.seen + _SEEN)


class Liveness:
    """What is known of the outputs of a bench.

    Args:
        readers: by output column, the instrument that reads it.
        point: at which outputs were read last, by an earlier session; None if they never were.
        last: what was read there, by column.

    """

    def __init__(self, readers: Mapping[str, str], point: Point | None, last: Mapping[str, Sequence[float]]) -> None:
        self._readers = readers
        self._point, self._last = point, last
        self._outputs = {name: _Output() for name in readers}

    def hanging(self, point: Point, observation: Observation, passing: Mapping[str, Sequence[float]]) -> list[str]:
        """Outputs that hang.

        Args:
            point: where the observation was made.
            observation: it.
            passing: what outputs read since the one before, while only temperatures were wanted.

        """
        now = {name: c.readings for name, c in observation.outputs.items()}
        last = {name: (*self._last.get(name, ()), *passing.get(name, ())) for name in now}
        found = observation.frozen(last, moved=self._point is None or self._point.setpoints != point.setpoints)
        found = found or self._too_still(observation)
        if found:
            self._last = {name: (*last[name], *now[name]) for name in now}
        else:
            self._point, self._last = point, now
        return found

    def _too_still(self, observation: Observation) -> list[str]:
        chances = {name: self._outputs[name].chance(c.readings) for name, c in observation.outputs.items()}
        found = []
        for reader in dict.fromkeys(self._readers.values()):
            still = [name for name, chance in chances.items() if self._readers[name] == reader and chance < 1.0]
            together = 1.0
            for name in still:
                together *= chances[name]
            found += still if together < _TOO_STILL else []
        return found
