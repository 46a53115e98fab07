"""Talk with a SCPI instrument that a bench file describes: identity, lines with their errors, settings read back.

Before the identity is known, only the question for it is sent. After every command the instrument's errors are read.
The roles are those of declared instruments (`rig.drivers.declared`): `Described` gives them this way to talk.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, TypeVar

from rig.contracts.declared.exchanges import Ask, Check, Tell
from rig.contracts.declared.instrument import Instrument
from rig.drivers.clock import Clock
from rig.drivers.declared.base import Remembering
from rig.drivers.declared.talk import NOTHING, Answer, Holes, Talk
from rig.drivers.driver import Medium
from rig.drivers.errors import BadReply, InstrumentError, NoReply, WrongInstrument
from rig.drivers.kept import not_kept
from rig.drivers.numbers import decimal, whole
from rig.drivers.roles import Identity
from rig.drivers.scpi import PREPARED, agrees, forget_errors, raise_errors
from rig.drivers.scpi_learned import is_unit, same_unit, unit_after
from rig.drivers.scpi_options import ScpiOptions
from rig.drivers.wires import SerialLine, SerialSettings, Wires

Value = TypeVar("Value")

_MOST_ERRORS = 32  # chosen: a queue that does not end is a garbled answer
_EVENTS = {4: "query error", 8: "device error", 16: "execution error", 32: "command error"}
"""Errors in the standard event register (IEEE 488.2, 11.5.1)."""


class DescribedScpi:
    """One instrument; sends what its options say.

    Args:
        name: the bench's name for it.
        address: text address.
        options: see `ScpiOptions`.
        wires: where to open it.
        clock: bench time.

    Attributes:
        line: its line.

    Raises:
        Unreachable: the address cannot be opened.
    """

    def __init__(self, name: str, address: str, options: ScpiOptions, wires: Wires, clock: Clock) -> None:
        self.line: SerialLine = wires.serial(
            address,
            SerialSettings(
                options.baud,
                options.frame,
                options.flow_at(address),
                send_end=options.send_end,
                reply_end=options.reply_end,
                timeout_s=options.timeout_s,
                sync=("*IDN?", options.model) if options.model else None,
            ),
            name,
        )
        self._options = options
        self._clock = clock
        self._number = options.number_pattern
        self._free = -math.inf  # the time from which the next line may be sent

    def _paced(self) -> None:
        if self._options.pace_s:
            self._clock.sleep(self._free - self._clock.now())
            self._free = self._clock.now() + self._options.pace_s

    def ask(self, question: str, timeout_s: float | None = None, *, repeat: bool = True) -> str:
        """The answer to a question.

        Raises:
            InstrumentError: it does not answer, and has an error to tell.
            NoReply: it does not answer.
            BadReply: the answer is no line of text.
        """
        self._paced()
        try:
            return self.line.query(question, timeout_s, repeat=repeat)
        except NoReply:
            if question not in ("*IDN?", self._options.error):
                with contextlib.suppress(NoReply, BadReply):
                    self._check(question)
            raise

    def asked(self, question: str, meaning: Callable[[str, str], Value]) -> Value:
        """The meaning of an answer; the question has no side effect and is asked again if that makes no sense.

        Args:
            question: the question.
            meaning: takes question and answer; raises `BadReply`.
        """
        try:
            return meaning(question, self.ask(question))
        except BadReply:
            return meaning(question, self.ask(question))

    def whole(self, question: str) -> int:
        """The answer to a question as a whole number. Raises `BadReply`."""
        return self.asked(question, self._whole_in)

    def _whole_in(self, question: str, answer: str) -> int:
        try:
            return whole(answer)
        except ValueError:
            raise self.line.bad_reply(question, answer, "a whole number") from None

    def printed_in(self, question: str, answer: str) -> tuple[str, float]:
        """The number in an answer as printed, and its value. Raises `BadReply`, also for another unit after it."""
        found, digits, form = self._number.fullmatch(answer), self._options.digits, self._options.number
        number, unit = unit_after(found[1]) if found is not None else ("", "")
        if found is not None and digits and not re.fullmatch(digits, number, re.ASCII):
            raise self.line.bad_reply(question, answer, f"a number of the form {digits!r}")
        declared = self._options.unit
        if unit and not same_unit(unit, declared) and (is_unit(unit) or "*" not in form):
            raise self.line.bad_reply(
                question,
                answer,
                f"a number in {declared}, as in the bench file; was its unit changed at the panel?",
            )
        try:
            if found is not None:
                return number, decimal(number)
        except ValueError:
            pass
        raise self.line.bad_reply(question, answer, f"a number as in {form!r}")

    def tell(self, command: str) -> None:
        """Send a command without looking at its errors: only on the way to the safe state."""
        self._paced()
        self.line.write(command)

    def send(self, command: str) -> None:
        """Send a command, and check that it was not refused. Raises `InstrumentError`."""
        self.tell(command)
        self._check(command)

    def _check(self, line: str) -> None:
        """Raise `InstrumentError` with the first error after a line."""
        try:
            self.raise_errors()
        except InstrumentError as error:
            raise InstrumentError(f"{self.line.where}, after {line!r},", error.code, error.text) from None

    def raise_errors(self) -> None:
        """Empty the error queue. Raises `InstrumentError` with the first error."""
        question = self._options.error
        if not question.upper().endswith("*ESR?"):
            raise_errors(self.line, lambda: self.ask(question, repeat=False), _MOST_ERRORS, question)
            return
        events = self._whole_in(question, self.ask(question, repeat=False))
        found = [words for bit, words in _EVENTS.items() if events & bit]
        if found:
            raise InstrumentError(self.line.where, events, " and ".join(found))

    def forget_errors(self) -> None:
        """Empty the error queue of errors that are nobody's; an answer that makes no sense is left for later."""
        forget_errors(self.raise_errors, self.line)

    def identify(self) -> Identity:
        """Ask for the identity. Nothing but *IDN? is sent."""
        options = self._options
        answer = self.ask("*IDN?")
        if "*IDN?" in answer.upper():
            raise WrongInstrument(
                f"{self.line.where} echoes the command before its answer, {answer!r}: switch the echo off, "
                f"at the instrument, the adapter or the serial server"
            )
        parts = [part.strip() for part in answer.split(",", 3)]
        maker, model, serial, firmware = (parts + [""] * 4)[:4]
        if options.identity:
            known = re.fullmatch(options.identity, answer) is not None
        else:
            known = model == options.model and options.maker in ("", maker)
        if not known:
            wanted = options.identity or f"{options.maker}{options.maker and ' '}{options.model}"
            raise WrongInstrument(f"{self.line.where} should be a {wanted}; it answers {answer!r} to *IDN?")
        return Identity(maker, model, serial, firmware)

    def prepare(self) -> None:
        """Send the prepare lines one by one, read settings back, and set the mark of `restarted`."""
        self.forget_errors()
        for command in self._options.prepare:
            self.send(command)
        for question, value in self._options.wanted.items():
            self.verify(question, value)
        if self._options.mark:
            self.send("*PSC 1")
            self.send(f"*ESE {PREPARED}")
            self.verify("*ESE?", float(PREPARED))

    def verify(self, question: str, wanted: float | str) -> None:
        """Read a setting back. Raises `BadReply`."""

        def right(_: str, answer: str) -> None:
            if not agrees(answer, wanted):
                raise BadReply(f"{self.line.where}: {question} should answer {wanted} and answers {answer!r}")

        self.asked(question, right)

    def restarted(self) -> bool:
        """Whether it has been powered up since `prepare` last ran. Without a mark, settings that have been lost are the
        evidence.
        """
        if not self._options.mark:
            return bool(self.unhealthy(self._options.wanted))
        return self.whole("*ESE?") != PREPARED

    def wrong(self, changed_by: str = "") -> tuple[str, ...]:
        """Questions of `check` and `healthy` that are not answered as declared, as sentences.

        Args:
            changed_by: a line that the driver has sent since it was prepared; settings in it are not asked for.
        """
        ours = changed_by.upper()
        kept = {q: a for q, a in self._options.wanted.items() if q.partition("?")[0].strip(":").upper() not in ours}
        return self.unhealthy({**kept, **self._options.healthy})

    def unhealthy(self, healthy: Mapping[str, float | str]) -> tuple[str, ...]:
        """Questions whose answer is not the healthy one, also when asked again, as sentences."""
        return tuple(f"{q} answers {answer}, not {wanted}" for q, wanted, answer in not_kept(healthy, self.ask, agrees))


