"""A simulated CAN bus inside the process, under virtual time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from sims.world import World

Frame = tuple[int, bytes]
"""Identifier (11 bits) and data."""

OnFrame = Callable[[int, bytes, Callable[[int, bytes], None]], None]
"""A node: takes a frame's identifier and data, and where to send frames."""


def on_one_bus(*nodes: OnFrame) -> OnFrame:
    """Several instruments as one end of a bus: each hears every frame and answers for itself."""

    def on_frame(can_id: int, data: bytes, tx: Callable[[int, bytes], None]) -> None:
        for node in nodes:
            node(can_id, data, tx)

    return on_frame


class CanCable:
    """A bus to a simulated instrument; what `drivers.wires.can_transport` calls a transport.

    Args:
        world: virtual time.
        on_frame: the instrument's own.

    """

    def __init__(self, world: World, on_frame: OnFrame) -> None:
        self._world = world
        self._on_frame = on_frame
        self._received: deque[Frame] = deque()

    def send(self, can_id: int, data: bytes) -> None:
        """Pass a frame to the instrument."""
        self._on_frame(can_id, data, self._receive)

    def recv(self, seconds: float) -> Frame | None:
        """The next frame, waiting at most that many virtual seconds for it."""
        received = self._received
        if not received:
            self._world.run_until(self._world.now() + seconds, lambda: bool(received))
        return received.popleft() if received else None

    def close(self) -> None:
        """Forget what has come and was not read."""
        self._received.clear()

    def _receive(self, can_id: int, data: bytes) -> None:
        self._received.append((can_id, data))
