"""The attitude models against rotations (appendix A) and against the figures of NASA/TP-1999-209835."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proving.truth.attitude import D1, Bench, Sensor, simulate
from rig.fitter import RankError, least_squares
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.fit import fit_attitude
from rig.procedures.attitude.infer import calibrate_package
from rig.procedures.attitude.model import (
    COLUMNS,
    COLUMNS_NO_ROLL,
    attitude_columns,
    attitude_parameters,
    linear_coefficients,
    no_roll_parameters,
    nominal_axis,
    sigma_deg,
    variance_function,
)

angles = st.floats(-180, 180)


@settings(max_examples=60, deadline=None)
@given(
    axis=st.sampled_from("xyz"),
    b=st.floats(-1, 1),
    S=st.floats(0.1, 10),
    Omega=st.floats(0, 179),
    A=angles,
    pitch=angles,
    roll=angles,
)
def test_linear_model_is_the_rotated_sensor(axis, b, S, Omega, A, pitch, roll):
    truth = Bench(sensors=(Sensor(axis, b, S, Omega, A),))
    one = np.array([pitch]), np.array([roll])
    volts = truth.outputs(*one, np.array([23.0]), np.array([14.0]), np.zeros(1), np.zeros(1), np.zeros(1))
    c = linear_coefficients("xyz".index(axis), b, S, Omega, A)
    assert (attitude_columns(*one) @ c)[0] == pytest.approx(volts[f"{axis}_V"][0], abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(axis=st.integers(0, 2), S=st.floats(0.1, 10), Omega=st.floats(1e-3, 179), A=st.floats(-179.9, 180))
def test_parameters_and_back_and_their_covariance(axis, S, Omega, A):
    values = np.array([0.3, S, Omega, A])
    c = linear_coefficients(axis, *values)
    root = np.random.default_rng(1).normal(size=(4, 4)) * 1e-6
    p = attitude_parameters(axis, c, root @ root.T)
    np.testing.assert_allclose([p.b_V, p.S_V, p.Omega_deg, p.A_deg], values, rtol=1e-9, atol=1e-9)
    # the forward map differentiated numerically must carry the parameters' covariance back to the coefficients'
    step = np.array([1e-3, S * 1e-5, min(Omega, 1.0) * 1e-3, 1e-2])
    forward = np.column_stack(
        [
            (linear_coefficients(axis, *(values + h)) - linear_coefficients(axis, *(values - h))) / (2 * h.sum())
            for h in np.diag(step)
        ]
    )
    back = forward @ p.covariance @ forward.T
    np.testing.assert_allclose(back, root @ root.T, rtol=1e-4, atol=1e-6 * np.abs(root @ root.T).max())


def test_without_coning_azimuth_is_undefined_and_nothing_else():
    p = attitude_parameters(0, linear_coefficients(0, 0.0, 5.0, 0.0, 45.0), np.diag([1.0, 4.0, 9.0, 9.0]) * 1e-12)
    assert p.Omega_deg == 0
    assert np.isnan(p.A_deg)
    assert np.isnan(p.stderr[3])
    np.testing.assert_allclose(p.stderr[:3], [1e-6, 2e-6, np.degrees(3e-6 / 5.0)])


def test_sensor_without_roll_is_eq_1():
    pitch = np.linspace(-36, 36, 37)
    phi = np.radians(0.4)
    volts = 0.01 + 5.0 * np.sin(np.radians(pitch) - phi)
    fit = least_squares(attitude_columns(pitch, 0 * pitch, roll=False), volts, COLUMNS_NO_ROLL)
    p = no_roll_parameters(fit.coefficients, np.eye(3))
    np.testing.assert_allclose([p.b_V, p.S_V, p.phi_deg], [0.01, 5.0, 0.4], rtol=1e-9)
    d = p.covariance[2, 2]
    assert d == pytest.approx(np.degrees(1 / 5.0) ** 2)


def test_axis_by_name_or_by_what_the_sensor_feels():
    backwards = linear_coefficients(2, 0.0, 5.0, 178.0, 10.0)
    assert nominal_axis("x_V", backwards) == 0
    assert nominal_axis("unit_7_V", backwards) == 2


@pytest.mark.parametrize("axis", "xyz")
def test_a_whole_calibration_finds_the_truth(axis):
    truth = Sensor(axis, b=-0.004, S=4.7, Omega_deg=1.3, A_deg=-130.0)
    data, clean = simulate(Bench(sensors=(truth,)), D1(90, 19), seed=4)
    fit = fit_attitude(data, f"{axis}_V")
    p = fit.parameters
    pull = (np.array([p.b_V, p.S_V, p.Omega_deg, p.A_deg]) - [-0.004, 4.7, 1.3, -130.0]) / p.stderr
    assert np.all(np.abs(pull) < 4)
    assert fit.model == f"attitude-{axis}"
    assert sigma_deg(fit.linear.sigma, p.S_V) == pytest.approx(1.5e-4, rel=0.05)
    error = fit.predict(data.pitch_deg, data.roll_deg) - clean[f"{axis}_V"]
    half = fit.linear.confidence(fit.columns(data.pitch_deg, data.roll_deg), level=0.9999)
    assert np.mean(np.abs(error) < half) > 0.95


ROLL_64 = np.arange(64) * 360 / 64 - 180


@pytest.mark.parametrize(
    ("calibrated", "used", "figure"),
    [
        (30, 30, 1.989),
        (45, 45, 1.993),
        (45, 30, 1.927),
        (90, 90, 2.008),
        (90, 30, 2.222),
        (180, 180, 1.993),
        (180, 30, 2.174),
    ],
)
def test_table_1(calibrated, used, figure):
    pitch, roll = np.meshgrid(np.linspace(-calibrated, calibrated, 33), ROLL_64)
    design = attitude_columns(pitch.ravel(), roll.ravel())
    at = np.linspace(-used, used, 2001)
    mean = variance_function(design, attitude_columns(at, np.full_like(at, 12.0))).mean()
    assert np.sqrt(len(design) * mean) == pytest.approx(figure, abs=6e-4)


def test_tumble_designs():
    at = attitude_columns(*np.random.default_rng(0).uniform(-180, 180, (2, 50)))
    six = attitude_columns(np.array([-90.0, 0, 90, 180, 0, 0]), np.array([0.0, 0, 0, 0, 90, -90]))
    np.testing.assert_allclose(variance_function(six, at), 2 / 3)  # eq. (69)
    pitch = np.array([-90.0, 0, 90, 180])
    four = attitude_columns(pitch, 0 * pitch, roll=False)
    line = np.linspace(-180, 180, 50)
    np.testing.assert_allclose(variance_function(four, attitude_columns(line, line, roll=False)), 3 / 4)  # eq. (71)


def test_variance_of_design_D1():
    n, m = 33, 64
    pitch, roll = np.meshgrid(np.linspace(-30, 30, n), ROLL_64)
    at = np.linspace(-60, 60, 41)
    c2 = np.cos(2 * np.radians(np.linspace(-30, 30, n))).sum()
    cos = np.cos(np.radians(at)) ** 2
    eq_66 = 1 / (m * n) + 2 * (n + c2 + (n - 3 * c2) * cos) / (m * (n**2 - c2**2))
    h = attitude_columns(pitch.ravel(), roll.ravel())
    for level in (0.0, 77.0):  # Theorem IV: independent of roll
        np.testing.assert_allclose(variance_function(h, attitude_columns(at, np.full_like(at, level))), eq_66)
    # eq. (67) with the errata: C_a wherever cos a stands beside it
    c1 = np.cos(np.radians(np.linspace(-30, 30, n))).sum()
    ca, sa = np.cos(np.radians(at)), np.sin(np.radians(at))
    eq_67 = ((n + c2) / 2 - 2 * c1 * ca + n * ca**2) / (n * (n + c2) / 2 - c1**2) + 2 * sa**2 / (n - c2)
    line = np.linspace(-30, 30, n)
    h = attitude_columns(line, 0 * line, roll=False)
    np.testing.assert_allclose(variance_function(h, attitude_columns(at, 0 * at, roll=False)), eq_67)
    assert eq_67[20] == pytest.approx(0.06876, abs=5e-6)


def test_variance_is_the_same_for_all_sensors():
    """Theorems I to III: whichever sensor, and however mounted, the normalised output variance is the same."""
    data, _ = simulate(Bench(), D1(45, 9), seed=0)
    at = attitude_columns(np.array([5.0, 80.0]), np.array([30.0, -60.0]))
    per_sensor = [fit_attitude(data, s).linear.variance_function(at) for s in data.sensors]
    np.testing.assert_allclose(per_sensor[1:], [per_sensor[0]] * 2)


def rows(**changes):
    n = 12
    base = {
        "replicate": np.repeat([1, 2], n // 2),
        "order": np.arange(n),
        "elapsed_s": np.arange(n) * 30.0,
        "pitch_deg": np.tile([-30.0, 0, 30, 30, 0, -30], 2),
        "roll_deg": np.zeros(n),
        "sensor_temperature_degC": np.full(n, 23.0),
        "outputs": {"x_V": np.sin(np.arange(n))},
    }
    return base | changes


def test_points_attitudes_and_sides():
    data = AttitudeData(**rows())
    assert not data.has_roll
    assert data.point.max() + 1 == 6  # up and back: each visit its own point
    np.testing.assert_array_equal(data.point[:6], data.point[6:])
    np.testing.assert_array_equal(data.pitch_side, [0, 1, 1, 1, -1, -1, -1, 1, 1, 1, -1, -1])
    night, _ = simulate(Bench(), D1(180, 37), seed=0)
    assert (night.point.max() + 1, night.attitude.max() + 1) == (481, 206)
    noise = np.random.default_rng(0).normal(0, 1e-4, (2, len(night)))
    fields = {name: getattr(night, name) for name in ("replicate", "order", "elapsed_s", "sensor_temperature_degC")}
    read_back = AttitudeData(
        **fields, pitch_deg=night.pitch_deg + noise[0], roll_deg=night.roll_deg + noise[1], outputs=night.outputs
    )
    np.testing.assert_array_equal(read_back.point, night.point)
    assert read_back.attitude.max() + 1 == 206


def test_sides_do_not_depend_on_the_order_of_rows():
    data, _ = simulate(Bench(), D1(90, 7), seed=0)
    shuffled = data.take(np.random.default_rng(0).permutation(len(data)))
    bare = AttitudeData(
        **{name: getattr(shuffled, name) for name in rows() if name not in ("outputs",)}, outputs=shuffled.outputs
    )
    known = bare.roll_side != 0
    np.testing.assert_array_equal(bare.roll_side[known & (bare.roll_deg % 180 != 0)] != 0, True)
    order = np.argsort(bare.order)
    np.testing.assert_array_equal(bare.point[order], data.point[np.argsort(data.order)])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"pitch_deg": np.zeros(5)}, "pitch_deg: expected 12 values"),
        ({"elapsed_s": np.full(12, np.nan)}, "elapsed_s: row 0 holds nan"),
        ({"outputs": {"x_V": np.r_[np.zeros(11), np.inf]}}, "x_V: row 11 holds inf"),
        ({"outputs": {}}, "no sensor output"),
        ({"order": np.zeros(12)}, "same executed position"),
        ({"replicate": np.full(12, 1.5)}, "replicate: row 0 holds 1.5, not a whole number"),
        ({"order": np.zeros(0)}, "no observations"),
    ],
)
def test_what_cannot_be_fitted_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        AttitudeData(**rows(**changes))


def test_a_design_that_does_not_determine_the_model():
    data = AttitudeData(**rows(pitch_deg=np.zeros(12), roll_deg=np.tile([0.0, 90, 180], 4)))
    with pytest.raises(RankError, match=r"sin\(pitch\)"):
        fit_attitude(data, "x_V")


def test_a_sensor_that_is_not_connected():
    with pytest.raises(ValueError, match="x_V reads 0 V at every attitude"):
        fit_attitude(AttitudeData(**rows(outputs={"x_V": np.zeros(12)})), "x_V")


def test_json_has_no_nan():
    data = AttitudeData(**rows())
    found = fit_attitude(data, "x_V").to_dict()
    assert found["model"] == "attitude-no-roll"
    assert found["points"] == 12
    assert all(value == value for value in found.values())  # noqa: PLR0124 - NaN is what differs from itself
    assert set(found["coefficients"]) == set(COLUMNS_NO_ROLL)
    assert len(COLUMNS) == 4


@pytest.mark.parametrize("angle", [-540, -270, -180, -90, 0, 90, 180, 360, 450])
def test_columns_are_exact_at_quarter_turns(angle):
    quarter = angle // 90 % 4
    assert attitude_columns(np.array([angle]), np.zeros(1))[0, 1] == (0, 1, 0, -1)[quarter]
    assert attitude_columns(np.array([angle]), np.zeros(1), roll=False)[0, 2] == (1, 0, -1, 0)[quarter]


@given(pitch=st.floats(-720, 720), roll=st.floats(-720, 720))
def test_columns_are_those_of_radians_elsewhere(pitch, roll):
    a, r = np.radians(pitch), np.radians(roll)
    expected = [1.0, np.sin(a), np.cos(a) * np.sin(r), np.cos(a) * np.cos(r)]
    np.testing.assert_allclose(attitude_columns(np.array([pitch]), np.array([roll]))[0], expected, atol=1e-14)


@pytest.mark.parametrize("readback_deg", [0.0, 1e-3])
def test_a_design_without_pitch_is_refused(readback_deg):
    """Pitch of -180, 0 and 180 deg never tilts the package; neither rounding nor readback noise is a measurement."""
    pitch, roll = (a.ravel() for a in np.meshgrid([-180.0, 0.0, 180.0], [-180.0, -60.0, 60.0, 180.0]))
    rng = np.random.default_rng(0)
    pitch = pitch + rng.normal(0, readback_deg, pitch.size) if readback_deg else pitch
    h = attitude_columns(pitch, roll)
    data = AttitudeData(
        replicate=np.ones(12),
        order=np.arange(12),
        elapsed_s=np.arange(12.0),
        pitch_deg=pitch,
        roll_deg=roll,
        sensor_temperature_degC=np.full(12, 23.0),
        outputs={"x_V": h @ [0.002, 5.0, 0.01, 0.03] + rng.normal(0, 1e-5, 12)},
    )
    with pytest.raises(RankError, match=r"do not determine sin\(pitch\): zero"):
        fit_attitude(data, "x_V")
    with pytest.raises(RankError, match=r"do not determine sin\(pitch\): zero"):
        variance_function(h, h)


def test_a_variance_function_of_too_few_angles_is_refused():
    h = attitude_columns(np.array([-60.0, 60.0, -60.0, 60.0]), np.zeros(4), roll=False)
    with pytest.raises(RankError, match=r"cannot tell apart: 1, cos\(pitch\)"):
        variance_function(h, h)


def test_axes_may_be_told_and_go_where_the_data_go():
    """A y sensor on a channel whose name begins with z: the paper's Omega is small only about its own axis."""
    data, _ = simulate(Bench(sensors=(Sensor("y"),)), D1(90, 7, 5, replications=2), seed=0)
    renamed = replace(data, outputs={"zulu": data.outputs["y_V"]})
    assert fit_attitude(renamed, "zulu").model == "attitude-z"
    told = replace(renamed, axes={"zulu": "y"}).take(np.arange(len(data))[5:])
    fit = fit_attitude(told, "zulu")
    assert fit.model == "attitude-y"
    assert fit.parameters.Omega_deg == pytest.approx(0.6, abs=0.01)
    unnamed = replace(data, outputs={"out1": data.outputs["y_V"]}, axes={})
    assert fit_attitude(unnamed, "out1").model == "attitude-y"
    with pytest.raises(ValueError, match="out1 is along 'w', not x, y or z"):
        replace(unnamed, axes={"out1": "w"})
    with pytest.raises(ValueError, match="there is no output out2, only out1"):
        replace(unnamed, axes={"out2": "x"})


