"""Real and scaled clocks; the world has a clock's shape."""

from __future__ import annotations

import time

import pytest

from rig.drivers.clock import Clock, RealClock, ScaledClock, boot_id
from rig.sims.world import World


def test_real_time_passes_at_real_pace_and_ignores_steps_of_the_calendar(monkeypatch):
    clock = RealClock()
    began = clock.now()
    monkeypatch.setattr(time, "time", lambda: 0.0)  # somebody sets the machine's calendar
    clock.sleep(0.02)
    assert 0.02 <= clock.now() - began < 1.0


def test_scaled_time_runs_faster_and_bears_a_little_more_delay():
    real = RealClock()
    clock = ScaledClock(50.0, epoch_utc=1e9, started_utc=real.utc())
    began, began_real = clock.now(), real.now()
    clock.sleep(2.0)
    passed, passed_real = clock.now() - began, real.now() - began_real
    assert passed == pytest.approx(50.0 * passed_real, rel=0.05)
    assert 0.04 <= passed_real < 1.0
    assert clock.timeout(10.0) == pytest.approx(0.4)
    assert clock.utc() == pytest.approx(1e9 + passed, abs=50.0)


def test_speed_must_be_positive():
    with pytest.raises(ValueError, match="positive"):
        ScaledClock(0.0, 0.0, 0.0)


@pytest.mark.parametrize("clock", [RealClock(), ScaledClock(100.0, 0.0, 0.0), World()])
def test_every_clock_can_do_what_a_clock_can_do(clock):
    used: Clock = clock
    began, watch = used.now(), used.stopwatch()
    used.sleep(0.01)
    used.sleep(-1.0)
    used.idle(0.01)
    assert used.now() >= began + 0.01999
    assert used.stopwatch() > watch
    assert used.timeout(1.0) > 0
    assert isinstance(used.utc(), float)


def test_this_boot_has_a_name():
    assert boot_id() == boot_id() != ""
