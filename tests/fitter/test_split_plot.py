"""Split plots against closed forms, dense matrices and brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from split_plot_cases import NAMES, broken, chamber, dense_log_likelihood, dense_score, design

from rig.fitter import RankError, least_squares
from rig.fitter.split_plot import SplitPlotDesign, fit_split_plot, plan_precision
from rig.fitter.split_plot.kenward_roger import selection
from rig.fitter.split_plot.profile import Profile

SEEDS = st.integers(0, 2**32 - 1)


def mean_square(columns, y, df):
    """Residual mean square, by an orthogonal basis of what the columns span."""
    left, singular, _ = np.linalg.svd(columns, full_matrices=False)
    basis = left[:, singular > 1e-10 * singular[0]]
    return np.sum((y - basis @ (basis.T @ y)) ** 2) / df


def balanced(rng, whole_plots, size, wholeplot_sd, subplot_sd=1.0):
    """A hard factor with its square, an easy one, their product; the same easy settings in every whole plot."""
    hard = np.repeat(rng.uniform(-2, 3, whole_plots), size)
    easy = np.tile(rng.uniform(-2, 3, size), whole_plots)
    columns = np.column_stack([np.ones_like(hard), hard, hard**2, easy, hard * easy])
    whole_plot = np.repeat(np.arange(whole_plots), size)
    y = 100.0 + 3.0 * easy + subplot_sd * rng.normal(size=len(hard))
    return columns, y + wholeplot_sd * rng.normal(size=whole_plots)[whole_plot], whole_plot


@settings(max_examples=40, deadline=None)
@given(
    seed=SEEDS,
    whole_plots=st.integers(5, 25),
    size=st.integers(3, 12),
    wholeplot_sd=st.sampled_from([0.0, 0.3, 3.0, 1e3, 1e6]),
)
def test_balanced_is_analysis_of_variance(seed, whole_plots, size, wholeplot_sd):
    columns, y, whole_plot = balanced(np.random.default_rng(seed), whole_plots, size, wholeplot_sd)
    fit = fit_split_plot(columns, y, whole_plot, ["1", "h", "hh", "e", "he"])
    means = y.reshape(whole_plots, size).mean(axis=1)
    df_wholeplot, df_subplot = whole_plots - 3, whole_plots * (size - 1) - 2
    ms_wholeplot = size * mean_square(columns[::size, :3], means, df_wholeplot)
    within = columns - columns.reshape(whole_plots, size, 5).mean(axis=1)[whole_plot]
    ms_subplot = mean_square(within, y - means[whole_plot], df_subplot)
    if ms_wholeplot <= ms_subplot:
        pooled = (df_wholeplot * ms_wholeplot + df_subplot * ms_subplot) / (df_wholeplot + df_subplot)
        assert fit.boundary
        assert fit.sigma_wholeplot == 0.0
        assert fit.sigma_subplot**2 == pytest.approx(pooled, rel=1e-8)
        return
    rounding = 1e-15 * (wholeplot_sd + 100.0)
    assert fit.sigma_subplot**2 == pytest.approx(ms_subplot, rel=1e-8, abs=rounding)
    assert fit.sigma_wholeplot**2 == pytest.approx((ms_wholeplot - ms_subplot) / size, rel=1e-8)
    hard, easy = columns[::size, :3], columns[:size, 3]
    spread_h, spread_hh = np.diag(np.linalg.inv(hard.T @ hard))[1:]
    spread_he = np.linalg.inv(hard[:, :2].T @ hard[:, :2])[1, 1] / np.sum((easy - easy.mean()) ** 2)
    assert fit.stderr[2] ** 2 == pytest.approx(ms_wholeplot / size * spread_hh, rel=1e-7)
    assert fit.stderr[4] ** 2 == pytest.approx(ms_subplot * spread_he, rel=1e-7)
    mixed = ms_wholeplot / size * spread_h + ms_subplot * spread_he * easy.mean() ** 2
    assert fit.stderr[1] ** 2 == pytest.approx(mixed, rel=1e-7)
    np.testing.assert_allclose(fit.df[[2, 4]], [df_wholeplot, df_subplot], rtol=1e-7)
    np.testing.assert_allclose(fit.satterthwaite(np.eye(5)[[2, 4]]), [df_wholeplot, df_subplot], rtol=1e-6)


def unbalanced(rng, whole_plots, columns):
    """Whole plots of 1 to 7 readings, in any order, with any identities."""
    identity = rng.choice(10_000, whole_plots, replace=False) - 5_000
    whole_plot = rng.permutation(np.repeat(identity, rng.integers(1, 8, whole_plots)))
    n = len(whole_plot)
    hard = dict(zip(identity.tolist(), rng.normal(size=whole_plots), strict=True))
    matrix = np.column_stack([np.ones(n), [hard[w] for w in whole_plot.tolist()], rng.normal(size=(n, columns))])
    own = dict(zip(identity.tolist(), rng.normal(size=whole_plots), strict=True))
    return matrix, whole_plot, np.array([own[w] for w in whole_plot.tolist()]), rng.normal(size=n)


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, whole_plots=st.integers(6, 20), sd=st.sampled_from([0.0, 0.2, 1.0, 10.0]))
def test_no_other_variances_are_likelier(seed, whole_plots, sd):
    rng = np.random.default_rng(seed)
    columns, whole_plot, own, error = unbalanced(rng, whole_plots, 2)
    y = 5.0 + sd * own + error
    try:
        fit = fit_split_plot(columns, y, whole_plot, "abcd")
    except (ValueError, RankError):
        assert len(y) <= whole_plots + 4
        return
    variances = np.array([fit.variances.subplot, fit.variances.wholeplot])
    assert fit.reml_loglik == pytest.approx(dense_log_likelihood(columns, y, [whole_plot], variances), abs=1e-9)
    score = dense_score(columns, y, [whole_plot], variances)
    if fit.boundary:
        assert score[1] <= 1e-8
    else:
        np.testing.assert_allclose(score * variances, 0.0, atol=1e-8)
    assert abs(score[0] * variances[0]) < 1e-8
    for ratio in [0.0, *np.geomspace(1e-4, 1e6, 60)]:
        shares = np.array([1.0, ratio])
        v = np.eye(len(y)) + ratio * np.equal.outer(whole_plot, whole_plot)
        left = np.linalg.solve(v, columns)
        residual = y - columns @ np.linalg.solve(columns.T @ left, left.T @ y)
        subplot = residual @ np.linalg.solve(v, residual) / (len(y) - 4)
        assert dense_log_likelihood(columns, y, [whole_plot], subplot * shares) <= fit.reml_loglik + 1e-8


def test_coefficients_covariance_and_predictions_by_dense_matrices():
    columns, y, whole_plot, _ = broken(chamber(1, 0.32, 0.0, 12))
    fit = fit_split_plot(columns, y, whole_plot, NAMES)
    z = np.equal.outer(whole_plot, fit.whole_plots).astype(float)
    v = fit.variances.subplot * np.eye(len(y)) + fit.variances.wholeplot * z @ z.T
    covariance = np.linalg.inv(columns.T @ np.linalg.solve(v, columns))
    coefficients = covariance @ columns.T @ np.linalg.solve(v, y)
    np.testing.assert_allclose(fit.coefficients, coefficients, rtol=1e-9)
    np.testing.assert_allclose(fit.covariance, covariance, rtol=1e-8, atol=1e-14)
    residual = y - columns @ coefficients
    blup = fit.variances.wholeplot * z.T @ np.linalg.solve(v, residual)
    np.testing.assert_allclose(fit.blup, blup, atol=1e-11)
    np.testing.assert_allclose(fit.marginal_residuals, residual, atol=1e-11)
    np.testing.assert_allclose(fit.conditional_residuals, residual - z @ blup, atol=1e-11)
    np.testing.assert_allclose(fit.predict(columns), y - residual, atol=1e-11)


def test_order_names_and_units_do_not_matter():
    columns, y, whole_plot, _ = broken(chamber(1, 0.32, 0.0, 12))
    fit = fit_split_plot(columns, y, whole_plot, NAMES)
    rng = np.random.default_rng(5)
    rows, scale = rng.permutation(len(y)), 10.0 ** rng.integers(-6, 7, len(NAMES))
    other = fit_split_plot(columns[rows] * scale, 1e-3 * y[rows], 7 - 3 * whole_plot[rows], NAMES)
    np.testing.assert_allclose(other.coefficients * scale, 1e-3 * fit.coefficients, rtol=1e-9)
    np.testing.assert_allclose(other.kenward_roger().stderr * scale, 1e-3 * fit.kenward_roger().stderr, rtol=1e-9)
    np.testing.assert_allclose(other.df, fit.df, rtol=1e-9)
    np.testing.assert_allclose(other.blup[::-1], 1e-3 * fit.blup, rtol=1e-9)
    assert other.sigma_wholeplot == pytest.approx(1e-3 * fit.sigma_wholeplot, rel=1e-10)


def test_zero_variance_is_least_squares_and_said():
    rng = np.random.default_rng(1)
    columns, whole_plot, _ = design()
    y = columns @ rng.normal(size=10) + rng.normal(size=220)
    y -= 0.9 * (np.bincount(whole_plot, y)[whole_plot] / 11 - columns @ np.linalg.lstsq(columns, y)[0])
    fit, plain = fit_split_plot(columns, y, whole_plot, NAMES), least_squares(columns, y, NAMES)
    assert fit.boundary
    assert fit.sigma_wholeplot == 0.0
    assert fit.notes == ("the whole-plot variance is estimated at zero; the fit is without it",)
    np.testing.assert_allclose(fit.coefficients, plain.coefficients, rtol=1e-10)
    np.testing.assert_allclose(fit.stderr, plain.stderr, rtol=1e-10)
    np.testing.assert_allclose(fit.kenward_roger().stderr, plain.stderr, rtol=1e-10)
    np.testing.assert_allclose(fit.df, 210.0)
    np.testing.assert_allclose(fit.satterthwaite(np.eye(10)), 210.0)
    assert fit.df_method == "residual"
    assert fit.f_test(["t1", "t2"]).ddf == pytest.approx(210.0)
    assert not fit.blup.any()
    np.testing.assert_allclose(fit.interval(columns, new_readings=1), plain.prediction(columns), rtol=1e-10)


def test_several_maxima():
    """Two groups of eigenvalues whose readings want different ratios: the higher of two maxima is taken."""
    xi = np.array([100.0] * 8 + [0.01] * 4)
    profile = Profile(xi, 40)
    low, high = np.repeat([2.5, 4000.0], [8, 4]), np.repeat([1.2, 9000.0], [8, 4])
    ratios = np.geomspace(1e-6, 1e9, 200_001)
    for squares in (low, high):
        u2 = np.repeat(squares[:, None], len(ratios), axis=1)
        deviance = profile.deviance(ratios, u2, np.full(len(ratios), 28.0))
        inner = deviance[1:-1]
        minima = ratios[1:-1][(inner < deviance[:-2]) & (inner < deviance[2:])]
        found = profile.maximise(squares, 28.0)
        assert found == pytest.approx(ratios[np.argmin(deviance)], rel=1e-4)
        assert len(minima) + (deviance[0] < deviance[1]) == 2
    both = profile.maximise_many(np.column_stack([low, high]), np.full(2, 28.0))
    np.testing.assert_allclose(both, [profile.maximise(low, 28.0), profile.maximise(high, 28.0)], rtol=1e-12)


@pytest.mark.parametrize("ratio", [1e-7, 1e-3, 1.0, 1e4, 1e11, 1e15])
def test_ratios_of_any_size(ratio):
    """With equal eigenvalues the ratio is a ratio of mean squares; also far beyond the grid of starting points."""
    squares, xi = np.array([0.5, 1.0, 0.1, 3.0, 0.4]) * (1.0 + 7.0 * ratio), np.full(5, 7.0)
    found = Profile(xi, 105).maximise(squares, 100.0)
    assert found == pytest.approx((squares.mean() - 1.0) / 7.0, rel=1e-8)
    assert Profile(xi, 105).maximise_many(squares[:, None], np.array([100.0]))[0] == pytest.approx(found, rel=1e-12)


@pytest.mark.parametrize("sd", [0.0, 0.03, 0.3, 30.0])
def test_many_at_once_are_the_same_one_by_one(sd):
    rng = np.random.default_rng(2)
    columns, whole_plot, _ = design()
    keep = ~np.isin(np.arange(220), [38, 39, 40, 41, 42, *range(89, 99), 150])
    columns, whole_plot = columns[keep], whole_plot[keep]
    ys = rng.normal(size=(len(columns), 60)) + sd / 0.1 * rng.normal(size=(21, 60))[whole_plot]
    batch = SplitPlotDesign(columns, whole_plot, NAMES).fit_many(ys)
    plain = SplitPlotDesign(columns, whole_plot, NAMES)
    at = columns[::20]
    for i, y in enumerate(ys.T):
        fit = plain.fit(y)
        np.testing.assert_allclose(batch.coefficients[i], fit.coefficients, rtol=1e-9, atol=1e-12)
        assert batch.sigma_subplot[i] == pytest.approx(fit.sigma_subplot, rel=1e-10)
        assert batch.sigma_wholeplot[i] == pytest.approx(fit.sigma_wholeplot, rel=1e-9)
        assert batch.boundary[i] == fit.boundary
        assert batch.reml_loglik[i] == pytest.approx(fit.reml_loglik, abs=1e-9)
        np.testing.assert_allclose(batch.stderr[i], fit.stderr, rtol=1e-9)
        np.testing.assert_allclose(batch.df(np.eye(10))[i], fit.df, rtol=1e-8)
        np.testing.assert_allclose(batch.variance(np.eye(10))[i], fit.kenward_roger().stderr ** 2, rtol=1e-9)
        for new in ({}, {"new_whole_plot": True}, {"new_whole_plot": True, "new_readings": 1}):
            np.testing.assert_allclose(batch.interval(at, **new)[i], fit.interval(at, **new), rtol=1e-8)


def test_intervals_hold_what_they_promise():
    """Of the mean, a new whole plot, a new reading in it, and its difference from four others there."""
    rng = np.random.default_rng(4)
    columns, whole_plot, _ = design()
    m, at = 20_000, columns[[2, 80]]
    for sd in (3.0, 0.7):
        ys = rng.normal(size=(220, m)) + sd * rng.normal(size=(21, m))[whole_plot]
        batch = SplitPlotDesign(columns, whole_plot, NAMES).fit_many(ys)
        off = batch.coefficients @ at.T
        plots, readings = sd * rng.normal(size=(m, 1)), rng.normal(size=(m, 1))
        zeroed = rng.normal(size=m) - rng.normal(size=(m, 4)).mean(axis=1)
        inside = [
            np.abs(off) < batch.interval(at),
            np.abs(off - plots) < batch.interval(at, new_whole_plot=True),
            np.abs(off - plots - readings) < batch.interval(at, new_whole_plot=True, new_readings=1),
            np.abs(off @ [-1, 1] - zeroed) < batch.interval(at[1] - at[0], new_readings=1.25)[:, 0],
        ]
        for each in inside:
            np.testing.assert_allclose(np.mean(each, axis=0), 0.95, atol=0.01)


def test_precision_before_the_data_is_that_of_the_fit():
    columns, y, whole_plot, _ = broken(chamber(1, 0.32, 0.0, 12))
    fit = fit_split_plot(columns, y, whole_plot, NAMES)
    plan = plan_precision(columns, whole_plot, fit.sigma_wholeplot, fit.sigma_subplot, NAMES)
    np.testing.assert_allclose(plan.stderr, fit.stderr, rtol=1e-12)
    np.testing.assert_allclose(plan.df, fit.df, rtol=1e-12)
    v = 0.1**2 * np.eye(len(y)) + 0.3**2 * np.equal.outer(whole_plot, whole_plot)
    plan = plan_precision(columns, whole_plot, 0.3, 0.1, NAMES)
    np.testing.assert_allclose(plan.covariance, np.linalg.inv(columns.T @ np.linalg.solve(v, columns)), atol=1e-14)


def test_the_paper_design_leaves_14_degrees_of_freedom_between_whole_plots():
    columns, whole_plot, _ = design()
    plan = plan_precision(columns, whole_plot, 0.3, 0.1, NAMES)
    np.testing.assert_allclose(plan.df[[5, 6, 9]], 14.0)  # t11, t22, t12
    np.testing.assert_allclose(plan.df[[1, 4, 7, 8]], 196.0)  # p, pp, pt1, pt2


def test_precision_of_a_design_that_cannot_estimate_its_errors():
    columns, whole_plot, _ = design()
    plan = plan_precision(columns[:, [0, 1, 4]][:11], whole_plot[:11], 0.3, 0.1, ["1", "p", "pp"])
    assert plan.stderr[0] > 0.3
    assert np.isnan(plan.df).all()


COLUMNS, Y, WHOLE_PLOT, REPLICATE = chamber(2, 0.3, 0.3, 1)
ONE = slice(0, 220)
PAIR = [0, 1, *range(12, 132, 12)]
"""Two readings of whole plot 1 and one each of the others."""
INDICATORS = np.eye(21)[WHOLE_PLOT[ONE]][:, 1:]
MEASURED = np.column_stack([np.ones(20), np.repeat([20.0, 50.0], 10) + 0.03 * np.sin(np.arange(20.0))])
"""A straight line over a setting of two whole plots that was measured: it scatters a little within them."""


@pytest.mark.parametrize(
    ("message", "arguments", "replicate"),
    [
        ("y: a value is not finite .row 3", (COLUMNS, np.where(np.arange(440) == 3, np.nan, Y), WHOLE_PLOT), None),
        ("columns: a value is not finite", (np.where(COLUMNS == 4.0, np.inf, COLUMNS), Y, WHOLE_PLOT), None),
        ("y has 220 readings, the design 440", (COLUMNS, Y[ONE], WHOLE_PLOT), None),
        ("whole_plot: 440 identities are needed", (COLUMNS, Y, WHOLE_PLOT[ONE]), None),
        ("whole_plot: identities must be whole numbers", (COLUMNS, Y, WHOLE_PLOT + 0.5), None),
        ("columns: 2 dimensions are needed", (COLUMNS[:, 1], Y, WHOLE_PLOT), None),
        ("3 readings leave nothing", (COLUMNS[[0, 5, 11], :3], Y[:3], [1, 1, 2]), None),
        ("all readings are in one whole plot", (COLUMNS[:, [0, 1]], Y, np.ones(440)), None),
        ("every whole plot has a single reading", (COLUMNS, Y, np.arange(440)), None),
        ("use up all 20 whole plots", (INDICATORS, Y[ONE], WHOLE_PLOT[ONE]), None),
        ("use up nearly all of 2 whole plots", (MEASURED, np.arange(20) % 3, np.arange(20) // 10), None),
        ("no degrees of freedom within", (COLUMNS[PAIR, :2], Y[PAIR], WHOLE_PLOT[PAIR]), None),
        ("show no error beyond rounding", (COLUMNS, COLUMNS @ np.arange(10.0), WHOLE_PLOT), None),
        ("whole plot 2 has readings in more than one", (COLUMNS, Y, WHOLE_PLOT), np.arange(440) // 13),
        ("no degrees of freedom between replications", (COLUMNS, Y, WHOLE_PLOT), np.ones(440)),
        ("leave replications out", (COLUMNS, Y, WHOLE_PLOT), WHOLE_PLOT),
    ],
)
def test_bad_input(message, arguments, replicate):
    columns, y, whole_plot = arguments
    names = NAMES if np.ndim(columns) == 2 and len(columns[0]) == 10 else [f"x{i}" for i in range(columns.shape[-1])]
    with pytest.raises(ValueError, match=message):
        fit_split_plot(columns, y, whole_plot, names, replicate=replicate)


@pytest.mark.parametrize("offset", [100.0, 2026.0])
def test_intervals_do_not_depend_on_where_a_setting_starts(offset):
    """A square of years: the variance of the curve, its degrees of freedom and interval are those from zero."""
    rng, x, plot = np.random.default_rng(5), np.arange(24) / 32.0, np.arange(24) % 6
    y = 2.0 + 3.0 * x + rng.normal(0, 0.01, 24) + rng.normal(0, 0.03, 6)[plot]
    near, far = (
        [powers, fit_split_plot(powers, y, plot, ["1", "x", "x2"])] for powers in (_powers(x), _powers(x + offset))
    )
    for seen in ("variance", "df_of", "interval"):
        wanted, found = (getattr(fit, seen)(powers) for powers, fit in (near, far))
        np.testing.assert_allclose(found, wanted, rtol=1e-3, err_msg=seen)


def _powers(x):
    return np.column_stack([np.ones(len(x)), x, x * x])


def test_columns_that_cannot_be_told_apart_are_named():
    columns = np.column_stack([COLUMNS, COLUMNS[:, 2] + 3.0])
    with pytest.raises(RankError, match=r"cannot tell apart: \(Intercept\), t1, t1 again"):
        fit_split_plot(columns, Y, WHOLE_PLOT, [*NAMES, "t1 again"])


def test_terms_are_called_by_name():
    fit = fit_split_plot(COLUMNS, Y, WHOLE_PLOT, NAMES)
    with pytest.raises(ValueError, match="no such term: t3; there are"):
        fit.f_test(["t1", "t3"])
    t = fit.coefficients[1] / fit.kenward_roger().stderr[1]
    assert fit.f_test(["p"]).value == pytest.approx(t**2, rel=1e-9)
    assert fit.f_test(["p"]).p < 1e-9


def test_a_coefficient_is_tested_against_a_value_that_is_given():
    kenward_roger = fit_split_plot(COLUMNS, Y, WHOLE_PLOT, NAMES).kenward_roger()
    one = np.array([[0.0, 1.0, *[0.0] * (len(NAMES) - 2)]])
    estimate, stderr = float((one @ kenward_roger.coefficients)[0]), kenward_roger.stderr[1]
    assert kenward_roger.f_test(one, estimate).value == pytest.approx(0.0, abs=1e-12)
    assert kenward_roger.f_test(one, estimate - 3.0 * stderr).value == pytest.approx(9.0, rel=1e-9)


def test_terms_that_are_missing_are_listed_with_those_there_are():
    with pytest.raises(ValueError, match=r"^no such term: t3, q; there are a, b$"):
        selection(["a", "b"], ["t3", "q"])
