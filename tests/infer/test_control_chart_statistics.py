"""The statistics of control charts against other programs, published figures and algebra."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import special, stats

from proving.truth.attitude import D1, Bench, Plan, Sensor, simulate
from proving.truth.chart import BENCH, PLAN, START, UNIT, bench_of, draw_history, largest_error_deg
from rig.fitter.history import Between, ErrorBound, Series, error_bound, homogeneity, limits, step, trend
from rig.fitter.history.between_calibrations import Profile
from rig.fitter.history.chart import holm
from rig.fitter.history.forecast import Prediction, predict
from rig.procedures.attitude.fit import fit_all
from rig.procedures.attitude.history import attitude_charted, calibrated, calibrated_from
from rig.procedures.attitude.infer import calibrate_package

BCG = """
4 119 11 128; 6 300 29 274; 3 228 11 209; 62 13536 248 12619; 33 5036 47 5761; 180 1361 372 1079; 8 2537 10 619;
505 87886 499 87892; 29 7470 45 7232; 17 1699 65 1600; 186 50448 141 27197; 5 2493 3 2338; 27 16886 29 17825"""
"""The BCG vaccine trials (Colditz et al. 1994): cases and others, treated and control."""


def alike(values, variance=1.0, df=10.0, years=None):
    values = np.asarray(values, float)
    years = np.arange(len(values)) / 2.0 if years is None else years
    return Series(years, values, np.full(len(values), variance), df)


@pytest.fixture
def bcg():
    a, b, c, d = np.array([row.split() for row in BCG.split(";")], float).T
    log_ratio = np.log(a / (a + b)) - np.log(c / (c + d))
    return Series(np.arange(13.0), log_ratio, 1 / a - 1 / (a + b) + 1 / c - 1 / (c + d), 1e6)


def test_the_variance_between_is_that_of_the_r_package_metafor(bcg):
    """metafor 4: rma(yi, vi, method="PM"), its Q, and confint() for the interval by the Q profile."""
    profile = Profile.of(bcg, bcg.constant, Between.SCATTER)
    assert float(profile.squares.sum()) == pytest.approx(152.2330, abs=1e-4)
    assert profile.paule_mandel() == pytest.approx(0.3181, abs=5e-5)
    low, high = profile.psi(special.chdtri(12, np.array([0.025, 0.975])), np.ones(2))
    assert (low, high) == (pytest.approx(0.1197, abs=5e-5), pytest.approx(1.1115, abs=5e-5))


def test_homogeneity_is_one_way_analysis_of_variance():
    rng = np.random.default_rng(1)
    groups = rng.normal(size=(5, 4)) + rng.normal(size=(5, 1))
    series = alike(groups.mean(axis=1), groups.var(axis=1, ddof=1).mean() / 4, 15)
    expected = stats.f_oneway(*groups)
    found = homogeneity(series)
    assert (found.F, found.p) == (pytest.approx(expected.statistic), pytest.approx(expected.pvalue))


@pytest.mark.parametrize("within", [1e-4, 100.0])
def test_a_trend_of_equal_calibrations_is_ordinary_regression(within):
    rng = np.random.default_rng(2)
    years = np.cumsum(rng.uniform(0.2, 1.0, 7)) - 0.5
    series = alike(rng.normal(size=7) + years, within, years=years)
    expected, found = stats.linregress(years, series.values), trend(series)
    assert found.per_year == pytest.approx(expected.slope)
    assert (found.stderr, found.p) == (pytest.approx(expected.stderr), pytest.approx(expected.pvalue))
    assert found.explained == pytest.approx(expected.rvalue**2)


def test_a_calibration_is_outside_where_its_t_test_against_the_others_says_so():
    rng = np.random.default_rng(3)
    seen = set()
    for _ in range(60):
        values = rng.normal(size=6)
        values[2] += rng.normal(0, 4)
        found = limits(alike(values, 1e-6))
        for i in range(6):
            p = stats.ttest_ind([values[i]], np.delete(values, i)).pvalue
            assert (found.warned[i], found.out[i]) == (p < 0.05, p < 0.003)
            seen.add((p < 0.05, p < 0.003))
    assert len(seen) == 3, "all cases occurred"


def test_the_step_is_the_split_with_the_largest_t():
    rng = np.random.default_rng(4)
    for _ in range(20):
        values = rng.normal(size=8)
        tests = [stats.ttest_ind(values[k:], values[:k]) for k in range(1, 8)]
        best = int(np.argmax([abs(t.statistic) for t in tests]))
        found = step(alike(values, 1e-6))
        assert found.before == best + 1
        assert found.size / found.stderr == pytest.approx(tests[best].statistic)


def test_a_step_somewhere_is_no_rarer_than_it_says():
    rng = np.random.default_rng(5)
    p = np.array([step(alike(rng.normal(size=6), 1e-6)).p for _ in range(1000)])
    for level in (0.05, 0.2, 0.5):
        count = np.sum(p <= level)
        assert stats.binomtest(int(count), 1000, level).pvalue > 0.001


def test_adjusted_probabilities_are_those_of_r():
    """p.adjust(c(0.01, 0.04, 0.03, 0.005), "holm")."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


