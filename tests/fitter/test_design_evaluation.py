"""Precision of designs before any measurement; grids and central composite designs."""

import numpy as np
import pytest
from published_designs import FIVES, LEVELS, SPLIT_D, dense_information, linear, quadratic

from rig.fitter.designs import Factor, advice, central_composite, evaluate, grid, optimal, plots_by_setting, to_range
from rig.fitter.errors import FitError
from rig.fitter.split_plot import plan_precision

SEED = 20
WHOLE_PLOTS = "{} left for the error between whole plots: add whole plots"
NAMES = ["1", "a", "b", "a:b", "a^2", "b^2"]


def test_a_grid_is_in_the_order_of_its_levels():
    assert grid([[3, 1], [5, 6, 7]]).tolist() == [[3, 5], [3, 6], [3, 7], [1, 5], [1, 6], [1, 7]]


@pytest.mark.parametrize(
    ("factors", "half", "printed"),
    [(2, False, 1.414), (3, False, 1.682), (4, False, 2.000), (5, False, 2.378), (5, True, 2.000), (6, False, 2.828)],
)
def test_rotatable_alpha(factors, half, printed):
    """NIST/SEMATECH e-Handbook of Statistical Methods, 5.3.3.6.1."""
    assert central_composite(factors, half=half).alpha == pytest.approx(printed, abs=5e-4)


@pytest.mark.parametrize("factors", [2, 3, 4])
def test_rotatable_designs_predict_equally_well_in_all_directions(factors):
    made = central_composite(factors, centre=3)
    e = evaluate(made.points, [Factor.within(-1, 1)] * factors, quadratic)
    ways = np.random.default_rng(SEED).normal(size=(50, factors))
    variance = e.variance(0.8 * ways / np.linalg.norm(ways, axis=1, keepdims=True))
    assert variance == pytest.approx(np.full(50, variance[0]), rel=1e-9)


@pytest.mark.parametrize(
    ("factors", "blocks", "centre", "half", "printed"),
    [
        (2, 2, (3, 3), False, 1.4142),
        (3, 3, (2, 2), False, 1.633),
        (4, 3, (2, 2), False, 2.000),
        (5, 2, (6, 1), True, 2.000),
        (3, 2, (4, 2), False, None),
        (6, 2, (5, 4), True, None),
    ],
)
def test_orthogonal_blocks(factors, blocks, centre, half, printed):
    """Box and Hunter (1957), section 8: block means have no part in linear terms, products or squares."""
    made = central_composite(factors, blocks=blocks, centre=centre, half=half, alpha="orthogonal-blocks")
    block = np.eye(blocks)[made.block]
    rows = quadratic(made.points)
    shares = block.sum(axis=0) / len(block)
    assert (block - shares).T @ rows == pytest.approx(np.zeros((blocks, rows.shape[1])), abs=1e-9)
    if printed is not None:
        assert made.alpha == pytest.approx(printed, abs=5e-4)


def test_kinds_of_central_composite():
    round_, face, inside = (
        central_composite(3, kind=k, centre=2) for k in ("circumscribed", "face-centred", "inscribed")
    )
    assert [len(d.points) for d in (round_, face, inside)] == [16] * 3
    assert np.abs(round_.points).max() == pytest.approx(8**0.25)
    assert np.abs(face.points).max() == face.alpha == 1.0
    assert np.abs(inside.points).max() == pytest.approx(1.0)
    assert inside.points * inside.alpha == pytest.approx(round_.points)
    kpa = to_range(inside.points, [0, 10, -5], [300, 40, 5])
    assert (kpa.min(axis=0).tolist(), kpa.max(axis=0).tolist()) == ([0, 10, -5], [300, 40, 5])
    assert (round_.points == 0).all(axis=1).sum() == 2
    assert central_composite(3, alpha="spherical").alpha == pytest.approx(3**0.5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"factors": 1}, "2 to 10 factors"),
        ({"factors": 4, "half": True}, "half a cube"),
        ({"factors": 2, "blocks": 3}, "divided into two"),
        ({"factors": 3, "centre": -1}, "negative"),
        ({"factors": 3, "alpha": "large"}, "alpha is"),
        ({"factors": 3, "alpha": -2.0}, "alpha is"),
    ],
)
def test_central_composites_that_do_not_exist(arguments, message):
    with pytest.raises(FitError, match=message):
        central_composite(**arguments)


def random_design(seed):
    random = np.random.default_rng(seed)
    plots = int(random.integers(4, 8))
    plot = np.sort(random.permutation(np.concatenate([np.arange(plots), random.integers(0, plots, 14)])))
    points = np.column_stack([random.uniform(10, 40, plots)[plot], random.uniform(0, 1e6, plot.size)])
    return points, plot, float(random.uniform(0, 5))


