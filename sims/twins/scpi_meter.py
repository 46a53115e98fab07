"""Twin of a meter that a bench file describes: its readings are the plant's, its commands the bench file's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from rig.contracts.declared.roles import Reader
from rig.sims.faults import Kind
from rig.sims.faults.reading_faults import OF_READINGS
from rig.sims.twin import Accuracy, Role
from rig.sims.twins.scpi import ScpiTwin, Wait
from rig.sims.twins.scpi_described import DescribedTwin, header, units
from rig.sims.twins.scpi_syntax import ScpiError, number
from rig.sims.world import World

_PLAIN = ("unit", "reading_s", "most", "overload")
"""Options that are keys of a reader."""


class DescribedMeterTwin(DescribedTwin):
    """The meter; its input is the plant's channel "input". Arguments as for `DescribedTwin`."""

    roles: ClassVar[frozenset[Role]] = frozenset({"reader"})
    faults: ClassVar[tuple[Kind, ...]] = (*OF_READINGS, *ScpiTwin.faults)

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Any, serial: str) -> None:
        self._start = units(str(options.get("start") or ""))
        self._fetch = header(str(options.get("fetch", "READ?")))
        self._abort = units(str(options.get("abort") or ""))[0][0]
        super().__init__(name, options, world, plant, serial)

    def role(self, options: Mapping[str, object]) -> dict[str, Any]:
        """Its reader, as a table has it."""
        given = {"unit": "V", "most": 1000} | {key: options[key] for key in _PLAIN if key in options}
        return {"reader": Reader.model_validate(given)}

    def reset(self) -> None:
        """*RST: no readings."""
        super().reset()
        self._count = 1

    def device_clear(self) -> None:
        """Gives up readings under way."""
        super().device_clear()
        self.done("reader.abort")

    def accuracy(self, channel: str, unit: str) -> Accuracy:
        """Accuracy of readings of an input; `unit` is "V" or "degC"."""
        return self.it.accuracy(channel, unit)

    def busy_for(self) -> float:
        """Seconds until all readings are taken."""
        return self.it.busy_for()

    def does(self, name: str, rest: str) -> str | None:
        """Start, fetch and abort."""
        if name == self._abort and name:
            self.done("reader.abort")
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
        if not 1 <= count <= self.it.most:
            raise ScpiError(-222)
        self._count = round(count)

    def _begin(self) -> None:
        if self.busy_for() > 0:
            raise ScpiError(-213)
        self.done("reader.start", count=float(self._count))

    def _fetched(self) -> str:
        if not self.it.begun:
            raise ScpiError(-230)
        said = self.told("reader.fetch")  # readings are kept until the next start
        if said.after_s > 0:
            raise Wait(said.after_s)
        readings: Any = said.fields["values"]
        return self.number(*(f"{one:+.9E}" for one in readings))

    def _one(self) -> str:
        """A reading that is taken by its question."""
        if not self.it.begun:
            self.done("reader.start", count=1.0)
        found = self._fetched()
        self.done("reader.abort")
        return found
