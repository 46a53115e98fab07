"""The formula grammar against patsy, an implementation by others; what differs on purpose is written out."""

import re

import numpy as np
import patsy
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rig.fitter.arithmetic_text import FormulaError, parse_expression
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula

_RNG = np.random.default_rng(5)
TABLE = {
    "P": _RNG.uniform(0.01, 5.0, 36),
    "T": _RNG.uniform(-130.0, -50.0, 36),
    "x": _RNG.normal(size=36),
    "b": np.tile([1, 2, 3], 12),
    "c": np.repeat(["u", "v"], 18),
    "Load cell (kN)": _RNG.uniform(1.0, 2.0, 36),
}
LOAD = "`Load cell (kN)`"

atoms = st.sampled_from(["P", "T", "x", "C(b)", "C(c)", "log(P)", "I(P / (P + 0.1))", "I(x - -T)", LOAD])
numbers = st.sampled_from(
    [
        "P",
        "T",
        "x",
        "log(P)",
        LOAD,
        "exp(x)",
        "abs(x)",
        "sqrt(P)",
        "sin(2*T)",
        "I(2 * (x > P) - cos(x)**2)",
        "max(x, P)",
    ]
)


def formulas(leaf):
    def grow(inner):
        return st.one_of(
            st.tuples(inner, st.sampled_from(["+", "-", ":", "*"]), inner).map(lambda t: f"({t[0]} {t[1]} {t[2]})"),
            st.tuples(inner, st.integers(1, 3)).map(lambda t: f"(x + {t[0]} + T)^{t[1]}"),
        )

    tree = st.recursive(leaf, grow, max_leaves=5)
    return st.tuples(st.sampled_from(["", "1 + ", "0 + "]), tree, st.sampled_from(["", " - 1", " + 0"])).map("".join)


_NUMPY = {"min": "minimum", "max": "maximum"}


def theirs(text):
    assume(Formula.parse(text).names)  # patsy cannot count the rows of a constant
    spelled = re.sub(r"\b(log|exp|sqrt|abs|sin|cos|max)(?=\()", lambda m: f"np.{_NUMPY.get(m[0], m[0])}", text)
    spelled = re.sub("`(.*?)`", r"Q('\1')", spelled.replace("^", "**"))
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
        ("I(P**1.5) + P**2 + I(P^1) + I(x^21)", ("1", "I(P^1.5)", "P^2", "I(P^1)", "I(x^21)")),
        (f"I({LOAD}) + {LOAD}^2 + `P`", ("1", LOAD, f"{LOAD}^2", "P")),
        ("max(x,P)**3:I((x>=P)*2) + I((x>P)>(P!=1))", ("1", "I((x > P) > (P != 1))", "max(x, P)^3:I((x >= P) * 2)")),
        ("0 + C(`b`)", ("C(b)[1]", "C(b)[2]", "C(b)[3]")),
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


leaves = st.sampled_from(["x", "P", "T", "`Load cell (kN)`", "2", "0.5", "1e-3"])


def _grown(inner):
    one = st.sampled_from(["log", "exp", "sqrt", "abs", "sign", "sin", "cos", "-"])
    marks = st.sampled_from(["<", "<=", ">", ">=", "==", "!="])
    return st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/", "**", "^"]), inner).map(lambda t: f"({' '.join(t)})"),
        st.tuples(leaves, marks, leaves).map(lambda t: f"(1.0 * ({' '.join(t)}))"),
        st.tuples(one, inner).map(lambda t: f"({t[0]}({t[1]}))"),
        st.tuples(st.sampled_from(["min", "max"]), inner, inner).map(lambda t: f"{t[0]}({t[1]}, {t[2]})"),
    )


arithmetic = st.recursive(leaves, _grown, max_leaves=8)


@settings(max_examples=200, deadline=None)
@given(arithmetic)
def test_arithmetic_is_pythons_with_numpys_functions(text):
    """Python's own parser and NumPy are the oracle; what NumPy finds undefined is undefined."""
    spelled = re.sub(r"\b(log|exp|sqrt|abs|sign|sin|cos|min|max)\(", lambda m: f"np.{_NUMPY.get(m[1], m[1])}(", text)
    spelled = spelled.replace("^", "**").replace("`Load cell (kN)`", "L")
    spelled = re.sub(r"(?<![\w.])(2|0\.5|1e-3)(?![\w.])", r"np.float64(\1)", spelled)
    with np.errstate(all="ignore"):
        expected = eval(spelled, {"np": np, "L": TABLE["Load cell (kN)"], **TABLE})
    found = parse_expression(text).value(TABLE)
    np.testing.assert_allclose(found, expected, rtol=1e-13)


