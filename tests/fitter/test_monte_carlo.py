"""Simulation of a budget's distributions: JCGM 101's examples with their printed tables, and checks of budgets.

The numbers of the tables of JCGM 101 are from memory, as its text was not at hand; those with a closed form were
computed again from it.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
import pytest
from scipy import special

from rig.fitter.budget import Correlation, Influence, TypeA, budgets, check, monte_carlo, simulate
from rig.fitter.budget.draws import standard_error, standard_errors, trials
from rig.fitter.budget.influence import checked
from rig.fitter.budget.monte_carlo import numerical_tolerance, shortest
from rig.fitter.errors import FitError


def one(name: str, *sensitivities: float, df: float = inf, distribution: str = "normal") -> Influence:
    return Influence(name, "certificate", "B", np.array(sensitivities), df, distribution)  # type: ignore[arg-type]


def four(distribution: str, last: float = 1.0) -> list[Influence]:
    return [one(f"x{i}", s, distribution=distribution) for i, s in enumerate([1.0, 1.0, 1.0, last])]


def checked_sum(inputs: list[Influence], **given):
    budget = budgets(["y"], ["1"], np.zeros(1), (), inputs)
    return budget[0], monte_carlo(budget, (), inputs, seed=101, **given)[0]


def test_normal_inputs_of_jcgm_101():
    """9.2.2, table 2: u = 2.00, 95 % from -3.92 to 3.92 by both methods."""
    budget, found = checked_sum(four("normal"), count=400_000)
    assert (budget.standard_uncertainty, round(budget.expanded_uncertainty, 2)) == (2.0, 3.92)
    assert found.tolerance == 0.05
    assert found.agrees is True
    assert found.simulated.standard_deviation == pytest.approx(2.0, abs=found.simulated.error)
    assert found.simulated.symmetric.lower == pytest.approx(-3.92, abs=0.02)
    assert found.simulated.symmetric.upper == pytest.approx(3.92, abs=0.02)


def test_rectangular_inputs_of_jcgm_101():
    """9.2.3, table 3: the exact interval is 2 sqrt(3) (2 - (3/5)^(1/4)) = 3.88; with two digits the GUM's is valid."""
    exact = 2.0 * sqrt(3.0) * (2.0 - 0.6**0.25)
    assert round(exact, 2) == 3.88
    _, found = checked_sum(four("rectangular"), count=400_000)
    assert found.simulated.symmetric.upper == pytest.approx(exact, abs=found.simulated.error)
    assert found.upper == pytest.approx(0.04, abs=found.simulated.error)
    assert found.agrees is not False  # 0.04 is near the tolerance of 0.05: only millions of trials tell
    assert checked_sum(four("rectangular"), digits=3, count=400_000)[1].agrees is False


def test_rectangular_inputs_of_different_widths_of_jcgm_101():
    """9.2.4, table 4: u = 10.1, 19.9 by the GUM, 17.0 by simulation: not valid."""
    budget, found = checked_sum(four("rectangular", 10.0))
    assert (round(budget.standard_uncertainty, 1), round(budget.expanded_uncertainty, 1)) == (10.1, 19.9)
    assert [round(found.simulated.symmetric.lower, 1), round(found.simulated.symmetric.upper, 1)] == [
        pytest.approx(-17.0, abs=0.101),
        pytest.approx(17.0, abs=0.101),
    ]
    assert found.agrees is False
    assert found.simulated.stable


def test_mass_calibration_of_jcgm_101():
    """9.3, table 6, in mg: 1.2340(539) and 1.1285 to 1.3395 by the GUM; 1.2341(754), shortest 1.0834 to 1.3825.

    The differences printed are 0.0451 and 0.0430; with one digit the tolerance is 0.005, and the GUM's is not valid.
    """

    def mass(errors):
        reference, weights, air, unknown, known = errors.T
        rho = 1.2 + 0.1 / sqrt(3.0) * air
        inverse = 1.0 / (8000.0 + 1000.0 / sqrt(3.0) * unknown) - 1.0 / (8000.0 + 50.0 / sqrt(3.0) * known)
        return ((1e5 + 0.050 * reference + 1.234 + 0.020 * weights) * (1.0 + (rho - 1.2) * inverse) - 1e5)[:, None]

    inputs = [one("reference", 0.050), one("weights", 0.020)]
    inputs += [one(name, 0.0, distribution="rectangular") for name in ("air", "unknown", "known")]
    budget = budgets(["mass"], ["mg"], np.array([1.234]), (), inputs)
    assert f"{budget[0].standard_uncertainty:.4f}" == "0.0539"
    assert f"{budget[0].value - budget[0].expanded_uncertainty:.4f}" in ("1.1285", "1.1284")
    assert f"{budget[0].value + budget[0].expanded_uncertainty:.4f}" in ("1.3395", "1.3396")
    (found,) = monte_carlo(budget, (), inputs, seed=93, evaluate=mass, digits=1, count=700_000)
    simulated = found.simulated
    assert simulated.stable
    assert simulated.mean == pytest.approx(1.2341, abs=3e-4)
    assert simulated.standard_deviation == pytest.approx(0.0754, abs=3e-4)
    assert simulated.shortest.lower == pytest.approx(1.0834, abs=0.004)
    assert simulated.shortest.upper == pytest.approx(1.3825, abs=0.004)
    assert (round(found.lower, 3), round(found.upper, 3)) == (
        pytest.approx(0.045, abs=3e-3),
        pytest.approx(-0.043, abs=3e-3),
    )
    assert found.tolerance == 0.005
    assert found.agrees is False


