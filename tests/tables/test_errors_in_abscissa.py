"""Stated uncertainties and errors in the abscissa: ISO/TS 28037:2010, GUM H.3, and ODRPACK."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest
from command import rig
from scipy import optimize

from rig.fitter import least_squares
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.fitter.nonlinear import Correlated, Distance, WrittenCurve, solve
from rig.procedures.general.declared import Declared
from rig.procedures.general.fit import fit_general
from rig.tables import FileSource

LINE = Formula.parse("1 + x")
SIX = {
    "equal": ([1, 2, 3, 4, 5, 6], [3.3, 5.6, 7.1, 9.3, 10.7, 12.1], None, [0.5] * 6),
    "unequal": ([1, 2, 3, 4, 5, 6], [3.2, 4.3, 7.6, 8.6, 11.7, 12.8], None, [0.5] * 3 + [1.0] * 3),
    "both": ([1.2, 1.9, 2.9, 4.0, 4.7, 5.9], [3.4, 4.4, 7.2, 8.5, 10.8, 13.5], [0.2] * 6, [0.2] * 3 + [0.4] * 3),
}
"""Examples of clauses 6 and 7: abscissa, response, and their standard uncertainties."""
PRINTED = {
    "equal": (1.867, 0.465, 1.757, 0.120, -0.050, 1.665),
    "unequal": (0.885, 0.530, 2.057, 0.178, -0.082, 4.131),
    "both": (0.5788, 0.4764, 2.1597, 0.1355, -0.0577, 2.743),
}
"""a, u(a), b, u(b), cov(a, b), chi-squared, as the standard prints them in clauses 6.3 and 7.4.

