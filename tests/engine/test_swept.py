"""Settings that were swept once in time: what is an effect of theirs may be one of time, and both are said."""

from __future__ import annotations

import general_lab as lab
import numpy as np
import pytest

from rig.bench.config import parse_procedure
from rig.fitter.trace.engine import family
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.planning import advice
from rig.procedures.general.settings import GeneralProcedure
from rig.procedures.general.swept import functions_alike, swept
from rig.procedures.general.trace import trace_general
from rig.procedures.tables.table import Table

N = 30
TIME = 60.0 * np.arange(N)


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)


def traced(x, bend):
    rng = np.random.default_rng(3)
    y = 0.2 + x + bend * x**2 + rng.normal(0.0, 5e-4, N)
    roles = Roles(response="y", formula="1 + x", time="elapsed_s")
    table = Table("t.csv", {"elapsed_s": TIME, "x": x, "y": y}, simulated=True, provenance={})
    return trace_general(roles_of(table, roles)[0])


@pytest.mark.parametrize("bend", [0.0, 6e-4])
def test_a_curve_over_a_setting_that_rose_once_may_be_any_function_of_time(bend):
    levels = np.logspace(-1, 1, N)  # no power of time is alike
    once = traced(levels, bend)
    assert any(remark.startswith("x changes in one direction only, with elapsed_s") for remark in once.notes)
    if not bend:
        return
    (found,) = once.effects
    assert "function:elapsed_s" in found.aliases
    assert "measure in another order, or up and down" in found.separate_by
    anew = traced(np.random.default_rng(1).permutation(levels), bend)
    assert not any("one direction" in remark for remark in anew.notes)
    assert not any("function:" in alias for effect in anew.effects for alias in effect.aliases)


@pytest.mark.parametrize(
    ("values", "rises_once"),
    [
        (np.arange(N), True),
        (-np.sqrt(np.arange(N)), True),
        (np.repeat(np.arange(N // 2), 2), True),
        (np.repeat([1.0, 2.0, 3.0], N // 3), False),  # time passes within a level: a drift shows there
        (np.where(np.arange(N) < N // 2, np.arange(N), N - np.arange(N)), False),
        (np.repeat([0.0, 1.0], N // 2), False),
    ],
)
def test_what_is_swept_once(values, rises_once):
    assert swept(values.astype(float), TIME) is rises_once


def test_what_is_said_already_is_not_said_again():
    course = ("t", "x")
    assert functions_alike(("x",), [], course) == ["function:t"]
    assert functions_alike(("t",), [], course) == ["function:x"]
    assert functions_alike(("x",), [("t",)], course) == []
    assert functions_alike(("x", "z"), [], course) == []


@pytest.mark.parametrize(
    ("order", "replications", "told"),
    [("as written", 1, True), ("up-down", 1, False), ("as written", 2, False)],
)
def test_a_plan_says_what_is_swept_once(order, replications, told):
    text = lab.PROCEDURE.replace('"up-down"', f'"{order}"').replace(
        "replications = 2", f"replications = {replications}"
    )
    procedure = parse_procedure(text, "p")
    assert isinstance(procedure, GeneralProcedure)
    sentences = [one.sentence for one in advice(procedure)]
    assert any("force_kN changes in one direction only" in sentence for sentence in sentences) is told


def test_a_hard_factor_whose_random_order_happens_to_rise_is_told_too():
    text = lab.PROCEDURE.replace('order = "up-down"', 'hard = true\norder = "random"').replace(
        "[0, 1, 2, 5]", "[1, 2, 5]"
    )
    text = text.replace("replications = 2", "replications = 1")
    rises = 0
    for seed in range(12):
        procedure = parse_procedure(text.replace("seed = 1", f"seed = {seed}"), "p")
        levels = procedure.expand().column("force_kN")
        told = any("in one direction only" in one.sentence for one in advice(procedure))
        assert told is (sorted(levels) in (levels, levels[::-1]))
        rises += told
    assert 0 < rises < 12
