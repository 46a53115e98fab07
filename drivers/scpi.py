"""Common parts of drivers of SCPI meters: identity, error queue, reading settings back, readings in two steps.

The differences between meters are in a `Dialect`. One query is sent at a time.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from rig.drivers.clock import Clock
from rig.drivers.errors import BadReply, DriverError, InstrumentError, LimitError, NoReply, NotReady, WrongInstrument
from rig.drivers.kept import not_kept
from rig.drivers.numbers import decimal, whole
from rig.drivers.roles import Identity
from rig.drivers.wires import SerialLine
from rig.drivers.wires.line import Line

SYNC = ("SYST:VERS?", "19")
"""A question that is only used for synchronisation; the answer is the year of the standard and a revision: 1991.0."""

_MOST_ERRORS = 21  # more than the queues of these meters hold, 20 at most: a queue that does not end is garbled
_LATE_S = 2.0  # beyond the computed duration; chosen
_CHARACTERS_PER_READING = 16  # +1.23456789E+01 and a comma
_READBACK = 1e-6  # relative: answers are printed with eight decimals
_MARKS = 32  # measurements are numbered 1 to 31 and from 1 again, in bits of the mask that have no effect of their own
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(E[+-]?\d{1,3})?", re.ASCII)

PREPARED = 52
"""An event enable mask (query, execution and command errors) that means: prepared, and not switched off since.

