"""One CAN bus: frames are received on the clock passed to it, and given to their listeners.

Frames are python-can's. canopen would receive them in a thread and wait on a queue for 0.3 s of real time. Here every
wait for a reply pumps the bus, so no thread is needed and virtual time works.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from functools import partial
from typing import NoReturn

import can
import canopen

from rig.contracts.declared.frames import packed
from rig.drivers.clock import Clock
from rig.drivers.errors import BadReply, Unreachable
from rig.drivers.wires.addresses import CanAddress
from rig.drivers.wires.can_transport import BusTransport, CanTransport

BUS_ERRORS = (OSError, can.CanError)
"""Errors of a lost bus."""

_QUIET_S = 0.05  # chosen; nodes answer an SDO request within some milliseconds
_SDO_REPLIES = range(0x581, 0x600)  # 580h and the node, 1 to 127 (CiA 301)
_MOST_SHOWN = 12  # identifiers in a message; chosen
_TALKS_ON_S = 5.0  # chosen: a bus that still sends then has another master


class CanBus:
    """One bus.

    Args:
        address: its address.
        clock: bench time.
        opener: makes the transport of a simulated bus; may raise `OSError`.

    Attributes:
        heard: identifiers of the first frames since this was cleared.

    Raises:
        Unreachable: it cannot be opened.
    """

    def __init__(self, address: CanAddress, clock: Clock, opener: Callable[[], CanTransport] | None = None) -> None:
        self.clock = clock
        self.network = _Network(self._send)
        self._open = opener or partial(BusTransport, address)
        self._log: Callable[[str, bytes], None] = _unlogged
        self._newest = 0
        self.heard: dict[int, None] = {}
        self._repeated: dict[int, tuple[bytes, float]] = {}
        self._transport: CanTransport | None = self._opened(f"{address.interface} {address.channel}")

    def begin(self, where: str, log: Callable[[str, bytes], None]) -> None:
        """Open the bus if necessary; from now on `log` is called with ("tx" or "rx", identifier and data)."""
        self._log = log
        if self._transport is None:
            self._transport = self._opened(where)
            for can_id, (data, seconds) in self._repeated.items():  # the instrument still wants them
                self.repeat(can_id, data, seconds)

    def repeat(self, can_id: int, data: bytes, seconds: float) -> None:
        """Send a frame now and every so many bench seconds from now on, in place of an earlier one."""
        assert self._transport is not None
        self._log("tx", packed(can_id, data))
        self._repeated[can_id] = data, seconds
        clock = self.clock
        self._transport.repeat(can_id, data, clock.timeout(seconds) - clock.timeout(0.0))

    def pump(self, seconds: float) -> bool:
        """Receive one frame and give it to its listeners, waiting at most this many bench seconds; returns whether one
        came.
        """
        assert self._transport is not None
        frame = self._transport.recv(self.clock.timeout(seconds) if seconds > 0 else 0.0)
        if frame is None:
            return False
        can_id, data = frame
        self._newest = can_id
        if len(self.heard) < _MOST_SHOWN:
            self.heard[can_id] = None
        self._log("rx", packed(can_id, data))
        self.network.notify(can_id, bytearray(data), 0.0)
        return True

    def drain(self, where: str) -> None:
        """Listen until no SDO reply has come for a while. Raises `BadReply` if they do not end."""
        end = self.clock.now() + _TALKS_ON_S
        quiet_at = self.clock.now() + _QUIET_S
        while (left := quiet_at - self.clock.now()) > 0:
            if self.pump(left) and self._newest in _SDO_REPLIES:
                quiet_at = self.clock.now() + _QUIET_S
            if self.clock.now() > end:
                raise BadReply(f"{where}: SDO replies never end; is there a second master on the bus?")

    def lost(self, where: str, error: Exception) -> NoReturn:
        """Give up the bus; it opens again at its next use."""
        self._released()
        raise Unreachable(f"{where} was lost ({error}); check cable, termination and power") from error

    def close(self) -> None:
        """Release the bus; idempotent."""
        self._repeated.clear()
        self._released()

    def _released(self) -> None:
        transport, self._transport = self._transport, None
        if transport is not None:
            with contextlib.suppress(*BUS_ERRORS):  # an error while closing does not matter
                transport.close()

    def _send(self, can_id: int, data: bytes) -> None:
        assert self._transport is not None
        self._log("tx", packed(can_id, data))
        self._transport.send(can_id, data)

    def _opened(self, where: str) -> CanTransport:
        try:
            return self._open()
        except (*BUS_ERRORS, ValueError, NotImplementedError, ImportError, NameError) as error:
            # python-can raises NameError if an adapter's driver library is not installed
            raise Unreachable(
                f"{where} cannot be opened ({error}); check power, cable, address and permissions"
            ) from error


class _Network(canopen.Network):
    """canopen's network without a bus or a thread."""

    def __init__(self, send: Callable[[int, bytes], None]) -> None:
        super().__init__()
        self._send = send

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self._send(can_id, bytes(data))


def _unlogged(direction: str, data: bytes) -> None:
    """Does nothing: the default log."""
