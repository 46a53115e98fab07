"""Modbus RTU: recognition of the one answer to a request, and requests whose answers are distinct from late ones.

A frame of a serial line has no transaction number: a late answer to one request may look like an answer to the next.
Sources: MODBUS Application Protocol 1.1b3, 6.8.1 (return query data); MODBUS over Serial Line 1.02, 2.5.1.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

from pymodbus.framer.rtu import FramerRTU

from rig.drivers.errors import BadReply

_BITS, _READS, _WRITE_ONE, _LOOPBACK, _WRITE = (1, 2), (3, 4), 6, 8, 16
_EXCEPTION_SIZE, _ECHO_SIZE = 5, 8
_LEAST = 3  # number of words in a read that must be distinct from others: numbers and codes have one or two


class OutOfStep(BadReply):
    """Unrequested bytes came. Asking again does not repair a wrong answer that was accepted before."""


def framed(unit: int, pdu: bytes) -> bytes:
    """A request or an answer with its unit and checksum."""
    return _summed(bytes((unit,)) + pdu)


def _summed(body: bytes) -> bytes:
    return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")


def fits(heard: bytes, sent: bytes) -> bool:
    """Whether these bytes are exactly one whole answer to that request, with nothing before or after it."""
    if len(heard) < _EXCEPTION_SIZE or heard != _summed(heard[:-2]) or heard[0] != sent[0]:
        return False
    function = sent[1]
    if heard[1] == function | 0x80:
        return len(heard) == _EXCEPTION_SIZE
    if function in _READS + _BITS:
        count = int.from_bytes(sent[4:6], "big")
        size = 2 * count if function in _READS else (count + 7) // 8
        return heard[1:3] == bytes((function, size)) and len(heard) == 5 + size
    if function == _WRITE:
        return heard[:6] == sent[:6] and len(heard) == _ECHO_SIZE
    return heard == sent


def other_value(heard: bytes, sent: bytes) -> tuple[int, int] | None:
    """The value that a device confirms, and the one that it was told, if they differ and nothing else does."""
    if sent[1] != _WRITE_ONE or len(heard) != _ECHO_SIZE or heard != _summed(heard[:-2]) or heard[:4] != sent[:4]:
        return None
    return int.from_bytes(heard[4:6], "big", signed=True), int.from_bytes(sent[4:6], "big", signed=True)


def ends_with_answer(heard: bytes, sent: bytes) -> bool:
    """Whether the last of these bytes are the answer to a request of `questions`, whatever came before."""
    if sent[1] == _LOOPBACK:  # no other request has this function, so a refusal of it is an answer too
        return fits(heard[-_ECHO_SIZE:], sent) or fits(heard[-_EXCEPTION_SIZE:], sent)
    answer = heard[-5 - 2 * sent[5] :]
    return fits(answer, sent) and answer[1] == sent[1]


def questions(unit: int, number: int, known: tuple[int, int]) -> Iterator[bytes]:
    """Requests whose answers fit no other request.

    The loopback returns a number that changes. A device without it should refuse it. For a device that ignores it there
    is a read with more words than any other read, and with another number of words than the last time.

    Args:
        unit: the device.
        number: number of this attempt; different each time.
        known: first address and number of existing consecutive words of the device; (0, 0) if none.
    """
    yield framed(unit, struct.pack(">BHH", _LOOPBACK, 0, number % 0xFFFF + 1))
    address, most = known
    if most > _LEAST:
        yield framed(unit, struct.pack(">BHH", 3, address, _LEAST + number % (most - _LEAST)))
