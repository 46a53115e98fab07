"""CAN: buses shared by their instruments, with SDO or with raw frames."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import ParamSpec, TypeVar

from canopen.objectdictionary import ObjectDictionary

from rig.drivers.clock import Clock
from rig.drivers.errors import BadReply, Unreachable
from rig.drivers.wires.addresses import CanAddress
from rig.drivers.wires.can_bus import BUS_ERRORS, CanBus
from rig.drivers.wires.can_node import CanNode
from rig.drivers.wires.can_transport import CanTransport
from rig.drivers.wires.serial_port import Tap

_MOST_BUFFERED = 100_000  # maximum number of frames in an adapter; a bus with more frames at once never becomes silent

Answer = TypeVar("Answer")
Given = ParamSpec("Given")


class CanLine:
    """A bus for one instrument; the instrument may have several nodes.

    Args:
        bus: the bus.
        address: its address, for messages.
        label: the bench's name for the instrument.
        tap: called for every frame.
    """

    def __init__(self, bus: CanBus, address: str, label: str = "", tap: Tap | None = None) -> None:
        self._bus = bus
        self._address = address
        self._label = label
        self._tap = tap
        self.where = f"{label} at {address}" if label else address

    @property
    def heard(self) -> dict[int, None]:
        """Identifiers of some frames of anybody since this was cleared."""
        return self._bus.heard

    def node(self, node: int, dictionary: ObjectDictionary, timeout_s: float = 0.3) -> CanNode:
        """One of its nodes.

        Raises:
            Unreachable: another instrument on this bus has this node.

        """
        if node in self._bus.network:
            raise Unreachable(f"{self.where}: node {node} is already declared on this bus; every node is one drive")
        return CanNode(self._bus, node, dictionary, self._address, self._label, self._tap, timeout_s)

    def listen(self, can_id: int, heard: Callable[[bytes], None]) -> None:
        """Call `heard` with the data of every frame with this identifier, at every reception.

        Raises:
            Unreachable: another instrument on this bus has this identifier.
        """
        if can_id in self._bus.network.subscribers:
            raise Unreachable(f"{self.where}: identifier {can_id:03X}h is already declared on this bus")
        self._bus.network.subscribe(can_id, lambda can_id, data, timestamp: heard(bytes(data)))

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame; raises `Unreachable`."""
        self._on_bus(self._bus.network.send_message, can_id, data)

    def repeat(self, can_id: int, data: bytes, seconds: float) -> None:
        """Send a frame now and every so many bench seconds, in place of an earlier one; raises `Unreachable`."""
        self._on_bus(self._bus.repeat, can_id, data, seconds)

    def pump(self, seconds: float) -> bool:
        """Receive one frame of any identifier, waiting at most this many bench seconds; returns whether one came."""
        return self._on_bus(self._bus.pump, seconds)

    def flush(self) -> None:
        """Receive all waiting frames, so that later ones are new."""
        for _ in range(_MOST_BUFFERED):
            if not self.pump(0.0):
                return
        raise BadReply(f"{self.where}: the bus never becomes silent; is it overloaded?")

    def _on_bus(self, action: Callable[Given, Answer], *given: Given.args, **options: Given.kwargs) -> Answer:
        try:
            self._bus.begin(self.where, self._log)
            return action(*given, **options)
        except BUS_ERRORS as error:
            self._bus.lost(self.where, error)

    def _log(self, direction: str, data: bytes) -> None:
        if self._tap:
            self._tap(self._label, direction, data)

    def close(self) -> None:
        """Release the bus; idempotent."""
        self._bus.close()


class CanWires:
    """Opens every bus once.

    Args:
        clock: bench time.
        simulated: makes the transport of a `sim://` address.
        tap: called for every frame.
    """

    def __init__(
        self, clock: Clock, simulated: Callable[[str], CanTransport] | None = None, tap: Tap | None = None
    ) -> None:
        self._clock = clock
        self._simulated = simulated
        self._tap = tap
        self._buses: dict[tuple[str, str], tuple[CanAddress, CanBus]] = {}

    def line(self, address: str, label: str = "") -> CanLine:
        """The bus at `address`; raises `Unreachable`."""
        parsed = CanAddress.parse(address)
        first, bus = self._buses.get((parsed.interface, parsed.channel)) or self._opened(parsed, label)
        if first != parsed:
            raise Unreachable(f"{label or address}: {parsed.channel} is already open at another bit rate")
        return CanLine(bus, address, label, self._tap)

    def close(self) -> None:
        """Release every bus; idempotent."""
        for _, bus in self._buses.values():
            bus.close()

    def _opened(self, address: CanAddress, label: str) -> tuple[CanAddress, CanBus]:
        opener: Callable[[], CanTransport] | None = None
        if address.interface == "sim":
            if self._simulated is None:
                raise Unreachable(f"{label or address.channel}: there is no simulated bench in this process")
            opener = partial(self._simulated, address.channel)
        found = (address, CanBus(address, self._clock, opener))
        self._buses[address.interface, address.channel] = found
        return found
