"""Simulated Watlow F4T temperature controller, one control loop or cascade on one of the plant's chambers.

The registers are those of the register map that the options carry; what each does is here. As shipped, the
controller talks in degrees Fahrenheit. Settings survive a power cycle, as in the real one.
"""

from __future__ import annotations

import struct
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf, nan
from typing import Any

from sims.inputs import Inputs
from sims.noise import event_at, normal
from sims.physics import Plant
from sims.wires.modbus_line import ModbusEndpoint
from sims.wires.modbus_slave import ILLEGAL_ADDRESS, ILLEGAL_VALUE, Refused
from sims.world import World

_PV_NOISE_DEGC = 0.003
_PART_NUMBER = "F4T1A2CAA1A1AAA"
_STRUCT = {"uint16": ">H", "int32": ">i", "float32": ">f"}
_ALARMS, _MODULES = 14, 6

Value = float | int | str
Access = tuple[Callable[[], Value], Callable[[Any], None] | None]
"""How a register is read and written."""


@dataclass
class _Alarm:
    """One of the controller's alarms; limits as shipped, of a deviation alarm differences."""

    state: int
    kind: int
    high_degC: float = 148.9
    low_degC: float = 0.0


class _Register:
    """One parameter in one or more words.

    Args:
        kind: type as the register map names it.
        low_first: order of the words of a number.
        get: its value now.
        put: sets it, None if it is read only; raises `Refused`.

    """

    def __init__(self, kind: str, low_first: bool, get: Callable[[], Value], put: Callable[[Any], None] | None) -> None:
        self._kind = kind
        self._low_first = low_first
        self._get = get
        self._put = put
        self.size = int(kind.partition(":")[2]) if kind.startswith("text:") else struct.calcsize(_STRUCT[kind]) // 2

    def words(self) -> list[int]:
        """Its value as words."""
        value = self._get()
        if isinstance(value, str):
            return [ord(c) for c in value.ljust(self.size, "\0")]
        packed = struct.pack(_STRUCT[self._kind], value)
        words = list(struct.unpack(f">{self.size}H", packed))
        return words[::-1] if self._low_first else words

    def set(self, words: Sequence[int]) -> None:
        """Set its value from all of its words."""
        if self._put is None or len(words) != self.size:
            raise Refused(ILLEGAL_ADDRESS)
        ordered = words[::-1] if self._low_first else words
        (value,) = struct.unpack(_STRUCT[self._kind], struct.pack(f">{self.size}H", *ordered))
        self._put(value)


class _Bank:
    """Registers at their addresses."""

    def __init__(self) -> None:
        self._at: dict[int, tuple[_Register, int]] = {}

    def add(self, address: int, register: _Register) -> None:
        """Put a register at an address."""
        for offset in range(register.size):
            self._at[address + offset] = (register, offset)

    def read(self, address: int, count: int) -> list[int]:
        """See `sims.wires.modbus_slave.Registers`; every word must belong to a register."""
        words: list[int] = []
        while len(words) < count:
            register, offset = self._find(address + len(words))
            words += register.words()[offset:]
        return words[:count]

    def write(self, address: int, words: Sequence[int]) -> None:
        """See `sims.wires.modbus_slave.Registers`; registers are written whole."""
        done = 0
        while done < len(words):
            register, offset = self._find(address + done)
            if offset:
                raise Refused(ILLEGAL_ADDRESS)
            register.set(words[done : done + register.size])
            done += register.size

    def _find(self, address: int) -> tuple[_Register, int]:
        try:
            return self._at[address]
        except KeyError:
            raise Refused(ILLEGAL_ADDRESS) from None


