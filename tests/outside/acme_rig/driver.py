"""Acme M7: three voltage inputs A, B, C and a thermometer T, on a serial line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import ClassVar

from pydantic import Field

from rig.drivers.clock import Clock
from rig.drivers.driver import ContractFile, Medium
from rig.drivers.errors import InstrumentError
from rig.drivers.numbers import whole
from rig.drivers.scpi import Dialect, ScpiMeter
from rig.drivers.wires import SerialOptions, SerialSettings, Wires

_DIALECT = Dialect(start="SAMP:COUN {count};:INIT", reading=re.compile(r"[+-]\d\.\d{8}E[+-]\d\d", re.ASCII))


class AcmeM7(ScpiMeter):
    """The meter; satisfies `rig.drivers.roles.Reader`."""

    wire: ClassVar[Medium] = "serial"
    contracts: ClassVar[tuple[ContractFile, ...]] = (ContractFile("conditions", "acme_rig", "m7_conditions.toml"),)

    class Options(SerialOptions):
        """What the bench file may say about this instrument."""

        conditions: str = Field(description="what the bits of its event register mean")
        period_ms: int = Field(100, ge=20, le=1000, description="how long each input is read")

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self._period_s = options.period_ms * 1e-3
        self._conditions = tomllib.loads(options.conditions)["conditions"]
        settings = SerialSettings(19200, "8N1", send_end=options.send_end, timeout_s=2.0, sync=("SYST:VERS?", "19"))
        line = wires.serial(address, settings, name)
        super().__init__(line, clock, "M7", _DIALECT)

    @property
    def most_sweeps(self) -> int:
        return 1000

    def channels(self) -> Sequence[str]:
        return ("A", "B", "C", "T")

    def sweep_s(self) -> float:
        return 4 * self._period_s

    def prepare(self) -> None:
        self._configure((f"SENS:PER {self._period_s:g}",))
        self._verify({"SENS:PER?": self._period_s})
        self._mark_prepared()

    def fetch(self) -> Mapping[str, Sequence[float]]:
        """Readings, but none taken while something was wrong, which its event register keeps until it is asked."""
        readings = super().fetch()
        question = "STAT:QUES?"
        answer = self._line.query(question, repeat=False)
        try:
            found = whole(answer)
        except ValueError:
            raise self._line.bad_reply(question, answer, "a number") from None
        for name, bit in self._conditions.items():
            if found & bit:
                raise InstrumentError(self._line.where, bit, name.replace("_", " "))
        return readings
