"""CAN: one bus shared by its nodes, spoken to by SDO or by frames of their own.

Frames are python-can's, the SDO protocol and the object dictionary canopen's; the waiting is ours. canopen would
wait on a queue that another thread fills, for 0.3 s of the machine's time; here whoever waits for a reply pumps the
bus on the clock that was handed in, so no thread is needed and virtual time works.
"""

from __future__ import annotations

import contextlib
import io
import logging
import queue
import struct
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import NoReturn, TypeVar, cast

import can
import canopen
from canopen.objectdictionary import ObjectDictionary, ObjectDictionaryError, ODVariable
from canopen.objectdictionary.eds import import_eds
from canopen.sdo.client import SdoClient, WritableStream
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from drivers.clock import Clock
from drivers.errors import BadReply, InstrumentError, NoReply, Unreachable
from drivers.wires.can_transport import BusTransport, CanAddress, CanTransport
from drivers.wires.serial_line import Tap

logging.getLogger("canopen").addHandler(logging.NullHandler())  # it prints what we raise

_QUIET_S = 0.05
_SDO_REPLIES = range(0x581, 0x600)
_UPLOADED, _DOWNLOADED, _ABORTED = 0x40, 0x60, 0x80  # the server's command specifiers that name the object
_DEVICE_TYPE = 0x1000  # every node has it (CiA 301)
_TALKS_ON_S = 5.0
_MOST_BUFFERED = 100_000  # frames an adapter may still hold; a bus that brings more at once never falls quiet
_BUS_ERRORS = (OSError, can.CanError)

Answer = TypeVar("Answer")


def read_eds(text: str, node: int) -> ObjectDictionary:
    """The object dictionary that an electronic data sheet describes.

    Args:
        text: the data sheet (CiA 306).
        node: node identifier, for entries that depend on it.

    Raises:
        ValueError: it cannot be read.

    """
    try:
        dictionary: ObjectDictionary = import_eds(io.StringIO(text), node)  # type: ignore[no-untyped-call]  # canopen's
    except Exception as error:  # the parser lets every kind of error through
        raise ValueError(f"the EDS cannot be read: {error}") from error
    if not dictionary.indices:
        raise ValueError("the EDS describes no objects")
    return dictionary


class CanBus:
    """One bus.

    Args:
        address: where it is.
        clock: bench time.
        opener: makes the transport of a simulated bus; may raise `OSError`.

    Raises:
        Unreachable: it cannot be opened.

    """

    def __init__(self, address: CanAddress, clock: Clock, opener: Callable[[], CanTransport] | None = None) -> None:
        self.clock = clock
        self.network = _Network(self._send)
        self._open = opener or partial(BusTransport, address)
        self._log: Callable[[str, bytes], None] = _unlogged
        self._newest = 0
        self._transport: CanTransport | None = self._opened(f"{address.interface} {address.channel}")

    def begin(self, where: str, log: Callable[[str, bytes], None]) -> None:
        """Make sure that the bus is open; from now on `log` sees ("tx" or "rx", identifier and data)."""
        self._log = log
        if self._transport is None:
            self._transport = self._opened(where)

    def pump(self, seconds: float) -> bool:
        """Take one frame and hand it to whom it concerns, waiting at most so many bench seconds; whether one came."""
        assert self._transport is not None
        frame = self._transport.recv(self.clock.timeout(seconds) if seconds > 0 else 0.0)
        if frame is None:
            return False
        can_id, data = frame
        self._newest = can_id
        self._log("rx", _on_wire(can_id, data))
        self.network.notify(can_id, bytearray(data), 0.0)
        return True

    def drain(self, where: str) -> None:
        """Listen until no SDO reply has come for a while, whatever else is sent; raises `BadReply` if they go on."""
        end = self.clock.now() + _TALKS_ON_S
        quiet_at = self.clock.now() + _QUIET_S
        while (left := quiet_at - self.clock.now()) > 0:
            if self.pump(left) and self._newest in _SDO_REPLIES:
                quiet_at = self.clock.now() + _QUIET_S
            if self.clock.now() > end:
                raise BadReply(f"{where}: SDO replies never end; is there a second master on the bus?")

    def lost(self, where: str, error: Exception) -> NoReturn:
        """Give the bus up; it opens again if it is used again."""
        self.close()
        raise Unreachable(f"{where} was lost ({error}); check cable, termination and power") from error

    def close(self) -> None:
        """Release the bus; idempotent."""
        transport, self._transport = self._transport, None
        if transport is not None:
            with contextlib.suppress(*_BUS_ERRORS):  # whoever closes does not care that it was gone already
                transport.close()

    def _send(self, can_id: int, data: bytes) -> None:
        assert self._transport is not None
        self._log("tx", _on_wire(can_id, data))
        self._transport.send(can_id, data)

    def _opened(self, where: str) -> CanTransport:
        try:
            return self._open()
        except (*_BUS_ERRORS, ValueError, NotImplementedError, ImportError) as error:
            raise Unreachable(
                f"{where} cannot be opened ({error}); check power, cable, address and permissions"
            ) from error


