"""Coverage factors by the shapes of distributions, held against exact ones, printed ones, and simulated sums."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
import pytest
from scipy import special

from rig.fitter.budget import EXCESS, Correlation, Influence, TypeA, budgets, combine, coverage_factor, shape_factor
from rig.fitter.budget.draws import standard_error
from rig.fitter.errors import FitError


def one(name: str, u: float, distribution: str = "normal", df: float = inf) -> Influence:
    return Influence(name, "certificate", "B", np.array([u]), df, distribution)  # type: ignore[arg-type]


def factor(*inputs: Influence, **given) -> float:
    return budgets(["y"], ["V"], np.zeros(1), (), inputs, shapes=True, **given)[0].coverage_factor


def test_one_bounded_error_has_its_exact_factor():
    assert factor(one("a", 3.0, "rectangular")) == pytest.approx(0.95 * sqrt(3.0), rel=1e-9)
    assert factor(one("a", 3.0, "arcsine")) > sqrt(2.0)  # counts as rectangular: all of it is inside
    assert factor(one("a", 3.0, "triangular")) == pytest.approx((1.0 - sqrt(0.05)) * sqrt(6.0), rel=0.01)


NORMAL, LIMITS = "normal", "rectangular"


@pytest.mark.parametrize(
    ("lines", "u", "of_largest", "k", "expanded"),
    [
        ([(1e-3, NORMAL), (2.9e-2, LIMITS), (6.4e-3, LIMITS)], "3.0e-02", 1, "1.65", 0.05),  # S9, multimeter, V
        ([(0.46, LIMITS), (1.7 * 1.15, LIMITS), (15.0, LIMITS), (29.0, LIMITS)], "3.3e+01", 2, "1.83", 60.0),  # S10, um
        (
            [(15.0, NORMAL), (10.0, NORMAL), *((one, LIMITS) for one in (23.0, 29.0, 58.0, 144.0, 29.0, 17.0))],
            "1.6e+02", 2, "1.79", 300.0,  # printed: 1.81
        ),  # S11, block calibrator, mK
    ],
)  # fmt: skip
def test_limits_that_dominate_in_ea_4_02(lines, u, of_largest, k, expanded):
    """S9 to S11: lines, u, k and U as the tests of another program print them (a Ruby program, by a laboratory).

    Their k is of the one or two largest lines alone; certificates have that of all lines, and the same expanded
    uncertainty, which is printed with one digit. S11 prints 1.81, and its two largest lines have 1.79.
    """

    def by_shape(some):
        inputs = [Influence(str(i), "printed", "B", np.array([one]), inf, shape) for i, (one, shape) in enumerate(some)]
        return budgets(["y"], ["1"], np.zeros(1), (), inputs, shapes="where limits dominate")[0]

    found = by_shape(lines)
    assert found.by_shape
    assert f"{found.standard_uncertainty:.1e}" == u
    assert float(f"{found.expanded_uncertainty:.1g}") == expanded
    assert f"{by_shape(sorted(lines)[-of_largest:]).coverage_factor:.2f}" == k


def test_factors_by_shape_where_limits_dominate_alone():
    """Of three results the first is S9's; in the second the limit has not half of the variance; the third is S10's."""
    rest = np.array([0.29, 1.01, 0.1])
    inputs = [
        Influence("a", "c", "B", np.array([1.0, 1.0, 2.0]), inf, "rectangular"),
        Influence("b", "c", "B", np.array([0.0, 0.0, 1.0]), inf, "rectangular"),
        Influence("rest", "c", "B", rest),
    ]
    names, units = list("xyz"), ["V"] * 3
    some = budgets(names, units, np.zeros(3), (), inputs, shapes="where limits dominate")
    every = budgets(names, units, np.zeros(3), (), inputs, shapes=True)
    none = budgets(names, units, np.zeros(3), (), inputs)
    assert [one.by_shape for one in some] == [True, False, True]
    assert [one.coverage_factor for one in some] == [
        every[0].coverage_factor,
        none[1].coverage_factor,
        every[2].coverage_factor,
    ]
    assert round(some[2].coverage_factor, 2) == 1.83
    r = Correlation("a", "c", 0.5)
    (both,) = budgets(["x"], ["V"], np.zeros(1), (), [one("a", 1.0, "rectangular"), one("b", 1e-6), one("c", 0.1)],
                      correlations=[r], shapes="where limits dominate")  # fmt: skip
    assert not both.by_shape, "a correlated error counts as normal"


def test_certificates_cover_95_percent_on_both_sides_of_where_limits_dominate():
    """A rectangle with a normal error: the exact coverage of intervals, whatever the share of each."""
    rest = np.array([0.1, 0.29, 0.31, 0.6, 0.99, 1.01, 1.5, 3.0])
    inputs = [
        Influence("a", "c", "B", np.ones(len(rest)), inf, "rectangular"),
        Influence("rest", "c", "B", rest),
    ]
    names, units = list("abcdefgh"), ["V"] * len(rest)
    for one_result, sd in zip(
        budgets(names, units, np.zeros(len(rest)), (), inputs, shapes="where limits dominate"), rest, strict=True
    ):
        at = one_result.expanded_uncertainty + sqrt(3.0) * np.linspace(-1.0, 1.0, 20_001)
        exact = 2.0 * np.trapezoid(special.ndtr(at / sd), dx=1.0 / 20_000) - 1.0
        assert 0.95 <= exact <= 0.956


@pytest.mark.parametrize(("df", "by_student", "by_shape"), [(8.0, "95.4", "94.3"), (5.0, "95.2", "93.9")])
def test_coverage_where_the_rule_begins_beside_few_degrees_of_freedom(df, by_student, by_shape):
    """A rectangle, and as large a normal error whose size is known from a sample: docs/explanation/uncertainty.md."""
    parts = (np.arange(400) + 0.5) / 400.0
    known = special.chdtri(df, 1.0 - parts) / df  # variance as the sample has it: its quantiles
    limit = sqrt(3.0) * (2.0 * parts - 1.0)[:, None]
    longer = (known / (known + 1.0)) ** 2 / df
    student = coverage_factor(0.95, 1.0 / longer) * np.sqrt(known + 1.0)
    shaped = shape_factor(0.95, longer + EXCESS["rectangular"] / (known + 1.0) ** 2) * np.sqrt(known + 1.0)
    held = [100.0 * np.mean(special.ndtr(half - limit) - special.ndtr(-half - limit)) for half in (student, shaped)]
    assert [f"{one:.1f}" for one in held] == [by_student, by_shape]


def test_without_bounded_errors_it_is_welch_satterthwaite():
    inputs = [one("a", 1.0, df=4.0), one("b", 2.0, df=9.0), one("c", 1.5)]
    alone = budgets(["y"], ["V"], np.zeros(1), (), inputs)[0]
    assert factor(*inputs) == pytest.approx(alone.coverage_factor, rel=1e-12)
    assert shape_factor(0.95, [0.0, 1e-7, -1e-7]) == pytest.approx([special.ndtri(0.975)] * 3, rel=1e-12)
    assert shape_factor(0.95, 0.125) == pytest.approx(float(coverage_factor(0.95, 8.0)), rel=1e-12)


SIZES = [0.95, 0.9, 0.8, 0.7, 0.5]


def covered(pair: list[Influence]) -> float:
    rng, n = np.random.default_rng(5), 60_000
    total = sum(standard_error(each, rng, n) * each.sensitivities[0] for each in pair)
    return float(np.mean(np.abs(total) <= factor(*pair)))


@pytest.mark.parametrize("shape", ["rectangular", "triangular"])
@pytest.mark.parametrize("rest", ["normal", "rectangular", "triangular"])
def test_simulated_sums_are_covered(shape, rest):
    shares = [covered([one("a", sqrt(share), shape), one("b", sqrt(1.0 - share), rest)]) for share in SIZES]
    assert min(shares) >= 0.945
    assert max(shares) <= 0.959


def test_sums_with_an_arcsine_error_are_covered_at_least_so_often():
    for rest in ("normal", "rectangular", "arcsine"):
        shares = [covered([one("a", sqrt(share), "arcsine"), one("b", sqrt(1.0 - share), rest)]) for share in SIZES]
        assert min(shares) >= 0.945
    alone = [covered([one("a", sqrt(share), "rectangular"), one("b", sqrt(1.0 - share), "arcsine")]) for share in SIZES]
    assert min(alone) >= 0.945


def test_rows_in_numpy_have_the_same_factors():
    rng = np.random.default_rng(12)
    kinds = ["normal", "rectangular", "arcsine", "triangular", "normal", "rectangular"]
    dfs = np.array([7.0, inf, inf, inf, inf, inf])
    rows = rng.normal(size=(40, 6)) * 10.0 ** rng.uniform(-1, 1, 6)
    r = np.eye(6)
    r[4, 5] = r[5, 4] = 0.5
    excess = np.array([EXCESS[kind] for kind in kinds])
    fast = combine(rows, dfs, [(np.full(40, 0.3), 12.0)], correlation=r, excess=excess)
    inputs = [
        Influence(str(i), "c", "B", rows[:, i], float(dfs[i]), kinds[i])  # type: ignore[arg-type]
        for i in range(6)
    ]
    fit = TypeA(0.3 * np.eye(40), 12.0)
    told = budgets(
        ["y"] * 40, ["V"] * 40, np.zeros(40), fit, inputs, correlations=[Correlation("4", "5", 0.5)], shapes=True
    )
    assert [each.expanded_uncertainty for each in told] == pytest.approx(fast.expanded_uncertainty.tolist(), rel=1e-9)
    assert min(each.coverage_factor for each in told) < 1.8


def test_a_result_without_uncertainty_and_another_probability():
    assert factor(one("a", 0.0, "rectangular")) == pytest.approx(special.ndtri(0.975))
    fast = combine(np.zeros((1, 1)), np.array([inf]), excess=np.array([-0.2]))
    assert fast.expanded_uncertainty.tolist() == [0.0]
    with pytest.raises(FitError, match="for 94 to 96 %, not for 99 %"):
        factor(one("a", 1.0), probability=0.99)