The mask has no other use. Instruments clear it at power-on, and reading it changes nothing. So the evidence remains if
a session ends before it has used it (unlike the power-on bit of *ESR?).
"""


def one_of(*allowed: str | float) -> Callable[[Any], Any]:
    """A validator: the number, or text, must be one of a few."""

    def check(value: Any) -> Any:
        if value not in allowed:
            raise ValueError(f"must be one of {', '.join(a if isinstance(a, str) else f'{a:g}' for a in allowed)}")
        return value

    return check


@dataclass(frozen=True)
class Dialect:
    """Differences between SCPI meters. The defaults are those of SCPI-1999 without commands of one maker.

    Attributes:
        remote: the command for remote control; "" if there is none, as over GPIB and LAN.
        clear: command that gives up a measurement and empties the buffers: Ctrl-C if it acts as device clear.
        clear_with_dtr: whether the line DTR has to be dropped for it.
        reading: pattern of printed readings; a stricter pattern detects lost characters more reliably.
        start: starts `{count}` sweeps, whose readings the instrument keeps.
        fetch: asks for them when they are complete.
    """

    remote: str = ""
    clear: str = "ABOR"
    clear_with_dtr: bool = False
    reading: re.Pattern[str] = _NUMBER
    start: str = "TRIG:COUN {count};:INIT"
    fetch: str = "FETC?"


Interface = Literal["rs232", "gpib"]
"""Interface of the instrument itself, whatever carries the text to it."""

INTERFACE = "rs232, also behind a serial server, or gpib"


class ScpiMeter(ABC):
    """A meter that is started with INITiate and asked for its readings with FETCh?, or as in its dialect.

    It satisfies `rig.drivers.roles.Restartable` and `SelfChecking`.

    Args:
        line: its open line.
        clock: bench time.
        model: required model name in its identity.
        dialect: its dialect.
    """

    def __init__(self, line: SerialLine, clock: Clock, model: str, dialect: Dialect = Dialect()) -> None:
        self._line = line
        self._clock = clock
        self._model = model
        self._dialect = dialect
        self._remote = dialect.remote if line.rs232 else ""
        self._count = 0
        self._due = 0.0
        self._mark = 0
        self._declared: Mapping[str, float | str] = {}

    @abstractmethod
    def channels(self) -> Sequence[str]:
        """Channel labels in scan order; a single-input meter has one channel, "input"."""

    @abstractmethod
    def prepare(self) -> None:
        """Set remote control, units, ranges and speeds as the bench declares them."""

    @property
    @abstractmethod
    def most_sweeps(self) -> int:
        """Maximum number of sweeps in the instrument's memory."""

    @abstractmethod
    def sweep_s(self) -> float:
        """Duration of one sweep over all channels, seconds."""

    def identify(self) -> Identity:
        """Ask for the identity.

        It also ends a measurement of an earlier session, whose readings could be taken for the answer, and takes remote
        control.
        """
        self._clear()
        if self._remote:
            self._line.write(self._remote)
        answer = self._line.query("*IDN?")
        parts = [part.strip() for part in answer.split(",")]
        if "*IDN?" in answer.upper():
            raise WrongInstrument(
                f"{self._line.where} echoes the command before its answer, {answer!r}: switch the echo off, "
                f"at the instrument, the adapter or the serial server"
            )
        if len(parts) != 4 or parts[1] != self._model:
            raise WrongInstrument(f"{self._line.where} should be a {self._model}; it answers {answer!r} to *IDN?")
        return Identity(*parts)

    def restarted(self) -> bool:
        """Whether it has been powered up since `prepare` last ran."""
        answer = self._line.query("*ESE?")
        try:
            return whole(answer) != PREPARED
        except ValueError:
            raise self._line.bad_reply("*ESE?", answer, "a number") from None

    def wrong(self) -> Sequence[str]:
        """Settings that are not as declared: the settings of `prepare`. Nothing is asked of a meter with a command for
        remote control: its panel is locked, and set to local it refuses to measure.
        """
        if self._remote:
            return ()
        return [f"{q} answers {answer}, not {wanted}" for q, wanted, answer in self._not_kept(self._declared)]

    def start(self, count: int) -> float:
        """Trigger `count` sweeps over all channels; returns the seconds they are expected to take.

        The measurement's number is written to the service request mask, which a serial line does not use. Readings of
        an earlier measurement, kept in the instrument or late on the wire, come with another number.

        Raises:
            LimitError: fewer than one sweep, or more than the instrument's memory holds.
        """
        if not 1 <= count <= self.most_sweeps:
            raise LimitError(f"{self._line.where} can take 1 to {self.most_sweeps} sweeps at once, not {count}")
        self._mark = self._mark % (_MARKS - 1) + 1
        self._line.write(f"*SRE {self._mark};:{self._dialect.start.format(count=count)}")
        expected = count * self.sweep_s()
        self._count = count
        self._due = self._clock.now() + expected
        return expected

    def fetch(self) -> Mapping[str, Sequence[float]]:
        """Collect the readings of the last `start`, by channel, waiting for them if necessary. Asks only when the
        readings are due, because the instrument does not listen before.

        Raises:
            NotReady: nothing was started.
            NoReply: the readings did not come; the measurement has been given up.
            BadReply: the wrong number of readings, or readings of another measurement.
        """
        if not self._count:
            raise NotReady(f"{self._line.where}: there is nothing to fetch; start a measurement first")
        names = self.channels()
        count, self._count = self._count, 0
        self._clock.sleep(self._due - self._clock.now())
        question = f"{self._dialect.fetch};*SRE?"
        sending_s = self._line.takes_s(count * len(names) * _CHARACTERS_PER_READING)
        try:
            answer = self._line.query(question, sending_s + count * self.sweep_s() / 4 + _LATE_S, repeat=False)
        except NoReply:
            self._clear()
            self._raise_errors()  # often the reason for missing readings
            raise
        readings, _, mark = answer.rpartition(";")
        if not readings:  # only the mark: there are no readings
            self._clear()
            self._raise_errors()
        words = readings.split(",")
        if not (mark.isascii() and mark.strip("+").isdecimal() and all(map(self._dialect.reading.fullmatch, words))):
            raise self._line.bad_reply(question, answer, "readings and the measurement's mark")
        if int(mark) != self._mark:
            raise self._line.bad_reply(question, answer, f"mark {self._mark}: these are another measurement's readings")
        if len(words) != count * len(names):
            raise self._line.bad_reply(question, answer, f"{count * len(names)} numbers")
        values = [float(word) for word in words]  # by the pattern only decimal digits
        if not all(map(math.isfinite, values)):
            raise self._line.bad_reply(question, answer, "finite numbers")
        return {name: values[i :: len(names)] for i, name in enumerate(names)}

    def make_safe(self) -> None:
        """The safe state: a running measurement is given up; nothing else can do harm."""
        self._clear()
        self._count = 0

    def close(self) -> None:
        """Release the wire; idempotent."""
        self._line.close()

    def _clear(self) -> None:
        self._line.device_clear(self._dialect.clear, with_dtr=self._dialect.clear_with_dtr)

    def _configure(self, commands: Iterable[str]) -> None:
        """Reset to a known state, send commands one by one, and check that none was refused."""
        self._clear()
        self._declared = {}
        remote = (self._remote,) if self._remote else ()
        for command in (*remote, "*RST", "*CLS", *commands):
            self._line.write(command)
            # It answers when the command has been carried out, so none is sent while the meter is busy.
            if self._line.query("*OPC?") != "1":
                raise self._line.bad_reply("*OPC?", "", "1")
        self._raise_errors()

    def _mark_prepared(self) -> None:
        """The last step of preparing: set the mark that `restarted` reads."""
        self._line.write(f"*PSC 1;*ESE {PREPARED}")  # PSC 1: power-on clears the mask, and with it the mark
        self._verify({"*ESE?": float(PREPARED)})

    def _verify(self, wanted: Mapping[str, float | str]) -> None:
        """Read settings back. Raises `BadReply` with the first wrong one."""
        self._declared = {**self._declared, **wanted}
        for question, value, answer in self._not_kept(wanted):
            raise BadReply(f"{self._line.where}: {question} should answer {value} and answers {answer!r}")

    def _not_kept(self, wanted: Mapping[str, float | str]) -> Iterator[tuple[str, float | str, str]]:
        return not_kept(wanted, self._line.query, _agree)

    def _raise_errors(self) -> None:
        """Empty its error queue. Raises `InstrumentError` with the errors."""
        raise_errors(self._line, lambda: self._line.query("SYST:ERR?", repeat=False), _MOST_ERRORS)