class _Network(canopen.Network):
    """canopen's network without a bus or a thread of its own."""

    def __init__(self, send: Callable[[int, bytes], None]) -> None:
        super().__init__()
        self._send = send

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self._send(can_id, bytes(data))


class _Responses:
    """What canopen takes for the queue that a thread fills. Waiting for a reply pumps the bus."""

    def __init__(self, bus: CanBus, seconds: float) -> None:
        self._bus = bus
        self._seconds = seconds
        self._frames: deque[bytes] = deque()
        self._asked = b""
        self.foreign = b""

    def expect(self, index: int, subindex: int) -> None:
        """Only what is about this object counts from now on: canopen takes any confirmation for that of its write."""
        self._asked = struct.pack("<HB", index, subindex)
        self.foreign = b""

    def put(self, frame: bytes) -> None:
        names_object = len(frame) == 8 and frame[0] & 0xE0 in (_UPLOADED, _DOWNLOADED, _ABORTED)
        if not names_object or frame[1:4] == self._asked:
            self._frames.append(frame)
        else:
            self.foreign = frame

    def empty(self) -> bool:
        """Asked before a request is sent: what is still here is from before, and is forgotten."""
        self._frames.clear()
        return True

    def get(self, block: bool = True, timeout: float | None = None) -> bytes:
        clock = self._bus.clock
        end = clock.now() + self._seconds
        while not self._frames:
            left = end - clock.now()
            if left <= 0 or not (self._bus.pump(left) or clock.now() < end):
                raise queue.Empty
        return self._frames.popleft()


class CanNode:
    """One node on a bus.

    Args:
        bus: what it is on.
        node: node identifier, 1 to 127.
        dictionary: its objects.
        address: the bus's address, for messages.
        label: the bench's name for the instrument.
        tap: sees every frame, as two bytes of identifier and the data.
        timeout_s: bench seconds to wait for a reply.

    Attributes:
        exchanges: requests sent so far, repeated ones included.
        retries: reads that had to be repeated.

    """

    def __init__(
        self,
        bus: CanBus,
        node: int,
        dictionary: ObjectDictionary,
        address: str,
        label: str = "",
        tap: Tap | None = None,
        timeout_s: float = 0.3,
    ) -> None:
        self._bus = bus
        self._dictionary = dictionary
        self._label = label or address
        self._tap = tap
        self._timeout_s = timeout_s
        self._out_of_step = False
        self._owed = False  # an answer that may still come
        self.where = f"{f'{label} at ' if label else ''}{address} node {node}"
        self.exchanges = 0
        self.retries = 0
        remote = canopen.RemoteNode(node, dictionary)
        self._responses = _Responses(bus, timeout_s)
        remote.sdo.responses = cast("queue.Queue[bytes]", self._responses)
        bus.network[node] = remote
        self._sdo: SdoClient = remote.sdo

    def read(self, index: int, subindex: int = 0) -> int | str:
        """Read an object: a number, or text for a string.

        Raises:
            NoReply, BadReply: twice in a row.
            InstrumentError: the node refuses; its code is the SDO abort code.
            Unreachable: the bus is gone.

        """
        variable = self._variable(index, subindex)
        try:
            data = self._upload(index, subindex, f"reading {_name(variable)}")
        except (NoReply, BadReply):
            self.retries += 1
            data = self._upload(index, subindex, f"reading {_name(variable)}")
        try:
            return cast("int | str", variable.decode_raw(data))
        except ObjectDictionaryError as error:
            raise BadReply(
                f"{self.where} answered {data!r} for {_name(variable)}; does the EDS fit the node?"
            ) from error

    def number(self, index: int, subindex: int = 0) -> int:
        """Read an object that is a number; otherwise as `read`."""
        value = self.read(index, subindex)
        if isinstance(value, str):
            raise BadReply(f"{self.where} answered the text {value!r} where a number was expected")
        return value

    def write(self, index: int, value: int, subindex: int = 0) -> None:
        """Write an object. Never repeated.

        Raises:
            NoReply, BadReply: it may have been carried out or not: read back.
            InstrumentError: the node refuses; its code is the SDO abort code.
            Unreachable: the bus is gone.

        """
        variable = self._variable(index, subindex)
        data = variable.encode_raw(value)

        def request() -> None:
            self._responses.expect(index, subindex)
            # Not SdoClient.download: its buffer is flushed once more after an error, which repeats the write.
            stream: io.RawIOBase = WritableStream(self._sdo, index, subindex, len(data))  # type: ignore[no-untyped-call]  # canopen's
            stream.write(data)

        self._ask(request, f"writing {value} to {_name(variable)}")

    def close(self) -> None:
        """Release the bus; idempotent. It opens again if anybody on it speaks again."""
        self._bus.close()

    def _variable(self, index: int, subindex: int) -> ODVariable:
        variable = self._dictionary.get_variable(index, subindex)
        if variable is None:
            raise BadReply(f"{self.where}: the EDS has no object {index:04X}h:{subindex:02X}")
        return variable

    def _upload(self, index: int, subindex: int, what: str) -> bytes:
        """Read an object. A node answers in order: after a missing answer it is asked for another object first.

        Whatever is late has come when that answer comes. A write is not held up by this: a stop must go out at once.
        """

        def request(index: int, subindex: int) -> bytes:
            self._responses.expect(index, subindex)
            data: bytes = self._sdo.upload(index, subindex)
            return data

        if self._owed:
            self._ask(lambda: request(_DEVICE_TYPE, 0), what)
            self._owed, self._out_of_step = False, True
        return self._ask(lambda: request(index, subindex), what)

    def _ask(self, request: Callable[[], Answer], what: str) -> Answer:
        self.exchanges += 1
        try:
            self._bus.begin(self.where, self._log)
            if self._out_of_step:
                self._bus.drain(self.where)
                self._out_of_step = False
            return request()
        except SdoAbortedError as error:
            text = SdoAbortedError.CODES.get(error.code, "no reason known")
            raise InstrumentError(self.where, error.code, f"{what}: {text} (SDO abort {error.code:08X}h)") from error
        except SdoCommunicationError as error:
            self._out_of_step = True
            if "No SDO response" in str(error):
                self._owed = True
                if foreign := self._responses.foreign:
                    index, subindex = struct.unpack("<HB", foreign[1:4])
                    raise BadReply(
                        f"{self.where}, {what}: it answered about {index:04X}h:{subindex:02X} instead; "
                        f"is there another SDO client on the bus?"
                    ) from error
                raise NoReply(
                    f"{self.where} did not answer {what} within {self._timeout_s:g} s; "
                    f"is it powered, terminated, and set to this node and bit rate?"
                ) from error
            raise BadReply(f"{self.where}, {what}: {error}") from error
        except _BUS_ERRORS as error:
            self._out_of_step = True
            self._bus.lost(self.where, error)

    def _log(self, direction: str, data: bytes) -> None:
        if self._tap:
            self._tap(self._label, direction, data)


