"""One Modbus master on a TCP connection or a serial line: requests, replies, and synchronisation with the devices.

Requests, replies and frames are pymodbus's; the wire below them is ours. A late reply never answers the next request.
"""

from __future__ import annotations

import contextlib
import logging
import struct
from collections.abc import Callable
from functools import partial
from itertools import count
from typing import NoReturn

from pymodbus.exceptions import ModbusException, ModbusIOException
from pymodbus.framer import FramerBase, FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU, ModbusPDU
from pymodbus.pdu.register_message import ReadHoldingRegistersResponse

from rig.drivers.clock import Clock
from rig.drivers.errors import BadReply, NoReply, Unreachable
from rig.drivers.wires.addresses import ModbusAddress
from rig.drivers.wires.modbus_rtu import OutOfStep, ends_with_answer, fits, other_value, questions
from rig.drivers.wires.modbus_transport import TcpTransport, Transport, open_transport, silence_s

logging.getLogger("pymodbus").addHandler(logging.NullHandler())  # it prints errors that we raise

_QUIET_S = 0.3  # silence after which nothing more is on its way; chosen
_SERVER_SILENCE_S = 0.02  # a serial server sends received bytes on within some milliseconds
_TALKS_ON_S = 10.0  # chosen: a line that still sends then has another master
_LEAST_WAIT_S = 1e-4  # a look without waiting: a timeout of 0 would be another mode of a socket
_HEAD = struct.Struct(">HHHBBB")  # of an answer over TCP: number, 0, length, unit, function, bytes of words
_MOST_NUMBERS = 65_000  # of requests over TCP, then from 1 again; the field has 16 bits
_WRITES = frozenset({6, 16})
_ENDED = 2  # connections in a row that ended after one answer: then every answer ends one


class ClosedAfterAnswer(Unreachable):
    """The other side closed the connection after one answer, while the next request was on its way."""


class _FramerSocket(FramerSocket):
    """pymodbus's frames over TCP; one whole answer to function 3, nearly all of a night, is taken at once."""

    def handleFrame(self, data: bytes, exp_devid: int, exp_tid: int) -> tuple[int, ModbusPDU | None]:  # noqa: N802
        """Number of bytes used, and the answer in them; None if it is not whole yet."""
        whole = len(data)
        if whole > _HEAD.size and _HEAD.unpack_from(data) == (exp_tid, 0, whole - 6, exp_devid, 3, whole - 9):
            words = list(struct.unpack_from(f">{(whole - 9) // 2}H", data, 9))
            return whole, ReadHoldingRegistersResponse(exp_devid, exp_tid, registers=words)
        return super().handleFrame(data, exp_devid, exp_tid)


