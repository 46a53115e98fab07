"""The formula grammar against patsy, an implementation by others; what differs on purpose is written out."""

import numpy as np
import patsy
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fitter.errors import FitError
from fitter.formula import Formula, FormulaError

_RNG = np.random.default_rng(5)
TABLE = {
    "P": _RNG.uniform(0.01, 5.0, 36),
    "T": _RNG.uniform(-130.0, -50.0, 36),
    "x": _RNG.normal(size=36),
    "b": np.tile([1, 2, 3], 12),
    "c": np.repeat(["u", "v"], 18),
}

atoms = st.sampled_from(["P", "T", "x", "C(b)", "C(c)", "log(P)", "I(P / (P + 0.1))", "I(x - -T)"])
numbers = st.sampled_from(["P", "T", "x", "log(P)"])


def formulas(leaf):
    def grow(inner):
        return st.one_of(
            st.tuples(inner, st.sampled_from(["+", "-", ":", "*"]), inner).map(lambda t: f"({t[0]} {t[1]} {t[2]})"),
            st.tuples(inner, st.integers(1, 3)).map(lambda t: f"(x + {t[0]} + T)^{t[1]}"),
        )

    tree = st.recursive(leaf, grow, max_leaves=5)
    return st.tuples(st.sampled_from(["", "1 + ", "0 + "]), tree, st.sampled_from(["", " - 1", " + 0"])).map("".join)


def theirs(text):
    assume(Formula.parse(text).names)  # patsy cannot count the rows of a constant
    spelled = text.replace("^", "**").replace("log(", "np.log(")
    return np.asarray(patsy.dmatrix(spelled, TABLE))


def span(columns):
    """Projection onto the columns, scaled so that their lengths do not matter."""
    length = np.linalg.norm(columns, axis=0)
    u, s, _ = np.linalg.svd(columns / np.where(length > 0, length, 1.0), full_matrices=False)
    u = u[:, s > 1e-9 * max(s.max(initial=0.0), 1.0)]
    return u @ u.T


@settings(max_examples=150, deadline=None)
@given(formulas(numbers))
def test_numeric_terms_are_patsys(text):
    ours = Formula.parse(text).columns(TABLE)[1]
    expected = theirs(text)
    assert ours.shape == expected.shape
    by_value = [np.lexsort(np.round(m / np.abs(m).max(axis=0), 9)) for m in (ours, expected)]
    np.testing.assert_allclose(ours[:, by_value[0]], expected[:, by_value[1]], rtol=1e-12)


@settings(max_examples=150, deadline=None)
@given(formulas(atoms))
def test_categories_span_what_patsys_span(text):
    ours = Formula.parse(text).columns(TABLE)[1]
    expected = theirs(text)
    assert ours.shape == expected.shape
    np.testing.assert_allclose(span(ours), span(expected), atol=1e-7)


@settings(max_examples=100, deadline=None)
@given(formulas(atoms))
def test_a_formula_reads_back_as_written(text):
    formula = Formula.parse(text)
    again = Formula.parse(str(formula))
    assert again == formula
    np.testing.assert_array_equal(again.columns(TABLE)[1], formula.columns(TABLE)[1])


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("P + P^2", ("1", "P", "P^2")),
        ("I(P^2) + (P)^2 + I(P * P)", ("1", "P^2", "I(P * P)")),
        ("P^2:T - 1", ("P^2:T",)),
        ("(P + T)^2 + T^2", ("1", "P", "T", "T^2", "P:T")),
        ("T:P + P:T", ("1", "T:P")),
        ("log(P)^2 + I(-P^2)", ("1", "log(P)^2", "I(-P^2)")),
        ("C(c):P + P", ("1", "P", "C(c)[v]:P")),
        ("0 + C(b)", ("C(b)[1]", "C(b)[2]", "C(b)[3]")),
        ("I(P ^ -2 / (1 - .5e1))", ("1", "I(P^(-2) / (1 - 5))")),
    ],
)
def test_names_of_columns(text, names):
    assert Formula.parse(text).columns(TABLE)[0] == names


