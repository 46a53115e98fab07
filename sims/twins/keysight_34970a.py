"""Simulated Agilent/Keysight 34970A scanner with a 34901A multiplexer in slot 100, on its serial interface.

Commands, errors and state after *RST are from the 34970A/34972A Command Reference, version 2.00. Channels 101 to 120
measure DC volts, thermistors or platinum resistors; a four-wire sensor uses a second channel, ten above its own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partialmethod
from typing import ClassVar

from rig.sims.twins.keysight_34970a_commands import COMMANDS, ERRORS
from rig.sims.twins.keysight_channel import (
    CHANNELS,
    DEGREES,
    NPLC,
    RELAY_S,
    SLOTS,
    SPANS_DEGC,
    TYPES,
    VOLTS,
    Channel,
)
from rig.sims.twins.keysight_mainframe import Mainframe
from rig.sims.twins.keysight_memory import RememberingTwin
from rig.sims.twins.keysight_meter import (
    OVERLOAD,
    RESOLUTION,
    Plant,
    nplc_for,
    nplc_for_resolution,
    parameter,
    range_named,
    reading,
    temperature,
    text,
)
from rig.sims.twins.keysight_trigger import TriggeredTwin
from rig.sims.twins.scpi import ScpiTwin
from rig.sims.twins.scpi_flow import XonXoffTwin
from rig.sims.twins.scpi_syntax import Command, ScpiError, boolean
from rig.sims.world import World

_LONG = {"THERMISTOR": "THER"}


class Keysight34970ATwin(Mainframe, XonXoffTwin, RememberingTwin):
    """The scanner.

    Args:
        name: the bench's name for it.
        options: its options in the bench file; `baud`, `frame`, `flow`, `interface` and `line_Hz` are used.
        world: virtual time.
        plant: voltages and temperatures at its channels.
        serial: not reported by this model, which answers 0.
    """

    commands: ClassVar[Mapping[str, Command]] = COMMANDS
    errors: ClassVar[Mapping[int, str]] = {**ScpiTwin.errors, **ERRORS}
    identity = "HEWLETT-PACKARD,34970A,0,13-2-2"
    queued_errors = 10
    overflow = "Error queue overflow"
    memory = 50_000
    sources = ("IMM", "BUS", "EXT", "TIM")

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Plant, serial: str) -> None:
        self.holds_up = options.get("flow", "xonxoff") == "xonxoff"  # factory setting
        self._plan: list[tuple[str, Channel, bool, float, float]] | None = None  # of a scan, with its times
        super().__init__(name, options, world, plant, baud=9600, frame="8N1")

    def reset(self) -> None:
        """*RST: every channel DC volts, autorange, 1 power line cycle; empty scan list."""
        super().reset()
        self._plan = None
        self.channels = dict.fromkeys(CHANNELS, Channel())
        self.scan: list[str] = []
        self.timer_s = 10.0

    def changed(self) -> None:
        """Settings cannot be changed during a scan."""
        if self.measuring:
            raise ScpiError(261)
        self._plan = None
        super().changed()

    def channel_of(self, position: int) -> str:
        """Channels in the order of the scan list."""
        return self.scan[position]

    def unit_of(self, channel: str) -> str:
        """Unit of a channel: volts or degrees."""
        settings = self.channels[channel]
        return "VDC" if settings.function == VOLTS else "F" if settings.fahrenheit else "C"

    def late_s(self, position: int) -> float:
        """Channels are read one after the other."""
        return sum(self.channels[name].seconds(self.line_hz) for name in self.scan[:position])

    def sweeps(self) -> float:
        """Number of scans in a measurement."""
        return self.trigger_count

    def readings_per_sweep(self) -> int:
        """Number of channels in the scan list."""
        return len(self.scan)

    def sweep_s(self) -> float:
        """Duration of a scan: channel after channel, or the longer period of a timer."""
        seconds = sum(self.channels[c].seconds(self.line_hz) for c in self.scan)
        return max(seconds, self.timer_s) if self.source == "TIM" else seconds

    def take(self, began: float) -> list[float]:
        """One scan."""
        if self._plan is None:
            listed = [(name, self.channels[name]) for name in self.scan]
            self._plan = [(name, c, c.function == VOLTS, c.settling_s(), c.seconds(self.line_hz)) for name, c in listed]
        values, hz, given = [], self.line_hz, self.inputs.given
        for name, channel, volts, settling_s, seconds in self._plan:
            t0, nplc = began + RELAY_S + settling_s, channel.nplc
            if volts:
                value = reading(self.plant, self.name, name, t0, nplc, hz, channel.range)
                value = given(name, "V", t0, t0 + nplc / hz, value)
            else:
                value = temperature(self.plant, self.name, name, t0, nplc, hz, SPANS_DEGC[channel.probe])
                value = given(name, "degC", t0, t0 + nplc / hz, value)
                if channel.fahrenheit and value != OVERLOAD:
                    value = value * 1.8 + 32.0
            values.append(value)
            began += seconds
        return values

    def overload_bit(self, position: int) -> int:
        """Voltage overload is bit 0, temperature overload bit 10."""
        return 1 if self.channels[self.scan[position]].function == VOLTS else 1 << 10

    def initiate(self) -> None:
        """INITiate; fails without a scan list."""
        if not self.scan:
            raise ScpiError(113)
        super().initiate()

    def read(self) -> str:
        """READ?; fails without a scan list."""
        if not self.scan:
            raise ScpiError(113)
        return super().read()

    def abort(self) -> None:
        """ABORt: gives up the scan; a completed scan keeps its readings."""
        if self.measuring or self._armed:
            self.stop_measuring()

    def configure_volts(self, *parameters: str) -> None:
        """CONFigure:VOLTage:DC [range[,resolution],](@channels): also makes them the scan list."""
        span, resolution, *_ = *parameters[:-1], "DEF", "DEF"
        chosen = range_named(span)
        nplc = nplc_for_resolution(resolution, chosen, NPLC) if resolution.upper() != "DEF" else 1.0
        self._configure(parameters, Channel(VOLTS, nplc, chosen))

    def configure_temperature(self, *parameters: str) -> None:
        """CONFigure:TEMPerature probe,type[,1[,resolution]],(@channels): also makes them the scan list."""
        if len(parameters) < 3:
            raise ScpiError(-109)
        probe = _LONG.get(parameters[0].upper(), parameters[0].upper())
        if probe not in TYPES:
            raise ScpiError(251)
        default = "5000" if probe == "THER" else "85"
        type_ = f"{parameter(parameters[1], float(default), float(default), float(default)):.0f}"
        if type_ not in TYPES[probe]:
            raise ScpiError(-224)
        if probe == "FRTD" and any(int(name) % 100 > 10 for name in self._listed(parameters[-1])):
            raise ScpiError(308)
        self._configure(parameters, Channel(DEGREES, 1.0, 0.0, probe, type_))

    def measure_volts(self, *parameters: str) -> str:
        """MEASure:VOLTage:DC?: configure, scan once and answer."""
        if not self._streaming:
            self.configure_volts(*parameters)
        return self.read()

    def measure_temperature(self, *parameters: str) -> str:
        """MEASure:TEMPerature?: likewise."""
        if not self._streaming:
            self.configure_temperature(*parameters)
        return self.read()

    def ask_function(self, channels: str = "") -> str:
        """FUNCtion?."""
        return self._about_channels(channels, lambda c: f'"{c.function}"')

    def set_delay(self, seconds: str, channels: str = "") -> None:
        """ROUTe:CHANnel:DELay: replaces the automatic delay."""
        value = parameter(seconds, 0.0, 60.0, 0.0)
        if not 0.0 <= value <= 60.0:
            raise ScpiError(-222)
        self._change(channels, "", lambda c: replace(c, delay=value))

    def ask_delay(self, channels: str = "") -> str:
        """ROUTe:CHANnel:DELay?."""
        return self._about_channels(channels, lambda c: text(c.settling_s()))

    def ask_operation(self) -> str:
        """STATus:OPERation:CONDition?: bit 4 while scanning."""
        return f"{16 * self.measuring:+d}"

    def ask_relay_cycles(self, channels: str = "") -> str:
        """DIAGnostic:RELay:CYCLes?: closures of the channels' relays; they are not counted."""
        return self._about_channels(channels, lambda c: "+0")

    def _configure(self, parameters: tuple[str, ...], settings: Channel) -> None:
        listed = self._listed(parameters[-1] if parameters else "")
        settled = self.channels | {
            name: replace(settings, fahrenheit=self.channels[name].fahrenheit) for name in listed
        }
        self._refuse_pairs(listed, settled)
        self.changed()
        TriggeredTwin.reset(self)
        self.channels = settled
        self.scan = listed

    def _refuse_pairs(self, listed: list[str], channels: Mapping[str, Channel]) -> None:
        """A channel that carries the other two wires of a resistor cannot be measured itself."""
        lower = {name: str(int(name) - 10) for name in listed if int(name) % 100 > 10}
        if any(channels[n].probe == "FRTD" for n in lower.values()):
            raise ScpiError(306)

    def ask_configuration(self, channels: str = "") -> str:
        """CONFigure?."""
        return ",".join(self._about(self.channels[name]) for name in self._listed(channels))

    def _about(self, channel: Channel) -> str:
        if channel.function == DEGREES:
            return f'"TEMP {channel.probe},{channel.type},{1:+.6E},{1e-4:+.6E}"'
        span = channel.range or 10.0
        return f'"VOLT {span:+.6E},{RESOLUTION[channel.nplc] * span:+.6E}"'

    def _listed(self, text_: str) -> list[str]:
        """Channels of a list such as (@101,103:105), ascending; the scan list if none is given."""
        if not text_:
            return self.scan
        match = re.fullmatch(r"\(@([\d:,\s]*)\)", text_)
        if match is None:
            raise ScpiError(309 if text_.startswith("(") else -109)
        found: set[int] = set()
        for part in filter(None, (p.strip() for p in match.group(1).split(","))):
            first, _, last = part.partition(":")
            ends = sorted((int(first), int(last or first)))
            found.update(range(ends[0], ends[1] + 1))
        if any(n // 100 * 100 != SLOTS[0] for n in found):
            raise ScpiError(111)
        if any(str(n) not in self.channels for n in found):
            raise ScpiError(112)
        return [str(n) for n in sorted(found)]

    def set_scan(self, channels: str) -> None:
        """ROUTe:SCAN."""
        listed = self._listed(channels)
        self._refuse_pairs(listed, self.channels)
        self.changed()
        self.scan = listed

    def ask_scan(self) -> str:
        """ROUTe:SCAN?: a block of definite length."""
        listed = f"(@{','.join(self.scan)})"
        digits = str(len(listed))
        return f"#{len(digits)}{digits}{listed}"

    def ask_scan_size(self) -> str:
        """ROUTe:SCAN:SIZE?."""
        return f"{len(self.scan):+d}"

    def _change(self, channels: str, function: str, change: Callable[[Channel], Channel]) -> None:
        """Change settings of the channels that measure `function` ("" for any)."""
        listed = self._listed(channels)
        if any(function not in ("", self.channels[name].function) for name in listed):
            raise ScpiError(305)
        self.changed()
        for name in listed:
            self.channels[name] = change(self.channels[name])

    def _about_channels(self, channels: str, about: Callable[[Channel], str]) -> str:
        return ",".join(about(self.channels[name]) for name in self._listed(channels))

    def _set_nplc(self, function: str, cycles: str, channels: str = "") -> None:
        chosen = nplc_for(cycles, NPLC)
        self._change(channels, function, lambda c: replace(c, nplc=chosen))

    def _ask_nplc(self, channels: str = "") -> str:
        return self._about_channels(channels, lambda c: text(c.nplc))

    set_nplc_volts, set_nplc_temperature = partialmethod(_set_nplc, VOLTS), partialmethod(_set_nplc, DEGREES)
    ask_nplc_volts = ask_nplc_temperature = _ask_nplc

    def set_range(self, span: str, channels: str = "") -> None:
        """VOLTage:DC:RANGe."""
        chosen = range_named(span)
        self._change(channels, VOLTS, lambda c: replace(c, range=chosen))

    def ask_range(self, channels: str = "") -> str:
        """VOLTage:DC:RANGe?."""
        return self._about_channels(channels, lambda c: text(c.range or 10.0))

    def set_autozero(self, state: str, channels: str = "") -> None:
        """ZERO:AUTO; ONCE leaves it off."""
        on = state.upper() != "ONCE" and boolean(state)
        self._change(channels, "", lambda c: replace(c, autozero=on))

    def ask_autozero(self, channels: str = "") -> str:
        """ZERO:AUTO?."""
        return self._about_channels(channels, lambda c: "1" if c.autozero else "0")

    def set_unit(self, unit: str, channels: str = "") -> None:
        """UNIT:TEMPerature."""
        if unit.upper() not in ("C", "F"):
            raise ScpiError(-224)
        self._change(channels, "", lambda c: replace(c, fahrenheit=unit.upper() == "F"))

    def ask_unit(self, channels: str = "") -> str:
        """UNIT:TEMPerature?."""
        return self._about_channels(channels, lambda c: "F" if c.fahrenheit else "C")

    def ask_transducer(self, channels: str = "") -> str:
        """TEMPerature:TRANsducer:TYPE?."""
        return self._ask_probes(channels, lambda c: c.probe)

    def ask_thermistor(self, channels: str = "") -> str:
        """TEMPerature:TRANsducer:THERmistor:TYPE?."""
        return self._ask_probes(channels, lambda c: c.type, "THER")

    def ask_rtd(self, channels: str = "") -> str:
        """TEMPerature:TRANsducer:RTD:TYPE?."""
        return self._ask_probes(channels, lambda c: f"+{c.type}", "RTD")

    def ask_frtd(self, channels: str = "") -> str:
        """TEMPerature:TRANsducer:FRTD:TYPE?."""
        return self._ask_probes(channels, lambda c: f"+{c.type}", "FRTD")

    def ask_ohms(self, channels: str = "") -> str:
        """TEMPerature:TRANsducer:RTD:RESistance? and FRTD:RESistance?: at 0 degrees Celsius."""
        return self._ask_probes(channels, lambda c: text(100.0), "RTD", "FRTD")

    def _ask_probes(self, channels: str, about: Callable[[Channel], str], *probes: str) -> str:
        chosen = [self.channels[name] for name in self._listed(channels)]
        if any(c.function != DEGREES or (probes and c.probe not in probes) for c in chosen):
            raise ScpiError(305)
        return ",".join(map(about, chosen))

    def set_timer(self, seconds: str) -> None:
        """TRIGger:TIMer: period of scans."""
        value = parameter(seconds, 0.0, 359_999.0, 10.0)
        if not 0.0 <= value <= 359_999.0:
            raise ScpiError(-222)
        self.changed()
        self.timer_s = value

    def ask_timer(self) -> str:
        """TRIGger:TIMer?."""
        return text(self.timer_s)

    def ask_line_frequency(self) -> str:
        """SYSTem:LFRequency?."""
        return f"{self.line_hz:+.0f}"
