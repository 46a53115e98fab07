"""Modbus: the devices on a TCP connection or a serial line, which share one master (`rig.drivers.wires.modbus_wire`).

No request is repeated silently: a read may be repeated once; a write is never repeated, unless the device itself
reported that it did nothing (exception 6, busy).
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from pymodbus.pdu import ExceptionResponse, ModbusPDU, ReadHoldingRegistersRequest
from pymodbus.pdu.bit_message import ReadCoilsRequest, ReadDiscreteInputsRequest, WriteSingleCoilRequest
from pymodbus.pdu.register_message import (
    ReadInputRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)

from rig.drivers.clock import Clock
from rig.drivers.errors import BadReply, InstrumentError, NoReply, Unreachable
from rig.drivers.wires.addresses import ModbusAddress
from rig.drivers.wires.modbus_rtu import OutOfStep
from rig.drivers.wires.modbus_transport import Transport, as_ascii
from rig.drivers.wires.modbus_wire import ClosedAfterAnswer, ModbusWire
from rig.drivers.wires.serial_port import Tap

_BUSY, _BUSY_WAIT_S, _BUSY_TRIES = 6, 0.2, 10
"""Exception code; a device that is busy is asked again for two seconds, longer than a chamber stores a program."""
_SENSIBLE, _LIKELY = (1e-20, 1e20), (1e-3, 1e5)
"""Magnitudes that a measurement in an ordinary unit may have, and those that it is likely to have."""
_READS: Mapping[str, type[ModbusPDU]] = {
    "holding": ReadHoldingRegistersRequest,
    "input": ReadInputRegistersRequest,
    "coil": ReadCoilsRequest,
    "discrete": ReadDiscreteInputsRequest,
}
_BITS = ("coil", "discrete")
_EXCEPTIONS = {
    1: "it does not support this function",
    2: "it has no such register",
    3: "it does not accept this value",
    4: "it failed to carry it out",
    5: "it has accepted the request and needs a long time for it",
    6: "it is busy",
    8: "its memory has a parity error",
    10: "the gateway is misconfigured or overloaded",
    11: "the gateway got no answer from the device",
}


class ModbusLine:
    """One device on a Modbus wire.

    Args:
        wire: its wire.
        place: its address, parsed.
        address: its address, for messages.
        label: the bench's name for it.
        tap: called for every transfer.
        timeout_s: bench seconds to wait for a reply.

    Attributes:
        exchanges: requests sent so far, repeated ones included.
        retries: repeated requests.
        rtu: whether the device is reached at its serial port, also behind a serial server; otherwise at its network
            port.
        known: first address and number, more than 3, of existing consecutive words; (0, 0) if unknown. After a missing
            answer on a serial line some of them are read if the device ignores the loopback.
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
        self._ascii = place.ascii
        self._timeout_s = timeout_s
        self._label = label or address
        self.where = f"{label} at {address}" if label else address
        self.known = (0, 0)
        self.exchanges = 0
        self.retries = 0

    def read(self, address: int, count: int = 1, table: str = "holding") -> list[int]:
        """Read `count` registers from `address`: holding (function 3), input (4), coil (1) or discrete (2).

        Returns:
            16-bit words, or bits.

        Raises:
            NoReply, BadReply, Unreachable: twice in a row.
            InstrumentError: the device refuses; the code is the Modbus exception.
        """
        request = _READS[table](dev_id=self._unit, address=address, count=count)
        reply = self._ask(request, "reading", repeat=True)
        words = list(map(int, reply.bits[:count])) if table in _BITS else reply.registers
        if len(words) != count:  # a valid frame, but perhaps the late answer to another question
            self._wire.doubt(self._unit)
            raise BadReply(f"{self.where} answered {len(words)} words to a question for {count} at {address}")
        return list(words)

    def write(self, address: int, words: Sequence[int], table: str = "holding") -> None:
        """Write registers from `address` on: one by function 6, several by 16, a coil by 5. Never repeated.

        Raises:
            NoReply, BadReply: the write may have been carried out: read back.
            Unreachable: the wire is gone.
            InstrumentError: the device refuses; the code is the Modbus exception.
        """
        values = list(words)
        if table == "coil":
            coil = self._ask(
                WriteSingleCoilRequest(dev_id=self._unit, address=address, bits=[bool(values[0])]), "writing"
            )
            if coil.address != address or coil.bits[:1] != [bool(values[0])]:
                self._wire.doubt(self._unit)
                raise BadReply(f"{self.where} confirms something else than writing coil {address}: {coil}")
            return
        kind = WriteSingleRegisterRequest if len(values) == 1 else WriteMultipleRegistersRequest
        reply = self._ask(kind(dev_id=self._unit, address=address, registers=values), "writing")
        echo = reply.registers == values if len(values) == 1 else reply.count == len(values)
        if reply.address != address or not echo:
            self._wire.doubt(self._unit)
            raise BadReply(f"{self.where} confirms something else than writing {values} at register {address}: {reply}")

    def close(self) -> None:
        """Release the wire; idempotent. It opens again at its next use."""
        self._wire.close()

    def _ask(self, request: ModbusPDU, doing: str, *, repeat: bool = False) -> ModbusPDU:
        reply = self._once_or_twice(request, repeat=repeat)
        tries = 0
        while isinstance(reply, ExceptionResponse):
            code = reply.exception_code
            if code != _BUSY or tries == _BUSY_TRIES:
                reason = _EXCEPTIONS.get(code, "no reason known")
                raise InstrumentError(
                    self.where, code, f"{doing} {request.count} word(s) at {request.address}: {reason}"
                )
            tries += 1
            self._wire.clock.sleep(_BUSY_WAIT_S)  # it has done nothing, so a repetition is safe
            self.retries += 1
            reply = self._once_or_twice(request, repeat=repeat)
        return reply

    def _once_or_twice(self, request: ModbusPDU, *, repeat: bool) -> ModbusPDU:
        while True:
            self.exchanges += 1
            try:
                return self._wire.ask(
                    request, where=self.where, seconds=self._timeout_s, log=self._log, known=self.known
                )
            except (NoReply, BadReply, ClosedAfterAnswer) as error:
                if not repeat or isinstance(error, OutOfStep):  # then the reply before may be wrong too
                    raise
            repeat = False
            self.retries += 1

    def remarks(self) -> Sequence[str]:
        """What its connection does that a person should know; () if nothing."""
        if not self._wire.closes_after_answer:
            return ()
        return ("closes the connection after each answer; every request has a connection of its own",)

    def _log(self, direction: str, data: bytes) -> None:
        if self._tap:  # what is on the wire: the frames of ASCII are those of RTU above its transport
            self._tap(self._label, direction, as_ascii(data) if self._ascii else data)


