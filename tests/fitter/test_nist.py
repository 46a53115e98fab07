"""Least squares against NIST's certified values, and twice-long arithmetic against exact fractions."""

from __future__ import annotations

import json
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from command import rig
from hypothesis import given
from hypothesis import strategies as st
from nist import PROBLEMS, digits

from rig.fitter import Triangle, least_squares
from rig.fitter.all_digits import refine
from rig.fitter.arithmetic_text import parse_expression
from rig.fitter.double_double import DoubleDouble
from rig.fitter.formula import Formula
from rig.fitter.linear import CONDITION
from rig.procedures.general.fit import fit_general
from rig.tables import FileSource

EVERY = pytest.mark.parametrize("problem", PROBLEMS.values(), ids=PROBLEMS.keys())


def exact_fit(terms, y):
    """Coefficients, diagonal of the inverse of the normal equations and residual sum of squares, in fractions."""
    k = len(terms)
    products = [[sum(a * b for a, b in zip(u, v, strict=True)) for v in (*terms, y)] for u in terms]
    matrix = [[*row, *(Fraction(i == j) for j in range(k))] for i, row in enumerate(products)]
    for i in range(k):
        matrix[i] = [value / matrix[i][i] for value in matrix[i]]
        for j in range(k):
            if j != i:
                matrix[j] = [b - matrix[j][i] * a for a, b in zip(matrix[i], matrix[j], strict=True)]
    coefficients = [row[k] for row in matrix]
    fitted = [sum(c * t for c, t in zip(coefficients, row, strict=True)) for row in zip(*terms, strict=True)]
    rss = sum((value - f) ** 2 for value, f in zip(y, fitted, strict=True))
    return coefficients, [matrix[i][k + 1 + i] for i in range(k)], rss


def published(value: Fraction, like: str, *, root: bool = False) -> str:
    """An exact value, or its root, rounded to the digits and exponent that a certified value has."""
    with localcontext() as context:
        context.prec = 40
        number = Decimal(value.numerator) / Decimal(value.denominator)
        number = number.sqrt() if root else number
        return str(number.quantize(Decimal(like)))


@EVERY
def test_certified_values_are_those_of_exact_arithmetic(problem):
    """To every published digit: the data and the values are copied right, and the formula is the model meant."""
    y = [row[problem.names.index("y")] for row in problem.rows]
    coefficients, inverse, rss = exact_fit(problem.terms(), y)
    variance = rss / (len(y) - len(coefficients))
    for found, certified in zip(coefficients, problem.coefficients, strict=True):
        assert Decimal(published(found, certified)) == Decimal(certified)
    for found, certified in zip(inverse, problem.stderr, strict=True):
        assert Decimal(published(found * variance, certified, root=True)) == Decimal(certified)
    assert Decimal(published(variance, problem.sigma, root=True)) == Decimal(problem.sigma)


def certain(problem, coefficients, stderr, sigma):
    """Fewest digits that are right, over coefficients, over standard errors, of the residual standard deviation."""
    return (
        min(map(digits, coefficients, problem.coefficients)),
        min(map(digits, stderr, problem.stderr)),
        digits(sigma, problem.sigma),
    )


@EVERY
def test_a_fit_has_the_certified_digits(problem):
    names, columns = Formula.parse(problem.model).exact_columns(problem.columns)
    y = problem.columns["y"]
    fit = least_squares(columns.hi, y, names, tails=columns.lo)
    wanted = 13.0 if fit.condition >= CONDITION else 11.0
    assert min(certain(problem, fit.coefficients, fit.stderr, fit.sigma)) >= wanted
    assert fit.df == len(y) - len(names)


@EVERY
def test_so_has_the_users_fit_of_a_table(problem, tmp_path):
    path = problem.write_csv(tmp_path / "table.csv")
    found = fit_general(FileSource(path).read, "y", problem.model)
    values = found["coefficients"].values()
    estimates, errors = [v["estimate"] for v in values], [v["stderr"] for v in values]
    assert min(certain(problem, estimates, errors, found["sigma_E"])) >= 11.0


def test_filip_on_the_command_line(tmp_path):
    filip = PROBLEMS["Filip"]
    path = filip.write_csv(tmp_path / "filip.csv")
    done = rig("fit", path, "--response", "y", "--formula", filip.model, "--json")
    values = json.loads(done.stdout)["coefficients"].values()
    assert min(map(digits, (v["estimate"] for v in values), filip.coefficients)) >= 13.0