@pytest.mark.parametrize("seed", range(5))
def test_precision_is_that_of_generalised_least_squares(seed):
    points, plot, eta = random_design(seed)
    e = evaluate(points, [Factor.within(10, 40), Factor.within(0, 1e6)], quadratic, NAMES, whole_plot=plot, eta=eta)
    unit = np.array([1, 40, 1e6, 4e7, 1600, 1e12])
    rows = quadratic(points) / unit
    m = dense_information(rows, plot, eta)
    covariance = np.linalg.inv(m) / np.outer(unit, unit)
    assert e.covariance / covariance == pytest.approx(np.ones((6, 6)), rel=1e-6)
    assert e.log_determinant == pytest.approx(np.linalg.slogdet(m)[1] + 2 * np.log(unit).sum(), abs=1e-8)
    forecast = plan_precision(quadratic(points), plot, np.sqrt(eta), 1.0, NAMES)
    assert e.stderr == pytest.approx(forecast.stderr, rel=1e-8)
    at = np.array([[12.0, 3e5], [40.0, 1e6]])
    there = quadratic(at) / unit
    assert e.variance(at) == pytest.approx(np.sum((there @ np.linalg.inv(m)) * there, axis=1), rel=1e-8)
    assert e.shares[0] <= e.mean_variance <= e.largest_variance


def test_full_factorial_of_a_line():
    """Points -1, 0, 1 for a parabola: weights of the D-optimal measure, G-efficiency 1 (Kiefer and Wolfowitz)."""
    e = evaluate([[-1], [0], [1]], [[-1, 0, 1]], quadratic)
    assert (e.efficiency.d, e.efficiency.g) == pytest.approx((1.0, 1.0), abs=1e-4)
    assert e.mean_variance == pytest.approx(0.8, abs=1e-12), "integral of 1 - 3/2 (x^2 - x^4) by hand"
    four = evaluate([[-1], [0], [0], [1]], [[-1, 0, 1]], quadratic)
    assert four.efficiency.i == pytest.approx(1.0, abs=1e-4), "I-optimal weights 1/4, 1/2, 1/4"
    x, variance = e.profile(0, 5)
    assert variance == pytest.approx(1 - 1.5 * (x**2 - x**4))


def test_terms_that_are_not_determined_and_points_that_would():
    corners = grid([[-1, 1], [-1, 1]])
    e = evaluate(np.vstack([corners, corners]), [LEVELS] * 2, quadratic, NAMES)
    assert e.undetermined == ("1", "a^2", "b^2")
    assert len(e.would) == 2
    assert np.isnan(e.stderr).tolist() == [True, False, False, False, True, True]
    assert e.stderr[1:4] == pytest.approx(np.full(3, 8**-0.5))
    assert e.efficiency.d == 0.0
    assert np.isinf(e.variance([[0, 0]])).all()
    cured = evaluate(np.vstack([corners, e.would]), [LEVELS] * 2, quadratic, NAMES)
    assert cured.undetermined == ()
    assert np.isfinite(cured.stderr).all()


def test_levels_that_cannot_determine_a_term_ask_for_further_levels():
    e = evaluate(grid([[0, 100], [10, 20, 30]]), [[0, 100], [10, 20, 30]], quadratic, NAMES)
    assert e.undetermined == ("a", "a^2")
    assert e.would.shape == (1, 2)
    assert 0 < e.would[0, 0] < 100


def test_a_model_that_no_design_determines_is_refused():
    with pytest.raises(FitError, match="no design over these levels determines a, twice a"):
        evaluate([[0.0], [1.0], [2.0]], [[0, 1, 2]], lambda p: np.column_stack([p, 2 * p]), ["a", "twice a"])


def test_nearly_confounded_terms_are_named():
    x = np.linspace(290, 300, 12)[:, None]
    e = evaluate(x, [Factor.within(290, 300)], lambda p: np.column_stack([np.ones(len(p)), p, p**2]), ["1", "T", "T^2"])
    assert {pair[:2] for pair in e.correlated(0.9)} == {("1", "T"), ("1", "T^2"), ("T", "T^2")}
    assert all(abs(pair[2]) > 0.999 for pair in e.correlated(0.9))


def test_degrees_of_freedom_of_independent_points():
    e = evaluate(np.vstack([grid([LEVELS, LEVELS]), [[0, 0]] * 4]), [LEVELS] * 2, quadratic)
    f = e.freedom
    assert (f.residual, f.pure_error, f.lack_of_fit, f.whole_plots) == (7, 4, 3, None)
    assert f.residual == f.pure_error + f.lack_of_fit


def test_degrees_of_freedom_of_whole_plots():
    """4 whole plots, 3 of the hard terms; the third and fourth are the same five points."""
    f = evaluate(SPLIT_D, [LEVELS] * 2, quadratic, whole_plot=FIVES).freedom
    assert (f.residual, f.whole_plots) == (13, 1)
    assert (f.pure_error, f.whole_plot_pure_error, f.lack_of_fit) == (10, 1, 3)


