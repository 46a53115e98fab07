"""A source that the bench file describes: sets one quantity of any unit, over any wire for text.

Every setpoint is read back before the output is switched on, and errors are read after every command. A source that has
been off since it was prepared is not switched on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, model_validator

from rig.contracts.declared.exchanges import Ask
from rig.contracts.declared.roles import Source
from rig.drivers.declared.source import DeclaredSource
from rig.drivers.scpi_described import Described, ask, line, tell
from rig.drivers.scpi_options import Command, Question, ScpiOptions, filled


class DescribedSource(DeclaredSource, Described):
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
            None, gt=0.0, description="largest distance of its reading from the setpoint; with settled: then, too"
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
            if self.tolerance is not None and self.read is None:
                raise ValueError("tolerance needs read: it is how its reading tells that it has arrived")
            if any("*RST" in line.upper() for line in self.prepare):
                raise ValueError("prepare must not contain *RST: preparing changes no output; a run may be resumed")
            if self.readback < 0.5 * 10.0**-self.decimals * (1 - 1e-9):
                raise ValueError(
                    f"readback = {self.readback:g} is less than half the last of {self.decimals} decimals: "
                    f"setpoints would be rounded further than it allows"
                )
            return self

    numbers = ("setpoint", "read")
    speaks_unasked = False

    def _roles(self) -> Mapping[str, Any]:
        options = self._options
        asks: dict[str, Any] = {key: ask(text) for key in _ASKS if (text := getattr(options, key)) is not None}
        tells: dict[str, Any] = {key: (tell(text),) for key in ("on", "off") if (text := getattr(options, key))}
        if options.settled is not None:
            asks["settled"] = Ask(ask=line(options.settled), answer=("{value:d}",), bit=options.settled_bit)
        plain: dict[str, Any] = {key: getattr(options, key) for key in _PLAIN}
        to = (tell(options.set, value=f":.{options.decimals}"),)
        return {"source": Source.model_construct(set=to, **asks, **tells, **plain)}


_ASKS = ("setpoint", "read", "output")
_PLAIN = ("unit", "low", "high", "readback", "read_off", "safe_value", "tolerance", "dwell_s")
"""Options that are keys of a source."""
