"""`rig correct`: typed entries get another value, both are kept, and everything that uses them says so."""

from __future__ import annotations

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
from command import rig
from few_points import Killed, records
from general_lab import DVM, PROCEDURE, run_dry, written
from test_typed_readings import DIAL, bench, defects, world

from rig.engine.session import Outcome, Signals
from rig.run_file.chain import Record, encode
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import read_state
from rig.run_file.verify.verification import verify_file
from rig.run_file.write.writer import RunWriter
from rig.runs.controller import resume_run, start_run
from rig.runs.plans import load_plan
from rig.tables.table_of_run import run_table
from rig.unattended.earlier import ended_without_a_word
from rig.verbs.certificate.parts_in_words import deviations

WHY = "digits exchanged"


def correct(path, said="gauge_bar=4.2", point=2, *more):
    return rig("correct", path, said, "--point", point, "--why", WHY, "--operator", "A. Reader", *more)


@pytest.fixture
def run(tmp_path):
    path, result = run_dry(tmp_path, bench=bench(), world=world())
    assert result.outcome is Outcome.COMPLETE
    return path


def test_both_values_stay_and_tables_have_the_new_one(run):
    before = run_table(run).columns["gauge_bar"]
    assert correct(run).returncode == 0
    after = run_table(run)
    assert after.columns["gauge_bar"][2] == 4.2
    np.testing.assert_array_equal(np.delete(after.columns["gauge_bar"], 2), np.delete(before, 2))
    (record,) = records(run, "correction", None)
    said = "gauge_bar at point 2 was corrected by A. Reader: 4.02 bar became 4.2, because digits exchanged"
    assert record.sentence() == said
    observed = next(r for r in records(run) if r.accepted and r.run_index == 2)
    assert observed.event.outputs["gauge_bar"]["readings"] == [4.02], "what was recorded stays"
    found = verify_file(run)
    assert found.whole
    assert said in found.notes
    assert not run.with_suffix(".sqlite-wal").exists()
    assert "corrections of typed entries: 1" in rig("export", run, "--out", run.with_name("x.csv")).stderr


def test_a_correction_of_a_correction_keeps_all_three(run):
    assert correct(run).returncode == 0
    assert correct(run, "gauge_bar=4.04 bar").returncode == 0
    assert [(r.event.old, r.event.new) for r in records(run, "correction", None)] == [(4.02, 4.2), (4.2, 4.04)]
    assert run_table(run).columns["gauge_bar"][2] == 4.04
    assert defects(run) == []


@pytest.mark.parametrize(
    ("said", "point", "more", "says"),
    [
        ("cell_V=1.1", 2, (), "readings of instruments stay as they are"),
        ("gauge_bar=4.2", 99, (), "point 99 has no accepted observation with gauge_bar"),
        ("gauge_bar=4,2", 2, (), "with a point as its decimal sign"),
        ("gauge_bar", 2, (), "the reading is missing"),
        ("gauge_bar=4.2 kPa", 2, (), "is not a number; it is gauge_bar in bar"),
        ("gauge_bar=4.02", 2, (), "is 4.02 bar already; nothing was recorded"),
        ("gauge_bar=4.2", 2, ("--reading", "2"), "has 1 entries at point 2"),
        ("gauge_bar=4.2", 2, ("--why", " "), "a reason has 1 to 500 printable characters"),
    ],
)
def test_what_cannot_be_corrected_is_refused_and_the_file_stays(run, said, point, more, says):
    before = run.read_bytes()
    done = correct(run, said, point, *more)
    assert done.returncode == 2
    assert says in done.stderr
    assert run.read_bytes() == before
    assert [p.name for p in run.parent.glob(f"{run.stem}*")] == [run.name]


def test_one_of_two_entries_is_named(tmp_path):
    path, _ = run_dry(tmp_path, bench=bench(f"{DIAL}twice = true\n"), world=world())
    assert "was typed 2 times at point 2 (1: 4.02, 2: 4.02): say which, --reading N" in correct(path).stderr
    assert correct(path, "gauge_bar=4.04", 2, "--reading", "2").returncode == 0
    assert run_table(path).columns["gauge_bar"][2] == pytest.approx(4.03)


def test_the_formula_of_a_standard_is_used_again(tmp_path):
    standard = '[references.force_kN]\nreader = "operator"\nchannel = "dial"\nformula = "0.5 * reading"\n'
    of = f'{world().partition("[sensors.gauge]")[0]}[references.force_kN]\nformula = "2*force_kN"\n'
    path, _ = run_dry(tmp_path, bench=bench(DIAL, standard), world=of)
    assert correct(path, "force_kN=4.02").returncode == 0
    assert run_table(path).columns["force_kN"][2] == pytest.approx(2.01)
    assert defects(path) == []


