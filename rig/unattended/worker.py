"""A thread for work that may be slow or never end: mail servers, webhooks, a log on a network drive.

It does real input and output and does not know bench time. The sequencer hands over work and never waits.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

Item = TypeVar("Item")

_LAST_PAUSE_S = 2.0


class Worker(Generic[Item]):
    """Does tasks in order, in a thread that ends with the process even if it hangs.

    Args:
        name: name of the thread.
        do: does one task; must not raise.
        limit: maximum number of waiting tasks; more are refused.

    """

    def __init__(self, name: str, do: Callable[[Item], None], limit: int) -> None:
        self._do = do
        self._limit = limit
        self._waiting: deque[Item] = deque()
        self._changed = threading.Condition()
        self._closing = threading.Event()
        self._in_hand: list[Item] = []
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def put(self, item: Item) -> bool:
        """Hand over a task; False if too many are waiting, or after the end."""
        with self._changed:
            if len(self._waiting) >= self._limit or self._closing.is_set():
                return False
            self._waiting.append(item)
            self._changed.notify()
            return True

    def pause(self, seconds: float) -> None:
        """Called by `do`: wait, in real seconds; after the end of the session only for a moment."""
        if not self._closing.wait(seconds):
            return
        threading.Event().wait(min(seconds, _LAST_PAUSE_S))

    def idle(self) -> bool:
        """Whether all tasks are done."""
        with self._changed:
            return not self._waiting and not self._in_hand

    def finish(self) -> None:
        """Refuse new tasks, and end after the waiting ones."""
        with self._changed:
            self._closing.set()
            self._changed.notify()

    def close(self, within_s: float) -> list[Item]:
        """Do the waiting tasks, for at most this many real seconds; returns those not done."""
        self.finish()
        self._thread.join(within_s)
        with self._changed:
            left = [*self._in_hand, *self._waiting]
            self._waiting.clear()
        return left

    def _work(self) -> None:
        while True:
            with self._changed:
                self._in_hand.clear()
                while not self._waiting:
                    if self._closing.is_set():
                        return
                    self._changed.wait()
                item = self._waiting.popleft()
                self._in_hand.append(item)
            self._do(item)
