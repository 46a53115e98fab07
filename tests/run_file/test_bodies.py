"""What is read from a run file is of the kind it has to be, or one sentence names record, field and what is wrong."""

from __future__ import annotations

import contextlib
import json
import shutil
import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest
from command import rig

from proving.crashes.damages import small_finished
from proving.doors.hostile import Seeded, command
from proving.doors.of_runs import Image
from rig.errors import ConfigurationError, RunFileError, UsageError
from rig.run_file.bodies import ContentsError
from rig.run_file.chain import Record
from rig.run_file.events.event import body_of
from rig.run_file.read.reader import RunReader
from rig.run_file.state.documents import declared_model, mounting_of
from rig.run_file.state.state import read_state
from rig.run_file.verify.verification import verify_file
from rig.runs.plans import stored_plan
from rig.tables.table_of_run import run_table
from rig.unattended.systemd_unit import ServiceUnit
from rig.verbs.page import story
from rig.watch.feed import RunFeed


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    return small_finished("attitude", tmp_path_factory.mktemp("whole"))


def body(values: object, kind: str = "event", status: str | None = "safe") -> object:
    return body_of(json.dumps(values), kind, status, lambda: "record 7 (event)")


NEEDED = {
    "event": {"planned": 1},
    "session": {"clock_s": 0.0, "elapsed_s": 0.0},
    "fault": {"message": "it smokes"},
    "run": {"run_id": "r", "simulated": True, "documents": {}, "run_list": "", "points": 1, "seed": 1},
}


def forged(whole: Path, path: Path, kind: str, changes: dict[str, object], status: str | None = None) -> Path:
    """The first record of a kind with other fields, and every hash made again."""
    image = Image.of(whole)
    row = next(r for r in image.records if r[2] == kind and status in (None, r[8]))
    row[9] = json.dumps({**json.loads(row[9]), **changes})
    image.rechain()
    image.write(path, Seeded("bodies", 0), under_way=False)
    return path


@pytest.mark.parametrize(
    ("kind", "status", "field", "value", "words"),
    [
        ("event", "safe", "seconds", "x", "a number of seconds"),
        ("event", "safe", "unsafe", "head", "a list of texts"),
        ("event", "whole-plot", "setpoints_degC", {"a": None}, "numbers by name"),
        ("session", None, "gap_s", 1e300, "a number of seconds"),
        ("fault", "retry", "failure", True, "a whole number from 0 on"),
        ("identity", "head", "serial", ["x"], "a text or nothing"),
        ("observation", "accepted", "outputs", {"x_V": {"mean": 1.0, "sd": "0", "readings": []}}, "mean, sd"),
        ("observation", "accepted", "measured_s", [1.0], "two numbers"),
        ("run", None, "seed", 10**400, "a whole number"),
    ],
)
def test_a_field_of_another_kind_is_named(kind, status, field, value, words):
    with pytest.raises(ContentsError, match=rf"record 7 \(event\): its {field} cannot be .*it has to be {words}"):
        body({**NEEDED.get(kind, {}), field: value}, kind, status)


def test_a_field_that_is_missing_is_named_where_it_is_needed():
    assert body({"seconds": 2.0}) == {"seconds": 2.0}
    with pytest.raises(ContentsError, match=r"record 7 \(event\): its body has no message"):
        body({"fault": "noisy"}, "fault", "retry")


@pytest.mark.parametrize("text", ["[1]", "{", "[" * 5000, '{"a": 1} x', b"{}", None])
def test_a_body_that_is_no_object(text):
    with pytest.raises(ContentsError, match="its body is"):
        body_of(text, "event", None, lambda: "record 7")


def test_a_record_says_which_it_is():
    record = Record(1, "fault", 0.0, 0.0, run_index=3, body='{"message": 5}')
    record.seq = 12
    with pytest.raises(ContentsError, match=r"record 12 \(fault of point 3\): its message cannot be 5"):
        record.data["message"]


def test_every_reader_says_file_record_and_field(whole, tmp_path):
    path = forged(whole, tmp_path / "f.sqlite", "session", {"gap_s": "long"})
    (finding,) = verify_file(path).findings
    assert "its gap_s cannot be 'long', it has to be a number of seconds" in str(finding)
    for read in (story, run_table, lambda p: read_state(RunReader.open(p))):
        with pytest.raises(RunFileError, match=r"f\.sqlite .*gap_s cannot be 'long'"):
            read(path)
    feed = RunFeed(path, None, lambda: 0.0, lambda: 2e9)
    feed.refresh()
    assert "its gap_s cannot be 'long'" in feed.view()["state"]["error"]
    for asked in (("status", path), ("export", path, "--all", "--out", tmp_path / "o.csv"), ("fit", path)):
        done = rig(*asked)
        assert (done.returncode, "unforeseen" in done.stderr) == (1, False), done.stderr


def test_an_observation_of_other_kinds_is_left_out_of_what_is_salvaged(whole, tmp_path):
    bad = {"x_V": {"mean": "0.1", "sd": 0.0, "readings": []}}
    path = forged(whole, tmp_path / "f.sqlite", "observation", {"outputs": bad})
    with pytest.raises(RunFileError, match=r"observation of point \d+\): its outputs cannot be"):
        run_table(path)
    assert len(run_table(path, salvage=True)) == len(run_table(whole)) - 1


