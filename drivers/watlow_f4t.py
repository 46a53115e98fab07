"""Watlow F4T temperature controller: a chamber's or an enclosure's control loop over Modbus.

The register map of `contracts/` defines the registers and their codes; the controller program passes it as text.
`rig.drivers.watlow_units` handles temperatures and their unit.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Sequence
from typing import ClassVar, Literal

from pydantic import BaseModel, Field, ValidationError, ValidationInfo, field_validator, model_validator

from rig.drivers.clock import Clock
from rig.drivers.driver import ContractFile, Medium
from rig.drivers.errors import BadReply, LimitError, NotReady, WrongInstrument
from rig.drivers.roles import ChamberState, Identity
from rig.drivers.watlow_map import map_of
from rig.drivers.watlow_units import MappedTemperatures, celsius
from rig.drivers.wires import Wires

_NO_ALARM = ("startup", "none", "blocked")  # blocked: not armed until its quantity has been in range once
_PROFILES = ("running", "paused")


def _register(power: str) -> str:
    return power.replace("-", "_")


_NEEDED = (
    *("part_number", "serial_number", "software_release", "software_build"),
    *("process_value", "setpoint", "power", "mode", "active_mode"),
)
"""Registers that are required to identify and control a chamber."""


class WatlowF4T(MappedTemperatures):
    """One control loop of the controller, or one cascade of two; satisfies `rig.drivers.roles.Chamber` and
    `SelfChecking`.

    It has no known sign of a power cut: settings and setpoint survive it.

    Args:
        name: the bench's name for it.
        address: Modbus address.
        options: see `Options`.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the address cannot be opened.
    """

    wire: ClassVar[Medium] = "modbus"
    contracts: ClassVar[tuple[ContractFile, ...]] = (ContractFile("register_map", "rig.contracts", "watlow_f4t.toml"),)

    class Options(BaseModel, extra="forbid"):
        """Options of this instrument in the bench file."""

        loop: int = Field(1, ge=1, le=4, description="control loop, or cascade if it is one")
        cascade: bool = Field(False, description="a cascade: a part's temperature is controlled through the air's")
        low_degC: float = Field(-40.0, description="lowest permitted setpoint")
        high_degC: float = Field(100.0, description="highest permitted setpoint")
        ramp_degC_per_min: float | None = Field(None, gt=0, description="ramp to new setpoints; none if not given")
        safe_degC: float = Field(23.0, description="setpoint of the safe state: about ambient")
        alarms: int = Field(4, ge=0, le=14, description="number of watched alarms of the controller")
        limit_modules: list[int] = Field([], max_length=6, description="slots (1 to 6) of limit controllers to watch")
        units: Literal["modbus", "C", "F"] = Field(
            "modbus",
            description="unit of temperatures on the wire; modbus: the controller's own Modbus setting",
        )
        power: str = Field(
            "none",
            pattern=r"^(none|event-[1-8]|key-[1-4])$",
            description="switch of the chamber's power: event-1 to event-8, key-1 to key-4, or none for the loop alone",
        )
        timeout_s: float = Field(1.0, gt=0, description="maximum wait for a reply")
        register_map: str = Field(description="file with the register map, beside the bench file")

        @field_validator("register_map")
        @classmethod
        def _readable(cls, text: str) -> str:
            try:
                map_of(text)
            except (tomllib.TOMLDecodeError, ValidationError) as error:
                raise ValueError(f"the register map cannot be read: {error}") from error
            except RecursionError:
                raise ValueError("the register map cannot be read: it is nested too deeply") from None
            return text

        @field_validator("units", mode="before")
        @classmethod
        def _not_the_display(cls, units: object, info: ValidationInfo) -> object:
            if units == "display" and (info.context or {}).get("stored"):
                return "modbus"  # meaning in runs of earlier versions, now with the right register
            if units == "display":
                raise ValueError(
                    "the display's unit is not that of Modbus; leave units out, or write C or F as the controller's "
                    "menu Settings, Network, Modbus has it"
                )
            return units

        @model_validator(mode="after")
        def _consistent(self) -> WatlowF4T.Options:
            if not self.low_degC < self.high_degC:
                raise ValueError(f"low_degC {self.low_degC:g} is not below high_degC {self.high_degC:g}")
            if not self.low_degC <= self.safe_degC <= self.high_degC:
                raise ValueError(f"safe_degC {self.safe_degC:g} is outside low_degC to high_degC")
            if not all(1 <= slot <= 6 for slot in self.limit_modules):
                raise ValueError(f"limit_modules {self.limit_modules}: a controller has slots 1 to 6")
            registers = map_of(self.register_map)
            here = {**registers.registers, **(registers.cascade if self.cascade else {})}
            for name in (*_NEEDED, *(["alarm_state"] if self.alarms else [])):
                if name not in here:
                    raise ValueError(f"the register map knows no {name}, which the driver needs")
            if not here["part_number"].type.startswith("text:"):
                raise ValueError("the register map has part_number, which is a text, as a number")
            if self.cascade and not registers.cascade:
                raise ValueError("the register map knows no cascade")
            if self.cascade and self.ramp_degC_per_min is not None and "ramp_rate" not in registers.cascade:
                raise ValueError("the register map knows no ramp of a cascade; leave ramp_degC_per_min out")
            if self.power != "none" and _register(self.power) not in registers.registers:
                raise ValueError(f"the register map knows no {self.power}")
            if self.limit_modules and "limit_state" not in registers.registers:
                raise ValueError("the register map knows no limit_modules")
            return self

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self.name = name
        self._options = options
        line = wires.modbus(address, name, options.timeout_s)
        super().__init__(
            line,
            map_of(options.register_map),
            options.loop,
            cascade=options.cascade,
            limits_degC=(options.low_degC, options.high_degC),
            units=options.units,
        )
        part = self._entries["part_number"]
        self._line.known = (part.address, part.words)
        self._power = "" if options.power == "none" else _register(options.power)

    def identify(self) -> Identity:
        """Ask for the identity. Raises `WrongInstrument` for another model, `NoReply` without an answer."""
        part = self._if_there(lambda: self._text("part_number"), "")
        if not part.startswith(self._map.model):
            raise WrongInstrument(
                f"{self._line.where} should be a {self._map.maker} {self._map.model}; its part number is {part!r}"
            )
        firmware = f"{self._integer('software_release')}.{self._integer('software_build')}"
        return Identity(self._map.maker, part, str(self._integer("serial_number")), firmware)

    def prepare(self) -> None:
        """Set the ramp and check that the controller accepts the bench's range. Setpoint and power do not change.

        Raises:
            LimitError: the controller's own setpoint range is narrower than the bench's.
            NotReady: a cascade's air control is on, or a profile runs.
            BadReply: a setting reads back differently, or the unit of temperature is in doubt.
        """
        for profile in self._profile():
            raise NotReady(f"{self._line.where}: {profile}")
        fahrenheit = self._fahrenheit()
        low, high = self._range(fahrenheit)
        if not self._holds_ours(low, high):
            raise LimitError(
                f"{self._line.where}: the bench allows {self._options.low_degC:g} to {self._options.high_degC:g} degC, "
                f"the controller's own setpoint range is {low:g} to {high:g} degC; narrow one or widen the other"
            )
        found = self._witness("process_value")
        if math.isfinite(found):
            self._check_possible(celsius(found, fahrenheit))
        if self._power:
            self._powered()
        self._require_cascade()
        if self._options.cascade and "ramp_action" not in self._map.cascade:
            return
        ramp = self._options.ramp_degC_per_min
        if ramp is None:
            self._set("ramp_action", "off")
            return
        self._set("ramp_scale", "minutes")
        self._set("ramp_rate", ramp * 1.8 if fahrenheit else ramp)
        self._set("ramp_action", "setpoint")

    def wrong(self) -> Sequence[str]:
        """Settings that are not as declared: the unit of its temperatures, what this driver set, and what else may set
        it.
        """
        unit = self._own_unit()
        if self._found_unit and unit not in ("", self._found_unit):
            return [f"the unit of its Modbus temperatures is {unit}, not {self._found_unit}"]
        air = self._air_control()
        off = [f"{self._options.power} reads off, not on"] if self._kept.get("mode") and not self._powered() else []
        return [*self._not_kept(), *off, *([air] if air else []), *self._profile()]

    def remarks(self) -> Sequence[str]:
        """Settings that are not used, or not as declared: what its connection does."""
        return self._line.remarks()

    def limits(self) -> tuple[float, float]:
        """Lowest and highest accepted setpoint, degrees Celsius."""
        return self._options.low_degC, self._options.high_degC

    def set_temperature(self, degC: float) -> None:
        """Command a setpoint with closed-loop control on. The setpoint is read back before control and power are
        switched on.

        Raises:
            LimitError: outside the bench's range, or not a number.
            NotReady: a cascade's air control is on.
            BadReply: the setpoint, the mode or the power reads back differently, or the unit is in doubt.
        """
        low, high = self.limits()
        if not low <= degC <= high:
            raise LimitError(f"{self._line.where}: {degC:g} degC is outside {low:g} to {high:g} degC")
        fahrenheit = self._fahrenheit()
        self._require_cascade()
        self._set_setpoint(degC, fahrenheit)
        # After the setpoint: a loop that was off must not start towards the setpoint of somebody else.
        if self._code("mode") != "auto":
            self._set("mode", "auto")
        self._kept["mode"] = "auto"
        if self._power and not self._powered():
            self._switch_on()

    def read(self) -> ChamberState:
        """Read its state. The setpoint is the commanded one, also during a ramp to it.

        Raises:
            BadReply: the temperature is impossible, or the unit is in doubt.
        """
        fahrenheit, air = self._fahrenheit(), self._air_control()
        return ChamberState(
            setpoint_degC=self._temperature("setpoint", fahrenheit),
            temperature_degC=self._process_value(fahrenheit),
            power_pct=self._number("power"),
            running=self._code("active_mode") == "auto" and self._powered() and not air,
            alarms=(*([air] if air else []), *self._alarms(fahrenheit), *self._limits_tripped()),
        )

    def stop(self) -> None:
        """Hold the present temperature: it becomes the setpoint. If control is off it stays off; manual power becomes
        control.

        Raises:
            BadReply: the temperature is far outside the bench's range, as with a broken sensor; the setpoint does not
                change.
        """
        low, high = self.limits()
        fahrenheit = self._fahrenheit()
        here = self._process_value(fahrenheit)
        if not self._plausible(here):
            raise BadReply(
                f"{self._line.where}: process_value reads {here:g} degC, far outside {low:g} to {high:g} degC; its "
                f"setpoint stays as it is; look at the chamber and at its sensor"
            )
        self._set_setpoint(min(max(here, low), high), fahrenheit)  # before control: it holds what it finds
        self._end_manual()

    def make_safe(self) -> None:
        """The safe state: to the safe setpoint, under control; outputs that are off stay off.

        A chamber that was switched off by a person or by its protection does not heat, and a fault elsewhere does not
        start it. The unit is the controller's present one, also after a change.
        """
        self._set_setpoint(self._options.safe_degC, self._fahrenheit(may_change=True), or_back=False)
        self._end_manual()

    def close(self) -> None:
        """Release the wire; idempotent."""
        self._line.close()

    def _end_manual(self) -> None:
        """Switch the loop to control: manual power would stay on at any temperature."""
        if self._code("mode") not in ("auto", "off"):
            self._set("mode", "auto")

    def _air_control(self) -> str:
        """Defect of a cascade that controls the air's temperature instead of the part's; "" if none."""
        if not self._options.cascade or "air_control" not in self._map.cascade or self._code("air_control") == "off":
            return ""
        return "its Air Control is on, so it is not a cascade; switch it off there"

    def _profile(self) -> Sequence[str]:
        """Defect of a controller with a profile under way, which sets the setpoint; () if none, or if it has none."""
        if "profile_state" not in self._map.registers:
            return ()
        state = self._if_there(lambda: self._code("profile_state"), "")
        return (f"its profile is {state}, and sets the setpoint; end it at its panel",) if state in _PROFILES else ()

    def _require_cascade(self) -> None:
        if air := self._air_control():
            raise NotReady(f"{self._line.where}: {air}")

    def _alarms(self, fahrenheit: bool) -> tuple[str, ...]:
        states = {n: self._code("alarm_state", n) for n in range(1, self._options.alarms + 1)}
        return tuple(self._alarm(n, state, fahrenheit) for n, state in states.items() if state not in _NO_ALARM)

    def _alarm(self, number: int, state: str, fahrenheit: bool) -> str:
        """An alarm as text, with the exceeded limit if the register map has it."""
        if state == "error":
            return f"alarm {number}: its sensor cannot be read"
        if state.startswith("code "):
            return f"alarm {number}: unknown alarm state {state.removeprefix('code ')}"
        if "alarm_type" not in self._map.registers:
            return f"alarm {number}: {state}"
        kind = self._code("alarm_type", number)
        limit = self._number(f"alarm_{state}", number)
        if fahrenheit:
            limit = (limit - (32.0 if kind == "process" else 0.0)) / 1.8
        of = "" if kind == "process" else " from the setpoint"
        return f"alarm {number}: {'above' if state == 'high' else 'below'} {limit:.4g} degC{of}"

    def _limits_tripped(self) -> Iterator[str]:
        """Limit controllers that have tripped, or that cannot be relied on."""
        for slot in self._options.limit_modules:
            state, status, error = (self._code(f"limit_{what}", slot) for what in ("state", "status", "error"))
            if error != "none":
                yield f"limit controller in slot {slot}: its sensor: {error}"
            elif status == "fail":
                yield f"limit controller in slot {slot}: failed"
            elif state == "error":
                yield f"limit controller in slot {slot}: tripped; reset it at the chamber"

    def _powered(self) -> bool:
        """Whether the switch of the chamber's power is on; anybody may switch it at the panel."""
        if not self._power:
            return True
        found = self._code(self._power)
        if found not in ("on", "off"):
            raise BadReply(f"{self._line.where}: {self._options.power} reads {found}, neither on nor off")
        return found == "on"

    def _switch_on(self) -> None:
        if self._power.startswith("event"):
            self._set(self._power, "on")
            return
        press = self._power.replace("key", "key_press")
        self._line.write(self._address(press), [self._code_of(press, "down")])
        if not self._powered():
            raise BadReply(
                f"{self._line.where}: {self._options.power} was pressed and reads off; a key that does not stay on "
                f"does not show whether the chamber runs: declare the event output that does, or power = none"
            )
