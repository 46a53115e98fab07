"""Where an attitude cannot be told: nothing is given without a word, and the interval still holds the truth."""

from dataclasses import replace

import numpy as np
import pytest
from test_inverse import BENCH, PACKAGES, true_calibration, turn, volts

from proving.truth.attitude import D1, simulate
from rig.procedures.attitude.infer import calibrate_package, infer_attitude, singularity

SIGMA_V = 2e-5
SEED = 7


def noisy(pitch, roll, names, n, sensors=BENCH.sensors):
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    bench = replace(BENCH, sensors=sensors)
    v = volts(np.broadcast_to(pitch, n).astype(float), np.broadcast_to(roll, n).astype(float), names, bench)
    return v + rng.normal(0, SIGMA_V, v.shape)


def paper_determinant(package, Om, A, pitch, roll):
    """Determinant of eqs. (86), (94) for unit sensitivities; Om and A in deg by axis."""
    a, R = np.radians(pitch), np.radians(roll)
    Om, A = ({k: np.radians(v) for k, v in d.items()} for d in (Om, A))
    ca, sa, sR, cR, sin, cos = np.cos(a), np.sin(a), np.sin(R), np.cos(R), np.sin, np.cos
    xa = cos(Om["x"]) * ca + sin(Om["x"]) * sa * sin(R + A["x"])
    xR = -sin(Om["x"]) * ca * cos(R + A["x"])
    if package == "xy":
        ya = cos(Om["y"]) * sa * sR + sin(Om["y"]) * (sin(A["y"]) * ca + cos(A["y"]) * sa * cR)
        yR = -ca * (cos(Om["y"]) * cR - sin(Om["y"]) * cos(A["y"]) * sR)
    else:
        ya = cos(Om["z"]) * sa * cR + sin(Om["z"]) * (cos(A["z"]) * ca + sin(A["z"]) * sa * sR)
        yR = ca * (cos(Om["z"]) * sR - sin(Om["z"]) * sin(A["z"]) * cR)
    return xa * yR - xR * ya


def oblique(Om, A):
    return tuple(replace(s, S=1.0, b=0.0, Omega_deg=Om[s.axis], A_deg=A[s.axis]) for s in BENCH.sensors)


# figures 9(a) to (d) and 11(a) to (d)
@pytest.mark.parametrize("coning", [0.1, 1.0])
@pytest.mark.parametrize(("package", "A_x", "A_other"), [("xy", 0, 90), ("xy", 90, 90), ("xz", 90, 0), ("xz", 0, 0)])
def test_loci_of_two_axes_are_those_of_figures_9_and_11(package, A_x, A_other, coning):
    Om, A = dict.fromkeys("xyz", coning), {"x": A_x, "y": A_other, "z": A_other}
    calibration = true_calibration(PACKAGES[package], oblique(Om, A))
    pitch, roll = np.meshgrid(np.linspace(-180, 180, 61), np.linspace(-180, 180, 49))
    found = singularity(calibration, pitch, roll)
    paper = paper_determinant(package, Om, A, pitch, roll)
    norm = np.linalg.norm(np.cross(*calibration.matrix))
    sign = 1.0 if package == "xy" else -1.0  # n of x and z points against y
    np.testing.assert_allclose(sign * found * norm, np.where(found * sign * paper < 0, -1, 1) * paper, atol=1e-12)
    assert np.all(singularity(calibration, [90.0, -90.0, 90.0], [0.0, 20.0, 180.0]) == 0)
    # near level the loci are at +-90 deg of roll (0 and 180 deg), within the coning angles
    at = 90.0 if package == "xy" else 0.0
    below, above = singularity(calibration, [10.0, 10.0], [at - 2 * coning, at + 2 * coning])
    assert below * above < 0


