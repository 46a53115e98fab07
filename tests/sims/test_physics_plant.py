"""The plant as a whole: temperatures, sensors, and that nobody can change the truth by looking at it."""

from collections.abc import Callable
from math import inf, radians, sin, sqrt
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.sims.physics import Plant
from rig.sims.world import EPOCH_UTC, World

BENCH: dict[str, Any] = {
    "sensors": {
        "x": {"axis": "x", "reader": "scanner", "channel": "101"},
        "y": {"axis": "y", "reader": "scanner", "channel": "102"},
        "z": {"axis": "z", "reader": "scanner", "channel": "103"},
    },
    "temperatures": {
        "sensor_temperature_degC": {"reader": "scanner", "channel": "104", "place": "package"},
        "lab_temperature_degC": {"reader": "scanner", "channel": "105", "place": "lab"},
    },
}
QUIET = {"noise_V": 0.0}
STILL = {"sensors": {"x": QUIET, "y": QUIET, "z": QUIET}}
HOUR = 3600.0


def plant(world: World | None = None, **truth: Any) -> Plant:
    return Plant(world or World(), {**STILL, **truth}, BENCH)


def settled(truth: dict[str, Any], pitch: float = 30.0, roll: float = -60.0) -> tuple[World, Plant]:
    world = World()
    made = plant(world, **truth)
    made.head.move("pitch", pitch, 5.0, 5.0)
    made.head.move("roll", roll, 5.0, 5.0)
    world.sleep(100.0)
    return world, made


def read(made: Plant, sensor: str, t: float) -> float:
    return made.sensor_V(sensor, t, t + 0.2)


def test_the_lab_is_warmest_at_its_hour_every_day() -> None:
    made = plant(lab={"mean_degC": 20.0, "daily_amplitude_degC": 2.0, "warmest_hour_utc": 15.0})
    hours = np.arange(0, 48, 0.25)
    degC = np.array([made.temperature_degC("lab", h * HOUR) for h in hours])
    of_day = (EPOCH_UTC / HOUR + hours) % 24
    assert of_day[np.argmax(degC)] == pytest.approx(15.0)
    assert degC.max() == pytest.approx(22.0)
    assert degC.min() == pytest.approx(18.0)


def integrated(
    drive: Callable[[float], float], tau: float, start: float, t0: float, t1: float, dt: float = 1.0
) -> float:
    y = start
    for i in range(round((t1 - t0) / dt)):
        u = drive(t0 + (i + 0.5) * dt)
        y = u + (y - u) * np.exp(-dt / tau)
    return y


def test_enclosure_and_package_obey_their_differential_equations() -> None:
    truth = {
        "lab": {"mean_degC": 21.0, "daily_amplitude_degC": 2.0, "drift_degC_per_day": 1.0},
        "enclosure": {"leak": 0.3, "time_constant_s": 400.0, "slew_degC_per_min": 0.5},
        "package": {"thermal_time_constant_s": 1500.0},
    }
    world = World()
    made = plant(world, **truth)
    world.sleep(2 * HOUR)
    t0 = world.now()
    air, package = made.temperature_degC("enclosure", t0), made.temperature_degC("package", t0)
    made.enclosure.command(t0, 26.0)

    def setpoint(t: float) -> float:
        return min(26.0, 23.0 + 0.5 / 60.0 * (t - t0))

    def drive(t: float) -> float:
        return setpoint(t) + 0.3 * (made.temperature_degC("lab", t) - 21.0)

    for hours in (0.05, 0.2, 3.0):
        t1 = t0 + hours * HOUR
        assert made.temperature_degC("enclosure", t1) == pytest.approx(integrated(drive, 400.0, air, t0, t1), abs=2e-4)
        lagged = integrated(lambda t: made.temperature_degC("enclosure", t), 1500.0, package, t0, t1)
        assert made.temperature_degC("package", t1) == pytest.approx(lagged, abs=2e-4)


def test_without_control_the_enclosure_follows_the_lab() -> None:
    world = World()
    made = plant(world, lab={"daily_amplitude_degC": 0.0, "mean_degC": 19.0})
    made.enclosure.command(0.0, 23.0, controlled=False)
    assert made.temperature_degC("enclosure", HOUR) == pytest.approx(19.0 + 4.0 * np.exp(-1.0))
    assert made.enclosure.power_pct(HOUR) == 0.0


def test_holding_above_the_lab_takes_heating_in_proportion() -> None:
    made = plant(lab={"daily_amplitude_degC": 0.0, "mean_degC": 20.0}, enclosure={"authority_degC": 30.0})
    assert made.enclosure.power_pct(0.0) == pytest.approx(10.0)


