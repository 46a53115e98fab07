"""A simulated CAN bus inside the process, under virtual time."""

from __future__ import annotations

import errno
from collections import deque
from collections.abc import Callable

from rig.sims.wires.tampering import UNTOUCHED, Tampering
from rig.sims.world import World

Frame = tuple[int, bytes]
"""Identifier (11 bits) and data."""

OnFrame = Callable[[int, bytes, Callable[[int, bytes], None]], None]
"""A node: takes a frame's identifier and data, and a function to send frames."""


def on_one_bus(*nodes: OnFrame) -> OnFrame:
    """Several instruments at one end of a bus: each receives every frame and answers separately."""

    def on_frame(can_id: int, data: bytes, tx: Callable[[int, bytes], None]) -> None:
        for node in nodes:
            node(can_id, data, tx)

    return on_frame


class CanCable:
    """A bus to a simulated instrument; a transport of `rig.drivers.wires.can_transport`.

    Args:
        world: virtual time.
        on_frame: the instrument's function.
        tampering: faults of the bus.

    Raises:
        OSError: there is no adapter.
    """

    def __init__(self, world: World, on_frame: OnFrame, tampering: Tampering = UNTOUCHED) -> None:
        self._world = world
        self._on_frame = on_frame
        self._received: deque[Frame] = deque()
        self._tampering = tampering
        if tampering.unplugged:
            raise OSError(errno.ENODEV, "No such device")
        self._connection = tampering.connection

    def send(self, can_id: int, data: bytes) -> None:
        """Pass a frame to the instrument. Raises `OSError` or `can.CanError` if the bus is lost."""
        self._check()
        if self._tampering.off:
            import can  # noqa: PLC0415 - 0.06 s, and most benches have no bus

            raise can.CanOperationError("Failed to transmit: the controller is bus-off", errno.ENETDOWN)
        self._tampering.to_twin(_packed(can_id, data), self._forward, self._deliver)

    def recv(self, seconds: float) -> Frame | None:
        """The next frame, waiting at most this many virtual seconds. Raises `OSError` if the bus is lost."""
        received = self._received
        if not received:
            self._world.run_until(self._world.now() + seconds, lambda: bool(received) or not self._alive())
        self._check()
        return received.popleft() if received else None

    def close(self) -> None:
        """Discard received frames."""
        self._received.clear()

    def _forward(self, message: bytes) -> None:
        self._on_frame(*_unpacked(message), self._answer)

    def _answer(self, can_id: int, data: bytes) -> None:
        self._tampering.to_host(_packed(can_id, data), self._deliver)

    def _deliver(self, message: bytes) -> None:
        if not self._tampering.off:
            self._received.append(_unpacked(message))

    def _alive(self) -> bool:
        return self._tampering.connection == self._connection

    def _check(self) -> None:
        if not self._alive():
            raise OSError(errno.ENODEV, "No such device")


def _packed(can_id: int, data: bytes) -> bytes:
    return can_id.to_bytes(2, "big") + data


def _unpacked(message: bytes) -> Frame:
    return int.from_bytes(message[:2], "big"), message[2:]
