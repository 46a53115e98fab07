"""Units of CiA 402 drives: codes that makers' manuals print, and what a degree per second is in them."""

from __future__ import annotations

import pytest

from rig.drivers.cia402_units import Quantity, Unit, parse_unit, told_unit


@pytest.mark.parametrize(
    ("code", "quantity", "unit"),
    [
        (0x00B44700, "velocity", "rpm"),  # Nanotec and maxon, the factory's 60A9h
        (0xFFB44700, "velocity", "0.1 rpm"),
        (0xFDB44700, "velocity", "0.001 rpm"),
        (0x00C00300, "acceleration", "rpm/s"),  # maxon, the factory's 60AAh
        (0x00B50300, "velocity", "counts/s"),
        (0x00410300, "velocity", "deg/s"),
        (0x00B40300, "velocity", "rev/s"),
    ],
)
def test_codes_of_the_makers(code: int, quantity: Quantity, unit: str) -> None:
    assert told_unit(code, quantity) == parse_unit(unit, quantity)
    assert str(told_unit(code, quantity)) == unit


@pytest.mark.parametrize("code", [0, 0x00010300, 0x00B40000, 0x00B5_0000])
def test_a_code_that_is_not_known_is_no_unit(code: int) -> None:
    assert told_unit(code, "velocity") is None


@pytest.mark.parametrize(
    ("unit", "quantity", "value"),
    [
        ("counts/s", "velocity", 36000.0),
        ("rpm", "velocity", 100.0 / 6.0),  # 1 deg/s is a sixth of a turn a minute, times the gear
        ("0.1 rpm", "velocity", 1000.0 / 6.0),
        ("rev/s", "velocity", 100.0 / 360.0),
        ("deg/s", "velocity", 100.0),
        ("rpm/s", "acceleration", 100.0 / 6.0),
        ("counts/s^2", "acceleration", 36000.0),
        ("1e-3 rev/s^2", "acceleration", 1e5 / 360.0),
    ],
)
def test_a_degree_per_second_of_a_table_behind_a_gear_of_100(unit: str, quantity: Quantity, value: float) -> None:
    assert parse_unit(unit, quantity).per_degree(36000.0, 100.0) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("text", ["RPM", "rpm/s", "0 rpm", "rpm 2", "", "m/s", "-1 rpm"])
def test_what_is_no_unit_of_speed(text: str) -> None:
    with pytest.raises(ValueError, match=r"is not a unit of velocity; known: counts/s, rpm, rev/s, deg/s"):
        parse_unit(text, "velocity")


def test_counts_need_no_gear() -> None:
    assert not Unit(1.0, "counts/s").of_shaft
    assert Unit(1.0, "rpm").of_shaft
