"""Three axes, fast: the same attitudes as by iteration to the end; and the document's example."""

import re
from dataclasses import fields, replace
from pathlib import Path
from threading import get_ident

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import special
from scipy.optimize import least_squares
from test_inverse import BENCH, PACKAGES, attitudes, true_calibration, volts

from proving.truth.attitude import D1, Bench, simulate
from rig.procedures.attitude.infer import AttitudeCalibration, SensorModel, ThreeAxis, blocks, infer_attitude
from rig.procedures.attitude.infer import infer as of_readings
from rig.procedures.attitude.infer.package import Noise, Propagation, angles, directions, gravity, t_limits
from rig.procedures.attitude.infer.tangent import Tangent
from rig.procedures.attitude.infer.three_axis import CHUNK

NAMES = PACKAGES["xyz"]
DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "how_to" / "inference.md"


def apart(a, b):
    """Greatest angle between attitudes given as (pitch, roll) in deg, rad."""
    (pa, ra), (pb, rb) = a, b
    up = np.abs(np.radians(pa - pb))
    around = np.abs(np.radians((ra - rb + 180) % 360 - 180)) * np.cos(np.radians(pa))
    return max(up.max(), around.max())


@pytest.mark.parametrize(
    ("noise", "ratio", "steps", "within"),
    [
        (1e-5, 1.0, 1, 1e-9),
        (1e-5, 10.0, 1, 1e-8),
        (1e-4, 1.0, 1, 1e-9),
        (1e-4, 10.0, 2, 1e-9),
        (1e-3, 1.0, 2, 1e-9),
    ],
)
def test_corrections_reach_least_squares(noise, ratio, steps, within):
    """Noise in g, y and z weighed as `ratio` times worse than x: errors against iteration to the end, rad."""
    calibration = true_calibration(NAMES)
    three = ThreeAxis.of(calibration.offsets_V, calibration.matrix, np.array([1.0, ratio, ratio]))
    pitch, roll, rng = attitudes(20_000, pitch=89.9)
    v = volts(pitch, roll, NAMES) + rng.normal(0, 5 * noise, (20_000, 3))
    assert apart(three.angles_deg(v, steps), three.angles_deg(v, 8)) < within


def test_fast_and_full_are_one_across_chunks():
    calibration = true_calibration(NAMES)
    three = ThreeAxis.of(calibration.offsets_V, calibration.matrix, calibration.sigma_V)
    pitch, roll, _ = attitudes(CHUNK + 7)
    v = volts(pitch, roll, NAMES)
    fast, full = three.angles_deg(v), infer_attitude(calibration, v)
    assert apart(fast, (pitch, roll)) < 1e-12
    assert apart(fast, (full.pitch_deg, full.roll_deg)) < 1e-12
    assert [len(a) for a in three.angles_deg(np.empty((0, 3)))] == [0, 0]
    assert len(infer_attitude(calibration, np.empty((0, 3))).flag) == 0
    bad = v[:3].copy()
    bad[1, 2] = np.nan
    assert list(np.isnan(three.angles_deg(bad)[0])) == [False, True, False]
    with pytest.raises(ValueError, match="expected as"):
        three.angles_deg(v[:, :2])


def test_more_sensors_than_three():
    calibration = true_calibration(NAMES)
    doubled = (*calibration.sensors, SensorModel("x2_V", "x", calibration.sensors[0].coefficients * 0.9, 3e-5, 50.0))
    four = AttitudeCalibration(doubled, 1e-14 * np.eye(16), (-180, 180), (-180, 180))
    pitch, roll, rng = attitudes(20)
    exact = volts(pitch, roll, NAMES)
    v = np.column_stack([exact, 0.9 * exact[:, 0]]) + rng.normal(size=(20, 4)) * four.sigma_V
    found = infer_attitude(four, v)
    for i in range(20):

        def misfit(z, row=v[i]):
            g = np.array([np.sin(z[0]), -np.sin(z[1]) * np.cos(z[0]), -np.cos(z[1]) * np.cos(z[0])])
            return (row - four.offsets_V - four.matrix @ g) / four.sigma_V

        best = least_squares(misfit, np.radians([pitch[i], roll[i]]), method="lm", xtol=1e-15, ftol=1e-15).x
        np.testing.assert_allclose([found.pitch_deg[i], found.roll_deg[i]], np.degrees(best), atol=1e-7)