def test_a_wandering_parameter_without_errors_is_predicted_by_students_t():
    """Independent steps: the slope is the mean step, and the error after h years is t (q (h + h^2 / T))^1/2."""
    rng = np.random.default_rng(6)
    years = np.cumsum(rng.uniform(0.3, 0.8, 6))
    years -= years[0]
    values = np.concatenate([[0.0], np.cumsum(rng.normal(size=5) * np.sqrt(np.diff(years)))])
    found = predict(alike(values, 1e-12, years=years), Between.WALK, np.array([0.7]), nodes=4096)
    T, slope = years[-1], values[-1] / years[-1]
    q = np.sum((np.diff(values) - slope * np.diff(years)) ** 2 / np.diff(years)) / 4
    sd = np.sqrt(q * (0.7 + 0.7**2 / T))
    for t in (0.5, 1.0, stats.t.ppf(0.95, 4), stats.t.ppf(0.99, 4)):
        probability = np.mean(special.ndtr((0.7 * slope + t * sd - found.mean[:, 0]) / found.sd[:, 0]))
        assert probability == pytest.approx(stats.t.cdf(t, 4), abs=2e-4)


def test_a_line_without_errors_is_predicted_by_regression():
    rng = np.random.default_rng(7)
    series = alike(rng.normal(size=5), 1e-12)
    found = predict(series, Between.SCATTER, np.array([1.0]), nodes=4096)
    t, at = series.years, series.years[-1] + 1.0
    line = np.polynomial.Polynomial.fit(t, series.values, 1)
    s = np.sqrt(np.sum((series.values - line(t)) ** 2) / 3)
    sd = s * np.sqrt(1 + 1 / 5 + (at - t.mean()) ** 2 / np.sum((t - t.mean()) ** 2))
    limit = line(at) - series.values[-1] + stats.t.ppf(0.975, 3) * sd
    probability = np.mean(special.ndtr((limit - found.mean[:, 0]) / found.sd[:, 0]))
    assert probability == pytest.approx(0.975, abs=3e-4)


def test_a_bound_holds_until_it_first_exceeds_the_tolerance():
    years = np.array([0.0, 1.0, 2.0, 3.0])
    bound = ErrorBound(years, {Between.SCATTER: np.array([1.0, 2, 4, 3]), Between.WALK: np.array([2.0, 2, 2, 2.5])})
    assert bound.holds_for(3.0, Between.SCATTER) == 1.5
    assert bound.holds_for(3.0, Between.WALK) == 3.0
    assert bound.holds_for(3.0) == 1.5
    assert bound.governs(3.0) is Between.SCATTER
    assert bound.holds_for(1.5) is None, "a walk would be outside at once"
    assert bound.holds_for(5.0) == 3.0, "nothing is said beyond"


def test_too_few_calibrations_say_nothing_rather_than_something():
    two, three = alike([1.0, 2.0]), alike([1.0, 2.0, 1.5])
    assert (trend(two), limits(two), step(two)) == (None, None, None)
    assert step(three) is None
    assert trend(three).df == 1
    with pytest.raises(ValueError, match="at least two"):
        alike([1.0])
    with pytest.raises(ValueError, match="order of time"):
        Series(np.array([0.0, 0.0]), np.zeros(2), np.ones(2), 1.0)


