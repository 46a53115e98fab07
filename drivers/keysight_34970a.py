"""Agilent/Keysight 34970A scanner on its serial interface: DC volts and thermistors through a 34901A multiplexer.

Commands from the 34970A/34972A Command Reference, version 2.00. The scanner goes through its scan list in ascending
order, whatever order it was given in.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, Field

from drivers.clock import Clock
from drivers.errors import BadReply
from drivers.scpi import FREQUENCIES, Nplc, ScpiMeter, one_of, settling_s
from drivers.wires import SerialSettings, Wires

THERMISTORS = {"thermistor-2.2k": 2252, "thermistor-5k": 5000, "thermistor-10k": 10000}
"""Kinds of thermistor it linearises (44004, 44007, 44006): ohms at 25 degrees Celsius."""

_MEMORY = 50_000
_RELAY_S = 0.0167  # 60 channels a second with a 34901A

ChannelName = Annotated[str, Field(pattern=r"^[123](0[1-9]|1[0-9]|20)$")]


class Keysight34970A(ScpiMeter):
    """The scanner; satisfies `drivers.roles.Reader`.

    Args:
        name: the bench's name for it.
        address: serial address.
        options: see `Options`.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the address cannot be opened.

    """

    class Options(BaseModel, extra="forbid"):
        """What the bench file may say about this instrument."""

        channels: dict[ChannelName, Literal["volts", "thermistor-2.2k", "thermistor-5k", "thermistor-10k"]] = Field(
            min_length=1, max_length=60, description="what is wired to which channel: slot 1 to 3, channel 01 to 20"
        )
        baud: Literal[1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200] = Field(
            9600, description="symbols per second"
        )
        frame: Literal["8N1", "7E1", "7O1"] = Field("8N1", description="data bits, parity, stop bits")
        nplc: Nplc = Field(10, description="integration time, power line cycles")
        range_V: Annotated[float, AfterValidator(one_of(0.1, 1, 10, 100))] = Field(
            10, description="measuring range of the volts channels"
        )

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self.name = name
        self._options = options
        self._names = tuple(sorted(options.channels))
        self._line_hz = FREQUENCIES[0]
        settings = SerialSettings(options.baud, options.frame, timeout_s=2.0)
        super().__init__(wires.serial(address, settings, name), clock, "34970A")

    @property
    def most_sweeps(self) -> int:
        """50,000 readings."""
        return _MEMORY // len(self._names)

    def channels(self) -> Sequence[str]:
        """See `Reader.channels`."""
        return self._names

    def sweep_s(self) -> float:
        """Seconds of a scan: for each channel relay, delay, integration, and autozero, which integrates once more."""
        nplc = self._options.nplc
        return len(self._names) * (_RELAY_S + settling_s(nplc) + 2 * nplc / self._line_hz)

    def prepare(self) -> None:
        """Set every channel, the scan list and the trigger, and read them back; learn the power line's frequency.

        Raises:
            InstrumentError: a command was refused.
            BadReply: a setting reads back as something else.

        """
        span, nplc = self._options.range_V, self._options.nplc
        volts = [name for name in self._names if self._options.channels[name] == "volts"]
        degrees = [name for name in self._names if name not in volts]
        commands: list[str] = []
        wanted: dict[str, float | str] = {}
        if volts:
            at = channel_list(volts)
            commands += [f"CONF:VOLT:DC {span:g},{at}", f"VOLT:DC:NPLC {nplc:g},{at}"]
            wanted |= {f"VOLT:DC:RANG? {at}": span, f"VOLT:DC:NPLC? {at}": nplc}
        for kind, ohms in THERMISTORS.items():
            alike = [name for name in degrees if self._options.channels[name] == kind]
            if alike:
                commands.append(f"CONF:TEMP THER,{ohms},{channel_list(alike)}")
        if degrees:
            at = channel_list(degrees)
            commands += [f"TEMP:NPLC {nplc:g},{at}", f"UNIT:TEMP C,{at}"]
            wanted |= {f"TEMP:NPLC? {at}": nplc, f"UNIT:TEMP? {at}": ",".join("C" * len(degrees))}
        everything = channel_list(self._names)
        listed = f"(@{','.join(self._names)})"
        block = f"#{len(str(len(listed)))}{len(listed)}{listed}"
        self._configure([*commands, f"ROUT:SCAN {everything}", "TRIG:SOUR IMM"])
        self._verify(wanted | {"ROUT:SCAN?": block, "TRIG:SOUR?": "IMM"})
        self._line_hz = self._asked_frequency()
        self._mark_prepared()

    def _asked_frequency(self) -> float:
        answer = self._line.query("SYST:LFR?")
        try:
            frequency = float(answer)
        except ValueError:
            frequency = 0.0
        if frequency not in FREQUENCIES:
            raise BadReply(f"{self._line.where}: the power line frequency should be 50 or 60 Hz, not {answer!r}")
        return frequency


def channel_list(names: Iterable[str]) -> str:
    """Channels as the scanner takes them, neighbours joined: (@101:103,105)."""
    runs: list[list[int]] = []
    for number in sorted(map(int, names)):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return f"(@{','.join(f'{run[0]}:{run[-1]}' if len(run) > 1 else str(run[0]) for run in runs)})"
