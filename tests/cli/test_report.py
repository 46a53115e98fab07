"""The report as a person reads it: nothing from a file is taken for markup, every number stands beside its error."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from command import Done, rig
from dry import LAB, SHORT, dry, write_short
from few_sensors import with_sensors
from markupsafe import escape

from rig.by_kind import fit_table, trace_table
from rig.fitter.rounding import with_error
from rig.fitter.trace.outcome import Parameter
from rig.procedures.attitude.evaluate import AttitudeTraced
from rig.procedures.attitude.trace import trace
from rig.procedures.attitude.words import little_help
from rig.procedures.present.effects_shown import show_effect
from rig.procedures.present.words import chance, incomplete, unnamed
from rig.procedures.tables.table import Table
from rig.tables.table_of_run import run_table
from rig.verbs.page import render as rendered

SCRIPT = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    bench, world = with_sensors(LAB, tmp_path_factory.mktemp("lab"), "x", "z")
    text = SHORT.replace('"short"', f'"{SCRIPT}"')
    return dry(tmp_path_factory.mktemp("report"), text=text, bench=bench, world=world)


@pytest.fixture(scope="module")
def traced(path) -> AttitudeTraced:
    return trace_table(run_table(path))


@pytest.fixture(scope="module")
def html(traced) -> str:
    return rendered(traced.page())


def only_x(traced: AttitudeTraced) -> AttitudeTraced:
    """The same with one sensor: pictures are what takes time."""
    return replace(traced, trace=replace(traced.trace, sensors={"x_V": traced.trace.sensors["x_V"]}))


def parameters(traced: AttitudeTraced, name: str) -> tuple[Parameter, ...]:
    return next(one.parameters for one in traced.outcomes if one.sensor == name)


def test_names_are_not_taken_for_markup(html):
    assert "<script" not in html
    assert f"<title>{SCRIPT.replace('<', '&lt;').replace('>', '&gt;')}</title>" in html


def test_every_number_before_and_after_is_there(traced, html):
    for name, sensor in traced.to_json()["sensors"].items():
        for side in ("before", "after"):
            for key in ("sigma_E_deg", "sigma_bias_deg", "sigma_prec_deg", "cv_rms_deg"):
                assert f">{sensor[side][key] * 1e4:.3g}</td>" in html, (name, side, key)
        for one in parameters(traced, name):
            for side in (one.before, one.after):
                assert all(f">{text}</td>" in html for text in with_error(side.value, side.stderr))


def test_notes_are_shown(traced, html):
    for sensor in traced.to_json()["sensors"].values():
        assert sensor["notes"]
        for note in sensor["notes"]:
            assert note in html


def test_every_effect_has_interval_and_figure(traced, html):
    effects = [effect for sensor in traced.to_json()["sensors"].values() for effect in sensor["effects"]]
    assert effects
    assert len(re.findall(r'<img alt="[^"]*residuals over its own variable"', html)) == len(effects)
    for effect in effects:
        if effect["size_95"]:
            assert f"<td>{effect['size_95']} (conditional on the selection)</td>" in html
        for ends, error in zip(effect["interval_95"], effect["stderr"], strict=True):
            if ends is not None:
                low, high = (with_error(end, error)[0] for end in ends)
                assert f">{low} to {high}</td>" in html


def test_a_doubtful_name_is_said_to_be_so_wherever_it_stands(traced):
    """On the page, in the certificate's paragraph, in the summary and on the terminal."""
    why = "something is left over the roll angle"
    found = only_x(traced).trace
    sensor = found.sensors["x_V"]
    doubted = replace(sensor, effects=tuple(replace(effect, doubtful=why) for effect in sensor.effects))
    told = replace(only_x(traced), trace=replace(found, sensors={"x_V": doubted}))
    page = rendered(told.page())
    assert f'<tr><th>doubtful</th><td class="warning">{why}</td></tr>' in page
    assert f"The name is doubtful: {why}." in page
    name = doubted.effects[0].effect
    assert f"doubtful: {name} ({why})" in told.to_json()["sensors"]["x_V"]["sentence"]
    effect = told.to_json()["sensors"]["x_V"]["effects"][0]
    assert [block.text for block in show_effect(effect) if "doubtful" in getattr(block, "text", "")] == [
        f"doubtful: {why}"
    ]


def test_every_sensor_has_one_paragraph_for_the_certificate(traced, html):
    sensors = traced.to_json()["sensors"]
    said = [str(escape(sensor["certificate"])) for sensor in sensors.values()]
    assert re.findall(r"<blockquote[^>]*>(.*?)</blockquote>", html) == said
    assert html.count("not confirmed by a measurement of its own") == sum(bool(s["effects"]) for s in sensors.values())


def test_the_report_needs_no_other_file(html):
    assert re.findall(r'(?:src|href)="(?!data:)', html) == []


def test_a_run_that_is_not_complete_says_so_at_the_top(traced, html):
    table = traced.table
    assert "not complete" not in html
    part = replace(table, provenance={**table.provenance, "points_planned": 1950, "complete": False})
    shown = rendered(replace(only_x(traced), table=part).page())
    headline = shown[shown.index("<h1>") : shown.index("What was found")]
    assert f"{len(table)} of 1950 points; the run is not complete" in headline
    assert incomplete({}) == ""
    ended = {**part.provenance, "complete": True}
    assert incomplete(ended) == f"{len(table)} of 1950 points; the others were skipped"


def test_a_table_without_temperatures_makes_a_report_too(traced):
    data = replace(traced.data, sensor_temperature_degC=None)
    shown = rendered(only_x(AttitudeTraced(traced.table, data, trace(data, validate=False))).page())
    assert "residuals over sensor temperature" not in shown
    assert "residuals over pitch" in shown


