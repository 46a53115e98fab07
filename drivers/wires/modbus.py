"""Modbus: one master on a TCP connection or a serial line, shared by the devices on it.

The protocol is pymodbus's; the wire under it and the policy above it are ours. Its silent resends are off: a read
may be repeated once, a write never, unless the device itself said that it did nothing (exception 6, busy).
"""

from __future__ import annotations

import contextlib
import logging
import struct
from collections.abc import Callable, Sequence
from functools import partial
from itertools import count
from typing import NoReturn

from pymodbus import FramerType
from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ModbusException
from pymodbus.pdu import ExceptionResponse, ModbusPDU

from drivers.clock import Clock
from drivers.errors import BadReply, InstrumentError, NoReply, Unreachable
from drivers.wires.addresses import ModbusAddress
from drivers.wires.modbus_rtu import OutOfStep, ends_with_answer, fits, questions
from drivers.wires.modbus_transport import Transport, open_transport, silence_s
from drivers.wires.serial_line import Tap

logging.getLogger("pymodbus").addHandler(logging.NullHandler())  # it prints what we raise

_QUIET_S = 0.3
_SERVER_SILENCE_S = 0.02  # a serial server sends on what it has after at most some milliseconds
_TALKS_ON_S = 10.0
_LEAST_WAIT_S = 1e-4
_BUSY, _BUSY_WAIT_S, _BUSY_TRIES = 6, 0.2, 10
_EXCEPTIONS = {
    1: "it does not have this function",
    2: "it has no such register",
    3: "it does not accept this value",
    4: "it failed to carry it out",
    5: "it has accepted the request and needs long for it",
    6: "it is busy",
    8: "its memory has a parity error",
    10: "the gateway is misconfigured or overloaded",
    11: "the gateway got no answer from the device",
}


class _Client(ModbusTcpClient):
    """pymodbus's synchronous client with our wire under it."""

    def __init__(self, framer: FramerType, seconds: float, send: Callable[[bytes], None], hear: Callable[[], bytes]):
        super().__init__("", framer=framer, timeout=seconds, retries=0)
        self._send = send
        self._hear = hear

    def connect(self) -> bool:
        return True

    def close(self) -> None:
        """Nothing to close: the wire is not ours."""

    def send(self, request: bytes, addr: tuple[str, int] | None = None) -> int:
        self._send(request)
        return len(request)

    def recv(self, size: int | None) -> bytes:
        return self._hear()


