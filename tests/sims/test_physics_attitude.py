"""Sensor outputs from rotations, against the paper's equations and its numbers for the effects."""

from math import cos, degrees, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.sims.physics.attitude import Accelerometer, sensitive_axis
from rig.sims.physics.rotations import GRAVITY, Vector, apply, compose, pitch_matrix, roll_matrix, yaw_matrix
from rig.sims.physics.truth import SensorTruth
from rig.sims.physics.undeclared import Effects, HeadError, IsolationPad, SecondOrder

ANGLE = st.floats(-360, 360)


def attitude(pitch_deg: float, roll_deg: float) -> Vector:
    return apply(roll_matrix(radians(roll_deg)), apply(pitch_matrix(radians(pitch_deg)), GRAVITY))


def paper(axis: str, b: float, s: float, coning: float, azimuth: float, pitch: float, roll: float) -> float:
    """Equations (2), (4) and (5) of NASA/TP-1999-209835 as printed, angles in degrees."""
    o, a, al, r = map(radians, (coning, azimuth, pitch, roll))
    if axis == "x":
        return b + s * (cos(o) * sin(al) - sin(o) * cos(al) * sin(r + a))
    if axis == "y":
        return b - s * (cos(o) * sin(r) * cos(al) - sin(o) * (sin(a) * sin(al) - cos(a) * cos(r) * cos(al)))
    return b - s * (cos(o) * cos(r) * cos(al) - sin(o) * (cos(a) * sin(al) - sin(a) * sin(r) * cos(al)))


@given(st.sampled_from("xyz"), st.floats(0, 90), ANGLE, ANGLE, ANGLE)
def test_an_ideal_sensor_follows_equations_2_4_and_5(
    axis: str, coning: float, azimuth: float, pitch: float, roll: float
) -> None:
    sensor = Accelerometer(axis, axis, SensorTruth(0.0123, 5.02, coning, azimuth, 0.0), Effects())
    expected = paper(axis, 0.0123, 5.02, coning, azimuth, pitch, roll)
    assert sensor.output_V(attitude(pitch, roll), 23.0, 0.0) == pytest.approx(expected, abs=1e-13)


@given(st.floats(-180, 180))
def test_an_x_sensor_with_azimuth_90_is_the_single_axis_without_roll_of_equation_1(pitch: float) -> None:
    phi = 0.7
    sensor = Accelerometer("x", "x", SensorTruth(0.01, 5.0, phi, 90.0, 0.0), Effects())
    expected = 0.01 + 5.0 * sin(radians(pitch - phi))
    assert sensor.output_V(attitude(pitch, 0.0), 23.0, 0.0) == pytest.approx(expected, abs=1e-13)


@given(ANGLE, ANGLE)
def test_turning_past_the_zenith_and_half_round_is_the_same_attitude(pitch: float, roll: float) -> None:
    assert attitude(pitch, roll) == pytest.approx(attitude(180 - pitch, roll + 180), abs=1e-12)


@given(ANGLE, ANGLE, ANGLE)
def test_rotations_keep_lengths_and_compose_as_matrices(pitch: float, roll: float, yaw: float) -> None:
    p, r, y = pitch_matrix(radians(pitch)), roll_matrix(radians(roll)), yaw_matrix(radians(yaw))
    all_three = compose(y, compose(r, p))
    assert np.asarray(all_three) == pytest.approx(np.array(y) @ np.array(r) @ np.array(p), abs=1e-15)
    assert np.asarray(all_three) @ np.asarray(all_three).T == pytest.approx(np.eye(3), abs=1e-12)


def test_sensitive_axes_are_the_package_axes_without_coning() -> None:
    assert np.array([sensitive_axis(a, 0.0, 33.0) for a in "xyz"]) == pytest.approx(np.eye(3), abs=1e-15)


def design(pitches: np.ndarray, rolls: np.ndarray) -> list[tuple[float, float]]:
    return [(p, r) for p in pitches for r in rolls]


PAPER_37_X_13 = design(np.linspace(-180, 180, 37), np.linspace(-180, 180, 13))


def beyond_the_model(values: np.ndarray, points: list[tuple[float, float]]) -> np.ndarray:
    """What four columns (1, and gravity's components) cannot describe."""
    columns = np.array([(1.0, *attitude(p, r)) for p, r in points])
    return values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]


