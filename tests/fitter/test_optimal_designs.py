"""Searches meet or beat printed designs, known optima, and all possible designs where these can be counted."""

import re
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np
import pytest
from published_designs import (
    EQUIVALENT_20,
    EQUIVALENT_24,
    FIVES,
    FOURTEEN,
    INDEPENDENT_I,
    LARGEST_DETERMINANTS,
    LEVELS,
    SIX,
    SPLIT_D,
    SPLIT_I,
    dense_information,
    linear,
    quadratic,
)
from scipy.optimize import brentq

from rig.fitter.designs import Factor, evaluate, optimal, optimal_measure
from rig.fitter.errors import FitError

DOCUMENT = Path(__file__).parents[2] / "docs" / "how_to" / "designs.md"
SQUARE, CUBE = [LEVELS] * 2, [LEVELS] * 3


def log_det(points, plot=None, eta=1.0, model=quadratic):
    rows = model(points)
    return np.linalg.slogdet(
        dense_information(rows, [0] * len(rows) if plot is None else plot, 0.0 if plot is None else eta)
    )[1]


def test_jones_and_goos_independent_points():
    d, i = (
        optimal(SQUARE, quadratic, 20, starts=50).evaluation,
        optimal(SQUARE, quadratic, 20, criterion="I", starts=50).evaluation,
    )
    assert d.mean_variance == pytest.approx(0.233, abs=5e-4)
    assert np.diag(d.covariance) == pytest.approx([0.302, 0.068, 0.068, 0.083, 0.282, 0.282], abs=5e-4)
    printed = evaluate(INDEPENDENT_I, SQUARE, quadratic)
    assert printed.mean_variance == pytest.approx(0.183, abs=5e-4)
    assert np.diag(printed.covariance) == pytest.approx([0.179, 0.083, 0.083, 0.125, 0.214, 0.214], abs=5e-4)
    assert np.exp((printed.log_determinant - d.log_determinant) / 6) == pytest.approx(0.949, abs=5e-4)
    assert printed.mean_variance / d.mean_variance == pytest.approx(0.785, abs=5e-4)
    assert i.mean_variance < printed.mean_variance - 5e-4, "a better one than the printed"


def test_jones_and_goos_split_plot():
    d = optimal(SQUARE, quadratic, 20, hard=(0,), whole_plots=4, starts=50).evaluation
    i = optimal(SQUARE, quadratic, 20, hard=(0,), whole_plots=4, criterion="I", starts=50).evaluation
    assert d.log_determinant == pytest.approx(log_det(SPLIT_D, FIVES), abs=1e-9)
    assert np.diag(d.covariance) == pytest.approx([1.301, 0.450, 0.075, 0.092, 1.665, 0.279], abs=6e-4)
    assert np.diag(i.covariance) == pytest.approx([0.640, 0.600, 0.083, 0.125, 1.240, 0.250], abs=5e-4)
    assert (d.mean_variance, i.mean_variance) == pytest.approx((0.973, 0.717), abs=5e-4)
    assert np.exp((i.log_determinant - d.log_determinant) / 6) == pytest.approx(0.934, abs=5e-4)


@pytest.mark.parametrize(("eta", "printed"), [(1.0, 0.738), (0.1, 0.759), (10.0, 0.729)])
def test_jones_and_goos_i_efficiency_of_the_d_optimal_design(eta, printed):
    d, i = (
        evaluate(points, SQUARE, quadratic, whole_plot=FIVES, eta=eta).mean_variance for points in (SPLIT_D, SPLIT_I)
    )
    assert i / d == pytest.approx(printed, abs=6e-4)


