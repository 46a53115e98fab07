"""A bench of ideal pressure instruments under virtual time, for tests of whole plots alone: no wires, no bytes.

Chambers and pressure follow their setpoints at a constant rate. Their state lives outside a session, so that a test
can let a bench stand, drift or lose its power between two of them. Faults are planted by overwriting methods.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rig.bench.config import BenchConfig
from rig.drivers.roles import ChamberState, Identity, PressureState
from rig.engine.sequencer import Sequencer
from rig.engine.session import Outcome, Session, Signals
from rig.instruments.opening import Bench
from rig.procedures.pressure.settings import WholePlotProcedure
from rig.run_file.state.state import RunState, fold
from rig.run_file.write.creation import Genesis, create
from rig.run_file.write.writer import RunWriter
from rig.sims.world import World

CONFIG = BenchConfig.model_validate(
    {
        "name": "ideal",
        "instruments": {
            name: {"driver": "ideal", "address": "nowhere"} for name in ("supply", "hot_box", "cold_box", "dvm")
        },
        "factors": {
            "pressure_psia": "supply",
            "sensor_temperature_degC": "cold_box",
            "sse_temperature_degC": "hot_box",
        },
        "sensors": {"bridge": {"reader": "dvm", "channel": "1", "unit": "mV"}},
        "temperatures": {"sensor_temperature_degC": {"reader": "dvm", "channel": "2", "place": "sensors"}},
        "limits": {"pressure_psia": [0, 15.5], "cold_box_degC": [-140, 40], "hot_box_degC": [-60, 60]},
    }
)

PROCEDURE = WholePlotProcedure.model_validate(
    {
        "kind": "whole-plot",
        "name": "small",
        "seed": 4,
        "design": {
            "type": "list",
            "temperatures_degC": [[-60, 0], [-50, 10], [-60, 0]],
            "pressures_psia": [0.01, 1.0, 2.5, 5.0],
            "repeated_psia": [2.5],
        },
        "soak": {"dwell_s": 60, "poll_s": 10},
        "settle": {"dwell_s": 2},
        "measure": {"readings": 2},
    }
)
IN_ALL = 15
EACH = 5


class _Ideal:
    def __init__(self, world: World, name: str) -> None:
        self.world, self.name = world, name
        self.power_was_off = False
        self.safe = 0

    def identify(self) -> Identity:
        return Identity("ideal", self.name, self.name, "1")

    def prepare(self) -> None:
        self.power_was_off = False

    def make_safe(self) -> None:
        self.safe += 1

    def close(self) -> None:
        pass


class _Follower(_Ideal):
    """A quantity that goes to its setpoint at a constant rate."""

    rate = 1.0

    def __init__(self, world: World, name: str, value: float) -> None:
        super().__init__(world, name)
        self.setpoint = self._from = value
        self._began = 0.0
        self.on = False
        self.sent: list[float] = []
        self.offset = 0.0

    def value(self) -> float:
        gone = self.rate * (self.world.now() - self._began)
        way = self.setpoint - self._from
        return self.offset + (self.setpoint if gone >= abs(way) else self._from + math.copysign(gone, way))

    def command(self, value: float) -> None:
        self._from = self.value() - self.offset
        self.setpoint, self._began, self.on = value, self.world.now(), True
        self.sent.append(value)

    def stop(self) -> None:
        self.command(self.value())

    def carry_over(self, world: World) -> None:
        """The same thing at the beginning of another session."""
        self.world = world
        self._from, self._began = self.setpoint, 0.0


class IdealSupply(_Follower):
    rate = 0.5
    venting = False

    def limits(self) -> tuple[float, float]:
        return 0.0, 15.0

    def set_pressure(self, psia: float) -> None:
        self.venting = False
        self.command(psia)

    def read(self) -> PressureState:
        settled = abs(self.value() - self.setpoint) < 1e-6
        self.venting = self.venting and not settled
        return PressureState(self.setpoint, self.value(), settled, self.on, self.venting, 0.0)

    def vent(self) -> None:
        self.command(14.7)
        self.venting = True

    def make_safe(self) -> None:
        super().make_safe()
        self.vent()
        self.world.sleep(abs(self.setpoint - self._from) / self.rate)
        self.on = self.venting = False

    def restarted(self) -> bool:
        return self.power_was_off


class IdealChamber(_Follower):
    rate = 0.05
    alarms: tuple[str, ...] = ()

    def limits(self) -> tuple[float, float]:
        return -150.0, 100.0

    def set_temperature(self, degC: float) -> None:
        self.command(degC)

    def read(self) -> ChamberState:
        return ChamberState(self.setpoint, self.value(), 0.0, self.on, self.alarms)

    def make_safe(self) -> None:
        super().make_safe()
        self.command(23.0)


class IdealReader(_Ideal):
    """Reads 2 mV/psi, and the cold box's temperature."""

    def __init__(self, world: World, supply: IdealSupply, box: IdealChamber) -> None:
        super().__init__(world, "dvm")
        self._supply, self._box = supply, box
        self._count = 0
        self.open_thermometer = False
        self.starts = 0

    def channels(self) -> Sequence[str]:
        return ("1", "2")

    def start(self, count: int) -> float:
        self._count = count
        self.starts += 1
        return 0.5 * count

    def fetch(self) -> Mapping[str, Sequence[float]]:
        degC = 9.9e37 if self.open_thermometer else self._box.value()
        return {"1": [2e-3 * self._supply.value()] * self._count, "2": [degC] * self._count}


