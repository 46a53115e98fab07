"""Simulated Watlow F4T temperature controller: one control loop or cascade on one of the plant's chambers.

The registers are those of the register map in the options; their effects are here. The panel and the two Modbus ports
(network, serial) have separate units of temperature, all degrees Fahrenheit by default. So the meaning of a number on
the wire depends on the port. Settings are non-volatile, as in the real controller.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from math import inf, nan
from typing import Any, ClassVar, Literal

from rig.sims.faults import Kind
from rig.sims.faults.instrument_faults import ALARM, DOOR, OWN_SENSOR
from rig.sims.faults.reading_faults import FROZEN, SPIKE
from rig.sims.inputs import Inputs
from rig.sims.noise import event_at, normal
from rig.sims.physics import Plant, WorldError
from rig.sims.twin import Medium, Role
from rig.sims.wires.modbus_line import ModbusEndpoint
from rig.sims.wires.modbus_slave import ILLEGAL_VALUE, Refused
from rig.sims.wires.register_bank import Access, Bank, Register, Value
from rig.sims.world import World

_PV_NOISE_DEGC = 0.003
_PART_NUMBER = "F4T1A2CAA1A1AAA"
_ALARMS, _MODULES, _EVENTS, _KEYS = 14, 6, 8, 4

Port = Literal["tcp", "rtu"]
_PORTS: tuple[Port, ...] = ("tcp", "rtu")


class _Described(dict[str, Any]):
    """A table of the register map; missing keys are errors."""

    where = ""

    @classmethod
    def of(cls, table: Mapping[str, Any], where: str) -> _Described:
        found = cls({k: cls.of(v, f"{where}: {k}") if isinstance(v, dict) else v for k, v in table.items()})
        found.where = where
        return found

    def __missing__(self, key: str) -> Any:
        raise WorldError(f"{self.where} has no {key}, without which the controller cannot be simulated")


@dataclass(frozen=True)
class Scale:
    """Temperatures in the unit of one of the controller's ports.

    Attributes:
        fahrenheit: whether that port is now set to degrees Fahrenheit.
    """

    fahrenheit: Callable[[], bool]

    def per_kelvin(self) -> float:
        """Degrees of this port per kelvin."""
        return 1.8 if self.fahrenheit() else 1.0

    def shown(self, degC: float) -> float:
        """A temperature as a number on the wire."""
        return degC * 1.8 + 32.0 if self.fahrenheit() else degC

    def celsius(self, shown: float) -> float:
        """A temperature from a number on the wire."""
        return (shown - 32.0) / 1.8 if self.fahrenheit() else shown


@dataclass
class _Alarm:
    """One of the controller's alarms; default limits; for a deviation alarm they are differences."""

    state: int
    kind: int
    high_degC: float = 148.9
    low_degC: float = 0.0