def test_a_world_starts_steady_so_that_a_resumed_one_goes_on() -> None:
    first = plant()
    later = World(9 * HOUR)
    second = plant(later)
    for place in ("package", "enclosure", "lab"):
        assert second.temperature_degC(place, 10 * HOUR) == pytest.approx(first.temperature_degC(place, 10 * HOUR))


def test_the_enclosure_leaves_a_fraction_of_the_labs_swing() -> None:
    made = plant(lab={"daily_amplitude_degC": 2.0}, enclosure={"leak": 0.2})
    degC = [made.temperature_degC("package", h * HOUR) for h in np.arange(0, 24, 0.1)]
    assert max(degC) - min(degC) == pytest.approx(2 * 2.0 * 0.2, rel=0.01)


def test_a_clean_sensor_reads_its_equation() -> None:
    world, made = settled({}, pitch=30.0, roll=-60.0)
    x = made.truth.sensors["x"]
    assert read(made, "x", world.now()) == pytest.approx(
        x.offset_V
        + x.sensitivity_V_per_g
        * (
            np.cos(radians(x.coning_deg)) * sin(radians(30.0))
            - np.sin(radians(x.coning_deg)) * np.cos(radians(30.0)) * sin(radians(-60.0 + x.azimuth_deg))
        ),
        abs=1e-10,
    )


def test_noise_falls_with_the_square_root_of_the_integration_time() -> None:
    made = Plant(World(), {"sensors": {"x": {"noise_V": 2e-5}}}, BENCH)
    for window in (0.2, 1.0, 5.0):
        clean = read(plant(), "x", 0.0)
        readings = [made.sensor_V("x", i * 10.0, i * 10.0 + window) - clean for i in range(3000)]
        assert np.std(readings) == pytest.approx(2e-5 / sqrt(window), rel=0.05)
        assert abs(np.mean(readings)) < 4 * 2e-5 / sqrt(window) / sqrt(3000)


def test_noise_of_sensors_and_seeds_is_independent() -> None:
    noisy = {name: {"noise_V": 1e-4} for name in "xyz"}
    columns = [
        [Plant(World(), {"sensors": noisy, "seed": seed}, BENCH).sensor_V(s, t, t + 1.0) for t in range(400)]
        for seed in (1, 2)
        for s in "xyz"
    ]
    correlations = np.corrcoef(columns) - np.eye(6)
    assert abs(correlations).max() < 0.2


def test_temperature_coefficients_act_on_offset_and_sensitivity_about_their_reference() -> None:
    truth = {
        "enclosure": {"leak": 0.0, "start_setpoint_degC": 25.0},
        "effects": {
            "offset_temperature": {"uV_per_degC": {"x": 40.0}, "reference_degC": 23.0},
            "sensitivity_temperature": {"ppm_per_degC": 100.0, "reference_degC": 24.0},
        },
    }
    world, made = settled(truth)
    _, plain = settled({"enclosure": {"leak": 0.0}})
    offset = plain.truth.sensors["x"].offset_V
    clean = read(plain, "x", world.now())
    assert read(made, "x", world.now()) - clean == pytest.approx(80e-6 + 100e-6 * (clean - offset), abs=1e-10)
    clean_y = read(plain, "y", world.now())
    offset_y = plain.truth.sensors["y"].offset_V
    assert read(made, "y", world.now()) - clean_y == pytest.approx(100e-6 * (clean_y - offset_y), abs=1e-10)


def test_a_hundred_ppm_per_degree_over_a_degree_is_the_papers_uncorrected_residual() -> None:
    """Rows 28(a) and (b): temperature correction takes 7.76e-4 deg down to 3.87e-4 deg within 1 degC, +-30 deg."""
    removed = sqrt(7.76e-4**2 - 3.87e-4**2)
    pitches = np.radians(np.linspace(-30, 30, 13))
    spread_degC = 0.35  # standard deviation of a swing of 1 degC
    per_degC = radians(removed) / spread_degC / np.sqrt(np.mean(np.sin(pitches) ** 2))
    assert 80e-6 < per_degC < 150e-6


def test_drifts_grow_with_the_hours() -> None:
    effects = {"offset_drift": {"uV_per_h": 3.0}, "sensitivity_drift": {"ppm_per_h": {"x": 2.0}}}
    world, made = settled({"effects": effects})
    _, plain = settled({})
    clean = read(plain, "x", 10 * HOUR)
    expected = 30e-6 + 20e-6 * (clean - plain.truth.sensors["x"].offset_V)
    assert read(made, "x", 10 * HOUR - 0.1) - clean == pytest.approx(expected, abs=2e-9)
    assert world.now() == 100.0


