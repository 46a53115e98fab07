"""Simulated HP/Agilent/Keysight 34401A voltmeter on its serial interface, DC volts.

Commands, errors and state after *RST are from the 34401A user's guide (34401-90004).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from rig.sims.twins.keysight_meter import (
    RESOLUTION,
    SETTLING_S,
    Plant,
    nplc_for,
    nplc_for_resolution,
    parameter,
    range_for,
    range_named,
    reading,
    text,
)
from rig.sims.twins.keysight_trigger import TRIGGERING, TriggeredTwin
from rig.sims.twins.scpi import COMMON, ScpiTwin
from rig.sims.twins.scpi_syntax import Command, ScpiError, boolean, compiled, switch
from rig.sims.world import World

NPLC = (0.02, 0.2, 1.0, 10.0, 100.0)
"""Integration times, power line cycles (user's guide)."""

_INPUT = "input"
_MOST_SAMPLES = 50_000

_TABLE = (
    *COMMON,
    *TRIGGERING,
    Command("CONFigure:VOLTage[:DC]", set="configure"),
    Command("CONFigure", query="ask_configuration"),
    Command("MEASure:VOLTage[:DC]", query="measure"),
    Command("[SENSe:]FUNCtion", set="set_function", query="ask_function"),
    Command("[SENSe:]VOLTage[:DC]:NPLCycles", set="set_nplc", query="ask_nplc"),
    Command("[SENSe:]VOLTage[:DC]:RANGe", set="set_range", query="ask_range"),
    Command("[SENSe:]VOLTage[:DC]:RANGe:AUTO", set="set_autorange", query="ask_autorange"),
    Command("[SENSe:]VOLTage[:DC]:RESolution", set="set_resolution", query="ask_resolution"),
    Command("[SENSe:]ZERO:AUTO", set="set_autozero", query="ask_autozero"),
    Command("TRIGger:DELay", set="set_delay", query="ask_delay"),
    Command("TRIGger:DELay:AUTO", set="set_delay_auto", query="ask_delay_auto"),
    Command("SAMPle:COUNt", set="set_sample_count", query="ask_sample_count"),
    Command("INPut:IMPedance:AUTO", set="set_impedance_auto", query="ask_impedance_auto"),
    Command("ROUTe:TERMinals", query="ask_terminals"),
    Command("DISPlay", set="set_display", query="ask_display"),
    Command("DISPlay:TEXT", set="set_text", query="ask_text"),
    Command("DISPlay:TEXT:CLEar", set="clear_text"),
    Command("SYSTem:BEEPer", set="beep"),
    Command("SYSTem:BEEPer:STATe", set="set_beeper", query="ask_beeper"),
    Command("CALCulate:STATe", query="ask_math"),
    Command("*TST", query="test"),
)


class Keysight34401ATwin(TriggeredTwin):
    """The voltmeter. Its one input is the plant's channel "input".

    Args:
        name: the bench's name for it.
        options: its options in the bench file; `baud`, `frame`, `interface` and `line_Hz` are used.
        world: virtual time.
        plant: voltage at the input.
        serial: not reported by this model, which answers 0.
    """

    commands = compiled(_TABLE)
    errors: ClassVar[Mapping[int, str]] = {
        **ScpiTwin.errors,
        514: "Command allowed only with RS-232",
        531: "Insufficient memory",
        550: "Command not allowed in local",
    }
    identity = "HEWLETT-PACKARD,34401A,0,10-5-2"
    memory = 512
    set_impedance_auto, ask_impedance_auto = switch("impedance_auto")
    set_display, ask_display = switch("display")
    set_beeper, ask_beeper = switch("beeper")

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Plant, serial: str) -> None:
        self.dsr: bool | None = None
        super().__init__(name, options, world, plant, baud=9600, frame="7E2")

    def hears_clear(self) -> bool:
        """DTR is false while it has a query to answer; then Ctrl-C counts only if DSR is false (page 151)."""
        return not (self.busy and self.dsr)

    def reset(self) -> None:
        """*RST: DC volts, autorange, 10 power line cycles, autozero, one reading at once."""
        super().reset()
        self.nplc = 10.0
        self.range = 0.0
        self.autozero = True
        self.delay: float | None = None
        self.sample_count = 1
        self.impedance_auto = False
        self.display = True
        self.text = ""
        self.beeper = True

    def sweeps(self) -> float:
        """One sweep is one reading."""
        return self.trigger_count * self.sample_count

    def check_memory(self) -> None:
        """At most 512 readings."""
        if self.sweeps() > self.memory:
            raise ScpiError(531)

    def readings_per_sweep(self) -> int:
        """One input."""
        return 1

    def settling_s(self) -> float:
        """Trigger delay, automatic unless set."""
        return SETTLING_S[self.nplc] if self.delay is None else self.delay

    def sweep_s(self) -> float:
        """Delay, integration, and with autozero a second integration with the input shorted."""
        return self.settling_s() + (2 if self.autozero else 1) * self.nplc / self.line_hz

    def take(self, began: float) -> list[float]:
        """One reading."""
        t0 = began + self.settling_s()
        value = reading(self.plant, self.name, _INPUT, t0, self.nplc, self.line_hz, self.range)
        return [self.inputs.given(_INPUT, "V", t0, t0 + self.nplc / self.line_hz, value)]

    def overload_bit(self, position: int) -> int:
        """Voltage overload is bit 0."""
        return 1

    def configure(self, span: str = "DEF", resolution: str = "DEF") -> None:
        """CONFigure:VOLTage:DC presets everything and does not trigger."""
        wanted = range_named(span)
        nplc = nplc_for_resolution(resolution, wanted, NPLC)
        self.changed()
        TriggeredTwin.reset(self)
        self.range, self.nplc = wanted, nplc
        self.autozero, self.delay, self.sample_count = True, None, 1

    def ask_configuration(self) -> str:
        """CONFigure?."""
        return f'"VOLT {self._span():+.6E},{self._resolution():+.6E}"'

    def measure(self, span: str = "DEF", resolution: str = "DEF") -> str:
        """MEASure:VOLTage:DC?: configure and read."""
        if not self._streaming:
            self.configure(span, resolution)
        return self.read()

    def _span(self) -> float:
        return self.range or range_for(
            self.plant.channel_V(self.name, _INPUT, self.world.now(), self.world.now() + 1e-3)
        )

    def _resolution(self) -> float:
        return RESOLUTION[self.nplc] * self._span()

    def set_function(self, name: str) -> None:
        """FUNCtion: only DC volts is simulated."""
        if name.strip("\"'").upper() not in ("VOLT", "VOLT:DC", "VOLTAGE", "VOLTAGE:DC"):
            raise ScpiError(-224)
        self.changed()

    def ask_function(self) -> str:
        """FUNCtion?."""
        return '"VOLT"'

    def set_nplc(self, cycles: str) -> None:
        """VOLTage:DC:NPLCycles."""
        chosen = nplc_for(cycles, NPLC)
        self.changed()
        self.nplc = chosen

    def ask_nplc(self) -> str:
        """VOLTage:DC:NPLCycles?."""
        return text(self.nplc)

    def set_range(self, span: str) -> None:
        """VOLTage:DC:RANGe."""
        chosen = range_named(span)
        self.changed()
        self.range = chosen

    def ask_range(self) -> str:
        """VOLTage:DC:RANGe?."""
        return text(self._span())

    def set_autorange(self, state: str) -> None:
        """VOLTage:DC:RANGe:AUTO."""
        on = boolean(state)
        self.changed()
        self.range = 0.0 if on else self._span()

    def ask_autorange(self) -> str:
        """VOLTage:DC:RANGe:AUTO?."""
        return "0" if self.range else "1"

    def set_resolution(self, volts: str) -> None:
        """VOLTage:DC:RESolution; refused while autoranging."""
        if not self.range:
            raise ScpiError(-221)
        chosen = nplc_for_resolution(volts, self.range, NPLC)
        self.changed()
        self.nplc = chosen

    def ask_resolution(self) -> str:
        """VOLTage:DC:RESolution?."""
        return text(self._resolution())

    def set_autozero(self, state: str) -> None:
        """ZERO:AUTO; ONCE leaves it off."""
        on = state.upper() != "ONCE" and boolean(state)
        self.changed()
        self.autozero = on

    def ask_autozero(self) -> str:
        """ZERO:AUTO?."""
        return "1" if self.autozero else "0"

    def set_delay(self, seconds: str) -> None:
        """TRIGger:DELay, which ends the automatic delay."""
        value = parameter(seconds, 0.0, 3600.0, 0.0)
        if not 0.0 <= value <= 3600.0:
            raise ScpiError(-222)
        self.changed()
        self.delay = value

    def ask_delay(self) -> str:
        """TRIGger:DELay?."""
        return text(self.settling_s())

    def set_delay_auto(self, state: str) -> None:
        """TRIGger:DELay:AUTO."""
        on = boolean(state)
        self.changed()
        self.delay = None if on else self.settling_s()

    def ask_delay_auto(self) -> str:
        """TRIGger:DELay:AUTO?."""
        return "1" if self.delay is None else "0"

    def set_sample_count(self, count: str) -> None:
        """SAMPle:COUNt."""
        value = parameter(count, 1, _MOST_SAMPLES, 1)
        if not 1 <= value <= _MOST_SAMPLES:
            raise ScpiError(-222)
        self.changed()
        self.sample_count = round(value)

    def ask_sample_count(self) -> str:
        """SAMPle:COUNt?."""
        return text(self.sample_count)

    def ask_terminals(self) -> str:
        """ROUTe:TERMinals?."""
        return "FRON"

    def set_text(self, words: str) -> None:
        """DISPlay:TEXT: up to twelve characters are shown."""
        self.text = words.strip("\"'")[:12]

    def ask_text(self) -> str:
        """DISPlay:TEXT?."""
        return f'"{self.text}"'

    def clear_text(self) -> None:
        """DISPlay:TEXT:CLEar."""
        self.text = ""

    def ask_math(self) -> str:
        """CALCulate:STATe?: math is off; it is not simulated."""
        return "0"

    def beep(self) -> None:
        """SYSTem:BEEPer."""

    def test(self) -> str:
        """*TST?: passed."""
        return "+0"
