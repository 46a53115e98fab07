"""Errors in the abscissa: the nearest point of all branches, and the lowest of several minima."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from abscissa_examples import CUBIC_X, CUBIC_Y, SCIPY_X, SCIPY_Y

from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.fitter.nonlinear import Distance, WrittenCurve, solve, solve_lowest
from rig.fitter.nonlinear.curve import Each
from rig.procedures.general.declared import Declared
from rig.procedures.general.fit import fit_general
from rig.procedures.general.models.named import NamedCurve, standard_models
from rig.procedures.general.rows import CurveRows
from rig.tables import FileSource

CUBIC = Formula.parse("1 + x + x^3")
SINE = WrittenCurve.parse("a*sin(w*x) + c", ["a", "w", "c"])
PEAK = WrittenCurve.parse("a*exp(-((x - m)/w)^2)", ["a", "m", "w"])
LOGARITHM = WrittenCurve.parse("a + b*log(x)", ["a", "b"])
# curve, true parameters, range of the abscissa
KINDS = {
    "cubic": (CUBIC, (-1.0, 7.5, -4.2), (-5.0, 5.0)),
    "quintic": (Formula.parse("1 + x + x^3 + x^5"), (0.0, 4.0, -5.0, 1.0), (-2.0, 2.0)),
    "sine": (SINE, (3.0, 2.0, 1.0), (0.0, 6.0)),
    "peak": (PEAK, (8.0, 2.0, 0.8), (-1.0, 5.0)),
    "logarithm": (LOGARITHM, (1.0, 3.0), (0.3, 5.0)),
}


def fitted(folder, x, y, u_x, u_y):
    np.savetxt(folder / "t.csv", np.column_stack([x, y]), delimiter=",", header="x,y", comments="")
    declared = Declared("1 + x + x^3", u_x=u_x, u_y=u_y)
    return fit_general(FileSource(folder / "t.csv").read, "y", declared=declared)


def test_a_cubic_is_not_left_in_a_local_minimum(tmp_path):
    """SciPy's ODRPACK: 7.52 (54), -4.19 (21), chi-squared 33.1. The search from least squares alone ended at 192."""
    found = fitted(tmp_path, CUBIC_X, CUBIC_Y, "0.3", "0.5")
    _, one, three = found["coefficients"].values()
    assert (round(one["estimate"], 2), round(one["stderr"], 2)) == (7.52, 0.54)
    assert (round(three["estimate"], 2), round(three["stderr"], 2)) == (-4.19, 0.21)
    assert round(found["chi_squared"]["value"], 1) == 33.1


def test_a_cubic_that_had_no_solution_from_least_squares(tmp_path):
    """ODRPACK, the best of four starts: -2.564 (482), 6.971 (657), -4.114 (146), chi-squared 100.04."""
    found = fitted(tmp_path, SCIPY_X, SCIPY_Y, "0.3", "2")
    told = [(round(c["estimate"], 3), round(c["stderr"], 3)) for c in found["coefficients"].values()]
    assert told == [(-2.564, 0.482), (6.971, 0.657), (-4.114, 0.146)]
    assert round(found["chi_squared"]["value"], 2) == 100.04


def test_chi_squared_above_its_limit_says_that_another_minimum_is_possible(tmp_path):
    found = fitted(tmp_path, CUBIC_X, CUBIC_Y, "0.1", "0.2")
    assert any("lower minimum is possible" in note for note in found["calibration"]["notes"])


def table_of(kind, seed):
    """A random table of a kind: curve, true parameters, and the problem."""
    curve, true, (low, high) = KINDS[kind]
    rng = np.random.default_rng([seed, sorted(KINDS).index(kind)])
    n, b = int(rng.integers(10, 40)), np.array(true)
    true_x = np.sort(rng.uniform(low, high, n))
    true_y = curve.value(b, {"x": true_x})
    u_x, u_y = rng.choice([0.005, 0.02]) * (high - low), rng.choice([0.01, 0.05]) * np.std(true_y)
    x, y = np.maximum(true_x + rng.normal(0, u_x, n), 0.01 if low > 0.0 else -np.inf), true_y + rng.normal(0, u_y, n)
    return b, Distance(curve, {"x": x}, "x", y, np.full(n, u_x), np.full(n, u_y)), rng