@settings(max_examples=60, deadline=None)
@given(
    pitch=st.floats(-89.5, 89.5),
    roll=st.floats(-180, 180),
    scale=st.floats(0.5, 2.0),
    package=st.sampled_from(["xy", "xz", "xyz"]),
)
def test_there_and_back(pitch, roll, scale, package):
    """Any attitude comes back, or is flagged; a sensor's unit of volts makes no difference."""
    calibration = true_calibration(PACKAGES[package])
    one = volts(np.array([pitch]), np.array([roll]), PACKAGES[package])
    found = infer_attitude(calibration, one, near_deg=(pitch, roll))
    if not found.flag[0]:
        assert apart(([pitch], np.array([roll])), (found.pitch_deg, found.roll_deg)) < 1e-8
    other = AttitudeCalibration.from_dict(_scaled(calibration.to_dict(), scale))
    again = infer_attitude(other, one * scale, near_deg=(pitch, roll))
    np.testing.assert_allclose(again.pitch_sd_deg, found.pitch_sd_deg, rtol=1e-6)


def _scaled(calibration, scale):
    for sensor in calibration["sensors"]:
        sensor["coefficients"] = [scale * c for c in sensor["coefficients"]]
        sensor["sigma_V"] *= scale
    calibration["covariance"] = (scale**2 * np.array(calibration["covariance"])).tolist()
    return calibration


def test_limits_of_t():
    df = np.array([1.0, 2.5, 19.9, 20.0, 33.0, 243.0, 1e5, np.inf])
    exact = special.stdtrit(np.minimum(df, 1e12), 0.975)
    np.testing.assert_allclose(t_limits(df), exact, rtol=3e-7)


def test_example_of_the_document():
    text = DOCUMENT.read_text(encoding="utf-8")
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL)[1]
    data, _ = simulate(Bench(), D1(90, 7, 8, replications=2), 0)
    space = {"data": data, "outputs_V": volts(np.array([12.0]), np.array([-30.0]), NAMES, BENCH)}
    exec(code, space)
    assert space["found"].pitch_deg[0] == pytest.approx(12.0, abs=1e-3)
    assert space["found"].roll_deg[0] == pytest.approx(-30.0, abs=1e-3)


def test_angles_by_half_angles_are_those_of_arctan2_in_every_octant_and_on_every_axis():
    rng = np.random.default_rng(3)
    axes = np.array([[x, y, z] for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0) for z in (-1.0, 0.0, 1.0)]).T
    g = np.concatenate([axes, rng.normal(size=(3, 2000)), rng.normal(size=(3, 500)) * [[1.0], [1e-9], [1e-9]]], axis=1)
    pitch, roll = angles(g)
    assert np.abs(pitch - np.arctan2(g[0], np.hypot(g[1], g[2]))).max() < 5e-16
    assert np.abs(roll - np.arctan2(-g[1], -g[2])).max() < 1e-15


