"""Instruments on simulated Modbus and CAN wires, on the real plant, for tests of drivers and twins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

from rig.drivers.cia402 import CiA402Pair
from rig.drivers.watlow_f4t import WatlowF4T
from rig.drivers.wires import Wires
from rig.sims.physics import Plant
from rig.sims.twins.cia402 import CiA402PairTwin
from rig.sims.twins.watlow_f4t import WatlowF4TTwin
from rig.sims.wires.can_line import CanCable
from rig.sims.wires.modbus_line import ModbusCable
from rig.sims.world import World

CONTRACTS = Path(__file__).parents[2] / "contracts"
EDS = (CONTRACTS / "cia402_drive.eds").read_text(encoding="utf-8")
REGISTER_MAP = (CONTRACTS / "watlow_f4t.toml").read_text(encoding="utf-8")

Driver = TypeVar("Driver")
Twin = TypeVar("Twin")


@dataclass
class Simulated(Generic[Driver, Twin]):
    """A driver, its twin, and what passed between them ("tx 06014041...").

    Attributes:
        make: a new driver, as another controller process would have: it knows nothing of the first.

    """

    make: Callable[[], Driver]
    twin: Twin
    world: World
    plant: Plant
    log: list[str]
    driver: Driver = field(init=False)

    def __post_init__(self) -> None:
        self.driver = self.make()

    def bytes_of(self, action: Callable[[], object]) -> list[str]:
        """What an action sends and hears."""
        self.log.clear()
        action()
        return list(self.log)


def oven(
    truth: dict[str, Any] | None = None, modbus_units: str = "F", wiring: str = "", **options: Any
) -> Simulated[WatlowF4T, WatlowF4TTwin]:
    """A chamber; its Modbus ports talk in `modbus_units`, and `wiring` powers it, as the options say if not given."""
    world = World()
    plant = Plant(world, truth or {}, {})
    given = {"register_map": REGISTER_MAP, **options}
    wired = {**given, "power": wiring} if wiring else given
    twin = WatlowF4TTwin("oven", wired, world, plant, "SN004711")
    twin.set_units(tcp=modbus_units, rtu=modbus_units)
    log: list[str] = []

    def make() -> WatlowF4T:
        factories = {"modbus": lambda address: ModbusCable(world, twin.on_rx)}
        wires = Wires(world, simulated=factories, tap=lambda name, way, data: log.append(f"{way} {data.hex()}"))
        return WatlowF4T("oven", "sim://w/oven", WatlowF4T.Options(**given), wires, world)

    return Simulated(make, twin, world, plant, log)


def head(truth: dict[str, Any] | None = None, **options: Any) -> Simulated[CiA402Pair, CiA402PairTwin]:
    world = World()
    plant = Plant(world, truth or {}, {})
    given = {"eds": EDS, **options}
    twin = CiA402PairTwin("head", given, world, plant, "SN004711")
    log: list[str] = []

    def make() -> CiA402Pair:
        factories = {"can": lambda address: CanCable(world, twin.on_frame)}
        wires = Wires(world, simulated=factories, tap=lambda name, way, data: log.append(f"{way} {data.hex()}"))
        return CiA402Pair("head", "sim://w/head", CiA402Pair.Options(**given), wires, world)

    return Simulated(make, twin, world, plant, log)


def without_objects(eds: str, *indices: int) -> str:
    """A data sheet whose drive has no such objects."""
    kept, keep = [], True
    for line in eds.splitlines():
        if line.startswith("["):
            keep = not any(line.upper().startswith(f"[{index:04X}") for index in indices)
        listed = line.partition("=")[2].upper().removeprefix("0X")
        if keep and not (line[:1].isdigit() and listed in {f"{index:04X}" for index in indices}):
            kept.append(line)
    return "\n".join(kept) + "\n"
