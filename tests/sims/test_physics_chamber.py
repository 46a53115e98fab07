"""Chambers: their differential equations against an integrator, what counts as a change of temperature."""

from collections.abc import Callable
from dataclasses import replace
from math import inf, pi, sin
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from rig.sims.physics.chamber import Chamber
from rig.sims.physics.pressure_truth import ChamberTruth
from rig.sims.physics.steps import Steps
from rig.sims.physics.thermal import Lab
from rig.sims.physics.truth import LabTruth

Setpoint = Callable[[float], float] | None

HOUR = 3600.0
DAY = 24 * HOUR
LAB = LabTruth(mean_degC=21.0, daily_amplitude_degC=3.0, warmest_hour_utc=6.0, drift_degC_per_day=2.0)
CALM = LabTruth(mean_degC=20.0, daily_amplitude_degC=0.0)
ORDINARY = ChamberTruth()
SLUGGISH = ChamberTruth(
    time_constant_s=300.0,
    damping=0.4,
    slew_degC_per_min=3.0,
    wall_exchange_s=1800.0,
    body_sees_wall=0.1,
    body_sees_lab=0.02,
)


def chamber(truth: ChamberTruth = ORDINARY, lab: LabTruth = CALM) -> Chamber:
    return Chamber(truth, Lab(lab, 0.0), 0.0)


def temperatures(made: Chamber, t: float) -> list[float]:
    return [made.air_degC(t), made.wall_degC(t), made.package_degC(t)]


def the_lab(t: float) -> float:
    """Warmest at six hours, the world having begun at midnight."""
    return 21.0 + 2.0 * t / DAY + 3.0 * sin(2 * pi * (t - 6 * HOUR) / DAY + pi / 2)


def integrated(truth: ChamberTruth, begin: list[float], t0: float, t1: float, setpoint: Setpoint) -> list[float]:
    """The equations of the chamber's walls, air and body, stepped through time. No setpoint: no control."""

    def rates(t: float, x: np.ndarray) -> list[float]:
        air, wall, body, total = x
        error, heat = 0.0, 0.0
        if setpoint:
            error = setpoint(t) - air
            heat = 2 * truth.damping / truth.time_constant_s * error + total / truth.time_constant_s**2
        seen = truth.body_sees_wall * wall + truth.body_sees_lab * the_lab(t)
        seen += (1 - truth.body_sees_wall - truth.body_sees_lab) * air
        return [
            (the_lab(t) - air) / truth.free_time_constant_s + (wall - air) / truth.wall_exchange_s + heat,
            (air - wall) / truth.wall_time_constant_s,
            (seen - body) / truth.body_time_constant_s,
            error,
        ]

    return list(solve_ivp(rates, (t0, t1), begin, rtol=1e-10, atol=1e-10, max_step=30.0).y[:, -1])


def test_air_walls_and_body_obey_their_differential_equations() -> None:
    truth, made = SLUGGISH, chamber(SLUGGISH, LAB)
    state = [*temperatures(made, 0.0), 0.0]
    state = integrated(truth, state, 0.0, HOUR, None)
    assert temperatures(made, HOUR) == pytest.approx(state[:3], abs=1e-6)

    made.command(HOUR, -60.0, ramp_degC_per_min=2.0)
    begin = state[0]
    arrival = HOUR + (begin + 60.0) / 2.0 * 60.0
    state[3] = 0.0  # the integral starts again
    state = integrated(truth, state, HOUR, arrival, lambda t: begin - 2.0 / 60.0 * (t - HOUR))
    assert temperatures(made, arrival) == pytest.approx(state[:3], abs=1e-6)
    state = integrated(truth, state, arrival, arrival + 900.0, lambda t: -60.0)
    assert temperatures(made, arrival + 900.0) == pytest.approx(state[:3], abs=1e-6)

    again = arrival + 900.0
    made.command(again, -30.0)  # no ramp: as fast as its power allows
    state = integrated(truth, state, again, again + 300.0, lambda t: -60.0 + 3.0 / 60.0 * (t - again))
    assert temperatures(made, again + 300.0) == pytest.approx(state[:3], abs=1e-6)

    made.command(again + 300.0, -30.0, controlled=False)
    state = integrated(truth, state, again + 300.0, again + 2 * HOUR, None)
    assert temperatures(made, again + 2 * HOUR) == pytest.approx(state[:3], abs=1e-6)


