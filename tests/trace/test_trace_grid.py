"""Periods that the steps of a design cannot tell: an error of the head and one of a gear with N - k teeth."""

from dataclasses import replace

import numpy as np
import pytest

from proving.truth.attitude import D1, simulate
from proving.truth.attitude_hidden import CLEAN
from rig.procedures.attitude.trace import trace
from rig.procedures.attitude.trace.grid import same_on_grid

PLAN = D1(180, 13, 13, replications=4)


@pytest.fixture(scope="module")
def run():
    return simulate(CLEAN, PLAN, 3)[0]


def test_a_gear_of_ten_teeth_is_named_an_ellipse_of_the_scale_and_said_as_its_alias(run):
    """Steps of 30 deg: ten periods a turn and two are the same numbers. Nothing said that it could be a gear."""
    pitch, outputs = np.radians(run.pitch_deg), dict(run.outputs)
    outputs["x_V"] = outputs["x_V"] + np.radians(5e-3) * np.cos(pitch) * np.sin(10 * pitch) * np.ptp(outputs["x_V"]) / 2
    data = replace(run, outputs={"x_V": outputs["x_V"]})
    sensor = trace(data, validate=False).sensors["x_V"]
    effect = next(e for e in sensor.added if e.effect == "head-twice-per-turn")
    assert "gear-pitch" in effect.aliases
    assert "half a step (15 deg)" in effect.separate_by
    assert "a gear error of 10 a turn" in effect.separate_by
    beside = [e.effect for e in sensor.added if e is not effect]
    assert beside == ["sensor-third-order"], "what an effect this large leaves has its shape"
    assert "sensor-third-order has the shape" in effect.doubtful


def test_what_the_grid_hides(run):
    once = same_on_grid("head-once-per-turn", run)
    assert (once.effect, once.periods, once.step_deg) == ("gear-pitch", 11, 30.0)
    assert same_on_grid("sensor-second-order", run) is None
    assert same_on_grid("roll-head-twice-per-turn", run).effect == "gear-roll"


def test_uneven_pitches_hide_no_gear(run):
    uneven = replace(run, pitch_deg=run.pitch_deg + 3.0 * np.sin(np.radians(run.pitch_deg)) ** 2)
    assert same_on_grid("head-twice-per-turn", uneven) is None
