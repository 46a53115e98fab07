"""Talk with a SCPI instrument that a bench file describes: identity, lines with their errors, settings read back.

Before the identity is known, only the question for it is sent. After every command the instrument's errors are read.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable, Mapping
from typing import TypeVar

from rig.drivers.clock import Clock
from rig.drivers.errors import BadReply, DriverError, InstrumentError, NoReply, WrongInstrument
from rig.drivers.kept import not_kept
from rig.drivers.numbers import decimal, whole
from rig.drivers.roles import Identity
from rig.drivers.scpi import PREPARED, agrees, raise_errors
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

    def number(self, question: str) -> float:
        """The number in the answer to a question, by the bench file's form. Raises `BadReply`."""
        return self.asked(question, self.number_in)

    def whole(self, question: str) -> int:
        """The answer to a question as a whole number. Raises `BadReply`."""
        return self.asked(question, self._whole_in)

    def _whole_in(self, question: str, answer: str) -> int:
        try:
            return whole(answer)
        except ValueError:
            raise self.line.bad_reply(question, answer, "a whole number") from None

    def number_in(self, question: str, answer: str) -> float:
        """The number in an answer. Raises `BadReply`."""
        return self.printed_in(question, answer)[1]

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
        for _ in range(2):
            try:
                self.raise_errors()
            except InstrumentError:
                continue
            except DriverError:
                self.line.drain()
            return

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
