"""Split plots against R: lme4 and nlme (estimates), lmerTest (Satterthwaite), pbkrtest (Kenward-Roger).

reference/split_plot.json holds R's answers and the command and versions that made them; the data are generated here
and there by the same rules. lme4 stands at nlme's maximum there, because its own optimiser stops short of it.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from split_plot_cases import cases

from fitter.split_plot import fit_split_plot

REFERENCE = json.loads((Path(__file__).parent / "reference" / "split_plot.json").read_text())["cases"]
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
        assert f.ddf == pytest.approx(test["ddf"], rel=1e-6)  # pbkrtest's own differences of nearly equal numbers
        assert f.scale == pytest.approx(test["scale"], rel=1e-8)


def test_oats_as_published():
    """-2 log L, sds and standard errors of Pinheiro and Bates, "Mixed-Effects Models in S and S-PLUS", section 1.6.

    They code nitrogen and variety as here, and print six digits.
    """
    columns, y, whole_plot, block = CASES["oats"]
    fit = fit_split_plot(columns, y, whole_plot, REFERENCE["oats"]["names"], replicate=block)
    assert (fit.sigma_replicate, fit.sigma_wholeplot, fit.sigma_subplot) == pytest.approx(
        (14.64504, 10.43758, 12.86695), abs=6e-6
    )
