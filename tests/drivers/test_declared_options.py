"""What a bench file chooses of an instrument that is a file, and how such a one is cleared, paced and locked."""

from __future__ import annotations

from importlib.resources import files

import pytest
from declared_bench import DeclaredBench
from pydantic import ValidationError

from rig.bench.plugins import declared
from rig.contracts.declared.forms import Form
from rig.contracts.declared.instrument import parse
from rig.contracts.declared.options import computed
from rig.drivers.declared import driver_of
from rig.drivers.errors import BadReply

METER = """
maker = "ACME"
model = "V1"
prepare = ["RANGE {range_V}"]
check = [{ ask = "RANGE?", is = "{range_V}" }]
[parameters]
range_V = 10.0
speed = "slow"
[choices]
range_V = [1.0, 10.0]
speed = ["slow", "fast"]
baud = [1200, 9600]
[formulas]
reading_s = "0.5 - 0.4 * (range_V < 5)"
[wire]
clear = "\\u0003"
remote = "REMOTE"
done = { ask = "DONE?", answer = "1" }
[identity]
ask = "ID?"
answer = "{maker} {model}"
[errors]
ask = "ERR?"
each = false
[reader]
unit = "V"
start = "GO {count:d}"
fetch = { ask = "GET?", answer = "{values:+.8e2}" }
"""


def test_options_reach_commands_checks_and_the_time_of_a_reading():
    it = DeclaredBench(METER, more="range_V = 1")
    it.it.identify()
    it.it.prepare()
    assert it.sent == [
        *("\x03", "REMOTE", "ID?"),
        *("\x03", "REMOTE", "DONE?", "RANGE 1", "DONE?", "ERR?", "RANGE?"),
    ]
    assert it.it.start(4) == pytest.approx(0.4)
    assert len(it.it.fetch()["input"]) == 4
    it.close()


def test_errors_are_asked_once_and_again_where_readings_are_missing():
    it = DeclaredBench(METER)
    it.it.prepare()
    it.wire.clear()
    it.it.start(1)
    it.it.fetch()
    assert it.sent == ["GO 1", "GET?"]
    it.it.start(1)
    it.twin.does = lambda *_: None
    it.twin._began = -1.0  # it has lost its readings
    it.wire.clear()
    with pytest.raises(Exception, match="reports error -113"):
        it.it.fetch()
    assert it.sent[:2] == ["GET?", "\x03"]
    assert "ERR?" in it.sent[2:]
    it.close()


def test_a_locked_panel_is_not_asked_and_another_bus_has_no_command_for_it():
    it = DeclaredBench(METER)
    it.it.prepare()
    it.wire.clear()
    assert it.it.wrong() == ()
    assert it.sent == []
    it.close()
    it = DeclaredBench(METER, more='interface = "gpib"')
    it.it.prepare()
    assert "REMOTE" not in it.sent
    it.wire.clear()
    assert it.it.wrong() == ()
    assert it.sent == ["RANGE?"]
    it.close()


def test_a_clear_gives_up_a_measurement_and_what_was_sent_before():
    it = DeclaredBench(METER)
    it.it.prepare()
    it.it.start(1000)
    it.it.make_safe()
    assert not it.twin.begun
    assert it.it.identify().model == "V1"
    it.close()


def test_a_command_that_is_not_carried_out_is_noticed():
    it = DeclaredBench(METER)
    it.twin._printed = lambda *_: "0"
    with pytest.raises(BadReply, match=r"'0' to 'DONE\?'; expected an answer as in '1'"):
        it.it.prepare()
    it.close()


