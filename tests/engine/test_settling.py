"""Settling: arrival by evidence."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rig.engine.settling import Criteria, Settling

CRITERIA = Criteria(target=10.0, band=0.1, dwell_s=5.0, drift_per_s=0.01, timeout_s=60.0)


def outcome_of(values, step=1.0, criteria=CRITERIA):
    settling = Settling(criteria, 0.0)
    for i, value in enumerate(values):
        if settling.add(i * step, value) != "waiting":
            break
    return settling


def test_a_quiet_value_settles_after_the_dwell_and_not_before():
    assert outcome_of([10.0] * 5).outcome == "waiting"
    assert outcome_of([10.0] * 6).outcome == "settled"


def test_drift_is_the_slope_of_least_squares_over_the_dwell():
    values = [10.0 + 1e-3 * i + 0.01 * math.sin(7.0 * i) for i in range(6)]
    slope = float(np.polyfit(range(6), values, 1)[0])
    for limit, outcome in ((slope * (1 + 1e-10), "settled"), (slope * (1 - 1e-10), "waiting")):
        assert outcome_of(values, criteria=CRITERIA._replace(drift_per_s=limit)).outcome == outcome


def test_one_spike_costs_three_samples_not_a_new_dwell():
    """The way out is taken back, the spike's own step and the way in do not count."""
    values = [10.0] * 4 + [11.0] + [10.0] * 20
    settled = outcome_of(values)
    assert settled.outcome == "settled"
    assert settled.evidence()["seconds"] == 5 + 3


def test_a_value_outside_its_band_times_out():
    assert outcome_of([11.0] * 100).outcome == "timed-out"


def test_a_value_inside_the_band_that_keeps_creeping_is_called_drifting():
    criteria = Criteria(10.0, 1.0, 5.0, 0.001, 60.0)
    assert outcome_of([9.1 + 0.02 * i for i in range(100)], criteria=criteria).outcome == "drifting"


def test_an_exponential_approach_settles_when_it_is_slow_enough():
    tau = 4.0
    settled = outcome_of([10 + 5 * math.exp(-i / tau) for i in range(200)])
    assert settled.outcome == "settled"
    arrival = tau * math.log(5 / 0.1)
    assert arrival + 5 - 1 <= settled.evidence()["seconds"] <= arrival + 5 + 3


@given(st.lists(st.sampled_from((10.0, 10.05, 9.93, 11.0, 2.0)), min_size=1, max_size=80))
def test_settled_means_at_least_a_dwell_inside_and_inside_now(values):
    settled = outcome_of(values)
    samples = [v for _, v in settled.evidence()["samples"]]
    inside = [abs(v - 10.0) <= 0.1 for v in samples]
    if settled.outcome == "settled":
        assert inside[-1]
        assert sum(inside) > 5


def test_what_has_settled_may_leave_again_and_then_has_not():
    settling = Settling(CRITERIA, 0.0)
    assert [settling.add(float(t), 10.0) for t in range(6)][-1] == "settled"
    assert settling.add(6.0, 12.0) == "waiting"
    outcomes = [settling.add(float(t), 10.0) for t in range(7, 15)]
    assert outcomes[0] == "waiting", "hours inside the band do not outlast an excursion"
    assert outcomes[-1] == "settled"


def test_a_long_trace_is_thinned_but_keeps_its_ends():
    settled = outcome_of([11.0] * 5000, step=0.01)
    samples = settled.evidence()["samples"]
    assert len(samples) == 200
    assert samples[0][0] == 0.0
    assert samples[-1][0] == 49.99


def settled_at(value_at, criteria, *, rarely):
    """When a value settles that is looked at every 30 s, or as rarely as a forecast does; and the number of looks."""
    settling, now, looks = Settling(criteria, 0.0), 0.0, 0
    while True:
        looks += 1
        if settling.add(now, value_at(now)) != "waiting":
            return settling.outcome, now, looks
        now += 30.0 * max(1, int(settling.idle_s() / 30.0)) if rarely else 30.0


def test_a_forecast_looks_less_often_far_from_the_band_and_sees_the_same_end():
    criteria = Criteria(target=-90.0, band=0.5, dwell_s=1200.0, drift_per_s=0.5 / 3600.0, timeout_s=8 * 3600.0)
    ways = {
        "towards": lambda t: -90.0 + 110.0 * math.exp(-t / 600.0),
        "evenly": lambda t: max(-90.0, 20.0 - t / 30.0),
        "after an hour at rest": lambda t: -90.0 + 110.0 * math.exp(-max(0.0, t - 3600.0) / 300.0),
        "through the band and back": lambda t: -90.0 + 110.0 * math.exp(-t / 900.0) * math.cos(t / 900.0),
    }
    for name, way in ways.items():
        outcome, then, looks = settled_at(way, criteria, rarely=False)
        again, other, fewer = settled_at(way, criteria, rarely=True)
        assert again == outcome == "settled", name
        assert abs(other - then) <= 60.0, name
        assert fewer < looks, name


def test_a_forecast_waits_no_longer_for_what_never_settles():
    criteria = Criteria(target=-90.0, band=0.5, dwell_s=1200.0, drift_per_s=0.5 / 3600.0, timeout_s=8 * 3600.0)
    outcome, then, _ = settled_at(lambda t: 20.0 - 1e-6 * t, criteria, rarely=True)
    assert outcome == "timed-out"
    assert then < 1.2 * criteria.timeout_s