class NoWires:
    """There are none."""

    def close(self) -> None:
        pass


class PressureBench:
    """The instruments, living on from session to session."""

    def __init__(self) -> None:
        world = World(0.0)
        self.supply = IdealSupply(world, "supply", 0.0)
        self.cold_box = IdealChamber(world, "cold_box", 20.0)
        self.hot_box = IdealChamber(world, "hot_box", 20.0)
        self.dvm = IdealReader(world, self.supply, self.cold_box)

    def power_cut(self) -> None:
        """Everything is off for a moment: setpoints are remembered, control and pressure are not."""
        for instrument in (self.supply, self.cold_box, self.hot_box, self.dvm):
            instrument.power_was_off = True
        self.supply.on = self.cold_box.on = self.hot_box.on = False

    def open(self, world: World) -> Bench:
        for instrument in (self.supply, self.cold_box, self.hot_box):
            instrument.carry_over(world)
        self.dvm.world = world
        instruments = {"supply": self.supply, "cold_box": self.cold_box, "hot_box": self.hot_box, "dvm": self.dvm}
        return Bench(CONFIG, instruments, world, NoWires())  # type: ignore[arg-type]


def new_run(folder: Path, procedure: WholePlotProcedure = PROCEDURE) -> Path:
    path = folder / "small.sqlite"
    about = {"procedure": "small", "bench": "ideal", "software": {}}
    genesis = Genesis("small", {}, procedure.expand(), True, about)
    create(path, genesis, elapsed_s=0.0, utc_s=0.0)
    return path


def run_session(
    path: Path,
    instruments: PressureBench,
    *,
    procedure: WholePlotProcedure = PROCEDURE,
    signals: Signals | None = None,
    on_progress: Callable[[Any], None] = lambda _: None,
    gap_s: float = 60.0,
    certain: bool = True,
) -> tuple[Outcome, RunState, str]:
    """One session, begun `gap_s` after the last record."""
    with RunWriter.open(path) as run:
        state = fold(run.records())
        world = World(state.elapsed_s + (gap_s if state.sessions else 0.0))
        sequencer = Sequencer(
            bench=instruments.open(world),
            run=run,
            state=state,
            run_list=procedure.expand(),
            conduct=procedure.conduct,
            clock=world,
            session=Session(0.0, state.sessions + 1, certain, frozenset(), {"pid": 1}),
            signals=signals or Signals(),
            on_progress=on_progress,
        )
        return sequencer.run(), state, sequencer.message
