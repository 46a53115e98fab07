"""Holes in time: a controller that had no turn checks the bench like one that is resumed."""

from __future__ import annotations

import itertools

import pytest
from ideal_bench import PROCEDURE, new_run, run_session
from ideal_pressure_bench import PROCEDURE as PRESSURE
from ideal_pressure_bench import PressureBench
from ideal_pressure_bench import new_run as new_pressure_run
from ideal_pressure_bench import run_session as run_pressure_session

from rig.engine.holes import HOLE_S, WatchedClock
from rig.engine.session import Outcome
from rig.run_file.read.reader import RunReader
from rig.sims.world import World


def records(path, kind, status=None):
    with RunReader.open(path) as reader:
        reader.verify()
        return [r for r in reader.records(kind) if status in (None, r.status)]


def test_a_hole_is_what_waiting_does_not_explain():
    world = World()
    clock = WatchedClock(world)
    clock.sleep(1000.0)
    clock.timeout(30.0)
    world.sleep(30.0 + HOLE_S)  # a wait that was announced, and as late as a busy machine may be
    assert clock.take_hole() is None
    world.sleep(30.0 + HOLE_S + 0.5)
    clock.timeout(1.0)
    world.call_in(2.0, lambda: world.suspend(500.0))
    clock.sleep(5.0)
    hole = clock.take_hole()
    assert (hole.began, hole.seconds) == (pytest.approx(1000.0 + 70.0 + 10.5), pytest.approx(497.0))
    assert clock.take_hole() is None


def suspended(reader_starts, seconds):
    """A controller that has no turn for so long while a point is measured."""

    def spoil(bench, _head, reader):
        start = reader.start

        def start_and_be_stopped(count):
            due = start(count)
            if reader.starts == reader_starts:
                bench.clock.call_in(0.5 * due, lambda: bench.clock.suspend(seconds))
            return due

        reader.start = start_and_be_stopped

    return spoil


@pytest.mark.parametrize(("seconds", "prepared"), [(8.0, 1), (60.0, 1), (PROCEDURE.recovery.max_gap_s + 60.0, 2)])
def test_a_point_over_a_hole_is_measured_again_and_a_long_one_prepares_again(tmp_path, seconds, prepared):
    path = new_run(tmp_path)
    outcome, *_ = run_session(path, spoil=suspended(5, seconds))
    assert outcome is Outcome.COMPLETE
    holes = records(path, "event", "hole")
    assert len(holes) == (seconds > HOLE_S)
    assert all(h.data["hole_s"] == pytest.approx(seconds, abs=5.0) and h.run_index == 4 for h in holes)
    assert len(records(path, "event", "prepared")) == prepared
    seen = records(path, "observation", "accepted")
    assert [r.run_index for r in seen] == list(range(18))
    spans = [r.data["measured_s"][1] - r.data["measured_s"][0] for r in seen]
    assert max(spans) < 2.0 + HOLE_S
    assert records(path, "fault") == []


@pytest.mark.parametrize(
    ("seconds", "lost"), [(30.0, 0), (PRESSURE.recovery.continue_gap_s + 60.0, 1), (16_090.0, 1), (200 * 3600.0, 1)]
)
def test_a_whole_plot_does_not_go_on_over_a_long_hole(tmp_path, seconds, lost):
    path, bench, done = new_pressure_run(tmp_path), PressureBench(), []
    set_pressure = bench.supply.set_pressure

    def set_and_be_stopped(psia):
        done.append(psia)
        if len(done) == 4:
            world = bench.supply.world
            world.call_in(1.0, lambda: world.suspend(seconds))
        set_pressure(psia)

    bench.supply.set_pressure = set_and_be_stopped
    outcome, *_ = run_pressure_session(path, bench)
    assert outcome is Outcome.COMPLETE
    assert len(records(path, "event", "hole")) == 1
    told = records(path, "event", "whole-plot-lost")
    assert len(told) == lost
    assert all("longer than continue_gap_s" in r.data["reason"] for r in told)
    by_plot: dict[int, list[float]] = {}
    for r in records(path, "observation", "accepted"):
        by_plot.setdefault(r.whole_plot, []).append(r.elapsed_s)
    for times in by_plot.values():
        assert max(b - a for a, b in itertools.pairwise(times)) <= PRESSURE.recovery.continue_gap_s