def test_isolation_pads_show_two_periods_of_pitch_and_one_of_roll_on_the_x_sensor() -> None:
    c = 1.5e-3
    pad = IsolationPad(pitch_compliance_deg_per_g=c)
    change = np.array([degrees(pad.deflect(attitude(p, r))[0] - attitude(p, r)[0]) for p, r in PAPER_37_X_13])
    shape = np.array([sin(2 * radians(p)) * cos(radians(r)) for p, r in PAPER_37_X_13])
    assert abs(change) == pytest.approx(abs(c / 2 * shape), abs=1e-7)
    residual = beyond_the_model(change, PAPER_37_X_13)
    assert abs(np.corrcoef(residual, shape)[0, 1]) > 0.999


def test_the_papers_pad_effect_is_a_compliance_of_about_a_thousandth_of_a_degree_per_g() -> None:
    """Table 2, row 47(a): sigma_bias is 3.72e-4 deg over 37 x 13 points."""
    pad = IsolationPad(pitch_compliance_deg_per_g=1.46e-3)
    change = np.array([degrees(pad.deflect(attitude(p, r))[0] - attitude(p, r)[0]) for p, r in PAPER_37_X_13])
    assert sqrt(np.mean(beyond_the_model(change, PAPER_37_X_13) ** 2)) == pytest.approx(3.72e-4, rel=0.02)


def test_within_30_degrees_the_pad_effect_still_shows_with_41_percent_of_its_amplitude() -> None:
    """Table 2, row 28(b): 13 x 25 points within +-30 deg leave an rms of 0.41 of sin 2a cos R."""
    points = design(np.linspace(-30, 30, 13), np.linspace(-180, 180, 25))
    c = 1e-3
    pad = IsolationPad(pitch_compliance_deg_per_g=c)
    change = np.array([degrees(pad.deflect(attitude(p, r))[0] - attitude(p, r)[0]) for p, r in points])
    assert sqrt(np.mean(beyond_the_model(change, points) ** 2)) / (c / 2) == pytest.approx(0.41, abs=0.01)


def test_roll_compliance_leaves_the_x_sensor_alone_and_turns_y_and_z() -> None:
    pad = IsolationPad(roll_compliance_deg_per_g=1e-3)
    g = attitude(20.0, 40.0)
    x, y, z = (degrees(a - b) for a, b in zip(pad.deflect(g), g, strict=True))
    assert x == 0.0
    assert y == pytest.approx(-1e-3 * g[1] * g[2], rel=1e-4)
    assert z == pytest.approx(1e-3 * g[1] ** 2, rel=1e-4)


def test_pads_alike_all_round_tip_the_package_alike_whichever_way_it_leans() -> None:
    """Turning the package by 90 deg about its vertical axis must turn what the pads do to it, and nothing else."""
    pad = IsolationPad(pitch_compliance_deg_per_g=1e-3, roll_compliance_deg_per_g=1e-3)
    g = attitude(20.0, 40.0)
    x, y, z = pad.deflect((g[0], g[1], g[2]))
    turned = pad.deflect((-g[1], g[0], g[2]))
    assert turned == pytest.approx((-y, x, z), abs=1e-9)


def test_second_order_term_is_a_parabola_in_the_acceleration() -> None:
    truth = SensorTruth(0.0, 5.0, 0.0, 0.0, 0.0)
    sensor = Accelerometer("x", "x", truth, Effects(second_order=SecondOrder(ug_per_g2=20.0)))
    for pitch in (-90.0, -30.0, 0.0, 45.0):
        g = attitude(pitch, 0.0)
        assert sensor.output_V(g, 23.0, 0.0) - 5.0 * g[0] == pytest.approx(5.0 * 20e-6 * g[0] ** 2, abs=1e-15)


def test_a_head_error_of_one_period_a_turn_at_phase_90_is_a_quadratic_and_at_phase_0_is_sin_2a() -> None:
    """What looks alike on the x model: a head error and the sensor's own terms."""
    pitches = np.linspace(-180, 180, 73)
    for phase, shape in ((90.0, np.sin(np.radians(pitches)) ** 2), (0.0, np.sin(2 * np.radians(pitches)))):
        error = HeadError("pitch", 2.0, 1.0, phase)
        change = np.array([attitude(p + error.error_deg(p), 0.0)[0] - attitude(p, 0.0)[0] for p in pitches])
        columns = np.column_stack([np.ones(73), np.sin(np.radians(pitches)), np.cos(np.radians(pitches))])
        left = change - columns @ np.linalg.lstsq(columns, change, rcond=None)[0]
        same = shape - columns @ np.linalg.lstsq(columns, shape, rcond=None)[0]
        assert abs(np.corrcoef(left, same)[0, 1]) > 0.999, phase