def words_of_float(value: float, *, low_first: bool = True) -> list[int]:
    """IEEE 754 single precision in two words; raises `OverflowError` beyond its range."""
    high, low = struct.unpack(">HH", struct.pack(">f", value))
    return [low, high] if low_first else [high, low]


def float_of_words(words: Sequence[int], *, low_first: bool = True) -> float:
    """The number in two words of IEEE 754 single precision."""
    low, high = words if low_first else reversed(words)
    value: float = struct.unpack(">f", struct.pack(">HH", high, low))[0]
    return value


def in_other_order(words: Sequence[int], *, low_first: bool = True) -> float | None:
    """The number in the other word order, if it is the only sensible one; None otherwise.

    A whole number such as 200 in the wrong order is far below the smallest measurement: 2e-41.
    """
    value, other = (float_of_words(words, low_first=order) for order in (low_first, not low_first))
    odd = value != 0.0 and not _SENSIBLE[0] <= abs(value) <= _SENSIBLE[1]
    return other if odd and _LIKELY[0] <= abs(other) <= _LIKELY[1] else None


def float_in_order(words: Sequence[int], what: str, setting: str, *, low_first: bool = True) -> float:
    """The number in two words.

    Args:
        words: the words as read.
        what: device and register, for messages.
        setting: what has to be changed if the order is wrong.
        low_first: whether the low word comes first.

    Raises:
        BadReply: only the other word order makes sense.
    """
    value, other = float_of_words(words, low_first=low_first), in_other_order(words, low_first=low_first)
    if other is None:
        return value
    raise BadReply(
        f"{what} reads {value:.3g}, and {other:.6g} with its two words in the other order; the word order of the "
        f"controller or gateway may be swapped: set it to {'low' if low_first else 'high'} word first, or change "
        f"{setting}; nothing was set"
    )


class ModbusWires:
    """Opens every Modbus wire once.

    Args:
        clock: bench time.
        simulated: makes the transport of a `sim://` address.
        tap: called for every transfer.
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
        if (first.baud, first.frame, first.ascii) != (parsed.baud, parsed.frame, parsed.ascii):
            raise Unreachable(
                f"{label or address}: {parsed.place} already runs at {first.baud} baud {first.frame}"
                f"{' in Modbus ASCII' if first.ascii else ''}; "
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
