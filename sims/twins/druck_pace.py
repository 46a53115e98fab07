"""Simulated Druck PACE5000 or PACE6000 pressure controller, on serial or TCP.

Commands, defaults and the status system are from the SCPI manual K0472 (issue 1 and revision A). Every answer repeats
its header. The plant simulates the gas; this module simulates units, settings, in-limits timer, vent and errors.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from math import inf
from typing import ClassVar, Protocol

from rig.sims.faults import Kind
from rig.sims.faults.instrument_faults import SUPPLY
from rig.sims.faults.reading_faults import FROZEN, SPIKE
from rig.sims.inputs import Inputs
from rig.sims.physics.pressure_line import PressureLine
from rig.sims.twin import Role
from rig.sims.twins.druck_commands import COMMANDS, echo
from rig.sims.twins.druck_status import PaceStatus
from rig.sims.twins.scpi import ScpiTwin
from rig.sims.twins.scpi_syntax import Command, ScpiError, boolean, number, switch
from rig.sims.world import World

PASCALS = {
    "PSI": 6894.757293168,
    "BAR": 1e5,
    "MBAR": 100.0,
    "HPA": 100.0,
    "KPA": 1e3,
    "MPA": 1e6,
    "PA": 1.0,
    "TORR": 101325.0 / 760.0,
    "MMHG": 133.322387415,
    "INHG": 3386.388640341,
    "ATM": 101325.0,
}
"""Known units, in pascals."""

FULL_SCALE_PSI = 15.0
"""Full scale of its control module, psi."""

_FASTEST_PSI_PER_S = 5.0
_LINE_ENDS = {"lf": (b"\n", b"\r\n"), "cr": (b"\r", b"\r"), "crlf": (b"\r\n", b"\r\n")}
"""End of commands and answers; with LF it is assumed to answer with CR LF [?]."""

_MODULE = re.compile(r"(SOURCE|SOUR|SENSE|SENS|OUTPUT|OUTP|UNIT)(\d)(?=:|$)")
_VENT_COMPLETE, _IN_LIMITS = 1, 4


@lru_cache(maxsize=1024)
def _module_in(name: str) -> tuple[int | None, str]:
    """The module that a header names, 1 if it could name one and does not, None if it cannot; the header without it."""
    match = _MODULE.match(name)
    if match is not None:
        return int(match[2]), match[1] + name[match.end() :]
    return None if _MODULE.match(f"{name.partition(':')[0]}1") is None else 1, name


class Plant(Protocol):
    """Parts of the plant that this twin uses."""

    def pressure_line(self, instrument: str) -> PressureLine:
        """The gas line of an instrument."""
        ...


class DruckPACETwin(PaceStatus):
    """The controller.

    Args:
        name: the bench's name for it.
        options: its options in the bench file; `module` (2 makes it a PACE6000), `reference`, `baud`, `frame` and
            `line_end` are used, and `barometer`, false if that option is not fitted.
        world: virtual time.
        plant: has `pressure_line`.
        serial: its serial number.

    Attributes:
        inputs: path of its readings to its answers.
    """

    commands: ClassVar[Mapping[str, Command]] = COMMANDS
    roles: ClassVar[frozenset[Role]] = frozenset({"pressure-controller"})
    faults: ClassVar[tuple[Kind, ...]] = (FROZEN, SPIKE, SUPPLY, *ScpiTwin.faults)
    errors: ClassVar[Mapping[int, str]] = {
        **ScpiTwin.errors,
        -102: "Syntax error",
        -114: "Header suffix out of range",
        201: "Query only",
        202: "No query allowed",
    }
    queued_errors = 5
    overflow = "Queue overflow"
    integers = "d"

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Plant, serial: str) -> None:
        self.line = plant.pressure_line(name)
        self.inputs = Inputs()
        self.module = int(str(options.get("module", 1)))
        self._serial = serial
        self._gauge = options.get("reference") == "gauge"
        self._barometer = bool(options.get("barometer", True))
        self.line_end, self.reply_end = _LINE_ENDS[str(options.get("line_end", "lf"))]
        super().__init__(name, world, int(str(options.get("baud", 9600))), str(options.get("frame", "8N1")))

    def switch_on(self) -> None:
        """Measuring, default settings, and no power-on bit: in K0472 it is reserved."""
        super().switch_on()
        self.remote = True

    def clear_status(self) -> None:
        """*CLS: pressure events, too."""
        super().clear_status()
        self._events_read = self.world.now()

    def power_cycle(self) -> None:
        """Without power all valves close."""
        self.line.control_off(self.world.now())
        super().power_cycle()

    def reset(self) -> None:
        """Settings at power-on."""
        self._units = dict.fromkeys(range(1, self.module + 1), "BAR")  # every module has its own
        self._module_asked = self.module
        self._isolation, self._mode = False, "ACT"
        self.output = False
        self.slew_psi_per_s = _FASTEST_PSI_PER_S
        self.linear = False
        self.overshoot = True
        self.setpoint_psi = 0.0
        self.band_pct = 0.01
        self.band_s = 2
        self._vent_latched = False
        self._events_read = self.world.now()

    # Syntax

    def addressed(self, name: str) -> str:
        """Remove the module number; 1 or none is the first module."""
        number, rest = _module_in(name)
        if number is None:
            return name
        of_units = name.startswith("UNIT")
        if number not in self._units or (number != self.module and not of_units):
            raise ScpiError(-114)
        self._module_asked = number
        return rest

    def reply(self, row: Command, answer: str) -> str:
        """The header in short form with every optional node spelt out, and the value."""
        return f"{echo(row.header)} {answer}"

    # Units

    def _pressure(self, psia: float) -> str:
        gauge = self.line.ambient_psia(self.world.now()) if self._gauge else 0.0
        return self._difference(psia - gauge)

    def _difference(self, psi: float) -> str:
        return f"{psi * PASCALS['PSI'] / PASCALS[self.unit]:.7f}"

    def _psi(self, text: str) -> float:
        return number(text) * PASCALS[self.unit] / PASCALS["PSI"]

    @property
    def unit(self) -> str:
        """Unit of the addressed module."""
        return self._units[self.module]

    def set_unit(self, name: str) -> None:
        """:UNIT:PRES, of the addressed module."""
        if name.upper() not in PASCALS:
            raise ScpiError(-224)
        self._units[self._module_asked] = name.upper()

    def ask_unit(self) -> str:
        """:UNIT:PRES?, of the addressed module."""
        return self._units[self._module_asked]

    # Identity and readings

    def ask_identity(self) -> str:
        """*IDN?, as printed in the manual."""
        return f"GE Druck,Pace{6 if self.module == 2 else 5}000 User Interface,{self._serial},01.05.04"

    def ask_serial(self) -> str:
        """:INST:SN?."""
        return self._serial

    def ask_pressure(self) -> str:
        """:SENS:PRES?."""
        now = self.world.now()
        return self._pressure(self.inputs.given("pressure", "psi", now, now, self.line.reading_psia(now)))

    def ask_in_limits(self) -> str:
        """:SENS:PRES:INL?: pressure, and whether it has been in limits for the time set."""
        return f"{self.ask_pressure()}, {int(self.in_limits)}"

    def ask_barometer(self) -> str:
        """:SENS:PRES:BAR?: zero if none is fitted."""
        return self._difference(self.line.ambient_psia(self.world.now()) if self._barometer else 0.0)

    def ask_supply(self) -> str:
        """:SOUR:PRES:COMP1?."""
        return self._pressure(self.line.supply_psia(self.world.now()))

    def ask_vacuum(self) -> str:
        """:SOUR:PRES:COMP2?."""
        return self._pressure(self.line.vacuum_psia(self.world.now()))

    def ask_effort(self) -> str:
        """:SOUR:PRES:EFF?."""
        return f"{self.line.effort_pct(self.world.now()):.7f}"

    def ask_measured_slew(self) -> str:
        """:SENS:PRES:SLEW?: rate of change of the pressure, units per second."""
        now = self.world.now()
        return self._difference((self.line.pressure_psia(now) - self.line.pressure_psia(now - 0.1)) / 0.1)

    # Control

    set_isolation, ask_isolation = switch("_isolation")
    """:OUTP:ISOL:STAT: stored and reported; the simulated line has no such valve."""

    def set_mode(self, mode: str) -> None:
        """:OUTP:MODE: active, passive or gauge; only active is simulated."""
        if mode.upper() not in ("ACT", "ACTIVE"):
            raise ScpiError(-224)
        self._mode = "ACT"

    def ask_mode(self) -> str:
        """:OUTP:MODE?."""
        return self._mode

    def _control(self, *, changed: bool = True) -> None:
        """Set the valves as commanded."""
        if self.output and changed:
            now = self.world.now()
            gauge = self.line.ambient_psia(now) if self._gauge else 0.0
            slew = self.slew_psi_per_s if self.linear else inf
            self.line.command(now, self.setpoint_psi + gauge, slew, overshoot=self.overshoot)

    def set_setpoint(self, value: str) -> None:
        """:SOUR:PRES."""
        psi = self._psi(value)
        low = -self.line.ambient_psia(self.world.now()) if self._gauge else 0.0
        if not low - 1e-9 <= psi <= FULL_SCALE_PSI * (1.0 + 1e-9):
            raise ScpiError(-222)
        self.setpoint_psi = psi
        self._control()

    def ask_setpoint(self) -> str:
        """:SOUR:PRES?."""
        return self._difference(self.setpoint_psi)

    def set_output(self, state: str) -> None:
        """:OUTP:STAT."""
        on = boolean(state)
        if on and not self.output:
            self.output, self._vent_latched = True, False
            self._control()
        elif self.output and not on:
            self.output = False
            self.line.control_off(self.world.now())

    def ask_output(self) -> str:
        """:OUTP:STAT?."""
        return str(int(self.output))

    def set_slew(self, value: str) -> None:
        """:SOUR:PRES:SLEW, units per second."""
        psi = _FASTEST_PSI_PER_S if value.upper() == "MAX" else self._psi(value)
        if not 0.0 < psi <= 100.0 * FULL_SCALE_PSI:
            raise ScpiError(-222)
        before, self.slew_psi_per_s = self.slew_psi_per_s, psi
        self._control(changed=self.linear and psi != before)

    def ask_slew(self) -> str:
        """:SOUR:PRES:SLEW?."""
        return self._difference(self.slew_psi_per_s)

    def set_slew_mode(self, mode: str) -> None:
        """:SOUR:PRES:SLEW:MODE."""
        if mode.upper() not in ("LIN", "LINEAR", "MAX", "MAXIMUM"):
            raise ScpiError(-224)
        before, self.linear = self.linear, mode.upper().startswith("LIN")
        self._control(changed=self.linear != before)

    def ask_slew_mode(self) -> str:
        """:SOUR:PRES:SLEW:MODE?."""
        return "LIN" if self.linear else "MAX"

    def set_overshoot(self, state: str) -> None:
        """:SOUR:PRES:SLEW:OVER."""
        before, self.overshoot = self.overshoot, boolean(state)
        self._control(changed=self.overshoot != before)

    def ask_overshoot(self) -> str:
        """:SOUR:PRES:SLEW:OVER?."""
        return str(int(self.overshoot))

    def set_range(self, name: str) -> None:
        """:SOUR:PRES:RANG: there is one range."""
        if name != self.ask_range():
            raise ScpiError(-224)

    def ask_range(self) -> str:
        """:SOUR:PRES:RANG?: its name, which ends in the reference of pressures."""
        return f'"{FULL_SCALE_PSI:.2f}psi{"g" if self._gauge else "a"}"'

    # In limits

    @property
    def in_limits(self) -> bool:
        """Whether the pressure has been in limits for long enough."""
        now = self.world.now()
        begin = now - self.band_s
        since = self.line.settled_since(now, self._band_psi, begin)
        if since is None or since > begin:
            return False
        return abs(self.line.reading_psia(now) - self.line.setpoint_psia) <= self._band_psi

    @property
    def _band_psi(self) -> float:
        return self.band_pct / 100.0 * FULL_SCALE_PSI

    def _in_limits_from(self) -> float | None:
        since = self.line.settled_since(self.world.now(), self._band_psi)
        return None if since is None else since + self.band_s

    def set_band(self, value: str) -> None:
        """:SOUR:PRES:INL, percent of full scale."""
        pct = number(value)
        if not 0.0 <= pct <= 100.0:
            raise ScpiError(-222)
        self.band_pct = pct

    def ask_band(self) -> str:
        """:SOUR:PRES:INL?."""
        return f"{self.band_pct:.7f}"

    def set_band_time(self, value: str) -> None:
        """:SOUR:PRES:INL:TIME."""
        seconds = round(number(value))
        if not 2 <= seconds <= 999:
            raise ScpiError(-222)
        self.band_s = seconds

    def ask_band_time(self) -> str:
        """:SOUR:PRES:INL:TIME?."""
        return str(self.band_s)

    def ask_pressure_condition(self) -> str:
        """:STAT:OPER:PRES:COND?: present state."""
        vented = self._vent_latched and self.line.vented(self.world.now())
        return str(_VENT_COMPLETE * vented + _IN_LIMITS * self.in_limits)

    def ask_pressure_events(self) -> str:
        """:STAT:OPER:PRES?: events since the last query."""
        events = self.pressure_events()
        self._events_read = self.world.now()
        return str(events)

    def pressure_events(self) -> int:
        """The pressure event register: events since the last reading."""
        reached = self._in_limits_from()
        condition = int(self.ask_pressure_condition())
        if reached is None or reached <= self._events_read:
            condition &= ~_IN_LIMITS
        return condition

    # Vent

    def set_vent(self, value: str) -> None:
        """:SOUR:PRES:LEV:IMM:AMPL:VENT: 1 starts, at full speed; 0 aborts. Control is off afterwards."""
        start = round(number(value))
        if start not in (0, 1):
            raise ScpiError(-222)
        now = self.world.now()
        if start:
            self.output, self._vent_latched = False, True
            self.line.vent(now, inf)
        elif self._vent_latched:
            self._vent_latched = False
            self.line.control_off(now)

    def ask_vent(self) -> str:
        """:SOUR:PRES:LEV:IMM:AMPL:VENT?: 0 idle, 1 in progress, 2 completed."""
        if not self._vent_latched:
            return "0"
        return "1" if self.line.venting(self.world.now()) else "2"
