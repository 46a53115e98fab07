"""A source that the bench file describes: sets one quantity of any unit, over any wire for text.

Every setpoint is read back before the output is switched on, and errors are read after every command. A source that has
been off since it was prepared is not switched on.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from typing import Annotated, ClassVar, Self

from pydantic import AfterValidator, Field, model_validator

from rig.drivers.clock import Clock
from rig.drivers.driver import ContractFile, Medium
from rig.drivers.errors import BadReply, DriverError, LimitError, NotReady
from rig.drivers.roles import Identity, SourceState
from rig.drivers.scpi_described import DescribedScpi
from rig.drivers.scpi_options import Command, Question, ScpiOptions, filled
from rig.drivers.wires import Wires

_ON = {"1", "ON"}
_OFF = {"0", "OFF"}


class DescribedSource:
    """The source; satisfies `rig.drivers.roles.Source`, `Restartable` and `SelfChecking`.

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

        low: float = Field(description="lowest accepted setpoint, in its unit")
        high: float = Field(description="highest accepted setpoint, in its unit")
        set: Annotated[str, AfterValidator(filled("value"))] = Field(description="sets {value}, in its unit")
        decimals: int = Field(6, ge=0, le=12, description="decimals of {value}")
        setpoint: Question = Field(description="asks for the setpoint in force")
        readback: float = Field(1e-6, gt=0.0, description="largest difference between setpoint and its answer")
        read: Question | None = Field(None, description="asks for its own reading; left out: it has none")
        read_off: bool = Field(True, description="whether it gives a reading with the output off; else the setpoint")
        on: Command | None = Field(None, description="switches the output on; left out: it is always on")
        off: Command | None = Field(None, description="switches the output off: its safe state")
        output: Question | None = Field(None, description="asks whether the output is on: 1, ON, 0 or OFF")
        safe_value: float | None = Field(None, description="setpoint of the safe state, sent before switching off")
        settled: Question | None = Field(None, description="asks for a number with a bit that means settled")
        settled_bit: int = Field(0, ge=0, le=31, description="number of that bit, 0 for the lowest")
        tolerance: float | None = Field(
            None, gt=0.0, description="without settled: largest distance of its reading from the setpoint"
        )
        dwell_s: float = Field(1.0, ge=0.0, le=86400.0, description="minimum time that it has been so, or has been set")
        time_constant_s: float | None = Field(
            None,
            gt=0.0,
            le=1e6,
            description="time constant with which its quantity follows a setting, for forecasts, and for dry runs "
            "whose world file does not say it; assumed if left out: 480 s in degC, else 0.5 s",
        )

        @model_validator(mode="after")
        def _whole(self) -> Self:
            if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
                raise ValueError(f"low = {self.low:g} has to be below high = {self.high:g}, both finite")
            switches = [key for key in ("on", "off", "output") if getattr(self, key) is not None]
            if switches and len(switches) < 3:
                raise ValueError(f"on, off and output belong together; here is only {' and '.join(switches)}")
            if not switches and self.safe_value is None:
                raise ValueError("its safe state is missing: give on, off and output, or safe_value")
            if self.safe_value is not None and not self.low <= self.safe_value <= self.high:
                raise ValueError(f"safe_value = {self.safe_value:g} is outside {self.low:g} to {self.high:g}")
            if self.tolerance is not None and (self.read is None or self.settled is not None):
                raise ValueError(
                    "tolerance needs read, and no settled: it is how its reading tells that it has arrived"
                )
            if any("*RST" in line.upper() for line in self.prepare):
                raise ValueError("prepare must not contain *RST: preparing changes no output; a run may be resumed")
            if self.readback < 0.5 * 10.0**-self.decimals * (1 - 1e-9):
                raise ValueError(
                    f"readback = {self.readback:g} is less than half the last of {self.decimals} decimals: "
                    f"setpoints would be rounded further than it allows"
                )
            return self

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self.name = name
        self._options = options
        self._clock = clock
        self._scpi = DescribedScpi(name, address, options, wires, clock)
        self._where = self._scpi.line.where
        self._near_since: float | None = None  # begin of the time within tolerance
        self._set_at = clock.now()

    def unit(self) -> str:
        """Its unit as at the end of column names ("V", "kN", "degC"); a factor that it sets has the same unit."""
        return self._options.unit

    def limits(self) -> tuple[float, float]:
        """Lowest and highest accepted setpoint, in its unit."""
        return self._options.low, self._options.high

    def identify(self) -> Identity:
        """Ask for the identity. Nothing but *IDN? is sent."""
        return self._scpi.identify()

    def prepare(self) -> None:
        """Send the lines of the bench file, and read settings back; the output is not changed by this driver.

        Raises:
            InstrumentError: a line was refused.
            BadReply: a setting reads back differently.
        """
        self._scpi.prepare()

    def restarted(self) -> bool:
        """Whether it has been powered up since `prepare` last ran."""
        return self._scpi.restarted()

    def wrong(self) -> Sequence[str]:
        """Settings that are not as declared: the questions of `check` and `healthy`."""
        return self._scpi.wrong()

    def set(self, value: float) -> None:
        """Command a setpoint with the output on.

        Raises:
            LimitError: outside the limits, or not a number.
            NotReady: it has been switched off since it was prepared.
            InstrumentError: it refuses.
            BadReply: setpoint or output read back differently; the output has been switched off again.
        """
        low, high = self.limits()
        if not low <= value <= high:
            raise LimitError(f"{self._where}: {value:g} {self.unit()} is outside {low:g} to {high:g}")
        if self._scpi.restarted():  # its ranges and limits are those of power-on, not those of `prepare`
            raise NotReady(f"{self._where} has been switched off since it was prepared, and is not switched on")
        self._scpi.forget_errors()
        self._near_since, self._set_at = None, self._clock.now()
        try:
            self._command(value)
            if self._options.on is not None and not self._output():
                self._scpi.send(self._options.on)
                if not self._output():
                    raise BadReply(f"{self._where}: the output does not switch on")
        except BadReply:
            self._shut()
            raise
        self._set_at = self._clock.now()

    def _command(self, value: float) -> None:
        """Send a setpoint and read it back. Raises `InstrumentError`, `BadReply`."""
        options = self._options
        self._scpi.send(options.set.replace("{value}", f"{round(value, options.decimals) + 0.0:.{options.decimals}f}"))
        found = self._scpi.number(options.setpoint)
        if not abs(found - value) <= options.readback:
            raise BadReply(f"{self._where}: {options.setpoint} should answer {value:g} and answers {found:g}")

    def _output(self) -> bool:
        """Whether the output is on; one that cannot be switched is always on."""
        question = self._options.output
        if question is None:
            return True
        return self._scpi.asked(question, self._is_on)

    def _is_on(self, question: str, answer: str) -> bool:
        word = answer.upper().lstrip("+")
        if word not in _ON | _OFF:
            raise self._scpi.line.bad_reply(question, answer, "1, ON, 0 or OFF")
        return word in _ON

    def read(self) -> SourceState:
        """Read its state."""
        options = self._options
        setpoint = self._scpi.number(options.setpoint)
        output = self._output()
        value = setpoint
        if options.read is not None and (output or options.read_off):
            value = self._scpi.number(options.read)
        settled = output and self._settled(setpoint, value)
        at_safe = options.safe_value is not None and abs(setpoint - options.safe_value) <= options.readback
        safe = at_safe if options.off is None else not output
        return SourceState(setpoint, value, settled, output, safe, self._scpi.unhealthy(options.healthy))

    def _settled(self, setpoint: float, value: float) -> bool:
        """Whether it has arrived: by its own word, by its reading, or by the time since it was set."""
        options, now = self._options, self._clock.now()
        if options.settled is not None:
            return bool(self._scpi.whole(options.settled) >> options.settled_bit & 1)
        if options.tolerance is None:
            return now - self._set_at >= options.dwell_s
        if abs(value - setpoint) > options.tolerance:
            self._near_since = None
            return False
        if self._near_since is None:
            self._near_since = now
        return now - self._near_since >= options.dwell_s

    def stop(self) -> None:
        """Hold the present value: it becomes the setpoint."""
        state = self.read()
        if state.output and not state.settled:
            low, high = self.limits()
            self._command(min(max(state.value, low), high))
            self._set_at = self._clock.now()

    def make_safe(self) -> None:
        """The safe state: the safe value if there is one, then the output off; both are read back.

        Raises:
            NotReady: it is not in its safe state.
        """
        self._scpi.forget_errors()
        self._shut()
        if not self.read().safe:
            raise NotReady(f"{self._where} is not in its safe state: switch it off by hand")

    def _shut(self) -> None:
        """Send the safe value and switch off; a step that fails does not prevent the next. Its state is read later."""
        safe, off = self._options.safe_value, self._options.off
        with contextlib.suppress(DriverError):
            if safe is not None:
                self._command(safe)
        with contextlib.suppress(DriverError):
            if off is not None:
                self._scpi.send(off)

    def close(self) -> None:
        """Release the wire; idempotent."""
        self._scpi.line.close()