def test_an_interrupted_run_is_corrected_and_goes_on(tmp_path):
    files = written(tmp_path, bench=bench(), world=world())
    plan = load_plan(files[0], files[1], dry=True, world=files[2])
    paths = []

    def killed(news):
        if news.done == 5:
            raise Killed

    with pytest.raises(Killed):
        start_run(plan, tmp_path, announce=paths.append, on_progress=killed, signals=Signals())
    assert correct(paths[0]).returncode == 0
    assert resume_run(paths[0], on_progress=lambda _: None, signals=Signals()).outcome is Outcome.COMPLETE
    assert run_table(paths[0]).columns["gauge_bar"][2] == 4.2
    assert defects(paths[0]) == []


def test_a_certificate_is_not_contradicted_without_a_word(run):
    with RunReader.open(run) as reader:
        head = reader.head()[1].hex()
    folder = run.parent / "certificates"
    folder.mkdir()
    (folder / "C-1.json").write_text(json.dumps({"evidence": [{"head": head}]}))
    refused = correct(run)
    assert refused.returncode == 2
    assert "certificate C-1 was issued of this run" in refused.stderr
    assert correct(run, "gauge_bar=4.2", 2, "--after", "C-1").returncode == 0
    (record,) = records(run, "correction", None)
    assert "corrected by A. Reader, after certificate C-1: 4.02 bar" in record.sentence()


def test_the_register_of_issued_numbers_is_asked(run):
    settings = run.parent / "certificate.toml"
    settings.write_text('number = "C-{next}"\n')
    with RunReader.open(run) as reader:
        run_id = reader.about().run_id
    entry = {"number": "C-7", "issued": "2026-11-28", "runs": [run_id], "folder": "elsewhere", "sha256": "0"}
    (run.parent / "issued.json").write_text(json.dumps([entry]))
    assert "certificate C-7 was issued" in correct(run, "gauge_bar=4.2", 2, "--settings", settings).stderr
    assert correct(run, "gauge_bar=4.2", 2, "--settings", settings, "--after", "C-7").returncode == 0


def test_the_report_shows_both_values(run):
    assert correct(run).returncode == 0
    report = run.with_name("report.html")
    assert rig("trace", run, "--report", report).returncode == 0
    assert "<td>typed entries corrected</td><td>gauge_bar at point 2 was corrected by A. Reader" in report.read_text()


def test_what_is_salvaged_is_corrected(run):
    assert correct(run).returncode == 0
    assert run_table(run, salvage=True).columns["gauge_bar"][2] == 4.2


def test_a_correction_is_no_crash(tmp_path):
    path, _ = run_dry(tmp_path, bench=bench(), world=world())
    with RunReader.open(path) as reader:
        before = ended_without_a_word(reader)
    assert correct(path).returncode == 0
    with RunReader.open(path) as reader:
        assert ended_without_a_word(reader) is before


@pytest.mark.parametrize(
    ("forged", "says"),
    [
        ({"old": 7.0}, "the entry that it corrects is 4.02, not 7.0"),
        ({"readings": [9.0]}, "its readings of gauge_bar do not follow from the entries"),
        ({"column": "cell_V"}, "no entry 1 of cell_V was typed at its point"),
    ],
)
def test_a_correction_that_no_command_wrote_is_found(run, forged, says):
    body = {"column": "gauge_bar", "number": 1, "unit": "bar", "old": 4.02, "new": 4.2, "readings": [4.2], "why": WHY}
    last = records(run)[-1]
    with RunWriter.open(run) as writer:
        record = Record(1, "correction", last.elapsed_s, last.utc_s, 2, body=encode({**body, **forged}))
        writer.correct(record, ended=True)
    assert says in str(defects(run)[0])


def test_other_records_after_the_end_are_still_found(run):
    assert correct(run).returncode == 0
    last = records(run)[-1]
    with RunWriter.open(run) as writer:
        writer.append(Record(1, "event", last.elapsed_s, last.utc_s, status="prepared", body="{}"))
    assert "is the end of the run, and 1 record(s) follow" in str(verify_file(run).findings[0])


def test_the_certificate_states_the_number_and_both_values(run):
    assert correct(run).returncode == 0
    of = SimpleNamespace(table=run_table(run), corrected=())
    with RunReader.open(run) as reader:
        found = list(deviations(of, read_state(reader), "", (None, None)))
    assert "Entries that a person had typed were corrected after their acceptance, once." in found
    assert re.search(
        r"by A\. Reader: 4\.02 bar became 4\.2, because digits exchanged \(force 2 kN; on \d{4}-\d\d-\d\d\)\.$",
        found[-1],
    ), "what was altered, by whom, why, and when (ISO/IEC 17025, 7.5.2)"


def test_a_run_that_people_alone_have_read_is_verified(tmp_path):
    """Readings that are typed take no time of a meter."""
    text = bench().replace(DVM, "").replace('[sensors.cell]\nreader = "dvm"\n', "")
    truth = 'seed = 3\n[sensors.gauge]\nformula = "2*force_kN + 0.013"\n'
    once = PROCEDURE.replace("readings = 3", "readings = 1")
    path, result = run_dry(tmp_path, once, text, truth)
    assert result.outcome is Outcome.COMPLETE
    assert verify_file(path).whole
    assert correct(path).returncode == 0
    assert defects(path) == []
