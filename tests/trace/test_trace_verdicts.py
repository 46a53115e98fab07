"""One rule for shares, verdicts and the names of noise in the three kinds of run, and no traceback in any."""

import json
from dataclasses import replace
from itertools import permutations
from types import SimpleNamespace

import noisy_truth
import numpy as np
import pytest
import strong_truth

from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.engine import family
from rig.fitter.trace.found import verdict
from rig.fitter.trace.keep import kept
from rig.fitter.trace.outcome import remains
from rig.fitter.trace.shares import of_rest, shares
from rig.procedures.attitude.effects import CATALOGUE
from rig.procedures.attitude.trace import trace
from rig.procedures.attitude.trace.estimate import estimate
from rig.procedures.attitude.trace.judge import AttitudeJudge
from rig.procedures.attitude.trace.make_problem import make_problem
from rig.procedures.attitude.trace.run import final_check
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import trace_general
from rig.procedures.general.trace.run import LEVEL
from rig.procedures.present.words import verdict_of
from rig.procedures.pressure.trace import trace_whole_plots
from rig.procedures.tables.table import Table

KINDS = ("attitude", "whole plots", "table")
MODELS = ("full", "II.C", "P")
FORMULAS = ("load", "load + I(load^2)", "1")
STRONG = {"attitude": (7,), "whole plots": (2,), "table": (9,)}
"""Seeds: before, a NaN that was to be a whole number, and shares of 2.2 and of 1.0 beside a rest."""


@pytest.fixture(autouse=True)
def _few_tables(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)


def of_table(columns, formula):
    table = Table("table.csv", columns, simulated=True, provenance={})
    return trace_general(roles_of(table, Roles(response="y", formula=formula, time="time_s"))[0])


def traced(kind, seed):
    """Sensors of a strongly bent run, each with its errors before and after."""
    if kind == "table":
        found = of_table(strong_truth.table(seed)[1], FORMULAS[seed % 3])
        return [(found, (found.before.fit.sigma_E,), (found.after.fit.sigma_E,))]
    if kind == "attitude":
        every = trace(strong_truth.attitude(seed)[1], validate=False).sensors.values()
        return [(one, (one.before.sigma_E,), (one.after.sigma_E,)) for one in every]
    run = trace_whole_plots(strong_truth.whole_plots(seed)[1], model=MODELS[seed % 3], validate=False)
    sides = [(one, one.before.fit, one.after.fit) for one in run.sensors.values()]
    return [(one, *((fit.sigma_subplot, fit.sigma_wholeplot) for fit in fits)) for one, *fits in sides]


def only_noise(kind, how, seed):
    rng = np.random.default_rng(seed)
    if kind == "table":
        return [of_table(noisy_truth.table(how, rng), "load").outcome().to_json()]
    if kind == "attitude":
        run = trace(noisy_truth.attitude(how, rng), validate=False)
    else:
        run = trace_whole_plots(noisy_truth.whole_plots(how, rng), model="full", validate=False)
    return [sensor.outcome().to_json() for sensor in run.sensors.values()]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("how", "name", "word"),
    [
        ("growing", "noise-grows", "nothing to add"),
        ("outliers", "outliers", "nothing to add"),
        ("correlated", "autocorrelation", "unexplained"),  # a wander, or an effect in time
    ],
)
def test_the_same_noise_has_one_name_and_one_verdict(kind, how, name, word):
    for sensor in only_noise(kind, how, seed=1):
        assert [(e["effect"], e["stratum"]) for e in sensor["effects"]] == [(name, "noise")]
        assert sensor["verdict"] == word
        key = "sigma_subplot" if kind == "whole plots" else "sigma_E"
        assert sensor["before"][key] == sensor["after"][key] > 0


@pytest.mark.parametrize(("kind", "seed"), [(kind, seed) for kind, seeds in STRONG.items() for seed in seeds])
def test_strong_nonlinearities_are_traced_and_what_is_said_of_them_adds_up(kind, seed):
    for sensor, before, after in traced(kind, seed):
        found = json.loads(json.dumps(sensor.outcome().to_json(), allow_nan=False))
        effects = [effect for effect in found["effects"] if effect["stratum"] != "noise"]
        assert found["verdict"] != "explained" or all(effect["doubtful"] is None for effect in effects)
        every = [one["share"] for one in (*effects, *found["unnamed"])]
        assert all(0.0 <= share <= 1.0 for share in every)
        assert sum(every) <= 1.0 + 1e-9, [(e["effect"], e["share"]) for e in effects]
        assert all(effect["p_adjusted"] <= (LEVEL if kind == "table" else ALPHA) for effect in effects)
        fell = [b > a for b, a in zip(before, after, strict=True)]
        reason = any("error of this one is not smaller" in note for note in found["notes"])
        assert not effects or any(fell) or reason
        assert found["verdict"] != "explained" or (effects and any(fell))


