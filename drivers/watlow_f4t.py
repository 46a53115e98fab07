"""Watlow F4T temperature controller: a chamber's or an enclosure's control loop over Modbus.

Which registers there are and what their codes mean is data: the register map of `contracts/`, which the controller
program hands over as text. This module knows only what to do with them.
"""

from __future__ import annotations

import math
import struct
import tomllib
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import ClassVar, Literal

from pydantic import BaseModel, Field, ValidationError, field_validator, model_validator

from drivers.clock import Clock
from drivers.errors import BadReply, InstrumentError, LimitError, WrongInstrument
from drivers.roles import ChamberState, Identity
from drivers.wires import Wires
from drivers.wires.addresses import Wire
from drivers.wires.modbus import float_of_words, words_of_float

_READBACK = 1e-5  # relative; a setpoint passes through single precision
_ILLEGAL_ADDRESS = 2
_ALARMING = ("high", "low", "error")
_WORDS = {"uint16": 1, "int32": 2, "float32": 2}


class RegisterEntry(BaseModel, extra="forbid", frozen=True):
    """One register of the map.

    Attributes:
        address: relative address.
        type: "uint16", "int32", "float32" or "text:N".
        access: "r" or "rw".
        stride: distance to the next loop's, alarm's or module's.
        codes: name of the table of its codes.

    """

    address: int = Field(ge=0, le=65535)
    type: str = Field(pattern=r"^(uint16|int32|float32|text:\d+)$")
    access: Literal["r", "rw"]
    stride: int = 0
    codes: str = ""


class RegisterMap(BaseModel, extra="forbid", frozen=True):
    """A device's registers and codes; those of `cascade` take the place of others where a cascade is controlled."""

    maker: str
    model: str
    word_order: Literal["low-first", "high-first"]
    registers: Mapping[str, RegisterEntry]
    cascade: Mapping[str, RegisterEntry] = Field(default_factory=dict)
    codes: Mapping[str, Mapping[str, int]]


@lru_cache(maxsize=8)
def _map_of(text: str) -> RegisterMap:
    return RegisterMap.model_validate(tomllib.loads(text))


