"""No verdict passes over what a shape of all recorded columns jointly takes up, whatever its name."""

import numpy as np
import pytest

from proving.statistics.laws import SHAPES, blind, judged
from proving.truth.laws import laws
from proving.truth.table import options, simulate
from rig.fitter.trace.engine import family
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.jointly import polynomials, spread_evenly
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import report
from rig.procedures.general.trace.run import problem_of
from rig.procedures.general.trace.together import together
from rig.procedures.tables.table import Table


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    """200 draws of the family, and no rows left out: the verdict is asked for alone, and quickly."""
    monkeypatch.setattr(family, "MOST", 200)
    monkeypatch.setattr(report, "left_out", lambda *_: None)


def prepared(columns, formula, **told):
    return roles_of(Table("table.csv", columns, True, {}), Roles(response="y", formula=formula, **told))[0]


def unnamed_options(lab):
    return {name: value for name, value in options(lab).items() if name not in ("response", "formula")}


def asked(columns, formula="1 + x", **told):
    data = prepared(columns, formula, **told)
    return together(TableJudge(problem_of(data)), (), data)


@pytest.mark.parametrize("name", SHAPES)
def test_a_clean_table_has_no_shape(name):
    lab = SHAPES[name]
    for seed in range(4):
        assert asked(simulate(lab, seed), **unnamed_options(lab)) is None


def test_a_shape_of_three_columns_that_has_no_name_is_seen_and_says_its_columns():
    rng = np.random.default_rng(1)
    a, b, c, idle = rng.uniform(1.0, 3.0, (4, 120))
    y = 2.0 * a + 0.05 * np.sin(2.0 * a * b) * c + 0.005 * rng.standard_normal(120)
    found = asked({"a": a, "b": b, "c": c, "idle": idle, "y": y}, "1 + a")
    assert found is not None
    assert found.place.variables >= {"a", "b"}
    assert "idle" not in found.place.variables
    assert found.share > 0.3


def test_a_shape_finer_than_polynomials_is_seen_by_neighbours():
    x = np.linspace(0.0, 10.0, 300)
    rng = np.random.default_rng(2)
    y = x + np.sin(12.0 * x) + 0.3 * rng.standard_normal(300)
    order = rng.permutation(300)
    found = asked({"x": x[order], "y": y[order]})
    assert found is not None
    assert found.place.block.place == "over x"


def test_rows_that_stand_alone_are_no_shape():
    for seed in range(10):
        rng = np.random.default_rng(seed)
        x = rng.uniform(0.0, 10.0, 50)
        y = x + 0.1 * rng.standard_normal(50)
        y[np.argmax(x)] += 5.0
        assert asked({"x": x, "y": y}) is None


def test_a_smooth_peak_is_not_many_rows_that_stand_alone():
    """A spectral line of 801 rows beside a straight line."""
    x = np.linspace(380.0, 780.0, 801)
    y = 10.0 * np.exp(-0.5 * ((x - 560.0) / 8.0) ** 2) + 0.01 * np.random.default_rng(3).standard_normal(801)
    judge = TableJudge(problem_of(prepared({"x": x, "y": y}, "1 + x")))
    assert np.array_equal(judge.held(()), judge.problem.y)
    y[400] += 50.0
    alone = TableJudge(problem_of(prepared({"x": x, "y": y}, "1 + x")))
    assert np.flatnonzero(alone.held(()) - alone.problem.y).tolist() == [400]


def test_polynomials_have_each_total_degree_and_columns_for_the_rows():
    u = spread_evenly(np.random.default_rng(4).uniform(size=(100, 3)))
    assert [one.shape for one in polynomials(u, 25)] == [(100, 3), (100, 6), (100, 10)]
    assert spread_evenly(10.0 ** np.arange(5.0)[:, None])[:, 0].tolist() == [-1.0, -0.5, 0.0, 0.5, 1.0]


QUICK = ("I.12.1", "II.10.9", "III.14.14")


@pytest.mark.parametrize("number", QUICK)
def test_no_verdict_about_a_shifted_law_is_blind(number):
    """A share of `python -m proving laws verdicts`."""
    assert not blind(judged(laws()[number], 0))


def test_the_laws_are_sixty_and_differ_from_what_is_declared():
    assert len(laws()) == 60
    assert all(f"1 + I({law.truth})" != law.declared for law in laws().values())
