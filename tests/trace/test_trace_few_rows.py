"""A name that one or two rows make: gross errors are found before names, and a name that rests on a row says so."""

import re

import numpy as np
import pytest

from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import trace_general
from rig.procedures.tables.table import Table

VOLTAGE_MV = [0, 0.19, 0.4, 0.65, 0.76, 1.05, 1.28, 1.51, 1.75, 1.96, 2.16, 2.43, 2.6, 2.83, 3.03, 3.23, 3.45, 3.65]
VOLTAGE_MV += [3.88, 4.04, 4.07]
"""Thermocouple of a laboratory course; the last row is a gross error of 6.6 sd."""
DAC_V = [
    0.000375529088,
    0.360528769,
    1.06964499,
    1.79940492,
    2.52722476,
    3.25716991,
    3.96202773,
    4.66208302,
    4.99700007,
]
"""A converter from 0 to 4000 in steps of 500: dead at code 0, clipped at 4000."""


def _traced(x, y):
    table = Table("published", {"x": np.array(x, float), "y": np.array(y, float)}, True, {})
    return trace_general(roles_of(table, Roles(response="y", formula="1 + x"))[0])


def test_one_bad_end_row_is_a_gross_error_and_no_saturation():
    found = _traced(np.arange(0, 101, 5), VOLTAGE_MV)
    assert found.added == ()
    assert [(effect.effect, effect.terms) for effect in found.effects if effect.effect == "outliers"] == [
        ("outliers", ("row 22",))
    ]
    assert "saturation:x, which is not named" in next(e.size for e in found.effects if e.effect == "outliers")
    without = _traced(np.arange(0, 100, 5), VOLTAGE_MV[:-1])
    assert found.before.fit.sigma_E == pytest.approx(without.before.fit.sigma_E, rel=1e-9)


def test_a_name_that_rests_on_both_end_rows_is_doubtful_and_says_which():
    found = _traced(np.arange(0, 4001, 500), DAC_V)
    assert found.added
    for effect in found.added:
        assert effect.doubtful == "it rests on rows 2 and 10: the other rows do not show it"
    assert found.verdict != "explained"


@pytest.mark.parametrize("seed", range(3))
def test_a_dead_zone_and_a_limit_are_a_clip_and_no_power(seed):
    rng = np.random.default_rng([21, seed])
    x = rng.permutation(np.linspace(0.0, 100.0, 21))
    low, high = rng.uniform(3.0, 25.0), rng.uniform(75.0, 97.0)
    found = _traced(x, 0.05 * np.clip(x, low, high) + 0.01 * rng.standard_normal(21))
    assert [(effect.effect, effect.doubtful) for effect in found.added] == [("clip:x", None)]
    term = found.added[0].terms[0]
    corners = [float(text) for text in re.fullmatch(r"min\(max\(x, (.*)\), (.*)\)", term).groups()]
    assert corners == pytest.approx([low, high], abs=2.5)


@pytest.mark.parametrize("bad", [0, 20])
def test_gross_end_rows_of_many_tables_are_never_named_without_doubt(bad):
    named = 0
    for seed in range(8):
        x = np.linspace(0.0, 100.0, 21)
        y = 1.0 + 0.04 * x + 0.03 * np.random.default_rng(seed).normal(size=21)
        y[bad] -= 0.36
        named += any(not effect.doubtful for effect in _traced(x, y).added)
    assert named == 0


def test_a_curve_that_many_rows_show_is_named_without_this_doubt():
    x = np.linspace(0.0, 100.0, 21)
    y = 1.0 + 0.04 * x + 1e-4 * (x - 50.0) ** 2 + 0.01 * np.random.default_rng(1).normal(size=21)
    found = _traced(x, y)
    assert [(effect.effect, effect.doubtful) for effect in found.added] == [("second-order:x", None)]