class ModbusWire:
    """One connection or line, shared by the devices on it.

    Args:
        address: any of its devices' addresses.
        clock: bench time.
        opener: makes the transport of a simulated device; may raise `OSError`.

    Raises:
        Unreachable: it cannot be opened.

    """

    def __init__(self, address: ModbusAddress, clock: Clock, opener: Callable[[], Transport] | None = None) -> None:
        self.clock = clock
        self._open = opener or partial(open_transport, address, clock)
        self._rtu = address.rtu and not address.simulated
        self._framer = FramerType.RTU if self._rtu else FramerType.SOCKET
        self._silence_s = _SERVER_SILENCE_S if address.host else silence_s(address.baud)
        self._out_of_step = False
        self._owing: set[int] = set()  # units that may yet answer what they were asked before
        self._numbers = count(1)
        self._trusted = False
        self._heard_at = clock.now()
        self._sent = b""
        self._log: Callable[[str, bytes], None] = _unlogged
        self._heard = b""
        self._seconds = self._asked_s = 1.0
        self._client: _Client | None = None
        self._last_number = 0
        self._transport: Transport | None = self._connected(address.place)

    def ask(
        self,
        request: Callable[[ModbusTcpClient], ModbusPDU],
        *,
        unit: int,
        where: str,
        seconds: float,
        log: Callable[[str, bytes], None],
        known: tuple[int, int] = (0, 0),
    ) -> ModbusPDU:
        """Send one request and wait for its reply, which may be an exception response.

        Args:
            request: makes the request with a client.
            unit: the device it goes to.
            where: the device, for messages.
            seconds: bench seconds to wait.
            log: sees ("tx" or "rx", bytes).
            known: first address and number of words in a row that the device is known to have.

        Raises:
            NoReply: nothing came in time.
            BadReply: what came is no reply to this, or not only.
            OutOfStep: more came after an earlier reply; nothing was sent.
            Unreachable: the wire is gone.

        """
        self._log, self._heard = log, b""
        self._seconds, self._asked_s = self.clock.timeout(seconds), seconds
        try:
            if self._transport is None:
                self._transport = self._connected(where)
            if self._rtu:
                self._refuse_unasked(unit, where)
            if self._out_of_step:
                self._drain(where)
            if unit in self._owing:
                self._synchronise(unit, known, where)
            if self._client is None:
                self._client = _Client(self._framer, self._seconds, self._send, self._hear)
                self._client.transaction.next_tid = self._last_number
            self._heard = b""
            reply = request(self._client)
            if self._rtu and not fits(self._heard, self._sent):
                raise ModbusException("more or less than the one reply")
            self._trusted = True
            return reply
        except ModbusException as error:
            self.doubt(unit)
            if self._heard:
                raise BadReply(
                    f"{where} sent {self._heard[:40]!r}, which is no reply to the request, or not only; "
                    f"check baud rate, parity, unit, echo, and whether it speaks TCP or RTU"
                ) from error
            raise self._silent(where) from error
        except OSError as error:
            self._lost(where, unit, error)

    def doubt(self, unit: int) -> None:
        """Bring the line, and this unit, back in step before the next request."""
        if self._client is not None:
            self._last_number = self._client.transaction.next_tid  # else a late reply would have the next one's number
        self._client = None  # it counts failures and acts on them
        self._out_of_step = True
        self._trusted = False
        if self._rtu:
            self._owing.add(unit)

    def close(self) -> None:
        """Release the wire; idempotent. It opens again if it is used again."""
        transport, self._transport = self._transport, None
        if transport is not None:
            with contextlib.suppress(OSError):  # whoever closes does not care that it was gone already
                transport.close()

    def _send(self, data: bytes) -> None:
        assert self._transport is not None
        self._log("tx", data)
        self._sent = data
        self._transport.send(data)

    def _hear(self) -> bytes:
        assert self._transport is not None
        heard = self._transport.recv(self._seconds)
        if heard:
            self._log("rx", heard)
            self._heard += heard
            self._heard_at = self.clock.now()
        return heard

    def _refuse_unasked(self, unit: int, where: str) -> None:
        """Wait for the silence between two frames; what comes in it puts the reply before it in doubt."""
        assert self._transport is not None
        self.clock.sleep(self._heard_at + self._silence_s - self.clock.now())
        heard = self._transport.recv(_LEAST_WAIT_S)
        if not heard:
            return
        self._log("rx", heard)
        trusted = self._trusted
        self.doubt(unit)
        if trusted:
            raise OutOfStep(
                f"{where}: {heard[:40]!r} came after a reply, unasked; that reply may have been a late one to an "
                f"earlier request; nothing was sent; is there a second master, an echo or noise on the line?"
            )

    def _synchronise(self, unit: int, known: tuple[int, int], where: str) -> None:
        """Ask what only one answer fits; everything before that answer was late, and is forgotten."""
        for question in questions(unit, next(self._numbers), known):
            self._heard = b""
            end = self.clock.now() + _TALKS_ON_S
            self._send(question)
            while self._hear() and self.clock.now() < end:
                if ends_with_answer(self._heard, question):
                    self._owing.discard(unit)
                    self._drain(where)
                    return
        self.doubt(unit)
        raise self._silent(where)

    def _silent(self, where: str) -> NoReply:
        return NoReply(
            f"{where} did not answer within {self._asked_s:g} s; is it switched on, connected, and set to this unit?"
        )

    def _drain(self, where: str) -> None:
        """Listen until the line is silent, so that a late reply cannot answer the next request."""
        assert self._transport is not None
        end = self.clock.now() + _TALKS_ON_S
        while heard := self._transport.recv(self.clock.timeout(_QUIET_S)):
            self._log("rx", heard)
            if self.clock.now() > end:
                raise BadReply(f"{where}: the line never falls silent; is there a second master on it?")
        self._out_of_step = False

    def _connected(self, where: str) -> Transport:
        try:
            return self._open()
        except (OSError, ValueError) as error:
            raise Unreachable(
                f"{where} cannot be opened ({error}); check power, cable, address and permissions"
            ) from error

    def _lost(self, where: str, unit: int, error: OSError) -> NoReturn:
        self.close()
        self.doubt(unit)  # a serial server may have kept what the device answered
        raise Unreachable(f"{where} was lost ({error}); check cable and power") from error


