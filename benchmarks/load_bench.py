"""The bench of the load benchmarks: a head, a scanner with seven sensors and a thermistor, all of them ideal."""

from __future__ import annotations

import contextlib
import sys
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "support"))

import ideal_bench

from rig.instruments.opening import Bench
from rig.run_file.chain import encode
from rig.runs.plans import Plan, plan_of
from rig.sims.world import World

SENSORS = ("s1", "s2", "s3", "s4", "s5", "s6", "s7")
CELLS = 1000

BENCH = """
name = "load"
[instruments.head]
driver = "newport-esp301"
address = "/dev/rig/head"
[instruments.scanner]
driver = "keysight-34970a"
address = "/dev/rig/scanner"
[instruments.scanner.channels]
108 = "thermistor-10k"
CHANNELS
[temperatures.sensor_temperature_degC]
reader = "scanner"
channel = "108"
[limits]
pitch_deg = [-95, 95]
roll_deg = [-185, 185]
"""
SENSOR = """
[sensors.NAME]
axis = "x"
reader = "scanner"
channel = "CHANNEL"
"""
PROCEDURE = """
kind = "pitch-roll"
name = "load"
seed = 1
replications = REPLICATIONS
[design]
type = "D1"
pitch_max_deg = 90
pitch_count = 40
roll_count = 25
[settle]
dwell_s = 1.0
[measure]
readings = 5
"""


_READ = {"mean": 0.7857167547142776, "sd": 1.951915885742837e-06, "readings": [0.7857155202142776] * 5}
_SETTLED = {"outcome": "settled", "seconds": 1.0, "samples": [[0.5 * i, -25.384615385] for i in range(3)]}
OBSERVATION = {
    "approach": {"pitch": [1, -30.0], "roll": [1, -180.0]},
    "readback": {"pitch_deg": -25.384615385, "roll_deg": -165.0},
    "settling": {"pitch": _SETTLED, "roll": _SETTLED},
    "measured_s": [123456.5, 123459.0],
    "environment": {},
    "outputs": {f"{name}_V": _READ for name in SENSORS},
    "temperatures": {"sensor_temperature_degC": _READ},
    "flags": [],
}
BODY = encode(OBSERVATION)
"""As large as an observation of seven sensors."""


def planned(points: int) -> Plan:
    """The plan of a run of so many points, a multiple of 1000, as from files."""
    channels = {name: str(101 + i) for i, name in enumerate(SENSORS)}
    bench = BENCH.replace("CHANNELS", "\n".join(f'{channel} = "volts"' for channel in channels.values()))
    bench += "".join(SENSOR.replace("NAME", n).replace("CHANNEL", c) for n, c in channels.items())
    procedure = PROCEDURE.replace("REPLICATIONS", str(points // CELLS))
    return plan_of({"bench.toml": bench, "procedure.toml": procedure}, dry=True)


class Head(ideal_bench.IdealHead):
    """The ideal head, which does not remember where it was sent. Notes when it was first asked to move."""

    first_move_s: float | None = None

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self.sent = deque(maxlen=1)  # type: ignore[assignment]

    def move(self, targets_deg: Mapping[str, float]) -> None:
        if Head.first_move_s is None:
            Head.first_move_s = time.process_time()
        super().move(targets_deg)


class Scanner(ideal_bench.IdealReader):
    """Seven sensors and a thermistor; every reading with all its digits, as an instrument gives them."""

    def channels(self) -> Sequence[str]:
        return tuple(str(101 + i) for i in range(len(SENSORS) + 1))

    def fetch(self) -> Mapping[str, Sequence[float]]:
        volts = self.world.now() / 7.0 % 1.0
        readings = [volts + 1.2345e-6 * i for i in range(self._count)]
        found: dict[str, Sequence[float]] = {str(101 + i): [r / (i + 1) for r in readings] for i in range(len(SENSORS))}
        return found | {str(101 + len(SENSORS)): [23.0123 + r for r in readings]}


@contextlib.contextmanager
def ideal(plan: Plan, *, start: float = 0.0) -> Iterator[tuple[Bench, World, str]]:
    """The bench of a plan with ideal instruments."""
    world = World(start)
    head = Head(world)
    instruments = {"head": head, "scanner": Scanner(world, head)}
    yield Bench(plan.bench, instruments, world, ideal_bench.NoWires()), world, "virtual"  # type: ignore[arg-type]