class CanLine:
    """A bus as one instrument sees it; the instrument may be several nodes.

    Args:
        bus: the bus.
        address: its address, for messages.
        label: the bench's name for the instrument.
        tap: sees every frame.

    """

    def __init__(self, bus: CanBus, address: str, label: str = "", tap: Tap | None = None) -> None:
        self._bus = bus
        self._address = address
        self._label = label
        self._tap = tap
        self.where = f"{label} at {address}" if label else address

    def node(self, node: int, dictionary: ObjectDictionary, timeout_s: float = 0.3) -> CanNode:
        """One of its nodes.

        Raises:
            Unreachable: another instrument on this bus has this node.

        """
        if node in self._bus.network:
            raise Unreachable(f"{self.where}: node {node} is already declared on this bus; every node is one drive")
        return CanNode(self._bus, node, dictionary, self._address, self._label, self._tap, timeout_s)

    def listen(self, can_id: int, heard: Callable[[bytes], None]) -> None:
        """Have `heard` called with the data of every frame with this identifier, whoever is taking frames.

        Raises:
            Unreachable: another instrument on this bus has this identifier.

        """
        if can_id in self._bus.network.subscribers:
            raise Unreachable(f"{self.where}: identifier {can_id:03X}h is already declared on this bus")
        self._bus.network.subscribe(can_id, lambda can_id, data, timestamp: heard(bytes(data)))

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame; raises `Unreachable`."""
        self._on_bus(lambda: self._bus.network.send_message(can_id, data))

    def pump(self, seconds: float) -> bool:
        """Take one frame, whomever it concerns, waiting at most so many bench seconds; whether one came."""
        return self._on_bus(lambda: self._bus.pump(seconds))

    def flush(self) -> None:
        """Take what has already come, so that what comes now is new."""
        for _ in range(_MOST_BUFFERED):
            if not self.pump(0.0):
                return
        raise BadReply(f"{self.where}: the bus never falls quiet; is it overloaded?")

    def _on_bus(self, action: Callable[[], Answer]) -> Answer:
        try:
            self._bus.begin(self.where, self._log)
            return action()
        except _BUS_ERRORS as error:
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
        tap: sees every frame.

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


def _name(variable: ODVariable) -> str:
    return f"{variable.index:04X}h:{variable.subindex:02X} ({variable.name})"


def _on_wire(can_id: int, data: bytes) -> bytes:
    return can_id.to_bytes(2, "big") + data


def _unlogged(direction: str, data: bytes) -> None:
    """Nobody listens."""