def test_what_refinement_and_exact_powers_are_for():
    """Wampler's fifth loses nine digits without, Filip's six even so if the columns are rounded to doubles."""
    wampler, filip = PROBLEMS["Wampler5"], PROBLEMS["Filip"]
    names, columns = Formula.parse(wampler.model).columns(wampler.columns)
    plain = Triangle(names).add(columns, wampler.columns["y"]).solve()
    assert min(map(digits, plain.coefficients, wampler.coefficients)) < 8.0
    names, rounded = Formula.parse(filip.model).columns(filip.columns)
    fit = least_squares(rounded, filip.columns["y"], names)
    exact, _, _ = exact_fit([[Fraction(v) for v in c] for c in rounded.T], [Fraction(v) for v in filip.columns["y"]])
    assert min(map(digits, fit.coefficients, filip.coefficients)) < 8.0
    # which is no fault of the fit: it solves the rounded columns' problem
    np.testing.assert_allclose(fit.coefficients, [float(c) for c in exact], rtol=1e-14)


@pytest.mark.parametrize(("degree", "condition"), [(12, 1e8), (18, 1e13)])
def test_polynomials_of_high_degree_are_those_of_exact_fractions(degree, condition):
    """Over 0 to 1; columns pass for dependent from a condition of 1e14 on. Leverages too, which cancel most."""
    x = np.arange(1, 61) / 64
    y = np.cos(7 * x) + 1e-3 * np.random.default_rng(1).normal(size=60)
    names, columns = Formula.parse(" + ".join(f"x^{i}" for i in range(1, degree + 1))).exact_columns({"x": x})
    fit = least_squares(columns.hi, y, names, tails=columns.lo)
    assert fit.condition > condition
    powers = [[Fraction(v) ** i for v in x] for i in range(degree + 1)]
    coefficients, inverse, rss = exact_fit(powers, [Fraction(v) for v in y])
    np.testing.assert_allclose(fit.coefficients, [float(c) for c in coefficients], rtol=4e-16)
    np.testing.assert_allclose(np.sum(fit.root**2, axis=1), [float(v) for v in inverse], rtol=1e-13)
    assert fit.rss == pytest.approx(float(rss), rel=1e-14)
    assert fit.variance_function(columns.hi).sum() == pytest.approx(degree + 1, rel=1e-2)


def test_more_rows_than_are_worth_it_are_left_as_they_are(monkeypatch):
    wampler = PROBLEMS["Wampler5"]
    names, columns = Formula.parse(wampler.model).columns(wampler.columns)
    monkeypatch.setattr("rig.fitter.linear.AFFORDABLE", columns.size)
    fit = least_squares(columns, wampler.columns["y"], names)
    plain = Triangle(names).add(columns, wampler.columns["y"]).solve()
    np.testing.assert_array_equal(fit.coefficients, plain.coefficients)


@pytest.mark.parametrize("scale", [2.0**450, 2.0**-450])
def test_the_unit_of_a_column_does_not_matter(scale):
    """A power of two changes no digit of anything."""
    filip = PROBLEMS["Filip"]
    names, columns = Formula.parse(filip.model).exact_columns(filip.columns)
    plain = least_squares(columns.hi, filip.columns["y"], names, tails=columns.lo)
    scaled = least_squares(scale * columns.hi, filip.columns["y"], names, tails=scale * columns.lo)
    np.testing.assert_allclose(scaled.coefficients * scale, plain.coefficients, rtol=1e-14)
    np.testing.assert_allclose(scaled.stderr * scale, plain.stderr, rtol=1e-13)


def test_what_cannot_be_refined_is_left_as_it_is():
    """Columns beyond 1e300 overflow in twice-long products."""
    x = np.linspace(1.0, 1.01, 20)
    columns = np.column_stack([np.ones(20), x])
    root = least_squares(columns, x, ["1", "x"]).root
    assert refine(1e302 * columns, None, x, root / 1e302) is None
    assert refine(columns, None, x, root) is not None


numbers = st.floats(min_value=1e-100, max_value=1e100).flatmap(lambda v: st.sampled_from([v, -v]))


def value(number: DoubleDouble) -> Fraction:
    return Fraction(float(number.hi)) + Fraction(float(number.lo))


def near(found: DoubleDouble, exact: Fraction, bits: int = 100) -> bool:
    return abs(value(found) - exact) <= abs(exact) / 2**bits


