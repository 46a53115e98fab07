"""Twin of a source that a bench file describes: it moves the plant's source, its commands are the bench file's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from rig.contracts.declared.exchanges import Tell
from rig.contracts.declared.roles import Source
from rig.sims.faults import Kind
from rig.sims.twin import Role
from rig.sims.twins.scpi import ScpiTwin
from rig.sims.twins.scpi_described import DescribedTwin, header, units
from rig.sims.twins.scpi_syntax import ScpiError, number
from rig.sims.world import World


class DescribedSourceTwin(DescribedTwin):
    """The source. Arguments as for `DescribedTwin`."""

    roles: ClassVar[frozenset[Role]] = frozenset({"source"})
    faults: ClassVar[tuple[Kind, ...]] = (*ScpiTwin.faults,)

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Any, serial: str) -> None:
        self._words = {key: units(str(options.get(key) or ""))[0] for key in ("set", "on", "off")}
        self._asks = {header(str(options.get(key) or "")): key for key in ("settled", "output", "read", "setpoint")}
        self._bit = int(str(options.get("settled_bit", 0)))
        super().__init__(name, options, world, plant, serial)
        self.quantity = self.it.quantity

    def role(self, options: Mapping[str, object]) -> dict[str, Any]:
        """Its source, as a table has it."""
        low, high = (float(str(options[key])) for key in ("low", "high"))
        within = float(str(options.get("tolerance") or (high - low) * 1e-6))
        on = (Tell(tell=self._words["on"][0]),) if self._words["on"][0] else ()
        return {"source": Source.model_construct(low=low, high=high, tolerance=within, on=on)}

    def does(self, name: str, rest: str) -> str | None:
        """Setpoint, output, readings."""
        if not name:
            raise KeyError(name)
        for key in ("on", "off"):
            if (name, rest) == self._words[key]:
                self.done(f"source.{key}")
                return None
        if name == self._words["set"][0]:
            self._set(rest)
            return None
        key = self._asks.get(name, "")
        if key in ("setpoint", "read"):
            return self.number(f"{self.told(f'source.{key}').value:.9E}")
        if key in ("output", "settled"):
            return str(int(self.told(f"source.{key}").value) << (self._bit if key == "settled" else 0))
        return super().does(name, rest)

    def _set(self, rest: str) -> None:
        before, _, after = self._words["set"][1].partition("{value}")
        if not (rest.startswith(before) and rest.endswith(after)):
            raise ScpiError(-104)
        self.done("source.set", value=number(rest[len(before) : len(rest) - len(after)]))