@pytest.mark.parametrize(
    ("x", "r", "mean", "sd", "lower", "upper"),
    [
        (0.000, 0.0, 50, 50, 0, 150),
        (0.010, 0.0, 150, 112, 0, 367),
        (0.050, 0.0, 2551, 502, 1590, 3543),
        (0.000, 0.9, 50, 67, 0, 185),
        (0.010, 0.9, 150, 121, 13, 398),
        (0.050, 0.9, 2551, 504, 1628, 3555),
    ],
)
def test_comparison_loss_of_jcgm_101(x, r, mean, sd, lower, upper):
    """9.4, tables 7 and 8, in 1e-6: mean, deviation and shortest interval; printed numbers are of a simulation, too."""
    inputs = [one("x1", 1.0), one("x2", 1.0)]
    correlations = [Correlation("x1", "x2", r)] if r else []

    def loss(errors):
        first, second = x + 0.005 * errors[:, 0], 0.005 * errors[:, 1]
        return 1e6 * (first**2 + second**2)[:, None]

    (found,) = simulate(trials(checked(["Y"], np.zeros(1), (), inputs, correlations), loss), seed=94, count=200_000)
    assert found.mean == pytest.approx(mean, abs=0.5 + 5.0 * sd / sqrt(200_000))
    assert found.standard_deviation == pytest.approx(sd, abs=0.5 + 0.008 * sd)
    assert found.shortest.lower == pytest.approx(lower, abs=0.5 + 0.06 * sd)
    assert found.shortest.upper == pytest.approx(upper, abs=0.5 + 0.06 * sd)


def test_gauge_block_of_jcgm_101():
    """9.5: 838 nm, u = 36 nm, 99 % within 1 nm of 745 to 932 nm; the GUM has 32 nm (H.1)."""

    def trapezoid(rng, half, d, n):
        lower = -half + d * rng.uniform(-1.0, 1.0, n)
        return lower - 2.0 * lower * rng.random(n)

    def block(rng, n):
        standard, difference = 50_000_623.0 + 25.0 * rng.standard_t(18.0, n), 215.0 + 6.0 * rng.standard_t(24.0, n)
        comparator = 4.0 * rng.standard_t(5.0, n) + 7.0 * rng.standard_t(8.0, n)
        alpha = rng.uniform(9.5e-6, 13.5e-6, n)
        theta = rng.normal(-0.1, 0.2, n) + 0.5 * np.sin(2.0 * np.pi * rng.random(n))
        expansion = trapezoid(rng, 1e-6, 0.1e-6, n) * theta + alpha * trapezoid(rng, 0.050, 0.025, n)
        return (standard * (1.0 - expansion) + difference + comparator - 5e7)[:, None]

    (found,) = simulate(block, seed=95, probability=0.99, count=500_000)
    assert round(found.mean) == 838
    assert round(found.standard_deviation) == 36
    assert found.shortest.lower == pytest.approx(745.0, abs=1.5)
    assert found.shortest.upper == pytest.approx(932.0, abs=1.5)


@pytest.mark.parametrize(
    ("limits", "k", "expanded"),
    [
        ([("rectangular", 0.05), ("rectangular", 0.011), ("normal", 0.001)], 1.65, 0.05),  # S9, multimeter, V
        ([("rectangular", 50.0), ("rectangular", 25.0), ("normal", 2.1)], 1.83, 60.0),  # S10, calliper, um
    ],
)
def test_rectangular_budgets_of_ea_4_02(limits, k, expanded):
    """S9 and S10: where rectangular lines dominate, k is not 2. From memory; k is of the dominant lines alone."""
    inputs = [
        one(str(i), half / sqrt(3.0) if shape == "rectangular" else half, distribution=shape)
        for i, (shape, half) in enumerate(limits)
    ]
    budget, found = checked_sum(inputs, count=200_000)
    half = 0.5 * (found.simulated.symmetric.upper - found.simulated.symmetric.lower)
    assert half / budget.standard_uncertainty == pytest.approx(k, abs=0.06)
    assert float(f"{half:.1g}") == expanded
    assert found.agrees is False


