"""A simulated bench: the true physical state, and a twin for every instrument of a bench file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any
from zlib import crc32

from rig.sims.faults import Faults, FaultyWire, read_faults
from rig.sims.physics import Plant, read_truth, sensor_axes
from rig.sims.physics.truth import FAULTS
from rig.sims.tape import Change, Readback, Reading, Tape
from rig.sims.twin import Changing, MakesTwins
from rig.sims.wires.can_line import CanCable
from rig.sims.wires.modbus_line import ModbusCable, ModbusEndpoint, registers_of
from rig.sims.wires.serial_line import SerialCable, register, unregister
from rig.sims.world import EPOCH_UTC, World

_OF_THE_BENCH = frozenset({"driver", "address", "asset", "due", "serial"})
"""Keys of an `[instruments.NAME]` table that belong to the bench; the rest are options of driver and twin."""


def serial_number(bench: str, instrument: str) -> str:
    """The serial number of a twin: always the same for the same bench and instrument."""
    return f"SN{crc32(f'{bench}/{instrument}'.encode()) % 1_000_000:06d}"


def world_for(bench: Mapping[str, Any], truth: Mapping[str, Any], start: float = 0.0) -> World:
    """The virtual time of a world file.

    Args:
        bench: the bench file as plain values.
        truth: the world file as plain values; its `epoch` is UTC at virtual time zero.
        start: first value of `now()`, seconds.

    Raises:
        rig.sims.physics.WorldError: the world file is wrong.
    """
    epoch = read_truth(truth, sensor_axes(bench)).epoch
    return World(start, EPOCH_UTC if epoch is None else epoch)


class SimBench:
    """The twins of all instruments of a bench, on one plant.

    Args:
        world: virtual time.
        bench: the bench file as plain values.
        truth: the world file as plain values; its `faults` are the planned faults.
        key: name of this world in `sim://KEY/INSTRUMENT` addresses.
        twin_classes: twin class by driver name.
        record_tape: keep the true events, for checkers.
        heard: called with each true event at once; see `rig.sims.tape.Tape`.

    Attributes:
        tape: the true events; None unless recorded.
        plant: the physical state.
        cables: serial cables by instrument.
        faults: the planned faults, and those that have happened.
        steps: number of changes that a person has made.

    Raises:
        rig.sims.physics.WorldError: the world file is wrong.
    """

    def __init__(
        self,
        world: World,
        bench: Mapping[str, Any],
        truth: Mapping[str, Any],
        key: str,
        twin_classes: Mapping[str, MakesTwins],
        *,
        record_tape: bool = False,
        heard: Callable[[Reading | Readback | Change], None] | None = None,
    ) -> None:
        self.world = world
        heads = [name for name, one in bench["instruments"].items() if "head" in twin_classes[one["driver"]].roles]
        self.plant = Plant(world, truth, bench, heads)
        self._key, self.steps = key, 0
        self._twins: dict[str, Any] = {}
        for name, instrument in bench["instruments"].items():
            options = {k: v for k, v in instrument.items() if k not in _OF_THE_BENCH}
            serial = instrument.get("serial") or serial_number(bench["name"], name)
            twin = twin_classes[instrument["driver"]](name, options, world, self.plant, serial)
            self._twins[name] = twin
        self.faults = Faults(self, read_faults(truth.get(FAULTS), self._twins))
        taped = record_tape or heard is not None
        self.tape = Tape(world, self.plant, self._twins, heard) if taped else None
        self._addresses = {name: str(instrument["address"]) for name, instrument in bench["instruments"].items()}
        self.cables = {
            n: SerialCable(world, twin, self.wire(n), timed=not self._addresses[n].startswith(("socket:", "visa:")))
            for n, twin in self._twins.items()
            if twin.wire == "serial"
        }
        for name, cable in self.cables.items():
            register(f"{key}/{name}", cable)

    def transports(self) -> Mapping[str, Callable[[str], object]]:
        """Simulated wires that are not serial, by kind: factories that take a `sim://` address."""
        return {
            "modbus": self._modbus,
            "can": self._can,
        }

    def _modbus(self, address: str) -> ModbusCable:
        name = self._at(address)
        registers = registers_of(self._twins[name], self._addresses[name])
        endpoint = ModbusEndpoint(self.world, {1: registers})  # TCP framing on every port
        return ModbusCable(self.world, endpoint.on_rx, self.wire(name))

    def _can(self, address: str) -> CanCable:
        name = self._at(address)
        twin = self._twins[name]
        return CanCable(self.world, twin.on_frame, self.wire(name), getattr(twin, "connected", None))

    def _at(self, address: str) -> str:
        key, _, name = address.removeprefix("sim://").partition("/")
        if key != self._key or name not in self._twins:
            raise LookupError(f"there is no simulated instrument at {address}")
        return name

    def wire(self, name: str) -> FaultyWire:
        """The wire of one instrument, with its faults."""
        return self.faults.wires[name]

    def twin(self, name: str) -> Any:
        """The twin of one instrument."""
        return self._twins[name]

    @property
    def twins(self) -> Mapping[str, Any]:
        """All twins by the bench's names."""
        return dict(self._twins)

    def by_hand(self, change: str, number: float | None = None) -> None:
        """A person changes the bench by hand: the plant, and every twin that can be changed (`rig.sims.twin.Changing`).

        Args:
            change: the word of the procedure file.
            number: the number that the person states; None for none.
        """
        self.steps += 1
        self.plant.by_hand(change)
        for twin in self._twins.values():
            if isinstance(twin, Changing):
                twin.by_hand(change, number)

    def reads(self, instrument: str, channel: str) -> float:
        """Reading of a person at one of their channels, a glance of a second: degC, or as `Plant.channel_V`."""
        now = self.world.now()
        degC = self.plant.channel_degC(instrument, channel, now)
        return degC if isfinite(degC) else self.plant.channel_V(instrument, channel, now - 1.0, now)

    def power_cycle(self) -> None:
        """Switch every instrument off and on; the plant does not change."""
        for twin in self._twins.values():
            twin.power_cycle()

    def close(self) -> None:
        """Remove the addresses."""
        for name in self.cables:
            unregister(f"{self._key}/{name}")
