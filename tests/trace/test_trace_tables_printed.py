"""What a trace of a table prints, taken literally: terms, coefficients, residuals, scatter of repeats, sizes."""

from __future__ import annotations

import re

import numpy as np
import pytest

from proving.truth.table import MISSING, options, simulate
from rig.fitter.trace.engine import family
from rig.procedures.errors import DataError
from rig.procedures.evaluate import in_short
from rig.procedures.general import report as general_report
from rig.procedures.general.column_roles import Roles, parts_played, roles_of
from rig.procedures.general.effects import effects_of
from rig.procedures.general.evaluate import GeneralTraced
from rig.procedures.general.trace import trace_general
from rig.procedures.tables.table import Table
from rig.verbs.page import render


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)


def traced(columns, text=None, **told):
    table, roles = Table("t.csv", columns, True, {}, text=text or {}), Roles(**told)
    data, taken = roles_of(table, roles)
    return GeneralTraced(table, roles, trace_general(data), taken, parts_played(data)), data


def computed(label, columns):
    """A printed term as anybody who has the table would compute it."""
    clock = next((columns[name] for name in ("t_s", "days") if name in columns), None)

    def lag(v, tau):
        out = [v[0]]
        for i, dt in enumerate(np.diff(clock)):  # in many small steps, linear in between
            state, parts = out[-1], 400
            for k in range(parts):
                drive = v[i] + (v[i + 1] - v[i]) * (k + 0.5) / parts
                state += (drive - state) * -np.expm1(-dt / parts / tau)
            out.append(state)
        return np.array(out)

    known = {
        "exp": np.exp, "log": np.log, "sqrt": np.sqrt, "max": np.maximum, "min": np.minimum, "lag": lag,
        "sign": np.sign,
        "previous": lambda v: np.concatenate([v[:1], v[:-1]]), "sin": np.sin, "cos": np.cos, "pi": np.pi, **columns,
    }  # fmt: skip
    text = re.sub(r"C\((\w+)\)\[(\w+)\]", r"1.0*(\1 == '\2')", label).replace("]:", "]*")
    text = text.replace("'):", "')*").replace("2 pi ", "2*pi*").replace("^", "**")
    text = re.sub(r"\b(sin|cos)\((\d+) (\w+)\)", r"\1(pi/180*\2*\3)", text)
    return np.broadcast_to(1.0 * eval(text, {"__builtins__": {}}, known), next(iter(columns.values())).shape)


def awkward():
    """Columns whose ranges lie far from zero, at numbers that are not round."""
    rng = np.random.default_rng(1)
    n = 60
    return {
        "x": rng.uniform(3.0, 17.123, n) + 100.0,
        "temp_c": rng.uniform(18.0, 25.0, n),
        "pitch_deg": rng.uniform(0.0, 360.0, n),
        "side": rng.choice([-1.0, 1.0], n),
        "t_s": 1.6e9 + np.sort(rng.uniform(0.0, 7000.0, n)),
        "y": rng.standard_normal(n),
    }, {"unit": rng.choice(["a", "b", "c"], n)}


def test_every_label_computed_literally_gives_its_column():
    columns, text = awkward()
    told = {"group": ("unit",), "time": "t_s", "direction": "side"}
    table = Table("t.csv", columns, True, {}, text=text)
    for formula in ("1 + x", "1 + log(x)"):
        data, _ = roles_of(table, Roles(response="y", formula=formula, **told))
        seen = 0
        for effect in effects_of(data.scene, "y"):
            for term in effect.terms(data.scene)[::7]:
                for label, column in zip(term.labels, term.columns.T, strict=True):
                    close = 1e-3 if "lag(" in label else 1e-6
                    off = np.abs(computed(label, {**columns, **text}) - column).max()
                    assert off <= close * np.abs(column).max(), (effect.name, label)
                    seen += 1
        assert seen > 50