def _unlogged(direction: str, data: bytes) -> None:
    """Nobody listens."""


class ModbusLine:
    """One device on a Modbus wire.

    Args:
        wire: what it is on.
        place: its address, parsed.
        address: its address, for messages.
        label: the bench's name for it.
        tap: sees every byte.
        timeout_s: bench seconds to wait for a reply.

    Attributes:
        exchanges: requests sent so far, repeated ones included.
        retries: requests that had to be sent again.
        rtu: the device hears it at its serial port, also behind a serial server; at its own network port otherwise.
        known: first address and number of words in a row that the device has, more than 3; (0, 0) if nobody says so.
            After a missing answer on a serial line some of them are read, where the device ignores the loopback.

    """

    def __init__(
        self,
        wire: ModbusWire,
        place: ModbusAddress,
        address: str,
        label: str = "",
        tap: Tap | None = None,
        timeout_s: float = 1.0,
    ) -> None:
        self._wire = wire
        self._unit = place.unit
        self.rtu = place.rtu
        self._tap = tap
        self._timeout_s = timeout_s
        self._label = label or address
        self.where = f"{label} at {address}" if label else address
        self.known = (0, 0)
        self.exchanges = 0
        self.retries = 0

    def read(self, address: int, count: int = 1) -> list[int]:
        """Read `count` holding registers (function 3) from `address`.

        Returns:
            16-bit words.

        Raises:
            NoReply, BadReply, Unreachable: twice in a row.
            InstrumentError: the device refuses; its code is the Modbus exception.

        """

        def request(client: ModbusTcpClient) -> ModbusPDU:
            return client.read_holding_registers(address, count=count, device_id=self._unit)

        return self._words(request, address, count)

    def read_input(self, address: int, count: int = 1) -> list[int]:
        """Read `count` input registers (function 4) from `address`; otherwise as `read`."""

        def request(client: ModbusTcpClient) -> ModbusPDU:
            return client.read_input_registers(address, count=count, device_id=self._unit)

        return self._words(request, address, count)

    def write(self, address: int, words: Sequence[int]) -> None:
        """Write holding registers from `address` on: one by function 6, several by function 16. Never repeated.

        Raises:
            NoReply, BadReply: it may have been carried out or not: read back.
            Unreachable: the wire is gone.
            InstrumentError: the device refuses; its code is the Modbus exception.

        """
        values = list(words)

        def request(client: ModbusTcpClient) -> ModbusPDU:
            if len(values) == 1:
                return client.write_register(address, values[0], device_id=self._unit)
            return client.write_registers(address, values, device_id=self._unit)

        reply = self._ask(request, f"writing {len(values)} word(s) at {address}", repeat=False)
        echo = reply.registers == values if len(values) == 1 else reply.count == len(values)
        if reply.address != address or not echo:
            self._wire.doubt(self._unit)
            raise BadReply(f"{self.where} confirms something else than writing {values} at register {address}: {reply}")

    def close(self) -> None:
        """Release the wire; idempotent. It opens again if anybody on it speaks again."""
        self._wire.close()

    def _words(self, request: Callable[[ModbusTcpClient], ModbusPDU], address: int, count: int) -> list[int]:
        words = self._ask(request, f"reading {count} word(s) at {address}", repeat=True).registers
        if len(words) != count:
            self._wire.doubt(self._unit)
            raise BadReply(f"{self.where} answered {len(words)} words to a question for {count} at {address}")
        return list(words)

    def _ask(self, request: Callable[[ModbusTcpClient], ModbusPDU], what: str, *, repeat: bool) -> ModbusPDU:
        reply = self._once_or_twice(request, repeat=repeat)
        for _ in range(_BUSY_TRIES):
            if not (isinstance(reply, ExceptionResponse) and reply.exception_code == _BUSY):
                break
            self._wire.clock.sleep(_BUSY_WAIT_S)  # it has done nothing, so asking again repeats nothing
            self.retries += 1
            reply = self._once_or_twice(request, repeat=repeat)
        if isinstance(reply, ExceptionResponse):
            code = reply.exception_code
            raise InstrumentError(self.where, code, f"{what}: {_EXCEPTIONS.get(code, 'no reason known')}")
        return reply

    def _once_or_twice(self, request: Callable[[ModbusTcpClient], ModbusPDU], *, repeat: bool) -> ModbusPDU:
        try:
            return self._once(request)
        except (NoReply, BadReply) as error:
            if not repeat or isinstance(error, OutOfStep):
                raise
        self.retries += 1
        return self._once(request)

    def _once(self, request: Callable[[ModbusTcpClient], ModbusPDU]) -> ModbusPDU:
        self.exchanges += 1
        return self._wire.ask(
            request, unit=self._unit, where=self.where, seconds=self._timeout_s, log=self._log, known=self.known
        )

    def _log(self, direction: str, data: bytes) -> None:
        if self._tap:
            self._tap(self._label, direction, data)