def leaning(axis, Omega_deg, A_deg, errors_V, S=5.0):
    """Parameters of a sensor whose sensitive axis has these standard errors, V/g, along x, y and z."""
    return attitude_parameters(axis, linear_coefficients(axis, 0.0, S, Omega_deg, A_deg), np.diag([0, *errors_V]) ** 2)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("A", [-179.0, -60.0, 0.0, 45.0, 179.0])
def test_the_interval_of_azimuth_is_all_directions_across_which_the_axis_does_not_lean(axis, A):
    """Fieller's set by its definition, on a grid of azimuths, with unequal errors."""
    errors = np.roll([1e-4, 2e-4, 1e-4], axis)
    p = leaning(axis, 0.02, A, errors)
    low, high = p.intervals(60)[3]
    j, k = (axis + 1) % 3, (axis + 2) % 3
    azimuth = np.radians(np.linspace(low - 90.0, low + 90.0, 180_001))
    across = -np.sin(azimuth) * p.m_V[j] + np.cos(azimuth) * p.m_V[k]
    error = np.hypot(np.sin(azimuth) * errors[j], np.cos(azimuth) * errors[k])
    inside = np.degrees(azimuth[np.abs(across) <= 2.0003 * error])  # Student's t at 95 %, 60 degrees of freedom
    np.testing.assert_allclose([low, high], [inside.min(), inside.max()], atol=2e-3)
    assert low < A < high
    assert high - low < 60