def test_parameters_before_are_those_of_the_fit(traced):
    fitted = fit_table(traced.table).to_json()["sensors"]["x_V"]["parameters"]
    assert [one.label for one in parameters(traced, "x_V")] == ["b / V", "S / (V/g)", "Omega / deg", "A / deg"]
    for parameter, value in zip(parameters(traced, "x_V"), fitted.values(), strict=False):
        assert parameter.before.stderr == value["stderr"]
        assert parameter.before.value == value["estimate"]


def test_standard_errors_after_include_the_effects_own_uncertainty():
    """Against the normal equations of model and effect together, written out here.

    The temperature follows pitch in part, so that effect and sensitivity are not independent.
    """
    rng = np.random.default_rng(3)
    pitch, roll = (g.ravel() for g in np.meshgrid(np.arange(-90.0, 91, 30), np.arange(-150.0, 181, 60)))
    a, r = np.radians(np.tile(pitch, 4)), np.radians(np.tile(roll, 4))
    n = len(a)
    warmth = rng.normal(0.0, 1.0, n) + np.sin(a)
    columns = {
        "replicate": np.repeat(np.arange(1.0, 5), len(pitch)),
        "order": np.arange(1.0, n + 1),
        "elapsed_s": 60.0 * np.arange(n),
        "pitch_deg": np.degrees(a),
        "roll_deg": np.degrees(r),
        "sensor_temperature_degC": 22.0 + warmth,
        "x_V": 5 * np.sin(a) + 0.02 * np.cos(a) * np.sin(r) + 0.01 + 1e-3 * warmth + rng.normal(0, 2e-5, n),
    }
    traced = trace_table(Table("one", columns, True, {}))
    found = traced.trace.sensors["x_V"]
    assert [effect.effect for effect in found.effects] == ["offset-temperature"]
    effect = 22.0 + warmth - traced.trace.scene.temperature_degC
    both = np.column_stack([np.ones(n), np.sin(a), np.cos(a) * np.sin(r), np.cos(a) * np.cos(r), effect])
    expected = found.after.sigma_E * np.sqrt(np.diag(np.linalg.inv(both.T @ both)))
    b, S, *_ = parameters(traced, "x_V")
    assert b.after.stderr == pytest.approx(expected[0], rel=0.06)
    assert S.after.stderr == pytest.approx(expected[1], rel=0.06)
    alone = found.after.sigma_E * np.sqrt(np.diag(np.linalg.inv(both[:, :4].T @ both[:, :4])))
    assert S.after.stderr > 1.1 * alone[1]
    assert found.fit.stderr[1] == pytest.approx(expected[1], rel=0.06)


@pytest.mark.parametrize(
    ("estimate", "error", "shown"),
    [
        (5.0199769, 2.8e-6, ("5.0199769", "0.0000028")),
        (-118.00012, 0.0996, ("-118.00", "0.10")),
        (31.4159, 12.0, ("31", "12")),
        (float("nan"), float("nan"), ("-", "-")),
        (1.5, float("nan"), ("1.5", "-")),
    ],
)
def test_an_estimate_has_as_many_digits_as_its_error(estimate, error, shown):
    assert with_error(estimate, error) == shown


def test_words_for_what_was_found():
    assert chance({"p_adjusted": 5.8e-5, "p_adjusted_is_bound": True}) == "< 5.8e-05"
    assert chance({"p_adjusted": 0.003}) == "= 0.003"
    sensor = {
        "before": {"cv_rms_deg": 1e-3},
        "after": {"cv_rms_deg": 9e-4},
        "effects": [{}],
        "unnamed": [{"share": 0.4, "where": "between replications"}],
    }
    assert "0.001 to 0.0009 deg" in little_help(sensor)
    assert little_help({**sensor, "after": {"cv_rms_deg": 5e-4}}) == ""
    assert little_help({**sensor, "effects": []}) == ""
    assert unnamed(sensor) == ["Unexplained: 40 % of the error beyond scatter, between replications."]


def test_a_path_is_not_broken_at_80_columns(path, tmp_path):
    folder = tmp_path / ("a-folder-with-a-long-name-" * 3)
    folder.mkdir()
    out = folder / "data.csv"
    done = rig("export", path, "--out", out, env={"COLUMNS": "80"})
    assert done.returncode == 0, done.stderr
    assert str(out) in done.stderr


def rig_plan(folder, text: str, bench: str) -> Done:
    (folder / "bench.toml").write_text(bench)
    environment = {"COLUMNS": "80", "TZ": "UTC"}
    return rig("plan", write_short(folder, text), "--bench", "bench.toml", cwd=folder, env=environment)


def test_a_design_that_does_not_determine_the_sensor_is_explained(tmp_path):
    text = SHORT.replace("pitch_deg = [-90, -45, 0, 45, 90]", "pitch_deg = [0]")
    done = rig_plan(tmp_path, text, (LAB / "bench.toml").read_text())
    assert done.returncode == 78
    assert "short.toml: the design does not determine a sensor" in done.stderr.replace("\n", " ")
    assert "Traceback" not in done.stderr


def test_the_evening_answer_names_day_and_zone_and_a_chamber_that_is_missing(tmp_path):
    bench = (LAB / "bench.toml").read_text()
    bench = re.sub(r"\[instruments\.enclosure\].*?\n\n|enclosure_degC = .*?\n", "", bench, flags=re.DOTALL)
    done = rig_plan(tmp_path, SHORT, bench)
    assert done.returncode == 0, done.stderr
    assert "this bench has no instrument to control it" in done.stdout
    assert re.search(r"it ends [A-Z][a-z]+day \d{4}-\d\d-\d\d \d\d:\d\d UTC", done.stdout)
