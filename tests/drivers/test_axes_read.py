"""What axes are read for: one reading may serve looks at one moment, and never two samples of settling."""

from __future__ import annotations

import pytest
from ideal_bench import ideal_bench

from rig.drivers.roles import AxisState
from rig.engine.actions import BenchActions
from rig.engine.axes import Axes, HeadMover
from rig.engine.fault_classes import DriveFault
from rig.engine.guard import Guard
from rig.procedures.plan.run_list import Settle
from rig.sims.world import World


@pytest.mark.parametrize("poll_s", [0.01, 0.5])
def test_every_sample_of_settling_but_the_first_is_a_reading_of_its_own(poll_s: float):
    world = World()
    bench, head, _ = ideal_bench(world)
    do = BenchActions(bench, Axes([HeadMover(head)]), Guard({}), world, world.sleep)  # type: ignore[arg-type]
    do.home(0.5)
    do.go([{"pitch": 5.0}], 0.5, 60.0)
    reads, read = [], head.read

    def counted():
        reads.append(world.now())
        return read()

    head.read = counted  # type: ignore[method-assign]
    found = do.settle({"pitch": 5.0}, lambda _: Settle(0.1, 1.0, 1.0, 60.0), poll_s)
    samples = found["pitch"]["samples"]
    assert len(samples) > 1.0 / poll_s
    assert len(reads) == len(samples) - 1, "the first look is the one that saw the head stand"
    assert len(set(reads)) == len(reads)


def test_an_axis_that_stands_is_judged_at_every_reading(monkeypatch: pytest.MonkeyPatch):
    world = World()
    bench, head, _ = ideal_bench(world)
    guard, checked = Guard({}), []
    monkeypatch.setattr(guard, "check_axes", checked.append)
    do = BenchActions(bench, Axes([HeadMover(head)]), guard, world, world.sleep)  # type: ignore[arg-type]
    assert do.axes() == do.axes()
    assert len(checked) == 2
    head.read = lambda: {"pitch": AxisState(3.0, False, True, True, "too hot")}  # type: ignore[method-assign]
    for _ in range(2):
        with pytest.raises(DriveFault, match="too hot"):
            do.axes()
    assert len(checked) == 4
