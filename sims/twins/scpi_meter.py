"""Twin of a meter that a bench file describes: its readings are the plant's, its commands the bench file's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from rig.contracts.declared.roles import Reader
from rig.sims.faults import Kind
from rig.sims.faults.reading_faults import OF_READINGS
from rig.sims.twin import Accuracy, Role
from rig.sims.twins.scpi_described import DescribedTwin
from rig.sims.world import World

_PLAIN = ("unit", "reading_s", "most", "overload")
"""Options that are keys of a reader."""


class DescribedMeterTwin(DescribedTwin):
    """A meter; its input is the plant's channel "input". Arguments as for `DescribedTwin`."""

    roles: ClassVar[frozenset[Role]] = frozenset({"reader"})
    faults: ClassVar[tuple[Kind, ...]] = (*OF_READINGS, *DescribedTwin.faults)

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Any, serial: str) -> None:
        super().__init__(name, {"fetch": "READ?", **options}, world, plant, serial)

    def role(self, options: Mapping[str, object]) -> dict[str, Any]:
        """Its reader, as a table has it."""
        given = {"unit": "V", "most": 1000} | {key: options[key] for key in _PLAIN if key in options}
        return {"reader": Reader.model_validate(given)}

    def device_clear(self) -> None:
        """Gives up readings under way."""
        super().device_clear()
        self.done("reader.abort")

    def accuracy(self, channel: str, unit: str) -> Accuracy:
        """Accuracy of readings of an input; `unit` is "V" or "degC"."""
        return self.it.accuracy(channel, unit)
