"""Virtual time: order, cancelling, deadlock, and noise that belongs to events."""

from __future__ import annotations

import statistics
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.sims.noise import event_at, normal, splitmix64, uniform
from rig.sims.world import EPOCH_UTC, Deadlock, World


def test_a_thousand_seconds_take_no_time():
    world = World()
    before = world.stopwatch()
    world.sleep(1e6)
    assert world.now() == 1e6
    assert world.stopwatch() - before < 0.1


@given(st.lists(st.floats(0.0, 100.0), min_size=1, max_size=30))
def test_events_happen_in_order_of_time_then_of_scheduling(delays):
    world = World()
    seen = []
    for k, delay in enumerate(delays):
        world.call_in(delay, lambda k=k: seen.append((world.now(), k)))
    world.sleep(101.0)
    assert seen == sorted((delay, k) for k, delay in enumerate(delays))
    assert world.now() == 101.0


def test_an_event_may_schedule_another_that_is_due_at_once():
    world = World()
    seen = []
    world.call_in(1.0, lambda: world.call_in(0.0, lambda: seen.append(world.now())))
    world.sleep(1.0)
    assert seen == [1.0]


def test_a_cancelled_call_does_not_happen():
    world = World()
    seen = []
    timer = world.timer_in(1.0, lambda: seen.append("early"))
    world.call_in(2.0, lambda: seen.append("late"))
    timer.cancel()
    assert world.next_due() == 2.0
    world.sleep(3.0)
    assert seen == ["late"]
    timer.cancel()


def test_waiting_ends_when_the_condition_holds():
    world = World()
    seen = []
    for k in range(5):
        world.call_in(k, lambda k=k: seen.append(k))
    assert world.run_until(10.0, lambda: 2 in seen)
    assert (seen, world.now()) == ([0, 1, 2], 2.0)
    assert not world.run_until(3.5, lambda: 9 in seen)
    assert world.now() == 3.5


def test_waiting_for_ever_for_nothing_is_a_deadlock():
    with pytest.raises(Deadlock, match="nothing is scheduled"):
        World().run_until(None, lambda: False)


def test_sleeping_never_goes_backwards():
    world = World(start=50.0)
    world.sleep(-1.0)
    world.sleep(0.0)
    assert world.now() == 50.0
    assert world.utc() == EPOCH_UTC + 50.0


def test_splitmix64_is_the_published_one():
    """First outputs of the reference implementation (S. Vigna, splitmix64.c) seeded with 1234567."""
    golden = 0x9E3779B97F4A7C15
    state = 1234567
    outputs = []
    for _ in range(5):
        outputs.append(splitmix64(state))
        state = (state + golden) % 2**64
    assert outputs == [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]


def test_normal_deviates_are_normal():
    sample = [normal(7, "x", k) for k in range(20_000)]
    assert statistics.fmean(sample) == pytest.approx(0.0, abs=0.025)
    assert statistics.stdev(sample) == pytest.approx(1.0, abs=0.02)
    assert sum(abs(v) > 1.96 for v in sample) / len(sample) == pytest.approx(0.05, abs=0.006)
    neighbours = statistics.correlation(sample[:-1], sample[1:])
    assert abs(neighbours) < 0.025


def test_channels_and_seeds_are_independent():
    events = range(5000)
    one = [normal(1, "x", k) for k in events]
    for other in ([normal(1, "y", k) for k in events], [normal(2, "x", k) for k in events]):
        assert abs(statistics.correlation(one, other)) < 0.05


@given(st.integers(0, 2**63), st.text(max_size=20), st.integers(-(10**15), 10**15))
def test_the_same_event_always_gets_the_same_noise(seed, channel, event):
    assert normal(seed, channel, event) == normal(seed, channel, event)
    assert 0.0 <= uniform(seed, channel, event) < 1.0


def test_noise_is_the_same_in_another_process():
    here = repr([normal(3, "dvm/101", event_at(12.5 + k)) for k in range(5)])
    code = "from rig.sims.noise import *; print([normal(3, 'dvm/101', event_at(12.5 + k)) for k in range(5)])"
    there = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    assert here == there