Taken from the documentation of GTC (Measurement Standards Laboratory of New Zealand, MIT licence), which quotes them;
its 2.159 for the last slope lacks the fourth decimal of the others.
"""
DECIMALS = {"equal": (3,) * 6, "unequal": (3,) * 6, "both": (4, 4, 4, 4, 4, 3)}


def csv(folder, name):
    x, y, u_x, u_y = SIX[name]
    columns = {"x": x, "y": y, "u_y": u_y} | ({} if u_x is None else {"u_x": u_x})
    rows = zip(*columns.values(), strict=True)
    (folder / "t.csv").write_text("\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)]) + "\n")
    return folder / "t.csv"


@pytest.mark.parametrize("name", SIX)
def test_examples_of_iso_ts_28037(tmp_path, name):
    """Every printed digit, by the command that a user would give."""
    u_x = ("--u-x", "u_x") if name == "both" else ()
    options = ("--response", "y", "--formula", "1 + x", "--u-y", "u_y", *u_x)
    done = rig("fit", csv(tmp_path, name), *options, "--out", "c.json", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    a, b = found["coefficients"].values()
    told = (
        *(a["estimate"], a["stderr"], b["estimate"], b["stderr"]),
        found["correlation"][0][1] * a["stderr"] * b["stderr"],
        found["chi_squared"]["value"],
    )
    assert tuple(map(round, told, DECIMALS[name])) == PRINTED[name]
    assert found["chi_squared"]["df"] == 4
    assert round(found["chi_squared"]["limit95"], 3) == 9.488
    assert (a["df"], found["sigma_E"]) == (None, None)


@pytest.mark.parametrize(
    ("name", "y", "u", "x", "u_of_x"), [("equal", 10.5, 0.5, 4.913, 0.322), ("unequal", 10.5, 1.0, 4.674, 0.533)]
)
def test_prediction_of_iso_ts_28037(tmp_path, name, y, u, x, u_of_x):
    """Clause 11.1: a new response with its own standard uncertainty, by `rig infer`; digits of GTC's documentation."""
    options = ("--response", "y", "--formula", "1 + x", "--u-y", "u_y")
    done = rig("fit", csv(tmp_path, name), *options, "--out", "c.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (tmp_path / "use.csv").write_text(f"y\n{y}\n")
    done = rig("infer", "c.json", "use.csv", "--out", "o.csv", "--u-reading", str(u), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = dict(zip(*(line.split(",") for line in (tmp_path / "o.csv").read_text().splitlines()), strict=True))
    assert (round(float(found["x"]), 3), round(float(found["x_sd"]), 3)) == (x, u_of_x)


def test_unknown_equal_weights_of_annex_e(tmp_path):
    """Scaled by the residuals with m - 2 degrees of freedom; the standard's further factor is a t distribution here."""
    y = [3.014, 5.225, 7.004, 9.061, 11.201, 12.762]
    (tmp_path / "t.csv").write_text("x,y\n" + "".join(f"{i + 1},{v}\n" for i, v in enumerate(y)))
    found = fit_general(FileSource(tmp_path / "t.csv").read, "y", "1 + x")
    a, b = found["coefficients"].values()
    told = (
        a["estimate"],
        a["stderr"],
        b["estimate"],
        b["stderr"],
        found["correlation"][0][1] * a["stderr"] * b["stderr"],
    )
    assert tuple(round(v, 3) for v in told) == (1.172, 0.159, 1.964, 0.041, -0.006)


def clause_9():
    covariance = np.zeros((10, 10))
    covariance[:5, :5], covariance[5:, 5:] = 1.0, 4.0
    return (
        np.arange(1.0, 11.0),
        np.array([1.3, 4.1, 6.9, 7.5, 10.2, 12.0, 14.5, 17.1, 19.5, 21.0]),
        covariance + np.eye(10),
    )


def test_correlated_responses_of_clause_9():
    """Also with an abscissa that is nearly exact, as the limit of the general problem."""
    x, y, covariance = clause_9()
    root = np.linalg.cholesky(covariance)
    fit = least_squares(np.linalg.solve(root, np.column_stack([np.ones(10), x])), np.linalg.solve(root, y), ("a", "b"))
    both = np.block([[1e-12 * np.eye(10), np.zeros((10, 10))], [np.zeros((10, 10)), covariance]])
    b, error, _, chi = general(x, y, both)
    for estimate, stated, square in ((fit.coefficients, np.linalg.norm(fit.root, axis=1), fit.rss), (b, error, chi)):
        assert [round(v, 4) for v in estimate] == [-0.6456, 2.2014]
        assert [round(v, 4) for v in stated] == [1.2726, 0.2015]
        assert square == pytest.approx(2.0740, abs=5e-5)


def general(x, y, covariance):
    """Line, standard uncertainties, their covariance and chi-squared of correlated errors in both."""
    problem = Correlated(LINE, {"x": x}, "x", y, covariance)
    fit = solve(problem, problem.start(np.array([0.0, 1.0]))).fit
    line = (fit.root @ fit.root.T)[len(x) :, len(x) :]
    return fit.coefficients[len(x) :], np.sqrt(np.diag(line)), line[0, 1], fit.rss


def effective_variances(x, y, u_x, u_y, u_xy):
    """The iteration of clause 8, written from the variance of y - b x: u_y^2 + b^2 u_x^2 - 2 b u_xy."""
    b, chi = np.polyfit(x, y, 1)[::-1], np.nan
    for _ in range(200):
        variance = u_y**2 + (b[1] * u_x) ** 2 - 2.0 * b[1] * u_xy
        left = y - b[0] - b[1] * x
        true_x = x + (b[1] * u_x**2 - u_xy) * left / variance
        columns = np.column_stack([np.ones_like(x), true_x]) / np.sqrt(variance)[:, None]
        inverse = np.linalg.inv(columns.T @ columns)
        b = b + inverse @ columns.T @ (left / np.sqrt(variance))
        chi = np.sum(left**2 / variance)
    return b, inverse, chi


def test_correlated_pairs_of_clause_8():
    """The data of the example; its printed results were not to hand, so against the clause's own iteration."""
    x, y, u_x, u_y = (np.array(each, float) for each in SIX["both"])
    covariance = np.diag(np.concatenate([u_x, u_y]) ** 2)
    covariance[np.arange(6), np.arange(6) + 6] = covariance[np.arange(6) + 6, np.arange(6)] = 0.036
    b, error, mixed, chi = general(x, y, covariance)
    other, inverse, square = effective_variances(x, y, u_x, u_y, 0.036)
    np.testing.assert_allclose(b, other, rtol=1e-9)
    np.testing.assert_allclose([*error**2, mixed], [inverse[0, 0], inverse[1, 1], inverse[0, 1]], rtol=1e-7)
    assert chi == pytest.approx(square, rel=1e-9)


def test_correlated_errors_in_both_of_clause_10():
    """The data of the example; its printed results were not to hand, so against a minimum over the line alone.

    With the true values eliminated, the rest y - a - b x has the covariance Uy + b^2 Ux.
    """
    x = np.array([50.4, 99.0, 149.9, 200.4, 248.5, 299.7, 349.1])
    y = np.array([52.3, 97.8, 149.7, 200.1, 250.4, 300.9, 349.2])
    common = np.array([[0.5, 0, 0], [0, 1, 0], [0.5, 1, 0], [0, 0, 1], [0.5, 0, 1], [0, 1, 1], [0.5, 1, 1]])
    u_x, u_y = 0.25 * np.eye(7) + common @ common.T, 4.0 * np.eye(7) + 1.0
    b, error, mixed, chi = general(x, y, np.block([[u_x, np.zeros((7, 7))], [np.zeros((7, 7)), u_y]]))
    found = optimize.minimize(lambda at: alone(at, x, y, u_x, u_y), [0.0, 1.0], method="Nelder-Mead", options=TIGHT)
    np.testing.assert_allclose(b, found.x, rtol=1e-5)
    assert chi == pytest.approx(found.fun, rel=1e-9)
    # what this program says, to notice a change
    assert [round(v, 4) for v in b] == [0.3424, 1.0012]
    assert [round(v, 4) for v in error] == [2.0569, 0.0090]
    assert (round(mixed, 4), round(chi, 3)) == (-0.0129, 1.772)


TIGHT = {"xatol": 1e-9, "fatol": 1e-13, "maxiter": 4000}


def alone(line, x, y, u_x, u_y):
    left = y - line[0] - line[1] * x
    return left @ np.linalg.solve(u_y + line[1] ** 2 * u_x, left)


def test_a_covariance_that_is_none_is_refused():
    with pytest.raises(FitError, match="not positive definite"):
        general(np.arange(2.0), np.arange(2.0), np.ones((4, 4)))


def test_thermometer_of_gum_h3(tmp_path):
    """JCGM 100:2008, H.3: corrections of a thermometer, to the printed digits of tables H.6 and H.3.3 to H.3.4."""
    t = [21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511]
    b = [-0.171, -0.169, -0.166, -0.159, -0.164, -0.165, -0.156, -0.157, -0.159, -0.161, -0.160]
    (tmp_path / "h3.csv").write_text("t_degC,b_degC\n" + "".join(f"{p},{q}\n" for p, q in zip(t, b, strict=True)))
    found = fit_general(FileSource(tmp_path / "h3.csv").read, "b_degC", "1 + I(t_degC - 20)")
    y1, y2 = found["coefficients"].values()
    assert (round(y1["estimate"], 4), round(y1["stderr"], 4)) == (-0.1712, 0.0029)
    assert (round(y2["estimate"], 5), round(y2["stderr"], 5)) == (0.00218, 0.00067)
    assert round(found["correlation"][0][1], 3) == -0.930
    assert round(found["sigma_E"], 4) == 0.0035
    assert y1["df"] == 9
    # H.3.4: the correction at 30 degC, and its standard uncertainty
    row = np.array([1.0, 10.0])
    errors = np.array([y1["stderr"], y2["stderr"]])
    covariance = np.array(found["correlation"]) * np.outer(errors, errors)
    assert round(float(row @ [y1["estimate"], y2["estimate"]]), 4) == -0.1494
    assert round(float(np.sqrt(row @ covariance @ row)), 4) == 0.0041


def test_curves_with_errors_in_both_are_those_of_odrpack():
    """SciPy's copy of ODRPACK, as long as SciPy has one (it goes in SciPy 1.19), on an exponential."""
    odr = pytest.importorskip("scipy.odr")
    rng = np.random.default_rng(12)
    true_x = np.linspace(0.2, 3.0, 15)
    u_x, u_y = np.full(15, 0.03), np.linspace(0.02, 0.06, 15)
    x = true_x + rng.normal(0, u_x)
    y = 2.0 * np.exp(-0.9 * true_x) + 0.3 + rng.normal(0, u_y)
    curve = WrittenCurve.parse("a*exp(-k*x) + c", ["a", "k", "c"])
    found = solve(Distance(curve, {"x": x}, "x", y, u_x, u_y), [1.0, 1.0, 0.0]).fit
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        model = odr.Model(lambda b, at: b[0] * np.exp(-b[1] * at) + b[2])
        data = odr.RealData(x, y, sx=u_x, sy=u_y)
        told = odr.ODR(data, model, [1.0, 1.0, 0.0], sstol=1e-15, partol=1e-15, maxit=500).run()
    np.testing.assert_allclose(found.coefficients, told.beta, rtol=1e-6)
    assert found.rss == pytest.approx(told.sum_square, rel=1e-9)
    # ODRPACK's covariance is that of all 15 true values and 3 parameters, as here: the same to first order
    np.testing.assert_allclose(np.linalg.norm(found.root, axis=1), np.sqrt(np.diag(told.cov_beta)), rtol=1e-4)


def test_a_curve_of_distances_is_that_of_all_true_values_together():
    """Each abscissa's true value as a parameter of its own, with errors that are not correlated."""
    rng = np.random.default_rng(3)
    true_x = np.linspace(0.5, 4.0, 9)
    u_x, u_y = np.full(9, 0.05), np.full(9, 0.04)
    x, y = true_x + rng.normal(0, u_x), np.sqrt(true_x) * 2.0 + rng.normal(0, u_y)
    curve = WrittenCurve.parse("a*x^p", ["a", "p"])
    one = solve(Distance(curve, {"x": x}, "x", y, u_x, u_y), [1.0, 1.0]).fit
    problem = Correlated(curve, {"x": x}, "x", y, np.diag(np.concatenate([u_x, u_y]) ** 2))
    every = solve(problem, problem.start(np.array([1.0, 1.0]))).fit
    np.testing.assert_allclose(one.coefficients, every.coefficients[9:], rtol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(one.root, axis=1), np.linalg.norm(every.root, axis=1)[9:], rtol=1e-6)
    assert one.rss == pytest.approx(every.rss, rel=1e-10)


def test_no_error_in_the_abscissa_is_weighted_least_squares(tmp_path):
    read = FileSource(csv(tmp_path, "unequal")).read
    plain = fit_general(read, "y", declared=Declared("1 + x", u_y="u_y"))
    zero = fit_general(read, "y", declared=Declared("1 + x", u_y="u_y", u_x="0"))
    for one, other in zip(plain["coefficients"].values(), zero["coefficients"].values(), strict=True):
        assert other["estimate"] == pytest.approx(one["estimate"], rel=1e-10)
        assert other["stderr"] == pytest.approx(one["stderr"], rel=1e-10)


def test_stated_uncertainties_that_are_too_small_are_doubted(tmp_path):
    found = fit_general(FileSource(csv(tmp_path, "unequal")).read, "y", declared=Declared("1 + x", u_y="0.2"))
    assert any("chi-squared is" in note and "too narrow" in note for note in found["calibration"]["notes"])