def test_arithmetic_is_arithmetic():
    """Precedence as everywhere: powers from the right and above the sign, quotients from the left."""
    P, T = TABLE["P"], TABLE["T"]
    text = "0 + I(-P^2 + 2^3^2 * T / 3 / P - log(P + 1) * (T - -1)) + P^3"
    expected = np.column_stack([-(P**2) + 2.0**9 * T / 3 / P - np.log(P + 1) * (T + 1), P**3])
    columns = Formula.parse(text).columns(TABLE)[1]
    np.testing.assert_allclose(columns[:, np.argsort(np.abs(columns[0]))[::-1]], expected, rtol=1e-13)


def test_derivative_is_exact():
    P, T = TABLE["P"], TABLE["T"]
    formula = Formula.parse("T + P + P^3 + P:T + log(P):T + I(P / (P + 0.1))")
    expected = [0 * P, 0 * P, 1 + 0 * P, 3 * P**2, 0.1 / (P + 0.1) ** 2, T, T / P]
    np.testing.assert_allclose(formula.derivative(TABLE, "P"), np.column_stack(expected), rtol=1e-13)


def test_levels_of_one_table_serve_another():
    formula = Formula.parse("C(b)")
    levels = formula.levels(TABLE)
    few = {"b": np.array([3, 3])}
    np.testing.assert_array_equal(formula.columns(few, levels)[1], [[1, 0, 1], [1, 0, 1]])
    with pytest.raises(ValueError, match=r"C\(b\) is 4 in row 3, a level the model has not"):
        formula.columns({"b": np.array([3, 4])}, levels)


@pytest.mark.parametrize(
    ("text", "problem", "at"),
    [
        ("", "empty", 0),
        ("1 + ", "missing at the end", 3),
        ("P + tan(P)", r"no function tan, only C\(\), I\(\), log\(\), exp\(\).*write I\(sin\(x\) / cos\(x\)\)", 4),
        ("I(P + open(P))", "no function open here", 6),
        ("y ~ P", "response is given by itself", 2),
        ("P / T", r"division goes inside I\(\)", 2),
        ("P^1.5", "a power is a whole number from 1 to 20", 2),
        ("P^21", "a power is a whole number from 1 to 20", 2),
        ("C(b)^2", "is a category and has no powers", 5),
        ("2*P", r"numbers other than 0 and 1 go inside I\(\)", 0),
        ("(0 + P)", "outside parentheses", 1),
        ("(P + T", "closing parenthesis is missing", 6),
        ("P)", r"'\)' is not expected", 1),
        ("I(3)", "there is no variable", 0),
        ("P.__class__ @ T", "'@' is not expected", 12),
        ("P T", "'T' is not expected", 2),
        ("(" * 60 + "P" + ")" * 60, "nested more than 40 deep", 41),
        ("+".join(f"a{i}" for i in range(500)), "more than 400 terms", None),
        ("(a+b+c+d+e+f+g+h+i+j+k+l)^9", "more than 400 terms", None),
    ],
)
def test_a_bad_formula_is_pointed_at(text, problem, at):
    with pytest.raises(FormulaError, match=problem) as caught:
        Formula.parse(text)
    if at is not None:
        pointer = str(caught.value).splitlines()[-1]
        assert pointer == "  " + " " * at + "^"


@pytest.mark.parametrize(
    ("text", "error", "problem"),
    [
        ("Q", FitError, "no variable Q, only P, T"),
        ("C(Q)", FitError, "no variable Q"),
        ("c", ValueError, r"c is text; as a category it is C\(c\)"),
        ("log(T)", ValueError, r"log\(T\) is not a finite number in row 2, where T = -"),
        ("I(1 / (b - 2))", ValueError, "in row 3, where b = 2"),
    ],
)
def test_what_cannot_be_worked_out(text, error, problem):
    with pytest.raises(error, match=problem):
        Formula.parse(text).columns(TABLE)
