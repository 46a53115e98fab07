"""A value that is printed with its standard error has the digits which that determines."""

from __future__ import annotations

import ast
import re
from decimal import Decimal
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from command import rig
from hypothesis import given
from hypothesis import strategies as st

from rig.fitter.effects.sizes import amplitude, arcsec, each
from rig.fitter.rounding import guard_digits, with_error
from rig.procedures.present.effects_shown import picture
from rig.verbs.infer.result import infer

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("value", "error", "shown"),
    [
        (1e9, 5.44e-4, ("1000000000.00000", "0.00054")),
        (1000000000.1234567, 5.44e-4, ("1000000000.12346", "0.00054")),
        (-1000000000.1234567, 5.44e-4, ("-1000000000.12346", "0.00054")),
        (-2.0874581, 0.353, ("-2.09", "0.35")),
        (3.0, 0.0996, ("3.00", "0.10")),
        (123456.7, 1250.0, ("123457", "1250")),  # without a power of ten, zeros would not tell whether they count
        (12345678901234.0, 3e5, ("1.234567890e+13", "3.0e+5")),
        (1.23456789012345e-12, 1.5e-19, ("1.23456789e-12", "1.5e-19")),
        (1e-320, 5e-324, ("1.00000e-320", "5.0e-324")),
        (1e9, 1e-30, ("1.0000000000000000e+9", "1.0e-30")),  # a double has no more
        (0.003, 1.2, ("0.0", "1.2")),
        (5.0, 1234.0, ("5", "1234")),
        (3e-17, 1.5e-15, ("0", "1.5e-15")),
        (-0.0, 0.1, ("0.00", "0.10")),
        (0.0, 0.0, ("0", "0")),
        (1000000000.123456, 0.0, ("1000000000.12346", "0")),
        (3.0, inf, ("3", "inf")),
        (3.0, nan, ("3", "-")),
        (3.0, -1.0, ("3", "-")),
        (1.0, None, ("1", "-")),
        (-inf, 1.0, ("-inf", "-")),
        (nan, 1.0, ("-", "-")),
        (None, None, ("-", "-")),
    ],
)
def test_the_error_says_how_many_digits(value, error, shown):
    assert with_error(value, error) == shown


def test_coefficients_that_are_copied_have_more():
    assert with_error(-2.0874581, 0.353, guard=2) == ("-2.0875", "0.35")
    assert with_error(123456.78, 1234.0, guard=3) == ("123456.8", "1234")
    assert with_error(3.0, 0.1, guard=4) == ("3.00", "0.10")
    assert with_error(0.0, 0.1, guard=4) == ("0.00", "0.10")
    assert with_error(1e9, 5.44e-4, guard=0) == ("1000000000.00000", "0.00054")


@pytest.mark.parametrize(
    ("first", "last", "powers"), [(0.0, 1.0, 1), (900.0, 1000.0, 3), (-5.0, 5.0, 5), (0.0, 1e6, 2)]
)
def test_digits_of_copied_coefficients_keep_the_curve_and_are_no_more_than_that_takes(first, last, powers):
    seed = 20261129
    print("seed", seed)
    rng = np.random.default_rng(seed)
    x = np.linspace(first, last, 41)
    columns = x[:, None] ** np.arange(powers + 1)
    root = np.linalg.pinv(columns)
    covariance = root @ root.T
    b, errors = root @ rng.normal(size=len(x)), np.sqrt(np.diag(covariance))
    of_curve = np.sqrt(np.einsum("ij,jk,ik->i", columns, covariance, columns))

    def moved(guard):
        copied = np.array([float(with_error(*pair, guard=guard)[0]) for pair in zip(b, errors, strict=True)])
        return float(np.max(np.abs(columns @ (copied - b)) / of_curve))

    asked = guard_digits(covariance)
    # The bound is a root mean square over all roundings: one of them may be three times as large.
    assert moved(asked) < 0.3
    # A last place is between a tenth and a hundredth of its error, and the bound is of the worst direction.
    assert asked == 0 or moved(asked - 1) > 0.01


def test_a_fit_of_large_abscissae_prints_what_may_be_copied(tmp_path):
    seed = 7
    print("seed", seed)
    rng = np.random.default_rng(seed)
    x = np.linspace(900.0, 1000.0, 21)
    y = 2.0 - 0.3 * x + 2e-4 * x**2 - 1e-7 * x**3 + rng.normal(0.0, 1e-3, len(x))
    (tmp_path / "t.csv").write_text("x,y\n" + "".join(f"{a:.6f},{b:.9f}\n" for a, b in zip(x, y, strict=True)))
    done = rig("fit", "t.csv", "--response", "y", "--formula", "1 + x + x^2 + x^3", cwd=tmp_path)
    shown = [float(value) for value in re.findall(r"^│ (?:1|x|x\^[23]) +│ +(\S+) +│", done.stdout, re.MULTILINE)]
    columns = x[:, None] ** np.arange(4)
    best = columns @ (np.linalg.pinv(columns / columns[-1]) @ y / columns[-1])
    assert len(shown) == 4, done.stdout
    assert np.max(np.abs(columns @ shown - best)) < 3e-4


