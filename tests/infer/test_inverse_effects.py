"""Effects found by trace and temperature, carried into inference."""

import json
from dataclasses import replace

import numpy as np
import pytest
from test_inverse import volts

from proving.truth.attitude import D1, Bench, Sensor, simulate
from rig.fitter import RankError
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.fit import fit_attitude
from rig.procedures.attitude.infer import AttitudeCalibration, calibrate_package, infer_attitude
from rig.procedures.attitude.trace import trace

NAMES = ("x_V", "y_V", "z_V")
SEED = 3
PADS = Bench(
    sensors=tuple(Sensor(axis, S_per_degC=1.1e-4, b_per_degC=3e-5) for axis in "xyz"),
    compliance={("y", "x"): 2e-2},
    degC_daily=2.0,
    hours=20.0,
)


def contributions(found):
    out = {}
    for sensor, of_sensor in found.sensors.items():
        for effect in of_sensor.added:
            out.setdefault(effect.effect, {})[sensor] = effect.contribution_V
    return out


@pytest.fixture(scope="module")
def traced():
    print(f"seed {SEED}")
    data, _ = simulate(PADS, D1(180, 13, 13, replications=2), SEED)
    return data, contributions(trace(data, validate=False))


def worst(calibration, degC, effects_bench=PADS):
    """Largest errors of pitch and roll over their sd, and of pitch in deg, without noise."""
    rng = np.random.default_rng(SEED)
    pitch, roll = rng.uniform(-80, 80, 400), rng.uniform(-180, 180, 400)
    found = infer_attitude(
        calibration, volts(pitch, roll, NAMES, effects_bench, degC), sensor_temperature_degC=degC, noise_sd_V=1e-9
    )
    off = (found.roll_deg - roll + 180) % 360 - 180
    return (
        np.abs(found.pitch_deg - pitch) / found.pitch_sd_deg,
        np.abs(off) / found.roll_sd_deg,
        found.pitch_deg - pitch,
    )


def test_what_a_trace_found_is_applied(traced):
    data, effects = traced
    assert {"isolation-pad-deflection", "sensitivity-temperature"} <= set(effects)
    with_effects = calibrate_package(data, effects=effects)
    again = AttitudeCalibration.from_dict(json.loads(json.dumps(with_effects.to_dict())))
    without = calibrate_package(data)
    for degC in (21.5, 24.5):
        in_pitch, in_roll, error = worst(again, degC)
        assert in_pitch.max() < 6
        assert in_roll.max() < 6
        _, _, before = worst(without, degC)
        assert np.abs(error).max() < 0.02 * np.abs(before).max()


def test_an_effect_that_one_sensor_does_not_tell_from_another_is_left_to_it(traced):
    """Three sensors told the square of a voltmeter from one of a sensor, and the calibration of each had no rank."""
    data = traced[0]
    square = {"x_V": (np.sin(np.radians(data.pitch_deg)) ** 2)}
    both = {"voltmeter-nonlinearity": square, "sensor-second-order": {"x_V": 0.4 * square["x_V"]}}
    with pytest.raises(RankError, match="cannot tell apart"):
        calibrate_package(data, effects=both)
    merged = calibrate_package(data, effects=both, merge=True)
    assert any("tell it: sensor-second-order of x_V" in note for note in merged.notes)
    alone = calibrate_package(data, effects={"voltmeter-nonlinearity": square})
    np.testing.assert_allclose(merged.sigma_V, alone.sigma_V, rtol=1e-12)


def test_temperature_as_part_of_the_model(traced):
    warm = replace(PADS, compliance={})
    data, _ = simulate(warm, D1(90, 9, 9, replications=4), SEED)
    plain, corrected = calibrate_package(data), calibrate_package(data, temperature=True)
    assert {t.effect for s in corrected.sensors for t in s.terms} == {"offset-temperature", "sensitivity-temperature"}
    assert np.all(corrected.sigma_V < 0.2 * plain.sigma_V)
    in_pitch, in_roll, _ = worst(corrected, 24.5, warm)
    assert max(in_pitch.max(), in_roll.max()) < 6
    with pytest.raises(ValueError, match="temperature is needed"):
        infer_attitude(corrected, np.zeros((1, 3)))
    with pytest.raises(ValueError, match="no sensor temperature"):
        calibrate_package(replace(data, sensor_temperature_degC=None), temperature=True)


def test_what_belongs_to_the_head_is_fitted_and_left_behind():
    clean = Bench()
    bench = replace(clean, pitch_error_deg=(3e-3, 0.0, 0.0, 0.0))
    data, _ = simulate(bench, D1(180, 13, 13, replications=4), SEED)
    a = np.radians(data.pitch_deg)
    by_pitch = {"x": np.cos(a), "y": np.sin(np.radians(data.roll_deg)) * np.sin(a)}
    shape = {f"{s.axis}_V": 1e-4 * s.S * np.sin(a) * by_pitch[s.axis] for s in clean.sensors if s.axis in by_pitch}
    calibration = calibrate_package(data, ["x_V"], effects={"head-once-per-turn": shape})
    assert calibration.sensors[0].terms == ()
    assert calibration.notes == ("fitted beside the model and not applied in use: head-once-per-turn",)
    assert calibration.sigma_V[0] < 0.5 * calibrate_package(data, ["x_V"]).sigma_V[0]


def test_an_effect_that_cannot_be_carried_over_is_refused(traced):
    data, _ = traced
    walk = np.random.default_rng(SEED).normal(size=len(data))
    with pytest.raises(ValueError, match="cannot be applied"):
        calibrate_package(data, effects={"something": {"x_V": walk}})
    with pytest.raises(ValueError, match="expected"):
        calibrate_package(data, effects={"something": {"x_V": walk[:5]}})


@pytest.mark.parametrize("order", ["abba", "random"])
def test_one_by_one_or_together_without_effects(order):
    """The joint calibration has the covariance of each sensor's own fit on its diagonal."""
    data, _ = simulate(Bench(), D1(90, 7, 7, replications=3, order=order), SEED)
    together = calibrate_package(data)
    apart = AttitudeCalibration.from_fits([fit_attitude(data, name) for name in NAMES])
    for i in range(3):
        block = slice(4 * i, 4 * i + 4)
        np.testing.assert_allclose(
            together.covariance[block, block], apart.covariance[block, block], rtol=1e-9, atol=1e-20
        )
        np.testing.assert_allclose(
            together.sensors[i].coefficients, apart.sensors[i].coefficients, rtol=1e-9, atol=1e-12
        )


def test_a_run_without_roll():
    line = np.linspace(-90, 90, 37)
    zero = np.zeros_like(line)
    v = volts(line, zero, ("x_V",))[:, 0] + np.random.default_rng(SEED).normal(0, 2e-5, 37)
    data = AttitudeData(zero, np.arange(37), np.arange(37.0), line, zero, None, {"x_V": v})
    calibration = calibrate_package(data)
    assert not calibration.roll
    found = infer_attitude(calibration, v[8:29])
    np.testing.assert_allclose(found.pitch_deg, line[8:29], atol=2e-3)
    assert np.all(found.flag == "")
