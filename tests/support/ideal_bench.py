"""A bench of ideal instruments under virtual time, for tests of the sequencer alone: no wires, no bytes.

Faults are planted by overwriting methods. The sensor is written from the rotation of the head, not from a model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rig.bench.config import BenchConfig
from rig.drivers.roles import AxisState, Identity
from rig.engine.sequencer import Sequencer
from rig.engine.session import Outcome, Session, Signals
from rig.instruments.opening import Bench
from rig.procedures.attitude.settings import PitchRollProcedure
from rig.run_file.state.state import RunState, fold
from rig.run_file.write.creation import Genesis, create
from rig.run_file.write.writer import RunWriter
from rig.sims.world import World

CONFIG = BenchConfig.model_validate(
    {
        "name": "ideal",
        "instruments": {
            "head": {"driver": "ideal-head", "address": "nowhere"},
            "dvm": {"driver": "ideal-dvm", "address": "nowhere"},
        },
        "sensors": {"x": {"axis": "x", "reader": "dvm", "channel": "1"}},
        "temperatures": {"sensor_temperature_degC": {"reader": "dvm", "channel": "2"}},
        "limits": {"pitch_deg": [-95, 95], "roll_deg": [-185, 185]},
    }
)


class IdealHead:
    """Goes where it is sent at 10 deg/s and remembers every angle it was sent to."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.homed = True
        self.serial = "H1"
        self.sent: list[dict[str, float]] = []
        self._from = {"pitch": 3.0, "roll": -7.0}
        self._to = dict(self._from)
        self._began = 0.0
        self.safe = 0

    def identify(self) -> Identity:
        return Identity("ideal", "head", self.serial, "1")

    def prepare(self) -> None:
        pass

    def make_safe(self) -> None:
        self.safe += 1
        self.stop()

    def close(self) -> None:
        pass

    def axes(self) -> Mapping[str, tuple[float, float]]:
        return {"pitch": (-180.0, 180.0), "roll": (-200.0, 200.0)}

    def home(self) -> None:
        self.homed = True
        self.move({"pitch": 0.0, "roll": 0.0})

    def position(self, axis: str) -> float:
        gone = 10.0 * (self.world.now() - self._began)
        way = self._to[axis] - self._from[axis]
        return self._to[axis] if gone >= abs(way) else self._from[axis] + math.copysign(gone, way)

    def move(self, targets_deg: Mapping[str, float]) -> None:
        self.sent.append(dict(targets_deg))
        here = {axis: self.position(axis) for axis in self._to}
        self._from, self._to = here, {**here, **targets_deg}
        self._began = self.world.now()

    def read(self) -> Mapping[str, AxisState]:
        return {
            axis: AxisState(self.position(axis), self.position(axis) != self._to[axis], self.homed, True)
            for axis in self._to
        }

    def stop(self) -> None:
        here = {axis: self.position(axis) for axis in self._to}
        self._from, self._to = here, dict(here)


class IdealReader:
    """Reads gravity along the package's x axis, and 23 degC."""

    def __init__(self, world: World, head: IdealHead) -> None:
        self.world = world
        self.head = head
        self._count = 0
        self.noise_V = 0.0
        self.overloads: set[int] = set()
        self.starts = 0

    def identify(self) -> Identity:
        return Identity("ideal", "dvm", "0", "1")

    def prepare(self) -> None:
        pass

    def make_safe(self) -> None:
        pass

    def close(self) -> None:
        pass

    def channels(self) -> Sequence[str]:
        return ("1", "2")

    def start(self, count: int) -> float:
        self._count = count
        self.starts += 1
        return 0.5 * count

    def fetch(self) -> Mapping[str, Sequence[float]]:
        # The last digit is never the same twice, as no meter's is: readings that repeat one count as frozen.
        volts = math.sin(math.radians(self.head.position("pitch"))) + 1e-9 * self.starts
        readings = [volts + self.noise_V * (-1) ** i for i in range(self._count)]
        if self.starts in self.overloads:
            readings[0] = 9.9e37
        return {"1": readings, "2": [23.0] * self._count}


class NoWires:
    """There are none."""

    def close(self) -> None:
        pass


def ideal_bench(world: World) -> tuple[Bench, IdealHead, IdealReader]:
    head = IdealHead(world)
    reader = IdealReader(world, head)
    return Bench(CONFIG, {"head": head, "dvm": reader}, world, NoWires()), head, reader  # type: ignore[arg-type, dict-item]


PROCEDURE = PitchRollProcedure.model_validate(
    {
        "kind": "pitch-roll",
        "name": "small",
        "replications": 2,
        "design": {"type": "D", "pitch_deg": [-30, 0, 30], "roll_deg": [-90, 0, 90]},
        "settle": {"dwell_s": 1.0},
        "measure": {"readings": 4},
    }
)


def new_run(folder: Path, procedure: PitchRollProcedure = PROCEDURE) -> Path:
    path = folder / "small.sqlite"
    genesis = Genesis("small", {}, procedure.expand(), True, {"procedure": "small", "bench": "ideal", "software": {}})
    create(path, genesis, elapsed_s=0.0, utc_s=0.0)
    return path


def run_session(
    path: Path,
    *,
    procedure: PitchRollProcedure = PROCEDURE,
    spoil: Callable[[Bench, IdealHead, IdealReader], None] = lambda *_: None,
    signals: Signals | None = None,
    on_progress: Callable[[Any], None] = lambda _: None,
    gap_s: float = 60.0,
    accept: frozenset[str] = frozenset(),
) -> tuple[Outcome, RunState, IdealHead, str]:
    """One session on the ideal bench, whose head was power-cycled to where it happens to stand."""
    with RunWriter.open(path) as run:
        state = fold(run.records())
        world = World(state.elapsed_s + (gap_s if state.sessions else 0.0))
        bench, head, reader = ideal_bench(world)
        spoil(bench, head, reader)
        sequencer = Sequencer(
            bench=bench,
            run=run,
            state=state,
            run_list=procedure.expand(),
            conduct=procedure.conduct,
            clock=world,
            session=Session(0.0, state.sessions + 1, True, accept, {"pid": 1}),
            signals=signals or Signals(),
            on_progress=on_progress,
        )
        return sequencer.run(), state, head, sequencer.message