@pytest.mark.parametrize(("criterion", "starts", "printed"), [("D", 20, 3.10), ("I", 120, 2.05)])
def test_jones_and_goos_where_another_design_becomes_the_best(criterion, starts, printed):
    """Their Table 4: 7 whole plots of 4, two easy factors; one design is optimal below this eta, another above it."""
    options = {"hard": (0,), "whole_plots": 7, "criterion": criterion, "starts": starts}
    low, high = (optimal(CUBE, quadratic, 28, eta=eta, **options) for eta in (1.0, 10.0))

    def worth(design, eta):
        e = evaluate(design.points, CUBE, quadratic, whole_plot=design.whole_plot, eta=eta)
        return e.log_determinant if criterion == "D" else -e.mean_variance

    assert brentq(lambda eta: worth(low, eta) - worth(high, eta), 1.0, 10.0) == pytest.approx(printed, abs=0.011)


@pytest.mark.parametrize(
    ("design", "eta"), [(d, eta) for d in (EQUIVALENT_20, EQUIVALENT_24) for eta in (0.1, 1.0, 10.0)]
)
def test_at_least_as_good_as_equivalent_estimation_designs(design, eta):
    points, plot = np.vstack(design), np.repeat(np.arange(len(design)), 4)
    rows = quadratic(points)
    z = np.eye(len(design))[plot]
    v = np.eye(len(rows)) + eta * z @ z.T
    ordinary = np.linalg.inv(rows.T @ rows) @ rows.T
    printed = evaluate(points, CUBE, quadratic, whole_plot=plot, eta=eta)
    assert printed.covariance == pytest.approx(ordinary @ v @ ordinary.T, abs=1e-9), "its defining property"
    found = optimal(CUBE, quadratic, len(points), hard=(0,), whole_plots=len(design), eta=eta, starts=40)
    assert found.evaluation.log_determinant > printed.log_determinant


def test_fourteen_points_as_algdesign():
    printed = evaluate(FOURTEEN, CUBE, quadratic)
    found = optimal(CUBE, quadratic, 14, starts=250)
    assert np.exp(printed.log_determinant / 10) / 14 == pytest.approx(0.4630447, abs=5e-8)
    assert 14 * np.trace(printed.covariance) / 10 == pytest.approx(3.22, abs=5e-3)
    assert printed.efficiency.g == pytest.approx(0.893, abs=5e-4)
    assert found.evaluation.log_determinant == pytest.approx(printed.log_determinant, abs=1e-9)
    assert found.reached > 1


def test_box_and_draper_six_points():
    found = optimal([Factor.within(-1, 1)] * 2, quadratic, 6, starts=50)
    assert found.evaluation.log_determinant == pytest.approx(log_det(SIX), abs=1e-6)
    at_levels = optimal(SQUARE, quadratic, 6, starts=50).evaluation.log_determinant
    assert at_levels < log_det(SIX) - 1e-3, "which three levels do not reach"


@pytest.mark.parametrize(
    ("degree", "best"), [(2, [0.0]), (3, [-(5**-0.5), 5**-0.5]), (4, [-((3 / 7) ** 0.5), 0.0, (3 / 7) ** 0.5])]
)
def test_polynomials_have_their_points_at_extremes_of_legendre_polynomials(degree, best):
    """P. G. Guest, Ann. Math. Statist. 29 (1958) 294; here over 0 to 300 kPa, without any coding."""
    found = optimal([Factor.within(0, 300)], lambda p: p ** np.arange(degree + 1), degree + 1)
    assert found.points[:, 0] == pytest.approx(150 * (1 + np.array([-1.0, *best, 1.0])), abs=0.03)


@pytest.mark.parametrize("n", sorted(LARGEST_DETERMINANTS))
def test_saturated_first_order_designs_have_the_largest_determinants(n):
    found = optimal([[-1, 1]] * (n - 1), linear, n, starts=40).evaluation
    assert np.exp(found.log_determinant / 2) == pytest.approx(LARGEST_DETERMINANTS[n], rel=1e-9)


