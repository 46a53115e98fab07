"""Simulated benches with every instrument on them, and a question to each whose answer can be checked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench
from rig.drivers.errors import DriverError, NotReady
from rig.instruments.opening import Bench, open_bench
from rig.sims.bench import SimBench
from rig.sims.faults import Fault, Happening, kinds_of, kinds_on
from rig.simulated.dry_run import DryBench

ATTITUDE = """
name = "attitude"
[instruments.esp301]
driver = "newport-esp301"
address = "/dev/rig/head"
[instruments.dvm]
driver = "keysight-34401a"
address = "/dev/rig/dvm"
nplc = 1
[instruments.scanner]
driver = "keysight-34970a"
address = "/dev/rig/scanner"
nplc = 1
channels = { "101" = "volts", "104" = "thermistor-10k" }
[instruments.enclosure]
driver = "watlow-f4t"
address = "modbus-tcp://192.0.2.10:502/1"
[sensors.x]
axis = "x"
reader = "scanner"
channel = "101"
[sensors.y]
axis = "x"
reader = "dvm"
[temperatures.sensor_temperature_degC]
reader = "scanner"
channel = "104"
"""

_CIA402 = """
[instruments.cia402]
driver = "cia402-pair"
address = "can:socketcan/can1"
"""
_PACE = """
[instruments.pace]
driver = "druck-pace"
address = "/dev/rig/pace"
"""
_CHAMBERS = """
[instruments.chamber]
driver = "watlow-f4t"
address = "modbus-tcp://192.0.2.10:502/1"
low_degC = -60
[instruments.other]
driver = "watlow-f4t"
address = "modbus-tcp://192.0.2.11:502/1"
"""
_DAQ = """
[instruments.daq]
driver = "can-daq"
address = "can:socketcan/can0"
"""
_AT_INPUTS = """
[sensors.bridge]
reader = "daq"
channel = "spare_voltage"
unit = "mV"
[temperatures.sensor_temperature_degC]
reader = "daq"
channel = "sensor_temperature"
place = "sensors"
[temperatures.sse_temperature_degC]
reader = "daq"
channel = "sse_temperature"
place = "sse"
"""
_SENSOR = """
[instruments.dvm]
driver = "keysight-34401a"
address = "/dev/rig/dvm"
[sensors.bridge]
reader = "dvm"
"""
_NAME, _FACTORS = 'name = "pressure"\n', "\n[factors]\n"
_PRESSURE_BY, _TEMPERATURES_BY = (
    'pressure_psia = "pace"\n',
    'sensor_temperature_degC = "chamber"\nsse_temperature_degC = "other"\n',
)
PRESSURE = _NAME + _CIA402 + _PACE + _CHAMBERS + _DAQ + _FACTORS + _PRESSURE_BY + _TEMPERATURES_BY + _AT_INPUTS

# Small ones: a bench costs as long as its data sheets take to read.
BENCHES = {
    "esp301": ATTITUDE,
    "dvm": ATTITUDE,
    "scanner": ATTITUDE,
    "enclosure": ATTITUDE,
    "cia402": _NAME + _CIA402 + _SENSOR,
    "pace": _NAME + _PACE + _FACTORS + _PRESSURE_BY + _SENSOR,
    "chamber": _NAME + _CHAMBERS + _FACTORS + _TEMPERATURES_BY + _SENSOR,
    "daq": _NAME + _CHAMBERS + _DAQ + _FACTORS + _TEMPERATURES_BY + _AT_INPUTS,
}
"""Bench by instrument."""

QUIET = {"lab": {"daily_amplitude_degC": 0.0}}


@dataclass
class Faulty:
    """One instrument of a simulated bench, brought up and asked once.

    Attributes:
        name: the instrument.
        steps: how often what it sees was changed.

    """

    name: str
    dry: DryBench
    bench: Bench
    steps: int = 0

    @property
    def sim(self) -> SimBench:
        return self.dry.sim

    @property
    def driver(self) -> Any:
        return self.bench.instruments[self.name]

    def bring_up(self) -> None:
        """As a session does: who is there, settings, homing."""
        self.driver.identify()
        self.driver.prepare()
        if self.name in ("esp301", "cia402"):
            self.driver.home()
            for _ in range(200):
                if all(axis.homed and not axis.moving for axis in self.driver.read().values()):
                    return
                self.dry.world.sleep(0.5)
            raise AssertionError("it does not home")
        if self.name == "pace":
            self.driver.set_pressure(1.0)

    def step(self, settle_s: float = 15.0) -> None:
        """Change what every instrument sees, so that an old answer is a wrong one."""
        self.steps += 1
        now, plant = self.dry.world.now(), self.sim.plant
        for axis in plant.head.axes.values():
            axis.slip(1.0, encoder=True)
        plant.enclosure.assume_steady(20.0 + self.steps % 20, now)
        for name in ("chamber", "other"):
            if name in self.bench.instruments:
                plant.chamber(name).assume_steady(20.0 + self.steps % 20, now)
        if "pace" in self.bench.instruments:
            plant.pressure_line("pace").command(now, 1.0 + 0.1 * (self.steps % 20), 5.0)
        self.dry.world.sleep(settle_s)

    def ask(self) -> str:
        """Ask the instrument; "" if the answer is right, otherwise what is wrong with it.

        A `DriverError` is let through.
        """
        return _ASK[self.name](self)

    def strike(self, kind: str, **given: Any) -> Fault:
        """Have a fault happen now."""
        twins = self.sim.twins
        what = {**kinds_on(twins.values()), **kinds_of(twins[self.name])}[kind]
        own = {key: given.pop(key) for key in list(given) if key in what.options}
        options = {key: option.default for key, option in what.options.items()} | own
        fault = Fault(what, "" if what.of_bench else self.name, at_s=self.dry.world.now(), options=options, **given)
        self.sim.faults.strike(fault)
        return fault

    def outcomes(self, asks: int, settle_s: float = 15.0) -> list[str]:
        """What comes of asking several times, things having changed before each: "right", an error, or the wrong."""
        found = []
        for _ in range(asks):
            self.step(settle_s)
            try:
                found.append(self.ask() or "right")
            except DriverError as error:
                found.append(type(error).__name__)
        return found

    def happened(self) -> list[Happening]:
        return self.sim.faults.happened


def faulty(name: str, truth: Mapping[str, Any] | None = None, *, text: str = "", **options: Any) -> Faulty:
    """An instrument that has not been brought up, on its own bench or that of `text`."""
    config = parse_bench(text or BENCHES[name], "bench.toml")
    dry = DryBench(config, {**QUIET, **(truth or {})}, **options)
    return Faulty(name, dry, open_bench(dry.config, check_options(dry.config, "bench"), dry.world, dry.wires))


def up(name: str, truth: Mapping[str, Any] | None = None, **options: Any) -> Faulty:
    """An instrument that works."""
    rig = faulty(name, truth, **options)
    rig.bring_up()
    rig.step()
    assert not rig.ask()
    return rig


def _differences(pairs: Mapping[str, tuple[float, float]], allowed: float) -> str:
    return "; ".join(f"{k} {a:.6g} for {b:.6g}" for k, (a, b) in pairs.items() if not abs(a - b) <= allowed)


def _head(rig: Faulty) -> str:
    states = rig.driver.read()
    if lost := [axis for axis, s in states.items() if s.fault or not (s.homed and s.enabled)]:
        raise NotReady(f"{', '.join(lost)}: {states}")
    now, head = rig.dry.world.now(), rig.sim.plant.head
    return _differences({a: (s.position_deg, head.encoder_deg(a, now)) for a, s in states.items()}, 1e-3)


def _meter(rig: Faulty) -> str:
    rig.driver.start(1)
    readings = rig.driver.fetch()
    now, plant = rig.dry.world.now(), rig.sim.plant
    volts = {"dvm": "input", "scanner": "101"}[rig.name]
    wrong = _differences({"V": (readings[volts][0], plant.clean_V(rig.name, volts, now - 0.1, now))}, 2e-3)
    if rig.name == "scanner":
        degC = plant.channel_degC("scanner", "104", now)
        wrong += _differences({"degC": (readings["104"][0], degC)}, 0.1)
    return wrong


def _pace(rig: Faulty) -> str:
    state = rig.driver.read()
    if state.faults:
        raise NotReady("; ".join(state.faults))
    if not state.controlling:
        raise NotReady("control is off")
    now = rig.dry.world.now()
    return _differences({"psi": (state.pressure_psia, rig.sim.plant.pressure_line("pace").pressure_psia(now))}, 1e-3)


def _chamber(rig: Faulty) -> str:
    state = rig.driver.read()
    if state.alarms:
        raise NotReady("; ".join(state.alarms))
    chamber, now = rig.sim.plant.chamber(rig.name), rig.dry.world.now()
    pairs = {
        "setpoint": (state.setpoint_degC, chamber.setpoint_degC),
        "air": (state.temperature_degC, chamber.air_degC(now)),
    }
    return _differences(pairs, 0.1)


def _daq(rig: Faulty) -> str:
    rig.driver.start(2)
    readings = rig.driver.fetch()
    now, plant = rig.dry.world.now(), rig.sim.plant
    places = {"sensor_temperature": "sensors", "sse_temperature": "sse"}
    pairs = {f"{c}[{n}]": (readings[c][n], plant.temperature_degC(p, now)) for c, p in places.items() for n in (0, 1)}
    volts = plant.clean_V("daq", "spare_voltage", now - 0.1, now)
    return _differences(pairs, 0.1) + _differences({"V": (readings["spare_voltage"][0], volts)}, 1e-3)


_ASK: Mapping[str, Callable[[Faulty], str]] = {
    "esp301": _head,
    "dvm": _meter,
    "scanner": _meter,
    "enclosure": _chamber,
    "cia402": _head,
    "pace": _pace,
    "chamber": _chamber,
    "daq": _daq,
}