def test_a_mistake_of_ours_is_not_called_one_of_the_file(whole):
    with pytest.raises(KeyError), RunReader.open(whole):
        raise KeyError("a mistake")
    with pytest.raises(RunFileError, match="holds what makes no sense"), RunReader.open(whole):
        raise ContentsError("record 1: nonsense")


def test_a_run_without_its_procedure(whole, tmp_path):
    path = tmp_path / "f.sqlite"
    image = Image.of(whole)
    image.documents = [row for row in image.documents if row[0] != "procedure.toml"]
    image.rechain()
    image.write(path, Seeded("bodies", 0), under_way=False)
    with RunReader.open(path) as run, pytest.raises(ConfigurationError, match=r"there is no procedure\.toml"):
        stored_plan(run, path, None)


@pytest.mark.parametrize(
    ("column", "value"), [("pitch_deg", "'x'"), ("replication", "-3"), ("whole_plot", "0.5"), ("pitch_deg_side", "'x'")]
)
def test_points_of_other_kinds(whole, tmp_path, column, value):
    path = tmp_path / "f.sqlite"
    shutil.copy(whole, path)
    db = sqlite3.connect(path)
    db.execute("DROP TRIGGER point_refuses_update")
    db.execute("PRAGMA writable_schema = ON")
    (strict,) = db.execute("SELECT sql FROM sqlite_master WHERE name = 'point'").fetchone()
    db.execute("UPDATE sqlite_master SET sql = replace(sql, 'STRICT', '') WHERE name = 'point'")
    db.commit()
    db.close()
    db = sqlite3.connect(path)
    db.execute(f"UPDATE point SET {column} = {value} WHERE run_index = 4")
    db.execute("PRAGMA writable_schema = ON")
    db.execute("UPDATE sqlite_master SET sql = ? WHERE name = 'point'", (strict,))
    db.commit()
    db.close()
    with pytest.raises(RunFileError, match="point 4 of the run list cannot be"), RunReader.open(path) as run:
        run.run_list()


@pytest.mark.parametrize("text", ["[model]\nformula = 3", "model = 3", "[mounting]\nx_deg = 'a'", "[" * 3000])
def test_documents_of_other_kinds(text):
    documents = {"procedure.toml": text}
    with pytest.raises(ContentsError, match=r"procedure\.toml"):
        assert (declared_model(documents), mounting_of(documents)) == ({}, {})


def test_columns_of_other_kinds_are_told_as_json_too(whole, tmp_path):
    path = tmp_path / "f.sqlite"
    image = Image.of(whole)
    image.records[5][2] = b"x"
    image.records[7][5] = b"y"
    del image.records[9]
    for number, row in enumerate(image.records, 1):
        row[0] = number + 1
    image.write(path, Seeded("bodies", 0), under_way=False)
    done = rig("verify", path, "--json")
    assert (done.returncode, "unforeseen" in done.stderr) == (1, False), done.stderr
    assert json.loads(done.stdout)["findings"]


def test_a_file_that_does_not_begin_with_its_run(whole, tmp_path):
    path = tmp_path / "f.sqlite"
    image = Image.of(whole)
    image.records[0][2] = "hold"
    image.records[0][9] = json.dumps({"documents": [1]})
    image.rechain()
    image.write(path, Seeded("bodies", 0), under_way=False)
    for read in (run_table, story):
        with pytest.raises(RunFileError):
            read(path)
    assert any("not what a run begins with" in str(finding) for finding in verify_file(path).findings)


def test_half_a_character_is_written_out(whole, tmp_path):
    path = forged(whole, tmp_path / "f.sqlite", "run", {"procedure": "\ud800x"})
    assert "\\xd800x" in command("status", path)
    image = Image.of(path)
    image.records[-2][9] = json.dumps({"message": "\ud800 smoke"})
    image.records[-2][2] = "fault"
    image.rechain()
    image.write(path, Seeded("bodies", 0), under_way=False)
    command("export", path, "--all", "--out", tmp_path / "o.csv")
    assert "\\ud800 smoke" in (tmp_path / "o.faults.csv").read_text()


def test_a_unit_is_text(tmp_path):
    unit = ServiceUnit(tmp_path / "r.sqlite", "r", "\ud800 on x", system=False, user="u")
    assert unit.text().encode()
    with pytest.raises(UsageError, match="bytes that are no text"):
        replace(unit, run=tmp_path / "\udcff.sqlite").check_paths()


def test_the_status_of_another_kind_of_record(whole, tmp_path):
    path = tmp_path / "f.sqlite"
    image = Image.of(whole)
    image.records[3][8:10] = "whole-plot-lost", json.dumps({"first": "a", "count": []})
    assert image.records[3][2] != "event"
    image.records[3][6] = 1
    image.rechain()
    image.write(path, Seeded("bodies", 0), under_way=False)
    for read in (story, verify_file):
        with contextlib.suppress(RunFileError):
            read(path)


def test_why_a_point_was_skipped_is_shown_as_it_is(whole, tmp_path):
    path = tmp_path / "f.sqlite"
    image = Image.of(whole)
    at = next(n for n, row in enumerate(image.records) if row[2] == "skip" and row[8] == "final")
    image.records[at][9] = json.dumps({"reason": "[/] no [red]reply"})
    image.rechain()
    image.write(path, Seeded("bodies", 0), under_way=False)
    done = rig("export", path, "--out", tmp_path / "o.csv")
    assert done.returncode == 0, done.stderr
    assert "[/] no [red]reply" in done.stderr
