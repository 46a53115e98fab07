"""Physics that no catalogue lists, in every kind of run: it is drawn where it lives, beside the names nearest to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_trace_nameless import PLAN, X, with_error
from test_trace_tables_nameless import sensor_of

from proving.truth.attitude import simulate
from proving.truth.attitude_hidden import CLEAN
from proving.truth.whole_plot import SUBPLOT
from proving.truth.whole_plot import simulate as simulate_whole_plots
from rig.fitter.trace.engine import family
from rig.procedures.attitude.evaluate import AttitudeTraced
from rig.procedures.attitude.trace import trace
from rig.procedures.attitude.trace.places import between_replications
from rig.procedures.attitude.trace.places import places_of as attitude_places
from rig.procedures.general.column_roles import Roles
from rig.procedures.general.effects.scene import Grouping, TableScene, Timeline
from rig.procedures.general.evaluate import trace_general_table
from rig.procedures.general.trace.places import places_of as table_places
from rig.procedures.present.effects_shown import picture
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.evaluate import WholePlotTraced
from rig.procedures.pressure.fitted import Declared
from rig.procedures.pressure.trace import trace_whole_plots
from rig.procedures.pressure.trace.places import places_of as pressure_places
from rig.procedures.pressure.trace.run import scene_of
from rig.procedures.tables.table import Table
from rig.verbs.page import render

ONE = "bridge_1_mV"


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)


def resonance(data):
    """The stand rings at one pitch."""
    return 2.0 * np.exp(-0.5 * ((data.pitch_deg - 60.0) / 18.0) ** 2)


@pytest.fixture(scope="module")
def at_one_pitch():
    data = with_error(resonance, 3)
    found = trace(data, validate=False)
    found = replace(found, sensors={X: found.sensors[X]})
    return AttitudeTraced(Table("night", {"pitch_deg": data.pitch_deg}, True, {}), data, found)


def shapes_of(told):
    return [one["shape"] for one in (*told["unnamed"], *filter(None, [told["instead"]])) if one["shape"]]


def highest(shape):
    return shape["over"]["x"][int(np.argmax(shape["estimate"]))]


def bent(make, n=240, seed=5):
    return sensor_of(n, seed, make)


def traced_table(columns, **more):
    table = Table("table.csv", columns, simulated=True, provenance={})
    return trace_general_table(lambda *_a, **_k: table, Roles(response="y", formula="1 + x", **more))


def told_of(traced):
    return next(iter(traced.to_json()["sensors"].values()))


def test_a_resonance_at_one_pitch_is_drawn_there(at_one_pitch):
    told = at_one_pitch.to_json()["sensors"][X]
    shape = shapes_of(told)[0]
    assert shape["over"]["variable"] == "pitch_deg"
    assert shape["over"]["unit"] == "deg"
    assert highest(shape) == 60.0
    assert shape["unit"] == "mdeg"
    count = len(shape["over"]["x"])
    assert all(len(shape[key]) == count for key in ("estimate", "stderr", "residual", "residual_stderr", "rows"))
    sigma = told["after"]["sigma_prec_deg"] * 1e3
    assert 0.2 * sigma < shape["rms"] < 1.5 * sigma
    assert shape["stratum"] == "between-point"
    assert shape["p"] < 1e-3


def test_the_certificate_says_that_something_without_a_name_is_left(at_one_pitch):
    told = at_one_pitch.to_json()["sensors"][X]
    shape = shapes_of(told)[0]
    assert "nearest: " in told["certificate"]
    assert f"{shape['rms']:.3g} mdeg rms" in told["certificate"]
    assert ("Unexplained" in told["certificate"]) or ("shape without a name" in told["certificate"])


def test_the_page_draws_it_and_the_terminal_too(at_one_pitch):
    html = render(at_one_pitch.page())
    assert "What has no name" in html
    assert 'alt="what is left, between-point, over pitch"' in html
    shape = shapes_of(at_one_pitch.to_json()["sensors"][X])[0]
    curve, legend = picture(shape)
    assert "█" in curve
    assert "pitch from -180 to 180 deg" in legend
    texts = [getattr(block, "text", "") for block in at_one_pitch.blocks()]
    assert any(curve in text for text in texts)


def test_a_clean_run_has_no_shape():
    data, _ = simulate(CLEAN, PLAN, 8)
    told = told_of(AttitudeTraced(Table("night", {"pitch_deg": data.pitch_deg}, True, {}), data, trace(data)))
    assert shapes_of(told) == []
    assert told["instead"] is None


def test_a_bump_over_a_setting_stands_in_place_of_the_bundle_of_names():
    """A kink, a square, a cube and a fifth order were found for one bump: one curve is told beside them."""
    told = told_of(traced_table(bent(lambda c: 2.5 * np.exp(-0.5 * ((c["x"] - 1.7) / 0.5) ** 2)), time="t_s"))
    (shape,) = shapes_of(told)
    assert shape["over"]["variable"] == "x"
    assert highest(shape) == pytest.approx(1.7, abs=0.4)
    if told["instead"] is not None:
        assert set(told["instead"]["effects"]) == {one["effect"] for one in told["effects"] if one["doubtful"]}
    assert all(one["behind_sigmas"] > 3.0 for one in shape["nearest"])
    assert shape["nearest_sentence"] in told["certificate"]


def test_a_sawtooth_in_the_order_of_readings_is_drawn_over_its_period():
    """It climbs for 9.6 readings and falls back at once."""

    def sawtooth(data):
        return 1.3 * (2.0 * np.mod(np.argsort(np.argsort(data.elapsed_s)), 9.6) / 9.6 - 1.0)

    data = with_error(sawtooth, 3)
    found = trace(data, validate=False).sensors[X]
    (shape,) = (rest.shape for rest in found.unnamed if rest.shape is not None)
    assert shape.over.variable == "phase"
    assert shape.over.label.startswith("place in a period of 9.6")
    steps = np.diff(np.append(shape.estimate, shape.estimate[0]))
    fall = np.sort(steps)
    assert np.sum(steps > 0) > 0.7 * steps.size
    assert -fall[0] > 2.0 * fall[-1]


def test_a_bump_at_one_pressure_is_drawn_there():
    """The catalogue's own bends at one pressure are taken out of it: a knock at 2.5 psia has no name then."""
    data = simulate_whole_plots(seed=31)
    knock = np.exp(-0.5 * ((data.pressure_psia - 2.5) / 0.3) ** 2)
    outputs = {ONE: data.outputs[ONE] + 3.0 * SUBPLOT * knock * np.where(data.sse_temperature_degC > 20.0, 1.0, -1.0)}
    data = replace(data, outputs=outputs)
    local = ("touch-down", "saturation", "dead-band", "dead-zone")
    catalogue = [effect for effect in PRESSURE_CATALOGUE if effect.name not in local]
    found = trace_whole_plots(data, validate=False, catalogue=catalogue)
    table = Table("run", {"pressure_psia": data.pressure_psia}, True, {})
    told = told_of(WholePlotTraced(table, data, found, {}, Declared.of(table, None, data)))
    (shape, *_) = shapes_of(told)
    assert shape["over"]["variable"] == "pressure_psia"
    assert shape["unit"] == "mV"
    assert shape["stratum"] == "subplot"
    strongest = np.argmax(np.abs(shape["estimate"]))
    assert shape["over"]["x"][strongest] == pytest.approx(2.5, abs=0.2)