@pytest.mark.parametrize("name", ["curvature", "kink", "wave", "drift", "sensitivity", "group gain", "step"])
def test_the_printed_model_gives_the_fit(name):
    missing = MISSING[name]
    columns = simulate(missing.lab, 3, missing.at(3.0))
    result, _ = traced(columns, **options(missing.lab))
    fitted = result.to_json()["sensors"]["y"]["fitted"]["coefficients"]
    words = {k: v.astype(int).astype(str) if k in result.roles.group else v for k, v in columns.items()}
    total = sum(
        value["estimate"] * (computed(term.partition(": ")[2] or term, words) if term != "1" else 1.0)
        for term, value in fitted.items()
    )
    assert len(fitted) > 2
    assert total == pytest.approx(result.trace.after.fit.fitted, abs=1e-3)


def test_a_drift_is_printed_with_its_centre():
    rng = np.random.default_rng(0)
    t = np.arange(60) * 120.0
    x = rng.uniform(0.0, 10.0, 60)
    y = 1.0 + 2.0 * x + 4e-5 * t + 0.04 * rng.standard_normal(60)
    result, _ = traced({"t_s": t, "x": x, "y": y}, response="y", formula="1 + x")
    assert result.trace.added[0].terms == ("t_s - 3540",)
    assert "drift:t_s: t_s - 3540" in render(result.page())


def test_residuals_before_are_those_of_the_declared_model():
    """Written out with the normal equations; they sum to zero, and their scatter is what is printed."""
    missing = MISSING["drift"]
    columns = simulate(missing.lab, 3, missing.at(3.0))
    result, _ = traced(columns, **options(missing.lab))
    model = np.column_stack([np.ones_like(columns["x"]), columns["x"]])
    expected = columns["y"] - model @ np.linalg.solve(model.T @ model, model.T @ columns["y"])
    before, after = result.trace.before.fit, result.trace.after.fit
    assert before.left == pytest.approx(expected, abs=1e-9)
    assert after.left.sum() == pytest.approx(0.0, abs=1e-6)
    assert np.sqrt(after.left @ after.left / after.df) == pytest.approx(after.sigma_E)


def test_repeats_scatter_less_once_their_direction_is_known():
    """Two readings of each of 40 settings, up and down, 2 sd apart: without the direction 1.7 sd, with it 1."""
    rng = np.random.default_rng(2)
    x, side = np.repeat(np.linspace(0.0, 10.0, 40), 2), np.tile([1.0, -1.0], 40)
    y = 1.0 + x + 1.0 * side + rng.standard_normal(80)
    result, _ = traced({"x": x, "side": side, "y": y}, response="y", formula="1 + x", direction="side")
    assert result.trace.added[0].effect == "direction:sign(side)"
    change = (y - result.trace.added[0].coefficients[0] * side).reshape(40, 2)
    after = np.sqrt(np.sum((change - change.mean(1, keepdims=True)) ** 2) / 39)
    assert result.trace.before.sigma_pure == pytest.approx(np.sqrt(1.0 + 2.0), abs=0.3)
    assert result.trace.after.sigma_pure == pytest.approx(after, rel=0.05)
    assert result.trace.after.sigma_pure < 1.3 < result.trace.before.sigma_pure


def test_a_groups_size_is_the_difference_of_its_levels_and_text_is_not_passed_over_in_silence():
    rng = np.random.default_rng(4)
    x, batch = rng.uniform(0.0, 10.0, 60), rng.permutation(np.repeat(["A", "B", "C"], 20))
    y = 1.0 + x + np.where(batch == "B", 4.0, 0.0) + rng.standard_normal(60)
    result, _ = traced({"x": x, "y": y}, {"batch": batch}, response="y", formula="1 + x", group=("batch",))
    (effect,) = result.trace.added
    apart = np.ptp([0.0, *effect.coefficients])
    assert f"levels up to {apart:.3g} apart" in effect.size
    undeclared, _ = traced({"x": x, "y": y}, {"batch": batch}, response="y", formula="1 + x")
    found = undeclared.to_json()["sensors"]["y"]
    assert "batch holds text: its 3 levels are taken for a group; --ignore batch if not" in found["notes"]
    assert [one["effect"] for one in found["effects"]] == ["group-offset:batch"]
    many = np.array([f"lot {k}" for k in rng.permutation(np.repeat(np.arange(30), 2))])
    silent, _ = traced({"x": x, "y": y}, {"lot": many}, response="y", formula="1 + x")
    notes = silent.to_json()["sensors"]["y"]["notes"]
    assert "lot holds text: no effect of it was tested, only shapes without a name; --group lot" in notes
    assert found["roles"]["settings"] == ["x"]
    assert found["roles"]["covariates"] == []
    assert "batch" not in " ".join(result.taken)