class ModbusWire:
    """One connection or line, shared by the devices on it.

    Args:
        address: the address of any of its devices.
        clock: bench time.
        opener: makes the transport of a simulated device; may raise `OSError`.

    Raises:
        Unreachable: it cannot be opened.
    """

    def __init__(self, address: ModbusAddress, clock: Clock, opener: Callable[[], Transport] | None = None) -> None:
        self.clock = clock
        self._open = opener or partial(open_transport, address, clock)
        self._rtu = address.rtu and not address.simulated
        self._framer: FramerBase = (FramerRTU if self._rtu else _FramerSocket)(DecodePDU(False))
        self._silence_s = _SERVER_SILENCE_S if address.host else silence_s(address.baud)
        self._out_of_step = False
        self._owing: set[int] = set()  # units from which a late answer may still come
        self._numbers = count(1)
        self._trusted = False
        self._heard_at = clock.now()
        self._sent = b""
        self._log: Callable[[str, bytes], None] = _unlogged
        self._heard = b""
        self._seconds = self._asked_s = 1.0
        self._last_number = 0
        self._answers = 0  # on this connection
        self._ended = 0  # connections in a row that the other side closed after one answer
        self._transport: Transport | None = self._connected(address.place)

    def ask(
        self,
        request: ModbusPDU,
        *,
        where: str,
        seconds: float,
        log: Callable[[str, bytes], None],
        known: tuple[int, int] = (0, 0),
    ) -> ModbusPDU:
        """Send one request and wait for its reply, which may be an exception response.

        Args:
            request: the request, with the device it goes to.
            where: the device, for messages.
            seconds: bench seconds to wait.
            log: called with ("tx" or "rx", bytes).
            known: first address and number of existing consecutive words of the device.

        Raises:
            NoReply: no bytes came in time.
            BadReply: the bytes are not exactly a reply to this request.
            OutOfStep: bytes came after an earlier reply; nothing was sent.
            Unreachable: the wire is gone.
        """
        self._log, self._heard = log, b""
        self._seconds, self._asked_s = self.clock.timeout(seconds), seconds
        unit = request.dev_id
        try:
            if self._ended_after_answer():
                self._ended += 1
                self.close()
            elif self._ended and self._answers == 1 and request.function_code in _WRITES:
                self.close()  # it may be about to be closed as the one before was, and a write cannot be repeated
            if self._transport is None:
                self._transport, self._answers = self._connected(where), 0
            if self._rtu:
                self._refuse_unasked(unit, where)
            if self._out_of_step:
                self._drain(where)
            if unit in self._owing:
                self._synchronise(unit, known, where)
            self._heard = b""
            reply = self._exchanged(request)
            if self._rtu and not fits(self._heard, self._sent):
                raise ModbusException("more or less than one reply")
            self._trusted = True
            self._answered()
            return reply
        except ModbusException as error:
            self.doubt(unit)
            if self._heard:
                raise BadReply(
                    f"{where} sent {self._heard[:40]!r}, which is not exactly one reply to the request; "
                    f"{self._known_cause() or 'check baud rate, parity, unit, and whether it speaks TCP or RTU'}"
                ) from error
            raise self._silent(where) from error
        except OSError as error:
            self._lost(where, unit, error)

    @property
    def closes_after_answer(self) -> bool:
        """Whether the other side closes the connection after each answer. Then every request has its own connection."""
        return self._ended >= _ENDED

    def _ended_after_answer(self) -> bool:
        """Whether the other side has closed the connection after exactly one answer.

        After several answers that is no habit of a gateway: the device may have been restarted, which must be seen.
        """
        return self._answers == 1 and isinstance(self._transport, TcpTransport) and self._transport.ended()

    def _answered(self) -> None:
        self._answers += 1
        if self._answers > 1:
            self._ended = 0
        elif self.closes_after_answer:
            self.close()  # before the next request, so that none is sent into a connection that is being closed

    def _known_cause(self) -> str:
        """Words for what the bytes of no valid answer show; "" if nothing."""
        heard, sent = self._heard, self._sent
        if heard.startswith(sent):
            then = ", and then an answer" if len(heard) > len(sent) else ", and no answer"
            return f"that is an echo of the request itself{then}: switch the echo of the adapter or two-wire line off"
        if self._rtu and (taken := other_value(heard, sent)) is not None:
            return f"it confirms {taken[0]} where {taken[1]} was written: is that its limit?"
        if self._rtu or len(heard) < _HEAD.size or len(sent) < _HEAD.size:
            return ""
        number, zero, length, unit, function, _ = _HEAD.unpack_from(heard)
        asked, _, _, to, what, _ = _HEAD.unpack_from(sent)
        if (zero, length + 6, unit, function & 0x7F) != (0, len(heard), to, what) or number == asked:
            return ""
        return (
            f"the answer has transaction number {number}, and the request had {asked}: it is a late answer, or this "
            f"gateway gives answers numbers of its own. A late answer would pass for this one then. Let the gateway "
            f"return the number of the request, or let it pass RTU frames on (modbus-rtu://socket://HOST:PORT/UNIT)"
        )

    def doubt(self, unit: int) -> None:
        """Synchronise the line and this unit before the next request."""
        self._out_of_step = True
        self._trusted = False
        if self._rtu:  # over TCP the transaction number tells a late answer from the right one
            self._owing.add(unit)

    def close(self) -> None:
        """Release the wire; idempotent. It opens again at its next use."""
        transport, self._transport = self._transport, None
        if transport is not None:
            with contextlib.suppress(OSError):  # an error while closing does not matter
                transport.close()

    def _exchanged(self, request: ModbusPDU) -> ModbusPDU:
        """The reply to a request; raises `ModbusException`."""
        framer, clock = self._framer, self.clock
        if not self._rtu:
            self._last_number = self._last_number % _MOST_NUMBERS + 1
        request.transaction_id = self._last_number
        self._send(framer.buildFrame(request))
        unread, end = b"", clock.now() + self._asked_s + clock.grace()
        while heard := self._hear():
            unread += heard
            used, reply = framer.handleFrame(unread, request.dev_id, request.transaction_id)
            if reply is not None:
                if (reply.dev_id, reply.transaction_id) != (request.dev_id, request.transaction_id):
                    raise ModbusIOException("a reply to another request")
                return reply
            unread = unread[used:]
            if clock.now() >= end:
                break
        raise ModbusIOException("no reply in time")

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
            if self._rtu:
                self._heard_at = self.clock.now()
        return heard

    def _refuse_unasked(self, unit: int, where: str) -> None:
        """Wait for the silence between two frames; bytes in it put the previous reply in doubt."""
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
                f"{where}: {heard[:40]!r} came after a reply, without a request; that reply may be a late one to an "
                f"earlier request; nothing was sent; is there a second master, an echo or noise on the line?"
            )

    def _synchronise(self, unit: int, known: tuple[int, int], where: str) -> None:
        """Send a request whose answer fits no other; earlier bytes were late, and are discarded."""
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
                raise BadReply(f"{where}: the line never becomes silent; is there a second master on it?")
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
        if isinstance(error, ConnectionError) and self._answers == 1 and not self._heard:
            self._ended += 1
            raise ClosedAfterAnswer(
                f"{where} closed the connection while a request was on its way ({error})"
            ) from error
        self.doubt(unit)  # a serial server may have kept the device's answers
        raise Unreachable(f"{where} was lost ({error}); check cable and power") from error


def _unlogged(direction: str, data: bytes) -> None:
    """Does nothing: the default log."""
