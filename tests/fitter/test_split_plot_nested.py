"""Whole plots nested in replications: two variance ratios, either of which may be zero."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from split_plot_cases import NAMES, chamber, dense_log_likelihood, dense_score, design

from rig.fitter.split_plot import SplitPlotDesign, fit_split_plot, plan_precision

SEEDS = st.integers(0, 2**32 - 1)
POOLINGS = (
    ([[0], [1], [2]], [0, 1, 2]),
    ([[0, 1], [2]], [0, 0, 1]),
    ([[0], [1, 2]], [0, 1, 1]),
    ([[0, 1, 2]], [0, 0, 0]),
)
"""Mean squares of replications, whole plots, subplots: which are pooled where a variance is zero."""


def balanced(rng, replications, whole_plots, size, replicate_sd, wholeplot_sd):
    easy = np.tile(np.linspace(-1, 2, size), replications * whole_plots)
    hard = np.tile(np.repeat(rng.normal(size=whole_plots), size), replications)
    whole_plot = np.repeat(np.arange(replications * whole_plots), size)
    replicate = whole_plot // whole_plots
    y = 10.0 + easy + rng.normal(size=len(easy))
    y += wholeplot_sd * rng.normal(size=whole_plot[-1] + 1)[whole_plot]
    y += replicate_sd * rng.normal(size=replications)[replicate]
    return np.column_stack([np.ones_like(easy), hard, easy]), y, whole_plot, replicate


@settings(max_examples=30, deadline=None)
@given(
    seed=SEEDS,
    replications=st.integers(2, 5),
    whole_plots=st.integers(3, 8),
    size=st.integers(2, 6),
    sds=st.tuples(st.sampled_from([0.0, 1.0, 30.0]), st.sampled_from([0.0, 1.0, 1e3])),
)
@example(780549414, 3, 5, 5, (1.0, 1e3))  # a climb that ends on flat ground short of the edge
@example(857172224, 3, 5, 2, (30.0, 1e3))
def test_balanced_is_analysis_of_variance(seed, replications, whole_plots, size, sds):
    columns, y, whole_plot, replicate = balanced(np.random.default_rng(seed), replications, whole_plots, size, *sds)
    fit = fit_split_plot(columns, y, whole_plot, ["1", "h", "e"], replicate=replicate)
    of_plots = y.reshape(replications, whole_plots, size).mean(axis=2)
    of_replicates = of_plots.mean(axis=1)
    hard = columns[: whole_plots * size : size, 1] - columns[: whole_plots * size : size, 1].mean()
    easy = columns[:size, 2] - columns[:size, 2].mean()
    ss_replicate = whole_plots * size * np.sum((of_replicates - y.mean()) ** 2)
    inner = of_plots - of_replicates[:, None]
    slope = np.sum(inner @ hard) / (replications * np.sum(hard**2))
    ss_wholeplot = size * np.sum((inner - slope * hard) ** 2)
    within = y.reshape(-1, size) - of_plots.reshape(-1, 1)
    ss_subplot = np.sum((within - np.mean(within @ easy) / np.sum(easy**2) * easy) ** 2)
    df = np.array([replications - 1, replications * (whole_plots - 1) - 1, replications * whole_plots * (size - 1) - 1])
    ss = np.array([ss_replicate, ss_wholeplot, ss_subplot])
    sizes = [whole_plots * size, size]
    poolings = [np.array([ss[group].sum() / df[group].sum() for group in each])[np.array(at)] for each, at in POOLINGS]
    in_order = [ms for ms in poolings if np.all(np.diff(ms) <= 0.0)]
    ms = min(in_order, key=lambda each: np.sum(df * np.log(each) + ss / each))
    assert fit.variances.subplot == pytest.approx(ms[2], rel=1e-8)
    assert fit.variances.wholeplot == pytest.approx((ms[1] - ms[2]) / sizes[1], rel=1e-7, abs=1e-12)
    assert fit.variances.replicate == pytest.approx((ms[0] - ms[1]) / sizes[0], rel=1e-7, abs=1e-9)
    assert fit.boundary == (ms[0] == ms[1] or ms[1] == ms[2]) == bool(fit.notes)
    if not fit.boundary:
        np.testing.assert_allclose(fit.df[1:], df[1:], rtol=1e-6)
        np.testing.assert_allclose(fit.satterthwaite(np.eye(3)[1:]), df[1:], rtol=1e-6)


@settings(max_examples=25, deadline=None)
@given(seed=SEEDS, sds=st.tuples(st.sampled_from([0.0, 0.5, 5.0]), st.sampled_from([0.0, 0.5, 5.0])))
def test_no_other_variances_are_likelier(seed, sds):
    rng = np.random.default_rng(seed)
    replicate_of = rng.integers(0, 4, 16)
    whole_plot = rng.permutation(np.repeat(np.arange(16), rng.integers(1, 6, 16)))
    replicate, n = replicate_of[whole_plot], len(whole_plot)
    columns = np.column_stack([np.ones(n), rng.normal(size=16)[whole_plot], rng.normal(size=n)])
    y = rng.normal(size=n) + sds[0] * rng.normal(size=4)[replicate] + sds[1] * rng.normal(size=16)[whole_plot]
    fit = fit_split_plot(columns, y, whole_plot, "abc", replicate=replicate)
    groups = [whole_plot, replicate]
    variances = np.array([fit.variances.subplot, fit.variances.wholeplot, fit.variances.replicate])
    assert fit.reml_loglik == pytest.approx(dense_log_likelihood(columns, y, groups, variances), abs=1e-9)
    score = dense_score(columns, y, groups, variances)
    np.testing.assert_allclose(score * variances, 0.0, atol=1e-8)
    assert np.all(score[variances == 0.0] <= 1e-8)
    kernels = [np.equal.outer(group, group).astype(float) for group in groups]
    for w in [0.0, *np.geomspace(1e-3, 1e3, 10)]:
        for r in [0.0, *np.geomspace(1e-3, 1e3, 10)]:
            v = np.eye(n) + w * kernels[0] + r * kernels[1]
            left = np.linalg.solve(v, columns)
            residual = y - columns @ np.linalg.solve(columns.T @ left, left.T @ y)
            subplot = residual @ np.linalg.solve(v, residual) / (n - 3)
            shares = subplot * np.array([1.0, w, r])
            assert dense_log_likelihood(columns, y, groups, shares) <= fit.reml_loglik + 1e-8


def test_coefficients_covariance_and_predictions_by_dense_matrices():
    columns, y, whole_plot, replicate = chamber(3, 0.32, 0.5, 14)
    keep = np.arange(len(y)) % 7 != 3
    columns, y, whole_plot, replicate = columns[keep], y[keep], whole_plot[keep], replicate[keep]
    fit = fit_split_plot(columns, y, whole_plot, NAMES, replicate=replicate)
    z, q = (np.equal.outer(each, np.unique(each)).astype(float) for each in (whole_plot, replicate))
    subplot, wholeplot, replication = fit.variances.subplot, fit.variances.wholeplot, fit.variances.replicate
    v = subplot * np.eye(len(y)) + wholeplot * z @ z.T + replication * q @ q.T
    covariance = np.linalg.inv(columns.T @ np.linalg.solve(v, columns))
    residual = y - columns @ covariance @ columns.T @ np.linalg.solve(v, y)
    np.testing.assert_allclose(fit.covariance, covariance, rtol=1e-7, atol=1e-13)
    np.testing.assert_allclose(fit.marginal_residuals, residual, atol=1e-10)
    np.testing.assert_allclose(fit.blup, wholeplot * z.T @ np.linalg.solve(v, residual), atol=1e-10)
    np.testing.assert_allclose(fit.blup_replicate, replication * q.T @ np.linalg.solve(v, residual), atol=1e-10)
    np.testing.assert_allclose(fit.conditional_residuals, residual - z @ fit.blup - q @ fit.blup_replicate, atol=1e-10)
    plan = plan_precision(
        columns, whole_plot, fit.sigma_wholeplot, fit.sigma_subplot, NAMES,
        replicate=replicate, sigma_replicate=fit.sigma_replicate,
    )  # fmt: skip
    np.testing.assert_allclose(plan.stderr, fit.stderr, rtol=1e-10)
    np.testing.assert_allclose(plan.df, fit.df, rtol=1e-10)


def test_interval_of_a_new_whole_plot_includes_a_new_replication():
    columns, y, whole_plot, replicate = chamber(3, 0.32, 0.5, 14)
    fit = fit_split_plot(columns, y, whole_plot, NAMES, replicate=replicate)
    more = fit.variance(columns[:3], new_whole_plot=True) - fit.variance(columns[:3])
    np.testing.assert_allclose(more, fit.variances.wholeplot + fit.variances.replicate)


def test_many_at_once_refuses_replications():
    columns, whole_plot, replicate = design(2)
    with pytest.raises(ValueError, match="one by one"):
        SplitPlotDesign(columns, whole_plot, NAMES, replicate=replicate).fit_many(np.zeros((440, 2)))


def test_a_forecast_wants_sensible_sizes():
    columns, whole_plot, replicate = design(2)
    plan = SplitPlotDesign(columns, whole_plot, NAMES, replicate=replicate)
    with pytest.raises(ValueError, match="above zero"):
        plan.precision(0.3, 0.0)
    with pytest.raises(ValueError, match="above zero"):
        plan.precision(float("nan"), 0.1)
    with pytest.raises(ValueError, match="has none"):
        SplitPlotDesign(columns, whole_plot, NAMES).precision(0.3, 0.1, 0.2)


def test_degrees_of_freedom_are_not_forecast_where_replications_cannot_be_estimated():
    columns, whole_plot, replicate = design(2)
    indicated = SplitPlotDesign(
        np.column_stack([columns, replicate == 2]), whole_plot, [*NAMES, "second"], replicate=replicate
    )
    assert np.isnan(indicated.precision(0.3, 0.1, 0.2).df).all()
    assert indicated.precision(0.3, 0.1, 0.2).stderr[-1] > indicated.precision(0.3, 0.1).stderr[-1] > 0
    assert np.isfinite(indicated.precision(0.3, 0.1).df).all()
