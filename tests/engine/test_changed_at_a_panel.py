"""Numbers that an instrument changed under the run: a unit, a channel, a stale reading, a lost digit, a late alarm.

The instruments are of no twin: `tests/support/foreign_instruments.py`.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from few_points import accepted, records
from foreign_instruments import BENCH, PROCEDURE, Foreign

from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench
from rig.contracts.declared.units import same_unit
from rig.drivers.scpi_learned import PrintedForm, unit_after
from rig.engine.session import Outcome, Signals
from rig.instruments.opening import open_bench
from rig.run_file.read.reader import RunReader
from rig.run_file.state.lost_digits import lost_digit
from rig.run_file.verify.sense import judged
from rig.runs.controller import resume_run, start_run
from rig.runs.plans import load_plan
from rig.simulated.dry_run import DryBench
from rig.tables.table_of_run import run_table

UNIT = 'prepare = ["UNIT:TEMP C"]\ncheck = { "UNIT:TEMP?" = "C" }'
TERMINALS = 'check = { "ROUT:TERM?" = "FRON" }'


@pytest.fixture
def run(tmp_path):
    opened = []

    def go(it, levels, *, meter="", source="", replications=2, readings=1, signals=None):
        opened.append(it)
        bench, procedure = tmp_path / "bench.toml", tmp_path / "procedure.toml"
        bench.write_text(BENCH.format(ports=it.ports, meter=meter, source=source))
        procedure.write_text(PROCEDURE.format(levels=levels, replications=replications, readings=readings))
        paths: list[Path] = []
        result = start_run(
            load_plan(procedure, bench),
            tmp_path,
            announce=paths.append,
            on_progress=lambda _: None,
            signals=signals or Signals(),
        )
        return paths[0], result

    yield go
    for one in opened:
        one.close()


def means(path):
    return [round(r.data["outputs"]["probe_degC"]["mean"], 1) for r in accepted(path)]


def faults(path):
    return [r.data for r in records(path, "fault")]


def defects(path):
    with RunReader.open(path) as reader:
        return [str(one) for one in judged(reader, 100).findings]


def at(number, change):
    """Change the instrument at its panel before this reading, once."""
    return lambda n, it: change(it) if n == number else None


def to_fahrenheit(it):
    it.unit = "F"


def to_rear(it):
    it.terminals = "REAR"


def test_a_unit_changed_at_the_panel_is_found_after_the_readings_and_set_again(run):
    path, result = run(Foreign(at(3, to_fahrenheit)), [50, 100], meter=UNIT)
    assert result.outcome is Outcome.COMPLETE
    assert means(path) == [50.0, 100.0, 50.0, 100.0]
    (fault,) = faults(path)
    assert "UNIT:TEMP? answers F, not C: somebody has changed it" in fault["message"]
    assert fault["evidence"]["readings"]["probe_degC"] == [pytest.approx(122.0, abs=0.1)], "kept, and not used"
    assert defects(path) == []


def test_a_unit_in_the_replies_needs_no_question(run):
    it = Foreign(at(3, to_fahrenheit))
    it.with_unit = True
    path, result = run(it, [50, 100])
    assert result.outcome is Outcome.FAULT
    assert means(path) == [50.0, 100.0]
    assert "expected a number in degC, as in the bench file; was its unit changed at the panel?" in result.message
    it.unit = "C"  # somebody sets it back
    result = resume_run(path, on_progress=lambda _: None, signals=Signals())
    assert (result.outcome, means(path)) == (Outcome.COMPLETE, [50.0, 100.0, 50.0, 100.0])


def test_a_channel_that_no_command_can_set_back_stops_the_run_with_the_right_rows(run):
    path, result = run(Foreign(at(3, to_rear)), [150, 300], meter=TERMINALS)
    assert result.outcome is Outcome.FAULT
    assert means(path) == [150.0, 300.0]
    assert "ROUT:TERM? answers REAR, not FRON, after it was prepared" in result.message
    first = faults(path)[0]
    assert first["evidence"]["readings"]["probe_degC"] == [pytest.approx(250.0, abs=0.1)]


def test_the_previous_channels_value_once_after_a_switch_is_read_again_and_not_averaged(run):
    before = [0.0, 0.0]

    def values(true):
        if true != before[0]:
            before[:] = [true, before[0]]
            return before[1]
        return true

    it = Foreign()
    it.values = values
    path, result = run(it, [50, 150], replications=1, readings=2)
    assert result.outcome is Outcome.COMPLETE
    assert means(path) == [50.0, 150.0]
    (stale,) = accepted(path)[1].data["rejected"]
    assert stale["contradictory"] == "probe_degC"
    assert stale["outputs"]["probe_degC"]["mean"] == pytest.approx(100.0, abs=0.1)
    assert defects(path) == []


def test_the_previous_channels_value_at_every_measurement_is_flagged(run):
    it = Foreign()
    it.values = lambda true: 50.0 if it.taken % 2 else true
    path, result = run(it, [150, 300], replications=1, readings=2)
    assert result.outcome is Outcome.COMPLETE
    assert [r.data["flags"] for r in accepted(path)] == [["contradictory"]] * 2
    (warned,) = [r.data for r in records(path, "event", "warning")]
    assert "probe_degC reads from 50" in warned["message"]
    assert defects(path) == []


def test_noise_about_zero_at_the_first_points_is_read_again_and_not_flagged(run):
    it = Foreign()
    it.values = lambda true: true - 50.0
    path, result = run(it, [50, 60], replications=1, readings=3)
    assert result.outcome is Outcome.COMPLETE
    assert [r.data["flags"] for r in accepted(path)] == [[], []]


@pytest.mark.parametrize("resumed", [False, True])
def test_a_first_digit_that_is_lost_is_refused_and_asked_again(run, resumed):
    it, signals = Foreign(), Signals()
    it.printed = lambda text: text.replace("+1.", "+.") if it.taken == 9 else text

    def stop(n, it):
        signals.interrupt = "SIGTERM" if resumed and n == 8 else ""

    it.at_panel = stop
    path, result = run(it, [125, 150], readings=2, replications=3, signals=signals)
    if resumed:
        assert result.outcome is Outcome.INTERRUPTED
        result = resume_run(path, on_progress=lambda _: None, signals=Signals())
    assert result.outcome is Outcome.COMPLETE
    assert means(path) == [125.0, 150.0] * 3
    (fault,) = faults(path)
    assert "printed a reading as '+.24999" in fault["message"]
    assert [r.data["learned"]["readings"] for r in records(path, "event", "learned")] == [2, 4, 5]
    assert defects(path) == []


def test_a_first_point_whose_readings_are_all_what_the_meter_hangs_at_is_doubted(run):
    """A meter that hung at a spike from its first reading on was believed there, and found out at the next point."""
    it = Foreign()
    it.printed = lambda text: "+3.00010000E+01" if it.taken <= 6 else text
    path, result = run(it, [50, 100], readings=2)
    assert result.outcome is Outcome.COMPLETE
    assert means(path) == [30.0, 100.0, 50.0, 100.0]
    assert "probe_degC at point 1 hangs" in faults(path)[0]["message"]
    (warned,) = [r.data for r in records(path, "event", "warning")]
    assert warned["message"] == "point 0 is doubted: probe_degC hung there already, at 30.001"
    assert list(run_table(path, evidence=True).columns["flag_doubted"]) == [1.0, 0.0, 0.0, 0.0]
    assert defects(path) == []


def test_a_point_before_an_alarm_that_is_told_later_is_doubted(run):
    def probe(n, it):
        if n == 2:
            it.values = lambda true: -1.11  # and nothing tells
        elif n == 3:
            it.values = lambda true: true

    def told_at_the_next_setting(command):
        if command.startswith("SOUR:TEMP "):
            it.tripped = int(it.taken == 2)

    it = Foreign(probe)
    it.heard = told_at_the_next_setting
    path, result = run(it, [10, 30.001, 50], source='healthy = { "STAT:TRIP?" = 0 }', replications=1)
    assert means(path)[:2] == [10.0, -1.1]
    (warned,) = [r.data for r in records(path, "event", "warning")]
    assert warned["message"].startswith("point 1 is doubted: after its readings an instrument told of a defect")
    assert "STAT:TRIP? answers 1" in warned["message"]
    table = run_table(path, evidence=True)
    assert list(table.columns["flag_doubted"])[:2] == [0.0, 1.0]
    assert table.provenance["flags"] == {"doubted": 1}
    assert defects(path) == []
    assert result.outcome is Outcome.FAULT
    it.tripped, it.heard = 0, lambda command: None  # somebody resets it
    result = resume_run(path, on_progress=lambda _: None, signals=Signals())
    assert result.outcome is Outcome.COMPLETE
    assert len(records(path, "event", "warning")) == 1


# --- how readings are printed -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "number", "unit"),
    [
        ("50.0 C", "50.0", "C"),
        ("+1.22E+02 F", "+1.22E+02", "F"),
        ("+1.22E+02", "+1.22E+02", ""),
        ("1.5VDC", "1.5", "VDC"),
        ("2.912 kg/min", "2.912", "kg/min"),
    ],
)
def test_a_unit_after_a_number_is_recognised(text, number, unit):
    assert unit_after(text) == (number, unit)


@pytest.mark.parametrize(
    ("printed", "declared", "same"),
    [
        ("C", "degC", True),
        ("F", "degC", False),
        ("VDC", "V", True),
        ("mV", "V", False),
        ("kg/min", "kg_per_min", True),
        ("OHM", "ohm", True),
        ("g", "g", True),
        ("kg", "g", False),
    ],
)
def test_a_printed_unit_is_the_declared_one_or_not(printed, declared, same):
    assert same_unit(printed, declared) is same


NR3 = [f"{x:+.4E}" for x in (1.0, -20.0, 300.0, 0.0, 5e-5, 125.0)]


def test_a_form_is_learned_and_one_other_reading_is_refused():
    form = PrintedForm()
    assert form.strange(NR3) == ""
    assert form.strange(["+1.2500E+02", "+.2500E+02"]) == "+.2500E+02"
    assert form.strange(["1.2500E+02"]) == "", "twice in succession: it has no form"
    assert form.strange(["5"]) == ""


def test_numbers_with_an_exponent_that_differ_at_first_are_asked_again():
    """`rig night --lab any-bench --seed 4514`: two digits are lost from the first three readings of all."""
    form, cut = PrintedForm(), ["+2.7011140E+02", "+2.7011702E+02", "+2.7011043E+02"]
    whole = ["+2.701151140E+02", "+2.701185702E+02", "+2.701115043E+02"]
    assert form.strange([*cut, *whole]) == whole[0]
    assert form.strange([*whole, *whole]) == ""
    assert form.strange(cut) == cut[0]


def test_a_meter_whose_numbers_with_an_exponent_vary_is_asked_again_once():
    form, numbers = PrintedForm(), ["1.5E-05", "1.25E-05"] * 3
    assert [form.strange(numbers), form.strange(numbers), form.strange(["2E-05"])] == [numbers[1], "", ""]


def test_a_sign_that_is_always_there_cannot_be_lost():
    form = PrintedForm()
    assert form.strange(NR3) == ""
    assert form.strange(["2.0000E+01"]) == "2.0000E+01"


@pytest.mark.parametrize(
    "numbers", [["50", "50.1", "5e-05", "0.125", "1", "125", "25"], [str(x / 7) for x in range(20)]]
)
def test_a_meter_without_one_form_is_never_refused(numbers):
    form = PrintedForm()
    assert form.strange(numbers) == ""
    assert form.strange(["25", "1e3", "-0.5"]) == ""


@pytest.mark.parametrize("lost", ["125.0", "1250", ".50", "1.250"])
def test_a_number_of_decimals_is_learned(lost):
    form = PrintedForm()
    assert form.strange(["12.50", "-3.25", "0.00", "125.00", "9.75"]) == ""
    assert form.strange(["12.50", lost]) == lost


def test_a_meter_that_changes_its_range_keeps_the_number_of_digits():
    form = PrintedForm()
    assert form.strange(["1.2345", "1.5000", "0.9999", "1.0000", "1.1111"]) == ""
    assert form.strange(["12.345", "123.45", "-1.2345"]) == "", "another range is no lost character"
    again = PrintedForm()
    again.recall(form.learned)
    assert again.strange(["2.345"]) == "2.345"


@pytest.mark.parametrize("readings", [1, 2])
@pytest.mark.parametrize("resumed", [False, True])
def test_a_first_digit_that_plain_decimals_have_lost_is_read_again(run, readings, resumed):
    """The meter prints two decimals; 25.00 for 125.00 is no other form, and all readings of the point have lost it."""
    it, signals = Foreign(), Signals()
    wrong = range(5 * readings + 1, 6 * readings + 1)
    it.printed = lambda text: f"{float(text):.2f}"[it.taken in wrong :]
    it.at_panel = lambda n, it: setattr(signals, "interrupt", "SIGTERM" if resumed and n == 4 * readings else "")
    path, result = run(it, [12.5, 55, 125], readings=readings, replications=3, signals=signals)
    if resumed:
        assert result.outcome is Outcome.INTERRUPTED
        result = resume_run(path, on_progress=lambda _: None, signals=Signals())
    assert result.outcome is Outcome.COMPLETE
    assert means(path) == [12.5, 55.0, 125.0] * 3
    (rejected,) = [one for r in accepted(path) for one in r.data.get("rejected", [])]
    assert rejected["contradictory"] == "probe_degC"
    assert rejected["outputs"]["probe_degC"]["mean"] == pytest.approx(25.0, abs=0.1)
    assert defects(path) == []


def test_a_line_that_loses_every_first_digit_is_flagged_and_told(run):
    it = Foreign()
    it.printed = lambda text: f"{float(text):.2f}"[it.taken > 5 :]
    path, result = run(it, [12.5, 55, 125], readings=1, replications=3)
    assert result.outcome is Outcome.COMPLETE
    flagged = [r.run_index for r in accepted(path) if "contradictory" in r.data["flags"]]
    assert flagged == [5, 6, 7, 8]
    told = [r.data["message"] for r in records(path, "event", "warning") if r.data["cause"] == "contradictory"]
    assert "probe_degC reads 25 degC, and 125 degC at the same setting, as if a first digit were lost" in told[0]
    assert defects(path) == []


def test_a_first_digit_lost_in_the_first_replication_is_told_at_the_second(run):
    it = Foreign()
    it.printed = lambda text: f"{float(text):.2f}"[it.taken == 3 :]
    path, result = run(it, [12.5, 55, 125], readings=1, replications=2)
    assert result.outcome is Outcome.COMPLETE
    (warned,) = [r.data["message"] for r in records(path, "event", "warning")]
    assert warned.startswith("point 2: probe_degC reads 25 degC, and 125.01 degC at the same setting")
    assert defects(path) == []


@pytest.mark.parametrize(
    ("value", "whole", "lost"),
    [
        (2.5, 12.5, True),
        (25.0, 125.2, True),
        (-25.0, -125.0, True),
        (9.98, 100.02, True),
        (0.02, 10.03, True),
        (5.0, 55.0, True),
        (12.5, 125.0, False),
        (12.0, 12.5, False),
        (-2.5, 12.5, False),
        (0.5, 2.5, False),
        (3.9, 12.5, False),
        (math.nan, 12.5, False),
        (0.0, 0.0, False),
    ],
)
def test_which_differences_are_a_lost_digit(value, whole, lost):
    assert lost_digit(value, whole) is lost


def test_noise_about_zero_of_a_large_quantity_is_no_lost_digit(run):
    it = Foreign()
    it.values = lambda true: 1e5 * true + (13.0 if it.taken == 1 else 3.0 if it.taken == 3 else 0.0)
    path, result = run(it, [0, 350], readings=1, replications=2)
    assert result.outcome is Outcome.COMPLETE
    assert not any(r.data.get("rejected") for r in accepted(path))


# --- meters with a driver of their own --------------------------------------------------------------------------


@pytest.mark.parametrize("address", ["visa://GPIB0::22::INSTR", "/dev/rig/dvm"])
def test_a_meter_on_gpib_is_asked_for_its_settings_and_one_with_a_locked_panel_is_not(address):
    text = f'name = "x"\n[instruments.it]\ndriver = "keysight-34401a"\naddress = "{address}"\n'
    text += '[sensors.x]\naxis = "x"\nreader = "it"\n'
    sent = []
    dry = DryBench(
        parse_bench(text, "bench.toml"), {}, tap=lambda _, way, data: sent.append(data) if way == "tx" else None
    )
    try:
        it = open_bench(dry.config, check_options(dry.config, "x"), dry.world, dry.wires).instruments["it"]
        it.prepare()
        assert not it.wrong()
        sent.clear()
        dry.sim.twin("it").switch_on()  # as if *RST had been pressed at the panel
        said = it.wrong()
        assert bool(said) is bool(sent) is address.startswith("visa")
        assert not said or any("VOLT:DC:NPLC?" in one or "RANG" in one for one in said)
    finally:
        dry.close()
