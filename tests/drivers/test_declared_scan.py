"""A scanner that is a file: channels of several sorts, in lists, and what it is asked for itself."""

from __future__ import annotations

import pytest
from declared_bench import DeclaredBench
from pydantic import ValidationError

from rig.contracts.declared.instrument import parse
from rig.drivers.declared import driver_of
from rig.drivers.errors import BadReply, LimitError
from rig.drivers.roles import OneAfterAnother, Reader

SCANNER = """
maker = "ACME"
model = "S1"
asked = { line_Hz = "LINE?" }
[parameters]
span = 10.0
line_Hz = 60.0
[choices]
line_Hz = [50.0, 60.0]
[formulas]
reading_s = "6 / line_Hz"
[identity]
ask = "ID?"
answer = "{maker} {model}"
[reader]
unit = "V"
start = "GO {count:d}"
fetch = { ask = "GET?", answer = "{values:+.8e2}" }
most = 12
[scan]
cards = ["1:10"]
groups = [
    { sorts = "volts", prepare = "VOLT {span},({list})", check = [{ ask = "SPAN? ({list})", is = "{span}" }] },
    { prepare = "TEMP {probe},({list})", check = [{ ask = "PROBE? ({list})", is = "{probe}" }] },
    { prepare = "SCAN ({names})", check = [{ ask = "SCAN?", answer = "({text})", is = "{names}" }] },
]
[scan.sorts]
volts = { own = { spans = "span" } }
pt100 = { unit = "degC", fills = { probe = "PT" }, four_wires = true }
"k" = { unit = "degC", fills = { probe = "K" } }
"""
CHANNELS = 'channels = { 1 = "volts", 3 = "volts", 2 = "volts", 5 = "pt100", 6 = "k", 7 = "k" }'


def test_channels_alike_share_their_lines_and_each_has_an_answer():
    it = DeclaredBench(SCANNER, more=f"{CHANNELS}\nspans = {{ 3 = 0.1 }}")
    assert isinstance(it.it, Reader)
    assert isinstance(it.it, OneAfterAnother)
    assert it.it.channels() == ("1", "2", "3", "5", "6", "7")
    assert it.it.units() == {"1": "V", "2": "V", "3": "V", "5": "degC", "6": "degC", "7": "degC"}
    it.it.prepare()
    assert it.sent == [
        *("VOLT 0.1,(3)", "VOLT 10,(1:2)", "TEMP PT,(5)", "TEMP K,(6:7)", "SCAN (1,2,3,5,6,7)"),
        *("SPAN? (3)", "SPAN? (1:2)", "PROBE? (5)", "PROBE? (6:7)", "SCAN?", "LINE?"),
    ]
    assert it.it.sweep_s() == pytest.approx(0.6)
    assert it.it.start(2) == pytest.approx(1.2)
    assert {name: len(values) for name, values in it.it.fetch().items()} == dict.fromkeys(it.it.channels(), 2)
    with pytest.raises(LimitError, match="1 to 2 sweeps at once, not 3"):
        it.it.start(3)
    it.close()


@pytest.mark.parametrize(
    ("answers", "said"),
    [
        ({"SPAN? (1:3)": "10,1,10"}, r"SPAN\? \(1:3\) answers 10,1,10, not 10.0"),
        ({"PROBE? (6:7)": "K,PT"}, r"PROBE\? \(6:7\) answers K,PT, not K,K"),
        ({"SCAN?": "(1,2)"}, r"SCAN\? answers 1,2, not 1,2,3,5,6,7"),
        ({"LINE?": "55"}, r"answered '55' to 'LINE\?'; expected line_Hz: 50 or 60"),
    ],
)
def test_one_channel_that_is_set_otherwise_is_told(answers, said):
    it = DeclaredBench(SCANNER, more=CHANNELS)
    asked = it.it._talk.line.query_lines
    it.it._talk.line.query_lines = lambda line, *a, **k: [answers[line]] if line in answers else asked(line, *a, **k)
    with pytest.raises(BadReply, match=said):
        it.it.prepare()
    it.close()


def test_the_time_of_a_reading_follows_from_what_it_says():
    it = DeclaredBench(SCANNER, more=CHANNELS)
    asked = it.it._talk.line.query_lines
    it.it._talk.line.query_lines = lambda line, *a, **k: ["50"] if line == "LINE?" else asked(line, *a, **k)
    it.it.prepare()
    assert it.it.sweep_s() == pytest.approx(6 * 0.12)
    it.close()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"channels": {"11": "volts"}}, "11 is no channel; there are 1:10"),
        ({"channels": {"1": "ohms"}}, "must be one of volts, pt100, k"),
        ({"channels": {"6": "pt100"}}, "6: four wires go to channel 1 to 5, and to the one 5 above it"),
        ({"channels": {"5": "pt100", "10": "k"}}, "10 carries the other two wires of 5 and cannot be a channel"),
        ({"channels": {"6": "k"}, "spans": {"6": 0.1}}, "6 is not a volts channel"),
        ({"channels": {"6": "k"}, "spans": {"1": 0.1}}, "1 is not a volts channel"),
        ({"channels": {}}, "at least 1 item"),
        ({}, "Field required"),
        ({"channels": {"1": "volts"}, "line_Hz": 50.0}, "Extra inputs are not permitted"),
    ],
)
def test_channels_of_a_bench_file_are_checked(options, said):
    with pytest.raises(ValidationError, match=said) as found:
        driver_of(SCANNER).Options(**options)
    assert found.value.error_count() == 1


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('"span" }', '"spam" }', r"scan.sorts: own.spans = 'spam' has to name a parameter"),
        ('sorts = "volts"', 'sorts = "amps"', r"scan.groups\[0\] has sorts that there are not"),
        ("TEMP {probe}", "TEMP {prone}", r"scan.groups\[1\] has sorts .* do not fill in all of its probe, prone"),
        ('"1:10"', '"1-10"', r"scan.cards.0: String should match pattern"),
        ("start = ", "# ", "reader.start and reader.fetch belong together"),
        ('asked = { line_Hz = "LINE?" }', 'asked = { line = "LINE?" }', "asked.line: there is no parameter line"),
    ],
)
def test_a_file_that_makes_no_sense_is_refused(before, after, said):
    with pytest.raises(ValueError, match=said):
        parse(SCANNER.replace(before, after))


def test_a_setting_of_a_list_of_channels_is_read_back_by_its_question():
    text = SCANNER.replace('prepare = "VOLT', 'prepare = "SPAN').replace('prepare = "TEMP', 'prepare = "PROBE')
    it = DeclaredBench(text, more=CHANNELS)
    assert it.it.unwatched()[0].startswith("whether a command was refused")
    assert "what SCAN (1,2,3,5,6,7) set (check)" not in it.it.unwatched()
    assert not [one for one in it.it.unwatched() if "SPAN" in one or "PROBE" in one]
    assert [one.asked for one in it.it.compared()] == [one.said for one in it.it.table.check]
    it.close()
