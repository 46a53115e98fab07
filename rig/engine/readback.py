"""Whether a chamber that repeats its reading stands, as it may, or hangs: by how its reading changed before.

A chamber that has settled stands, and its display shows one number for hours. A reading that repeats is doubted only
where it should move: it went up and down by more than its resolution before, it was on its way, or it stands farther
from its setpoint than it ever was at a point.
"""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from math import inf, isfinite
from statistics import median

from rig.run_file.state.own_scatter import last_digit

HANGS_S = 60.0
"""Seconds of equal readings from which a chamber that should move hangs."""
_PAIRS = 6
"""Pairs of successive points with different readings, after which equal readings can be doubted at all. A chamber of
coarse resolution has equal ones earlier."""
_TURNS = 3
"""Changes against the one before them, at least, by which a reading is known to go up and down. Of noise two in three
are, of a temperature that settles none."""
_STEPS = 2.0
"""Steps by which a reading has to go up and down, to be known to move: one that flickers by one step may stand."""
_DIGITS = 10.0
"""Units of its last digit by which the next change is expected, to say that it is on its way: less may not show within
a minute."""
_FARTHER = 2.0
"""Factor by which it is farther from its setpoint than ever before."""
_FLOAT32 = 2.0**-23
"""Resolution of readings that arrive as binary numbers of 32 bits, relative."""
_KEPT = 40
"""Readings from which the size of its steps is taken; as many as a resumed run reads again. Chosen."""


class Readback:
    """How the reading of one chamber changes from point to point. Degrees Celsius."""

    def __init__(self) -> None:
        self._pairs = self._same = self._turns = self._triples = 0
        self._waiting = False
        self._values: deque[float] = deque(maxlen=_KEPT)
        self._sizes: deque[float] = deque(maxlen=_KEPT)
        self._changes: list[float] = []  # the last two of this whole plot
        self._last: float | None = None
        self._off = self._farthest = 0.0

    def note(self, degC: float, setpoint_degC: float, stood_s: float, *, new_whole_plot: bool) -> None:
        """Take the reading at an accepted point.

        Args:
            degC: the reading.
            setpoint_degC: the setpoint then.
            stood_s: how long an earlier one was repeated that ended lately; 0 if none was.
            new_whole_plot: whether the point before is of another whole plot, so that they do not compare.

        """
        if degC != self._last:
            self._farthest = max(self._farthest, self._off)
        self._off = abs(degC - setpoint_degC)
        before, self._last = None if new_whole_plot else self._last, degC
        if before is None:
            self._waiting, self._changes = False, []
            return
        change = degC - before
        if not change and self._never_the_same:
            self._waiting = True  # its resolution is coarser than assumed if it moves again soon; otherwise it hangs
            return
        if self._waiting and stood_s < HANGS_S:
            self._same += 1
        self._waiting = False
        self._pairs += 1
        self._same += not change
        if change:
            self._moved(change)
            self._values.extend((before, degC))

    def _moved(self, change: float) -> None:
        if self._changes:
            self._triples += 1
            self._turns += self._changes[-1] * change < 0
        self._changes = [*self._changes[-1:], change]
        self._sizes.append(abs(change))

    @property
    def should_move(self) -> bool:
        """Whether a minute of equal readings means that it hangs."""
        far = self._off > _FARTHER * self._farthest
        return self._never_the_same and (far or self._goes_up_and_down or self._was_on_its_way)

    @property
    def _never_the_same(self) -> bool:
        return self._pairs >= _PAIRS and not self._same

    @property
    def _goes_up_and_down(self) -> bool:
        if self._turns < max(_TURNS, self._triples / 3):
            return False
        step = min((b - a for a, b in pairwise(sorted(set(self._values)))), default=inf)
        return median(self._sizes) >= _STEPS * step

    @property
    def _was_on_its_way(self) -> bool:
        """Whether the next change would be seen, if changes go on as the last two: a settling temperature's shrink."""
        if len(self._changes) < 2:
            return False
        first, second = self._changes
        following = abs(second) * min(1.0, second / first)  # below zero if it has turned
        digit, largest = min(map(last_digit, self._values)), max(map(abs, self._values))
        return following >= _DIGITS * (digit if isfinite(digit) else _FLOAT32 * largest)
