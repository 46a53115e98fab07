"""Agilent/Keysight 34970A scanner on its serial interface: DC volts and thermometers through a 34901A multiplexer.

Commands from the 34970A/34972A Command Reference, version 2.00. The scanner scans its channels in ascending order,
whatever the order of the scan list.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, ClassVar, Literal, Self, get_args

from pydantic import AfterValidator, Field, model_validator

from rig.drivers.clock import Clock
from rig.drivers.driver import ContractFile, Medium
from rig.drivers.errors import BadReply
from rig.drivers.numbers import decimal
from rig.drivers.scpi import FREQUENCIES, INTERFACE, SYNC, Interface, ScpiMeter, hp_dialect, one_of, settling_s
from rig.drivers.wires import SerialOptions, SerialSettings, Wires
from rig.drivers.wires.serial_options import FLOW, Flow

Thermometer = Literal[
    "thermistor-2.2k",
    "thermistor-5k",
    "thermistor-10k",
    "rtd-2w-385",
    "rtd-2w-391",
    "rtd-4w-385",
    "rtd-4w-391",
]
TRANSDUCERS: Mapping[Thermometer, tuple[str, int]] = {
    "thermistor-2.2k": ("THER", 2252),
    "thermistor-5k": ("THER", 5000),
    "thermistor-10k": ("THER", 10000),
    "rtd-2w-385": ("RTD", 85),
    "rtd-2w-391": ("RTD", 91),
    "rtd-4w-385": ("FRTD", 85),
    "rtd-4w-391": ("FRTD", 91),
}
"""Types of thermometers that it linearises.

