"""Registers of a Watlow controller by their names, and temperatures: their unit on a wire, setting and reading in degC.

A setpoint in the wrong unit is tens of degrees off, and anybody may change the unit at the panel. So the unit is read
at every use, and must agree with all other information.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Literal, TypeVar

from rig.drivers.errors import BadReply, InstrumentError
from rig.drivers.kept import not_kept
from rig.drivers.watlow_map import RegisterMap
from rig.drivers.wires.modbus import ModbusLine, float_in_order, words_of_float

_ILLEGAL_ADDRESS = 2  # Modbus exception: the controller has no such register
_READBACK = 1e-5  # relative; a setpoint is stored in single precision
_MARGIN_K = 20.0  # possible distance of a chamber's temperature from its limits; chosen
_POSSIBLE_DEGC = (-273.15, 2000.0)  # absolute zero, and more than the range of any thermocouple of a chamber

Found = TypeVar("Found")


class MappedTemperatures:
    """A device whose registers are read and written by name, with temperatures in degC or degF.

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
        self._line, self._map, self._loop = line, registers, loop
        self._entries = {**registers.registers, **(registers.cascade if cascade else {})}
        self._low_first = registers.word_order == "low-first"
        self._kept: dict[str, float | str] = {}
        self._names = {of: {code: known for known, code in codes.items()} for of, codes in registers.codes.items()}
        self._limits_degC, self._declared = limits_degC, units
        self._unit_register = f"modbus_units_{'rtu' if line.rtu else 'tcp'}"
        self._found_unit = ""
        self._unit_witnessed = False

    def _address(self, name: str, number: int = 0) -> int:
        """Address of a register; `number` selects the alarm or module, the loop is this driver's own."""
        entry = self._entries[name]
        return entry.address + ((number or self._loop) - 1) * entry.stride

    def _words(self, name: str, number: int = 0) -> list[int]:
        return self._line.read(self._address(name, number), self._entries[name].words)

    def _text(self, name: str) -> str:
        return "".join(chr(word) for word in self._words(name) if word).strip()  # one character in each register

    def _integer(self, name: str) -> int:
        words = self._words(name)
        high, low = words[::-1] if self._low_first else words
        value: int = struct.unpack(">i", struct.pack(">HH", high, low))[0]
        return value

    def _code(self, name: str, number: int = 0) -> str:
        """Name of a code; an unknown code is kept as its number."""
        codes = self._entries[name].codes
        (word,) = self._words(name, number)
        return self._names[codes].get(word, f"code {word}")

    def _set(self, name: str, value: float | str) -> None:
        """Set a number, or a code by its name, and read it back. Raises `BadReply` if it reads back differently."""
        code = isinstance(value, str)
        low_first = self._low_first
        words = [self._code_of(name, value)] if isinstance(value, str) else words_of_float(value, low_first=low_first)
        self._line.write(self._address(name), words)
        found = self._code(name) if code else self._number(name)
        if not _same(found, value):
            plain, there = (one if isinstance(one, str) else f"{one:g}" for one in (value, found))
            raise BadReply(f"{self._line.where}: {name} was set to {plain} and reads back {there}")
        self._kept[name] = value

    def _code_of(self, name: str, value: str) -> int:
        return self._map.codes[self._entries[name].codes][value]

    def _float(self, name: str, number: int = 0) -> float:
        """A number as it stands on the wire, which may be NaN. Raises `BadReply` if its words are swapped."""
        return float_in_order(
            self._words(name, number),
            f"{self._line.where}: {name}",
            "word_order of the register map",
            low_first=self._low_first,
        )

    def _number(self, name: str, number: int = 0) -> float:
        value = self._float(name, number)
        if not math.isfinite(value):
            raise BadReply(f"{self._line.where}: {name} reads {value}; look at the controller's sensor")
        return value

    @staticmethod
    def _if_there(ask: Callable[[], Found], otherwise: Found) -> Found:
        """An answer, or another if the controller has no such register."""
        try:
            return ask()
        except InstrumentError as error:
            if error.code != _ILLEGAL_ADDRESS:
                raise
            return otherwise

    def _shown(self, name: str, value: float | str) -> str:
        """A register's value for a person."""
        fahrenheit = self._found_unit == "F"
        if isinstance(value, str):
            return value
        if name == "setpoint":
            return f"{celsius(value, fahrenheit):.5g} degC"
        return f"{value / (1.8 if fahrenheit else 1):.4g} K" if name == "ramp_rate" else f"{value:.6g}"

    def _not_kept(self) -> list[str]:
        """Settings that are not as this driver set them, as sentences."""

        def ask(name: str) -> float | str:
            return self._code(name) if self._entries[name].codes else self._float(name)

        changed = not_kept(self._kept, ask, _same)
        return [f"{n} reads {self._shown(n, found)}, not {self._shown(n, wanted)}" for n, wanted, found in changed]

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
        if self._unit_register not in self._map.registers:
            return ""
        unit = self._if_there(lambda: self._code(self._unit_register), "")
        if unit not in ("C", "F", ""):  # a setpoint in the wrong unit is tens of degrees off
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
        return self._if_there(lambda: self._float(name), math.nan)

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
        self._set("setpoint", shown(degC, fahrenheit))
        own = self._own_unit()
        if own in ("", "F" if fahrenheit else "C"):
            return
        if math.isfinite(before):
            self._set("setpoint", shown(before, own == "F"))
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


def _same(found: float | str, wanted: float | str) -> bool:
    """Whether a code or a number reads back as it was set."""
    if isinstance(found, str) or isinstance(wanted, str):
        return found == wanted
    return math.isclose(found, wanted, rel_tol=_READBACK, abs_tol=1e-4)