@given(numbers, numbers)
def test_sums_and_products_of_doubles_are_exact(a, b):
    assert value(DoubleDouble.of(a) + b) == Fraction(a) + Fraction(b)
    assert value(DoubleDouble.of(a) * b) == Fraction(a) * Fraction(b)


@given(numbers, numbers, numbers, numbers)
def test_arithmetic_has_thirty_digits(a, b, c, d):
    left, right = DoubleDouble.of(a) * b, DoubleDouble.of(c) * d
    x, y = Fraction(a) * Fraction(b), Fraction(c) * Fraction(d)
    if abs(left.hi) < 1e140 and abs(right.hi) < 1e140 and min(abs(left.hi), abs(right.hi)) > 1e-120:
        assert near(left * right, x * y)
        assert near(left / right, x / y)
    assert abs(value(left + right) - (x + y)) <= (abs(x) + abs(y)) / 2**100
    assert abs(value(left - right) - (x - y)) <= (abs(x) + abs(y)) / 2**100


@given(st.floats(0.1, 10.0), st.integers(-20, 20))
def test_powers(a, exponent):
    with np.errstate(all="raise"):
        assert near(np.power(DoubleDouble.of(a), exponent), Fraction(a) ** exponent, bits=96)


def test_numpys_functions_take_it():
    x = DoubleDouble.of([0.1, 0.2, 0.7])
    assert isinstance(np.ones(3) * x, DoubleDouble)
    third = value(np.divide(1.0, DoubleDouble.of(3.0)))
    assert abs(third - Fraction(1, 3)) < Fraction(1, 2**104)
    assert value(x.sum()) == sum(Fraction(v) for v in (0.1, 0.2, 0.7))
    np.testing.assert_array_equal(np.log(x).hi, np.log([0.1, 0.2, 0.7]))
    np.testing.assert_array_equal(np.power(x, 0.5).hi, np.power([0.1, 0.2, 0.7], 0.5))
    with pytest.raises(TypeError):
        np.add(x, 1.0, out=np.zeros(3))


def test_functions_are_those_of_doubles():
    table = {"x": DoubleDouble.of([1.0, 1.0, -1.0]) + np.array([2.0**-80, 0.0, -(2.0**-80)]), "y": DoubleDouble.of(1.0)}
    expected = {
        "x > y": [1, 0, 0],  # of what a double cannot tell apart: the difference has all digits
        "x <= y": [0, 1, 1],
        "x == y": [0, 1, 0],
        "x != y": [1, 0, 1],
        "sign(x - y)": [1, 0, -1],
        "max(x, y)": [1, 1, 1],
        "(min(x, y) - y) * (x > 0)": [0, 0, 0],
        "abs(x)": [1, 1, 1],
        "exp(x)": np.exp([1.0, 1.0, -1.0]),
        "x^0.5": [1, 1, np.nan],
    }
    for text, values in expected.items():
        found = parse_expression(text).value(table)
        np.testing.assert_array_equal(found.hi, values)
        assert not found.lo.any()


def test_exact_columns_of_functions_are_the_columns_with_more_digits():
    """Also where there are none to add: at zero, above what a double holds, and far round the circle."""
    text = "x + exp(x) + sqrt(x) + sin(x) + cos(x) + log(y) + abs(z) + sign(z) + max(x, y) + I(x > 1) + I(x^0.3)"
    x = np.array([0.0, 1.0, 709.0, 70.0, 0.3])
    table = {"x": x, "y": np.array([1e-310, 1e305, 1.0, 2.0, 3.0]), "z": np.array([-1e-100, 1e120, 3e99, -2.0, 1e-5])}
    formula = Formula.parse(f"{text} + I(z^-2) + sin(w)")
    table["w"] = np.array([0.0, 1e8, 1e15, 1e22, -3e300])
    names, exact = formula.exact_columns(table)
    assert (names, exact.hi.shape) == (formula.columns(table)[0], (5, 14))
    np.testing.assert_allclose(exact.hi, formula.columns(table)[1], rtol=4e-15)
    assert np.all(np.abs(exact.lo) <= 2.0**-52 * np.abs(exact.hi))


def test_columns_beyond_the_reach_of_split_products_keep_their_rounded_values():
    names, columns = Formula.parse("0 + x + x^2").exact_columns({"x": np.array([1e152, 3.0])})
    assert names == ("x", "x^2")
    np.testing.assert_array_equal(columns.hi[:, 1], [1e152**2, 9.0])
    assert columns.lo[0, 1] == 0.0
