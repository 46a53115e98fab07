"""Numbers of a certificate, rounded by their uncertainty."""

from __future__ import annotations

from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.fitter.errors import FitError
from rig.fitter.rounding import rounded, rounded_df, rounded_factor, rounded_uncertainty


@pytest.mark.parametrize(
    ("value", "uncertainty", "text"),
    [
        (10.05762, 0.0273, "10.058 ± 0.027"),  # JCGM 100, 7.2.6: 27 mOhm, and 10.058
        (100.02147, 0.00035, "100.02147 ± 0.00035"),  # JCGM 100, 7.2.2
        (50.000838, 93e-6, "50.000838 ± 0.000093"),  # H.1
        (10000.178, 0.01666, "10000.178 ± 0.017"),  # EA-4/02, S3
        (49.99908, 73e-6, "49.999080 ± 0.000073"),  # S4
        (0.1, 0.0478, "0.100 ± 0.048"),
        (1.0, 0.0996, "1.00 ± 0.10"),
        (9.999, 0.1, "10.00 ± 0.10"),
        (-0.004, 0.12, "0.00 ± 0.12"),
        (2.675, 0.1, "2.68 ± 0.10"),  # the nearest float is below the tie
        (0.125, 0.1, "0.12 ± 0.10"),
        (1.005, 0.145, "1.00 ± 0.15"),
        (123456.0, 1250.0, "(1.235 ± 0.013) × 10⁵"),
        (-12345.6, 12.0, "-12346 ± 12"),
        (1.23456e-3, 2.1e-8, "0.001234560 ± 0.000000021"),
        (1.23456e-5, 2.1e-8, "(1.2346 ± 0.0021) × 10⁻⁵"),
        (1.23456e-7, 2.1e-10, "(1.2346 ± 0.0021) × 10⁻⁷"),
        (0.0, 3.04e-12, "(0.0 ± 3.0) × 10⁻¹²"),
        (12345678.9, 0.5, "(1.234567890 ± 0.000000050) × 10⁷"),
    ],
)
def test_a_value_has_the_place_of_its_uncertainty(value, uncertainty, text):
    assert rounded(value, uncertainty).text == text


def test_one_digit_is_rounded_up_where_it_would_lose_more_than_five_percent():
    assert str(rounded_uncertainty(1.04, 1)) == "1"
    assert str(rounded_uncertainty(1.4, 1)) == "2"
    assert str(rounded_uncertainty(0.0014, 1)) == "0.002"


@given(st.floats(-1e12, 1e12), st.floats(1e-12, 1e9))
def test_what_is_printed_is_near_what_was_measured(value, uncertainty):
    found = rounded(value, uncertainty)
    power = Decimal(10) ** found.exponent
    assert len(found.uncertainty.as_tuple().digits) == 2
    assert abs(Decimal(found.uncertainty_text) * power - Decimal(repr(uncertainty))) <= Decimal("0.05") * Decimal(
        repr(uncertainty)
    )
    unit = Decimal((0, (1,), found.uncertainty.as_tuple().exponent))
    assert abs(Decimal(found.value_text) * power - Decimal(repr(value))) <= unit / 2
    assert "E" not in found.text
    assert len(found.value_text.partition(".")[2]) == len(found.uncertainty_text.partition(".")[2])


def test_factors_and_degrees_of_freedom():
    assert [rounded_factor(k) for k in (2.0, 1.959964, 2.365, 12.7062)] == ["2.00", "1.96", "2.37", "12.71"]
    assert [rounded_df(df) for df in (16.97, 1.5, 999.9, 1000.0, float("inf"))] == ["16", "1", "999", "∞", "∞"]


@pytest.mark.parametrize(
    ("value", "uncertainty", "words"),
    [
        (1.0, 0.0, "must be more than 0"),
        (1.0, -0.1, "must be more than 0"),
        (1.0, float("inf"), "inf cannot be rounded"),
        (float("nan"), 0.1, "nan cannot be rounded"),
    ],
)
def test_what_cannot_be_rounded_is_refused(value, uncertainty, words):
    with pytest.raises(FitError, match=words):
        rounded(value, uncertainty)