def test_coinciding_time_constants_are_no_trouble() -> None:
    plain = ORDINARY
    free, exchange, wall = 1 / plain.free_time_constant_s, 1 / plain.wall_exchange_s, 1 / plain.wall_time_constant_s
    fast = np.linalg.eigvals([[-free - exchange, exchange], [wall, -wall]]).min()
    truth, state = replace(plain, body_time_constant_s=-1.0 / fast), [0.0, 0.0, 0.0, 0.0]
    made = chamber(truth, LAB)
    made.assume_steady(-100.0, 0.0)
    made.command(0.0, -100.0, controlled=False)
    state[:3] = temperatures(made, 0.0)
    for hours in (0.1, 0.5, 2.0):
        assert temperatures(made, hours * HOUR) == pytest.approx(
            integrated(truth, state, 0.0, hours * HOUR, None)[:3], abs=1e-3
        )


def test_the_controllers_sensor_settles_first_and_the_body_stays_a_little_off() -> None:
    made = chamber()
    made.command(0.0, -90.0, ramp_degC_per_min=2.0)
    arrival = 55 * 60.0
    assert abs(made.air_degC(arrival + 1200.0) + 90.0) < 0.1 < abs(made.package_degC(arrival + 1200.0) + 90.0)
    assert made.air_degC(12 * HOUR) == pytest.approx(-90.0, abs=1e-6)
    assert made.package_degC(12 * HOUR) == pytest.approx(-90.0 + 0.002 * 110.0, abs=1e-3)


def test_a_weakly_damped_loop_overshoots() -> None:
    lowest = []
    for damping in (2.0, 0.8, 0.3):
        made = chamber(ChamberTruth(damping=damping))
        made.command(0.0, -40.0)
        lowest.append(min(made.air_degC(t) for t in range(0, 7200, 20)))
    assert lowest == sorted(lowest, reverse=True)
    assert lowest[2] < -42.0


def test_slew_limits_what_a_ramp_does_not() -> None:
    made = chamber(ChamberTruth(slew_degC_per_min=5.0))
    made.command(0.0, -30.0)
    assert made.active_setpoint_degC(240.0) == pytest.approx(0.0)
    made.command(240.0, -30.0, ramp_degC_per_min=1.0)
    assert made.active_setpoint_degC(840.0) == pytest.approx(-10.0)
    assert made.setpoint_degC == -30.0


def test_power_is_what_the_heat_balance_asks_for() -> None:
    made = chamber(ChamberTruth(authority_degC=200.0))
    made.command(0.0, -80.0, ramp_degC_per_min=2.0)
    assert made.power_pct(24 * HOUR) == pytest.approx(-50.0, abs=0.01)
    assert made.power_pct(1800.0) < made.power_pct(24 * HOUR)
    made.command(24 * HOUR, -80.0, controlled=False)
    assert made.power_pct(24 * HOUR + 1.0) == 0.0


def test_it_starts_at_the_laboratorys_temperature_without_control() -> None:
    made = chamber()
    assert not made.controlled
    assert temperatures(made, 0.0) == pytest.approx([20.0] * 3)
    assert temperatures(made, 9 * HOUR) == pytest.approx([20.0] * 3)


def since(made: Chamber, t: float) -> float:
    return made.temperatures.since(t)


def test_sending_it_elsewhere_is_a_change_of_temperature_and_nothing_else_is() -> None:
    made = chamber()
    made.command(100.0, -90.0)
    assert since(made, 99.0) == 0.0
    assert since(made, 100.0) == 100.0
    made.command(10 * HOUR, -90.0)  # the same again
    made.command(11 * HOUR, -89.5)  # hardly anything
    assert since(made, 12 * HOUR) == 100.0
    made.command(12 * HOUR, -88.9)  # little by little is a change too
    assert since(made, 12 * HOUR) == 12 * HOUR
    made.command(12 * HOUR + 600.0, -88.9)
    assert since(made, 13 * HOUR) == 12 * HOUR


