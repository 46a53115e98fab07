"""A simulated CAN bus inside the process, under virtual time."""

from __future__ import annotations

import errno
from collections import deque
from collections.abc import Callable
from math import inf

from rig.contracts.declared.frames import packed, unpacked
from rig.sims.wires.tampering import UNTOUCHED, Tampering
from rig.sims.world import World

Frame = tuple[int, bytes]
"""Identifier (11 bits; 29 with `EXTENDED` added) and data."""

Transmit = Callable[[int, bytes], None]
"""Sends a frame."""

OnFrame = Callable[[int, bytes, Transmit], None]
"""A node: takes a frame's identifier and data, and a function to send frames."""

Connected = Callable[[Transmit, float], None]
"""Tells a node that sends by itself that somebody listens, and how many seconds at least."""

_LISTENS_S = 10.0  # a node need not send to somebody who listens no more: a week without readings costs no time


def on_one_bus(*nodes: OnFrame) -> OnFrame:
    """Several instruments at one end of a bus: each receives every frame and answers separately."""

    def on_frame(can_id: int, data: bytes, tx: Transmit) -> None:
        for node in nodes:
            node(can_id, data, tx)

    return on_frame


class CanCable:
    """A bus to a simulated instrument; a transport of `rig.drivers.wires.can_transport`.

    Args:
        world: virtual time.
        on_frame: the instrument's function.
        tampering: faults of the bus.
        connected: told that somebody listens, if the instrument sends by itself.

    Raises:
        OSError: there is no adapter.
    """

    def __init__(
        self,
        world: World,
        on_frame: OnFrame,
        tampering: Tampering = UNTOUCHED,
        connected: Connected | None = None,
    ) -> None:
        self._world = world
        self._on_frame = on_frame
        self._received: deque[Frame] = deque()
        self._connected, self._told_until = connected, -inf
        self._repeated: dict[int, int] = {}
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
        self._listens()
        self._tampering.to_twin(packed(can_id, data), self._forward, self._deliver)

    def repeat(self, can_id: int, data: bytes, seconds: float) -> None:
        """Pass a frame now and again and again; see `rig.drivers.wires.can_transport.CanTransport`."""
        self.send(can_id, data)
        number = self._repeated[can_id] = self._repeated.get(can_id, 0) + 1

        def again() -> None:
            if self._repeated.get(can_id) == number and self._alive():
                if not self._tampering.off:
                    self._tampering.to_twin(packed(can_id, data), self._forward, self._deliver)
                self._world.call_in(seconds, again)

        self._world.call_in(seconds, again)

    def recv(self, seconds: float) -> Frame | None:
        """The next frame, waiting at most this many virtual seconds. Raises `OSError` if the bus is lost."""
        received = self._received
        self._listens()
        if not received:
            self._world.run_until(self._world.now() + seconds, lambda: bool(received) or not self._alive())
        self._check()
        return received.popleft() if received else None

    def close(self) -> None:
        """Discard received frames, and repeat none."""
        self._received.clear()
        self._repeated.clear()

    def _listens(self) -> None:
        now = self._world.now()
        if self._connected is not None and now > self._told_until - _LISTENS_S / 2:
            self._told_until = now + _LISTENS_S
            self._connected(self._answer, _LISTENS_S)

    def _forward(self, message: bytes) -> None:
        self._on_frame(*unpacked(message), self._answer)

    def _answer(self, can_id: int, data: bytes) -> None:
        self._tampering.to_host(packed(can_id, data), self._deliver)

    def _deliver(self, message: bytes) -> None:
        if not self._tampering.off:
            self._received.append(unpacked(message))

    def _alive(self) -> bool:
        return self._tampering.connection == self._connection

    def _check(self) -> None:
        if not self._alive():
            raise OSError(errno.ENODEV, "No such device")