def test_an_axis_that_leans_too_little_has_no_azimuth_but_its_components():
    error = 1e-4
    sd_deg = np.degrees(error / 5.0)
    for Omega in (4.9 * sd_deg, 180.0 - 4.9 * sd_deg):
        p = leaning(0, Omega, 45.0, [error] * 3)
        assert p.intervals(60)[2:] == (None, None)
        np.testing.assert_allclose(np.sqrt(np.diag(p.m_covariance)), error)
    for Omega in (5.1 * sd_deg, 180.0 - 5.1 * sd_deg):
        assert None not in leaning(0, Omega, 45.0, [error] * 3).intervals(60)
    data, _ = simulate(Bench(sensors=(Sensor("x", Omega_deg=0.0),)), D1(90, 7, 5, replications=2), seed=3)
    table = fit_attitude(data, "x_V").to_dict()["parameters"]
    assert table["A_deg"]["interval95"] is table["A_deg"]["stderr"] is table["Omega_deg"]["stderr"] is None
    low, high = table["mx_V"]["interval95"]
    assert low < 5.0 < high
    assert high - low < 1e-3


def test_offset_and_sensitivity_over_temperature_against_the_normal_equations():
    """Temperature follows pitch in part, so that leaving it out would bias the sensitivity."""
    rng = np.random.default_rng(8)
    bench = Bench(sensors=(Sensor("x", b_per_degC=3e-4, S_per_degC=1e-4),))
    data, _ = simulate(bench, D1(90, 7, 5, replications=3), seed=2)
    degC = 22.0 + np.sin(np.radians(data.pitch_deg)) + rng.normal(0, 0.5, len(data))
    zero = np.zeros(len(data))
    volts = bench.outputs(data.pitch_deg, data.roll_deg, degC, degC, zero, zero, zero)["x_V"]
    data = replace(data, sensor_temperature_degC=degC, outputs={"x_V": volts + rng.normal(0, 2e-5, len(data))})
    fit = fit_attitude(data, "x_V", temperature=True)
    g, w = data.g_M, degC - degC.mean()
    m = fit.parameters.m_V
    X = np.column_stack([np.ones(len(data)), g, w, w * (g @ m) / np.linalg.norm(m)])
    c = np.linalg.solve(X.T @ X, X.T @ data.outputs["x_V"])
    sigma = np.sqrt(np.sum((data.outputs["x_V"] - X @ c) ** 2) / (len(data) - 6))
    errors = sigma * np.sqrt(np.diag(np.linalg.inv(X.T @ X)))
    np.testing.assert_allclose(m, c[1:4], atol=0.01 * errors[1:4].min())
    np.testing.assert_allclose(np.sqrt(np.diag(fit.parameters.m_covariance)), errors[1:4], rtol=1e-3)
    np.testing.assert_allclose(fit.temperature.coefficients, c[4:], atol=0.01 * errors[4:].min())
    np.testing.assert_allclose(np.sqrt(np.diag(fit.temperature.covariance)), errors[4:], rtol=1e-3)
    assert fit.linear.df == len(data) - 6
    assert fit.replication.sigma_E == pytest.approx(sigma, rel=1e-4)
    table = fit.to_dict()["parameters"]
    assert table["dbdT_uV_per_degC"]["estimate"] == pytest.approx(1e6 * 3e-4, abs=4e6 * errors[4])
    assert table["dSdT_ppm_per_degC"]["estimate"] == pytest.approx(1e6 * 1e-4, abs=4e6 * errors[5])


def test_a_calibration_without_effects_keeps_no_copies_of_the_model():
    """Of a million rows it took 34 numbers a row beside what a fit already has: 145 MB of `rig fit`."""
    data, _ = simulate(Bench(), D1(180, 37, 13), 0)
    calibrate_package(data)
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        calibrate_package(data)
        peak = tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
    assert peak < 27 * 8 * len(data)
