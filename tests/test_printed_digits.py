"""Estimates are printed to the last decimal place of their standard errors."""

from __future__ import annotations

from math import inf, nan

import pytest
from command import rig

from procedures.numbers import to_error


@pytest.mark.parametrize(
    ("estimate", "error", "shown"),
    [
        (1e9, 0.000544, ("1000000000", "0.000544")),
        (1000000000.1234567, 0.000544, ("1000000000.123457", "0.000544")),
        (-1000000000.1234567, 0.000544, ("-1000000000.123457", "0.000544")),
        (0.0, 0.0, ("0", "0")),
        (3.0, inf, ("3", "inf")),
        (1.23456789012345e-12, 1.5e-19, ("1.234567890e-12".replace("890", "89"), "1.5e-19")),
        (-2.0874581, 0.353, ("-2.0874581", "0.353")),
        (None, None, ("-", "-")),
        (1.0, None, ("1", "-")),
        (nan, 1.0, ("-", "1")),
        (1e9, 1e-30, ("1000000000", "1e-30")),
    ],
)
def test_the_error_says_how_many_digits(estimate, error, shown):
    assert to_error(estimate, error) == shown


def test_a_fit_of_large_numbers_shows_what_was_determined(tmp_path):
    rows = "".join(f"{i},{1e9 + 0.25 * i + 0.001 * (i * 7 % 5 - 2):.6f}\n" for i in range(11))
    (tmp_path / "t.csv").write_text("x,y\n" + rows)
    done = rig("fit", "t.csv", "--response", "y", "--formula", "1 + x", cwd=tmp_path)
    assert "1e+09" not in done.stdout
    assert "100000000" in done.stdout or "99999999" in done.stdout
