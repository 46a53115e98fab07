"""Errors of a pressure calibration against the likelihood written out with dense matrices."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize, stats

from proving.truth.pressure import GROWING, HOMOSCEDASTIC, simulate
from rig.procedures.pressure.fit import Errors, fit_pressure
from rig.procedures.pressure.fit.errors import Layout


def restricted_loglik(theta, columns, y, pressure, groups):
    """Of variances by name, dense: subplot at zero, growth, whole plot, replication."""
    s2, c, *shared = theta
    v = np.diag(s2 * (1 + c * pressure) ** 2)
    for variance, group in zip(shared, groups, strict=False):
        v += variance * (group[:, None] == group[None, :])
    solved = np.linalg.solve(v, columns)
    r = y - columns @ np.linalg.solve(columns.T @ solved, solved.T @ y)
    logdet = np.linalg.slogdet(v)[1] + np.linalg.slogdet(columns.T @ solved)[1]
    return -0.5 * (logdet + r @ np.linalg.solve(v, r))


def parts(data, **options):
    fit = fit_pressure(data, "bridge_mV", **options)
    q = np.linalg.qr(fit.problem.columns / np.linalg.norm(fit.problem.columns, axis=0))[0]
    return fit, q, data.outputs["bridge_mV"]


def numerical_gradient(f, theta):
    steps = 1e-5 * np.abs(theta)
    return np.array(
        [(f(theta + h) - f(theta - h)) / (2 * h.sum()) for h in np.diag(steps)],
    )


def test_score_is_the_derivative_of_the_restricted_likelihood():
    data, _ = simulate(replace(GROWING, replicate_mV=0.02), 1, replications=2)
    data = data.take(np.flatnonzero(data.position < 7))
    _, q, y = parts(data)
    layout = Layout.of(data, nested=True)
    theta = np.array([4e-6, 0.6, 1.5e-4, 3e-4])
    errors = Errors(*theta, spread=np.zeros((4, 4)), p_growth=0.0)

    def loglik(at):
        return restricted_loglik(at, q, y, data.pressure_psia, (data.whole_plot, data.replicate))

    score, information = layout.restricted(errors, q, y)
    np.testing.assert_allclose(score, numerical_gradient(loglik, theta), rtol=1e-4)
    grown = 1 + theta[1] * data.pressure_psia
    together = [group[:, None] == group[None, :] for group in (data.whole_plot, data.replicate)]
    by = [np.diag(grown**2), np.diag(2 * theta[0] * data.pressure_psia * grown), *together]
    v = theta[0] * by[0] + theta[2] * by[2] + theta[3] * by[3]
    inverse = np.linalg.inv(v)
    p = inverse - inverse @ q @ np.linalg.inv(q.T @ inverse @ q) @ q.T @ inverse
    expected = [[0.5 * np.trace(p @ a @ p @ b) for b in by] for a in by]
    np.testing.assert_allclose(information, expected, rtol=1e-6)


def test_growth_is_at_the_maximum_of_the_restricted_likelihood():
    data, _ = simulate(GROWING, 4)
    fit, q, y = parts(data)

    def loss(log_theta):
        return -restricted_loglik(np.exp(log_theta), q, y, data.pressure_psia, (data.whole_plot,))

    best = optimize.minimize(
        loss, np.log([3e-6, 0.7, 2e-4]), method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-10}
    )
    e = fit.errors
    np.testing.assert_allclose([e.subplot_variance, e.growth_per_psia, e.wholeplot_variance], np.exp(best.x), rtol=1e-4)
    assert e.p_growth < 1e-6
    # a + b P is what was simulated, within three standard errors of each parameter
    assert abs(e.growth_per_psia - 0.75) < 3 * np.sqrt(e.spread[1, 1])
    np.testing.assert_allclose(e.subplot_sd(np.array([5.0])), GROWING.subplot_sd(5.0), rtol=0.3)


def test_growth_that_is_not_there_is_found_once_in_a_hundred():
    p = [fit_pressure(simulate(HOMOSCEDASTIC, seed)[0], "bridge_mV").errors.p_growth for seed in range(200)]
    assert sum(x < 0.01 for x in p) <= stats.binom.ppf(0.999, 200, 0.01)
    assert stats.kstest(p, "uniform").pvalue > 1e-3
    assert fit_pressure(simulate(HOMOSCEDASTIC, 0)[0], "bridge_mV", growth=True).errors.growth_per_psia != 0.0


@pytest.mark.parametrize("truth", [HOMOSCEDASTIC, GROWING], ids=["even", "growing"])
def test_covariance_of_an_estimator_and_its_derivatives(truth):
    data, _ = simulate(truth, 6, keep={3: 4})
    fit, _, _ = parts(data)
    layout, errors = fit.problem.layout, fit.errors
    a = np.random.default_rng(2).normal(size=(3, len(data)))
    theta = np.array([errors.subplot_variance, errors.growth_per_psia, errors.wholeplot_variance])
    v = np.diag(theta[0] * (1 + theta[1] * data.pressure_psia) ** 2)
    v += theta[2] * (data.whole_plot[:, None] == data.whole_plot[None, :])
    covariance, derivatives = layout.covariance(errors, a)
    np.testing.assert_allclose(covariance, a @ v @ a.T, rtol=1e-12)
    np.testing.assert_allclose(layout.solve(errors, v), np.eye(len(data)), atol=1e-9)
    rows, gradient = layout.variances(errors, a)
    np.testing.assert_allclose(rows, np.diag(covariance), rtol=1e-12)
    np.testing.assert_allclose(gradient, np.diagonal(derivatives, axis1=1, axis2=2).T, rtol=1e-12)
    h = 1e-6
    more = layout.covariance(replace(errors, growth_per_psia=errors.growth_per_psia + h), a)[0]
    less = layout.covariance(replace(errors, growth_per_psia=errors.growth_per_psia - h), a)[0]
    np.testing.assert_allclose(derivatives[1], (more - less) / (2 * h), rtol=1e-6)


def test_degrees_of_freedom_are_those_of_the_split_plot_fit():
    data, _ = simulate(HOMOSCEDASTIC, 7, keep={2: 5, 8: 1})
    fit, _, _ = parts(data, growth=False)
    found = fit.methods["GLS"]
    ours = fit.errors.df(
        np.einsum("pkk,p->k", found.derivatives, [fit.errors.subplot_variance, 0, fit.errors.wholeplot_variance, 0]),
        np.diagonal(found.derivatives, axis1=1, axis2=2).T,
    )
    np.testing.assert_allclose(ours, fit.reml.df, rtol=0.02)  # Satterthwaite's and Kenward and Roger's
    row = fit.problem.columns[:1]
    limit = stats.t.ppf(0.975, fit.errors.df(*_variance_at(fit, row)))
    close = fit.reml.interval(row, new_whole_plot=True, new_readings=1.0)
    np.testing.assert_allclose(limit * np.sqrt(_variance_at(fit, row)[0]), close, rtol=5e-3)


def _variance_at(fit, row):
    found = fit.methods["GLS"]
    new, by = fit.errors.of_reading(np.array([1.0]), new_whole_plot=True)
    fixed = np.einsum("nk,kl,nl->n", row, found.covariance, row)
    return new + fixed, by + np.einsum("nk,pkl,nl->np", row, found.derivatives, row)


@pytest.mark.parametrize("growth", [0.0, 30.0, 1e4])
def test_an_error_in_proportion_to_pressure(growth):
    """Nothing is left at zero pressure: growth ends at its limit, or near it, and never in a singular matrix."""
    at_zero = 0.004 / (1 + growth)
    truth = replace(HOMOSCEDASTIC, subplot_mV=at_zero, subplot_mV_per_psi=growth * at_zero)
    for seed in range(5):
        errors = fit_pressure(simulate(truth, seed)[0], "bridge_mV", growth=True).errors
        assert -0.18 <= errors.growth_per_psia <= 99 / 5
        np.testing.assert_allclose(errors.subplot_sd(np.array([4.0])), truth.subplot_sd(4.0), rtol=0.4)
    assert np.all(np.isfinite(errors.spread))


def test_a_model_without_pressure_is_fitted_as_badly_as_it_must():
    data, _ = simulate(HOMOSCEDASTIC, 0)
    fit = fit_pressure(data, "bridge_mV", "1 + T_sensor")
    assert fit.errors.subplot_sd(np.array([5.0]))[0] > 1.0


def test_no_whole_plot_error_leaves_residual_degrees_of_freedom():
    for seed in range(20):
        data, _ = simulate(replace(HOMOSCEDASTIC, wholeplot_mV=0.0), seed)
        fit = fit_pressure(data, "bridge_mV", growth=False)
        if fit.reml.boundary:
            break
    assert fit.errors.wholeplot_variance == 0.0
    np.testing.assert_allclose(fit.methods["GLS"].df, 210.0)
    np.testing.assert_allclose(fit.methods["WLS"].df, 210.0, rtol=1e-9)