def test_locus_of_figure_9d_departs_towards_90_deg_of_pitch():
    """A_x = 90 deg: at roll R the locus is where cos R cos a = -tan(Omega) sin a, nearly."""
    Om, A = dict.fromkeys("xyz", 1.0), {"x": 90, "y": 90, "z": 0}
    calibration = true_calibration(PACKAGES["xy"], oblique(Om, A))
    for pitch in (0.0, 60.0, 85.0, 88.0):
        roll = np.linspace(60, 179.9, 20_000)
        f = singularity(calibration, np.full(roll.shape, pitch), roll)
        crossing = roll[np.flatnonzero(np.diff(np.sign(f)))]
        assert len(crossing) == 1
        away = np.degrees(np.arcsin(min(np.tan(np.radians(1.0)) * np.tan(np.radians(pitch)), 1.0)))
        assert abs(abs(crossing[0] - 90.0) - away) < 0.05 + 0.02 * away


def test_three_axes_are_singular_at_90_deg_only_unless_far_out_of_line():
    pitch, roll = np.meshgrid(np.linspace(-89, 89, 41), np.linspace(-180, 180, 41))
    for coning in (0.1, 5.0, 9.9):
        Om, A = dict.fromkeys("xyz", coning), {"x": 90, "y": 0, "z": 0}
        f = singularity(true_calibration(PACKAGES["xyz"], oblique(Om, A)), pitch, roll)
        assert np.all(f > 0.5 * np.cos(np.radians(pitch)))
    # three axes in a plane see nothing across it: wherever that is level, on a great circle of attitudes. With
    # 45 deg of coning, as in figure 12, it takes azimuths of -90 deg; at the +90 deg of its caption nothing is singular
    for A_all, determinant in ((90.0, 2 / 2**1.5), (-90.0, 0.0)):
        Om, A = dict.fromkeys("xyz", 45.0), dict.fromkeys("xyz", A_all)
        calibration = true_calibration(PACKAGES["xyz"], oblique(Om, A))
        assert np.linalg.det(calibration.matrix) == pytest.approx(determinant, abs=1e-12)
        pitch, roll = np.meshgrid(np.linspace(-89, 89, 357), np.linspace(-180, 180, 721))
        f = singularity(calibration, pitch, roll) / np.cos(np.radians(pitch))
        assert (f.min() < 0.02) == (A_all < 0)
    up = np.degrees(np.arctan(np.sqrt(2.0) * np.sin(np.radians(45.0 + 20.0))))  # square to (1, 1, 1) at roll 20 deg
    assert singularity(calibration, up, 20.0) == pytest.approx(0.0, abs=1e-7)
    with pytest.raises(ValueError, match="lie in a plane"):
        infer_attitude(calibration, np.zeros((1, 3)))


def test_roll_at_90_deg_of_pitch_is_undetermined_while_pitch_is_not():
    names = PACKAGES["xyz"]
    for pitch in (90.0, -90.0):
        found = infer_attitude(true_calibration(names, sigma_V=SIGMA_V), noisy(pitch, 30.0, names, 1000))
        assert np.all(np.isnan(found.roll_deg))
        assert np.all(np.isinf(found.roll_sd_deg))
        assert np.all((found.roll_lo95_deg == -180) & (found.roll_hi95_deg == 180))
        assert all(f.startswith("roll is undetermined") for f in found.flag)
        np.testing.assert_allclose(found.pitch_deg, pitch, atol=2e-3)
        held = (found.pitch_lo95_deg <= pitch + 1e-12) & (pitch - 1e-12 <= found.pitch_hi95_deg)
        assert 0.93 < held.mean() <= 0.98
    # four standard deviations away from the pole nothing can be said of roll, ten away it can
    sd = np.degrees(SIGMA_V / 5.0)
    for away, open_ in ((4.0, True), (10.0, False)):
        exact = volts(np.array([90 - away * sd]), np.array([30.0]), names)
        assert np.isnan(infer_attitude(true_calibration(names, sigma_V=SIGMA_V), exact).roll_deg[0]) == open_


