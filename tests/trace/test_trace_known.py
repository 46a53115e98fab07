"""What a trace computes once, or for several at a time, is what it would compute each time by itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from proving.truth.attitude import D1, simulate
from proving.truth.attitude_hidden import CLEAN
from proving.truth.whole_plot import Bench, Run, Transducer
from proving.truth.whole_plot import simulate as simulate_plots
from rig.fitter.linear import least_squares, orthonormal
from rig.fitter.replication import Rows, analyse, drift_of, sigma_E
from rig.fitter.trace.aliases import DELTA, PER_COLUMN, Products, _paths, rivals
from rig.fitter.trace.lines import line, lines
from rig.fitter.trace.shape import nearest
from rig.fitter.trace.whitened import Whitened
from rig.procedures.attitude.effects import CATALOGUE
from rig.procedures.attitude.trace.estimate import estimate, stated
from rig.procedures.attitude.trace.make_problem import make_problem
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.fit import named_formula
from rig.procedures.pressure.trace.estimate import design_of
from rig.procedures.pressure.trace.estimate import estimate as estimate_plots
from rig.procedures.pressure.trace.judge import WholePlotJudge
from rig.procedures.pressure.trace.problem import Problem
from rig.procedures.pressure.trace.problem import pose as pose_plots
from rig.procedures.pressure.trace.run import scene_of

SMALL = D1(60, 5, 5, replications=4)


@dataclass(frozen=True)
class Named:
    name: str
    sensor: str

    @property
    def effect(self):
        return self


@pytest.fixture(scope="module")
def attitude():
    return make_problem(simulate(CLEAN, SMALL, 1)[0], CATALOGUE)


@pytest.fixture(scope="module")
def plots() -> Problem:
    two = (Transducer(), Transducer(sensitivity=1.9))
    data = simulate_plots(Bench(two), Run(), 1)
    names, declared = named_formula("full").columns(data.table)
    return pose_plots(data, names, declared, scene_of(data), PRESSURE_CATALOGUE)


def test_paths_of_several_names_are_those_of_each():
    rng = np.random.default_rng(2)
    x = rng.standard_normal((60, 12))
    y = x @ rng.normal(0.0, 3.0, 12) + rng.standard_normal(60)
    products = Products(x.T @ x, x.T @ y)
    names = [
        ([(0,), (1,), (2,)], False),
        ([(3, 4), (5, 6), (0, 7)], False),
        ([(8,), (9,), (10,)], True),
        ([(11,)], False),
    ]
    together = _paths(products, names)
    assert together == [_paths(products, [name])[0] for name in names]
    assert [len(path) for path in together] == [3, 3, 1, 1], "of values of one constant one at a time"
    for path in together[:2]:
        for terms, price in path.items():
            assert price == pytest.approx(products.price(terms), rel=1e-9)


def test_names_that_cannot_explain_it_are_left_out_and_no_alias_is():
    """Of columns like the first two and of others, in two sensors, by what is nearly all and by all explanations."""
    rng = np.random.default_rng(7)
    x = np.zeros((80, 16))
    x[:40, :8], x[40:, 8:] = rng.standard_normal((2, 40, 8))
    for k in (0, 8):
        x[:, k + 2 : k + 4] = x[:, k : k + 2] + 0.02 * rng.standard_normal((80, 2)) * (x[:, k : k + 2] != 0)
    y = x[:, [0, 1, 8, 9]] @ [3.0, 2.0, -3.0, 4.0] + rng.standard_normal(80)
    products = Products(x.T @ x, x.T @ y)
    entries = [Named(("one", "like it", "other", "another")[j % 8 // 2], "ab"[j // 8]) for j in range(16)]
    every = rivals(entries, products, (0, 1, 8, 9), (), ("a", "b"))
    near = rivals(entries, products, (0, 1, 8, 9), (), ("a", "b"), within=DELTA)
    assert [r.effect for r in every if r.alias] == ["one", "like it"]
    assert near == tuple(r for r in every if r.effect in ("one", "like it"))


def test_the_bound_of_a_name_drops_none_that_its_terms_can_reach():
    """Columns that are alike but for a ten-thousandth, twice the same, and zero."""
    rng = np.random.default_rng(5)
    x = rng.standard_normal((70, 12))
    x[:, 1], x[:, 2] = x[:, 0] + 1e-4 * x[:, 1], x[:, 0] + 1e-4 * x[:, 2]
    x[:, 4], x[:, 7] = x[:, 3], 0.0
    y = x @ rng.normal(0.0, 2.0, 12) + 3e4 * (x[:, 1] - x[:, 0]) + rng.standard_normal(70)
    products = Products(x.T @ x, x.T @ y)
    of = {"alike": [(0,), (1,), (2,)], "same": [(3,), (4,), (5,)], "zero": [(6,), (7,), (8,)], "one": [(9,)]}
    for name, units in of.items():
        terms = tuple(j for unit in units for j in unit)
        least = products.price(terms) - PER_COLUMN * (len(terms) - 1)
        assert name in products.able(of, set(), least + 1e-6 * abs(least))
        assert name not in products.able(of, set(), least * (1.1 if least < 0 else 0.9) - 1.0)


def test_products_among_others_are_those_alone_in_their_places():
    rng = np.random.default_rng(4)
    columns = rng.standard_normal((2, 30, 3))
    columns[1, :, 1] = 0.0
    white, weight, at = Whitened(rng.standard_normal((2, 30)), columns), np.array([1.0, 0.5]), np.array([4, 1, 3])
    alone, among = Products.of(white, weight), Products.of(white, weight, (at, 6))
    assert np.array_equal(among.columns[np.ix_(at, at)], alone.columns)
    assert np.array_equal(among.outputs[at], alone.outputs)
    assert np.count_nonzero(among.columns) == np.count_nonzero(alone.columns)
    assert among.columns.shape == (6, 6)


def test_a_run_of_all_its_rows_is_not_prepared_again(plots):
    assert plots.take(np.arange(len(plots.declared))) is plots
    assert len(plots.take(np.arange(1, len(plots.declared))).declared) == len(plots.declared) - 1


def test_periods_of_several_residuals_are_those_of_each():
    rng = np.random.default_rng(3)
    left, at = rng.standard_normal((3, 90)), np.cumsum(1.0 + 0.2 * rng.random(90))
    left[1] += np.sin(at / 2.0)
    left[2] = 0.0
    stretch, white = np.arange(90) // 30, rng.standard_normal((90, 4))
    found = lines(left, at, stretch, white)
    assert found[2] is None
    for one, alone in zip(found, (line(each, at, stretch, white) for each in left), strict=True):
        assert (one is None) == (alone is None)
        if one is not None and alone is not None:
            assert (one.period, one.unit) == (alone.period, alone.unit)
            assert (one.p, one.share) == pytest.approx((alone.p, alone.share), rel=1e-9)


def test_drift_and_standard_error_alone_are_those_of_table_2():
    rng = np.random.default_rng(4)
    columns = np.column_stack([np.ones(48), rng.standard_normal((48, 2))])
    rows, y = Rows(columns, np.arange(48) % 12, np.arange(48) // 12), rng.standard_normal(48)
    rows = rows.beside(rng.standard_normal((48, 1)))
    fit = least_squares(columns, y, ["a", "b", "c"])
    table = analyse(fit, rows, y, 1)
    assert (drift_of(rows, y), sigma_E(fit, 1)) == (table.drift, table.sigma_E)


def test_one_column_is_a_basis_as_it_is_of_several():
    column = np.random.default_rng(5).standard_normal((20, 1))
    both = orthonormal(np.column_stack([column, column]))
    np.testing.assert_allclose(orthonormal(column) @ orthonormal(column).T, both @ both.T, atol=1e-15)
    assert orthonormal(1e-9 * column, np.array([1.0])).shape == (20, 0), "short beside its own length"


def test_tables_of_an_estimate_are_made_when_they_are_read(attitude, monkeypatch):
    made = []
    monkeypatch.setattr(
        "rig.procedures.attitude.trace.estimate.analyse", lambda *given: made.append(given) or analyse(*given)
    )
    fitted = estimate(attitude, (0,))
    errors = stated(fitted)
    assert not made
    assert errors.tolist() == [table.sigma_E for table in fitted.tables]
    assert len(made) == len(attitude.sensors)


def test_of_names_that_explain_the_same_the_first_in_the_catalogue_is_told_first():
    """Their shares differ by rounding only."""
    basis = np.eye(4)[:, :2]
    near = {"other": (0.5, basis), "first": (0.7 - 2e-16, basis), "second": (0.7, basis)}
    assert [one.effect for one in nearest(near, np.ones(4), basis)] == ["first", "second", "other"]


def test_fits_and_designs_of_a_run_in_whole_plots_are_made_once(plots):
    j = next(j for j, c in enumerate(plots.candidates) if c.sensor is not None)
    judge = WholePlotJudge.of(plots)
    assert estimate_plots(judge, (j,)) is estimate_plots(judge, (j,))
    none = np.empty((len(plots.declared), 0))
    assert design_of(plots, none, ()) is design_of(plots, none.copy(), ())
    assert len(plots.designs) == 2, "of the transducer with the effect, and of the other"
