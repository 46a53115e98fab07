"""Numbers without a decimal point: a register or a field says how many decimals they have, by a number or a code."""

from __future__ import annotations

import pytest
from declared_bench import DeclaredBench
from fake_lines import served

from rig.contracts.declared.instrument import parse
from rig.drivers.errors import BadReply
from rig.sims.wires.register_bank import Register
from rig.verbs.instrument.check import check
from rig.verbs.instrument.new import asked, lacking

COUNTER = """
maker = "ACME"
model = "D1"
[identity]
ask = "ID?"
answer = "ACME {model}"
[reader]
unit = "degC"
reading = { ask = "T?", answer = "{value:d} {dp:d}"MORE }
"""
REGISTERS = """
maker = "ACME"
model = "D2"
[wire]
protocol = "modbus"
[identity]
register = 122
is = 532
[source]
unit = "degC"
low = 0
high = 300
set = { register = 2, decimals = 9, places = { 0 = 3, 1 = 2, 2 = 1, 3 = 0 } }
setpoint = { register = 2, decimals = 9, places = { 0 = 3, 1 = 2, 2 = 1, 3 = 0 } }
read = { register = 1MORE }
safe_value = 0
"""


def steps(text: str, says: bytes) -> dict[str, str]:
    with served({"ID?": b"ACME D1\n", "T?": says}.get) as address:
        return {step.what: step.found for step in check(text, "c", address, {}, None, 1.0).steps}


def test_a_field_says_how_many_decimals_a_number_has():
    """234 with one decimal was read as 234 degC."""
    silent = steps(COUNTER.replace("MORE", ""), b"234 1\n")
    assert silent["three readings"] == "input: 234, 234, 234 degC"
    assert (
        silent["numbers without a decimal point"]
        == "T?: 234 is taken for 234, since neither scale nor decimals is declared"
    )
    said = steps(COUNTER.replace("MORE", ', decimals = "dp"'), b"234 1\n")
    assert said["three readings"] == "input: 23.4, 23.4, 23.4 degC"
    assert said["numbers without a decimal point"] == "T?: 234 is taken for 23.4, by its decimals"
    said = steps(COUNTER.replace("MORE", ", scale = 0.1"), b"234 1\n")
    assert said["numbers without a decimal point"] == "T?: 234 is taken for 23.4, by its scale"


def test_a_number_with_a_decimal_point_needs_no_word():
    text = COUNTER.replace("MORE", "").replace("{value:d} {dp:d}", "{value}")
    assert "numbers without a decimal point" not in steps(text, b"23.4\n")
    assert "T?: 234 is taken for 234" in steps(text, b"234\n")["numbers without a decimal point"]


def test_a_field_may_be_a_code_and_belongs_to_every_channel():
    text = COUNTER.replace("MORE", ', decimals = "dp", places = { 7 = 2 }').replace("{value:d}", "{a:d};{b:d}")
    text += '[reader.channels]\na = { field = "a" }\nb = { field = "b" }\n'
    said = steps(text, b"234;101 7\n")
    assert said["three readings of each channel"] == "a: 2.34, 2.34, 2.34 degC; b: 1.01, 1.01, 1.01 degC"
    assert (
        "dp should be one of its places, 7, and is 1" in steps(text, b"234;101 1\n")["three readings of each channel"]
    )


@pytest.mark.parametrize("code", [0, 1, 2, 3])
def test_a_register_may_have_a_code_for_decimals(code):
    """A controller whose 0 means three decimals: 23.4 was read as 23400, or as 234."""
    it = DeclaredBench(
        REGISTERS.replace("MORE", ", decimals = 9, places = { 0 = 3, 1 = 2, 2 = 1, 3 = 0 }"), protocol="modbus"
    )
    try:
        it.it.prepare()
        it.it.set(25.0)
        assert it.it.read().setpoint == 25.0
        assert it.it.without_point()[0] == "register 2: 250 is taken for 25, by its decimals"
        it.twin.registers.add(9, Register("uint16", False, lambda: code, None))
        assert it.it.read().setpoint == pytest.approx(250 / 10 ** (3 - code))
        it.twin.registers.add(9, Register("uint16", False, lambda: 4, None))
        with pytest.raises(BadReply, match="register 9 should be one of its places, 0, 1, 2, 3, and is 4"):
            it.it.read()
    finally:
        it.close()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (COUNTER.replace("MORE", ", decimals = 3"), "decimals = 3 has to be a field of its answer"),
        (COUNTER.replace("MORE", ', decimals = "places"'), "no field places in its answer"),
        (COUNTER.replace("MORE", ", places = { 0 = 1 }"), "places are codes of decimals, which is missing"),
        (REGISTERS.replace("MORE", ', decimals = "dp"'), "decimals = 'dp' has to be a register"),
        (REGISTERS.replace("MORE", ", decimals = 9, places = { x = 1 }"), "x = 1 is no code with a number of decimals"),
    ],
)
def test_decimals_from_nowhere_are_refused(text, said):
    with pytest.raises(ValueError, match=said):
        parse(text)


def test_the_twin_has_them_too():
    for more in (', decimals = "dp"', ', decimals = "dp", places = { 5 = 3 }'):
        it = DeclaredBench(COUNTER.replace("MORE", more))
        try:
            it.twin._measured = lambda name, t0: 21.5
            it.it.start(1)
            assert it.it.fetch() == {"input": [21.5]}
        finally:
            it.close()


@pytest.mark.parametrize(
    ("said", "wanted"),
    [
        ({"Does it take": "modbus", "Register that says": "9"}, "register = 1, decimals = 9 }"),
        (
            {"Does it take": "modbus", "Register that says": "9", "Decimals by": "0=3 1=2"},
            "register = 1, decimals = 9, places = { 0 = 3, 1 = 2 } }",
        ),
        (
            {"Its answer, as the manual prints it": "T 234", "Its number 234 has": "23.4"},
            "answer = 'T {value}', scale = 0.1 }",
        ),
        ({"Its answer, as the manual prints it": "T 234"}, "answer = 'T {value}' }"),
        (
            {"Does it take": "stream", "One line": "T 234", "Its number 234 has": "2.34"},
            "answer = 'T {value}', scale = 0.01 }",
        ),
    ],
)
def test_a_new_file_asks_for_them(said, wanted):
    text = asked(lambda question, assumed: next((a for q, a in said.items() if question.startswith(q)), assumed))
    assert lacking(text) == ""
    assert wanted in text
