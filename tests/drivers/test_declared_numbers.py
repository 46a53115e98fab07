"""Numbers that a foreign instrument sends otherwise: after a comma, infinite, or as a code that is no reading."""

from __future__ import annotations

import pytest
from declared_bench import DeclaredBench

from rig.contracts.declared.forms import Form, step_of
from rig.contracts.declared.instrument import parse
from rig.drivers.errors import BadReply
from rig.drivers.roles import OVERLOAD

CONTROLLER = """
maker = "ACME"
model = "C3"
prepare = [{ register = 9, table = "coil", value = 1 }]
check = [{ register = 9, table = "discrete", is = 1 }]
[wire]
protocol = "modbus"
[identity]
register = 122
is = 1234
[reader]
unit = "bar"
reading = { register = 1, type = "TYPE", words = { WORD = "error: its sensor is broken" } }
"""


@pytest.mark.parametrize(
    ("kind", "word", "said"),
    [
        ("int16", "0x8003", "type int16 has 0x8003 as -32765; write -32765"),
        ("int16", "32771", "type int16 has 32771 as -32765; write -32765"),
        ("uint16", "0x8003", "write 32771"),
        ("uint16", "70000", "70000 is outside 0 to 65535, the numbers of type uint16"),
        ("float32", "0x7FC00000", "0x7FC00000 is a code; .* NaN, inf or -inf: write that"),
        ("int16", "broken", "broken is no number"),
    ],
)
def test_a_code_that_no_register_can_have_is_refused(kind: str, word: str, said: str) -> None:
    """The code of a broken sensor was taken for -3276.5 degC."""
    with pytest.raises(ValueError, match=said):
        parse(CONTROLLER.replace("TYPE", kind).replace("WORD", word))


@pytest.mark.parametrize(("kind", "word"), [("int16", "-32765"), ("uint16", "32771"), ("float32", "NaN")])
def test_a_code_that_a_register_can_have_is_taken(kind: str, word: str) -> None:
    parse(CONTROLLER.replace("TYPE", kind).replace("WORD", word))


def test_an_infinite_number_is_an_overload_and_a_coil_is_read_back_as_a_discrete_input() -> None:
    it = DeclaredBench(CONTROLLER.replace("TYPE", "float32").replace("WORD", "NaN"), protocol="modbus")
    it.it.identify()
    it.it.prepare()
    shown = it.twin._shown
    it.twin._shown = lambda place, ask: float("inf") if ask.register_ == 1 else shown(place, ask)
    it.it.start(1)
    assert list(it.it.fetch().values()) == [[OVERLOAD]]
    assert it.it.wrong() == ()


def test_a_file_with_the_wrong_order_of_words_is_told() -> None:
    """A reading of 200 degC was taken for 2e-41."""
    it = DeclaredBench(CONTROLLER.replace("TYPE", "float32").replace("WORD", "NaN"), protocol="modbus")
    it.it.identify()
    it.it.prepare()
    it.twin._measured = lambda name, t0: 200.0
    read = it.twin.registers.read
    it.twin.registers.read = lambda address, count: read(address, count)[::-1]
    it.it.start(1)
    with pytest.raises(BadReply, match=r"register 1', reads 2.*, and 200 with its two words .* word_order in"):
        it.it.fetch()


def test_a_number_may_have_a_comma() -> None:
    form = Form("{value:7,3};{unit}")
    assert form.read(" 20,044;C") == {"value": "20,044", "unit": "C"}
    assert form.fields["value"].read("20,044") == 20.044
    assert form.write({"value": 20.044, "unit": "C"}) == " 20,044;C"
    assert form.read(" 20.044;C") is None
    assert form.read(" 20,04;C") is None
    assert Form(form.text).filled({"unit": "C"}).text == "{value:7,3};C"
    assert step_of("20,04") == 0.01  # an acknowledged value may differ by no more


STANDBY = """
maker = "ACME"
model = "S4"
[wire]
WIRE
[identity]
IDENTITY
[source]
unit = "V"
low = 0
high = 10
SOURCE
dwell_s = 1
"""
LINES = (
    'ask = "ID?"\nanswer = "{maker} {model}"',
    """
set = "V{value:.3}"
setpoint = "V?"
on = "RUN"
off = "STBY"
output = { ask = "STB?", answer = "{value:d}", off_bit = 5 }
""",
)
REGISTERS = (
    "register = 40\nis = 4711",
    """
set = { register = 1, type = "float32" }
setpoint = { register = 1, type = "float32" }
on = { register = 9, value = 1 }
off = { register = 9, value = 0 }
output = { register = 8, off_bit = 5 }
""",
)


@pytest.mark.parametrize(
    ("wire", "protocol", "parts"), [("", "text", LINES), ('protocol = "modbus"', "modbus", REGISTERS)]
)
def test_a_bit_may_mean_that_it_is_off(wire: str, protocol: str, parts: tuple[str, str]) -> None:
    text = STANDBY.replace("WIRE", wire).replace("IDENTITY", parts[0]).replace("SOURCE", parts[1])
    it = DeclaredBench(text, protocol=protocol)
    it.it.prepare()
    assert not it.it.read().output
    it.it.set(2.5)
    assert it.it.read().output
    it.it.make_safe()
    assert not it.it.read().output
    if protocol == "text":
        assert b"32" in b"".join(data for direction, data in it.wire if direction == "rx")


def test_one_bit_cannot_mean_both() -> None:
    text = STANDBY.replace("WIRE", "").replace("IDENTITY", LINES[0]).replace("SOURCE", LINES[1])
    with pytest.raises(ValueError, match="bit means yes and off_bit means no: one of them"):
        parse(text.replace("off_bit = 5", "bit = 4, off_bit = 5"))