def _agree(answer: str, wanted: float | str) -> bool:
    """Whether an answer is as wanted, with one number for each channel."""
    return all(agrees(part, wanted) for part in ([answer] if isinstance(wanted, str) else answer.split(",")))


def raise_errors(line: SerialLine, ask: Callable[[], str], most: int, question: str = "SYST:ERR?") -> None:
    """Empty an instrument's error queue.

    Args:
        line: for messages.
        ask: reads and removes the oldest error of the queue: a number, a comma and a quoted text, number 0 for none.
        most: maximum length of the queue.
        question: the query, for messages.

    Raises:
        InstrumentError: the first error, the others in its text.
        BadReply: an answer that is not an error.
    """
    found: list[tuple[int, str]] = []
    while len(found) <= most:
        answer = ask()
        code, _, text = answer.partition(",")
        try:
            number = whole(code)
        except ValueError:
            raise line.bad_reply(question, answer, 'code,"text"') from None
        if number == 0:
            break
        found.append((number, text.strip().strip('"')))
    if found:
        (first, words), *others = found
        raise InstrumentError(line.where, first, words + "".join(f"; then {c} {t}" for c, t in others))


def forget_errors(raise_errors: Callable[[], None], line: Line) -> None:
    """Empty an error queue of errors that are nobody's; an answer that makes no sense is left for later."""
    for _ in range(2):
        try:
            raise_errors()
        except InstrumentError:
            continue
        except DriverError:
            line.drain()
        return


def agrees(answer: str, wanted: float | str) -> bool:
    """Whether an answer is a text, or a number within the rounding of its last digits."""
    if isinstance(wanted, str):
        return answer == wanted
    try:
        return math.isclose(decimal(answer), wanted, rel_tol=_READBACK)
    except ValueError:
        return False