@pytest.mark.parametrize("count", [2, 3, 4])
def test_gains_are_those_of_weighted_least_squares_in_the_tangent_plane(count):
    rng = np.random.default_rng(count)
    matrix, weights = rng.normal(size=(count, 3)), rng.uniform(0.1, 10.0, count)
    g = rng.normal(size=(3, 50))
    g /= np.linalg.norm(g, axis=0)
    turns, c = directions(g)
    assert np.allclose(c, np.hypot(g[1], g[2]), rtol=1e-14)
    found, cosine = Tangent.of(matrix, weights).gains(g)
    assert np.array_equal(cosine, c)
    for i in range(g.shape[1]):
        plane = turns[:, :, i]
        assert np.allclose(np.column_stack([plane, g[:, i]]).T @ plane, np.eye(3)[:, :2], atol=1e-15)
        slopes = matrix @ plane
        by_hand = np.linalg.solve(slopes.T * weights @ slopes, slopes.T * weights)
        assert np.allclose(found[:, :, i].T, by_hand, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("same_points", [True, False])
def test_variances_of_both_angles_at_once_are_those_of_the_whole_covariance(same_points):
    calibration = true_calibration(NAMES)
    rng = np.random.default_rng(7)
    root = np.kron(rng.normal(size=(3, 3)), rng.normal(size=(4, 4))) if same_points else rng.normal(size=(12, 12))
    calibration = replace(calibration, covariance=1e-12 * root @ root.T)
    assert (calibration.alike is not None) == same_points
    pitch, roll, _ = attitudes(40, pitch=80.0)
    g = gravity(np.radians(pitch), np.radians(roll))
    noise = Noise(calibration.sigma_V**2, of_fit=True)
    gains, _ = Tangent.of(calibration.matrix, 1.0 / noise.variance).gains(g)
    found = Propagation.at(calibration, noise, g, np.zeros(40)).spread(gains)
    columns = np.stack([np.ones(40), g[0], -g[1], -g[2]])
    moved = (gains[:, None] * columns[None, :, None]).reshape(12, 2, 40)
    whole = np.einsum("akn,ab,bkn->kn", moved, calibration.covariance, moved)
    whole += np.einsum("skn,s->kn", gains**2, noise.variance)
    assert np.abs(found.variance / whole - 1.0).max() < 1e-12


def test_the_first_correction_alone_is_within_the_rounding_where_it_ends():
    """Newton's method to the end starts from outputs that are off by more than where it ends at once."""
    calibration = true_calibration(NAMES)
    three = ThreeAxis.of(calibration.offsets_V, calibration.matrix, np.array([1.0, 3.0, 10.0]))
    pitch, roll, rng = attitudes(2000)
    v = volts(pitch, roll, NAMES) + rng.normal(0, 3e-5, (2000, 3))
    far = np.append(v, v[:1] * 1.001, axis=0)
    assert np.abs(three.gravity(v, 3) - three.gravity(far, 9)[:, :-1]).max() < 1e-13


@pytest.mark.parametrize("sigma_g", [(1, 1, 1), (1, 10, 10), (10, 1, 1), (1, 1, 100)])
def test_of_outputs_far_from_1_g_too_the_attitude_is_the_least_squares_one(sigma_g):
    """By the conditions that only the least of all points of a sphere meets (More and Sorensen 1983): a unit vector,
    (M'WM + c I) g = M'W y, and no eigenvalue of the matrix in brackets below zero.
    """
    calibration = true_calibration(NAMES)
    pitch, roll, rng = attitudes(300)
    v = volts(pitch, roll, NAMES)
    v *= 1.0 + rng.choice([0.0, 0.001, 0.01, 0.05, -0.05], (300, 1))
    v[:, rng.integers(3)] += 5.0 * rng.choice([0.0, 0.01, 0.03, 0.1, -0.1, 0.2, -0.3, 0.45], 300)
    sd = 1e-4 * np.array(sigma_g)
    found = infer_attitude(calibration, v, noise_sd_V=sd)
    given = np.isfinite(found.pitch_deg)
    assert given.sum() > 200
    g = gravity(np.radians(found.pitch_deg[given]), np.radians(found.roll_deg[given]))
    matrix = calibration.matrix / sd[:, None]
    y = (v[given] - calibration.offsets_V).T / sd[:, None]
    left = matrix.T @ y - matrix.T @ matrix @ g
    along = np.einsum("in,in->n", left, g)
    size = np.linalg.eigvalsh(matrix.T @ matrix)
    assert np.abs(left - along * g).max() < 1e-12 * size[-1]
    assert along.min() > -size[0] * (1.0 + 1e-9)


def test_cores_share_the_blocks_of_many_readings_and_answers_are_those_of_one_to_the_bit(monkeypatch):
    calibration = true_calibration(NAMES)
    pitch, roll, rng = attitudes(3000)
    v = volts(pitch, roll, NAMES) + rng.normal(0, 1e-4, (3000, 3))
    v[7, 1], v[2500] = np.nan, 2.0 * v[2500]
    monkeypatch.setattr(blocks, "BLOCK", 500)
    threads = set()
    flagged = of_readings.flag_ranges
    monkeypatch.setattr(of_readings, "flag_ranges", lambda *of: threads.add(get_ident()) or flagged(*of))
    answers = []
    for cores in ({0}, {0, 1, 2}):
        monkeypatch.setattr(blocks.os, "sched_getaffinity", lambda _, cores=cores: cores)
        threads.clear()
        answers.append(infer_attitude(calibration, v))
        assert (threads == {get_ident()}) == (len(cores) == 1)
    for each in fields(answers[0]):
        one, several = (getattr(answer, each.name) for answer in answers)
        assert np.array_equal(one, several, equal_nan=one.dtype.kind == "f")
    with pytest.raises(ValueError, match="planned"):
        blocks.in_blocks(3000, _fails)


def _fails(_):
    raise ValueError("planned")
