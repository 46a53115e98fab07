"""The twin of a person who sets factors by hand: nothing. `rig.simulated.person` does what is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from rig.sims.fault import Kind
from rig.sims.twin import Medium, Role
from rig.sims.world import World


class PersonTwin:
    """Somebody at the simulated bench."""

    wire: ClassVar[Medium] = "none"
    roles: ClassVar[frozenset[Role]] = frozenset()
    faults: ClassVar[tuple[Kind, ...]] = ()

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: object, serial: str) -> None:
        self.name = name

    def power_cycle(self) -> None:
        """People have no power switch."""
