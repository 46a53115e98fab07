"""Tables of any kind: what is found, by which name, and that nothing is where nothing is missing."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from proving.truth.table import CLOCKED, MISSING, Lab, options, simulate
from rig.fitter.trace.engine import family
from rig.procedures.errors import DataError
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import search_table, trace_general
from rig.procedures.tables.table import Table

NIST = json.loads((Path(__file__).parents[1] / "reference/nist/linear.json").read_text())["sets"]


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    """500 draws of the family are enough to tell 3.5 % from nothing, and quick."""
    monkeypatch.setattr(family, "MOST", 500)


def prepare(columns, **told):
    return roles_of(Table("table.csv", columns, simulated=True, provenance={}), Roles(**told))


def found(columns, **told):
    result = search_table(prepare(columns, **told)[0])
    return [result.judge.candidates[j].effect.name for j in result.chosen]


def nist(name):
    """Setting and response of one of NIST's reference data sets."""
    columns = dict(zip(NIST[name]["columns"], np.array(NIST[name]["rows"], float).T, strict=True))
    return columns["x"], columns["y"]


@pytest.mark.parametrize("name", MISSING)
def test_every_effect_is_found_by_its_name(name):
    """Twice the scatter of a reading; the laboratory adds the effect by its own formula."""
    missing = MISSING[name]
    columns = simulate(missing.lab, 3, missing.at(2.0))
    names = found(columns, **options(missing.lab))
    assert any(n.startswith(missing.named) for n in names), names


CLEAN = {
    "eight rows": Lab(8),
    "group and side": Lab(40, groups=4, sides=True),
    "neighbours alike": Lab(60, 2, clock=True, ar=0.7),
    "a random walk": Lab(60, 2, clock=True, walk=5.0),
    "neighbours alike, rising": Lab(40, 1, ar=0.9, design="rising"),
    "outliers": Lab(60, 2, groups=4, clock=True, outliers=0.05),
    "scatter grows": Lab(60, 2, clock=True, growing=5.0),
    "whole plots": Lab(60, 2, plots=10),
    "replications": Lab(60, 2, repeats=5),
}


@pytest.mark.parametrize("name", CLEAN)
def test_nothing_is_found_where_nothing_is_missing(name):
    """At most one table in twenty may say something; of three, one at most is 0.993 probable even then."""
    lab = CLEAN[name]
    assert sum(bool(found(simulate(lab, seed), **options(lab))) for seed in range(3)) <= 1


