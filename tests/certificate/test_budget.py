"""Budgets of several results: GTC's numbers, the same in numpy, correlations, and what is refused."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
import pytest

from proving.statistics.budgets import coverage, engine, stated
from proving.truth.budgets import laboratory
from rig.fitter.budget import Correlation, Influence, TypeA, budgets, combine, covariance, coverage_factor
from rig.fitter.budget.budget import Budgeted
from rig.fitter.errors import FitError

NAMES, UNITS = ("S", "b"), ("V", "V")


def one(name: str, *sensitivities: float, df: float = inf) -> Influence:
    return Influence(name, "certificate", "B", np.array(sensitivities), df)


@pytest.mark.parametrize(("case", "seeds"), [("rows in numpy", 200), ("calibration line", 50)])
def test_random_laboratories_have_the_same_budgets_in_gtc_and_in_numpy(case, seeds):
    """A line's sensitivities are those of uncertain numbers that GTC carries through the whole fit."""
    judge = engine().cases[case]
    assert max(judge(seed)["difference"] for seed in range(seeds)) < 1e-9


def test_a_forecast_has_the_numbers_of_gtc():
    for seed in range(10):
        fits, influences, pair = stated(laboratory(np.random.default_rng(seed)))
        asked = ["a", "b", "c"], ["V"] * 3, np.zeros(3), fits, influences
        told, forecast = (budgets(*asked, correlations=pair, forecast=one) for one in (False, True))
        for by_gtc, ours in zip(told, forecast, strict=True):
            for name in ("standard_uncertainty", "df", "coverage_factor", "expanded_uncertainty"):
                assert getattr(ours, name) == pytest.approx(getattr(by_gtc, name), rel=1e-9)
            assert ours.contributions == by_gtc.contributions


def test_expanded_uncertainties_hold_as_often_as_they_say():
    shares = [coverage().cases["normal"](seed)["held"] / 2000.0 for seed in range(5)]
    assert np.mean(shares) == pytest.approx(0.95, abs=4.0 * sqrt(0.95 * 0.05 / 10_000))


def test_an_influence_on_two_results_is_common_to_both():
    gain, fit = one("gain of dvm", 2.0, -3.0), TypeA(np.array([[4.0, 0.0], [0.0, 1.0]]), 10.0)
    assert covariance(fit, [gain], count=2).tolist() == [[8.0, -6.0], [-6.0, 10.0]]


def test_two_influences_that_are_wholly_correlated_cancel():
    pair = [one("a", 0.1, 1.0), one("b", 0.1, 2.0)]
    first, second = budgets(NAMES, UNITS, np.zeros(2), (), pair, correlations=[Correlation("a", "b", -1.0)])
    assert (first.standard_uncertainty, first.df, first.expanded_uncertainty) == (0.0, inf, 0.0)
    assert second.standard_uncertainty == pytest.approx(1.0, rel=1e-12)
    fast = combine(
        np.array([[0.1, 0.1], [1.0, 2.0]]), np.array([inf, inf]), correlation=np.array([[1.0, -1.0], [-1.0, 1.0]])
    )
    assert fast.standard_uncertainty == pytest.approx([0.0, 1.0], rel=1e-12)


def test_correlated_influences_of_one_evaluation_are_one_component():
    """Willink, Metrologia 44 (2007) 340: two means of the same five pairs have their sum's four degrees of freedom."""
    x, y = np.array([1.0, 2.0, 4.0, 3.0, 5.0]), np.array([0.5, -1.0, 2.0, 1.0, 0.0])
    ux, uy = (sqrt(np.var(a, ddof=1) / 5) for a in (x, y))
    pair = [one("x", ux, df=4.0), one("y", uy, df=4.0)]
    (total,) = budgets(
        ["x + y"],
        ["V"],
        np.array([4.0]),
        (),
        pair,
        correlations=[Correlation("x", "y", float(np.corrcoef(x, y)[0, 1]))],
    )
    assert total.standard_uncertainty == pytest.approx(sqrt(np.var(x + y, ddof=1) / 5), rel=1e-12)
    assert total.df == pytest.approx(4.0, rel=1e-12)


def test_contributions_stand_in_order_and_one_without_effect_is_shown():
    fit = TypeA(np.array([[1.0]]), 8.0)
    (found,) = budgets(["S"], ["V"], np.array([5.0]), fit, [one("level", 0.0), one("gain", 2.0)])
    assert [(line.name, line.kind, line.standard_uncertainty) for line in found.contributions] == [
        ("gain", "B", 2.0),
        ("repeatability", "A", 1.0),
        ("level", "B", 0.0),
    ]
    assert [line.share for line in found.contributions] == pytest.approx([0.8, 0.2, 0.0])
    assert found.df == pytest.approx(8 * 25.0)


def test_coverage_factors_are_those_of_the_table_of_the_gum():
    """JCGM 100:2008, table G.2, for 95 % and 95.45 %."""
    df = np.array([1, 2, 3, 4, 5, 8, 10, 20, 50, 100, inf])
    assert np.round(coverage_factor(0.95, df), 2).tolist() == [
        12.71,
        4.3,
        3.18,
        2.78,
        2.57,
        2.31,
        2.23,
        2.09,
        2.01,
        1.98,
        1.96,
    ]
    assert np.round(coverage_factor(0.9545, df), 2).tolist() == [
        13.97,
        4.53,
        3.31,
        2.87,
        2.65,
        2.37,
        2.28,
        2.13,
        2.05,
        2.03,
        2.0,
    ]


def test_a_budget_of_nothing_has_no_uncertainty():
    (found,) = budgets(["S"], ["V"], np.array([5.0]), (), [])
    assert found == Budgeted("S", "V", 5.0, 0.0, inf, 0.95, found.coverage_factor, 0.0, ())


@pytest.mark.parametrize(
    ("influences", "correlations", "words"),
    [
        ([one("a", np.nan)], [], "influence a: a number is not finite"),
        ([one("a", 1.0, df=0.0)], [], "influence a: 0 degrees of freedom"),
        ([one("a", 1.0), one("a", 2.0)], [], "two influences are called a"),
        ([one("a", 1.0)], [Correlation("a", "c", 0.5)], "no influence is called c; there are a"),
        ([one("a", 1.0), one("b", 1.0)], [Correlation("a", "b", 1.5)], "1.5; needed are two influences"),
        ([one("a", 1.0, df=3.0), one("b", 1.0)], [Correlation("a", "b", 0.5)], "3 and inf degrees of freedom"),
        (
            [one("a", 1.0), one("b", 1.0), one("c", 1.0)],
            [Correlation("a", "b", 0.9), Correlation("b", "c", 0.9), Correlation("a", "c", -0.9)],
            "contradict each other",
        ),
    ],
)
def test_what_is_refused(influences, correlations, words):
    with pytest.raises(FitError, match=words):
        budgets(["S"], ["V"], np.zeros(1), (), influences, correlations=correlations)


def test_type_a_that_is_no_covariance_is_refused():
    with pytest.raises(FitError, match="variance -1 is negative"):
        budgets(["S"], ["V"], np.zeros(1), TypeA(np.array([[-1.0]]), 3.0), [])
    with pytest.raises(FitError, match="a coverage probability of 95"):
        budgets(["S"], ["V"], np.zeros(1), (), [], probability=95)
    with pytest.raises(ValueError, match=r"expected shape \(2,\), found \(1,\)"):
        budgets(NAMES, UNITS, np.zeros(2), (), [one("a", 1.0)])
