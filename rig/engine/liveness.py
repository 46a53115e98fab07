"""Detection of frozen readings: a meter that hangs repeats a reading, but so does one with a coarse resolution and no
noise.

Three tests tell them apart. A reading from another setting does not return to the last digit. If the readings of one
point were hardly ever all equal, several channels at once do not suddenly have equal readings. And after readings that
nobody could keep (a session that ended, an answer that was lost) an output that scattered has to scatter again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from rig.engine.measuring import Observation
from rig.procedures.plan.run_list import Point

_TOO_STILL = 3e-3
"""Probability below which equal readings on several channels are not accepted as chance."""
_FEWEST = 3
"""Different readings, at least, by which a column is known to scatter."""
_STILL, _SEEN = 0.5, 4.0
"""Prior: two of four observations had equal readings."""


@dataclass
class _Output:
    """How often the readings of a point were all equal; counted after the output has shown that it works.

    Attributes:
        seen: observations.
        still: number of observations with all readings equal.
        doubted: the value of the last one of them, until another value is read.

    """

    seen: int = 0
    still: int = 0
    doubted: float | None = None

    def chance(self, readings: Sequence[float], different: set[float]) -> float:
        """Probability that these readings are all equal by chance, from earlier observations; 1 if they are not
        equal.

        Args:
            readings: of one observation.
            different: those of them that differ.

        """
        if self.doubted is not None and different != {self.doubted}:
            self.seen, self.still, self.doubted = self.seen + 1, self.still + 1, None
        if len(different) > 1:
            self.seen += 1
            return 1.0
        if len(readings) < 2:
            return 1.0
        self.doubted = readings[0]
        return (self.still + _STILL) / (self.seen + _SEEN)


class Liveness:
    """Watches the outputs of a bench, and its reference standards.

    Args:
        readers: by column of an output or a reference standard, the instrument that reads it.
        point: the last point of an earlier session; None if there was none.
        last: readings there, by column.
        hung: index of the point at which columns hung in the session before, and what they repeated.
        standards: place in a point's setpoints of the factor that a reference standard reads, by its column.

    """

    def __init__(
        self,
        readers: Mapping[str, str],
        point: Point | None,
        last: Mapping[str, Sequence[float]],
        standards: Mapping[str, int] = MappingProxyType({}),
        hung: tuple[int, Mapping[str, float]] = (-1, MappingProxyType({})),
    ) -> None:
        self._readers, self._standards = readers, standards
        self._point, self._last = point, last
        self._outputs = {name: _Output() for name in readers}
        self._hung_at, self._hung = hung
        self._former: Mapping[str, Sequence[float]] = {}
        self._new, self._begun = True, 0
        self._here: Mapping[str, Sequence[float]] = {}

    def begin(self) -> None:
        """A measurement begins. If `hanging` never sees its readings, they were lost, or out of range."""
        self._begun += 1

    def hanging(self, point: Point, observation: Observation, passing: Mapping[str, Sequence[float]]) -> list[str]:
        """Columns that hang.

        Args:
            point: where the observation was made.
            observation: it.
            passing: readings since the previous observation, made while only temperatures were wanted.

        """
        read = {**observation.references, **observation.outputs} if observation.references else observation.outputs
        now = {name: read[name].readings for name in self._readers if name in read}
        earlier = self._last

        def last(name: str) -> Sequence[float]:
            return (*earlier.get(name, ()), *passing.get(name, ()))

        if self._point is not None and self._point.setpoints != point.setpoints:
            self._former, self._here = self._last, {}
        different = {name: set(readings) for name, readings in now.items()}
        found = [n for n, r in now.items() if len(different[n]) == 1 and self._repeats(n, r, last(n), point)]
        found = found or self._too_still(now, different) or self._unknown(now, last)
        self._new, self._begun = False, 0
        if found:
            self._hung = {**self._hung, **{name: now[name][-1] for name in found}}
            self._hung_at = point.index
            self._last = {name: (*last(name), *now[name]) for name in now}
        else:
            if self._hung_at != point.index:
                self._hung = {}
            self._point, self._last = point, now
        here = self._here
        self._here = {name: (*here.get(name, ()), *readings) for name, readings in now.items()} if here else now
        return found

    def _repeats(self, name: str, now: Sequence[float], before: Sequence[float], point: Point) -> bool:
        """Whether all readings of a column are its last one before, and that is not by chance.

        If the setting has not changed, an output that scattered must scatter again. The factor of a reference standard
        may stay for long while others change: it is doubted only if it never gave the same reading twice.
        """
        if set(now) == {self._hung.get(name)}:
            return True  # it hung at this point, and read something else in between: an open input, a spike
        if name not in self._standards and (self._returned(name, now) or self._stopped(name, now)):
            return True
        if not before or set(now) != {before[-1]}:
            return False
        then = self._point
        if name not in self._standards:
            return then is None or then.setpoints != point.setpoints or len(set(before)) > 1
        at = self._standards[name]
        moved = then is None or then.setpoints[at] != point.setpoints[at]
        return moved or len(set(before)) == len(before) >= _FEWEST

    def _returned(self, name: str, now: Sequence[float]) -> bool:
        """Whether all readings are one that was there before others that were rejected.

        It is the last one at the former setting, or one of this point if none of this point's came twice.
        """
        here = self._here.get(name, ())
        if len(set(now)) > 1 or len(now) < 2 or not here:
            return False
        former = self._former.get(name, ())
        if former and now[0] == former[-1]:
            return True
        return now[0] in here and len(set(here)) == len(here) >= _FEWEST

    def _stopped(self, name: str, now: Sequence[float]) -> bool:
        """Whether all readings are equal at a point of which no two rejected ones were, and no point before was still.

        It may have begun to hang at a reading that nobody had seen before: that of an open input, or a spike.
        """
        here, output = self._here.get(name, ()), self._outputs[name]
        scattered = len(set(here)) == len(here) >= _FEWEST and output.still == 0 and output.seen >= _FEWEST
        return len(now) > 1 and len(set(now)) == 1 and scattered

    def _unknown(self, now: Mapping[str, Sequence[float]], last: Callable[[str], Sequence[float]]) -> list[str]:
        """Columns that may repeat a reading that was not kept: all equal, where they scattered or were never read."""
        lost = self._begun > 1
        if not (lost or self._new):
            return []
        equal = [name for name, readings in now.items() if len(readings) > 1 and len(set(readings)) == 1]
        return [n for n in equal if len(set(last(n))) >= _FEWEST or (lost and not last(n))]

    def _too_still(self, now: Mapping[str, Sequence[float]], different: Mapping[str, set[float]]) -> list[str]:
        chances = {name: self._outputs[name].chance(readings, different[name]) for name, readings in now.items()}
        suspect = [name for name, chance in chances.items() if chance < 1.0]
        found = []
        for reader in dict.fromkeys(self._readers[name] for name in suspect):
            still = [name for name in suspect if self._readers[name] == reader]
            together = 1.0
            for name in still:
                together *= chances[name]
            found += still if together < _TOO_STILL else []
        return found
