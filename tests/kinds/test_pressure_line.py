"""The pressure line: slew, settling and leak against integration step by step; nothing depends on polling."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.sims.physics.fields import WorldError, read_table
from rig.sims.physics.pressure_line import ATMOSPHERE_PSIA, LineTruth, PressureLine

QUIET = LineTruth(control_noise_psi=0.0, reference_noise_psi=0.0)
AIR = ATMOSPHERE_PSIA


def line(**truth):
    return PressureLine(replace(QUIET, **truth), "supply", 7)


def settled(setpoint=2.5, **truth):
    """A line that has been controlled to a setpoint for longer than it takes."""
    it = line(**truth)
    it.command(0.0, setpoint, 1.0)
    return it


def integrated(rate, begin, seconds, steps=20_000):
    """d p / d t = rate(t, p), by Heun's method."""
    p, dt = begin, seconds / steps
    for k in range(steps):
        first = rate(k * dt, p)
        p += dt * (first + rate((k + 1) * dt, p + dt * first)) / 2.0
    return p


@pytest.mark.parametrize("seconds", [1.0, 5.0, 12.1, 14.0, 30.0])
def test_a_slew_is_followed_with_the_control_loops_lag(seconds):
    it = line(control_time_constant_s=2.0)
    it.command(0.0, 2.5, 1.0)
    ramp = lambda t: max(AIR - t, 2.5)  # noqa: E731
    expected = integrated(lambda t, p: (ramp(t) - p) / 2.0, AIR, seconds)
    assert it.pressure_psia(seconds) == pytest.approx(expected, abs=1e-6)


def test_without_overshoot_the_setpoint_is_never_passed_and_with_it_by_the_declared_fraction():
    for allowed in (False, True):
        it = line(overshoot_fraction=0.05, control_time_constant_s=0.5)
        it.command(0.0, 5.0, math.inf, overshoot=allowed)
        lowest = min(it.pressure_psia(0.01 * k) for k in range(2000))
        if allowed:
            assert 5.0 - 0.05 * (AIR - 5.0) < lowest < 5.0
        else:
            assert lowest >= 5.0
        assert it.pressure_psia(100.0) == pytest.approx(5.0, abs=1e-9)


def test_left_alone_it_follows_its_surroundings_as_volume_and_conductance_say():
    it = settled(0.5, leak_time_constant_s=1000.0)
    it.control_off(100.0)
    assert it.pressure_psia(1100.0) == pytest.approx(AIR + (0.5 - AIR) / math.e, rel=1e-9)
    into_a_chamber = line(surroundings_psia=0.0, leak_time_constant_s=1000.0)
    assert into_a_chamber.pressure_psia(1000.0) == pytest.approx(AIR / math.e)


def test_control_makes_up_for_the_leak_and_its_effort_says_so():
    it = settled(0.5, leak_time_constant_s=1000.0, valve_psi_per_s=5.0)
    assert it.pressure_psia(500.0) == pytest.approx(0.5)
    assert it.effort_pct(500.0) == pytest.approx(-100.0 * (AIR - 0.5) / 1000.0 / 5.0)
    it.control_off(500.0)
    assert it.effort_pct(500.0) == 0.0


def test_a_restriction_makes_the_transducers_see_more_than_the_controller_while_the_line_leaks():
    """The pressure lost is the restriction times the leak, (surroundings - line) / time constant."""
    it = settled(0.5, leak_time_constant_s=1e4, restriction_s=3.0)
    true = it.pressure_psia(200.0)
    assert true - 0.5 == pytest.approx(3.0 * (AIR - true) / 1e4, rel=1e-9)
    assert it.reading_psia(200.0) == pytest.approx(0.5)
    it.control_off(200.0)
    assert it.pressure_psia(200.0) == it.reading_psia(200.0) == pytest.approx(true)


def test_the_references_own_error_is_what_separates_truth_from_setpoint():
    it = settled(5.0, reference_gain_ppm=100.0, reference_offset_psi=2e-4, reference_drift_psi_per_day=1e-3)
    assert it.reading_psia(43_200.0) == pytest.approx(5.0, abs=1e-9)
    assert it.pressure_psia(43_200.0) == pytest.approx((5.0 - 2e-4 - 5e-4) / 1.0001, abs=1e-9)


