"""The time between two sessions, where a clock was wrong; and room for a run, where there is none."""

from __future__ import annotations

import os
import resource
import time
from dataclasses import dataclass

import pytest
from command import rig
from dry import LAB
from ideal_bench import PROCEDURE, ideal_bench, new_run, run_session
from small_run import write_small

from rig.engine.gap import gap_since
from rig.engine.sequencer import Sequencer
from rig.engine.session import Outcome, Session, Signals
from rig.run_file.chain import Record, encode
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import RunState, fold
from rig.run_file.write.writer import RunWriter
from rig.sims.world import World

DAY, YEAR = 86400.0, 365.25 * 86400.0
NOON = 1.8e9  # in 2027


@dataclass
class Times:
    """A machine that has just been restarted."""

    utc_s: float

    def now(self):
        return 50.0

    def utc(self):
        return self.utc_s


def after(*sessions):
    """What a run has come to after sessions of (UTC at the beginning, seconds they lasted), each on its own boot."""
    state = RunState()
    elapsed = 0.0
    for number, (utc_s, lasted) in enumerate(sessions, 1):
        body = encode({"clock_s": 7.0, "elapsed_s": elapsed, "boot": str(number)})
        state.add(Record(number, "session", elapsed, utc_s, body=body))
        elapsed += lasted
        state.add(Record(number, "event", elapsed, utc_s + lasted, status="homed"))
    return state


@pytest.mark.parametrize(
    ("sessions", "utc_s", "gap_s", "known"),
    [
        ([(NOON, 100.0)], NOON + 400.0, 300.0, True),
        ([(NOON, 100.0)], NOON + 40.0, 0.0, True),  # set back a little
        ([(NOON, 100.0)], NOON - 8 * YEAR, 0.0, False),  # a battery that died
        ([(NOON, 100.0)], 5.0, 0.0, False),
        ([(5.0, 100.0)], NOON, 0.0, False),  # it had died before
        ([(NOON, 100.0), (5.0, 200.0)], NOON + 400.0, 100.0, True),  # and was changed: the first session knows
        ([(NOON, 100.0), (NOON + 10 * YEAR, 200.0)], NOON + 400.0, 0.0, False),
        ([(NOON, 100.0)], NOON + 2 * YEAR, 0.0, False),
        ([(NOON, 100.0)], NOON + 90 * DAY, 90 * DAY - 100.0, True),
        ([(NOON, 100.0)], NOON + 100.0 - 120.0, 0.0, True),  # the limits themselves still count
        ([(NOON, 100.0)], NOON + 100.0 - 120.5, 0.0, False),
        ([(NOON, 100.0)], NOON + 100.0 + 366 * DAY, 366 * DAY, True),
        ([(NOON, 100.0)], NOON + 100.5 + 366 * DAY, 0.0, False),
        ([(NOON, 100.0), (5.0, 200.0)], NOON + 300.0, 0.0, True),
        ([(NOON, 100.0), (5.0, 200.0)], NOON + 300.5, 0.5, True),
        ([(NOON, 100.0), (5.0, 200.0)], NOON + 299.5, 0.0, False),
        ([(NOON, 100.0), (5.0, 200.0)], NOON + 300.0 + 366 * DAY, 366 * DAY, True),
        ([(NOON, 100.0), (5.0, 200.0)], NOON + 300.5 + 366 * DAY, 0.0, False),
    ],
)
def test_the_gap_by_utc_and_what_it_is_worth(sessions, utc_s, gap_s, known):
    state = after(*sessions)
    gap = gap_since(state, Times(utc_s), "another boot")
    assert 50.0 - gap.origin - state.elapsed_s == pytest.approx(gap_s, abs=1e-3)
    assert (gap.certain, gap.known) == (False, known)
    assert bool(gap.warning) == (not known or len(sessions) > 1)


def test_a_clock_that_went_on_is_believed_whatever_utc_says():
    gap = gap_since(after((NOON, 20.0)), Times(NOON - 30 * YEAR), "1")
    assert (gap.certain, gap.known, gap.warning) == (True, True, "")
    assert gap.origin == 7.0


def test_before_the_first_session_there_is_no_gap():
    assert gap_since(RunState(), Times(NOON), "1").origin == 50.0


def test_a_clock_that_went_on_through_several_sessions_counts_from_the_first():
    state = after((NOON, 20.0), (NOON + 60.0, 10.0))  # its second session began with 20 s behind it
    gap = gap_since(state, Times(NOON + 90.0), "2")
    assert gap.origin == 7.0 - 20.0


