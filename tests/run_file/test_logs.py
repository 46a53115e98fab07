"""The log: what is in it, in which form, and that it decides nothing."""

from __future__ import annotations

import errno
import json
import os
import re

import pytest
from command import rig
from dry import LAB
from small_run import write_small

from rig.run_file.chain import Record, encode
from rig.unattended import Happening, Kind, Log, RunFacts
from rig.unattended.happenings import from_record
from rig.unattended.logs import file_writer, logged_by_journal

FACTS = RunFacts(None, "night-1", "lab", "night", simulated=False)


def happening(text, level="info"):
    return Happening(Kind.EVENT, level, text, 1_768_442_580.25, 60.0, {"point": 3})


def run(tmp_path, *more):
    procedure = write_small(tmp_path)
    return rig("run", procedure, "-b", LAB / "bench.toml", "--dry", "--out", tmp_path, *more)


def test_a_line_an_event_in_utc_with_what_happened(tmp_path):
    log = tmp_path / "night.log"
    done = run(tmp_path, "--log", log)
    assert done.returncode == 0, done.stderr
    lines = log.read_text().splitlines()
    stamp = re.compile(
        r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z (info   |warning|error  ) SIMULATED \d{8}T\d{6}-small-\w+: "
    )
    assert all(stamp.match(line) for line in lines), lines
    told = [stamp.sub("", line) for line in lines]
    for wanted in (
        "session 1 began",
        "homed",
        "observing",
        "6 of 12 points in",
        "parking",
        "done",
        "complete, 12 of 12",
    ):
        assert any(text.startswith(wanted) for text in told), (wanted, told)
    assert told.index("homed") < next(i for i, text in enumerate(told) if text.startswith("observing"))
    assert len(lines) < 40  # states of a point are not lines of their own
    assert [line[:24] for line in lines] == sorted(line[:24] for line in lines)


def test_json_lines_are_whole_objects_with_the_same_keys(tmp_path):
    log = tmp_path / "night.log"
    run(tmp_path, "--log", log, "--log-format", "json")
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert lines[0]["event"] == "start"
    assert lines[-1]["event"] == "finish"
    assert lines[-1]["outcome"] == "complete"
    for line in lines:
        assert line.keys() >= {"utc", "level", "event", "text", "run", "bench", "procedure", "simulated", "elapsed_s"}
        assert line["simulated"] is True


def test_a_dry_run_has_no_log_unless_asked_and_a_dash_is_stderr(tmp_path):
    quiet = run(tmp_path)
    assert not list(tmp_path.glob("*.log"))
    assert "homed" not in quiet.stderr
    told = run(tmp_path, "--log", "-")
    assert not list(tmp_path.glob("*.log"))
    assert "homed" in told.stderr


def test_a_record_with_fewer_fields_and_one_of_another_version_are_told_all_the_same():
    told = from_record(Record(1, "hold", 5.0, 5.0, 7, body=encode({"reason": "supply lost"})), after_crash=False)
    assert told is not None
    assert (told.kind, told.text) == (Kind.HOLD, "held at point 7")
    told = from_record(Record(1, "event", 5.0, 5.0, status="lamp-lit", body=encode({"why": "dusk"})), after_crash=False)
    assert told is not None
    assert (told.kind, told.text) == (Kind.EVENT, "event lamp lit: dusk")


@pytest.mark.parametrize("where", ["no/such/folder/night.log", "/dev/full"])
def test_a_log_that_cannot_be_written_costs_lines_and_nothing_else(tmp_path, where):
    done = run(tmp_path, "--log", tmp_path / where)
    assert done.returncode == 0, done.stderr
    assert "line(s) of the log could not be written" in done.stderr


def test_lines_lost_are_counted_in_the_next_one_that_gets_through():
    written, full = [], [True]

    def write(line):
        if full[0]:
            raise OSError(errno.ENOSPC, "full")
        written.append(line)

    log = Log(write)
    log.happened(happening("one"), FACTS)
    log.happened(happening("two"), FACTS)
    while log.lost < 2:
        pass
    full[0] = False
    log.happened(happening("three"), FACTS)
    log.close()
    assert [line.partition(": ")[2] for line in written] == ["three (2 line(s) before this one could not be written)"]


def test_the_file_may_be_rotated_at_any_time(tmp_path):
    path = tmp_path / "night.log"
    write = file_writer(path)
    write("one")
    path.rename(tmp_path / "night.log.1")
    write("two")
    assert path.read_text() == "two\n"
    assert (tmp_path / "night.log.1").read_text() == "one\n"


def test_control_characters_of_an_instrument_do_not_reach_the_log(tmp_path):
    body = encode({"message": "head: \x1b[2Jgone\nsecond\u2028line"})
    told = from_record(Record(1, "fault", 5.0, 5.0, 7, None, 1, "retry", body), after_crash=False)
    assert told is not None
    assert told.text == "fault at point 7: head:  [2Jgone; second line (retry)"
    assert told.kind is Kind.FAULT


def test_the_journal_is_told_the_priority(monkeypatch):
    written = []
    log = Log(written.append, journal=True)
    for level in ("info", "warning", "error"):
        log.happened(happening(level, level), FACTS)
    log.close()
    assert [line[:3] for line in written] == ["<6>", "<4>", "<3>"]
    found = os.fstat(2)
    monkeypatch.setenv("JOURNAL_STREAM", f"{found.st_dev}:{found.st_ino}")
    assert logged_by_journal()
    monkeypatch.setenv("JOURNAL_STREAM", "1:2")
    assert not logged_by_journal()