def test_shares_are_shapleys_of_the_fall_in_every_order():
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((40, 4))
    columns[:, 1] = columns[:, 0] + 0.05 * columns[:, 1]  # two that explain the same
    y = columns @ [2.0, -1.0, 0.5, 1.0] + rng.standard_normal(40)

    def left(chosen):
        picked = columns[:, chosen]
        return float(np.sum((y - picked @ np.linalg.lstsq(picked, y, rcond=None)[0]) ** 2)) if chosen else float(y @ y)

    falls = np.zeros(4)
    for order in permutations(range(4)):
        for at, k in enumerate(order):
            falls[k] += (left(list(order[:at])) - left(list(order[: at + 1]))) / 24
    scatter = 0.5 * left([0, 1, 2, 3])
    found = shares(list(columns.T), y, scatter)
    np.testing.assert_allclose(found, falls / (y @ y - scatter), rtol=1e-9)
    assert found[0] == pytest.approx(found[1], rel=0.5)
    # scatter that explains more than there is: all is explained, and not more than all
    assert shares(list(columns.T), y, float(y @ y)).sum() == pytest.approx(1.0)
    assert of_rest(found, (remains("here", 0.9), remains("there", 0.6)))[0].share == pytest.approx(
        0.6 * (1.0 - found.sum())
    )


def test_noise_alone_is_said_and_explains_nothing():
    """In words: the model lacks nothing, and the noise is not what it assumes."""
    said = only_noise("whole plots", "growing", seed=1)[0]
    assert "nothing to add to the model; the noise is not what the model assumes: readings scatter more" in verdict_of(
        said
    )
    assert verdict_of({**said, "effects": []}) == "nothing to add"


@pytest.mark.parametrize(
    ("found", "fell", "rest", "word"),
    [
        (True, True, (), "explained"),
        (True, False, (), "partly explained"),
        (True, True, (remains("here", 0.1),), "partly explained"),
        (True, True, (remains("a walk", 0.1, stratum="noise"),), "explained"),
        (False, False, (remains("here", 0.1),), "unexplained"),
        (False, False, (remains("a walk", 0.1, stratum="noise"),), "unexplained"),
        (False, False, (), "nothing to add"),
    ],
)
def test_a_verdict_is_about_effects_and_the_error(found, fell, rest, word):
    assert verdict(found=found, fell=fell, rest=rest) == word


class _Told:
    """A judge that was told the p of every candidate beside all others, whatever is chosen."""

    def __init__(self, p):
        self.p = p
        self.candidates = [SimpleNamespace(effect=SimpleNamespace(name=name), sensor=None) for name in p]

    def unit(self, j):
        return (j,)

    def p_adjusted(self, chosen, j):
        return list(self.p.values())[j]


def test_an_effect_stays_if_it_stands_out_and_lowers_the_error():
    judge = _Told({"good": 0.001, "by chance": 0.9, "idle": 0.02})
    chosen, left = kept(judge, (0, 1, 2), lambda chosen, own: own != (2,), "sigma_E")
    assert chosen == (0,)
    assert [one.sentence for one in left] == [
        "idle was left out: it is significant (p 0.02), but sigma_E is not smaller with it"
    ]


def test_columns_that_are_combinations_of_others_are_left_out_and_named():
    """One sensor without roll: what pads do is what an eccentric head does, and both were put into the model."""
    data = noisy_truth.attitude("outliers", np.random.default_rng(2))
    flat = data.take(np.flatnonzero(data.roll_deg == 0.0))
    flat = replace(flat, outputs={"x_V": flat.outputs["x_V"]}, axes={"x_V": "x"})
    problem = make_problem(flat, CATALOGUE)
    columns = problem.columns_at("declared", range(len(problem.candidates)))[0]
    unit = columns / np.linalg.norm(columns, axis=0)
    pairs = np.argwhere(np.triu(np.abs(unit.T @ unit) > 1.0 - 1e-12, 1))
    first, second = next((int(a), int(b)) for a, b in pairs if problem.unit_of[a] != problem.unit_of[b])
    fitted = estimate(problem, (first, second))
    assert fitted.told_apart == (first,)
    assert np.all(np.isfinite(fitted.gamma))
    judge = AttitudeJudge(problem)
    name = problem.candidates[second].effect.name
    said = f"{name} was left out: these data cannot distinguish it from effects in the model"
    assert said in [one.sentence for one in final_check(judge, (first, second))[1]]


def test_columns_too_large_for_a_double_are_left_out_and_named():
    """Outputs and loads in units that somebody got wrong by sixty orders."""
    rng = np.random.default_rng(0)
    data = noisy_truth.attitude("outliers", rng)
    run = trace(replace(data, outputs={name: 1e60 * y for name, y in data.outputs.items()}), validate=False)
    said = "voltmeter-nonlinearity was left out: its values are too large to be computed with"
    assert all(said in sensor.notes for sensor in run.sensors.values())
    columns = noisy_truth.table("outliers", rng)
    found = of_table({**columns, "load": 1e60 * columns["load"]}, "load")
    assert "second-order:load was left out: its values are too large to be computed with" in found.notes
    json.dumps(found.outcome().to_json(), allow_nan=False)