@pytest.mark.parametrize(
    ("sessions", "then"),
    [
        ([(1.0e9, 0.0), (5.0, 200.0)], "an earlier session's is taken"),
        ([(5.0, 200.0)], "the gap is not known; set the clock"),
    ],
)
def test_a_wrong_clock_is_told_with_both_times(sessions, then, monkeypatch):
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    time.tzset()
    try:
        assert gap_since(after(*sessions), Times(1.0e9 + 3600.0), "another boot").warning == (
            "the machine's clock was wrong or is: it says 2001-09-09 02:46, the last record 1970-01-01 00:03 UTC, "
            f"with a restart between them; {then}"
        )
    finally:
        monkeypatch.undo()
        time.tzset()


def test_a_clock_that_was_put_back_without_a_restart_knows_no_gap():
    gap = gap_since(after((NOON, 100.0)), Times(NOON + 400.0), "1")  # at 50 s, the last record at 107 s
    assert (gap.certain, gap.known) == (False, False)
    assert 50.0 - gap.origin == 100.0
    assert "57 s behind the last record's" in gap.warning


@pytest.mark.parametrize("known", [True, False])
def test_after_a_gap_that_nobody_knows_what_was_prepared_is_prepared_again(tmp_path, known):
    path, signals = new_run(tmp_path), Signals()

    def progress(told):
        if told.done == 3:
            signals.interrupt = "SIGTERM"

    assert run_session(path, signals=signals, on_progress=progress)[0] is Outcome.INTERRUPTED
    with RunWriter.open(path) as run:
        state = fold(run.records())
        world = World(state.elapsed_s)
        bench, head, _ = ideal_bench(world)
        head.homed = True
        sequencer = Sequencer(
            bench=bench,
            run=run,
            state=state,
            run_list=PROCEDURE.expand(),
            conduct=PROCEDURE.conduct,
            clock=world,
            session=Session(0.0, 2, False, frozenset(), {"pid": 1}, gap_known=known),
            signals=Signals(),
            on_progress=lambda _: None,
        )
        assert sequencer.run() is Outcome.COMPLETE
    with RunReader.open(path) as reader:
        prepared = [r for r in reader.records("event") if r.status == "prepared"]
        told = list(reader.records("session"))[1].data
    assert len(prepared) == (1 if known else 2)
    assert told["gap_known"] is known


# --- room -------------------------------------------------------------------------------------------------------------


def test_a_limit_on_the_size_of_files_is_found_before_anything_moves(tmp_path, monkeypatch):
    arguments = (write_small(tmp_path), "-b", LAB / "bench.toml", "--dry", "--out", tmp_path / "runs")
    path = rig("run", *arguments, "--create-only").stdout.strip()
    monkeypatch.setattr(resource, "getrlimit", lambda _: (1_000_000, resource.RLIM_INFINITY))
    for refused in (rig("run", *arguments), rig("resume", path)):
        assert refused.returncode == 1
        assert "files of at most 1.0 MB, but the run may need 10 MB: raise the limit (ulimit -f" in refused.stderr
    seen = rig("doctor", *arguments[1:4], "--procedure", arguments[0], "--out", tmp_path, "--json")
    assert "the size of files is limited to 1.0 MB here" in seen.stdout


@pytest.mark.parametrize("what", ["file", "folder"])
def test_a_run_in_a_place_that_may_only_be_read_is_not_begun_again_and_the_way_out_is_named(
    tmp_path, monkeypatch, what
):
    made = rig("run", write_small(tmp_path), "-b", LAB / "bench.toml", "--dry", "--out", tmp_path, "--create-only")
    path = made.stdout.strip()
    closed = path if what == "file" else str(tmp_path)
    monkeypatch.setattr("rig.files.disk_space.os.access", lambda place, how: not how & os.W_OK or str(place) != closed)
    refused = rig("resume", path)
    assert refused.returncode == 2
    assert f"{closed} cannot be written to" in refused.stderr
    assert f"copy {path} elsewhere" in refused.stderr
    assert rig("status", path).returncode == 0


def test_a_full_disk_offers_a_new_run_another_folder_and_one_that_goes_on_a_copy(tmp_path, monkeypatch):
    arguments = (write_small(tmp_path), "-b", LAB / "bench.toml", "--dry", "--out", tmp_path)
    path = rig("run", *arguments, "--create-only").stdout.strip()
    monkeypatch.setattr("rig.files.disk_space.needed_bytes", lambda _: 1 << 60)
    begun, resumed = rig("run", *arguments), rig("resume", path)
    assert begun.returncode == resumed.returncode == 1
    assert "another folder with --out" in begun.stderr
    assert f"copy {path} to another disk, with its -wal" in resumed.stderr
