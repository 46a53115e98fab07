"""Split plots against R: lme4 and nlme (estimates), lmerTest (Satterthwaite), pbkrtest (Kenward-Roger).

reference/split_plot.json holds R's answers and the command and versions that made them; the data are generated here
and there by the same rules. lme4 stands at nlme's maximum there, because its own optimiser stops short of it.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from split_plot_cases import OATS, cases

from rig.fitter.split_plot import fit_split_plot

REFERENCE = json.loads((Path(__file__).parents[1] / "reference" / "split_plot.json").read_text())["cases"]
NESTED = {"oats", "nested", "nested_broken"}
CASES = cases()


@pytest.fixture(scope="module", params=REFERENCE)
def pair(request):
    columns, y, whole_plot, replicate = CASES[request.param]
    expected = REFERENCE[request.param]
    nested = replicate if request.param in NESTED else None
    return fit_split_plot(columns, y, whole_plot, expected["names"], replicate=nested), expected


def test_estimates(pair):
    fit, expected = pair
    for package in ("lme4", "nlme"):
        np.testing.assert_allclose(fit.coefficients, expected[package]["coefficients"], rtol=1e-8)
        np.testing.assert_allclose(fit.stderr, expected[package]["stderr"], rtol=1e-8)
        assert fit.reml_loglik == pytest.approx(expected[package]["loglik"], abs=1e-8)
    sd = expected["lme4"]["sd"]
    assert fit.sigma_subplot == pytest.approx(sd["Residual"], rel=1e-8)
    assert fit.sigma_wholeplot == pytest.approx(sd["wp"], rel=1e-8)
    assert fit.sigma_replicate == (pytest.approx(sd["rep"], rel=1e-8) if "rep" in sd else None)


def test_printed_answers(pair):
    fit, expected = pair
    above = [each for each in (fit.sigma_replicate, fit.sigma_wholeplot) if each is not None]
    np.testing.assert_allclose([*above, fit.sigma_subplot], expected["nlme"]["sd"], rtol=1e-4)
    default = expected["lme4_default"]["sd"]
    np.testing.assert_allclose(above, [default[each] for each in ("rep", "wp") if each in default], rtol=1e-4)


def test_predicted_errors(pair):
    fit, expected = pair
    np.testing.assert_allclose(fit.blup, expected["lme4"]["blup"], rtol=1e-8, atol=1e-9)


def test_satterthwaite(pair):
    """LmerTest differentiates numerically, which is good for six digits."""
    fit, expected = pair
    np.testing.assert_allclose(fit.satterthwaite(np.eye(len(fit.names))), expected["lmerTest"]["df"], rtol=2e-6)


def test_kenward_roger(pair):
    fit, expected = pair
    np.testing.assert_allclose(fit.kenward_roger().stderr, expected["pbkrtest"]["stderr"], rtol=1e-8)
    np.testing.assert_allclose(fit.df, expected["pbkrtest"]["df"], rtol=1e-8)
    assert fit.df_method == "kenward-roger"


def test_kenward_roger_of_several_terms(pair):
    fit, expected = pair
    for test in expected["pbkrtest"]["tests"]:
        f = fit.f_test(test["terms"])
        assert f.ndf == test["ndf"]
        assert f.value == pytest.approx(test["F"], rel=1e-8)
        assert f.ddf == pytest.approx(test["ddf"], rel=1e-8)
        assert f.scale == pytest.approx(test["scale"], rel=1e-8)


def test_oats_by_hand():
    """The analysis of variance of Yates's experiment: 5, 10 and 53 degrees of freedom, nitrogen as a slope."""
    columns, y, whole_plot, block = CASES["oats"]
    fit = fit_split_plot(columns, y, whole_plot, REFERENCE["oats"]["names"], replicate=block)
    table, nitro = OATS.reshape(6, 3, 4), np.array([-0.3, -0.1, 0.1, 0.3])
    plots = table.mean(axis=2)
    blocks, varieties = plots.mean(axis=1, keepdims=True), plots.mean(axis=0)
    slope = np.mean(table @ nitro) / np.sum(nitro**2)
    ms_block = 12 * np.sum((blocks - plots.mean()) ** 2) / 5
    ms_plot = 4 * np.sum((plots - blocks - varieties + plots.mean()) ** 2) / 10
    ms_reading = np.sum((table - plots[..., None] - slope * nitro) ** 2) / 53
    assert fit.coefficients[1] == pytest.approx(slope, rel=1e-12)
    assert fit.variances.subplot == pytest.approx(ms_reading, rel=1e-10)
    assert fit.variances.wholeplot == pytest.approx((ms_plot - ms_reading) / 4, rel=1e-10)
    assert fit.variances.replicate == pytest.approx((ms_block - ms_plot) / 12, rel=1e-10)
    assert fit.stderr[2] ** 2 == pytest.approx(2 * ms_plot / 24, rel=1e-10)
    assert fit.stderr[1] ** 2 == pytest.approx(ms_reading / (18 * np.sum(nitro**2)), rel=1e-10)