def test_one_whole_plot_for_each_hard_term_leaves_none_for_the_error_between_them():
    points = SPLIT_D[:15]
    assert evaluate(points, [LEVELS] * 2, quadratic, whole_plot=FIVES[:15]).freedom.whole_plots == 0


def test_categories_lie_at_their_levels():
    e = evaluate(grid([[1, 2, 6], LEVELS]), [Factor.categories([1, 2, 6]), LEVELS], _with_category)
    assert set(e.region.settings[:, 0]) == {1, 2, 6}
    assert e.undetermined == ()


def _with_category(points):
    at = points[:, :1] == np.array([[1, 2, 6]])
    assert at.any(axis=1).all(), "nothing lies between categories"
    return np.column_stack([at, points[:, 1]]).astype(float)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: evaluate(np.empty((0, 2)), [LEVELS] * 2, linear), "no points"),
        (lambda: evaluate([[0.0]], [LEVELS] * 2, linear), "2 columns"),
        (lambda: evaluate([[0, 0], [1, 1], [0, 1]], [LEVELS] * 2, linear, whole_plot=[1, 2]), "3 whole plots"),
        (lambda: evaluate([[0.0], [1.0]], [[0, 1]], np.log), "not finite at the point"),
        (lambda: evaluate([[0.0]], [], linear), "needs a factor"),
        (lambda: Factor.within(5, 5), "from a low to a high"),
        (lambda: Factor.at([]), "finite levels"),
        (lambda: Factor.at([1, np.nan]), "finite levels"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_bad_arguments(call, message):
    with pytest.raises(FitError, match=message):
        call()


@pytest.mark.parametrize("seed", range(4))
def test_degrees_of_freedom_are_ranks(seed):
    random = np.random.default_rng(seed)
    points = random.integers(-1, 2, (30, 2)).astype(float)
    plot = random.integers(0, 7, 30)
    rows, z = quadratic(points), np.eye(7)[plot]
    distinct = np.eye(9)[(3 * points[:, 0] + points[:, 1]).astype(int) + 4]
    rank = np.linalg.matrix_rank
    f = evaluate(points, [LEVELS] * 2, quadratic, whole_plot=plot).freedom
    both, saturated = rank(np.hstack([rows, z])), rank(np.hstack([distinct, z]))
    assert (f.residual, f.whole_plots) == (30 - both, both - rank(rows))
    assert (f.pure_error, f.whole_plot_pure_error) == (30 - saturated, saturated - rank(distinct))
    assert f.lack_of_fit == rank(distinct) - rank(rows)


def test_a_large_grid_is_evaluated_in_little_memory():
    points = grid([np.linspace(-1, 1, 20)] * 3)
    e = evaluate(points, [Factor.within(-1, 1)] * 3, quadratic, whole_plot=plots_by_setting(points, [0]))
    assert (e.freedom.whole_plots, e.freedom.pure_error, e.freedom.lack_of_fit) == (17, 0, 7990)


@pytest.mark.parametrize(
    ("points", "plot", "sentences"),
    [
        (
            grid([[-1, 1], [-1, 0, 1]]),
            None,
            [
                "the design does not determine 1, a^2; with one more point it would: T_degC = 0, F_kN = -1",
                "one degree of freedom is left for the error of a point: add points",
                "no point is repeated, so that lack of fit cannot be tested against pure error",
            ],
        ),
        (SPLIT_D, FIVES, [WHOLE_PLOTS.format("one degree of freedom is")]),
        (
            SPLIT_D[:15],
            FIVES[:15],
            [WHOLE_PLOTS.format("no degrees of freedom are")],
        ),
        (np.vstack([grid([LEVELS, LEVELS])] * 2), None, []),
    ],
)
def test_advice(points, plot, sentences):
    e = evaluate(points, [LEVELS] * 2, quadratic, NAMES, whole_plot=plot)
    assert list(advice(e, ["T_degC", "F_kN"])) == sentences


def test_advice_on_a_short_search():
    made = optimal([LEVELS] * 3, quadratic, 24, hard=(0,), whole_plots=6, starts=10)
    assert made.reached <= 3
    assert any("10 random starts" in sentence for sentence in advice(made, ["a", "b", "c"]))


def test_all_factors_hard():
    made = optimal([LEVELS] * 2, quadratic, 18, hard=(0, 1), whole_plots=9, starts=50)
    e = made.evaluation
    assert np.unique(made.points, axis=0).tolist() == grid([LEVELS, LEVELS]).tolist(), "3^2, D-optimal for nine"
    assert (e.freedom.whole_plots, e.freedom.pure_error) == (3, 9)
