"""Terms that a trace adds are told in words; the formula to copy stays as it is."""

from __future__ import annotations

import pytest

from rig.procedures.present.terms import in_words
from rig.units.si import per_term


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("I((chamber_degC - 25) * flow_kg_per_min)", "flow_kg_per_min times (chamber_degC - 25)"),
        (
            "cell_1 coefficient I((a_degC - 25)**2 * f_kN) at 5 kN",
            "cell_1 coefficient f_kN times (a_degC - 25)**2 at 5 kN",
        ),
        ("1 + x + I(x * exp(-y / 2)) + I(z)", "1 + x + x times exp(-y / 2) + z"),
        ("I(x / (x + 1))", "(x / (x + 1))"),
        ("I(-x)", "-x"),
        ("MI(x) + x^2 + x:y", "MI(x) + x^2 + x:y"),
        ("I(x * (y", "I(x * (y"),
    ],
)
def test_arithmetic_of_a_term_is_a_product_in_words(text, told):
    assert in_words(text) == told


def test_a_coefficient_of_such_a_term_has_a_unit_without_the_term():
    assert per_term("Hz per unit of I((chamber_degC - 25) * flow_kg_per_min)") == "Hz*min/(degC*kg)"
