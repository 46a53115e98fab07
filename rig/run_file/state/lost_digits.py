"""Whether a first digit was lost on its way: 2.5 for 12.5, 25 for 125. What is left looks right.

A meter that prints all readings in one form cannot lose a digit unseen (`rig.drivers.scpi_learned`). Of plain
decimals nobody knows how many digits stand before the point. So a point is compared with the last one at the same
setting: a quantity that has changed by a whole number in its first place, and is smaller than that place now,
contradicts it. That may be a change of the quantity itself by chance, so the point is read again first.

It follows from the last `own_scatter.KEPT` accepted observations, so that a resumed run decides as if it had never
stopped.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence

from rig.procedures.column_names import spelled, unit_of
from rig.procedures.plan.run_list import RunList
from rig.run_file.events.points import CONTRADICTORY, Observed
from rig.run_file.state.own_scatter import KEPT, Contradiction

_NEAR = 0.05
"""Part of the lost digit's place by which the difference of two readings may differ from a whole number of it."""
_SPANS = 3.0
"""The difference is larger than this many spans of the readings, of both points together."""
_OF_LARGEST = 1e-3
"""The lost digit's place is at least this part of the largest reading of the quantity: less may be noise about zero."""


class LostDigits:
    """Compares the means of points at the same setting.

    Args:
        run_list: every point of the run.
        left_out: columns that are not judged, such as those that a person types.

    """

    def __init__(self, run_list: RunList, left_out: Collection[str]) -> None:
        self._points, self._left_out = run_list.points, left_out
        self._seen: deque[tuple[int, Sequence[float], Mapping[str, Sequence[float]]]] = deque(maxlen=KEPT)
        self._largest: dict[str, float] = {}

    def recall(self, point: int, observed: Observed) -> None:
        """Take an accepted observation; of one that contradicts others nothing is compared later."""
        if CONTRADICTORY not in observed.flags:
            readings = observed.every_reading
            self._seen.append((point, self._points[point].setpoints, readings))
            for name, values in readings.items():
                self._largest[name] = max(self._largest.get(name, 0.0), *map(abs, values))

    def contradiction(self, point: int, readings: Mapping[str, Sequence[float]]) -> Contradiction | None:
        """The first quantity that seems to have lost a digit at a new point; None if there is none.

        Args:
            point: index of the point.
            readings: by column.

        """
        for name, now, before, _ in self._compared(point, readings):
            if self._lost(name, now, before):
                return Contradiction(name, -1, self._words(name, now, before))
        return None

    def earlier(self, point: int, readings: Mapping[str, Sequence[float]]) -> Iterator[Contradiction]:
        """Quantities that seem to have lost a digit at the last point of this setting; arguments as above."""
        for name, now, before, index in self._compared(point, readings):
            if self._lost(name, before, now):
                yield Contradiction(name, index, self._words(name, before, now))

    def _compared(
        self, point: int, readings: Mapping[str, Sequence[float]]
    ) -> Iterator[tuple[str, Sequence[float], Sequence[float], int]]:
        """Column, its readings now and at the last point of this setting, and the index of that point."""
        setting = self._points[point].setpoints
        for index, where, earlier in reversed(self._seen):
            if where == setting:
                for name in readings.keys() & earlier.keys() - self._left_out:
                    yield name, readings[name], earlier[name], index
                return

    def _lost(self, name: str, less: Sequence[float], more: Sequence[float]) -> bool:
        value, whole = (math.fsum(readings) / len(readings) for readings in (less, more))
        spans = sum(max(readings) - min(readings) for readings in (less, more))
        most = max(self._largest.get(name, 0.0), abs(whole))
        return abs(whole - value) > _SPANS * spans and lost_digit(value, whole, _OF_LARGEST * most)

    def _words(self, name: str, less: Sequence[float], more: Sequence[float]) -> str:
        value, whole = (math.fsum(readings) / len(readings) for readings in (less, more))
        unit = spelled(unit_of(name))
        then = f"{whole:.6g} {unit} at the same setting"
        return f"{name} reads {value:.6g} {unit}, and {then}, as if a first digit were lost"


def lost_digit(value: float, whole: float, least: float = 0.0) -> bool:
    """Whether a value is another one without its first digit, which stands before the point and not in the last place.

    Args:
        value: what is left.
        whole: about what it would be with the digit.
        least: smallest place of a digit that counts.
    """
    lost = abs(whole) - abs(value)
    if not lost > 0.0 or value * whole < 0.0:
        return False
    first = 10.0 ** math.floor(math.log10(abs(whole)))
    places = (first, first / 10.0)  # 100.02 may be 99.98 in the next reading
    return any(
        place >= max(10.0, least)
        and abs(value) < place
        and 1 <= round(lost / place) <= 9
        and abs(lost / place - round(lost / place)) <= _NEAR
        for place in places
    )