def places_of_pitch_roll():
    data, _ = simulate(CLEAN, PLAN, 1)
    scene = trace(data, validate=False).scene
    return {"replications": len(data), "points": len(data)}, (*attitude_places(scene), *between_replications(scene))


def places_of_whole_plots():
    data = simulate_whole_plots(seed=31)
    return {"subplot": len(data), "whole-plot": data.whole_plots.size}, pressure_places(scene_of(data))


def places_of_a_table():
    n = np.arange(48)
    sides = ("x_side", np.where(n % 2, 1.0, -1.0))
    part = Grouping(tuple("abc"), n // 16)
    time = Timeline("t_s", 60.0 * n, 1.0)
    scene = TableScene({"x_mm": n % 12 * 1.0, "y_N": n % 5 * 1.0}, {"room_degC": np.cos(n)}, {"who": part}, time, sides)
    return {"": len(n)}, table_places(scene, n // 8)


@pytest.mark.parametrize("places_of", [places_of_pitch_roll, places_of_whole_plots, places_of_a_table])
def test_every_place_can_be_drawn(places_of):
    rows, places = places_of()
    assert len(places) > 15
    for place in places:
        axes = place.axes(0)
        assert axes is not None, place.text
        assert all(axis is None or axis.values.shape == (rows[place.level],) for axis in axes), place.text