def test_shapes_have_mean_zero_and_the_standard_uncertainty():
    rng, n = np.random.default_rng(6), 200_000
    limits = {"normal": inf, "rectangular": sqrt(3.0), "triangular": sqrt(6.0), "arcsine": sqrt(2.0)}
    for shape, limit in limits.items():
        drawn = standard_error(one("a", 1.0, distribution=shape), rng, n)
        assert abs(drawn.mean()) < 5.0 / sqrt(n)
        assert drawn.std() == pytest.approx(1.0, abs=0.01)
        assert np.max(np.abs(drawn)) <= limit
    drawn = np.sort(standard_error(one("a", 1.0, df=4.0), rng, n))
    assert drawn[int(0.975 * n)] == pytest.approx(special.stdtrit(4.0, 0.975), rel=0.03)


def test_correlated_errors_have_their_correlation_and_one_scale():
    pair = [one("a", 1.0, df=5.0), one("b", 1.0, df=5.0), one("c", 1.0)]
    inputs = checked(["y"], np.zeros(1), (), pair, [Correlation("a", "b", -0.6)])
    drawn = standard_errors(inputs, np.random.default_rng(7), 200_000)
    # Ranks: moments of t with five degrees of freedom converge slowly. Spearman's of a normal pair at -0.6 is -0.582.
    ranks = np.argsort(np.argsort(drawn, axis=0), axis=0)
    r = np.corrcoef(ranks.T)
    assert r[0, 1] == pytest.approx(-0.575, abs=0.02)
    assert abs(r[0, 2]) < 0.02
    assert np.corrcoef(np.abs(ranks[:, 0] - 1e5), np.abs(ranks[:, 1] - 1e5))[0, 1] > 0.3


def test_a_fit_is_drawn_with_its_covariance_and_its_degrees_of_freedom():
    covariance = np.array([[4.0, 3.0], [3.0, 9.0]])
    fit = TypeA(covariance, np.array([6.0, 12.0]))
    budget = budgets(["a", "b"], ["V", "V"], np.array([1.0, 2.0]), fit, [])
    found = monte_carlo(budget, fit, [], seed=8, digits=1, count=100_000)
    assert [one.agrees for one in found] == [True, True]
    draw = trials(checked(["a", "b"], np.zeros(2), fit, [], None))
    drawn = draw(np.random.default_rng(8), 100_000)
    assert np.corrcoef(drawn.T)[0, 1] == pytest.approx(0.5, abs=0.03)
    assert np.var(drawn[:, 0]) == pytest.approx(4.0 * 6.0 / 4.0, rel=0.1)


def test_a_nonlinear_evaluation_is_seen():
    """H.1.7: the product of two errors with mean zero is in no budget of first order."""
    pair = [one("a", 0.0), one("b", 0.0), one("c", 1.0)]
    budget = budgets(["y"], ["1"], np.zeros(1), (), pair)
    (found,) = monte_carlo(budget, (), pair, seed=9, evaluate=lambda e: (e[:, 2] + e[:, 0] * e[:, 1])[:, None])
    assert found.agrees is False
    assert found.simulated.standard_deviation == pytest.approx(sqrt(2.0), rel=0.02)


def test_the_same_seed_gives_the_same_numbers():
    first, second = (checked_sum(four("normal"), count=20_000)[1] for _ in range(2))
    assert first == second


def test_a_simulation_that_is_too_short_to_tell_says_so():
    budget, found = checked_sum(four("normal"), digits=3, count=20_000)
    assert found.agrees is None
    assert not found.simulated.stable
    assert check(budget, found.simulated, digits=1).agrees is True


def test_numerical_tolerances_of_jcgm_101():
    """7.9.2: 0.00035 with two digits is 35 x 10^-5, tolerance 0.5 x 10^-5; 2 K with one digit: 0.5 K."""
    assert numerical_tolerance(0.00035, 2) == 0.5e-5
    assert numerical_tolerance(2.0, 1) == 0.5
    assert numerical_tolerance(0.0996, 2) == 0.005
    assert numerical_tolerance(0.0, 2) == 0.0


def test_the_shortest_interval_of_sorted_values():
    found = shortest(np.array([0.0, 10.0, 11.0, 12.0, 13.0, 14.0, 20.0, 30.0, 40.0, 50.0]), 0.4)
    assert (found.lower, found.upper) == (10.0, 14.0)


def test_what_is_refused():
    pair = [one("a", 1.0, distribution="rectangular"), one("b", 1.0)]
    budget = budgets(["y"], ["1"], np.zeros(1), (), pair, correlations=[Correlation("a", "b", 0.5)])
    with pytest.raises(FitError, match="influence a is rectangular and correlated"):
        monte_carlo(budget, (), pair, seed=1, correlations=[Correlation("a", "b", 0.5)])
    with pytest.raises(FitError, match="not finite"):
        simulate(lambda rng, n: np.full((n, 1), np.nan), seed=1)
    with pytest.raises(FitError, match="a coverage probability of 95"):
        simulate(lambda rng, n: np.zeros((n, 1)), seed=1, probability=95.0)
    with pytest.raises(ValueError, match="the evaluation gave"):
        monte_carlo(budget, (), pair[1:], seed=1, evaluate=lambda e: e[:, 0])
