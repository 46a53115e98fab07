"""A thread of its own for what may take time or never answer: mail servers, webhooks, a log on a network drive.

It does real input and output and knows nothing of bench time; the sequencer hands things over and never waits.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

Item = TypeVar("Item")

_LAST_PAUSE_S = 2.0


class Worker(Generic[Item]):
    """Does one thing after another in a thread that ends with the process, whatever it hangs in.

    Args:
        name: of the thread.
        do: does one thing; must not raise.
        limit: how many things may wait; more are refused.

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
        """Hand something over; False if too much waits already, or it is over."""
        with self._changed:
            if len(self._waiting) >= self._limit or self._closing.is_set():
                return False
            self._waiting.append(item)
            self._changed.notify()
            return True

    def pause(self, seconds: float) -> None:
        """Called by `do`: wait, in real seconds; when the session is over, a moment at most."""
        if not self._closing.wait(seconds):
            return
        threading.Event().wait(min(seconds, _LAST_PAUSE_S))

    def idle(self) -> bool:
        """Whether everything handed over has been done."""
        with self._changed:
            return not self._waiting and not self._in_hand

    def finish(self) -> None:
        """Take nothing more and end when what waits is done."""
        with self._changed:
            self._closing.set()
            self._changed.notify()

    def close(self, within_s: float) -> list[Item]:
        """Do what waits, for at most so many real seconds; returns what was not done by then."""
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
