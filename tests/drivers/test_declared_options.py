"""What a bench file chooses of an instrument that is a file, and how such a one is cleared, paced and locked."""

from __future__ import annotations

from importlib.resources import files

import pytest
from declared_bench import DeclaredBench
from pydantic import ValidationError

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
