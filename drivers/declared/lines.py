"""Lines of an instrument's file on their wire: in frames, to one of several instruments, with all that answers them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from rig.contracts.declared.exchanges import Ask, Tell
from rig.contracts.declared.forms import Form
from rig.contracts.declared.instrument import Instrument
from rig.contracts.declared.sums import Frame
from rig.drivers.clock import Clock
from rig.drivers.declared.headers import same_header
from rig.drivers.declared.known_lines import sync_of
from rig.drivers.declared.talk import Talk
from rig.drivers.errors import BadReply
from rig.drivers.wires import SerialSettings, Wires
from rig.drivers.wires.line import Line
from rig.drivers.wires.serial_options import LineSettings


class LinesTalk(Talk):
    """Common part of instruments that take lines of text: the line, its frames, and whose turn it is.

    Args:
        table: its file.
        name: the bench's name for it.
        address: text address.
        settings: of the line, as the bench file has them.
        parameters: by name.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the address cannot be opened.
    """

    def __init__(
        self,
        table: Instrument,
        name: str,
        address: str,
        settings: LineSettings,
        parameters: Mapping[str, str | float],
        wires: Wires,
        clock: Clock,
    ) -> None:
        wire, self._parameters = table.wire, parameters
        self._shared = bool(wire.preamble or wire.shared) or any(hole in wire.request for hole in parameters)
        self.line: Line = self._opened(table, name, address, settings, wires)
        super().__init__(table, clock, self.line.where)
        self._frames = wire.frames(parameters)
        self._end = wire.reply_end or wire.send_end
        # whether a line goes out and comes in as it is
        self._bare = not (
            self._shared or self._frames or wire.request != "{line}" or wire.read or wire.echo or wire.by_frame
        )
        self._begun = False
        self._whole_once: set[str] = set()  # questions after whose answer nothing came
        serial = settings.serial and self.line.rs232
        self._clears_with_dtr = serial and wire.clear_drops_dtr
        self._remote = (Tell(tell=wire.remote),) if wire.remote and serial else ()

    def _opened(self, table: Instrument, name: str, address: str, settings: LineSettings, wires: Wires) -> Line:
        """Open the line. Raises `Unreachable`."""
        wire = table.wire
        return wires.serial(
            address,
            SerialSettings(
                settings.baud,
                settings.frame,  # type: ignore[arg-type]  # the schema has the same list
                settings.flow,
                send_end=wire.send_end.encode("ascii") if settings.send_end is None else settings.send_end,
                reply_end=(wire.reply_end.encode("ascii") or settings.send_end or wire.send_end.encode("ascii"))[-1:],
                timeout_s=wire.timeout_s,
                sync=None if self._shared or wire.echo or wire.request != "{line}" else sync_of(table),
                encoding="latin-1" if wire.by_frame else table.encoding,
            ),
            name,
        )

    def _form(self, text: str, words: frozenset[str] = frozenset()) -> Form:
        return Form(text, words).filled(self._parameters)

    def _begin(self) -> None:
        """Keep the distance of lines; take the wire if another instrument has used it."""
        wire = self.table.wire
        self.paced()
        if self._shared and self.line.user is not self:
            for text in wire.preamble:
                self.line.write(self._form(text).write({}))
            self.line.user = self
            if wire.preamble and not self._begun:  # it may stop a stream, or have an answer
                self.line.drain()
                self._begun = True

    def _framed(self, line: str, frame: Frame | None) -> str:
        frame = frame or (self._frames[0] if self._frames is not None else None)
        return line if frame is None else frame.write(self._recoded(line, "utf-8", "latin-1"))

    def _recoded(self, line: str, before: str, after: str) -> str:
        """A line in a frame, whose bytes are characters of Latin-1, if the file says that it is UTF-8."""
        by_bytes = self.table.wire.encoding == "utf-8" and self.table.wire.by_frame
        return line.encode(before).decode(after) if by_bytes else line

    def _unframed(self, question: str, line: str) -> str:
        if self._frames is None:
            return line
        found = self._frames[1].read(line)
        if found is None:
            frames = " or ".join(map(repr, self.table.wire.reply))
            raise self.line.bad_reply(question, line, f"an answer in the frame {frames}")
        if found[1]:
            raise self.line.bad_reply(question, line, f"the checksum {found[1]}")
        try:
            return self._recoded(found[0], "latin-1", "utf-8")
        except UnicodeDecodeError:
            raise self.line.bad_reply(question, line, "UTF-8, as its file says") from None

    def _whole(self, received: bytes, *, lines: int = 1) -> bool:
        """Whether an answer whose frame tells its end is complete."""
        text = received.decode("latin-1")
        if not text.endswith(self._end):
            return False
        every = self._apart(text, lines)
        found = [self._frames[1].read(one) for one in every] if self._frames is not None else []
        return len(every) == lines and all(one is not None and not one[1] for one in found)

    def _apart(self, text: str, lines: int) -> list[str]:
        """Lines of an answer; one alone may have bytes in it that look like an end."""
        text = text.removesuffix(self._end)
        return text.split(self._end) if lines > 1 and self._end else [text]

    def _write(self, line: str, frame: Frame | None) -> None:
        self._begin()
        if self.table.wire.echo:
            self._query(line, 0, None, frame, repeat=False)
        else:
            self.line.write(self._framed(line, frame))

    def _query(
        self, line: str, lines: int, timeout_s: float | None, frame: Frame | None = None, *, repeat: bool
    ) -> str:
        """The answer to a line. Raises `NoReply`, `BadReply`."""
        self._begin()
        if self._bare and frame is None:
            found = self.line.query_lines(line, lines, timeout_s, repeat=repeat)
            answer = found[0] if lines == 1 else " ".join(found)
            return answer if self.table.wire.headers is None else self._headless(line, answer)
        sent = self.table.wire.with_reads(self._framed(line, frame), lines)
        if not self.table.wire.echo:
            whole = partial(self._whole, lines=lines) if self.table.wire.by_frame else None
            found = self.line.query_lines(sent, lines, timeout_s, repeat=repeat, whole=whole)
            found = self._apart(found[0], lines) if whole is not None else found
        else:
            first, *found = self.line.query_lines(sent, lines + 1, timeout_s, repeat=repeat)
            if first != sent.strip():
                raise self.line.bad_reply(sent, first, "the line itself: it echoes")
        return self._headless(line, " ".join(self._unframed(sent, one) for one in found))

    def _headless(self, question: str, answer: str) -> str:
        """An answer without the header that it repeats. Raises `BadReply` if that is of another question."""
        ends, (header, _, value) = self.table.wire.headers, answer.partition(" ")
        if ends is None or header[:1] not in (":", "*"):  # it can be told to leave headers out
            return answer
        asked = question.removesuffix("?")
        if not same_header(asked, header, ends):
            raise self.line.bad_reply(question, answer, f"{asked} and a value")
        return value.strip()

    def _nothing_more(self, question: str, raw: str, lines: int = 1) -> None:
        """Raise `BadReply` if more comes after the first answer to a question: it would answer the next one.

        IEEE 488.2 has one line for each; a stream, or an instrument that is not prepared, sends whatever it likes.
        Files that are supplied are not watched: it takes a moment of the first readings.
        """
        told = self.quiet and not self.table.scpi and self.table.wire.protocol != "stream"
        if not told or question in self._whole_once:
            return
        if more := self.line.beyond():
            count = lines + len(more.splitlines())
            raise self.line.bad_reply(
                question, f"{raw} {more}", f"{lines} line(s), and more came after it; write lines = {count} if it is so"
            )
        self._whole_once.add(question)

    def bad(self, ask: Ask | Tell, answer: object, expected: str) -> BadReply:
        """The error for an answer that makes no sense; the line is synchronised before its next use."""
        return self.line.bad_reply(ask.said, answer, expected)

    def takes_s(self, characters: int) -> float:
        """Maximum bench seconds for this many characters on the wire."""
        return self.line.takes_s(characters)

    def drain(self) -> None:
        """Listen until it is silent; one that talks by itself never is."""
        if self.table.wire.protocol != "stream":
            self._begin()
            self.line.drain()

    def clear(self) -> None:
        """Have it give up what it does, if it can be told to; listen until it is silent."""
        if self.table.wire.clear:
            self._begin()
            self.line.device_clear(self.table.wire.clear, with_dtr=self._clears_with_dtr)
        else:
            self.drain()

    @property
    def remote(self) -> tuple[Tell, ...]:
        """The command for remote control, which locks its panel; () if there is none on this wire."""
        return self._remote

    def renew(self) -> None:
        """Send the preamble again before the next line: the instrument, or its adapter, may have been off."""
        if self.line.user is self:
            self.line.user = None
        self._begun = False

    def close(self) -> None:
        """Release the wire; idempotent."""
        self.line.close()
