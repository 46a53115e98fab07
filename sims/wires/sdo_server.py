"""The server side of SDO (CiA 301): a node's object dictionary over CAN, without input or output.

Expedited transfers both ways and segmented uploads. Segmented downloads and block transfers are refused with
"command specifier not valid", as small drives do.
"""

from __future__ import annotations

import struct
from typing import Protocol

TOGGLE, BAD_COMMAND = 0x05030000, 0x05040001
WRITE_ONLY, READ_ONLY, NO_OBJECT = 0x06010001, 0x06010002, 0x06020000
TOO_LONG, TOO_SHORT, NO_SUBINDEX = 0x06070012, 0x06070013, 0x06090011
OUT_OF_RANGE, TOO_HIGH, TOO_LOW = 0x06090030, 0x06090031, 0x06090032
NOT_STORED, NOT_IN_THIS_STATE, NO_DATA = 0x08000020, 0x08000022, 0x08000024

_ABORT = 0x80


class Aborted(Exception):
    """A transfer that is refused with an SDO abort code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"{code:08X}h")
        self.code = code


class Objects(Protocol):
    """A node's objects."""

    def read(self, index: int, subindex: int) -> bytes:
        """An object's value. Raises `Aborted`."""
        ...

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Set an object's value. Raises `Aborted`."""
        ...


class SdoServer:
    """Answers a client's requests, eight bytes for eight bytes."""

    def __init__(self, objects: Objects) -> None:
        self._objects = objects
        self._upload = b""
        self._uploading: tuple[int, int] | None = None
        self._toggle = 0

    def answer(self, request: bytes) -> bytes | None:
        """The response to a request; None for an abort, which has none."""
        request = request.ljust(8, b"\0")
        command = request[0]
        if command == _ABORT:
            self._uploading = None
            return None
        index, subindex = struct.unpack("<HB", request[1:4])
        try:
            match command >> 5:  # the client's command specifier
                case 1:
                    return self._download(command, index, subindex, request[4:])
                case 2:
                    return self._begin_upload(index, subindex)
                case 3:
                    index, subindex = self._uploading or (0, 0)
                    return self._upload_segment(command)
            raise Aborted(BAD_COMMAND)
        except Aborted as aborted:
            self._uploading = None
            return struct.pack("<BHBI", _ABORT, index, subindex, aborted.code)

    def _begin_upload(self, index: int, subindex: int) -> bytes:
        data = self._objects.read(index, subindex)
        if len(data) <= 4:
            command = 0x43 | (4 - len(data)) << 2
            return struct.pack("<BHB", command, index, subindex) + data.ljust(4, b"\0")
        self._upload, self._uploading, self._toggle = data, (index, subindex), 0
        return struct.pack("<BHBI", 0x41, index, subindex, len(data))

    def _upload_segment(self, command: int) -> bytes:
        if self._uploading is None:
            raise Aborted(BAD_COMMAND)
        if command & 0x10 != self._toggle:
            raise Aborted(TOGGLE)
        part, self._upload = self._upload[:7], self._upload[7:]
        last = 0 if self._upload else 1
        reply = bytes((self._toggle | (7 - len(part)) << 1 | last,)) + part.ljust(7, b"\0")
        self._toggle ^= 0x10
        if last:
            self._uploading = None
        return reply

    def _download(self, command: int, index: int, subindex: int, data: bytes) -> bytes:
        if not command & 0x02:
            raise Aborted(BAD_COMMAND)
        size = 4 - (command >> 2 & 3) if command & 0x01 else 4
        self._objects.write(index, subindex, data[:size])
        return struct.pack("<BHB4x", 0x60, index, subindex)