def test_pontius_is_quadratic_and_as_certified():
    """NIST StRD Pontius: the quadratic leaves 0.205177424076185e-3; run offsets (p 0.025) are chance."""
    x, y = nist("Pontius")
    columns = {"load": x, "deflection": y, "run": np.repeat([1.0, 2.0], len(x) // 2)}
    data, _ = prepare(columns, response="deflection", formula="1 + load", group=("run",))
    result = trace_general(data)
    assert [effect.effect for effect in result.added] == ["second-order:load"]
    assert result.verdict == "explained"
    assert result.after.fit.sigma_E == pytest.approx(0.205177424076185e-3, rel=1e-9)
    assert result.before.fit.sigma_E == pytest.approx(0.00217127, rel=2e-6)
    assert result.after.cv_rms < 0.2 * result.before.cv_rms


def test_norris_lacks_nothing():
    """NIST StRD Norris: a straight line of 36 ozone readings in random order."""
    x, y = nist("Norris")
    result = trace_general(prepare({"x": x, "y": y}, response="y", formula="1 + x")[0])
    assert result.verdict == "nothing to add"
    assert result.after.fit.sigma_E == pytest.approx(0.884796396144373, rel=1e-12)


def test_size_and_share_are_those_of_the_truth():
    """A temperature effect of 2 sd rms: its coefficient lies within four standard errors of the one put in."""
    missing = MISSING["temperature"]
    columns = simulate(missing.lab, 5, missing.at(2.0))
    without = simulate(missing.lab, 5)
    truth = np.polyfit(columns["temp_c"], columns["y"] - without["y"], 1)[0]
    result = trace_general(prepare(columns, **options(missing.lab))[0])
    effect = next(e for e in result.added if e.effect == "temperature:temp_c")
    assert effect.coefficients[0] == pytest.approx(truth, abs=4 * effect.stderr[0])
    assert effect.share > 0.9
    assert result.after.fit.sigma_E == pytest.approx(1.0, abs=0.25)
    assert result.after.cv_rms < 0.6 * result.before.cv_rms


def test_two_effects_at_once():
    lab = Lab(160, 2, groups=4, clock=True, sides=True)
    adds = [MISSING[name].at(1.5) for name in ("curvature", "direction")]
    names = found(simulate(lab, 4, lambda c, rng: sum(add(c, rng) for add in adds)), **options(lab))
    assert set(names) == {"second-order:x", "direction:sign(side)"}


def test_a_step_and_a_drift_that_hide_each_other():
    """Either alone leaves what a wander explains as well; together they do not."""
    rng = np.random.default_rng(3)
    t = np.arange(120.0)
    y = 0.03 * t - 2.4 * (t > 70) + 0.3 * rng.standard_normal(120)
    assert set(found({"t_h": t, "y": y}, response="y", formula="1", time="t_h")) == {"step:t_h", "drift:t_h"}


def test_the_end_of_a_range_is_an_effect_and_no_outliers():
    """The last four of 41 readings saturate: they stand out from the line, and not from a line with a kink."""
    rng = np.random.default_rng(1)
    x = np.linspace(0.0, 10.0, 41)
    y = np.minimum(x, 9.0 + 0.4 * (x - 9.0)) + 0.01 * rng.standard_normal(41)
    names = found({"x": x, "y": y}, response="y", formula="1 + x")
    assert names in (["kink:x"], ["saturation:x"])


def test_rows_sorted_by_an_angle_that_the_formula_leaves_out():
    """72 rows round a dial, no clock: the order is that of the angle, and the error goes round with it."""
    rng = np.random.default_rng(2)
    angle = np.arange(0.0, 360.0, 5.0)
    error = 3.0 * np.sin(np.radians(angle) + 0.7) + 0.8 * rng.standard_normal(72)
    assert found({"angle_deg": angle, "error": error}, response="error", formula="1") == ["harmonic:angle_deg"]


def test_what_has_no_name_is_told_by_its_place_and_a_curve_is_offered():
    """A wave over a temperature that is no kind of effect: variable, period 2 pi, and the error with the curve."""
    rng = np.random.default_rng(5)
    warm, x = rng.uniform(10.0, 40.0, 150), rng.uniform(0.0, 1.0, 150)
    y = x + 0.6 * np.sin(warm) + 0.2 * rng.standard_normal(150)
    result = trace_general(prepare({"x": x, "temp_c": warm, "y": y}, response="y", formula="1 + x")[0])
    assert result.verdict == "unexplained"
    (rest,) = result.unnamed
    assert rest.variable == "temp_c"
    assert rest.period == pytest.approx(2 * np.pi, rel=0.1)
    assert rest.sigma_E[0] > 0.4
    assert rest.sigma_E[1] < 0.3
    assert rest.left_out[1] < 0.3


def test_noise_tells_what_it_does_to_intervals():
    """Errors correlated by 0.7 over x that rises: the slope's true standard error, written out with matrices."""
    lab = Lab(200, 0, clock=True, ar=0.7, design="rising")
    result = trace_general(prepare(simulate(lab, 4), **options(lab))[0])
    alike = next(e for e in result.effects if e.effect == "autocorrelation")
    model = np.column_stack([np.ones(200), simulate(lab, 4)["x"]])
    inverse = np.linalg.inv(model.T @ model)
    place = np.arange(200)
    covariance = 0.7 ** np.abs(place[:, None] - place)
    true = np.diag(inverse @ model.T @ covariance @ model @ inverse)
    stated = np.diag(inverse) * (200 - np.trace(inverse @ model.T @ covariance @ model)) / 198
    assert alike.intervals["x"] == pytest.approx(np.sqrt(true / stated)[1], rel=0.3)
    assert "x 2" in alike.size


def test_what_runs_together_is_an_alias():
    """Two thermometers on one block: either may be the cause, and the report says so."""
    lab = Lab(120, 1, clock=True)
    columns = simulate(lab, 2, MISSING["temperature"].at(2.0))
    rng = np.random.default_rng(1)
    columns["block_c"] = columns["temp_c"] + 0.001 * rng.standard_normal(120)
    result = trace_general(prepare(columns, **options(lab))[0])
    effect = next(e for e in result.added if e.effect.startswith("temperature:"))
    assert {effect.effect, *effect.aliases} >= {"temperature:temp_c", "temperature:block_c"}


def test_a_group_that_covariates_stand_in_for():
    """Temperature differs between two runs and does nothing: the run is named, temperature at most as its alias."""
    rng = np.random.default_rng(9)
    run = np.repeat([1.0, 2.0], 40)
    columns = {"run": run, "temp_c": 22.0 + 0.5 * run + 0.2 * rng.standard_normal(80)}
    columns["x"] = rng.uniform(0, 10, 80)
    columns["y"] = 1.0 + columns["x"] + 2.0 * run + rng.standard_normal(80)
    assert found(columns, response="y", formula="1 + x", group=("run",)) == ["group-offset:run"]


def test_outliers_are_reported_and_stay():
    """Four readings off by 12 sd make no effect, hide none, and are pointed at by their rows in the file."""
    missing = MISSING["curvature"]
    columns = simulate(missing.lab, 6, missing.at(1.5))
    columns["y"][[7, 21, 33, 50]] += np.array([12.0, -12.0, 12.0, -12.0])
    result = trace_general(prepare(columns, **options(missing.lab))[0])
    (curve,) = result.added
    assert "second-order:x" in (curve.effect, *curve.aliases)
    alone = next(e for e in result.effects if e.effect == "outliers")
    assert {f"row {i + 2}" for i in (7, 21, 33, 50)} <= set(alone.terms)
    assert result.after.fit.df == 60 - 3


def test_scatter_that_grows_is_found_and_weighs():
    result = trace_general(prepare(simulate(Lab(200, 1, growing=6.0), 3), response="y", formula="1 + x")[0])
    growing = next(e for e in result.effects if e.effect == "noise-grows")
    low, high = growing.coefficients
    assert high / low == pytest.approx(6.0, rel=0.5)
    assert result.verdict == "nothing to add"


def noise_that_changes(lab, spread, seed=3):
    """The finding about it, in a table whose errors of sd one are multiplied by `spread` of the columns."""
    columns = simulate(lab, seed)
    columns["y"] += (spread(columns) - 1.0) * (columns["y"] - 3.0 - 2.0 * columns["x"])
    result = trace_general(prepare(columns, **options(lab))[0])
    assert result.verdict == "nothing to add"
    return next(e for e in result.effects if e.effect == "noise-grows")


def test_scatter_that_grows_from_the_middle_is_found():
    found = noise_that_changes(Lab(150, 1), lambda c: 0.4 + 0.32 * np.abs(c["x"] - 5.0))
    middle, ends = found.coefficients
    assert ends / middle == pytest.approx(5.0, rel=0.4)
    assert float(found.terms[0].removeprefix("sd at ")) == pytest.approx(3.0 + 2.0 * 5.0, abs=0.5)
    assert "fitted y" in found.cause


def test_scatter_of_one_level_of_a_group_is_found():
    found = noise_that_changes(Lab(120, 1, groups=3), lambda c: np.where(c["unit"] == 1, 3.0, 1.0))
    of_level = dict(zip(found.terms, found.coefficients, strict=True))
    assert of_level["sd of 1"] == pytest.approx(3.0, rel=0.25)
    assert of_level["sd of 0"] == pytest.approx(1.0, rel=0.25)
    assert "unit" in found.cause


def test_replications_that_differ_beside_scatter_that_grows_are_no_steps():
    """The offset of a replication was divided by each row's scatter with its noise: three of these five had steps."""
    lab, found_in = Lab(120, 2, clock=True, repeats=3, growing=8.0), []
    for seed in range(5):
        columns = simulate(lab, seed, lambda c, rng: 6.0 * rng.standard_normal(9)[c["rep"]])
        if found(columns, **options(lab)):
            found_in.append(seed)
    assert len(found_in) <= 1, found_in


def test_neighbours_that_are_alike_are_a_finding_about_the_noise():
    lab = Lab(200, 1, clock=True, ar=0.7)
    result = trace_general(prepare(simulate(lab, 1), **options(lab))[0])
    alike = next(e for e in result.effects if e.effect == "autocorrelation")
    assert alike.stratum == "noise"
    assert alike.coefficients[0] == pytest.approx(0.7, abs=0.2)


def test_whole_plots_have_their_own_error():
    lab = Lab(120, 1, plots=12)
    result = trace_general(prepare(simulate(lab, 1), **options(lab))[0])
    assert result.before.shared == pytest.approx((1.0, 1.0), abs=0.5)
    assert result.verdict == "nothing to add"


def test_rows_sorted_by_the_setting_tell_nothing_of_time():
    columns = simulate(Lab(40), 1)
    order = np.argsort(columns["x"])
    data, notes = prepare({name: v[order] for name, v in columns.items()}, response="y", formula="1 + x")
    assert data.scene.time is None
    assert any("sorted by x" in note for note in notes)
    trace_general(data)


def test_the_time_is_taken_by_its_name_and_said_so():
    columns = simulate(CLOCKED, 1)
    data, notes = prepare(columns, response="y", formula="1 + x")
    assert data.scene.time is not None
    assert data.scene.time.name == "t_s"
    assert any("t_s is used as the time" in note for note in notes)


def test_a_setting_gives_the_side_it_was_approached_from():
    """y is one higher where x went up: the sides follow from the order of taking."""
    columns = simulate(CLOCKED, 2)
    columns["y"] = columns["y"] + 2.0 * np.sign(np.diff(columns["x"], prepend=columns["x"][0] - 1.0))
    names = found(columns, response="y", formula="1 + x", time="t_s", direction="x")
    assert "direction:side(x)" in names


def test_a_difference_has_its_subtrahend_for_a_setting():
    """Encoder less reference, brought to half a turn, goes round twice a turn."""
    rng = np.random.default_rng(4)
    angle = rng.permutation(np.linspace(0.0, 360.0, 90))
    shown = (angle + 0.5 * np.sin(np.radians(2 * angle)) + 0.1 * rng.standard_normal(90) + 180.0) % 360.0 - 180.0
    names = found({"ref_deg": angle, "shown_deg": shown}, response="shown_deg - ref_deg", formula="1", wrap=360.0)
    assert names == ["harmonic:ref_deg"]


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({"formula": "1 +"}, "--formula"),
        ({"formula": "1 + log(minus)"}, "not a finite number"),
        ({"direction": "one"}, "one sign only"),
        ({"candidates": ("word",)}, "--group"),
        ({"ignore": ("nothing",)}, "no column 'nothing'"),
    ],
)
def test_what_cannot_be_is_refused_in_words(told, words):
    n = 12
    columns = {"x": np.arange(n) * 1.0, "minus": -np.arange(1.0, n + 1), "one": np.ones(n), "y": np.arange(n) ** 2.0}
    table = Table("t.csv", columns, True, {}, text={"word": np.array(["a"] * n)})
    with pytest.raises(DataError, match=words):
        roles_of(table, Roles(**{"response": "y", "formula": "1 + x", **told}))


def test_a_line_through_zero_lacks_its_offset():
    rng = np.random.default_rng(3)
    x = rng.uniform(0, 10, 40)
    assert found({"x": x, "y": 5.0 + x + rng.standard_normal(40)}, response="y", formula="0 + x") == ["offset:1"]


@pytest.mark.parametrize("begin", [0.0, 1.7e9])
def test_a_drift_beside_a_model_without_a_constant_begins_where_the_time_does(begin):
    rng = np.random.default_rng(4)
    t = np.linspace(1300.0 if begin == 0.0 else 0.0, 16000.0, 48)
    x = rng.permutation(np.repeat([25.0, 50.0, 75.0, 100.0], 12))
    y = 0.04 * x + 5e-7 * t + 3e-4 * rng.standard_normal(48)
    table = {"x_degC": x, "elapsed_s": begin + t, "y": y}
    assert found(table, response="y", formula="0 + x_degC", time="elapsed_s") == ["drift:elapsed_s"]


def test_a_perfect_fit_has_nothing_to_add():
    x = np.random.default_rng(0).permutation(np.arange(30.0))
    result = trace_general(prepare({"x": x, "y": 2.0 + 3.0 * x}, response="y", formula="1 + x")[0])
    assert result.verdict == "nothing to add"