@pytest.mark.parametrize("kind", KINDS)
def test_each_row_has_the_nearest_point_of_all_branches(kind):
    """Against 40,001 points of the curve: none is nearer, also with parameters that are far off."""
    for seed in range(3):
        b, problem, rng = table_of(kind, seed)
        b = b * rng.uniform(0.5, 1.5, b.size)
        x, reach = problem.table["x"], 6.0 * np.ptp(problem.table["x"])
        points = x.mean() + np.linspace(-reach, reach, 40001)
        points = points[points > 0.0] if kind == "logarithm" else points
        curve = problem.curve.value(b, {"x": points})
        for row, found in enumerate(np.abs(problem.residuals(b)).tolist()):
            there = np.hypot((points - x[row]) / problem.u_x[row], (curve - problem.y[row]) / problem.u_y[row])
            assert found <= there.min() * (1.0 + 1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_no_start_of_odrpack_ends_lower(kind):
    """SciPy's copy of ODRPACK (it goes in SciPy 1.19) from seven starts; chi-squared within rounding or lower."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        odr = pytest.importorskip("scipy.odr")
        for seed in range(3):
            b, problem, rng = table_of(kind, seed)
            x, y, u_x, u_y = problem.table["x"], problem.y, problem.u_x, problem.u_y
            model = odr.Model(lambda at, xi, curve=problem.curve: curve.value(np.asarray(at), {"x": xi}))
            squares = []
            for factor in [np.ones(b.size), *rng.uniform(0.5, 1.5, (6, b.size))]:
                try:
                    told = odr.ODR(odr.RealData(x, y, sx=u_x, sy=u_y), model, b * factor, maxit=400).run()
                except FitError:
                    continue
                squares.append(np.sum((told.delta / u_x) ** 2) + np.sum((told.eps / u_y) ** 2))
            assert squares
            start = b * rng.uniform(0.8, 1.25, b.size)
            assert solve_lowest(problem, start).fit.rss <= min(squares) * (1.0 + 1e-7)


def test_the_lowest_is_a_minimum_and_the_same_at_every_call():
    _, problem, _ = table_of("sine", 0)
    start = np.array([2.0, 1.5, 0.0])
    one, other = solve_lowest(problem, start), solve_lowest(problem, start)
    assert one.fit.coefficients.tolist() == other.fit.coefficients.tolist()
    again = solve(problem, one.fit.coefficients)
    assert again.fit.rss == pytest.approx(one.fit.rss, rel=1e-9)


def test_gross_errors_do_not_make_the_curve_steep_everywhere():
    """A cubic that is steep everywhere is near to every row, and to two gross errors: its sum of distances is less."""
    b, problem, rng = table_of("cubic", 3)
    y = problem.y.copy()
    y[[5, 20]] += np.array([-1000.0, 1000.0]) * np.std(y)
    rows = CurveRows(replace(problem, y=y, known={}), b * rng.uniform(0.9, 1.1, b.size), None, None)
    assert rows.gross().rows.tolist() == [5, 20]


@pytest.mark.parametrize("name", standard_models())
def test_curves_take_parameters_of_each_row(name):
    """As the search from several starts at once needs them; against one set at a time."""
    model = standard_models()[name]
    low, high = model.valid if np.isfinite(model.valid).all() else (1.0, 10.0)
    x = np.linspace(low, high, 7)
    curve = NamedCurve(model, "x")
    b = np.outer([1.0, 1.01], np.arange(1, len(curve.parameters) + 1) * 1e-3)
    each = Each(curve, np.repeat(b, 7, axis=0), {"x": np.tile(x, 2)})
    one = [Each(curve, row, {"x": x}) for row in b]
    for got, want in (
        (each.value(), [o.value() for o in one]),
        (each.slope("x"), [o.slope("x") for o in one]),
        (each.rows(), [o.rows() for o in one]),
    ):
        np.testing.assert_allclose(got, np.concatenate(want), rtol=1e-13)