class _Talk(Talk):
    """The way to talk as the roles of declared instruments want it."""

    def __init__(self, table: Instrument, clock: Clock, scpi: DescribedScpi, decimals: int) -> None:
        super().__init__(table, clock, scpi.line.where)
        self._scpi, self._decimals = scpi, decimals
        source = table.source
        self._numbers = {id(ask) for ask in (source.setpoint, source.read) if ask is not None} if source else set()

    def once(self, ask: Ask, holes: Holes = NOTHING, timeout_s: float | None = None, *, repeat: bool = True) -> Answer:
        """Ask once, or twice if no answer comes and `repeat`."""
        question = ask.said
        raw = self._scpi.ask(question, timeout_s, repeat=repeat)
        if id(ask) in self._numbers:
            printed, value = self._scpi.printed_in(question, raw)
            return Answer({}, value, "", printed)
        if ask.bit is not None:
            try:
                on = whole(raw) >> ask.bit & 1
            except ValueError:
                raise self._scpi.line.bad_reply(question, raw, "a whole number") from None
            return Answer({}, math.nan, "on" if on else "off", raw)
        return Answer({}, math.nan, "", raw)

    def tell(self, tell: Tell, holes: Holes = NOTHING, *, checked: bool = True) -> None:
        """Send a command; if `checked`, look whether it was refused."""
        line = tell.said
        for name, value in holes.items():
            decimals = self._decimals if name == "value" else 0
            line = line.replace(f"{{{name}}}", f"{round(float(value), decimals) + 0.0:.{decimals}f}")
        (self._scpi.send if checked else self._scpi.tell)(line)

    def bad(self, ask: Ask, answer: object, expected: str) -> BadReply:
        """The error for an answer that makes no sense; the line is synchronised before its next use."""
        return self._scpi.line.bad_reply(ask.said, answer, expected)

    def raise_errors(self) -> None:
        """Empty the error queue. Raises `InstrumentError` with the first error."""
        self._scpi.raise_errors()

    def forget_errors(self) -> None:
        """Empty the error queue of errors that are nobody's."""
        self._scpi.forget_errors()

    def drain(self) -> None:
        """Listen until it is silent."""
        self._scpi.line.drain()

    def takes_s(self, characters: int) -> float:
        """Maximum bench seconds for this many characters on the wire."""
        return self._scpi.line.takes_s(characters)

    def close(self) -> None:
        """Release the wire; idempotent."""
        self._scpi.line.close()