@pytest.mark.parametrize("away", [0.0, 0.2, 0.4, 1.0])
@pytest.mark.parametrize(("package", "fold"), [("xy", 90.0), ("xz", 0.0)])
def test_two_axes_where_their_two_solutions_meet(package, fold, away):
    """No number where it would not be one; intervals hold the truth everywhere on the way into the singular zone."""
    names, n, pitch, roll = PACKAGES[package], 2000, 25.0, fold - away
    sensors = tuple(replace(s, Omega_deg=0.0) for s in BENCH.sensors)
    side = fold - 30.0
    calibration = true_calibration(names, sensors, sigma_V=SIGMA_V)
    found = infer_attitude(calibration, noisy(pitch, roll, names, n, sensors), near_deg=(0.0, side))
    open_ = np.isnan(found.roll_deg)
    assert np.all(open_ == np.isnan(found.pitch_deg))
    assert np.all((found.flag != "") == open_)
    if away == 0:
        assert open_.mean() > 0.985  # else by a chance of more than 2.5 sd
    if away == 1:
        assert not open_.any()
    held = (found.pitch_lo95_deg <= pitch) & (pitch <= found.pitch_hi95_deg)
    assert held.mean() > 0.93
    middle, half = (found.roll_hi95_deg + found.roll_lo95_deg) / 2, (found.roll_hi95_deg - found.roll_lo95_deg) / 2
    assert np.mean(turn(middle, roll) <= half) > 0.92
    assert np.all(half[open_] < 3.0)  # wide, yet not more so than it has to be


@pytest.mark.parametrize("away", [0.0, 0.1, 0.3, 1.0])
def test_one_axis_near_90_deg(away):
    names, pitch = ("x_V",), 90.0 - away
    sensors = tuple(replace(s, Omega_deg=0.0) for s in BENCH.sensors)
    calibration = true_calibration(names, sensors, sigma_V=SIGMA_V)
    found = infer_attitude(calibration, noisy(pitch, 0.0, names, 2000, sensors), roll_deg=0.0)
    open_ = np.isnan(found.pitch_deg)
    assert open_.any() == (away < 0.5)
    assert np.all(np.isinf(found.pitch_sd_deg[open_]))
    assert np.all((found.flag != "") == open_)
    held = (found.pitch_lo95_deg <= pitch) & (pitch <= found.pitch_hi95_deg)
    assert held.mean() > 0.93
    assert np.all(found.pitch_hi95_deg[open_] - found.pitch_lo95_deg[open_] < 2.0)


def test_x_and_z_at_measured_roll_are_singular_in_one_point_only():
    """Eq. (98): at roll 90 deg the z sensor is blind, and x is at its crest at 90 deg of pitch."""
    names = PACKAGES["xz"]
    sensors = tuple(replace(s, Omega_deg=0.0) for s in BENCH.sensors)
    calibration = true_calibration(names, sensors, sigma_V=SIGMA_V)
    for roll, lost in ((0.0, False), (60.0, False), (90.0, True)):
        found = infer_attitude(calibration, noisy(90.0, roll, names, 300, sensors), roll_deg=roll)
        assert np.mean(np.isnan(found.pitch_deg) == lost) > 0.98
        held = (found.pitch_lo95_deg <= 90) & (found.pitch_hi95_deg >= 90)
        assert held.mean() > 0.91
        if not lost:
            a, R = np.radians(90.0), np.radians(roll)
            eq98 = (1 - np.cos(R) ** 2) * np.cos(a) ** 2 + np.cos(R) ** 2
            sd = np.degrees(SIGMA_V / 4.9 / np.sqrt(eq98))
            np.testing.assert_allclose(found.pitch_sd_deg, sd, rtol=0.01)


