"""Which point comes next: the run list, less what has been observed, with what was put off at the end.

Where nothing is hard to change, a point that was put off is tried again at the end of the run. In a whole plot it
is tried again at the whole plot's own end, while the temperatures it belongs to still stand.
"""

from __future__ import annotations

from procedures.run_list import Point, RunList
from rig.run_file.state import RunState


class PointQueue:
    """Points still to be observed, in order. A place in the run list, and what was put off: no list of what is ahead.

    Args:
        run_list: every point of the run.
        fold: what has become of them so far.

    """

    def __init__(self, run_list: RunList, fold: RunState) -> None:
        self._points = run_list.points
        self._fold = fold
        self._deferred: list[Point] = []
        self._again: list[Point] = []
        self.refill()

    def refill(self) -> None:
        """Begin again from what the run file says, as after a whole plot was lost."""
        self._deferred.clear()
        self._again.clear()  # points whose turn has come again; the next one is popped from the end
        self._at = -1
        self._following = self._next()

    def _next(self) -> Point | None:
        """The next point of the run list that is still to be observed."""
        accepted, skipped = self._fold.accepted, self._fold.skipped
        for index in range(self._at + 1, len(self._points)):
            if index not in accepted and index not in skipped:
                self._at = index
                return self._points[index]
        self._at = len(self._points)
        return None

    def peek(self) -> Point | None:
        """The next point; None if there is none left."""
        first = self._again[-1] if self._again else self._following
        if self._deferred and (first is None or first.whole_plot != self._deferred[0].whole_plot):
            self._again += self._deferred[::-1]
            self._deferred.clear()
            first = self._again[-1]
        return first

    def pop(self) -> Point | None:
        """Take the next point out."""
        point = self.peek()
        if self._again:
            self._again.pop()
        elif point is not None:
            self._following = self._next()
        return point

    def put_off(self, point: Point) -> None:
        """Try a point again later."""
        self._deferred.append(point)

    def put_back(self, point: Point) -> None:
        """Have a point that was taken out come next again, unless it has been observed meanwhile."""
        if point.index not in self._fold.accepted:
            self._again.append(point)
