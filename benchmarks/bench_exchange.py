"""Microseconds an exchange in process: driver, pyserial, simulated line, twin and physics together.

python benchmarks/bench_exchange.py
"""

from __future__ import annotations

import time
from collections.abc import Callable

from drivers.newport_esp301 import NewportESP301
from drivers.wires import Wires
from sims.bench import SimBench
from sims.twins.newport_esp301 import NewportESP301Twin
from sims.world import World

REPEATS = 20_000


def microseconds(action: Callable[[], object], repeats: int = REPEATS) -> float:
    """The best of five, since what else the machine does only ever adds."""
    best = float("inf")
    for _ in range(5):
        began = time.perf_counter()
        for _ in range(repeats // 5):
            action()
        best = min(best, (time.perf_counter() - began) / (repeats // 5))
    return best * 1e6


def main() -> None:
    world = World()
    bench = {
        "name": "benchmark",
        "instruments": {"head": {"driver": "newport-esp301", "address": "/dev/rig/head"}},
        "sensors": {},
    }
    SimBench(world, bench, {}, "benchmark", {"newport-esp301": NewportESP301Twin})
    wires = Wires(world)
    head = NewportESP301("head", "sim://benchmark/head", NewportESP301.Options(), wires, world)
    head.prepare()
    head.home()
    while any(s.moving or not s.homed for s in head.read().values()):
        world.sleep(0.5)
    line = head._line
    print(f"ESP301  1TP?                   {microseconds(lambda: line.query('1TP?')):6.1f} us")
    print(f"ESP301  read(), at rest        {microseconds(head.read):6.1f} us   (six queries in one line)")
    head.move({"pitch": 170.0, "roll": 170.0})
    print(f"ESP301  read(), while moving   {microseconds(head.read, 500):6.1f} us")


if __name__ == "__main__":
    main()
