"""The Acme M7, simulated, with a fault that no other instrument has."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any, ClassVar

from rig.sims.faults import Kind, Option, Striking
from rig.sims.faults.instrument_faults import ERROR_QUEUE
from rig.sims.faults.reading_faults import OF_READINGS
from rig.sims.inputs import Inputs
from rig.sims.twin import Accuracy, Role
from rig.sims.twins.scpi import COMMON, ScpiTwin, Wait
from rig.sims.twins.scpi_syntax import Command, ScpiError, compiled, number
from rig.sims.world import World

_INPUTS = ("A", "B", "C", "T")
_OVERLOAD, _FULL_V = 9.9e37, 12.0


def _let_cool(striking: Striking) -> Callable[[], None]:
    twin, amount = striking.twin, striking.fault.number("amount_V")
    twin.offset_V = amount
    striking.note(f"the reference's oven is cold: readings are {amount:+g} V off until {striking.until:.3f} s")
    return lambda: setattr(twin, "offset_V", 0.0)


OVEN = Kind(
    "oven-cold",
    "The oven of the voltage reference goes cold: voltages are off, and the event register says so.",
    _let_cool,
    lasts_s=120.0,
    options={"amount_V": Option(0.01, "V", "how far off")},
)


class AcmeM7Twin(ScpiTwin):
    """The meter; `conditions` (text) of its options matters here."""

    commands = compiled(
        (
            *COMMON,
            Command("ABORt", set="abort"),
            Command("INITiate", set="initiate"),
            Command("FETCh", query="fetch"),
            Command("SAMPle:COUNt", set="set_count"),
            Command("SENSe:PERiod", set="set_period", query="ask_period"),
        )
    )
    errors: ClassVar[Mapping[int, str]] = {**ScpiTwin.errors, 7: "Nothing measured"}
    roles: ClassVar[frozenset[Role]] = frozenset({"reader"})
    faults: ClassVar[tuple[Kind, ...]] = (*OF_READINGS, ERROR_QUEUE, OVEN)

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Any, serial: str) -> None:
        self._serial = serial
        self.inputs = Inputs(_OVERLOAD, told_open=True)
        self.offset_V = 0.0
        self._cold = tomllib.loads(str(options["conditions"]))["conditions"]["oven_cold"]
        self._plant = plant
        super().__init__(name, world, baud=19200, frame="8N1")

    def switch_on(self) -> None:
        super().switch_on()
        self.remote = True

    def reset(self) -> None:
        self._period_s, self._count = 0.1, 1
        self.abort()

    def device_clear(self) -> None:
        super().device_clear()
        self.abort()

    def accuracy(self, channel: str, unit: str) -> Accuracy:
        return Accuracy(1e-9 if unit == "V" else 1e-6)

    def ask_identity(self) -> str:
        return f"ACME,M7,{self._serial},1.0"

    def abort(self) -> None:
        self._began: float | None = None

    def set_count(self, count: str) -> None:
        self._count = round(number(count))

    def set_period(self, seconds: str) -> None:
        self._period_s = number(seconds)

    def ask_period(self) -> str:
        return f"{self._period_s:.8E}"

    def initiate(self) -> None:
        self._began = self.world.now()

    def busy_for(self) -> float:
        if self._began is None:
            return 0.0
        return max(0.0, self._began + self._count * len(_INPUTS) * self._period_s - self.world.now())

    def fetch(self) -> str:
        if self._began is None:
            raise ScpiError(7)
        if (left := self.busy_for()) > 0.0:
            raise Wait(left)
        steps = range(self._count * len(_INPUTS))
        said = [self._reading(_INPUTS[n % len(_INPUTS)], self._began + n * self._period_s) for n in steps]
        self.abort()
        return ",".join(f"{value:+.8E}" for value in said)

    def _reading(self, channel: str, begin: float) -> float:
        self.questionable |= self._cold if self.offset_V else 0
        end = begin + self._period_s
        if channel == "T":
            unit, found = "degC", self._plant.channel_degC(self.name, channel, (begin + end) / 2.0)
        else:
            unit, found = "V", self._plant.channel_V(self.name, channel, begin, end) + self.offset_V
        said = self.inputs.given(channel, unit, begin, end, found)
        return said if isfinite(said) and abs(said) < _FULL_V * (10 if unit == "degC" else 1) else _OVERLOAD
