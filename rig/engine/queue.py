"""Which point comes next: the run list, less what has been observed, with what was put off at the end.

Where nothing is hard to change, a point that was put off is tried again at the end of the run. In a whole plot it
is tried again at the whole plot's own end, while the temperatures it belongs to still stand.
"""

from __future__ import annotations

from procedures import Point, RunList
from rig.engine.state import RunState


class PointQueue:
    """Points still to be observed, in order.

    Args:
        run_list: every point of the run.
        fold: what has become of them so far.

    """

    def __init__(self, run_list: RunList, fold: RunState) -> None:
        self._run_list = run_list
        self._fold = fold
        self._deferred: list[Point] = []
        self._ahead: list[Point] = []
        self.refill()

    def refill(self) -> None:
        """Begin again from what the run file says, as after a whole plot was lost."""
        fold = self._fold
        points = (p for p in self._run_list.points if p.index not in fold.accepted and p.index not in fold.skipped)
        self._ahead = list(points)[::-1]  # the next point is popped from the end
        self._deferred.clear()

    def peek(self) -> Point | None:
        """The next point; None if there is none left."""
        if self._deferred and (not self._ahead or self._ahead[-1].whole_plot != self._deferred[0].whole_plot):
            self._ahead += self._deferred[::-1]
            self._deferred.clear()
        return self._ahead[-1] if self._ahead else None

    def pop(self) -> Point | None:
        """Take the next point out."""
        point = self.peek()
        if point is not None:
            self._ahead.pop()
        return point

    def put_off(self, point: Point) -> None:
        """Try a point again later."""
        self._deferred.append(point)

    def put_back(self, point: Point) -> None:
        """Have a point that was taken out come next again, unless it has been observed meanwhile."""
        if point.index not in self._fold.accepted:
            self._ahead.append(point)
