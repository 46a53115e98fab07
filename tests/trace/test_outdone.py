"""Doubtful names that together imitate one shape without a name: the shape is told, and the names only as near it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from proving.truth.attitude import D1, simulate
from proving.truth.attitude_hidden import CLEAN
from rig.fitter.trace.flexible import halves, waves
from rig.fitter.trace.outdone import Shape, outdone
from rig.procedures.attitude.trace import trace
from rig.procedures.attitude.trace.make_problem import make_problem

U = np.linspace(-1.0, 1.0, 300)
T = np.random.default_rng(8).permutation(U)


def shape_over(text, values):
    columns = waves(values, 12)
    return Shape(text, columns, halves(columns), np.log(2.0))


PLACES = (shape_over("over u", U), shape_over("over t", T))
NAMES = {"slope": U[:, None], "square": (U**2)[:, None], "cube": (U**3)[:, None], "drift": T[:, None]}
PRICES = dict.fromkeys(NAMES, 4.0)


def of(error, *names, seed=1):
    y = error + np.random.default_rng(seed).standard_normal(U.size)
    return outdone(y - y.mean(), {name: NAMES[name] - NAMES[name].mean() for name in names}, PRICES, PLACES)


@pytest.mark.parametrize("seed", range(5))
def test_a_bump_outdoes_the_powers_that_imitate_it(seed):
    bump = 3.0 * np.exp(-0.5 * ((U - 0.3) / 0.15) ** 2)
    assert of(bump, "slope", "square", "cube", seed=seed) == dict.fromkeys(("slope", "square", "cube"), "over u")


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", ["slope", "square", "drift"])
def test_a_right_name_is_not_outdone(name, seed):
    assert of(2.0 * NAMES[name][:, 0], name, seed=seed) == {}


@pytest.mark.parametrize("seed", range(5))
def test_a_right_name_of_another_cause_stays_beside_the_shape(seed):
    """The drift explains less than what is left of the bump, and no shape over u is a drift."""
    error = 3.0 * np.exp(-0.5 * ((U - 0.3) / 0.15) ** 2) + 0.7 * T
    assert set(of(error, "slope", "square", "drift", seed=seed)) == {"slope", "square"}


def test_names_that_explain_nothing_are_outdone_by_no_shape_where_there_is_none():
    assert of(np.zeros(U.size), "slope", "square") == {}


PLAN = D1(180, 13, 13, replications=4)


def dented(seed, beside=None):
    """A run whose roll axis drops, so that pitch errs, where a dent of its race comes into the loaded zone."""
    data, truth = simulate(CLEAN, PLAN, seed)
    scene = make_problem(data, ()).scene
    hump = np.exp(-0.5 * ((np.mod(data.roll_deg - 60.0 + 180.0, 360.0) - 180.0) / 25.0) ** 2)
    sd, outputs = min(float(np.std(y - truth[sensor])) for sensor, y in data.outputs.items()), {}
    for sensor, y in data.outputs.items():
        slope = scene.per_pitch(sensor) / np.max(np.abs(scene.per_pitch(sensor)))
        outputs[sensor] = y + 5.0 * sd * slope * hump + (0.0 if beside is None else sd * beside(data, sensor))
    return replace(data, outputs=outputs)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_dent_of_a_bearing_is_one_place_with_a_shape(seed):
    """Wobble and an index error were given for it, both doubtful."""
    for sensor in trace(dented(seed), validate=False).sensors.values():
        assert not sensor.added
        assert sensor.verdict == "unexplained"
        (left,) = sensor.unnamed
        assert left.cause == "between points, package: an error of pitch over the roll angle"
        assert left.shape is not None
        assert "roll-wobble" in {one.effect for one in left.shape.nearest}
        assert any(note.startswith("roll-wobble was left out: it is doubtful") for note in sensor.notes)


def test_a_name_stays_beside_what_outdoes_others():
    """A cube of one sensor's own is no error of pitch."""

    def cube(data, sensor):
        along = np.sin(np.radians(data.pitch_deg))
        return 6.0 * along**3 if sensor == "x_V" else 0.0 * along

    found = trace(dented(1, beside=cube), validate=False)
    assert {one.effect for one in found.sensors["x_V"].added} == {"sensor-third-order"}
    assert all(not found.sensors[other].added for other in ("y_V", "z_V"))
    assert all(sensor.unnamed for sensor in found.sensors.values())


def test_the_error_on_rows_left_out_is_that_of_what_is_reported():
    sensor = next(iter(trace(dented(1)).sensors.values()))
    assert sensor.cv_rms_after == sensor.cv_rms_before
