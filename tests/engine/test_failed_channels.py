"""A channel of a reader that fails does not stop the others, if the procedure's policy accepts it."""

from __future__ import annotations

import json
from math import nan
from pathlib import Path

import general_lab as lab
import pytest
from command import rig
from declared_bench import DeclaredBench, answers
from fake_lines import served

from rig.drivers.errors import BadReply, ChannelsFailed, InstrumentError
from rig.engine.session import Outcome
from rig.procedures.errors import DataError
from rig.procedures.general.for_budgets import general_evaluation
from rig.procedures.general.settings import GeneralFaults
from rig.run_file.events.bench import Fault
from rig.run_file.events.points import Observed
from rig.run_file.read.reader import RunReader
from rig.sims.declared.lines import LinesTwin
from rig.tables.table_of_run import run_table
from rig.verbs.instrument.check import check

SCANNER = """
maker = "ACME"
model = "G2"
[identity]
ask = "ID?"
answer = "{maker} {model}"
[reader]
unit = "V"
reading = { ask = "PR{channel}?", answer = "{state},{value:+.6e}", words = { 0 = "stable", 4 = "error: it is off" } }
[reader.channels]
hot = { is = "1" }
cold = { is = "2" }
"""
BENCH = (
    lab.SOURCE.partition("[instruments.dvm]")[0]
    + """
[instruments.scanner]
driver = "./scanner.toml"
address = "/dev/rig/scanner"
[sensors.hot]
reader = "scanner"
channel = "hot"
[sensors.cold]
reader = "scanner"
channel = "cold"
[factors]
input_V = "calibrator"
[limits]
input_V = [-8, 8]
"""
)
WORLD = """seed=2
[sensors.hot]
formula="1e-5 + 1.00002*input_V"
noise=1e-5
[sensors.cold]
formula="2*input_V"
noise=1e-5
[sources.input_V]
time_constant_s = 0.3
"""


class TestReader:
    def test_the_other_channels_are_read(self, scanner: DeclaredBench) -> None:
        answers(scanner, **{"PR2?": "4,+0.000000E+00"})
        scanner.it.start(3)
        with pytest.raises(ChannelsFailed, match=r"channel cold has no reading: .*asked 'PR2\?': it is off") as found:
            scanner.it.fetch()
        assert {name: len(one) for name, one in found.value.readings.items()} == {"hot": 3}
        assert scanner.sent[1:] == ["PR1?", "PR2?", "PR1?", "PR1?"]  # it is not asked again for the others' readings

    def test_a_check_shows_the_others(self) -> None:
        said = {"ID?": b"ACME G2\n", "PR1?": b"0,+1.000000E-03\n", "PR2?": b"4,+0.000000E+00\n"}
        with served(said.get) as address:
            steps = {step.what: step for step in check(SCANNER, "g", address, {}, None, 1.0).steps}
        found = steps["three readings of each channel"]
        assert not found.ok
        assert found.found.startswith("hot: 0.001, 0.001, 0.001 V; ")
        assert found.found.endswith("it is off")

    def test_a_register_without_a_number_is_its_channels_alone(self) -> None:
        """NaN of one temperature took the pressures away."""
        text = """
        maker = "ACME"
        model = "R1"
        [wire]
        protocol = "modbus"
        type = "float32"
        [identity]
        register = 100
        type = "uint16"
        is = 7
        [reader]
        unit = "bar"
        [reader.channels]
        p = { reading = { register = 2 } }
        t = { reading = { register = 4 } }
        """
        it = DeclaredBench(text, protocol="modbus")
        try:
            before = it.twin._shown
            it.twin._shown = lambda place, ask: nan if ask.register_ == 4 else before(place, ask)
            it.it.start(2)
            with pytest.raises(ChannelsFailed, match=r"channel t has no reading: .* NaN, no number") as found:
                it.it.fetch()
            assert len(found.value.readings["p"]) == 2
        finally:
            it.close()

    def test_all_of_them_are_an_error_of_the_instrument(self, scanner: DeclaredBench) -> None:
        answers(scanner, PR="4,+0.000000E+00")
        scanner.it.start(1)
        with pytest.raises(InstrumentError) as found:
            scanner.it.fetch()
        assert not isinstance(found.value, ChannelsFailed)

    def test_an_answer_that_makes_no_sense_is_one_of_the_wire(self, scanner: DeclaredBench) -> None:
        answers(scanner, **{"PR2?": "what"})
        scanner.it.start(1)
        with pytest.raises(BadReply):
            scanner.it.fetch()