@pytest.mark.parametrize("end", ["lf", "cr", "crlf"])
def test_its_line_end_is_that_of_the_bench(end):
    it = DeclaredBench(METER, more=f'line_end = "{end}"')
    assert it.it.identify().model == "V1"
    assert it.wire[1] == ("tx", b"REMOTE" + {"lf": b"\n", "cr": b"\r", "crlf": b"\r\n"}[end])
    it.close()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"range_V": 3}, "must be one of 1, 10"),
        ({"speed": "slower"}, "must be one of slow, fast"),
        ({"baud": 19200}, "must be one of 1200, 9600"),
    ],
)
def test_another_choice_is_refused(options, says):
    with pytest.raises(ValidationError, match=says):
        driver_of(METER).Options(**options)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("0.4 * (range_V < 5)", "0.4 * speed", "formulas.reading_s: .* is no formula of numbers"),
        ("0.4 * (range_V < 5)", "__import__('os')", "is no formula of numbers"),
        ("0.4 * (range_V < 5)", "1 / (range_V - 10)", "has no value: .*division by zero"),
        ("reading_s = ", "most = ", "formulas.most: a formula gives one of these of a reader: reading_s"),
        ("range_V = [1.0, 10.0]", "range_V = [1.0]", "choices.range_V lacks its default, 10.0"),
        ("speed = [", "speeds = [", "choices.speeds: there is no parameter speeds"),
        ('is = "{range_V}"', 'is = "{range}"', r"check of RANGE\?: \{range\} is no parameter"),
    ],
)
def test_a_file_whose_options_do_not_fit_is_refused(old, new, says):
    assert old in METER
    with pytest.raises(ValueError, match=says):
        parse(METER.replace(old, new))


def test_a_formula_has_numbers_comparisons_and_parameters():
    assert computed("2 * (nplc + 1) / hz - 1", {"nplc": 9.0, "hz": 50}) == pytest.approx(-0.6)
    assert computed("(nplc >= 1) + 2 * (nplc <= 0.2)", {"nplc": 0.2}) == 2.0


@pytest.mark.parametrize("text", ["+1.23456789E+0", "+1.23456789E02", "+1.23456789E+002", "1.23456789E+02"])
def test_a_lost_character_of_an_exponent_is_noticed(text):
    for field in ("value", "values"):
        assert Form(f"{{{field}:+.8e2}}").read("+1.23456789E+02") is not None
        assert Form(f"{{{field}:+.8e2}}").read(text) is None
    assert Form("{values:+.8e2}").read("+1.23456789E+02,-1.23456789E-02") is not None


def test_a_right_answer_that_no_field_can_have_is_refused():
    text = (files("rig.drivers.declared") / "julabo_fp50.toml").read_text()
    text = text.replace('{ ask = "in_sp_06", is = 0 }', '{ ask = "in_sp_06", answer = "{} C", is = 0 }')
    with pytest.raises(ValueError, match=r"check of in_sp_06: no field of '\{\} C' could be 0"):
        parse(text)


@pytest.mark.parametrize(("given", "written"), [("", []), ("ramp = 2.5", [25]), ("ramp = 0", [0])])
def test_a_number_that_the_bench_may_give_is_set_and_read_back_only_where_it_does(given, written):
    """A setpoint rate limit that somebody has set at the panel is left alone by a bench file that says nothing."""
    it = DeclaredBench(declared()["eurotherm-3200"], protocol="modbus", more=given)
    try:
        it.it.prepare()
        assert it.it.wrong() == ()
        requests = [data[7:] for direction, data in it.wire if direction == "tx"]
        assert [int.from_bytes(one[3:5], "big") for one in requests if one[:3] == bytes((6, 0, 35))] == written
        assert any(one[:3] == bytes((3, 0, 35)) for one in requests) is bool(written)
        if written:
            it.twin._kept["holding", 35] = 7.0
            assert it.it.wrong() == (f"register 35 answers 0.7, not {float(given.split()[2])}",)
    finally:
        it.close()


def test_lines_of_text_may_lack_a_number_too():
    known, more = 'prepare = ["UNIT', 'optional = { rate = "K" }\nprepare = ["RATE {rate}", "UNIT'
    text = declared()["fluke-9171"].replace(known, more)
    for more, sent in (("", []), ("rate = 1.5", ["RATE 1.5"])):
        it = DeclaredBench(text, more=more)
        try:
            it.it.prepare()
            assert [line for line in it.sent if "RATE" in line] == sent
        finally:
            it.close()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('value = "{ramp}"', 'value = "{rump}"', r"prepare of register 35: value = '\{rump\}' is neither a number nor"),
        ('value = "{ramp}"', 'value = "fast"', "value = 'fast' is neither a number nor a parameter"),
        ("optional =", "parameters = { ramp = 1 }\noptional =", "optional.ramp is a parameter, too"),
        ('is = "{ramp}"', 'is = "{rump}"', r"check of register 35: \{rump\} is no parameter"),
    ],
)
def test_a_number_that_nobody_gives_is_refused(old, new, said):
    with pytest.raises(ValueError, match=said):
        parse(declared()["eurotherm-3200"].replace(old, new))
