"""Numbers on a wire: what Python would read and an instrument never sends is not a number, in any driver."""

from __future__ import annotations

import pytest
import test_druck_pace
import test_keysight_34401a
import test_keysight_34970a
import test_newport_esp301

from rig.drivers.errors import BadReply
from rig.drivers.numbers import decimal, whole

WRONG = [
    "nan",
    "inf",
    "-Infinity",
    "1_2.5",
    "5_0.0",
    "1e999",
    "\uff15.0",
    "\u0665",
    "",
    "+",
    ".",
    "1e",
    "0x10",
    "5.0 PSI",
]


@pytest.mark.parametrize(
    ("text", "value"),
    [("5", 5.0), ("+5.", 5.0), ("-.5", -0.5), (" 1.0E-3", 1e-3), ("+9.90000000E+37", 9.9e37), ("0012.50", 12.5)],
)
def test_numbers_as_instruments_print_them(text, value):
    assert decimal(text) == value


@pytest.mark.parametrize("text", WRONG)
def test_what_is_no_number_is_refused(text):
    with pytest.raises(ValueError, match="is not a number"):
        decimal(text)


@pytest.mark.parametrize("text", ["1_0", "\u0665", "\u00b2", "1.0", "", "nan"])
def test_what_is_no_whole_number_is_refused(text):
    with pytest.raises(ValueError, match="is not a whole number"):
        whole(text)
    assert whole("+52") == 52


@pytest.mark.parametrize("text", ["nan", "inf", "1_2.5"])
def test_an_angle_of_the_head_that_is_no_number_is_refused(text, monkeypatch):
    rig = test_newport_esp301.Rig()
    rig.head.prepare()
    ask = rig.head._line.query_lines
    monkeypatch.setattr(
        rig.head._line, "query_lines", lambda *a: [text if "." in answer else answer for answer in ask(*a)]
    )
    with pytest.raises(BadReply, match="a number"):
        rig.head.read()


@pytest.mark.parametrize("text", ["5_0.0", "nan", "inf", "1e999"])
def test_a_pressure_that_is_no_number_is_refused(text, monkeypatch):
    rig = test_druck_pace.Rig().ready()
    monkeypatch.setattr(rig.twin, "ask_in_limits", lambda: f"{text}, 1")
    with pytest.raises(BadReply, match="a number"):
        rig.pace.read()


def test_meters_take_no_such_numbers_either(monkeypatch):
    dvm = test_keysight_34401a.Rig().dvm
    monkeypatch.setattr(dvm._talk.line, "query_lines", lambda *a, **k: ["5_2"])
    with pytest.raises(BadReply, match=r"an answer as in '\{value\}'"):
        dvm.restarted()
    scanner = test_keysight_34970a.Rig(channels={"101": "volts"}).dvm
    monkeypatch.setattr(scanner._talk.line, "query_lines", lambda *a, **k: ["5_2"])
    with pytest.raises(BadReply, match=r"an answer as in '\{value\}'"):
        scanner.restarted()
    monkeypatch.setattr(scanner._talk.line, "query_lines", lambda *a, **k: ["1_0"])
    with pytest.raises(BadReply, match=r"answered '1_0' to 'VOLT:DC:RANG\? .* an answer as in '\{values\}'"):
        scanner._verify(scanner.table.check[0])
    for answer in ("5_0", "+55"):
        monkeypatch.setattr(scanner._talk.line, "query_lines", lambda *a, said=answer, **k: [said])
        with pytest.raises(BadReply, match=r"to 'SYST:LFR\?'; expected "):
            scanner._ask_parameters()
