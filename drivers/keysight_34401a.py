"""HP/Agilent/Keysight 34401A voltmeter on its serial interface, DC volts.

Commands from the 34401A user's guide (34401-90004). The factory setting of its serial interface is 9600 baud, seven
bits, even parity, two stop bits. What meters have in common: `drivers/scpi.py`; the twin:
`sims/twins/keysight_34401a.py`; where both are registered: `drivers/__init__.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field

from rig.drivers.clock import Clock
from rig.drivers.driver import ContractFile, Medium
from rig.drivers.scpi import SYNC, Interface, Nplc, ScpiMeter, hp_dialect, one_of, settling_s
from rig.drivers.wires import SerialOptions, SerialSettings, Wires

_MEMORY = 512  # readings (user's guide)


class Keysight34401A(ScpiMeter):
    """The voltmeter; satisfies `rig.drivers.roles.Reader` with one channel, "input".

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

        baud: Literal[300, 600, 1200, 2400, 4800, 9600] = Field(9600, description="symbols per second")
        frame: Literal["7E2", "7O2", "8N2", "8N1"] = Field("7E2", description="data bits, parity, stop bits")
        interface: Interface = Field("rs232", description="rs232, also behind a serial server, or gpib")
        nplc: Nplc = Field(10, description="integration time, power line cycles")
        line_Hz: Literal[50, 60] = Field(50, description="power line frequency, the unit of its integration time")
        range_V: Annotated[float, AfterValidator(one_of(0.1, 1, 10, 100, 1000))] = Field(
            10, description="measuring range"
        )

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self.name = name
        self._options = options
        settings = SerialSettings(
            options.baud, options.frame, options.flow_at(address), send_end=options.send_end, timeout_s=2.0, sync=SYNC
        )
        dialect = hp_dialect(options.interface, clear_with_dtr=True)  # user's guide, page 151
        super().__init__(wires.serial(address, settings, name), clock, "34401A", dialect)

    @property
    def most_sweeps(self) -> int:
        """At most 512 readings."""
        return _MEMORY

    def channels(self) -> Sequence[str]:
        """Channel labels in scan order; a single-input meter has one channel, "input"."""
        return ("input",)

    def sweep_s(self) -> float:
        """Duration of a reading, seconds: automatic delay, integration, and autozero, which is a second integration."""
        return settling_s(self._options.nplc) + 2 * self._options.nplc / self._options.line_Hz

    def prepare(self) -> None:
        """Set range, integration time and trigger, and read them back.

        Raises:
            InstrumentError: a command was refused.
            BadReply: a setting reads back differently.
        """
        span, nplc = self._options.range_V, self._options.nplc
        self._configure(
            (f"CONF:VOLT:DC {span:g}", f"VOLT:DC:NPLC {nplc:g}", "ZERO:AUTO ON", "TRIG:SOUR IMM", "SAMP:COUN 1")
        )
        self._verify(
            {
                "FUNC?": '"VOLT"',
                "VOLT:DC:RANG?": span,
                "VOLT:DC:RANG:AUTO?": "0",
                "VOLT:DC:NPLC?": nplc,
                "ZERO:AUTO?": "1",
                "TRIG:SOUR?": "IMM",
                "SAMP:COUN?": 1.0,
            }
        )
        self._mark_prepared()