def counted(plots, size, eta, model, target):
    """Best criteria of all split-plot designs with one hard and one easy factor at three levels."""
    kinds = [(h, e) for h in LEVELS for e in combinations_with_replacement(LEVELS, size)]
    each = [dense_information(model(np.array([(h, x) for x in e])), [0] * size, eta) for h, e in kinds]
    all_of_them = np.array(list(combinations_with_replacement(range(len(kinds)), plots)))
    m = np.stack(each)[all_of_them].sum(axis=1)
    sign, value = np.linalg.slogdet(m)
    good = (sign > 0) & (value > -15)
    return value[good].max(), np.sum(np.linalg.inv(m[good]) * target, axis=(1, 2)).min()


@pytest.mark.parametrize("eta", [0.3, 4.0])
@pytest.mark.parametrize(("plots", "size", "squares"), [(3, 2, False), (3, 3, True), (4, 2, True)])
def test_no_design_of_all_is_better(plots, size, squares, eta):
    model = quadratic if squares else lambda p: quadratic(p)[:, :4]
    x, w = np.polynomial.legendre.leggauss(5)
    nodes = np.array([(a, b) for a in x for b in x])
    rows = model(nodes)
    target = rows.T @ (rows * np.outer(w, w).reshape(-1, 1) / 4)
    best_d, best_i = counted(plots, size, eta, model, target)
    options = {"hard": (0,), "whole_plots": plots, "eta": eta, "starts": 40}
    d = optimal(SQUARE, model, plots * size, **options).evaluation
    i = optimal(SQUARE, model, plots * size, criterion="I", **options).evaluation
    assert d.log_determinant == pytest.approx(best_d, abs=1e-8)
    assert i.mean_variance == pytest.approx(best_i, rel=1e-8)


def test_two_levels_split_evenly_are_orthogonal_in_every_whole_plot():
    """P. Goos, The Optimal Design of Blocked and Split-plot Experiments (2002): the bound of first-order designs."""
    eta, found = 2.0, optimal([[-1, 1]] * 3, linear, 16, hard=(0,), whole_plots=4, eta=2.0)
    bound = 2 * np.log(16 / (1 + 4 * eta)) + 2 * np.log(16)
    assert found.evaluation.log_determinant == pytest.approx(bound, abs=1e-9)


def test_optimal_measure_of_the_square():
    """R. H. Farrell, J. Kiefer and A. Walbran, Proc. 5th Berkeley Symp. 1 (1967) 113: quadratic model in a square."""
    points = np.array([(a, b) for a in np.linspace(-1, 1, 21) for b in np.linspace(-1, 1, 21)])
    measure = optimal_measure(quadratic(points))
    at = {tuple(np.abs(points[s])): w for s, w in zip(measure.support, measure.weights, strict=True) if w > 1e-3}
    assert at == pytest.approx({(1, 1): 0.1458, (1, 0): 0.0802, (0, 1): 0.0802, (0, 0): 0.0962}, abs=1e-3)
    assert measure.efficiency > 0.9999
    line = optimal_measure(quadratic(np.linspace(-1, 1, 101)[:, None]))
    assert np.linalg.det(line.information) == pytest.approx(4 / 27, rel=3e-4)


@pytest.mark.parametrize("n", [6, 9, 13])
def test_no_exact_design_beats_the_measure(n):
    assert optimal(SQUARE, quadratic, n, starts=30).evaluation.efficiency.d <= 1.0


def test_same_seed_same_design():
    first, second = (optimal(CUBE, quadratic, 24, hard=(0,), whole_plots=6, starts=50, seed=7) for _ in range(2))
    assert np.array_equal(first.points, second.points)
    assert np.array_equal(first.whole_plot, second.whole_plot)


def test_hard_factors_are_constant_within_whole_plots():
    made = optimal(CUBE, quadratic, 17, hard=(0, 2), whole_plots=[5, 3, 3, 2, 2, 1, 1], starts=30)
    for plot in range(7):
        assert len(np.unique(made.points[made.whole_plot == plot][:, [0, 2]], axis=0)) == 1
    assert np.bincount(made.whole_plot).tolist() == [5, 3, 3, 2, 2, 1, 1]


