"""A Modbus slave without input or output: bytes in, bytes out.

Function codes 1 to 6, 8 (echo), 16, 17 and 23, framed for TCP (MBAP header) or for a serial line (RTU). Source: MODBUS
Application Protocol 1.1b3, MODBUS over Serial Line 1.02, MODBUS Messaging on TCP/IP 1.0b.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Protocol

ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE, NO_TARGET = 1, 2, 3, 11
_READ_COILS, _READ_DISCRETE, _WRITE_COIL, _ON = 1, 2, 5, 0xFF00
_READ, _READ_INPUT, _WRITE_ONE, _DIAGNOSE, _WRITE, _REPORT, _WRITE_AND_READ = 3, 4, 6, 8, 16, 17, 23
_MOST_READ, _MOST_WRITTEN, _MOST_WRITTEN_TO_READ = 125, 123, 121
_BITS = {_READ_COILS: "coils", _READ_DISCRETE: "discretes", _WRITE_COIL: "coils"}
"""Attributes of registers with bits of their own; most have none."""
_FUNCTIONS = frozenset((*_BITS, _READ, _READ_INPUT, _WRITE_ONE, _DIAGNOSE, _WRITE, _WRITE_AND_READ))
_RUNNING = b"\xff"
_MBAP, _TWO = struct.Struct(">HHHB"), struct.Struct(">HH")


class Refused(Exception):
    """A request that is answered with an exception code."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class Registers(Protocol):
    """The registers of one device; 16-bit words by address.

    Attributes:
        identity: its answer to function 17.

    A twin may have further tables: `inputs_table`, `coils`, `discretes`, each with the same two methods.
    """

    identity: bytes

    def read(self, address: int, count: int) -> Sequence[int]:
        """Words from `address` on. Raises `Refused`."""
        ...

    def write(self, address: int, words: Sequence[int]) -> None:
        """Set words from `address` on. Raises `Refused`."""
        ...


def answer(registers: Registers, pdu: bytes) -> bytes:
    """A device's answer to a request, both without frame."""
    try:
        return pdu[:1] + _carry_out(registers, pdu)
    except Refused as refused:
        return bytes((pdu[0] | 0x80, refused.code))


def _carry_out(registers: Registers, pdu: bytes) -> bytes:
    function = pdu[0]
    if function == _REPORT:
        return bytes((len(registers.identity) + 1,)) + registers.identity + _RUNNING
    if function not in _FUNCTIONS:
        raise Refused(ILLEGAL_FUNCTION)
    if len(pdu) < 5:
        raise Refused(ILLEGAL_VALUE)
    address, number = _TWO.unpack_from(pdu, 1)
    if function == _DIAGNOSE:
        if address:  # only the echo of the sub-functions: counters are for lines with losses
            raise Refused(ILLEGAL_FUNCTION)
        return pdu[1:]
    if function in _BITS:
        return _bits(getattr(registers, _BITS[function], None), function, address, number)
    if function == _WRITE_ONE:
        registers.write(address, [number])
        return pdu[1:5]
    if function == _WRITE:
        registers.write(address, _written(pdu[3:], _MOST_WRITTEN))
        return pdu[1:5]
    if not 1 <= number <= _MOST_READ:
        raise Refused(ILLEGAL_VALUE)
    if function == _WRITE_AND_READ:  # the write comes first, 6.17
        if len(pdu) < 10:
            raise Refused(ILLEGAL_VALUE)
        (where,) = struct.unpack(">H", pdu[5:7])
        registers.write(where, _written(pdu[7:], _MOST_WRITTEN_TO_READ))
    table = getattr(registers, "inputs_table", registers) if function == _READ_INPUT else registers
    words = table.read(address, number)
    return struct.pack(f">B{number}H", 2 * number, *words)


def _bits(table: Registers | None, function: int, address: int, number: int) -> bytes:
    """The answer to a question for bits, or to the command for one."""
    if table is None:
        raise Refused(ILLEGAL_FUNCTION)
    if function == _WRITE_COIL:
        if number not in (0, _ON):
            raise Refused(ILLEGAL_VALUE)
        table.write(address, [int(number == _ON)])
        return _TWO.pack(address, number)
    if not 1 <= number <= _MOST_READ:
        raise Refused(ILLEGAL_VALUE)
    whole = sum(bit << n for n, bit in enumerate(table.read(address, number)))
    size = (number + 7) // 8
    return bytes((size,)) + whole.to_bytes(size, "little")


def _written(data: bytes, most: int) -> tuple[int, ...]:
    """The words to write, after their number and that of their bytes."""
    (number,) = struct.unpack(">H", data[:2])
    if not 1 <= number <= most or data[2:3] != bytes((2 * number,)) or len(data) != 3 + 2 * number:
        raise Refused(ILLEGAL_VALUE)
    return struct.unpack(f">{number}H", data[3:])


def crc16(data: bytes) -> bytes:
    """Checksum of an RTU frame, low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return struct.pack("<H", crc)


class TcpSlave:
    """Devices behind one TCP connection.

    A request for a missing unit is answered as by a gateway: exception 11, target did not respond.

    Args:
        devices: registers by unit identifier.
    """

    def __init__(self, devices: Mapping[int, Registers]) -> None:
        self._devices = devices
        self._buffer = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Take received bytes; returns the answers to the completed requests."""
        buffer = self._buffer + data
        answers = []
        while len(buffer) >= 8:
            transaction, protocol, length, unit = _MBAP.unpack_from(buffer)
            if protocol != 0 or not 2 <= length <= 254:
                buffer = b""  # not Modbus: the whole input is discarded
                break
            if len(buffer) < 6 + length:
                break
            pdu, buffer = buffer[7 : 6 + length], buffer[6 + length :]
            device = self._devices.get(unit)
            reply = answer(device, pdu) if device else bytes((pdu[0] | 0x80, NO_TARGET))
            answers.append(_MBAP.pack(transaction, 0, 1 + len(reply), unit) + reply)
        self._buffer = buffer
        return answers


class RtuSlave:
    """Devices on one serial line.

    There is no answer for a missing unit, a frame with a wrong checksum, or a broadcast (unit 0).

    Args:
        devices: registers by unit address.
    """

    def __init__(self, devices: Mapping[int, Registers]) -> None:
        self._devices = devices
        self._buffer = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Take received bytes; returns the answers to the completed requests."""
        self._buffer += data
        answers = []
        while (size := self._request_size()) and len(self._buffer) >= size:
            frame, self._buffer = self._buffer[:size], self._buffer[size:]
            if crc16(frame[:-2]) != frame[-2:]:
                self._buffer = b""  # out of step; the master will repeat the request after a timeout
                break
            unit, pdu = frame[0], frame[1:-2]
            if unit == 0:
                for device in self._devices.values():
                    answer(device, pdu)
            elif unit in self._devices:
                reply = bytes((unit,)) + answer(self._devices[unit], pdu)
                answers.append(reply + crc16(reply))
        return answers

    def _request_size(self) -> int:
        """Length of the request at the head of the buffer, bytes; 0 if it cannot be known yet."""
        if len(self._buffer) < 4:
            return 0
        if self._buffer[1] == _WRITE:
            return 9 + self._buffer[6] if len(self._buffer) > 6 else 0
        if self._buffer[1] == _WRITE_AND_READ:
            return 13 + self._buffer[10] if len(self._buffer) > 10 else 0
        if self._buffer[1] in (*_BITS, _READ, _READ_INPUT, _WRITE_ONE, _DIAGNOSE):
            return 8
        if self._buffer[1] == _REPORT:
            return 4
        return len(self._buffer)
