"""Twin of a source that a bench file describes: it moves the plant's source, its commands are the bench file's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Protocol

from rig.sims.faults import Kind
from rig.sims.twin import Role
from rig.sims.twins.scpi import ScpiTwin
from rig.sims.twins.scpi_described import DescribedTwin, header, units
from rig.sims.twins.scpi_syntax import ScpiError, number
from rig.sims.world import World


class Quantity(Protocol):
    """Parts of the plant's source that the twin uses."""

    on: bool
    setpoint: float

    def set(self, now: float, value: float) -> None:
        """Command a value, with the output on."""
        ...

    def off(self, now: float) -> None:
        """Switch off."""
        ...

    def reads(self, t: float) -> float:
        """Its own readback."""
        ...

    def settled(self, t: float, within: float) -> bool:
        """Whether it is within this of its setting."""
        ...


class Plant(Protocol):
    """Parts of the plant that the twin uses."""

    def source(self, instrument: str) -> Quantity:
        """The quantity behind a source of the bench."""
        ...


class DescribedSourceTwin(DescribedTwin):
    """The source.

    Args:
        name: the bench's name for it.
        options: its options in the bench file.
        world: virtual time.
        plant: has `source`.
        serial: its serial number.
    """

    roles: ClassVar[frozenset[Role]] = frozenset({"source"})
    faults: ClassVar[tuple[Kind, ...]] = (*ScpiTwin.faults,)

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Plant, serial: str) -> None:
        self.quantity = plant.source(name)
        self._low, self._high = (float(str(options[key])) for key in ("low", "high"))
        self._within = float(str(options.get("tolerance") or (self._high - self._low) * 1e-6))
        self._words = {key: units(str(options.get(key) or ""))[0] for key in ("set", "on", "off")}
        self._asks = {key: header(str(options.get(key) or "")) for key in ("setpoint", "read", "output", "settled")}
        self._bit = int(str(options.get("settled_bit", 0)))
        super().__init__(name, options, world, serial)

    def reset(self) -> None:
        """*RST and power-on: off, at zero."""
        super().reset()
        self._setpoint = 0.0
        if self.quantity.on:
            self.quantity.off(self.world.now())

    def does(self, name: str, rest: str) -> str | None:
        """Setpoint, output, readings."""
        if not name:
            raise KeyError(name)
        words, now = self._words, self.world.now()
        if name == words["on"][0] and rest == words["on"][1]:
            self.quantity.set(now, self._setpoint)
            return None
        if name == words["off"][0] and rest == words["off"][1]:
            self.quantity.off(now)
            return None
        if name == words["set"][0]:
            self._set(rest)
            return None
        if name == self._asks["setpoint"]:
            return self.number(f"{self._setpoint:.9E}")
        if name == self._asks["read"]:
            return self.number(f"{self.quantity.reads(now):.9E}")
        if name == self._asks["output"]:
            return str(int(self.quantity.on))
        if name == self._asks["settled"]:
            return str(int(self.quantity.settled(now, self._within)) << self._bit)
        return super().does(name, rest)

    def _set(self, rest: str) -> None:
        before, _, after = self._words["set"][1].partition("{value}")
        if not (rest.startswith(before) and rest.endswith(after)):
            raise ScpiError(-104)
        value = number(rest[len(before) : len(rest) - len(after)])
        if not self._low - 1e-9 <= value <= self._high + 1e-9:
            raise ScpiError(-222)
        self._setpoint = value
        if self.quantity.on or not self._words["on"][0]:
            self.quantity.set(self.world.now(), value)