def test_the_error_within_holds_drift_between_replications():
    """Offsets of replications, as large as a reading's noise, make the pooled fit's error far too small."""
    bench = replace(Bench(sensors=(Sensor("x"),), offset_sd=1.0), degC_daily=0.0)
    found = [calibrated(simulate(bench, PLAN, seed)[0], "x_V") for seed in range(150)]
    true = np.var([c.coefficients[0] for c in found], ddof=1)
    within = np.mean([c.covariance[0, 0] for c in found])
    pooled = np.mean([c.sigma_V**2 * c.shape[0, 0] for c in found])
    low, high = 149 / stats.chi2.ppf([0.9995, 0.0005], 149)
    assert low * 0.8 < within / true < high * 1.25
    assert pooled < 0.2 * true


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("rolls", [(-144.0, -72.0, 0.0, 72.0, 144.0), (0.0,)])
def test_what_a_change_of_a_parameter_does_to_the_output_is_what_the_sensor_does(axis, rolls):
    plan = Plan(np.linspace(-90, 90, 7), np.array(rolls), replications=2)
    before = Sensor(axis, Omega_deg=3.0)
    after = replace(before, b=before.b + 2e-5, S=before.S * (1 + 3e-6), Omega_deg=3.0002, A_deg=70.003)
    benches = [Bench(sensors=(s,), sigma_deg=1e-12, degC_daily=0.0) for s in (before, after)]
    name = f"{axis}_V"
    found = attitude_charted([calibrated(simulate(b, plan, 1)[0], name) for b in benches], np.array([0.0, 1.0]))
    change = np.array([np.diff(s.values)[0] for s in found.series])
    rng = np.random.default_rng(1)
    pitch, roll = rng.uniform(-90, 90, 20), rng.uniform(-180, 180, 20) * (len(rolls) > 1)
    zero = np.zeros(20)
    old, new = (b.outputs(pitch, roll, zero + 23.0, zero, zero, zero, zero)[name] for b in benches)
    volts = np.radians(found.output_rows(pitch, roll) @ change) * found.sensitivity
    assert volts == pytest.approx(new - old, abs=1e-8)


def test_the_bound_of_a_normal_error_is_that_of_its_tables():
    """1.959964 sd about zero; 1.644854 sd beyond a mean far from it."""
    found = Prediction(np.array([[0.0, 50.0, -50.0]]), np.array([[2.0, 1.0, 1.0]])).bound(0.95)
    assert found == pytest.approx([2 * 1.959964, 50 + 1.644854, 50 + 1.644854], rel=1e-6)


def test_an_output_is_charted_as_the_sum_of_its_parameters_with_their_covariance():
    """Within one calibration: the variance of h c, from the replications' own h c."""
    data = simulate(BENCH, PLAN, 5)[0]
    found = attitude_charted([calibrated(data, "x_V")] * 2, np.arange(2.0))
    row = found.output_rows(np.array([20.0]), np.array([50.0]))[0]
    a, r = np.radians(20.0), np.radians(50.0)
    h = np.array([1.0, np.sin(a), np.cos(a) * np.sin(r), np.cos(a) * np.cos(r)])
    alone = [fit_all(data.take(data.replicate == n))["x_V"].linear.coefficients @ h for n in data.replicates]
    expected = np.var(np.degrees(alone) / found.sensitivity, ddof=1) / len(alone)
    assert found.combined(row).variance == pytest.approx(expected, rel=1e-9)


def test_charted_axis_is_the_true_one():
    found = attitude_charted(
        [calibrated(simulate(bench_of(START), PLAN, seed)[0], "x_V") for seed in (1, 2)], np.arange(2.0)
    )
    values = np.array([s.values.mean() for s in found.series])
    assert np.abs((values - START) / UNIT).max() < 4
    assert found.parameters[0] == pytest.approx(
        [0.002, 5.0, np.hypot(0.2, 0.5), np.degrees(np.arctan2(0.5, 0.2))], rel=3e-3
    )


def test_standard_errors_of_the_papers_parameters_are_those_of_the_fit_where_nothing_drifts():
    bench = replace(BENCH, offset_sd=0.0)
    plan = replace(PLAN, replications=60)
    data = simulate(bench, plan, 3)[0]
    found = attitude_charted([calibrated(data, "x_V")] * 2, np.arange(2.0))
    assert found.stderr[0] == pytest.approx(fit_all(data)["x_V"].parameters.stderr, rel=0.25)