def test_a_transducer_one_metre_higher_feels_a_metre_of_gas_less():
    """rho g h / p of nitrogen at 23 degrees Celsius: 1.138 kg/m3 at 100 kPa, so 112 ppm a metre."""
    it = settled(5.0, height_m=1.0)
    assert 1.0 - it.pressure_psia(100.0) / 5.0 == pytest.approx(1.138 * 9.80665 / 100e3, rel=2e-3)


@pytest.mark.parametrize("start", [0.5, 40.0])
def test_a_vent_goes_to_the_atmosphere_no_faster_than_told_and_ends(start):
    it = line(start_psia=start)
    it.vent(10.0, 0.5)
    states = [(it.pressure_psia(t), it.venting(t)) for t in range(10, 200)]
    assert all(abs(b - a) <= 0.5 + 1e-9 for (a, _), (b, _) in itertools.pairwise(states))
    assert states[0][1]
    assert all(venting == (abs(p - AIR) > 0.01) for p, venting in states)
    assert not it.venting(200.0)
    assert it.vented(200.0)
    it.command(200.0, 5.0, 1.0)
    assert not it.vented(200.0)


def test_a_lost_supply_leaves_the_line_below_its_setpoint_and_a_valve_fully_open():
    it = line(supply_lost_h=0.01, supply_back_h=0.02, start_psia=1.0, leak_time_constant_s=1e6)
    it.command(0.0, 30.0, 0.5)
    assert it.pressure_psia(36.0) == pytest.approx(1.0 + 0.5 * (36.0 - 1.5), abs=0.01)
    stuck = it.pressure_psia(70.0)
    assert stuck == pytest.approx(it.pressure_psia(36.0), abs=0.01)
    assert it.effort_pct(70.0) == 100.0
    assert it.supply_psia(70.0) == pytest.approx(AIR)
    assert it.pressure_psia(72.0 + 60.0) == pytest.approx(30.0)
    assert it.supply_psia(100.0) == 45.0


def test_a_lost_vacuum_lets_the_leak_win():
    it = line(vacuum_lost_h=0.1, leak_time_constant_s=2e4)
    it.command(0.0, 0.12, 1.0)
    assert it.pressure_psia(360.0) == pytest.approx(0.12)
    expected = AIR + (0.12 - AIR) * math.exp(-600.0 / 2e4)
    assert it.pressure_psia(960.0) == pytest.approx(expected, rel=1e-6)
    assert it.effort_pct(960.0) == -100.0
    assert it.settled_since(960.0, 1e-3) is None
    it.command(960.0, 5.0, 1.0)
    assert it.pressure_psia(975.0) == pytest.approx(5.0, abs=0.02), "upwards still works"


def test_what_no_source_can_reach_is_approached_and_not_reached():
    it = settled(60.0)
    assert it.pressure_psia(200.0) == pytest.approx(45.0)
    assert it.effort_pct(200.0) == 100.0


@pytest.mark.parametrize("overshoot", [False, True])
@pytest.mark.parametrize("band", [1e-4, 1e-2, 0.3])
def test_in_the_band_since_agrees_with_looking_all_the_time(overshoot, band):
    it = line(overshoot_fraction=0.1)
    it.command(3.0, 5.0, 2.0, overshoot=overshoot)
    times = [3.0 + 0.005 * k for k in range(8000)]
    outside = max(t for t in times if abs(it.reading_psia(t) - 5.0) > band)
    assert it.settled_since(times[-1], band) == pytest.approx(outside, abs=0.006)
    assert it.settled_since(3.1, band) is None
    since = it.settled_since(times[-1], band)
    for begin in (0.0, since - 0.5, since - 1e-3, since + 1e-3, since + 0.5, times[-1]):
        assert it.settled_since(times[-1], band, begin) == pytest.approx(max(since, begin), abs=1e-6)
    it.command(50.0, 5.0, 2.0)
    assert it.settled_since(60.0, band) == 50.0


def test_means_are_the_mean_of_what_is_there():
    it = line(control_noise_psi=0.01)
    it.command(0.0, 5.0, 1.0, overshoot=True)
    for t0, t1 in ((0.0, 3.0), (8.0, 14.0), (60.0, 60.4), (60.0, 71.0)):
        step = (t1 - t0) / 4000
        seen = sum(it.pressure_psia(t0 + (k + 0.5) * step) for k in range(4000)) / 4000
        assert it.mean_psia(t0, t1) == pytest.approx(seen, abs=1e-7)


