"""One CANopen node: reading and writing its objects by SDO (CiA 301), as in its electronic data sheet (CiA 306).

The SDO protocol and the object dictionary are canopen's; the waiting is ours.
"""

from __future__ import annotations

import io
import logging
import queue
import struct
from collections import deque
from collections.abc import Callable
from functools import lru_cache
from typing import TypeVar, cast

import canopen
from canopen.objectdictionary import ObjectDictionary, ObjectDictionaryError, ODVariable
from canopen.objectdictionary.eds import import_eds
from canopen.sdo.client import SdoClient, WritableStream
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from rig.drivers.errors import BadReply, InstrumentError, NoReply
from rig.drivers.wires.can_bus import BUS_ERRORS, CanBus
from rig.drivers.wires.serial_port import Tap

logging.getLogger("canopen").addHandler(logging.NullHandler())  # it prints errors that we raise

_UPLOADED, _DOWNLOADED, _ABORTED = 0x40, 0x60, 0x80  # the server's command specifiers with the object's index
_DEVICE_TYPE = 0x1000  # every node has it (CiA 301)

Answer = TypeVar("Answer")


@lru_cache(maxsize=8)
def read_eds(text: str, node: int) -> ObjectDictionary:
    """The object dictionary that an electronic data sheet describes; nobody changes it.

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


def has_object(dictionary: ObjectDictionary, index: int, subindex: int = 0, *, writable: bool = False) -> bool:
    """Whether a data sheet describes an object that is readable (or writable)."""
    variable = dictionary.get_variable(index, subindex)
    return variable is not None and (variable.writable if writable else variable.readable)


class _Responses:
    """Replaces canopen's queue that a thread fills. Waiting for a reply pumps the bus."""

    def __init__(self, bus: CanBus, seconds: float) -> None:
        self._bus = bus
        self._seconds = seconds
        self._frames: deque[bytes] = deque()
        self._asked = b""
        self.foreign = b""

    def expect(self, index: int, subindex: int) -> None:
        """Accept only frames about this object from now on: canopen takes any confirmation for that of its write."""
        self._asked = struct.pack("<HB", index, subindex)
        self.foreign = b""

    def put(self, frame: bytes) -> None:
        # Segments of a long object have no index; they follow a frame that had the right one.
        names_object = len(frame) == 8 and frame[0] & 0xE0 in (_UPLOADED, _DOWNLOADED, _ABORTED)
        if not names_object or frame[1:4] == self._asked:
            self._frames.append(frame)
        else:
            self.foreign = frame

    def empty(self) -> bool:
        """Called by canopen before a request is sent: waiting frames are old, and are discarded."""
        self._frames.clear()  # a question of canopen's that discards: only its answer allows the request
        return True

    def get(self, block: bool = True, timeout: float | None = None) -> bytes:
        clock = self._bus.clock
        end = clock.now() + self._seconds + clock.grace()
        while not self._frames:
            left = end - clock.now()
            if left <= 0 or not (self._bus.pump(left) or clock.now() < end):
                raise queue.Empty
        return self._frames.popleft()


class CanNode:
    """One node on a bus.

    Args:
        bus: its bus.
        node: node identifier, 1 to 127.
        dictionary: its objects.
        address: the bus's address, for messages.
        label: the bench's name for the instrument.
        tap: called for every frame, with two bytes of identifier and the data.
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
        self._owed = False  # number of an answer that may still come
        self.where = f"{f'{label} at ' if label else ''}{address} node {node}"
        self.exchanges = 0
        self.retries = 0
        remote = canopen.RemoteNode(node, dictionary)
        self._responses = _Responses(bus, timeout_s)
        remote.sdo.responses = cast("queue.Queue[bytes]", self._responses)
        bus.network[node] = remote
        self._sdo: SdoClient = remote.sdo

    def has(self, index: int, subindex: int = 0, *, writable: bool = False) -> bool:
        """Whether its EDS describes an object that is readable (or writable)."""
        return has_object(self._dictionary, index, subindex, writable=writable)

    def read(self, index: int, subindex: int = 0) -> int | str:
        """Read an object: a number, or text for a string.

        Raises:
            NoReply, BadReply: twice in a row.
            InstrumentError: the node refuses; the code is the SDO abort code.
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
        """Read a numeric object; otherwise as `read`."""
        value = self.read(index, subindex)
        if isinstance(value, str):
            raise BadReply(f"{self.where} answered the text {value!r} where a number was expected")
        return value

    def write(self, index: int, value: int, subindex: int = 0) -> None:
        """Write an object. Never repeated.

        Raises:
            NoReply, BadReply: the write may have been carried out: read back.
            InstrumentError: the node refuses; the code is the SDO abort code.
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
        """Release the bus; idempotent. It opens again at its next use."""
        self._bus.close()

    def _variable(self, index: int, subindex: int) -> ODVariable:
        variable = self._dictionary.get_variable(index, subindex)
        if variable is None:
            raise BadReply(f"{self.where}: the EDS has no object {index:04X}h:{subindex:02X}")
        return variable

    def _upload(self, index: int, subindex: int, what: str) -> bytes:
        """Read an object. After a missing answer the node is asked for another object first, since it answers in order.

        So a late answer comes before that answer. A write does not wait for this: a stop must be sent at once.
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
        except BUS_ERRORS as error:
            self._out_of_step = True
            self._bus.lost(self.where, error)

    def _log(self, direction: str, data: bytes) -> None:
        if self._tap:
            self._tap(self._label, direction, data)


def _name(variable: ODVariable) -> str:
    return f"{variable.index:04X}h:{variable.subindex:02X} ({variable.name})"
