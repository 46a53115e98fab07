"""Temperatures of a Watlow controller: their unit on a wire, and setting and reading them in degC.

A setpoint in the wrong unit is tens of degrees off, and anybody may change the unit at the panel. So the unit is read
at every use, and must agree with all other information.
"""

from __future__ import annotations

import math
from typing import Literal

from rig.drivers.errors import BadReply, InstrumentError
from rig.drivers.watlow_map import MappedDevice, RegisterMap
from rig.drivers.wires.modbus import ModbusLine

ILLEGAL_ADDRESS = 2
"""Modbus exception: the controller has no such register."""

_MARGIN_K = 20.0  # possible distance of a chamber's temperature from its limits; chosen
_POSSIBLE_DEGC = (-273.15, 2000.0)  # absolute zero, and more than the range of any thermocouple of a chamber


class MappedTemperatures(MappedDevice):
    """A device with a register map and temperatures in degC or degF.

    Args:
        line: the device.
        registers: its map.
        loop: number of its loop.
        cascade: whether that loop is a cascade.
        limits_degC: lowest and highest permitted setpoint.
        units: unit in the bench file: "C", "F", or "modbus" if the controller reports it.
    """

    def __init__(
        self,
        line: ModbusLine,
        registers: RegisterMap,
        loop: int,
        *,
        cascade: bool,
        limits_degC: tuple[float, float],
        units: Literal["modbus", "C", "F"],
    ) -> None:
        super().__init__(line, registers, loop, cascade=cascade)
        self._limits_degC, self._declared = limits_degC, units
        self._unit_register = f"modbus_units_{'rtu' if line.rtu else 'tcp'}"
        self._tells_unit = self._unit_register in registers.registers
        self._found_unit = ""
        self._unit_witnessed = False

    def _fahrenheit(self, *, may_change: bool = False) -> bool:
        """Whether temperatures on this wire are in degrees Fahrenheit; anybody may change that at the panel.

        The panel's own unit is a different setting. The relevant one is the Modbus setting of the port of this wire, or
        the bench file for a controller without it. It must agree with all other information.
        """
        own, declared = self._own_unit(), self._declared
        if not own and declared == "modbus":
            raise BadReply(
                f"{self._line.where}: it does not report the unit of its Modbus temperatures (no register "
                f"{self._unit_register}); write units = C or F in the bench file, as its menu Settings, Network, "
                f"Modbus has it: what its display shows is another setting"
            )
        if own and declared not in ("modbus", own):
            raise BadReply(
                f"{self._line.where}: the bench file says units = {declared}, the controller's own Modbus setting "
                f"({self._unit_register}) is {own}; correct one of them"
            )
        unit = own or declared
        changed = self._found_unit not in ("", unit)
        if changed and not may_change:
            raise BadReply(
                f"{self._line.where}: the unit of its Modbus temperatures was {self._found_unit} and is {unit} now; "
                f"set it back, or resume the run: programs that have not noticed set wrong temperatures"
            )
        if changed or not self._unit_witnessed:
            self._check_witnesses(unit == "F")
        self._found_unit = unit
        return unit == "F"

    def _own_unit(self) -> str:
        """C or F by the controller's setting for this wire, "" if it has none."""
        if not self._tells_unit:
            return ""
        try:
            unit = self._code(self._unit_register)
        except InstrumentError as error:
            if error.code != ILLEGAL_ADDRESS:
                raise
            return ""
        if unit not in ("C", "F"):  # a setpoint in the wrong unit is tens of degrees off
            raise BadReply(f"{self._line.where}: its {self._unit_register} read {unit}, neither C nor F")
        return unit

    def _check_witnesses(self, fahrenheit: bool) -> None:
        """Refuse a unit that makes the chamber's range or temperature impossible if the other unit makes it
        possible.
        """
        this, other = ("F", "C") if fahrenheit else ("C", "F")
        low, high = self._witness("setpoint_minimum"), self._witness("setpoint_maximum")
        ours, theirs = ((celsius(low, f), celsius(high, f)) for f in (fahrenheit, not fahrenheit))
        if not self._holds_ours(*ours) and self._holds_ours(*theirs):
            raise self._doubtful(
                f"its setpoint range is {ours[0]:.4g} to {ours[1]:.4g} degC if its unit is {this}, which does not "
                f"hold the bench's range, and {theirs[0]:.4g} to {theirs[1]:.4g} degC if it is {other}"
            )
        value = self._witness("process_value")
        here, there = celsius(value, fahrenheit), celsius(value, not fahrenheit)
        if not self._plausible(here) and self._plausible(there):
            raise self._doubtful(
                f"it reads {value:.4g}, which is {here:.4g} degC if its unit is {this}, no temperature of this "
                f"chamber, and {there:.4g} degC if it is {other}"
            )
        self._unit_witnessed = self._plausible(here)

    def _witness(self, name: str) -> float:
        """A number on the wire; NaN if the controller has none, or its sensor is broken."""
        try:
            return self._float(name)
        except InstrumentError as error:
            if error.code != ILLEGAL_ADDRESS:
                raise
            return math.nan

    def _doubtful(self, what: str) -> BadReply:
        return BadReply(
            f"{self._line.where}: {what}; compare with its display, then correct its Modbus unit (menu Settings, "
            f"Network, Modbus) or the bench file's units or limits; nothing was set"
        )

    def _plausible(self, degC: float) -> bool:
        """Whether a chamber may have this temperature: near its range, or near ambient."""
        low, high = self._limits_degC
        return low - _MARGIN_K <= degC <= high + _MARGIN_K

    def _range(self, fahrenheit: bool) -> tuple[float, float]:
        low, high = (self._temperature(name, fahrenheit) for name in ("setpoint_minimum", "setpoint_maximum"))
        return low, high

    def _holds_ours(self, low: float, high: float) -> bool:
        least, most = self._limits_degC
        return low - 1e-3 <= least and most <= high + 1e-3

    def _shown(self, name: str, value: float | str) -> str:
        fahrenheit = self._found_unit == "F"
        if isinstance(value, str) or name not in ("setpoint", "ramp_rate"):
            return super()._shown(name, value)
        return (
            f"{celsius(value, fahrenheit):.5g} degC"
            if name == "setpoint"
            else f"{value / (1.8 if fahrenheit else 1):.4g} K"
        )

    def _temperature(self, name: str, fahrenheit: bool) -> float:
        return celsius(self._number(name), fahrenheit)

    def _process_value(self, fahrenheit: bool) -> float:
        degC = self._temperature("process_value", fahrenheit)
        self._check_possible(degC)
        return degC

    def _check_possible(self, degC: float) -> None:
        low, high = _POSSIBLE_DEGC
        if not low <= degC <= high:
            raise BadReply(
                f"{self._line.where}: process_value reads {degC:g} degC, which no chamber can be at; its setpoint "
                f"stays as it is; look at the controller's sensor"
            )

    def _set_setpoint(self, degC: float, fahrenheit: bool, *, or_back: bool = True) -> None:
        """Set a setpoint and read it back. The unit is read again, since anybody may have changed it meanwhile.

        Args:
            degC: the setpoint.
            fahrenheit: the unit as read before.
            or_back: if the unit has changed, restore the earlier setpoint and raise `BadReply`; otherwise set this one
                in the present unit.
        """
        before = celsius(self._witness("setpoint"), fahrenheit) if or_back else degC
        self._set_number("setpoint", shown(degC, fahrenheit))
        own = self._own_unit()
        if own in ("", "F" if fahrenheit else "C"):
            return
        if math.isfinite(before):
            self._set_number("setpoint", shown(before, own == "F"))
        self._found_unit = self._found_unit if or_back else own
        if or_back:
            raise BadReply(
                f"{self._line.where}: the unit of its Modbus temperatures became {own} while the setpoint was set; "
                f"the earlier setpoint, {before:.4g} degC, is back; set the unit back, or resume the run"
            )


def celsius(value: float, fahrenheit: bool) -> float:
    """A temperature on the wire in degC."""
    return (value - 32.0) / 1.8 if fahrenheit else value


def shown(degC: float, fahrenheit: bool) -> float:
    """A temperature in degC as it is sent on the wire."""
    return degC * 1.8 + 32.0 if fahrenheit else degC