def test_a_misspelt_column_to_ignore_is_answered_with_those_there_are():
    with pytest.raises(DataError, match=r"'humidty'.* the table has x, humidity, y"):
        traced(dict.fromkeys(("x", "humidity", "y"), np.arange(9.0)), response="y", formula="1", ignore=("humidty",))


def test_a_class_of_curves_is_led_by_its_simplest_order():
    """A parabola in rows sorted by the setting: a kink stands out a little more, and that is no reason to lead."""
    rng = np.random.default_rng(4)
    x, side = np.repeat(np.linspace(0.0, 100.0, 12), 4), np.tile([1.0, 1.0, -1.0, -1.0], 12)
    y = 1 + 0.02 * x + 4e-5 * (x - 50) ** 2 + 0.04 * side + 0.055 * rng.standard_normal(48)
    result, _ = traced({"x": x, "side": side, "y": y}, response="y", formula="1 + x", direction="side")
    curved = next(effect for effect in result.trace.added if effect.effect != "direction:sign(side)")
    assert curved.effect == "second-order:x"
    assert "kink:x" in curved.aliases
    assert curved.p_adjusted < 0.1


def test_levels_are_drawn_by_name_with_means_and_both_panels_on_one_scale():
    level, left = np.array([0.0, 0.0, 1.0, 2.0]), np.array([1.0, 3.0, 5.0, -9.0])
    figure = general_report.residuals_over("unit", level, (left, 0.1 * left), "y", ("a", "b", "c"))
    before, after = figure.axes
    assert [text.get_text() for text in before.get_xticklabels()] == ["a", "b", "c"]
    assert before.get_ylim() == after.get_ylim()
    means = next(line for line in before.lines if line.get_label() == "mean")
    assert means.get_linestyle() == "None"
    assert means.get_ydata() == pytest.approx([2.0, 5.0, -9.0])


def test_whole_plots_may_be_called_by_words():
    """A temperature that is constant in each of 16 whole plots: its interval goes by 14 degrees of freedom."""
    rng = np.random.default_rng(0)
    plot, x = np.repeat(np.arange(16), 8), rng.uniform(0.0, 10.0, 128)
    warm = rng.uniform(15.0, 30.0, 16)[plot]
    y = x + warm + 0.3 * rng.standard_normal(16)[plot] + 0.3 * rng.standard_normal(128)
    words = {"plot": np.array([f"p{i}" for i in plot])}
    told = {"response": "y", "formula": "1 + x", "whole_plot": ("plot",)}
    result, _ = traced({"x": x, "temp_c": warm, "y": y}, words, **told)
    (effect,) = result.to_json()["sensors"]["y"]["effects"]
    assert effect["stratum"] == "whole-plot"
    low, high = effect["interval_95"][0]
    assert (high - low) / 2 == pytest.approx(2.1448 * effect["stderr"][0], rel=1e-3)


@pytest.mark.parametrize(("over", "told"), [("bath", "Levels of bath that differ"), ("t_s", "A curve that the")])
def test_what_stands_in_place_of_many_names_is_levels_where_it_is_over_a_group(over, told):
    """Of 28 chicks that grow by different curves it was said that a curve over them was not in the model."""
    names = ["group-offset:bath", "group-gain:bath,t_s", "kink:t_s", "third-order:t_s"]
    shape = {"over": {"variable": over}, "rms": 1.0, "unit": "V"}
    effects = [{"effect": n, "family": "group", "columns": n.partition(":")[2].split(",")} for n in names[:2]]
    instead = {"effects": names, "where": f"over {over}", "shape": shape}
    (said,) = in_short._crowds({"y": {"instead": instead, "effects": effects}})
    assert told in said.text