def words_of_float(value: float, *, low_first: bool = True) -> list[int]:
    """IEEE 754 single precision in two words; raises `OverflowError` beyond its range."""
    high, low = struct.unpack(">HH", struct.pack(">f", value))
    return [low, high] if low_first else [high, low]


def float_of_words(words: Sequence[int], *, low_first: bool = True) -> float:
    """The number in two words of IEEE 754 single precision."""
    low, high = words if low_first else reversed(words)
    value: float = struct.unpack(">f", struct.pack(">HH", high, low))[0]
    return value


class ModbusWires:
    """Opens every Modbus wire once.

    Args:
        clock: bench time.
        simulated: makes the transport of a `sim://` address.
        tap: sees every byte.

    """

    def __init__(
        self, clock: Clock, simulated: Callable[[str], Transport] | None = None, tap: Tap | None = None
    ) -> None:
        self._clock = clock
        self._simulated = simulated
        self._tap = tap
        self._wires: dict[tuple[str, str], tuple[ModbusAddress, ModbusWire]] = {}

    def line(self, address: str, label: str = "", timeout_s: float = 1.0) -> ModbusLine:
        """The device at `address`; raises `Unreachable`."""
        parsed = ModbusAddress.parse(address)
        first, wire = self._wires.get((parsed.kind, parsed.place)) or self._opened(parsed, label)
        if (first.baud, first.frame) != (parsed.baud, parsed.frame):
            raise Unreachable(
                f"{label or address}: {parsed.place} already runs at {first.baud} baud {first.frame}; "
                f"devices on one line must agree on its settings"
            )
        return ModbusLine(wire, parsed, address, label, self._tap, timeout_s)

    def close(self) -> None:
        """Release every wire; idempotent."""
        for _, wire in self._wires.values():
            wire.close()

    def _opened(self, address: ModbusAddress, label: str) -> tuple[ModbusAddress, ModbusWire]:
        opener: Callable[[], Transport] | None = None
        if address.simulated:
            if self._simulated is None:
                raise Unreachable(f"{label or address.place}: there is no simulated bench in this process")
            opener = partial(self._simulated, address.place)
        found = (address, ModbusWire(address, self._clock, opener))
        self._wires[address.kind, address.place] = found
        return found
