"""Acme M7: three voltage inputs A, B, C and a thermometer T, on a serial line: a file, and what no key of it says."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from pydantic import Field

from rig.contracts.declared.exchanges import Ask
from rig.drivers.clock import Clock
from rig.drivers.declared import driver_of
from rig.drivers.driver import ContractFile
from rig.drivers.errors import InstrumentError
from rig.drivers.wires import Wires

_FILE: Any = driver_of(
    """
maker = "ACME"
model = "M7"
scpi = true
parameters = { period_s = 0.1 }
formulas = { reading_s = "4 * period_s" }
prepare = ["*RST", "*CLS", "SENS:PER {period_s}"]
check = [{ ask = "SENS:PER?", is = "{period_s}" }]
[wire]
baud = 19200
[errors]
ask = "SYST:ERR?"
each = false
[reader]
unit = "V"
channels = { A = {}, B = {}, C = {}, T = { unit = "degC" } }
start = "*SRE {mark:d};:SAMP:COUN {count:d};:INIT"
fetch = { ask = "FETC?;*SRE?", answer = "{values:+.8e2};{mark:d}" }
abort = "ABOR"
most = 1000
""",
    own=False,
)
_EVENTS = Ask(ask="STAT:QUES?")


class AcmeM7(_FILE):
    """The meter; satisfies `rig.drivers.roles.Reader`."""

    contracts: ClassVar[tuple[ContractFile, ...]] = (ContractFile("conditions", "acme_rig", "m7_conditions.toml"),)

    class Options(_FILE.Options):
        """What the bench file may say about this instrument."""

        conditions: str = Field(description="what the bits of its event register mean")

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self._conditions = tomllib.loads(options.conditions)["conditions"]
        super().__init__(name, address, options, wires, clock)

    def fetch(self) -> Mapping[str, Sequence[float]]:
        """Readings, but none taken while something was wrong, which its event register keeps until it is asked."""
        readings: Mapping[str, Sequence[float]] = super().fetch()
        found = int(self._talk.once(_EVENTS, repeat=False).value)
        for name, bit in self._conditions.items():
            if found & bit:
                raise InstrumentError(self._where, bit, name.replace("_", " "))
        return readings