def test_existing_points_count():
    corners = FOURTEEN[:8]
    made = optimal(CUBE, quadratic, 6, existing=corners, starts=50)
    assert made.existing == 8
    assert np.array_equal(made.points[:8], corners)
    assert made.evaluation.log_determinant == pytest.approx(log_det(FOURTEEN), abs=1e-9), "the rest of the printed one"


def test_existing_whole_plots_stay_as_they_are():
    made = optimal(
        SQUARE, quadratic, 10, hard=(0,), whole_plots=2, existing=SPLIT_D[:10], existing_plot=["a"] * 5 + ["b"] * 5
    )
    assert made.whole_plot.tolist() == FIVES.tolist()
    assert made.evaluation.log_determinant == pytest.approx(log_det(SPLIT_D, FIVES), abs=1e-9)


@pytest.mark.parametrize("free", [False, True])
def test_forbidden_points_are_not_used(free):
    factors = [Factor.within(-1, 1)] * 2 if free else [np.linspace(-1, 1, 9)] * 2
    made = optimal(factors, quadratic, 9, allowed=lambda p: p.sum(axis=1) <= 1.0 + 1e-12, starts=50)
    assert made.points.sum(axis=1).max() <= 1.0 + 1e-12
    assert made.points.sum(axis=1).max() > 0.99, "the edge is used"


def test_settings_in_other_units_give_an_equally_good_design():
    units = optimal([[10, 25, 40], [0, 500e3, 1000e3]], quadratic, 14, hard=(0,), whole_plots=4, starts=100)
    coded = optimal(SQUARE, quadratic, 14, hard=(0,), whole_plots=4, starts=100)
    back = (units.points - np.array([25, 500e3])) / np.array([15, 500e3])
    assert log_det(back, units.whole_plot) == pytest.approx(coded.evaluation.log_determinant, abs=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n": 5}, "5 points cannot determine 6 terms"),
        ({"n": 0}, "needs a point"),
        ({"hard": (0,)}, "say how many whole plots"),
        ({"hard": (3,), "whole_plots": 3}, "from 0 to 1"),
        ({"hard": (0,), "whole_plots": 2}, "2 whole plots cannot determine the 3 terms of hard-to-change factors"),
        ({"hard": (0,), "whole_plots": 30}, "cannot be divided"),
        ({"hard": (0,), "whole_plots": [4, 4]}, "do not make 20 points"),
        ({"factors": [[0, 1], LEVELS]}, "no design over these levels determines 1, a^2|determines .*a"),
        ({"criterion": "X"}, "D or I"),
        ({"eta": -1.0, "whole_plots": 4}, "eta is"),
        ({"starts": 0}, "needs a start"),
        ({"allowed": lambda p: p[:, 0] > 5}, "no combination"),
        ({"existing": SPLIT_D, "whole_plots": 4}, "which whole plot each existing point"),
        ({"factors": [np.arange(2000)] * 2}, "too many to search"),
        ({"names": ["one"]}, "6 columns were given for 1 names"),
    ],
)
def test_what_cannot_be(arguments, message):
    given = {
        "factors": SQUARE,
        "columns": quadratic,
        "n": 20,
        "names": ["1", "a", "b", "ab", "a^2", "b^2"],
        **arguments,
    }
    with pytest.raises(FitError, match=message):
        optimal(given.pop("factors"), given.pop("columns"), given.pop("n"), **given)


def test_the_example_of_the_document(capsys):
    examples = re.findall(r"```python\n(.*?)```\n\nprints\n\n```\n(.*?)```", DOCUMENT.read_text(), re.S)
    code, printed = examples[1]
    exec(compile(code, "designs.md", "exec"), {})
    assert capsys.readouterr().out == printed
