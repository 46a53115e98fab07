"""Twin of a meter that a bench file describes: its readings are the plant's, its commands the bench file's."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import ClassVar

from rig.sims.faults import Kind
from rig.sims.faults.reading_faults import OF_READINGS
from rig.sims.inputs import Inputs
from rig.sims.noise import event_at, normal
from rig.sims.twin import Accuracy, Role
from rig.sims.twins.keysight_meter import OVERLOAD, Plant
from rig.sims.twins.scpi import ScpiTwin, Wait
from rig.sims.twins.scpi_described import DescribedTwin, header, units
from rig.sims.twins.scpi_syntax import ScpiError, number
from rig.sims.world import World

_INPUT = "input"
_NOISE = 1e-6  # standard deviation of a reading, V


class DescribedMeterTwin(DescribedTwin):
    """The meter; its input is the plant's channel "input".

    Args:
        name: the bench's name for it.
        options: its options in the bench file.
        world: virtual time.
        plant: voltage at the input.
        serial: its serial number.
    """

    roles: ClassVar[frozenset[Role]] = frozenset({"reader"})
    faults: ClassVar[tuple[Kind, ...]] = (*OF_READINGS, *ScpiTwin.faults)

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Plant, serial: str) -> None:
        self.plant = plant
        # an open input wanders as a voltage; a counter without a signal, or a bridge without its thermometer, has none
        self.inputs = Inputs(OVERLOAD, told_open=not str(options.get("unit", "V")).endswith("V"))
        self._reading_s = float(str(options["reading_s"]))
        self._start = units(str(options.get("start") or ""))
        self._fetch = header(str(options.get("fetch", "READ?")))
        self._abort = units(str(options.get("abort") or ""))[0][0]
        self._span = float(str(options.get("overload", OVERLOAD)))
        self._most = int(str(options.get("most", 1000)))
        super().__init__(name, options, world, serial)

    def reset(self) -> None:
        """*RST: no readings."""
        super().reset()
        self._count, self._began = 1, -1.0
        self._taken: list[str] = []

    def device_clear(self) -> None:
        """Gives up readings under way."""
        super().device_clear()
        self._began = -1.0

    def accuracy(self, channel: str, unit: str) -> Accuracy:
        """Accuracy of readings of an input; `unit` is "V" or "degC"."""
        return Accuracy(6.0 * _NOISE + 1e-9)

    def busy_for(self) -> float:
        """Seconds until all readings are taken."""
        return 0.0 if self._began < 0 else max(0.0, self._began + self._count * self._reading_s - self.world.now())

    def does(self, name: str, rest: str) -> str | None:
        """Start, fetch and abort."""
        if name == self._abort and name:
            self._began = -1.0
            return None
        if name == self._fetch:
            return self._fetched() if self._start[0][0] else self._one()
        for position, (known, template) in enumerate(self._start):
            if name and name == known and not name.startswith("*"):
                self._told(template, rest)
                if position == len(self._start) - 1:
                    self._begin()
                return None
        return super().does(name, rest)

    def _told(self, template: str, rest: str) -> None:
        before, hole, after = template.partition("{count}")
        if not hole:
            if rest != template:
                raise ScpiError(-108)
            return
        count = number(rest.removeprefix(before).removesuffix(after))
        if not 1 <= count <= self._most:
            raise ScpiError(-222)
        self._count = round(count)

    def _begin(self) -> None:
        if self.busy_for() > 0:
            raise ScpiError(-213)
        self._began = self.world.now()
        self._taken.clear()

    def _fetched(self) -> str:
        if self._began < 0:
            raise ScpiError(-230)
        if (left := self.busy_for()) > 0:
            raise Wait(left)
        if not self._taken:  # they are kept until the next start
            self._taken = [self._reading(self._began + n * self._reading_s) for n in range(self._count)]
        return self.number(*self._taken)

    def _one(self) -> str:
        """A reading that is taken by its question."""
        if self._began < 0:
            self._count, self._began = 1, self.world.now()
        if (left := self.busy_for()) > 0:
            raise Wait(left)
        began, self._began = self._began, -1.0
        return self.number(self._reading(began))

    def _reading(self, t0: float) -> str:
        t1 = t0 + max(self._reading_s, 1e-6)
        noise = _NOISE * normal(self.plant.truth.seed, f"{self.name}/{_INPUT}/converter", event_at(t0))
        degC = self.plant.channel_degC(self.name, _INPUT, t1)  # of the thermometer that it reads, if it reads one
        found = (degC if isfinite(degC) else self.plant.channel_V(self.name, _INPUT, t0, t1)) + noise
        said = self.inputs.given(_INPUT, "V", t0, t1, found)
        return f"{said if abs(said) < self._span else OVERLOAD * (1 if said > 0 else -1):+.9E}"
