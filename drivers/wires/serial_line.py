"""A serial line that carries text commands and text replies, one query at a time.

The line opens addresses permitted by `rig.drivers.wires.addresses` (`/dev/ttyUSB0`, `COM4`, `socket://host:5025`,
`rfc2217://...`). It never repeats a command that may have been carried out. After an unexpected reply it listens until
the instrument is silent before it asks again. After a missing reply it asks a question whose answer fits no other
question. A line keeps the order of answers, so late ones come before that answer and cannot answer the next question.

XON and XOFF, which an instrument may send at any moment, are not part of an answer. But an error of one bit makes XON
of a 1 and XOFF of a 3. So an answer with one of them is asked for again if the instrument is not declared to use them.
"""

from __future__ import annotations

from collections.abc import Callable

from rig.drivers.clock import Clock
from rig.drivers.errors import BadReply, NoReply
from rig.drivers.wires.parity import WRONG_PARITY
from rig.drivers.wires.port import Port
from rig.drivers.wires.serial_port import PORT_ERRORS, PortOfLine, SerialSettings, Tap

Whole = Callable[[bytes], bool]
"""Tells whether an answer is complete."""

_BITS_PER_CHARACTER = 11  # the longest frame: start, eight data bits, parity or a second stop bit, stop
_SLOWEST_BAUD = 1200  # for a line behind a serial server
_LONGEST_REPLY = 1 << 20  # bytes; chosen: more than any memory of readings printed as text
_TALKS_ON_S = 10.0  # chosen: an instrument that still sends then was set to send by itself
_DTR_S = 0.01  # chosen, for an adapter that sends what it holds
_NOT_SAID = bytes([0x11, 0x13])  # XON and XOFF: flow control, never part of an answer


