"""Curves that are not linear in their parameters: NIST's certified values, refusals, and the user's commands."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command import rig
from nist import digits

from rig.errors import UsageError
from rig.fitter import least_squares
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.fitter.linear import RankError
from rig.fitter.nonlinear import Weighted, WrittenCurve, solve
from rig.procedures.general.declared import Declared
from rig.procedures.general.fit import fit_general
from rig.procedures.general.infer import CurveCalibration, infer_curve
from rig.tables import FileSource

FILE = Path(__file__).parents[1] / "reference" / "nist" / "nonlinear.json"
SETS = json.loads(FILE.read_text(), parse_float=str, parse_int=str)["sets"]
DIGITS = {"Lanczos3": 9.0}
"""Certified digits are 11; residuals of Lanczos3 are of the size of rounding of its data."""


def problem(name):
    y, x = np.array(SETS[name]["rows"], float).T
    named = [f"b{i + 1}" for i in range(len(SETS[name]["coefficients"]))]
    return Weighted(WrittenCurve.parse(SETS[name]["model"], named), {"x": x}, y, np.ones(len(y)))


@pytest.mark.parametrize("start", ["start_1", "start_2"])
@pytest.mark.parametrize("name", SETS)
def test_certified_values_of_nist_from_both_starts(name, start):
    """Ten digits of parameters, standard errors and the residual standard deviation; start_1 is far away."""
    told = SETS[name]
    fit = solve(problem(name), [float(v) for v in told[start]]).fit
    found = (*fit.coefficients, *fit.stderr, fit.sigma)
    wanted = (*told["coefficients"], *told["stderr"], told["sigma"])
    assert min(map(digits, found, wanted)) >= DIGITS.get(name, 10.0)


def table(folder, name):
    lines = [",".join(row) for row in SETS[name]["rows"]]
    (folder / "t.csv").write_text("\n".join(["y,x", *lines]) + "\n")
    return folder / "t.csv"


def test_a_users_own_formula_on_the_command_line(tmp_path):
    told = SETS["Misra1a"]
    path = table(tmp_path, "Misra1a")
    options = ("--response", "y", "--formula", told["model"], "--start", "b1=500,b2=0.0001")
    done = rig("fit", path, *options, "--out", "c.json", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    for i, one in enumerate(found["coefficients"].values()):
        assert digits(one["estimate"], told["coefficients"][i]) >= 10
        assert digits(one["stderr"], told["stderr"][i]) >= 10
        assert one["df"] == 12
    (tmp_path / "use.csv").write_text("y\n44.82\n200\n")
    done = rig("infer", "c.json", "use.csv", "--out", "out.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    first, second = (tmp_path / "out.csv").read_text().splitlines()[1:]
    assert float(first.split(",")[1]) == pytest.approx(378.4, abs=1.0)
    assert "outside the calibrated" in second


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--formula", "a*x", "--start", "a"), "say NAME=VALUE"),
        (("--formula", "a*x", "--start", "b=1"), "has no parameter b"),
        (("--formula", "b1*(1-exp(-b2*x))", "--start", "b1=5,b2=-400"), "no fit was found|not a finite number"),
        (("--formula", "a*b*x", "--start", "a=1,b=1"), "cannot tell apart"),
        (("--formula", "1 + x", "--model", "callendar"), "one model each"),
        (("--model", "callendr"), "there is no model 'callendr'; there are"),
        (("--formula", "1 + x", "--u-x", "0.1"), "--u-x needs --u-y"),
        (("--formula", "1 + x", "--u-y", "0"), "it has to be above zero"),
        (("--formula", "1 + x", "--u-y", "0.1", "--weight", "x"), "give one of them"),
        (("--formula", "1 + x", "--tolerance", "0"), "above zero"),
    ],
)
def test_what_cannot_be_fitted_is_refused(tmp_path, options, message):
    done = rig("fit", table(tmp_path, "Misra1a"), "--response", "y", *options, "--out", "c.json", cwd=tmp_path)
    assert done.returncode == 2, done.stdout
    assert any(part in " ".join(done.stderr.split()) for part in message.split("|")), done.stderr
    assert not (tmp_path / "c.json").exists()


def test_a_formula_that_is_linear_is_the_same_either_way(tmp_path):
    """Arithmetic with named parameters against terms: coefficients, errors, predictions and inferred values."""
    rng = np.random.default_rng(4)
    x = np.linspace(1.0, 9.0, 24)
    y = 2.0 + 3.0 * x + 0.1 * x**2 + rng.normal(0, 0.05, 24)
    (tmp_path / "t.csv").write_text(
        "x,y\n" + "".join(f"{a!r},{b!r}\n" for a, b in zip(x.tolist(), y.tolist(), strict=True))
    )
    read = FileSource(tmp_path / "t.csv").read
    terms = fit_general(read, "y", "1 + x + x^2")
    named = fit_general(read, "y", declared=Declared("a + b*x + c*x^2", start=["a=0", "b=0", "c=1"]))
    for one, other in zip(terms["coefficients"].values(), named["coefficients"].values(), strict=True):
        assert other["estimate"] == pytest.approx(one["estimate"], rel=1e-9)
        assert other["stderr"] == pytest.approx(one["stderr"], rel=1e-9)
    answers = [
        infer_curve(CurveCalibration.from_dict(json.loads(json.dumps(each["calibration"]))), np.array([20.0]))
        for each in (terms, named)
    ]
    assert answers[1].value == pytest.approx(answers[0].value, rel=1e-12)
    assert answers[1].lo95 == pytest.approx(answers[0].lo95, rel=1e-9)


def test_a_gross_error_is_named_and_left_out(tmp_path):
    rng = np.random.default_rng(3)
    x = np.linspace(0.0, 5.0, 30)
    y = 4.0 * np.exp(-0.7 * x) + rng.normal(0, 0.01, 30)
    y[11] += 0.4
    (tmp_path / "t.csv").write_text("x,y\n" + "".join(f"{a},{b}\n" for a, b in zip(x, y, strict=True)))
    read, declared = FileSource(tmp_path / "t.csv").read, Declared("a*exp(-b*x)", start=["a=1,b=1"])
    found = fit_general(read, "y", declared=declared)
    assert found["gross_errors"]["rows"] == [13]
    assert found["gross_errors"]["off"][0] == pytest.approx(0.4, abs=0.04)
    without = fit_general(read, "y", leave_out=["gross"], declared=declared)
    assert without["data"]["rows_left_out"] == [13]
    assert without["coefficients"]["b"]["estimate"] == pytest.approx(
        0.7, abs=4 * without["coefficients"]["b"]["stderr"]
    )


def test_whole_plots_of_a_curve(tmp_path):
    """Variances near the true ones; a straight line is the same either way."""
    rng = np.random.default_rng(9)
    plots, x = np.repeat(np.arange(8), 5), np.tile(np.linspace(0.0, 4.0, 5), 8)
    y = 3.0 * np.exp(-0.5 * x) + rng.normal(0, 0.05, 8)[plots] + rng.normal(0, 0.02, 40)
    lines = [f"{p},{a},{b!r}" for p, a, b in zip(plots, x, y.tolist(), strict=True)]
    (tmp_path / "t.csv").write_text("\n".join(["plot,x,y", *lines]) + "\n")
    read = FileSource(tmp_path / "t.csv").read
    found = fit_general(read, "y", whole_plot=["plot"], declared=Declared("a*exp(-b*x)", start=["a=1,b=1"]))
    assert found["sigma_wholeplot"] == pytest.approx(0.05, rel=0.6)
    assert found["sigma_subplot"] == pytest.approx(0.02, rel=0.4)
    terms = fit_general(read, "y", "1 + x", ["plot"])
    named = fit_general(read, "y", whole_plot=["plot"], declared=Declared("a + b*x", start=["a=1,b=1"]))
    for one, other in zip(terms["coefficients"].values(), named["coefficients"].values(), strict=True):
        assert other["estimate"] == pytest.approx(one["estimate"], rel=1e-8)
        assert other["stderr"] == pytest.approx(one["stderr"], rel=1e-6)


def test_weights_are_those_of_weighted_least_squares(tmp_path):
    """Against the normal equations; integer weights are repeats, but for degrees of freedom."""
    rng = np.random.default_rng(2)
    x, w = np.linspace(1.0, 8.0, 12), np.array([1.0, 4.0] * 6)
    y = 1.0 + 2.0 * x + rng.normal(0, 0.1, 12) / np.sqrt(w)
    lines = [f"{a},{b!r},{c}" for a, b, c in zip(x, y.tolist(), w, strict=True)]
    (tmp_path / "t.csv").write_text("\n".join(["x,y,w", *lines]) + "\n")
    read = FileSource(tmp_path / "t.csv").read
    found = fit_general(read, "y", declared=Declared("1 + x", weight="w"))
    named = fit_general(read, "y", declared=Declared("a + b*x", start=["a=0,b=0"], weight="w"))
    columns = np.column_stack([np.ones(12), x])
    inverse = np.linalg.inv(columns.T @ (w[:, None] * columns))
    b = inverse @ columns.T @ (w * y)
    variance = np.sum(w * (y - columns @ b) ** 2) / 10
    for result in (found, named):
        values = list(result["coefficients"].values())
        assert [v["estimate"] for v in values] == pytest.approx(b, rel=1e-9)
        assert [v["stderr"] for v in values] == pytest.approx(np.sqrt(variance * np.diag(inverse)), rel=1e-9)
        assert any("reading of weight 1" in note for note in result["calibration"]["notes"])


def test_lack_of_fit_is_that_of_the_textbook(tmp_path):
    """A line through repeated settings of a parabola: against the sums of squares of a fit with a mean per setting."""
    rng = np.random.default_rng(5)
    x = np.repeat(np.arange(6.0), 3)
    y = x + 0.08 * x**2 + rng.normal(0, 0.1, 18)
    lines = [f"{a},{b!r}" for a, b in zip(x, y.tolist(), strict=True)]
    (tmp_path / "t.csv").write_text("\n".join(["x,y", *lines]) + "\n")
    found = fit_general(FileSource(tmp_path / "t.csv").read, "y", "1 + x")
    line = least_squares(np.column_stack([np.ones(18), x]), y, ("1", "x")).rss
    pure = float(np.sum((y.reshape(6, 3) - y.reshape(6, 3).mean(axis=1, keepdims=True)) ** 2))
    assert found["lack_of_fit"]["F"] == pytest.approx((line - pure) / 4 / (pure / 12), rel=1e-9)
    assert found["lack_of_fit"]["df"] == [4, 12]
    assert any("lack of fit" in note for note in found["notes"])


def test_a_curve_that_leaves_its_domain_is_refused():
    curve = WrittenCurve.parse("log(x - a)", ["a"])
    x = np.linspace(1.0, 2.0, 9)
    with pytest.raises(FitError, match="not a finite number in row 2"):
        solve(Weighted(curve, {"x": x}, x, np.ones(9)), [1.5])
    with pytest.raises(RankError):
        solve(Weighted(WrittenCurve.parse("a + b + x", ["a", "b"]), {"x": x}, x, np.ones(9)), [1.0, 2.0])


def test_a_formula_is_a_curve():
    formula, x = Formula.parse("1 + x + log(x)"), np.array([1.0, 2.0])
    b = np.array([1.0, 2.0, 3.0])
    assert formula.parameters == ("1", "x", "log(x)")
    np.testing.assert_allclose(formula.value(b, {"x": x}), 1 + 2 * x + 3 * np.log(x), rtol=1e-15)
    np.testing.assert_allclose(formula.slope(b, {"x": x}, "x"), 2 + 3 / x, rtol=1e-15)


def test_stored_curves_are_read_back_or_refused(tmp_path):
    path = table(tmp_path, "Misra1a")
    declared = Declared(SETS["Misra1a"]["model"], start=["b1=250,b2=0.0005"])
    kept = json.loads(json.dumps(fit_general(FileSource(path).read, "y", declared=declared)["calibration"]))
    assert CurveCalibration.from_dict(kept).to_dict().items() <= kept.items()
    for change, message in (
        ({"parameters": ["b1", "c"]}, "no parameter c"),
        ({"formula": "b1*("}, "missing"),
        ({"model": {"name": "none", "variable": "x", "abscissa": [1, 0], "response": [1, 0]}}, "no model"),
        ({"reading": -1.0}, "garbles reading"),
    ):
        with pytest.raises(FitError, match=message):
            CurveCalibration.from_dict({**kept, **change})


def test_an_unknown_response_is_named(tmp_path):
    with pytest.raises(UsageError, match="there is no column 'z'"):
        fit_general(FileSource(table(tmp_path, "Misra1a")).read, "z", declared=Declared("a*x", start=["a=1"]))