@pytest.fixture
def scanner():
    it = DeclaredBench(SCANNER)
    it.it.identify()
    it.it.prepare()
    it.wire.clear()
    it.wire.append(("tx", b"begin\n"))
    yield it
    it.close()


def run(folder: Path, monkeypatch: pytest.MonkeyPatch, policy: str, fails: range):
    """A run in which the cold channel is off in some of its readings, counted from 0."""
    before, asked = LinesTwin._carried_out, []

    def carried_out(self: LinesTwin, line: str):  # type: ignore[no-untyped-def]
        if line == "PR2?":
            asked.append(line)
            if len(asked) - 1 in fails:
                return "4,+0.000000E+00", 0.0
        return before(self, line)

    monkeypatch.setattr(LinesTwin, "_carried_out", carried_out)
    (folder / "scanner.toml").write_text(SCANNER)
    procedure = f"{lab.SOURCE_PROCEDURE}[faults]\npause_s = 1\n{policy}"
    path, result = lab.run_dry(folder, procedure, BENCH, WORLD)
    with RunReader.open(path) as reader:
        return path, result, [one.event for one in reader.records()]


def test_a_failed_channel_is_a_missing_reading_with_its_reason(tmp_path, monkeypatch):
    """One sensor that died at night stopped all the others."""
    path, result, events = run(tmp_path, monkeypatch, 'channel = ["accept"]', range(12, 1000))
    assert result.outcome is Outcome.COMPLETE, result.message
    seen = [one for one in events if isinstance(one, Observed)]
    without = [one for one in seen if one.missing]
    assert len(seen) == 8
    assert len(without) == 6  # of five readings a point
    for one in without:
        assert one.accepted
        assert "missing" in one.flags
        assert set(one.outputs) == {"hot_V"}
        assert one.missing["cold_V"].endswith("it is off")
    assert rig("verify", path).returncode == 0
    fitted = json.loads(rig("fit", path, "--json").stdout)["sensors"]
    assert (fitted["hot_V"]["data"]["points"], fitted["cold_V"]["data"]["points"]) == (8, 2)
    assert any(
        note == "cold_V has no reading in 6 of 8 rows, and is evaluated without them"
        for note in fitted["hot_V"]["notes"]
    )
    exported = tmp_path / "x.csv"
    assert rig("export", path, "--out", exported).returncode == 0
    head, *rows = [line.split(",") for line in exported.read_text().splitlines()]
    assert sum(not row[head.index("cold_V")] for row in rows) == 6
    assert all(row[head.index("hot_V")] for row in rows)
    assert rig("trace", path, "--response", "hot_V").returncode == 0


def test_what_is_made_of_such_a_run_says_what_it_lacks(tmp_path, monkeypatch):
    path, _, _ = run(tmp_path, monkeypatch, 'channel = ["accept"]', range(27, 33))
    traced = json.loads(rig("trace", path, "--json").stdout)["sensors"]
    failed = "cold_V has no reading in 3 of 8 rows"
    assert traced["cold_V"]["notes"] == [f"{failed}, and is evaluated without them"]
    assert traced["hot_V"]["notes"] == []
    done = rig("confirm", path, "--dry")
    assert done.returncode == 2
    assert failed in done.stderr
    with pytest.raises(DataError, match=failed):
        general_evaluation(run_table(path), ())


def test_without_such_a_policy_it_is_an_error_of_the_instrument_with_the_others_readings(tmp_path, monkeypatch):
    _, result, events = run(tmp_path, monkeypatch, 'channel = ["retry 2", "abort"]', range(12, 1000))
    assert result.outcome is Outcome.FAULT
    faults = [one for one in events if isinstance(one, Fault)]
    assert [one.fault for one in faults] == ["channel"] * 3
    assert faults[0].message.startswith("no reading at point 2: cold_V: scanner at ")
    assert faults[0].message.endswith("asked 'PR2?': it is off")
    assert len(faults[0].evidence["readings"]["hot_V"]) == 5


def test_a_channel_that_comes_back_is_read_again(tmp_path, monkeypatch):
    _, result, events = run(tmp_path, monkeypatch, 'channel = ["retry 1", "accept"]', range(12, 13))
    assert result.outcome is Outcome.COMPLETE, result.message
    assert not any(one.missing for one in events if isinstance(one, Observed))


def test_the_policy_is_that_of_instrument_errors_where_none_is_written():
    assert GeneralFaults(instrument_error=["retry 1", "hold"]).plan("channel") == GeneralFaults(
        instrument_error=["retry 1", "hold"]
    ).plan("instrument_error")
