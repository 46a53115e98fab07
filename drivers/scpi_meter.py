"""A digital voltmeter (DVM), or another meter with one input, that the bench file describes: any maker's.

Options: docs/how_to/scpi.md; an example: `examples/voltmeter-lab/bench.toml`. How a driver of its own is added:
`drivers/__init__.py`.

It is started and fetched as the bench file says. Readings are recognised by a number in the service request mask where
the instrument allows that, as in `rig.drivers.scpi`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

from pydantic import AfterValidator, Field

from rig.drivers.clock import Clock
from rig.drivers.driver import ContractFile, Medium
from rig.drivers.errors import BadReply, DriverError, LimitError, NotReady
from rig.drivers.numbers import whole
from rig.drivers.roles import OVERLOAD, Identity, is_overload
from rig.drivers.scpi_described import DescribedScpi
from rig.drivers.scpi_learned import PrintedForm
from rig.drivers.scpi_options import Command, Question, ScpiOptions, filled
from rig.drivers.wires import Wires

_INPUT = "input"
_LATE_S = 2.0  # beyond the declared duration; chosen
_CHARACTERS_PER_READING = 20  # chosen: a number of any maker with its comma
_MARKS = 31  # bits of the service request mask without an effect on these lines: see `rig.drivers.scpi`


class DescribedMeter:
    """The meter; satisfies `rig.drivers.roles.Reader`, `WithUnits`, `Restartable`, `SelfChecking` and `Learning`.

    It has one channel, "input".

    Args:
        name: the bench's name for it.
        address: text address.
        options: see `Options`.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the address cannot be opened.
    """

    wire: ClassVar[Medium] = "serial"
    contracts: ClassVar[tuple[ContractFile, ...]] = ()

    class Options(ScpiOptions):
        """Options of this instrument in the bench file."""

        start: Annotated[str, AfterValidator(filled("count"))] | None = Field(
            None, description="starts {count} readings that it keeps; left out: each fetch takes one reading"
        )
        fetch: Question = Field("READ?", description="asks for all readings since start, or for one new reading")
        abort: Command | None = Field(None, description="gives up readings under way; left out: device clear only")
        reading_s: float = Field(ge=0.0, le=600.0, description="duration of a reading, seconds")
        most: int = Field(1000, ge=1, le=1_000_000, description="maximum number of readings in its memory")
        numbered: bool = Field(
            True, description="number measurements in *SRE, so that late and other readings are recognised"
        )
        overload: float = Field(
            9.9e37,
            gt=0.0,
            description="readings of this size or larger are outside the range; the twin's range ends there",
        )

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self.name = name
        self._options = options
        self._clock = clock
        self._scpi = DescribedScpi(name, address, options, wires, clock)
        self._where = self._scpi.line.where
        self._count = self._mark = 0
        self._due = 0.0
        self._form = PrintedForm()

    def channels(self) -> Sequence[str]:
        """Channel labels in scan order; a single-input meter has one channel, "input"."""
        return (_INPUT,)

    def units(self) -> Mapping[str, str]:
        """Unit of each channel's readings, by channel, as at the end of column names ("mV", "kN", "ohm")."""
        return {_INPUT: self._options.unit}

    def identify(self) -> Identity:
        """Ask for the identity.

        The bus is cleared first, which ends a measurement of an earlier session; nothing but *IDN? is sent.
        """
        self._scpi.line.drain()
        return self._scpi.identify()

    def prepare(self) -> None:
        """Send the lines of the bench file, and read settings back.

        Raises:
            InstrumentError: a line was refused.
            BadReply: a setting reads back differently.
        """
        self._count = 0
        self._give_up()
        self._scpi.prepare()

    def restarted(self) -> bool:
        """Whether it has been powered up since `prepare` last ran."""
        return self._scpi.restarted()

    def wrong(self) -> Sequence[str]:
        """Settings that are not as declared: the questions of `check` and `healthy`, without settings that `start`
        changes.
        """
        return self._scpi.wrong(self._options.start or "")

    def learned(self) -> Mapping[str, str | int]:
        """Its knowledge: the form of its readings."""
        return self._form.learned

    def recall(self, learned: Mapping[str, str | int]) -> None:
        """Take the knowledge of an earlier session of the run."""
        self._form.recall(learned)

    def start(self, count: int) -> float:
        """Trigger `count` sweeps over all channels; returns the seconds they are expected to take.

        Raises:
            LimitError: fewer than one reading, or more than its memory holds.
            InstrumentError: it refuses.
        """
        options = self._options
        if not 1 <= count <= options.most:
            raise LimitError(f"{self._where} can take 1 to {options.most} readings at once, not {count}")
        if options.start is not None:
            self._number()
            self._scpi.tell(options.start.replace("{count}", str(count)))
        expected = count * options.reading_s if options.start is not None else 0.0  # otherwise fetching takes the time
        self._count = count
        self._due = self._clock.now() + expected
        return expected

    def fetch(self) -> Mapping[str, Sequence[float]]:
        """Collect the readings of the last `start`, by channel, waiting for them if necessary.

        Raises:
            NotReady: nothing was started.
            NoReply: the readings did not come; the measurement has been given up.
            InstrumentError: it reports an error; its readings are not used.
            BadReply: the wrong number of readings, or readings of another measurement.
        """
        if not self._count:
            raise NotReady(f"{self._where}: there is nothing to fetch; start a measurement first")
        count, self._count = self._count, 0
        try:
            values = self._block(count) if self._options.start is not None else self._singly(count)
        except DriverError:
            try:
                self._scpi.raise_errors()  # often the reason
            finally:
                self._give_up()
            raise
        self._scpi.raise_errors()
        return {_INPUT: self._of_one_form(values)}

    def _of_one_form(self, readings: Sequence[tuple[str, float]]) -> list[float]:
        """Values of readings. Raises `BadReply` if one is printed in another form than all before."""
        values = [value for _, value in readings]
        if not self._options.digits:
            odd = self._form.strange([printed for printed, value in readings if not is_overload(value)])
            if odd:
                raise BadReply(
                    f"{self._where} printed a reading as {odd!r}, and all before in another form: a character may have "
                    f"been lost or doubled on its way; it is asked again"
                )
        return values

    def _number(self) -> None:
        """Give the next readings a number."""
        self._mark = self._mark % _MARKS + 1
        if self._options.numbered:
            self._scpi.tell(f"*SRE {self._mark}")

    def _singly(self, count: int) -> list[tuple[str, float]]:
        """One question for each reading."""
        timeout = self._options.reading_s * 1.25 + self._options.timeout_s
        found: list[tuple[str, float]] = []
        for _ in range(count):
            self._number()
            found += self._readings(1, timeout)
        return found

    def _block(self, count: int) -> list[tuple[str, float]]:
        """All readings with one answer, when they are due."""
        self._clock.sleep(self._due - self._clock.now())
        sending_s = self._scpi.line.takes_s(count * _CHARACTERS_PER_READING)
        return self._readings(
            count, sending_s + count * self._options.reading_s / 4 + _LATE_S + self._options.timeout_s
        )

    def _readings(self, count: int, timeout_s: float) -> list[tuple[str, float]]:
        """Ask for readings, as printed and in numbers, and check that they are those of the present number."""
        numbered = self._options.numbered
        question = f"{self._options.fetch};*SRE?" if numbered else self._options.fetch
        answer = self._scpi.ask(question, timeout_s, repeat=False)
        words = answer
        if numbered:
            words, _, mark = answer.rpartition(";")
            try:
                ours = whole(mark) == self._mark
            except ValueError:
                raise self._scpi.line.bad_reply(question, answer, "readings and the measurement's mark") from None
            if not ours:
                raise self._scpi.line.bad_reply(question, answer, f"mark {self._mark}: these are other readings")
        form, parts = self._options.number.split(";"), words.split(";")
        at = next(n for n, part in enumerate(form) if "{number}" in part)  # of a compound question, the readings' part
        readings = parts[at].split(",") if len(parts) == len(form) else []
        if len(readings) != count:
            raise self._scpi.line.bad_reply(question, answer, f"{count} numbers")
        return [self._value(question, ";".join([*parts[:at], one, *parts[at + 1 :]])) for one in readings]

    def _value(self, question: str, reading: str) -> tuple[str, float]:
        printed, value = self._scpi.printed_in(question, reading)
        if abs(value) >= self._options.overload:
            return printed, OVERLOAD if value > 0 else -OVERLOAD
        return printed, value

    def make_safe(self) -> None:
        """The safe state: a running measurement is given up; nothing else can do harm."""
        self._count = 0
        self._give_up()

    def _give_up(self) -> None:
        self._scpi.line.drain()
        if self._options.abort is not None:
            self._scpi.tell(self._options.abort)
            self._scpi.forget_errors()

    def close(self) -> None:
        """Release the wire; idempotent."""
        self._scpi.line.close()
