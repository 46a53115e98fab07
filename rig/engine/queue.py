"""The order of the remaining points: the run list without observed points, postponed points at the end.

Without hard-to-change factors a postponed point is tried again at the end of the run. In a whole plot it is tried
again at the end of that whole plot, while its temperatures still hold. A step by hand changes the bench: points
postponed before it are tried again before it.
"""

from __future__ import annotations

from rig.procedures.plan.hand_steps import next_step
from rig.procedures.plan.run_list import Point, RunList
from rig.run_file.state.state import RunState


class PointQueue:
    """Points still to be observed, in order; stored as a position in the run list and the postponed points.

    Args:
        run_list: every point of the run.
        fold: the state of the points so far.

    """

    def __init__(self, run_list: RunList, fold: RunState) -> None:
        self._points, self._steps = run_list.points, run_list.steps
        self._fold = fold
        self._deferred: list[Point] = []
        self._again: list[Point] = []
        self.refill()

    def refill(self) -> None:
        """Begin again from the state in the run file, for example after a whole plot was lost."""
        self._deferred.clear()
        self._again.clear()  # postponed points that come again; the next one is popped from the end
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
        if self._deferred and (
            first is None or first.whole_plot != self._deferred[0].whole_plot or self._changes_before(first)
        ):
            self._again += self._deferred[::-1]
            self._deferred.clear()
            first = self._again[-1]
        return first

    def _changes_before(self, following: Point) -> bool:
        """Whether a person changes the bench between a postponed point and this one."""
        number = next_step(self._steps, self._fold.by_hand)
        return number is not None and self._deferred[0].index < self._steps[number - 1].before <= following.index

    def pop(self) -> Point | None:
        """Remove the next point and return it."""
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
        """Put a removed point back in front, unless it has been observed since."""
        if point.index not in self._fold.accepted:
            self._again.append(point)
