"""What the drivers of SCPI meters have in common: identity, error queue, settings read back, readings in two steps.

What differs from meter to meter is a `Dialect`. One query is sent at a time.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import AfterValidator

from drivers.clock import Clock
from drivers.errors import BadReply, InstrumentError, LimitError, NoReply, NotReady, WrongInstrument
from drivers.numbers import decimal, whole
from drivers.roles import Identity
from drivers.wires import SerialLine

SYNC = ("SYST:VERS?", "19")
"""A question that is asked for nothing else; the answer is the year of the standard and a revision: 1991.0."""

_MOST_ERRORS = 21
_LATE_S = 2.0
_CHARACTERS_PER_READING = 16
_READBACK = 1e-6
_MARKS = 32  # measurements are numbered 1 to 31 and from 1 again, by bits of the mask that say nothing on their own
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(E[+-]?\d{1,3})?", re.ASCII)

PREPARED = 52
"""An event enable mask (query, execution and command errors) that says: prepared, and not switched off since.

Nothing is done with the mask otherwise, instruments clear it when they are switched on, and reading it changes nothing,
so the evidence outlives a session that ends before it has acted on it (the power-on bit of *ESR? does not).
"""


def one_of(*allowed: float) -> Callable[[float], float]:
    """A check that a number is one of a few."""

    def check(value: float) -> float:
        if value not in allowed:
            raise ValueError(f"must be one of {', '.join(f'{a:g}' for a in allowed)}")
        return value

    return check


Nplc = Annotated[float, AfterValidator(one_of(0.02, 0.2, 1, 10, 100))]
"""Integration time, power line cycles."""

FREQUENCIES = (50.0, 60.0)
"""Power line frequencies that integration times refer to, Hz."""


def settling_s(nplc: float) -> float:
    """The automatic delay before a DC volts reading, seconds (34401A user's guide, chapter 3)."""
    return 0.0015 if nplc >= 1 else 0.001


@dataclass(frozen=True)
class Dialect:
    """In what SCPI meters differ. The defaults are those of SCPI-1999 and ask for nothing of a maker's own.

    Attributes:
        remote: the command that takes remote control; "" where there is none, as over GPIB and LAN.
        clear: what gives up a measurement and empties the buffers: Ctrl-C where it stands for device clear.
        clear_with_dtr: the line DTR has to be dropped for it.
        reading: how readings are printed; the stricter, the surer is a lost character noticed.
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
"""What the instrument itself is connected by, whatever carries the text to it."""


def hp_dialect(interface: Interface, *, clear_with_dtr: bool = False) -> Dialect:
    """How the 34401A and the 34970A talk (user's guides).

    Only over RS-232 do they know SYSTem:REMote, without which they refuse to measure; over GPIB it is error 514.
    """
    serial = interface == "rs232"
    return Dialect(
        remote="SYST:REM" if serial else "",
        clear="\x03",
        clear_with_dtr=serial and clear_with_dtr,
        reading=re.compile(r"[+-]\d\.\d{8}E[+-]\d\d", re.ASCII),
    )


class ScpiMeter(ABC):
    """A meter that is started with INITiate and asked for its readings with FETCh?, or as its dialect has it.

    Args:
        line: its open line.
        clock: bench time.
        model: what its identity must name.
        dialect: how it differs from others.

    """

    def __init__(self, line: SerialLine, clock: Clock, model: str, dialect: Dialect = Dialect()) -> None:
        self._line = line
        self._clock = clock
        self._model = model
        self._dialect = dialect
        self._count = 0
        self._due = 0.0
        self._mark = 0

    @abstractmethod
    def channels(self) -> Sequence[str]:
        """See `Reader.channels`."""

    @abstractmethod
    def prepare(self) -> None:
        """See `Instrument.prepare`."""

    @property
    @abstractmethod
    def most_sweeps(self) -> int:
        """Sweeps that fit the instrument's memory."""

    @abstractmethod
    def sweep_s(self) -> float:
        """Seconds that one sweep over all channels takes."""

    def identify(self) -> Identity:
        """See `Instrument.identify`.

        Also ends what an earlier session may have left under way, whose readings would be taken for the answer,
        and takes remote control.
        """
        self._clear()
        if self._dialect.remote:
            self._line.write(self._dialect.remote)
        answer = self._line.query("*IDN?")
        parts = [part.strip() for part in answer.split(",")]
        if "*IDN?" in answer.upper():
            raise WrongInstrument(
                f"{self._line.where} repeats what it is sent in front of its answer, {answer!r}: switch the echo off, "
                f"at the instrument, the adapter or the serial server"
            )
        if len(parts) != 4 or parts[1] != self._model:
            raise WrongInstrument(f"{self._line.where} should be a {self._model}; it answers {answer!r} to *IDN?")
        return Identity(*parts)

    def restarted(self) -> bool:
        """See `Restartable.restarted`."""
        answer = self._line.query("*ESE?")
        try:
            return whole(answer) != PREPARED
        except ValueError:
            raise self._line.bad_reply("*ESE?", answer, "a number") from None

    def start(self, count: int) -> float:
        """See `Reader.start`.

        The measurement is marked in the service request mask, of which a serial line makes no use: the readings of an
        earlier one, kept in the instrument or late on the wire, come with another mark.

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
        """See `Reader.fetch`. Asks only when the readings are due, since the instrument hears nothing meanwhile.

        Raises:
            NotReady: nothing was started.
            NoReply: the readings did not come; the measurement has been given up.
            BadReply: not as many numbers as were asked for, or those of another measurement.

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
            self._raise_errors()  # often says why there are no readings
            raise
        readings, _, mark = answer.rpartition(";")
        if not readings:  # the mark alone: there are none
            self._clear()
            self._raise_errors()
        words = readings.split(",")
        if not (mark.isascii() and mark.strip("+").isdecimal() and all(map(self._dialect.reading.fullmatch, words))):
            raise self._line.bad_reply(question, answer, "readings and the measurement's mark")
        if int(mark) != self._mark:
            raise self._line.bad_reply(question, answer, f"mark {self._mark}: these are another measurement's readings")
        if len(words) != count * len(names):
            raise self._line.bad_reply(question, answer, f"{count * len(names)} numbers")
        try:
            values = [decimal(word) for word in words]
        except ValueError:
            raise self._line.bad_reply(question, answer, "finite numbers") from None
        return {name: values[i :: len(names)] for i, name in enumerate(names)}

    def make_safe(self) -> None:
        """See `Instrument.make_safe`: a measurement under way is given up; nothing else can do harm."""
        self._clear()
        self._count = 0

    def close(self) -> None:
        """See `Instrument.close`."""
        self._line.close()

    def _clear(self) -> None:
        self._line.device_clear(self._dialect.clear, with_dtr=self._dialect.clear_with_dtr)

    def _configure(self, commands: Iterable[str]) -> None:
        """Reset to a known state, send commands one by one, and see that none was refused."""
        self._clear()
        remote = (self._dialect.remote,) if self._dialect.remote else ()
        for command in (*remote, "*RST", "*CLS", *commands):
            self._line.write(command)
            if self._line.query("*OPC?") != "1":
                raise self._line.bad_reply("*OPC?", "", "1")
        self._raise_errors()

    def _mark_prepared(self) -> None:
        """The last of preparing: leave the mark by which `restarted` knows that it was."""
        self._line.write(f"*PSC 1;*ESE {PREPARED}")
        self._verify({"*ESE?": float(PREPARED)})

    def _verify(self, wanted: Mapping[str, float | str]) -> None:
        """Read settings back; raises `BadReply` naming the first that is not as wanted."""
        for question, value in wanted.items():
            answer = self._line.query(question)
            parts = [answer] if isinstance(value, str) else answer.split(",")  # one number for each channel
            if not all(_agrees(part, value) for part in parts):
                raise BadReply(f"{self._line.where}: {question} should answer {value} and answers {answer!r}")

    def _raise_errors(self) -> None:
        """See `raise_errors`."""
        raise_errors(self._line, lambda: self._line.query("SYST:ERR?", repeat=False), _MOST_ERRORS)


def raise_errors(line: SerialLine, ask: Callable[[], str], most: int) -> None:
    """Empty an instrument's error queue.

    Args:
        line: for messages.
        ask: takes the oldest error from the queue: a number, a comma and a quoted text, number 0 for none.
        most: errors the queue may hold.

    Raises:
        InstrumentError: the first error, the others in its text.
        BadReply: an answer that is no error.

    """
    found: list[tuple[int, str]] = []
    while len(found) <= most:
        answer = ask()
        code, _, text = answer.partition(",")
        try:
            number = whole(code)
        except ValueError:
            raise line.bad_reply("SYST:ERR?", answer, 'code,"text"') from None
        if number == 0:
            break
        found.append((number, text.strip().strip('"')))
    if found:
        (first, words), *others = found
        raise InstrumentError(line.where, first, words + "".join(f"; then {c} {t}" for c, t in others))


def _agrees(answer: str, wanted: float | str) -> bool:
    if isinstance(wanted, str):
        return answer == wanted
    try:
        return math.isclose(decimal(answer), wanted, rel_tol=_READBACK)
    except ValueError:
        return False