class WatlowF4TTwin:
    """The controller.

    Args:
        name: the bench's name for it.
        options: its options in the bench file; `register_map` (text), `loop`, `cascade` and `power` are used, and the
            range of setpoints: the wiring and settings by the chamber's maker.
        world: virtual time.
        plant: its `chamber(name)` is what the loop controls.
        serial: serial number; the controller reports its digits.

    Attributes:
        ports: registers on the wire, for any framing, by port ("tcp", "rtu").
        registers: those of the network port.
        sensor_broken: whether the process value is NaN [?].
        inputs: path of its readings to its answers.
    """

    wire: ClassVar[Medium] = "modbus"
    roles: ClassVar[frozenset[Role]] = frozenset({"chamber"})
    faults: ClassVar[tuple[Kind, ...]] = (FROZEN, SPIKE, OWN_SENSOR, ALARM, DOOR)

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Plant, serial: str) -> None:
        self.name = name
        self._world = world
        self._enclosure = plant.chamber(name)
        self._seed = plant.truth.seed
        contract = _Described.of(tomllib.loads(str(options["register_map"])), f"{name}: its register map")
        self._codes: Mapping[str, Mapping[str, int]] = contract["codes"]
        fahrenheit, off = self._codes["units"]["F"], self._codes["ramp_action"]["off"]
        self._settings: dict[str, Value] = {
            **dict.fromkeys(("display_units", "modbus_units_tcp", "modbus_units_rtu"), fahrenheit),
            **dict.fromkeys(("ramp_action", "cascade ramp_action"), off),
            **dict.fromkeys(("ramp_scale", "cascade ramp_scale"), self._codes["ramp_scale"]["minutes"]),
            "cascade air_control": off,
            "profile_state": 251,  # not started: there is none
        }
        self._minimum = min(-40.0, float(str(options.get("low_degC", -40.0))))
        self._maximum = max(150.0, float(str(options.get("high_degC", 150.0))))
        self._ramp_per_scale = {"": 1.0, "cascade ": 1.0}
        self._open_loop_pct = 0.0
        none, no_alarm = self._codes["alarm"]["none"], self._codes["alarm_type"]["off"]
        self._alarms = [_Alarm(none, no_alarm) for _ in range(_ALARMS)]
        self._limits = [self._limit() for _ in range(_MODULES)]
        self.sensor_broken = False
        self.inputs = Inputs()
        number = int("".join(c for c in serial if c.isdigit()) or 0) % 2**31
        self._fixed: Mapping[str, Value] = {
            "software_release": 5,
            "software_build": 3,
            "serial_number": number,
            "part_number": _PART_NUMBER,
        }
        self._in_charge = "cascade " if options.get("cascade") else ""
        power = str(options.get("power", "none"))
        self._powered_by = "" if power == "none" else power.replace("-", "_")
        switches = [f"event_{n + 1}" for n in range(_EVENTS)] + [f"key_{n + 1}" for n in range(_KEYS)]
        self._on = {name: name == self._powered_by and self._enclosure.controlled for name in switches}
        self._mode_name = "auto" if self._enclosure.controlled else "off"
        self._low_first = contract["word_order"] == "low-first"
        self.ports: dict[Port, Bank] = {port: self._bank(port, contract, options) for port in _PORTS}
        self.registers = self.ports["tcp"]
        self._endpoint = ModbusEndpoint(world, {1: self.registers})

    def on_rx(self, data: bytes, tx: Callable[[bytes], None]) -> None:
        """Modbus TCP requests to unit 1."""
        self._endpoint.on_rx(data, tx)

    def power_cycle(self) -> None:
        """Power off and on; setpoint, mode, events and settings are non-volatile."""

    def set_units(self, *, display: str = "", tcp: str = "", rtu: str = "") -> None:
        """Set the unit of the panel, or of a Modbus port, as at the panel: "C" or "F"; "" does not change it."""
        for name, unit in {"display_units": display, "modbus_units_tcp": tcp, "modbus_units_rtu": rtu}.items():
            if unit:
                self._settings[name] = self._codes["units"][unit]

    def set_at_panel(self, name: str, value: str | float) -> None:
        """Change a register as at the panel: a code by its name, a setpoint (degC) or a ramp (K per its scale)."""
        if name == "setpoint":
            self._set_setpoint(float(value))
        elif name == "mode":
            self._set_mode(self._codes["mode"][str(value)])
        elif name == "ramp_rate":
            self._set_ramp_rate(self._in_charge, float(value))
        elif name == "profile_state":
            self._settings[name] = self._codes["profile"][str(value)]
        else:
            table = "switch" if name == "air_control" else name
            self._settings[self._in_charge + name] = self._codes[table][str(value)]

    def set_alarm(self, number: int, state: str, kind: str = "process", limit_degC: float | None = None) -> None:
        """Put alarm 1, 2, ... into a state and give it a type, both named as in the register map."""
        alarm = self._alarms[number - 1]
        alarm.state, alarm.kind = self._codes["alarm"][state], self._codes["alarm_type"][kind]
        if limit_degC is not None:
            alarm.high_degC = alarm.low_degC = limit_degC

    def set_limit(self, slot: int, *, state: str = "none", status: str = "ok", error: str = "none") -> None:
        """Make the limit controller in slot 1 to 6 trip, fail, or lose its sensor; without words it is good."""
        self._limits[slot - 1] = self._limit(state, status, error)

    def switch(self, name: str, *, on: bool) -> None:
        """Switch an event output ("event_1" ...) or a key ("key_1" ...) on or off, as at the panel."""
        mode = self._mode()
        self._on[name] = on
        if name == self._powered_by:
            self._set_mode(mode)

    def _limit(self, state: str = "none", status: str = "ok", error: str = "none") -> dict[str, int]:
        codes = self._codes
        return {
            "limit_state": codes["limit_state"][state],
            "limit_status": codes["limit_status"][status],
            "limit_error": codes["input_error"][error],
        }

    def _bank(self, port: Port, contract: Mapping[str, Any], options: Mapping[str, object]) -> Bank:
        """All registers, with temperatures in the unit of one port."""
        fahrenheit = self._codes["units"]["F"]
        scale = Scale(lambda: self._settings[f"modbus_units_{port}"] == fahrenheit)
        # public clients read across the second address of a parameter of 16 bits [?]
        bank = Bank(f"Watlow {_PART_NUMBER}".encode(), padded=True)
        loop = int(str(options.get("loop", 1)))
        of_loop = self._loop(scale) | self._clock() | self._switches()
        self._fill(bank, contract["registers"], loop, of_loop, scale, "")
        if options.get("cascade"):
            of_cascade = self._loop(scale, "cascade ") | self._cascade(scale)
            self._fill(bank, contract["cascade"], loop, of_cascade, scale, "cascade ")
        return bank

    def _loop(self, scale: Scale, whose: str = "") -> dict[str, Access]:
        """Reading and writing of the control loop's registers, by name."""
        chamber, now, shown = self._enclosure, self._world.now, scale.shown
        return {
            "mode": (self._mode, self._set_mode),
            "active_mode": (self._mode, None),
            "setpoint": (lambda: shown(chamber.setpoint_degC), lambda v: self._set_setpoint(scale.celsius(v))),
            "active_setpoint": (lambda: shown(chamber.active_setpoint_degC(now())), None),
            "process_value": (lambda: shown(self._air()), None),
            "power": (self._power_pct, None),
            "open_loop_power": (lambda: self._open_loop_pct, self._set_open_loop),
            "setpoint_minimum": (
                lambda: shown(self._minimum),
                lambda v: setattr(self, "_minimum", scale.celsius(v)),
            ),
            "setpoint_maximum": (
                lambda: shown(self._maximum),
                lambda v: setattr(self, "_maximum", scale.celsius(v)),
            ),
            "ramp_rate": (
                lambda: self._ramp_per_scale[whose] * scale.per_kelvin(),
                lambda v: self._set_ramp_rate(whose, v / scale.per_kelvin()),
            ),
        }

    def _cascade(self, scale: Scale) -> dict[str, Access]:
        """Differences of a cascade: the part follows the air, which is controlled to the part's setpoint."""
        chamber, now = self._enclosure, self._world.now
        return {
            "process_value": (lambda: scale.shown(self._part()), None),
            "air_value": (lambda: scale.shown(self._air()), None),
            "air_setpoint": (lambda: scale.shown(chamber.active_setpoint_degC(now())), None),
        }

    def _clock(self) -> dict[str, Access]:
        units = ("hour", "minute", "second", "month", "day", "year")
        return {f"clock_{unit}": (partial(self._time, unit), None) for unit in units}

    def _time(self, unit: str) -> int:
        value: int = getattr(datetime.fromtimestamp(self._world.utc(), UTC), unit)
        return value

    def _switches(self) -> dict[str, Access]:
        """Event outputs are read and written; a key's state is read, and another register presses it."""
        codes, access = self._codes, dict[str, Access]()
        for n in range(1, _EVENTS + 1):
            access[f"event_{n}"] = (partial(self._switch_code, f"event_{n}"), partial(self._set_event, f"event_{n}"))
        for n in range(1, _KEYS + 1):
            access[f"key_{n}"] = (partial(self._switch_code, f"key_{n}"), None)
            access[f"key_press_{n}"] = (lambda: codes["press"]["up"], partial(self._press, f"key_{n}"))
        return access

    def _switch_code(self, name: str) -> int:
        return self._codes["switch"]["on" if self._on[name] else "off"]

    def _set_event(self, name: str, code: int) -> None:
        if code not in self._codes["switch"].values():
            raise Refused(ILLEGAL_VALUE)
        self.switch(name, on=code == self._codes["switch"]["on"])

    def _press(self, name: str, code: int) -> None:
        """Down is on and up is off, as in a public client: a key that stays in its position."""
        if code not in self._codes["press"].values():
            raise Refused(ILLEGAL_VALUE)
        self.switch(name, on=code == self._codes["press"]["down"])

    def _fill(
        self, bank: Bank, entries: Mapping[str, Any], loop: int, access: Mapping[str, Access], scale: Scale, whose: str
    ) -> None:
        for name, entry in entries.items():
            address, kind, stride = entry["address"], entry["type"], entry.get("stride", 0)
            several: list[Access] | None = None
            if name.startswith("alarm_"):
                several = [self._alarm_access(name, alarm, scale) for alarm in self._alarms]
            elif name.startswith("limit_"):
                several = [(partial(self._limit_code, slot, name), None) for slot in range(_MODULES)]
            if several is not None:
                for n, (get, put) in enumerate(several):
                    bank.add(address + n * stride, Register(kind, self._low_first, get, put))
                continue
            if name in access:
                get, put = access[name]
            elif name in self._fixed:
                get, put = partial(self._fixed.__getitem__, name), None
            else:
                get = partial(self._settings.__getitem__, whose + name)
                choose = partial(self._choose, whose + name, self._codes[entry["codes"]])
                put = choose if entry["access"] == "rw" else None
            bank.add(address + (loop - 1) * stride, Register(kind, self._low_first, get, put))

    def _limit_code(self, slot: int, name: str) -> int:
        return self._limits[slot][name]

    def _alarm_access(self, name: str, alarm: _Alarm, scale: Scale) -> Access:
        if name == "alarm_state":
            return lambda: alarm.state, None
        if name == "alarm_type":
            return lambda: alarm.kind, None
        attribute = f"{name.removeprefix('alarm_')}_degC"

        def get() -> float:
            absolute = alarm.kind != self._codes["alarm_type"]["deviation"]
            degC: float = getattr(alarm, attribute)
            return scale.shown(degC) if absolute else degC * scale.per_kelvin()

        return get, None

    def _choose(self, name: str, codes: Mapping[str, int], value: int) -> None:
        if value not in codes.values():
            raise Refused(ILLEGAL_VALUE)
        self._settings[name] = value

    def _powered(self) -> bool:
        """Whether the chamber has power: without it, its loop computes without effect."""
        return not self._powered_by or self._on[self._powered_by]

    def _mode(self) -> int:
        if self._powered() and self._enclosure.controlled:
            return self._codes["mode"]["auto"]
        return self._codes["mode"][self._mode_name]

    def _set_mode(self, code: int) -> None:
        """Manual mode is accepted and controls nothing: no manual power has been set."""
        names = {known: name for name, known in self._codes["mode"].items()}
        if code not in names:
            raise Refused(ILLEGAL_VALUE)
        self._mode_name = names[code]
        self._command(self._enclosure.setpoint_degC)

    def _set_setpoint(self, degC: float) -> None:
        if not self._minimum - 1e-4 <= degC <= self._maximum + 1e-4:
            raise Refused(ILLEGAL_VALUE)
        self._mode_name = next(name for name, code in self._codes["mode"].items() if code == self._mode())
        self._command(degC)

    def _command(self, degC: float) -> None:
        whose, codes = self._in_charge, self._codes["ramp_action"]
        ramping = self._settings[f"{whose}ramp_action"] in (codes["setpoint"], codes["both"])
        minutes = self._settings[f"{whose}ramp_scale"] == self._codes["ramp_scale"]["minutes"]
        ramp = self._ramp_per_scale[whose] * (1.0 if minutes else 1.0 / 60.0) if ramping else inf
        controlled = self._mode_name == "auto" and self._powered()
        self._enclosure.command(self._world.now(), degC, controlled=controlled, ramp_degC_per_min=ramp)

    def _set_ramp_rate(self, whose: str, per_scale: float) -> None:
        if not per_scale > 0.0:
            raise Refused(ILLEGAL_VALUE)
        self._ramp_per_scale[whose] = per_scale

    def _set_open_loop(self, pct: float) -> None:
        if not -100.0 <= pct <= 100.0:
            raise Refused(ILLEGAL_VALUE)
        self._open_loop_pct = pct

    def _power_pct(self) -> float:
        """The loop's output; without power of the chamber, its output without effect."""
        chamber, now = self._enclosure, self._world.now()
        if self._powered() or self._mode_name != "auto":
            return chamber.power_pct(now)
        return 100.0 if chamber.setpoint_degC > chamber.air_degC(now) else -100.0

    def _air(self) -> float:
        return self._reading("process value", self._enclosure.air_degC)

    def _part(self) -> float:
        return self._reading("part value", self._enclosure.package_degC)

    def _reading(self, sensor: str, truth_degC: Callable[[float], float]) -> float:
        if self.sensor_broken:
            return nan
        now = self._world.now()
        noise = _PV_NOISE_DEGC * normal(self._seed, f"{self.name} {sensor}", event_at(now))
        return self.inputs.given("process_value", "degC", now, now, truth_degC(now) + noise)