def test_in_any_laboratory_a_drift_goes_on_in_a_world_that_is_resumed_or_of_the_next_day() -> None:
    bench = {"sensors": {"cell": {"reader": "dvm"}}, "factors": {"force_kN": "operator"}}
    truth = {"sensors": {"cell": {"formula": "0.002*elapsed_h", "noise": 0.0}}}
    read = [Plant(World(start), truth, bench).sensor_V("cell", start, start + 1.0) for start in (0.0, 86400.0)]
    assert read == pytest.approx([0.0, 0.048], abs=1e-6)


def test_the_pendulum_lags_so_that_settling_matters() -> None:
    world = World()
    made = plant(world, head={"creep_arcsec": 0.0})
    made.head.move("pitch", 30.0, 10.0, 10.0)
    while made.head.moving("pitch", world.now()):
        world.sleep(0.01)
    late = [read(made, "x", world.now() + wait) for wait in (0.0, 1.0, 2.0, 30.0)]
    errors = [abs(v - late[-1]) for v in late[:-1]]
    assert errors[0] > 1e-3
    assert errors[1] / errors[0] == pytest.approx(np.exp(-1.0 / 0.3), rel=0.1)
    assert errors[2] / errors[1] == pytest.approx(np.exp(-1.0 / 0.3), rel=0.1)


def test_a_window_in_motion_is_a_mean_over_it() -> None:
    world = World()
    made = plant(world)
    made.head.move("pitch", 40.0, 5.0, 5.0)
    world.sleep(5.0)
    fine = [made.sensor_V("x", 3.0 + i * 1e-3, 3.0 + (i + 1) * 1e-3) for i in range(1000)]
    assert made.sensor_V("x", 3.0, 4.0) == pytest.approx(np.mean(fine), abs=1e-6)


def test_channels_are_wired_as_the_bench_file_says() -> None:
    world, made = settled({})
    t = world.now()
    assert made.channel_V("scanner", "102", t, t + 1.0) == made.sensor_V("y", t, t + 1.0)
    assert made.channel_V("scanner", "109", t, t + 1.0) == 0.0
    assert made.channel_degC("scanner", "105", t) == made.temperature_degC("lab", t)
    assert made.channel_degC("scanner", "109", t) == inf


ALL_EFFECTS: dict[str, Any] = {
    "isolation_pad": {"pitch_compliance_deg_per_g": 1.5e-3, "roll_compliance_deg_per_g": 1e-3},
    "offset_temperature": {"uV_per_degC": 40.0},
    "sensitivity_temperature": {"ppm_per_degC": 100.0},
    "offset_drift": {"uV_per_h": 1.0},
    "sensitivity_drift": {"ppm_per_h": 1.0},
    "backlash": {"pitch_arcsec": 4.0, "roll_arcsec": 4.0},
    "second_order": {"ug_per_g2": 20.0},
    "head_error": [{"axis": "pitch", "amplitude_arcsec": 2.0}, {"axis": "roll", "amplitude_arcsec": 3.0}],
}


@settings(max_examples=25)
@given(st.integers(0, 2**32))
def test_looking_changes_nothing(seed: int) -> None:
    """Same commands at the same moments: whoever looks in between, and how often, the bits stay the same."""
    rng = Random(seed)
    moments = sorted(rng.uniform(0, 100) for _ in range(6))
    commands = [(t, rng.choice(["pitch", "roll", "enclosure"]), rng.uniform(-90, 90)) for t in moments]
    watched = [rng.uniform(0, 140) for _ in range(20)]

    def night(looks: int) -> list[float]:
        world = World()
        made = Plant(world, {"effects": ALL_EFFECTS}, BENCH)
        for t, what, value in commands:
            for _ in range(looks):
                world.sleep((t - world.now()) / 2)
                made.sensor_V("x", world.now() - 0.1, world.now())
                made.head.true_deg("roll", world.now() - 0.5)
                made.temperature_degC("package", world.now())
                made.enclosure.power_pct(world.now())
            world.run_until(t)
            if what == "enclosure":
                made.enclosure.command(t, 23.0 + value / 30.0, ramp_degC_per_min=0.2)
            else:
                made.head.move(what, value, 8.0, 16.0)
        world.run_until(150.0)
        readings = [made.sensor_V(s, t, t + 0.2) for t in watched for s in "xyz"]
        return readings + [made.temperature_degC("package", t) for t in watched]

    assert night(0) == night(7)