class Described(Remembering):
    """A declared instrument whose table is in the bench file."""

    wire: ClassVar[Medium] = "serial"

    def _opened(self, address: str, wires: Wires) -> Talk:
        options = self._options
        healthy = tuple(Check.model_construct(ask=q, is_=answer) for q, answer in options.healthy.items())
        self.table = Instrument.model_construct(healthy=healthy, **self._roles())  # type: ignore[misc]  # of one instance
        self._scpi = DescribedScpi(self.name, address, options, wires, self._clock)
        return _Talk(self.table, self._clock, self._scpi, getattr(options, "decimals", 0))

    def _roles(self) -> Mapping[str, Any]:
        """Its reader or source."""
        raise NotImplementedError(f"{type(self).__name__} has no role")

    def identify(self) -> Identity:
        """Ask for the identity. Nothing but *IDN? is sent."""
        return self._scpi.identify()

    def prepare(self) -> None:
        """Send the lines of the bench file, and read settings back.

        Raises:
            InstrumentError: a line was refused.
            BadReply: a setting reads back differently.
        """
        self._give_up()
        self._scpi.prepare()

    def wrong(self) -> Sequence[str]:
        """Settings that are not as declared: the questions of `check` and `healthy`."""
        return self._scpi.wrong()

    def _lost(self) -> bool:
        return self._scpi.restarted()