def test_left_alone_for_long_it_has_drifted_and_is_sent_back() -> None:
    made = chamber()
    made.assume_steady(-90.0, 0.0)
    made.command(0.0, -90.0, controlled=False)
    assert not made.drifted(20.0)
    assert made.drifted(600.0)
    made.command(600.0, -90.0)
    assert since(made, 601.0) == 600.0
    assert not made.drifted(601.0)


def test_left_alone_for_a_moment_it_has_not() -> None:
    made = chamber()
    made.assume_steady(-90.0, 0.0)
    made.command(0.0, -90.0, controlled=False)
    made.command(20.0, -90.0)
    assert since(made, HOUR) == 0.0


@settings(max_examples=25)
@given(st.integers(0, 2**32))
def test_looking_at_a_chamber_changes_nothing(seed: int) -> None:
    rng = Random(seed)
    moments = sorted(rng.uniform(0, 20 * HOUR) for _ in range(6))
    commands = [(t, rng.uniform(-130, 60), rng.random() < 0.8, rng.choice([2.0, inf])) for t in moments]
    watched = [rng.uniform(moments[-1], 30 * HOUR) for _ in range(10)]

    def day(looks: int) -> list[float]:
        made, before = chamber(SLUGGISH, LAB), 0.0
        for t, setpoint, controlled, ramp in commands:
            for i in range(looks):
                at = before + (t - before) * i / looks
                temperatures(made, at)
                made.power_pct(at)
                made.drifted(at)
            made.command(t, setpoint, controlled=controlled, ramp_degC_per_min=ramp)
            before = t
        return [x for t in watched for x in (*temperatures(made, t), made.power_pct(t), since(made, t))]

    assert day(0) == day(7)


@pytest.mark.parametrize("takes_s", [0.0, 40.0, 900.0])
def test_what_lags_behind_steps_obeys_its_differential_equation(takes_s: float) -> None:
    made, tau = Steps(0.0, 14.0), 200.0
    for now, value in ((1000.0, 1.0), (2000.0, 5.0), (3000.0, 0.5)):
        made.set(now, value, takes_s)

    def path(t: float) -> float:
        value, last = 14.0, 14.0
        for now, target in ((1000.0, 1.0), (2000.0, 5.0), (3000.0, 0.5)):
            if t >= now:
                part = 1.0 if t >= now + takes_s else (t - now) / takes_s
                value, last = last + part * (target - last), target
        return value

    def rate(t: float, x: np.ndarray) -> list[float]:
        return [(path(t) - x[0]) / tau]

    for t in (1100.0, 1950.0, 2500.0, 3001.0, 3990.0):
        lagging = solve_ivp(rate, (0.0, t), [14.0], rtol=1e-9, atol=1e-9, max_step=1.0).y[0, -1]
        assert made.behind(t, tau) == pytest.approx(lagging - path(t), abs=2e-2 if takes_s == 0.0 else 1e-4)


def test_steps_know_since_when_and_which_way() -> None:
    made = Steps(5.0, 3.0)
    assert (made.value(0.0), made.since(9.0), made.direction(9.0), made.behind(9.0, 1.0)) == (3.0, 5.0, 0, 0.0)
    made.set(10.0, 4.0)
    made.set(20.0, 1.0)
    made.set(30.0, 1.0)
    assert [made.value(t) for t in (9.9, 10.0, 25.0, 40.0)] == [3.0, 4.0, 1.0, 1.0]
    assert [made.direction(t) for t in (9.9, 10.0, 25.0, 40.0)] == [0, 1, -1, -1]
    assert [made.since(t) for t in (9.9, 10.0, 25.0, 40.0)] == [5.0, 10.0, 20.0, 30.0]