@pytest.mark.parametrize("roll_count", [5, 1])
def test_a_calibration_file_tells_the_same_as_the_run(roll_count):
    data, _ = simulate(Bench(offset_sd=0.5), D1(90, 5, roll_count, replications=4), 3)
    fits = {name: fit.to_dict() for name, fit in fit_all(data).items()}
    content = json.loads(json.dumps({"sensors": fits, "calibration": calibrate_package(data).to_dict()}))
    for name, stored in calibrated_from(content).items():
        run = calibrated(data, name)
        assert stored.model == run.model
        assert stored.coefficients == pytest.approx(run.coefficients, rel=1e-12)
        assert stored.df == run.df
        assert stored.covariance[0, 0] == pytest.approx(run.covariance[0, 0], rel=1e-6)
        along = np.concatenate([[0.0], run.coefficients[1:]])
        ratio = (along @ stored.covariance @ along) / (along @ run.covariance @ along)
        assert ratio == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(("kind", "size"), [("none", 0.0), ("walk", 3.0), ("together", 3.0), ("linear", 3.0)])
def test_a_sensor_is_within_tolerance_when_it_is_due(kind, size):
    """A bounded share of proving/statistics/charts.py: from readings to charts, and what the sensor then does.

    Binomial tests of as many as there are: ten histories, of four quantities each.
    """
    rng = np.random.default_rng([8, len(kind)])
    pitch, roll = (a.ravel() for a in np.meshgrid(np.linspace(-30, 30, 5), np.arange(0, 360, 30.0)))
    within, differ = [], 0
    for _ in range(10):
        history = draw_history(kind, 6, rng, size)
        fits = [calibrated(run, "x_V") for run in history.runs()]
        charted, last = attitude_charted(fits, history.years), fits[-1].coefficients
        bound = error_bound(charted, charted.output_rows(pitch, roll), times=9, draws=512, nodes=32)
        years = bound.holds_for(8e-4)
        if years is not None:
            within.append(largest_error_deg(history.after(years), last) <= 8e-4)
        differ += sum(homogeneity(s).p < 0.05 for s in charted.series)
    assert len(within) >= 5
    assert stats.binomtest(sum(within), len(within), 0.95, alternative="less").pvalue > 0.01
    if kind == "none":
        assert stats.binomtest(differ, 40, 0.05).pvalue > 0.001
    else:
        assert differ > 12


def test_calibrations_at_other_temperatures_are_stated_at_one():
    """A sensor of 100 ppm/degC that does not change, calibrated warm and cold: its sensitivity at one temperature."""
    sensor = Sensor("x", b_per_degC=3e-5, S_per_degC=1e-4)
    found = []
    for seed, degC in ((1, 21.0), (2, 25.0)):
        data, _ = simulate(Bench(sensors=(sensor,), degC_daily=1.0), D1(90, 7, 7, replications=4), seed)
        offset = degC - data.sensor_temperature_degC.mean()
        volts = data.outputs["x_V"] + offset * (3e-5 + 1e-4 * (data.outputs["x_V"] - sensor.b))
        warm = replace(data, sensor_temperature_degC=data.sensor_temperature_degC + offset, outputs={"x_V": volts})
        one = calibrated(warm, "x_V", temperature=True)
        assert one.warmth.reference_degC == pytest.approx(degC)
        found.append(one)
    cold, hot = (one.at(23.0) for one in found)
    error = np.sqrt(np.diag(cold.covariance + hot.covariance))
    apart = hot.coefficients - cold.coefficients
    assert np.all(np.abs(apart) < 6 * error)
    as_taken = found[1].coefficients - found[0].coefficients
    assert as_taken[1] == pytest.approx(4.0 * 1e-4 * 5.0, rel=0.05)
    assert abs(apart[1]) < 0.05 * as_taken[1]
    kept = calibrated_from(
        {
            "sensors": {name: fit.to_dict() for name, fit in fit_all(warm, temperature=True).items()},
            "calibration": calibrate_package(warm, temperature=True).to_dict(),
        }
    )["x_V"]
    np.testing.assert_allclose(kept.at(23.0).coefficients, hot.coefficients, rtol=1e-9, atol=1e-12)