class SerialLine(PortOfLine):
    """One open serial line.

    Args:
        address: its address, see `rig.drivers.wires.addresses`.
        settings: settings of the instrument's line.
        clock: bench time.
        label: name of the instrument, for messages and the wire log.
        tap: called for every transfer.

    Attributes:
        exchanges: queries sent so far, repeated ones included.
        retries: repeated queries.
        user: which of several instruments behind it was addressed last.

    Raises:
        Unreachable: the address cannot be opened.
    """

    def __init__(
        self, address: str, settings: SerialSettings, clock: Clock, *, label: str = "", tap: Tap | None = None
    ) -> None:
        self._reply_end = settings.reply_end.decode("ascii")
        self.exchanges = 0
        self.retries = 0
        self._last = b""  # end of what was heard last, of an instrument that talks by itself
        self._tap = tap
        self._owed = False  # number of an answer that may still come
        self._wrong_parity = False  # a character of the last answer came with a wrong parity
        self._doubtful = False  # something was removed from the last answer that may have been a changed digit
        super().__init__(address, settings, clock, label)

    def write(self, text: str) -> None:
        """Send a command without reply, at once: it cannot be mistaken for another. Raises `Unreachable`."""
        port = self._port or self._reopened()
        try:
            self._send(port, text)
        except PORT_ERRORS as error:
            self._lost(error)

    def query(self, text: str, timeout_s: float | None = None, *, repeat: bool = True) -> str:
        """Send a question and return its one-line answer; see `query_lines`."""
        return self.query_lines(text, 1, timeout_s, repeat=repeat)[0]

    def query_lines(
        self,
        text: str,
        count: int,
        timeout_s: float | None = None,
        *,
        repeat: bool = True,
        whole: Whole | None = None,
    ) -> list[str]:
        """Send a question with `count` lines of answer.

        Args:
            text: the question, without its terminator.
            count: number of expected lines.
            timeout_s: maximum bench seconds of silence; the line's own setting if None.
            repeat: whether the question has no side effect and may be repeated.
            whole: tells whether an answer is complete, if its last character does not; it is then one line.

        Raises:
            NoReply: no complete answer in time.
            BadReply: more lines than expected, or bytes that are not text.
            Unreachable: the port is gone.
        """
        timeout = self.settings.timeout_s if timeout_s is None else timeout_s
        lines: list[str] = []
        try:
            lines = self._ask(text, count, timeout, whole)
        except NoReply:
            if not repeat:
                raise
        if lines and not self._wrong_parity and not (self._doubtful and repeat):
            return lines
        if lines and not repeat:
            raise self._misread(text, lines)
        self.retries += 1
        again = self._ask(text, count, timeout, whole)
        if self._wrong_parity:
            raise self._misread(text, again)
        if self._doubtful and again != lines:  # a bit error does not come twice; XON of an instrument may
            raise self.bad_reply(
                text,
                "; ".join(again),
                'text without XON and XOFF; if the instrument sends them, write flow = "xonxoff"',
            )
        return again

    def heard(self, timeout_s: float, *, onwards: bool = False) -> str:
        """The first line that begins from now on, of an instrument that talks by itself: neither an old nor a torn one.

        Args:
            timeout_s: longest wait for it, bench seconds.
            onwards: the next one instead, which may have come with the last one.

        Raises:
            NoReply: no whole line comes.
            BadReply: bytes that are not text.
            Unreachable: the port is gone.
        """
        port = self._port or self._reopened()
        end, raw, received = self.clock.now() + timeout_s, bytearray(), b""
        try:
            old, port.timeout = self._last, 0
            if onwards:
                old, _, received = self._last.partition(self.settings.reply_end)
            while not onwards and (said := port.read(4096)):  # not in_waiting: over TCP it does not say how many
                old = bytes(said)
            torn = not onwards and not old.endswith(self.settings.reply_end)
            while (left := end - self.clock.now()) > 0 and self.settings.reply_end not in received:
                self._limit(port, left)
                received += self._more(port, raw, left)
                if torn and self.settings.reply_end in received:
                    torn, received = False, received.partition(self.settings.reply_end)[2]
            self._last = received
        except PORT_ERRORS as error:
            self._lost(error)
        finally:
            self._tell_tap(raw)
        line, ended, _ = received.partition(self.settings.reply_end)
        if not ended:
            raise self._silent("nothing, since it talks by itself", bytes(received), timeout_s)
        try:
            return line.decode(self.settings.encoding).strip()
        except UnicodeDecodeError:
            raise self.bad_reply("nothing", bytes(line), "text; do baud rate and frame match") from None

    def beyond(self) -> str:
        """Lines that an instrument sends after a whole answer, within `quiet_s`; "" for none. They would be
        the answer to the next question.

        Raises:
            Unreachable: the port is gone.
        """
        if self._place.messages:  # their end is marked on the bus
            return ""
        port, heard = self._port or self._reopened(), bytearray()
        end = self.clock.now() + _TALKS_ON_S
        try:
            port.timeout = self.clock.timeout(self.settings.quiet_s)
            while (said := port.read(4096)) and self.clock.now() <= end:
                heard += said
        except PORT_ERRORS as error:
            self._lost(error)
        self._tell_tap(heard)
        return _said(heard).decode("latin-1").strip()

    def drain(self, waiting: int = 0) -> None:
        """Listen until the instrument has been silent for `quiet_s`, and discard its bytes.

        Args:
            waiting: number of bytes already received; if these are only line ends, XON and XOFF, there is no more
                listening. 0 to listen in any case.

        Raises:
            BadReply: it never stops sending.
            Unreachable: the port is gone.
        """
        port = self._port or self._reopened()
        end = self.clock.now() + _TALKS_ON_S
        try:
            if waiting:
                heard = port.read(waiting)
                self._tell_tap(heard)
                if not _said(heard).strip():
                    return
            port.timeout = self.clock.timeout(self.settings.quiet_s)
            while heard := port.read(4096):
                self._tell_tap(heard)
                if self.clock.now() > end:
                    raise BadReply(
                        f"{self.where} sends without being asked: is it set to send by itself, "
                        f"or is another instrument on this line?"
                    )
        except PORT_ERRORS as error:
            self._lost(error)
        self._out_of_step = False

    def device_clear(self, character: str, *, with_dtr: bool) -> None:
        """Send the character for device clear, and listen until the instrument is silent.

        Args:
            character: the character.
            with_dtr: drop the line DTR meanwhile; without it an instrument that holds the handshake may not receive the
                character. A pseudo-terminal and a TCP connection have no such line.

        Raises:
            BadReply: it never stops sending.
            Unreachable: the port is gone.
        """
        port = self._port or self._reopened()
        with_dtr = with_dtr and self._has_dtr
        try:
            if with_dtr:
                port.dtr = False
            self._send(port, character)
            if with_dtr:
                # Not flush(): it never returns while flow control holds up the port.
                # the character has left the adapter, too
                self.clock.sleep(2 * _BITS_PER_CHARACTER / self.settings.baud + _DTR_S)
                port.dtr = True
        except PORT_ERRORS as error:
            self._lost(error)
        self.drain()

    def bad_reply(self, text: str, reply: object, expected: str) -> BadReply:
        """The error for an answer that makes no sense; the line is synchronised before its next use."""
        self._out_of_step = True  # the rest of a garbled answer may still be on its way
        return BadReply(f"{self.where} answered {reply!r} to {text!r}; expected {expected}")

    def _misread(self, text: str, lines: list[str]) -> BadReply:
        return self.bad_reply(
            text, "; ".join(lines), "characters with the right parity; check the frame, the cable and what is near it"
        )

    def takes_s(self, characters: int) -> float:
        """Maximum bench seconds for this many characters on the line; unknown over TCP."""
        return characters * _BITS_PER_CHARACTER / (self.settings.baud if self._place.timed else _SLOWEST_BAUD)

    def _in_step(self) -> Port:
        port = self._port or self._reopened()
        try:
            waiting = port.in_waiting
        except PORT_ERRORS as error:
            self._lost(error)
        if self._out_of_step:
            self.drain()
        elif waiting:
            self.drain(waiting)
        if self._owed and self.settings.sync is not None:
            self._synchronise(port, *self.settings.sync)
        return port

    def _synchronise(self, port: Port, question: str, answer: str) -> None:
        """Ask a question whose answer fits no other question; earlier bytes were late, and are discarded.

        Raises:
            NoReply: no answer comes.
        """
        raw, heard = bytearray(), bytearray()
        timeout_s = self.settings.timeout_s
        self.exchanges += 1
        try:
            self._limit(port, timeout_s)
            self._send(port, question)
            end = self.clock.now() + timeout_s
            while not (self._ended(heard) and answer in _last_line(heard)):
                more = self._more(port, raw, timeout_s)
                if not more or (len(heard) > _LONGEST_REPLY and self.clock.now() > end):
                    self._out_of_step = True
                    raise self._silent(question, bytes(heard[-40:]), timeout_s)
                heard += more
        except PORT_ERRORS as error:
            self._lost(error)
        finally:
            self._tell_tap(raw)
        self._owed = False
        self.drain()  # the same question may have been asked before without an answer

    def _send(self, port: Port, text: str) -> None:
        data = text.encode(self.settings.encoding) + self.settings.send_end
        if self._tap:
            self._tap(self.label, "tx", data)
        port.write(data)

    def _ask(self, text: str, count: int, timeout_s: float, whole: Whole | None) -> list[str]:
        port = self._in_step()
        self.exchanges += 1
        try:
            self._limit(port, timeout_s)
            self._send(port, text)
            received = self._receive(port, text, count, timeout_s, whole)
        except PORT_ERRORS as error:
            self._lost(error)
        if whole is not None:
            return [received.decode("latin-1")]
        try:  # ASCII is strict on purpose: a wrong baud rate or frame shows as bytes above 127
            lines = received.decode(self.settings.encoding).split(self._reply_end)
        except UnicodeDecodeError:
            doubt = "do baud rate and frame match" if self.port_settings else "do the serial server's settings match"
            doubt = "" if self._place.messages else f"; {doubt} the instrument's?"
            if _is_utf8(received):
                doubt = '; it may be UTF-8: encoding = "utf-8" at [wire] of its file'
            raise self.bad_reply(text, received, f"text{doubt}") from None
        if len(lines) != count + 1 or lines[-1].strip():
            raise self.bad_reply(text, received, f"{count} line(s); `lines` says how many a question of a file has")
        return [line.strip() for line in lines[:-1]]

    def _receive(self, port: Port, text: str, count: int, timeout_s: float, whole: Whole | None) -> bytes:
        raw, received = bytearray(), bytearray()
        try:
            while True:
                heard = self._more(port, raw, timeout_s)
                if not heard:
                    self._out_of_step = self._owed = True  # the answer may only be late
                    if whole is not None and received:
                        raise self.bad_reply(text, bytes(received), "an answer in its frame, with the right checksum")
                    raise self._silent(text, bytes(received), timeout_s)
                received += heard
                if len(received) > _LONGEST_REPLY:
                    raise self.bad_reply(text, bytes(received[:40]), "an answer that ends")
                if whole(bytes(received)) if whole is not None else received.count(self.settings.reply_end) >= count:
                    break
        finally:
            self._tell_tap(raw)
        self._wrong_parity = self._parity and WRONG_PARITY in received
        self._doubtful = False
        if len(raw) > len(received) and self.settings.flow != "xonxoff":
            answer = raw[: raw.rfind(self.settings.reply_end)]
            self._doubtful = len(_said(answer)) < len(answer)
        return bytes(received)

    def _more(self, port: Port, raw: bytearray, timeout_s: float) -> bytes | bytearray:
        """The next received bytes, without flow control characters; empty if there are none. All bytes are added to
        `raw`.
        """
        end = None
        while True:
            heard = port.read(1)
            # One byte, then what came with it: a longer read would wait until its timeout for bytes that do not come.
            if heard and (waiting := port.in_waiting):
                heard += port.read(waiting)
            raw += heard
            said = heard if self.settings.encoding == "latin-1" else _said(heard)
            if said or not heard:
                return said
            now = self.clock.now()  # so far there was only flow control
            if end is None:
                end = now + timeout_s + self.clock.grace()
            elif now >= end:
                return said

    def _ended(self, heard: bytearray) -> bool:
        return self.settings.reply_end in heard[len(heard.rstrip(b"\r\n")) :]

    def _tell_tap(self, heard: bytes | bytearray) -> None:
        if self._tap and heard:
            self._tap(self.label, "rx", bytes(heard))

    def _silent(self, text: str, received: bytes, timeout_s: float) -> NoReply:
        settings = f"set to {self.port_settings}" if self.port_settings else "the serial server set as it is"
        state = "on and connected" if self._place.messages else f"on, connected, and {settings}"
        return NoReply(
            f"{self.where} answered {f'only {received!r}' if received else 'nothing'} to {text!r} "
            f"within {timeout_s:g} s; is it switched {state}?"
        )


def _is_utf8(received: bytes) -> bool:
    """Whether bytes beyond ASCII are characters of UTF-8; those of a wrong baud rate hardly ever are."""
    try:
        received.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def _said(heard: bytes | bytearray) -> bytes | bytearray:
    return heard.translate(None, _NOT_SAID)


def _last_line(heard: bytearray) -> str:
    return bytes(heard).splitlines()[-1].decode("ascii", "replace")  # asked only after a whole line