def test_control_noise_has_the_declared_size_and_averages_out():
    it = PressureLine(replace(QUIET, control_noise_psi=1e-3), "supply", 3)
    it.command(0.0, 5.0, math.inf)
    noise = [it.pressure_psia(100.0 + 0.37 * k) - 5.0 for k in range(5000)]
    assert math.sqrt(sum(x * x for x in noise) / len(noise)) == pytest.approx(1e-3, rel=0.05)
    means = [it.mean_psia(100.0 + 0.37 * k, 110.0 + 0.37 * k) - 5.0 for k in range(5000)]
    assert math.sqrt(sum(x * x for x in means) / len(means)) < 6e-4
    another = PressureLine(it.truth, "supply", 4)
    another.command(0.0, 5.0, math.inf)
    assert another.pressure_psia(100.0) != it.pressure_psia(100.0)


commands = st.lists(
    st.tuples(
        st.sampled_from(["command", "overshoot", "off", "vent"]),
        st.floats(0.0, 50.0),
        st.floats(0.01, 5.0),
        st.floats(0.1, 400.0),
    ),
    min_size=1,
    max_size=8,
)
truths = st.builds(
    LineTruth,
    leak_time_constant_s=st.floats(100.0, 1e6),
    restriction_s=st.floats(0.0, 1.0),
    height_m=st.floats(-2.0, 2.0),
    reference_drift_psi_per_day=st.floats(-1e-2, 1e-2),
    reference_gain_ppm=st.floats(-100.0, 100.0),
    vacuum_lost_h=st.none() | st.floats(0.0, 0.3),
    vacuum_back_h=st.none() | st.floats(0.0, 0.5),
    supply_lost_h=st.none() | st.floats(0.0, 0.3),
)


def played(it, script, polls=()):
    """Carry out a script, looking at the line at some moments in between."""
    now = 0.0
    for what, psia, rate, wait in script:
        match what:
            case "off":
                it.control_off(now)
            case "vent":
                it.vent(now, rate)
            case _:
                it.command(now, psia, rate, overshoot=what == "overshoot")
        for share in polls:
            t = now + share * wait
            it.pressure_psia(t), it.reading_psia(t), it.effort_pct(t), it.settled_since(t, 1e-3), it.venting(t)
            it.mean_psia(t, t + 0.2)
        now += wait
    return now


@settings(max_examples=60, deadline=None)
@given(truths, commands, st.lists(st.floats(0.0, 1.0), max_size=5))
def test_looking_changes_nothing(truth, script, polls):
    seen, left_alone = (PressureLine(truth, "supply", 5) for _ in range(2))
    now = played(seen, script, polls)
    assert played(left_alone, script) == now
    for t in (now, now + 1.3, now + 500.0):
        for quantity in ("pressure_psia", "reading_psia", "effort_pct", "venting", "vented", "supply_psia"):
            assert getattr(seen, quantity)(t) == getattr(left_alone, quantity)(t)
        assert seen.settled_since(t, 1e-3) == left_alone.settled_since(t, 1e-3)
        assert seen.mean_psia(t, t + 2.0) == left_alone.mean_psia(t, t + 2.0)


@settings(max_examples=60, deadline=None)
@given(truths, commands)
def test_the_gas_never_jumps_and_never_leaves_the_range_of_its_sources(truth, script):
    truth = replace(truth, control_noise_psi=0.0, overshoot_fraction=0.0)
    it = PressureLine(truth, "supply", 5)
    it_end = played(it, script)
    edges = [s.start for s in it._stretches]
    for edge in edges:
        assert it.pressure_psia(edge) == pytest.approx(it.pressure_psia(edge - 1e-9), abs=1e-6)
    for k in range(50):
        p = it.pressure_psia(it_end + 10.0 * k)
        assert -0.02 < p < 50.02
        assert -100.0 <= it.effort_pct(it_end + 10.0 * k) <= 100.0


def test_a_world_file_is_checked():
    assert read_table(LineTruth(), {"vacuum_lost_h": 2}, "pressure_line", {}).vacuum_lost_h == 2.0
    with pytest.raises(WorldError, match=r"pressure_line\.leak_s is not known"):
        read_table(LineTruth(), {"leak_s": 2}, "pressure_line", {})
    with pytest.raises(WorldError, match=r"pressure_line\.supply_psia = -1 is outside 0 to 10000"):
        read_table(LineTruth(), {"supply_psia": -1}, "pressure_line", {})