class WatlowF4TTwin:
    """The controller.

    Args:
        name: the bench's name for it.
        options: its options in the bench file; `register_map` (text), `loop` and `cascade` matter here, and the range
            of setpoints, for which whoever built the chamber has set the controller up.
        world: virtual time.
        plant: its `chamber(name)` is what the loop controls.
        serial: serial number; its digits are what the controller answers.

    Attributes:
        registers: what is on the wire, for any framing.
        sensor_broken: the process value is no number [?].
        inputs: what becomes of its readings.

    """

    kind = "modbus"

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Plant, serial: str) -> None:
        self.name = name
        self._world = world
        self._enclosure = plant.chamber(name)
        self._seed = plant.truth.seed
        contract = tomllib.loads(str(options["register_map"]))
        self._codes: Mapping[str, Mapping[str, int]] = contract["codes"]
        self._settings: dict[str, Value] = {
            "display_units": self._codes["units"]["F"],
            "ramp_action": self._codes["ramp_action"]["off"],
            "ramp_scale": self._codes["ramp_scale"]["minutes"],
        }
        self._minimum = min(-40.0, float(str(options.get("low_degC", -40.0))))
        self._maximum = max(150.0, float(str(options.get("high_degC", 150.0))))
        self._ramp_per_scale = 1.0
        none, off = self._codes["alarm"]["none"], self._codes["alarm_type"]["off"]
        self._alarms = [_Alarm(none, off) for _ in range(_ALARMS)]
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
        self.registers = _Bank()
        self._low_first = contract["word_order"] == "low-first"
        self._fill(contract["registers"], int(str(options.get("loop", 1))), self._loop())
        if options.get("cascade"):
            self._fill(contract["cascade"], int(str(options.get("loop", 1))), self._loop() | self._cascade())
        self._endpoint = ModbusEndpoint(world, {1: self.registers})

    def on_rx(self, data: bytes, tx: Callable[[bytes], None]) -> None:
        """Modbus TCP requests to unit 1."""
        self._endpoint.on_rx(data, tx)

    def power_cycle(self) -> None:
        """Off and on again; setpoint, mode and settings are kept in the controller's memory."""

    def set_alarm(self, number: int, state: str, kind: str = "process", limit_degC: float | None = None) -> None:
        """Put alarm 1, 2, ... into a state and give it a type, both as the register map names them."""
        alarm = self._alarms[number - 1]
        alarm.state, alarm.kind = self._codes["alarm"][state], self._codes["alarm_type"][kind]
        if limit_degC is not None:
            alarm.high_degC = alarm.low_degC = limit_degC

    def set_limit(self, slot: int, *, state: str = "none", status: str = "ok", error: str = "none") -> None:
        """Let the limit controller in slot 1 to 6 trip, fail, or lose its sensor; without words it is well."""
        self._limits[slot - 1] = self._limit(state, status, error)

    def _limit(self, state: str = "none", status: str = "ok", error: str = "none") -> dict[str, int]:
        codes = self._codes
        return {
            "limit_state": codes["limit_state"][state],
            "limit_status": codes["limit_status"][status],
            "limit_error": codes["input_error"][error],
        }

    def _loop(self) -> dict[str, Access]:
        """How the registers of the control loop are read and written, by name."""
        chamber, now = self._enclosure, self._world.now
        return {
            "mode": (self._mode, self._set_mode),
            "active_mode": (self._mode, None),
            "setpoint": (lambda: self._shown(chamber.setpoint_degC), self._set_setpoint),
            "active_setpoint": (lambda: self._shown(chamber.active_setpoint_degC(now())), None),
            "process_value": (self._process_value, None),
            "power": (lambda: chamber.power_pct(now()), None),
            "setpoint_minimum": (lambda: self._shown(self._minimum), self._set_minimum),
            "setpoint_maximum": (lambda: self._shown(self._maximum), self._set_maximum),
            "ramp_rate": (lambda: self._shown_difference(self._ramp_per_scale), self._set_ramp_rate),
        }

    def _cascade(self) -> dict[str, Access]:
        """Where a cascade differs from a loop: the part follows the air, which is led to the part's own setpoint."""
        chamber, now = self._enclosure, self._world.now
        return {
            "process_value": (self._part_value, None),
            "air_value": (self._process_value, None),
            "air_setpoint": (lambda: self._shown(chamber.active_setpoint_degC(now())), None),
        }

    def _fill(self, entries: Mapping[str, Any], loop: int, access: Mapping[str, Access]) -> None:
        for name, entry in entries.items():
            address, kind, stride = entry["address"], entry["type"], entry.get("stride", 0)
            several: list[Access] | None = None
            if name.startswith("alarm_"):
                several = [self._alarm_access(name, alarm) for alarm in self._alarms]
            elif name.startswith("limit_"):
                several = [(partial(self._limit_code, slot, name), None) for slot in range(_MODULES)]
            if several is not None:
                for n, (get, put) in enumerate(several):
                    self.registers.add(address + n * stride, _Register(kind, self._low_first, get, put))
                continue
            if name in access:
                get, put = access[name]
            elif name in self._fixed:
                get, put = partial(self._fixed.__getitem__, name), None
            else:
                get = partial(self._settings.__getitem__, name)
                put = partial(self._choose, name, self._codes[entry["codes"]])
            self.registers.add(address + (loop - 1) * stride, _Register(kind, self._low_first, get, put))

    def _limit_code(self, slot: int, name: str) -> int:
        return self._limits[slot][name]

    def _alarm_access(self, name: str, alarm: _Alarm) -> Access:
        if name == "alarm_state":
            return lambda: alarm.state, None
        if name == "alarm_type":
            return lambda: alarm.kind, None
        attribute = f"{name.removeprefix('alarm_')}_degC"

        def get() -> float:
            absolute = alarm.kind != self._codes["alarm_type"]["deviation"]
            degC: float = getattr(alarm, attribute)
            return self._shown(degC) if absolute else self._shown_difference(degC)

        return get, None

    def _choose(self, name: str, codes: Mapping[str, int], value: int) -> None:
        if value not in codes.values():
            raise Refused(ILLEGAL_VALUE)
        self._settings[name] = value

    def _mode(self) -> int:
        return self._codes["mode"]["auto" if self._enclosure.controlled else "off"]

    def _set_mode(self, code: int) -> None:
        """Manual is taken and controls nothing: nobody has set a manual power."""
        if code not in self._codes["mode"].values():
            raise Refused(ILLEGAL_VALUE)
        self._command(self._enclosure.setpoint_degC, controlled=code == self._codes["mode"]["auto"])

    def _set_setpoint(self, shown: float) -> None:
        degC = self._celsius(shown)
        if not self._minimum - 1e-4 <= degC <= self._maximum + 1e-4:
            raise Refused(ILLEGAL_VALUE)
        self._command(degC, controlled=self._enclosure.controlled)

    def _command(self, degC: float, *, controlled: bool) -> None:
        codes = self._codes["ramp_action"]
        ramping = self._settings["ramp_action"] in (codes["setpoint"], codes["both"])
        per_minute = 1.0 if self._settings["ramp_scale"] == self._codes["ramp_scale"]["minutes"] else 1.0 / 60.0
        ramp = self._ramp_per_scale * per_minute if ramping else inf
        self._enclosure.command(self._world.now(), degC, controlled=controlled, ramp_degC_per_min=ramp)

    def _set_minimum(self, shown: float) -> None:
        self._minimum = self._celsius(shown)

    def _set_maximum(self, shown: float) -> None:
        self._maximum = self._celsius(shown)

    def _set_ramp_rate(self, shown: float) -> None:
        if not shown > 0.0:
            raise Refused(ILLEGAL_VALUE)
        self._ramp_per_scale = shown / self._per_kelvin()

    def _process_value(self) -> float:
        if self.sensor_broken:
            return nan
        now = self._world.now()
        noise = _PV_NOISE_DEGC * normal(self._seed, f"{self.name} process value", event_at(now))
        return self._shown(self.inputs.given("process_value", "degC", now, now, self._enclosure.air_degC(now) + noise))

    def _part_value(self) -> float:
        if self.sensor_broken:
            return nan
        now = self._world.now()
        noise = _PV_NOISE_DEGC * normal(self._seed, f"{self.name} part value", event_at(now))
        return self._shown(
            self.inputs.given("process_value", "degC", now, now, self._enclosure.package_degC(now) + noise)
        )

    def _per_kelvin(self) -> float:
        return 1.0 if self._settings["display_units"] == self._codes["units"]["C"] else 1.8

    def _shown_difference(self, kelvin: float) -> float:
        return kelvin * self._per_kelvin()

    def _shown(self, degC: float) -> float:
        """A temperature in the units the controller talks in."""
        return degC if self._per_kelvin() == 1.0 else degC * 1.8 + 32.0

    def _celsius(self, shown: float) -> float:
        return shown if self._per_kelvin() == 1.0 else (shown - 32.0) / 1.8