class WatlowF4T:
    """One control loop of the controller, or one cascade of two; satisfies `drivers.roles.Chamber`.

    Nothing it is known to tell shows that its power has been off: settings and setpoint survive that.

    Args:
        name: the bench's name for it.
        address: Modbus address.
        options: see `Options`.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the address cannot be opened.

    """

    wire: ClassVar[Wire] = "modbus"

    class Options(BaseModel, extra="forbid"):
        """What the bench file may say about this instrument."""

        loop: int = Field(1, ge=1, le=4, description="control loop, or cascade if it is one")
        cascade: bool = Field(False, description="a cascade: the temperature is a part's, controlled through the air's")
        low_degC: float = Field(-40.0, description="lowest setpoint that may be commanded")
        high_degC: float = Field(100.0, description="highest setpoint that may be commanded")
        ramp_degC_per_min: float | None = Field(None, gt=0, description="ramp to new setpoints; none if not given")
        safe_degC: float = Field(23.0, description="setpoint of the safe state: about ambient")
        alarms: int = Field(4, ge=0, le=14, description="how many of the controller's alarms are watched")
        limit_modules: list[int] = Field([], max_length=6, description="slots (1 to 6) of limit controllers to watch")
        units: Literal["display", "C", "F"] = Field(
            "display", description="what temperatures on the wire are in; display: whatever its display shows"
        )
        timeout_s: float = Field(1.0, gt=0, description="wait for a reply")
        register_map: str = Field(description="text of the register map; supplied unless the bench has its own")

        @field_validator("register_map")
        @classmethod
        def _readable(cls, text: str) -> str:
            try:
                _map_of(text)
            except (tomllib.TOMLDecodeError, ValidationError) as error:
                raise ValueError(f"the register map cannot be read: {error}") from error
            return text

        @model_validator(mode="after")
        def _consistent(self) -> WatlowF4T.Options:
            if not self.low_degC < self.high_degC:
                raise ValueError(f"low_degC {self.low_degC:g} is not below high_degC {self.high_degC:g}")
            if not self.low_degC <= self.safe_degC <= self.high_degC:
                raise ValueError(f"safe_degC {self.safe_degC:g} is outside low_degC to high_degC")
            if not all(1 <= slot <= 6 for slot in self.limit_modules):
                raise ValueError(f"limit_modules {self.limit_modules}: a controller has slots 1 to 6")
            if self.cascade and self.ramp_degC_per_min is not None:
                raise ValueError("a cascade's ramp cannot be set from here; leave ramp_degC_per_min out")
            registers = _map_of(self.register_map)
            if self.cascade and not registers.cascade:
                raise ValueError("the register map knows no cascade")
            if self.limit_modules and "limit_state" not in registers.registers:
                raise ValueError("the register map knows no limit_modules")
            return self

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self.name = name
        self._options = options
        self._map = _map_of(options.register_map)
        self._low_first = self._map.word_order == "low-first"
        self._names = {of: {code: known for known, code in codes.items()} for of, codes in self._map.codes.items()}
        self._line = wires.modbus(address, name, options.timeout_s)

    def identify(self) -> Identity:
        """See `Instrument.identify`."""
        try:
            part = self._text("part_number")
        except InstrumentError as error:
            if error.code != _ILLEGAL_ADDRESS:
                raise
            part = ""
        if not part.startswith(self._map.model):
            raise WrongInstrument(
                f"{self._line.where} should be a {self._map.maker} {self._map.model}; its part number is {part!r}"
            )
        firmware = f"{self._integer('software_release')}.{self._integer('software_build')}"
        return Identity(self._map.maker, part, str(self._integer("serial_number")), firmware)

    def prepare(self) -> None:
        """Set the ramp and check that the controller accepts the bench's range. The setpoint stays.

        Raises:
            LimitError: the controller's own setpoint range is narrower than the bench's.
            BadReply: a setting reads back as something else.

        """
        fahrenheit = self._fahrenheit()
        low, high = (self._temperature(name, fahrenheit) for name in ("setpoint_minimum", "setpoint_maximum"))
        if self._options.low_degC < low - 1e-3 or self._options.high_degC > high + 1e-3:
            raise LimitError(
                f"{self._line.where}: the bench allows {self._options.low_degC:g} to {self._options.high_degC:g} degC, "
                f"the controller's own setpoint range is {low:g} to {high:g} degC; narrow one or widen the other"
            )
        if self._options.cascade:
            return
        ramp = self._options.ramp_degC_per_min
        if ramp is None:
            self._set_code("ramp_action", "off")
            return
        self._set_code("ramp_scale", "minutes")
        self._set_number("ramp_rate", ramp * 1.8 if fahrenheit else ramp)
        self._set_code("ramp_action", "setpoint")

    def limits(self) -> tuple[float, float]:
        """See `Chamber.limits`."""
        return self._options.low_degC, self._options.high_degC

    def set_temperature(self, degC: float) -> None:
        """See `Chamber.set_temperature`; the setpoint is read back before control is switched on.

        Raises:
            LimitError: outside the bench's range, or no number.
            BadReply: the setpoint reads back as something else.

        """
        low, high = self.limits()
        if not low <= degC <= high:
            raise LimitError(f"{self._line.where}: {degC:g} degC is outside {low:g} to {high:g} degC")
        self._set_setpoint(degC, self._fahrenheit())
        if self._code("mode") != "auto":
            self._set_code("mode", "auto")

    def read(self) -> ChamberState:
        """See `Chamber.read`. The setpoint is the commanded one, also while a ramp is on its way to it."""
        fahrenheit = self._fahrenheit()
        return ChamberState(
            setpoint_degC=self._temperature("setpoint", fahrenheit),
            temperature_degC=self._temperature("process_value", fahrenheit),
            power_pct=self._number("power"),
            running=self._code("active_mode") == "auto",
            alarms=(*self._alarms(fahrenheit), *self._limits_tripped()),
        )

    def stop(self) -> None:
        """See `Chamber.stop`. Where control is off it stays off."""
        low, high = self.limits()
        fahrenheit = self._fahrenheit()
        here = min(max(self._temperature("process_value", fahrenheit), low), high)
        self._set_setpoint(here, fahrenheit)

    def make_safe(self) -> None:
        """See `Instrument.make_safe`: to the safe setpoint, under control."""
        self.set_temperature(self._options.safe_degC)

    def close(self) -> None:
        """See `Instrument.close`."""
        self._line.close()

    def _alarms(self, fahrenheit: bool) -> tuple[str, ...]:
        states = {n: self._code("alarm_state", n) for n in range(1, self._options.alarms + 1)}
        return tuple(self._alarm(n, state, fahrenheit) for n, state in states.items() if state in _ALARMING)

    def _alarm(self, number: int, state: str, fahrenheit: bool) -> str:
        """An alarm in words, with the limit that was passed as far as the register map knows it."""
        if state == "error":
            return f"alarm {number}: its sensor cannot be read"
        if "alarm_type" not in self._map.registers:
            return f"alarm {number}: {state}"
        kind = self._code("alarm_type", number)
        limit = self._number(f"alarm_{state}", number)
        if fahrenheit:
            limit = (limit - (32.0 if kind == "process" else 0.0)) / 1.8
        of = "" if kind == "process" else " from the setpoint"
        return f"alarm {number}: {'above' if state == 'high' else 'below'} {limit:.4g} degC{of}"

    def _limits_tripped(self) -> Iterator[str]:
        """Limit controllers that have switched the chamber off, or cannot be relied on to do so."""
        for slot in self._options.limit_modules:
            state, status, error = (self._code(f"limit_{what}", slot) for what in ("state", "status", "error"))
            if error != "none":
                yield f"limit controller in slot {slot}: its sensor: {error}"
            elif status == "fail":
                yield f"limit controller in slot {slot}: failed"
            elif state == "error":
                yield f"limit controller in slot {slot}: tripped; reset it at the chamber"

    def _entry(self, name: str) -> RegisterEntry:
        if self._options.cascade and name in self._map.cascade:
            return self._map.cascade[name]
        return self._map.registers[name]

    def _address(self, name: str, number: int = 0) -> int:
        """Where a register is; `number` chooses the alarm or module, the loop is this driver's own."""
        entry = self._entry(name)
        return entry.address + ((number or self._options.loop) - 1) * entry.stride

    def _words(self, name: str, number: int = 0) -> list[int]:
        kind = self._entry(name).type
        count = int(kind.partition(":")[2]) if kind.startswith("text:") else _WORDS[kind]
        return self._line.read(self._address(name, number), count)

    def _text(self, name: str) -> str:
        return "".join(chr(word) for word in self._words(name) if word).strip()

    def _integer(self, name: str) -> int:
        words = self._words(name)
        high, low = words[::-1] if self._low_first else words
        value: int = struct.unpack(">i", struct.pack(">HH", high, low))[0]
        return value

    def _code(self, name: str, number: int = 0) -> str:
        """A code's name; a code that the map does not know is kept as its number."""
        codes = self._entry(name).codes
        (word,) = self._words(name, number)
        return self._names[codes].get(word, f"code {word}")

    def _set_code(self, name: str, value: str) -> None:
        code = self._map.codes[self._entry(name).codes][value]
        self._line.write(self._address(name), [code])
        found = self._code(name)
        if found != value:
            raise BadReply(f"{self._line.where}: {name} was set to {value} and reads back {found}")

    def _number(self, name: str, number: int = 0) -> float:
        value = float_of_words(self._words(name, number), low_first=self._low_first)
        if not math.isfinite(value):
            raise BadReply(f"{self._line.where}: {name} reads {value}; look at the controller's sensor")
        return value

    def _set_number(self, name: str, value: float) -> None:
        self._line.write(self._address(name), words_of_float(value, low_first=self._low_first))
        found = self._number(name)
        if not math.isclose(found, value, rel_tol=_READBACK, abs_tol=1e-4):
            raise BadReply(f"{self._line.where}: {name} was set to {value:g} and reads back {found:g}")

    def _fahrenheit(self) -> bool:
        """Whether temperatures on the wire are in degrees Fahrenheit; anybody may change that on the panel."""
        units: str = self._options.units
        if units == "display":
            units = self._code("display_units")
        if units not in ("C", "F"):  # a setpoint in the wrong one is tens of degrees off
            raise BadReply(f"{self._line.where}: its display_units read {units}, neither C nor F")
        return units == "F"

    def _temperature(self, name: str, fahrenheit: bool) -> float:
        value = self._number(name)
        return (value - 32.0) / 1.8 if fahrenheit else value

    def _set_setpoint(self, degC: float, fahrenheit: bool) -> None:
        self._set_number("setpoint", degC * 1.8 + 32.0 if fahrenheit else degC)