def test_outputs_that_no_attitude_gives():
    one, two = true_calibration(("x_V",)), true_calibration(PACKAGES["xy"])
    for found in (
        infer_attitude(one, [[5.2]], roll_deg=0.0),
        infer_attitude(two, [[4.0, 4.0]]),
        infer_attitude(one, [[np.nan]], roll_deg=0.0),
        infer_attitude(one, [[0.1]], roll_deg=np.nan),
    ):
        assert np.isnan(found.pitch_deg[0])
        assert found.pitch_lo95_deg[0] == -np.inf
        assert found.flag[0] in ("no attitude gives these outputs", "not a finite number")
    three = true_calibration(PACKAGES["xyz"])
    found = infer_attitude(three, [[0.0, 0.0, 0.0], [0.002, -0.003, 0.001], [1e300, 1.0, 1.0], [4.0, 4.0, 4.0]])
    assert list(found.flag) == ["no attitude gives these outputs"] * 4
    assert np.isnan(found.pitch_deg).all()
    assert np.all(found.pitch_hi95_deg == np.inf)
    # 1.001 g: an angle, and a word of warning
    pulled = 1.001 * (volts(np.array([10.0]), np.array([20.0]), PACKAGES["xyz"]) - three.offsets_V) + three.offsets_V
    found = infer_attitude(three, pulled)
    assert "1 g" in found.flag[0]
    assert found.pitch_deg[0] == pytest.approx(10.0, abs=1e-3)


def test_what_is_outside_the_calibrated_range_is_flagged():
    names = PACKAGES["xyz"]
    calibration = replace(true_calibration(names), pitch_range_deg=(-30.0, 30.0), roll_range_deg=(-90.0, 90.0))
    pitch, roll = np.array([10.0, 29.99, 40.0, 10.0, 170.0]), np.array([20.0, 90.0, 0.0, 150.0, -160.0])
    found = infer_attitude(calibration, volts(pitch, roll, names))
    assert [bool(f) for f in found.flag] == [False, False, True, True, False]  # the last is the attitude (10, 20)
    assert found.flag[2] == "outside the calibrated -30 to 30 deg of pitch and -90 to 90 deg of roll"
    warm = replace(calibration, degC_range=(20.0, 25.0))
    found = infer_attitude(warm, volts(pitch, roll, names), sensor_temperature_degC=[21.0, 30.0, 21.0, 21.0, np.nan])
    assert "20 to 25 degC" in found.flag[1]
    assert "20 to 25 degC" in found.flag[4]
    assert found.pitch_deg[4] == pytest.approx(10.0)  # temperature is no part of this calibration's model


def test_pitch_up_or_down_of_y_and_z_must_be_said():
    names = ("y_V", "z_V")
    calibration = true_calibration(names)
    v = volts(np.array([20.0, -20.0]), np.array([30.0, 30.0]), names)
    with pytest.raises(ValueError, match="give an attitude near the true one"):
        infer_attitude(calibration, v)
    found = infer_attitude(calibration, v, near_deg=([30.0, -30.0], 0.0))
    np.testing.assert_allclose(found.pitch_deg, [20.0, -20.0], atol=1e-9)
    with pytest.raises(ValueError, match="between the two solutions"):
        infer_attitude(
            true_calibration(PACKAGES["xy"], oblique(dict.fromkeys("xyz", 0.0), dict.fromkeys("xyz", 0.0))),
            v,
            near_deg=(90.0, 0.0),
        )


def test_intervals_hold_over_calibrations():
    """Calibrations drawn again and again; the whole campaign is proving/statistics/inference.py."""
    held = []
    pitch, roll = np.array([0.0, 45.0, -80.0, 85.0]), np.array([10.0, -170.0, 60.0, -30.0])
    names = PACKAGES["xyz"]
    for seed in range(150):
        calibration = calibrate_package(simulate(BENCH, D1(90, 5, 4, replications=1), seed)[0])
        rng = np.random.default_rng(10_000 + seed)
        sigma = np.radians(BENCH.sigma_deg) * np.array([s.S for s in BENCH.sensors])
        found = infer_attitude(calibration, volts(pitch, roll, names) + rng.normal(size=(4, 3)) * sigma)
        held.append((found.pitch_lo95_deg <= pitch) & (pitch <= found.pitch_hi95_deg))
        held.append(turn(found.roll_deg, roll) <= found.roll_hi95_deg - found.roll_deg)
    assert 0.925 < np.mean(held) < 0.975
