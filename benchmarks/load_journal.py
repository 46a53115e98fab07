"""Journal time a point late in a long run beside that early in a short one, both under way at once, in turns.

The machine's speed changes by half within minutes, so windows minutes apart cannot be compared. Two runs take turns,
a block of points each, in one process: the blocks of a pair are a fraction of a second apart.
"""

from __future__ import annotations

import statistics
import threading
import time
from array import array
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from rig.engine.journal import Journal

BLOCK = 50


class JournalTimes:
    """Processor time spent in each journal point by point: records written, state kept up to date, news spread.

    Args:
        point_done: called after every point, outside of what is timed.

    Attributes:
        of: seconds of every point, by journal, in the order in which they observed their first.
        points: processor seconds of every whole point, all of it and the ideal instruments, in the same order.

    """

    def __init__(self, point_done: Callable[[], None]) -> None:
        self.of: dict[Journal, array[float]] = {}
        self.points: dict[Journal, array[float]] = {}
        self._before: dict[Journal, float] = {}
        self._point_done = point_done
        self._depth = 0
        self._seconds = 0.0
        for name in ("write", "tell", "take_up", "point_observed"):
            setattr(Journal, name, self._timed(getattr(Journal, name)))

    def _timed(self, method: Any) -> Any:
        def timed(journal: Journal, *args: Any, **named: Any) -> Any:
            self._depth += 1
            began = time.process_time()
            try:
                return method(journal, *args, **named)
            finally:
                self._depth -= 1
                if not self._depth:
                    self._seconds += time.process_time() - began
                if method.__name__ == "point_observed":
                    self.of.setdefault(journal, array("d")).append(self._seconds)
                    self._seconds = 0.0
                    now = time.thread_time()  # of this run's thread: waiting for the other's turn costs nothing
                    self.points.setdefault(journal, array("d")).append(now - self._before.get(journal, now))
                    self._before[journal] = now
                    self._point_done()

        return timed


class Turns:
    """Lets two runs, a thread each, go on in turns of `BLOCK` points; only one of them ever does."""

    def __init__(self) -> None:
        self._may_go_on = [threading.Semaphore(1), threading.Semaphore(0)]
        self._done = [0, 0]
        self._alone = False
        self._here = threading.local()

    def point_done(self) -> None:
        """The run of this thread has done a point: after the last of a block, wait until the other has done one."""
        runner = self._here.runner
        self._done[runner] += 1
        if self._done[runner] % BLOCK == 0 and not self._alone:
            self._may_go_on[1 - runner].release()
            self._may_go_on[runner].acquire()

    def carry_out(self, *runs: Callable[[], object]) -> None:
        """Carry out two runs. Raises what one of them raises."""
        with ThreadPoolExecutor(2) as pool:
            for done in [pool.submit(self._go, runner, run) for runner, run in enumerate(runs)]:
                done.result()

    def _go(self, runner: int, run: Callable[[], object]) -> None:
        self._here.runner = runner
        self._may_go_on[runner].acquire()
        try:
            run()
        finally:
            self._alone = True
            self._may_go_on[1 - runner].release()


def compared(late: array[float], early: array[float], what: str) -> dict[str, Any]:
    """Medians of both, microseconds, and the ratio of the medians of each pair of blocks: quartiles over all pairs.

    Args:
        late: seconds of every point at the end of the long run.
        early: those of the short one.
        what: is timed.

    """
    blocks = [
        (statistics.median(late[at : at + BLOCK]), statistics.median(early[at : at + BLOCK]))
        for at in range(BLOCK, min(len(late), len(early)) - BLOCK + 1, BLOCK)  # the first blocks fill caches
    ]
    return {
        "blocks": len(blocks),
        f"late_{what}_us": round(statistics.median(a for a, _ in blocks) * 1e6, 1),
        f"early_{what}_us": round(statistics.median(b for _, b in blocks) * 1e6, 1),
        f"{what}_ratio": [round(q, 3) for q in statistics.quantiles([a / b for a, b in blocks], n=4)],
    }