@settings(max_examples=200, deadline=None)
@given(arithmetic)
def test_arithmetic_reads_back_as_written(text):
    expression = parse_expression(text)
    assert parse_expression(str(expression)) == expression


@pytest.mark.parametrize(
    "text", ["log(T) > 0", "log(T) != log(T)", "max(log(T), x)", "min(x, sqrt(T))", "sign(log(T))"]
)
def test_what_is_undefined_stays_so(text):
    assert np.isnan(parse_expression(text).value(TABLE)).all()
    assert np.isnan(parse_expression(text).value({**TABLE, "T": TABLE["T"] + 1e-30j})).all()


@pytest.mark.parametrize(
    "text",
    [
        "exp(x)",
        "sqrt(P)",
        "abs(x)",
        "abs(-T * x)",
        "sign(x):P",
        "sin(3*x)^2",
        "cos(x):x",
        "max(x, P)",
        "min(x^2, P):x",
        "I((x > 0) * x^2 + (x <= 0.3) * (P != x))",
        "I(T^3)",
        "I((T + x)^101 / 1e200)",
        "I(P^x)",
        "I(2^x)",
        "I(abs(x)^(P * x))",
        "max(abs(x), min(sqrt(P), 1))",
    ],
)
@pytest.mark.parametrize("name", ["x", "P", "T"])
def test_derivative_is_that_of_finite_differences(text, name):
    formula, step = Formula.parse(f"0 + {text}"), 1e-6
    above, below = (formula.columns({**TABLE, name: TABLE[name] + s})[1] for s in (step, -step))
    size = np.abs(above).max()
    np.testing.assert_allclose(
        formula.derivative(TABLE, name), (above - below) / (2 * step), rtol=1e-5, atol=1e-8 * size
    )


def test_at_a_kink_the_derivative_is_the_one_to_the_right():
    zero = {"x": np.zeros(1)}
    for text, slope in (("abs(x)", 1), ("abs(-x)", 1), ("max(x, -x)", 1), ("min(x, -x)", -1), ("I(x * (x >= 0))", 1)):
        assert Formula.parse(f"0 + {text}").derivative(zero, "x") == slope


def test_levels_of_one_table_serve_another():
    formula = Formula.parse("C(b)")
    levels = formula.levels(TABLE)
    few = {"b": np.array([3, 3])}
    np.testing.assert_array_equal(formula.columns(few, levels)[1], [[1, 0, 1], [1, 0, 1]])
    with pytest.raises(ValueError, match=r"C\(b\) is 4 in row 3, a level that the model does not have"):
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
        ("P T", "'T' is not expected here; a name of several words needs back-ticks", 2),
        ("P > T", r"comparisons go inside I\(\)", 2),
        ("I(P = T)", "equality is written ==", 4),
        ("I(1 < P < T)", r"multiply them: \(a < b\) \* \(b < c\)", 8),
        ("I(P > > T)", "'>' is not expected", 6),
        ("P + max(P)", r"max\(\) takes two values, not 1", 4),
        ("I(sin(P, T))", r"sin\(\) takes one value, not 2", 2),
        ("sin()", r"'\)' is not expected", 4),
        ("P + `Load", "the back-tick that ends the name is missing", 4),
        ("`sin`(P)", r"'\(' is not expected", 5),
        ("`I`:`0`:`(`:`1` + ``", "the back-tick that ends the name is missing", 18),
        ("P + ln(P)", r"the natural logarithm is log\(\)", 4),
        ("P + exp(2)", "there is no variable in it", 4),
        ("I(P + 1e999)", "the number is too large", 6),
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


def test_names_in_back_ticks_are_any_names():
    table = {name: _RNG.normal(size=5) for name in ("I", "0", "(", "a`b", "log", "\n")}
    formula = Formula.parse("0 + `I` + `0`:`(` + `a``b` + `log`^2 + log:I(`\n` + 1)")
    assert Formula.parse(str(formula)) == formula
    assert formula.names == ("I", "a`b", "log", "0", "(", "\n")
    i, a, log, zero, opened, line = (table[name] for name in ("I", "a`b", "log", "0", "(", "\n"))
    expected = np.column_stack([i, a, log**2, zero * opened, log * (line + 1)])
    np.testing.assert_allclose(formula.columns(table)[1], expected, rtol=1e-14)


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