Thermistors 44004, 44007 and 44006 by their resistance at 25 degrees Celsius, from -80 to 150 degrees Celsius. Platinum
of 100 ohms by its alpha, 0.00385 or 0.00391, on two or four wires, from -200 to 600 degrees Celsius. Outside these
ranges the reading is an overload.
"""

_MEMORY = 50_000  # readings (Command Reference)
_RELAY_S = 0.0167  # 60 channels a second with a 34901A

_RTD_OHMS = 100.0  # at 0 degC, the scanner's default: it is only read back

ChannelName = Annotated[str, Field(pattern=r"^[123](0[1-9]|1[0-9]|20)$")]
VoltsRange = Annotated[float, AfterValidator(one_of(0.1, 1, 10, 100))]


class Keysight34970A(ScpiMeter):
    """The scanner; satisfies `rig.drivers.roles.Reader`.

    Args:
        name: the bench's name for it.
        address: serial address.
        options: see `Options`.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the address cannot be opened.

    """

    wire: ClassVar[Medium] = "serial"
    contracts: ClassVar[tuple[ContractFile, ...]] = ()

    class Options(SerialOptions):
        """Options of this instrument in the bench file."""

        channels: dict[ChannelName, Literal["volts"] | Thermometer] = Field(
            min_length=1, max_length=60, description="sensor by channel: slot 1 to 3, channel 01 to 20"
        )
        baud: Literal[1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200] = Field(
            9600, description="symbols per second"
        )
        frame: Literal["8N1", "7E1", "7O1"] = Field("8N1", description="data bits, parity, stop bits")
        flow: Flow = Field("xonxoff", description=FLOW)
        interface: Interface = Field("rs232", description=INTERFACE)
        nplc: Annotated[float, AfterValidator(one_of(0.02, 0.2, 1, 2, 10, 20, 100, 200))] = Field(
            10, description="integration time, power line cycles"
        )
        range_V: VoltsRange = Field(10, description="measuring range of the volts channels")
        ranges: dict[ChannelName, VoltsRange] = Field({}, description="measuring ranges of individual volts channels")

        @model_validator(mode="after")
        def _wired(self) -> Self:
            for name, kind in self.channels.items():
                if not kind.startswith("rtd-4w"):
                    continue
                partner = str(int(name) + 10)
                if int(name[1:]) > 10:
                    raise ValueError(f"{name}: four wires go to channel 01 to 10 of a slot, and to the one 10 above it")
                if partner in self.channels:
                    raise ValueError(f"{partner} carries the other two wires of {name} and cannot be a channel")
            for name in self.ranges:
                if self.channels.get(name) != "volts":
                    raise ValueError(f"ranges: {name} is not a volts channel")
            return self

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self.name = name
        self._options = options
        self._names = tuple(sorted(options.channels))
        self._line_hz = FREQUENCIES[0]
        settings = SerialSettings(
            options.baud, options.frame, options.flow_at(address), send_end=options.send_end, timeout_s=2.0, sync=SYNC
        )
        super().__init__(wires.serial(address, settings, name), clock, "34970A", hp_dialect(options.interface))

    @property
    def most_sweeps(self) -> int:
        """At most 50,000 readings."""
        return _MEMORY // len(self._names)

    def channels(self) -> Sequence[str]:
        """Channel labels in scan order; a single-input meter has one channel, "input"."""
        return self._names

    def sweep_s(self) -> float:
        """Duration of a scan, seconds: relay, delay, integration and autozero (a second integration) of each
        channel.
        """
        nplc = self._options.nplc
        return len(self._names) * (_RELAY_S + settling_s(nplc) + 2 * nplc / self._line_hz)

    def prepare(self) -> None:
        """Set every channel, the scan list and the trigger, and read them back; read the power line's frequency.

        Raises:
            InstrumentError: a command was refused.
            BadReply: a setting reads back differently.
        """
        options, nplc = self._options, self._options.nplc
        commands: list[str] = []
        wanted: dict[str, float | str] = {}
        spans = {c: options.ranges.get(c, options.range_V) for c in self._names if options.channels[c] == "volts"}
        for span in sorted(set(spans.values())):
            at = channel_list(c for c in spans if spans[c] == span)
            commands += [f"CONF:VOLT:DC {span:g},{at}", f"VOLT:DC:NPLC {nplc:g},{at}"]
            wanted |= {f"VOLT:DC:RANG? {at}": span, f"VOLT:DC:NPLC? {at}": nplc}
        for kind in get_args(Thermometer):
            alike = [name for name in self._names if options.channels[name] == kind]
            if alike:
                family, type_ = TRANSDUCERS[kind]
                at = channel_list(alike)
                commands.append(f"CONF:TEMP {family},{type_},{at}")
                wanted |= {f"TEMP:TRAN:TYPE? {at}": ",".join([family] * len(alike))}
                wanted |= {f"TEMP:TRAN:{family}:TYPE? {at}": float(type_)}
                if family.endswith("RTD"):
                    wanted |= {f"TEMP:TRAN:{family}:RES? {at}": _RTD_OHMS}
        degrees = [name for name in self._names if name not in spans]
        if degrees:
            at = channel_list(degrees)
            commands += [f"TEMP:NPLC {nplc:g},{at}", f"UNIT:TEMP C,{at}"]
            wanted |= {f"TEMP:NPLC? {at}": nplc, f"UNIT:TEMP? {at}": ",".join("C" * len(degrees))}
        everything = channel_list(self._names)
        # It answers its scan list as a block of stated length (IEEE 488.2): #, digits of the length, length, text.
        listed = f"(@{','.join(self._names)})"
        block = f"#{len(str(len(listed)))}{len(listed)}{listed}"
        self._configure([*commands, f"ROUT:SCAN {everything}", "TRIG:SOUR IMM"])
        self._verify(wanted | {"ROUT:SCAN?": block, "TRIG:SOUR?": "IMM"})
        self._line_hz = self._asked_frequency()
        self._mark_prepared()

    def _asked_frequency(self) -> float:
        answer = self._line.query("SYST:LFR?")
        try:
            frequency = decimal(answer)
        except ValueError:
            frequency = 0.0
        if frequency not in FREQUENCIES:
            raise BadReply(f"{self._line.where}: the power line frequency should be 50 or 60 Hz, not {answer!r}")
        return frequency


def channel_list(names: Iterable[str]) -> str:
    """Channels in the scanner's notation, neighbours joined: (@101:103,105)."""
    runs: list[list[int]] = []
    for number in sorted(map(int, names)):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return f"(@{','.join(f'{run[0]}:{run[-1]}' if len(run) > 1 else str(run[0]) for run in runs)})"