def test_a_change_has_its_sign():
    assert with_error(2.0, 0.1, sign=True) == ("+2.00", "0.10")
    assert with_error(-2.0, 0.1, sign=True) == ("-2.00", "0.10")


@given(st.floats(-1e18, 1e18), st.floats(1e-18, 1e18), st.sampled_from([0, 2, 8]))
def test_both_are_within_half_of_the_last_place(value, error, guard):
    shown = [Decimal(text) for text in with_error(value, error, guard=guard)]
    assert abs(shown[1] - Decimal(repr(error))) <= Decimal("0.05") * Decimal(repr(error))
    half = max(Decimal("0.05") * Decimal(repr(error)), abs(Decimal(repr(value))) * Decimal("1e-16"))
    assert abs(shown[0] - Decimal(repr(value))) <= half


def test_sizes_of_effects_have_the_digits_of_their_errors():
    assert arcsec({"a": 40000.0 / 3600}, 1.0, {"a": 0.184 / 3600}, both=True) == "40000.00 +- 0.18 arcsec"
    assert each("deg/g")({"a": -2.15e-2}, 1.0, {"a": 1.02e-3}, both=True) == "-0.0215 +- 0.0010 deg/g"
    phases = {"sin": 3e6 / 3600, "cos": 4e6 / 3600}
    assert amplitude(phases, 1.0, dict.fromkeys(phases, 0.1 / 3600), both=True) == "5000000.00 +- 0.10 arcsec"
    assert each("V")({"a": 1234.56}, 1.0) == "1.23e+03 V"


def test_a_fit_of_large_numbers_shows_what_was_determined(tmp_path):
    rows = "".join(f"{i},{1e9 + 0.25 * i + 0.001 * (i * 7 % 5 - 2):.6f}\n" for i in range(11))
    (tmp_path / "t.csv").write_text("x,y\n" + rows)
    done = rig("fit", "t.csv", "--response", "y", "--formula", "1 + x", cwd=tmp_path)
    assert "1e+09" not in done.stdout
    shown = re.search(r"\b(\d+)\.(\d+) +\S? *0\.(\d+)", done.stdout)
    assert shown is not None, done.stdout
    assert shown[1] in {"1000000000", "999999999"}
    assert len(shown[2]) == len(shown[3])


BESIDE = re.compile(r"\} ?(\+-|±) ?\{")
ELSEWHERE = {
    "fitter/rounding.py": "the function",
    "rig/verbs/certificate/dcc_elements.py": "texts that were rounded",
    "rig/verbs/certificate/tolerances.py": "a tolerance, which was given",
    "procedures/pressure/words.py": "a largest error, and the interval of another reading: no value and its error",
}


@pytest.mark.parametrize("folder", ["fitter", "procedures", "rig"])
def test_nothing_else_prints_a_value_with_its_error(folder):
    for path in sorted((ROOT / folder).rglob("*.py")):
        name, source = str(path.relative_to(ROOT)), path.read_text(encoding="utf-8")
        if name in ELSEWHERE or not any(sign in source for sign in ("+-", "±")):
            continue
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.JoinedStr):
                text = ast.unparse(node)
                formats = [part.format_spec for part in node.values if isinstance(part, ast.FormattedValue)]
                assert not (BESIDE.search(text) and any(formats)), f"{name}:{node.lineno}: {text}"


def test_inferred_values_have_the_digits_of_their_standard_deviations(tmp_path):
    calibration, readings = tmp_path / "c.json", tmp_path / "r.csv"
    rows = "".join(f"{1e6 + x},{2 * x + 1e-3 * (x * 7 % 5 - 2):.6f}\n" for x in range(11))
    (tmp_path / "t.csv").write_text("x,y\n" + rows)
    line = ("fit", "t.csv", "--response", "y", "--formula", "1 + I(x - 1e6)", "--out", calibration)
    assert rig(*line, cwd=tmp_path).returncode == 0
    readings.write_text("y\n4.0005\n")
    shown = str(infer(calibration, readings))
    (value,) = re.findall(r"\b(1000002\.\d+)\b", shown)[:1]
    (sd,) = re.findall(r"\b(0\.000\d+)\b", shown)[:1]
    assert len(value.partition(".")[2]) == len(sd.partition(".")[2])


def test_the_picture_of_a_shape_tells_heights_to_the_place_of_its_band():
    over = {"x": [0.0, 1.0], "label": "x", "unit": ""}
    shape = {"over": over, "beside": None, "estimate": [-1234567.0, 1234568.0], "stderr": [0.1, 0.1], "unit": "V"}
    (*_, words) = picture(shape)
    assert words.endswith("▁ -1234567.00, █ +1234568.00 V, 95 % band +-0.20; · may be zero")
