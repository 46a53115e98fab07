"""The run file: durable, append-only, self-checking, never half there."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import apsw
import pytest

from rig.errors import BusyError, RunFileError, StorageError, UsageError
from rig.procedures.plan.run_list import Factor, Point, RunList
from rig.run_file import storage, wal
from rig.run_file.chain import Record, encode
from rig.run_file.last_word import read_last_word
from rig.run_file.live import live_path, read_json, read_live, request_path
from rig.run_file.read.reader import RunReader
from rig.run_file.state.elsewhere import goes_on_in
from rig.run_file.state.state import fold
from rig.run_file.verify.verification import verify_file
from rig.run_file.write.creation import Genesis, create
from rig.run_file.write.writer import RunWriter

RUN_LIST = RunList(
    (Factor("pitch_deg", "pitch", 2.0), Factor("roll_deg", "roll", 2.0)),
    tuple(Point(i, 1 + i // 5, None, (10.0 * i, -30.0), (1, -1)) for i in range(10)),
    seed=3,
)


def genesis() -> Genesis:
    return Genesis("a-run", {"bench.toml": "name = 'b'", "procedure.toml": "x = 1"}, RUN_LIST, True, {"bench": "b"})


def observation(index: int, status: str = "accepted") -> Record:
    body = encode({"outputs": {"x_V": {"mean": 0.1 * index, "sd": 0.0, "readings": [0.1 * index]}}})
    return Record(1, "observation", 10.0 * index, 1e9 + index, index, None, 1, status, body)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "a-run.sqlite"
    create(path, genesis(), elapsed_s=0.0, utc_s=1e9)
    return path


def test_what_was_put_in_comes_out(path):
    with RunWriter.open(path) as run:
        for i in range(3):
            run.append(observation(i))
    with RunReader.open(path) as reader:
        assert reader.run_list() == RUN_LIST
        assert reader.documents() == dict(genesis().documents)
        assert [r.data["outputs"]["x_V"]["mean"] for r in reader.records("observation")] == [0.0, 0.1, 0.2]
        state = fold(reader.records())
    assert state.accepted == {0, 1, 2}
    assert state.remaining == 7


def test_a_second_accepted_observation_of_a_point_is_impossible(path):
    with RunWriter.open(path) as run:
        run.append(observation(4))
        run.append(observation(4, "rejected"))
        with pytest.raises(apsw.ConstraintError):
            run.append(observation(4))


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE record SET elapsed_s = 0",
        "DELETE FROM record",
        "UPDATE point SET pitch_deg = 0",
        "DELETE FROM document",
        "UPDATE factor SET overtravel = 0",
    ],
)
def test_the_file_refuses_to_be_changed(path, statement):
    with (
        contextlib.closing(sqlite3.connect(path)) as db,
        pytest.raises(sqlite3.IntegrityError, match="append-only"),
    ):
        db.execute(statement)


@pytest.mark.parametrize(
    ("tampering", "says"),
    [
        ("UPDATE record SET body = '{}' WHERE seq = 3", "record 3 (observation of point 1) was changed"),
        ("UPDATE record SET utc_s = utc_s + 1 WHERE seq = 2", "record 2 (observation of point 0) was changed"),
        ("DELETE FROM record WHERE seq = 3", "record 3 is missing"),
        ("UPDATE document SET body = 'name = 1' WHERE name = 'bench.toml'", "document bench.toml is not the one"),
        ("UPDATE point SET pitch_deg = 1 WHERE run_index = 2", "run list is not the one"),
        ("INSERT INTO document VALUES ('x', 'y')", "document x was added"),
    ],
)
def test_an_edit_behind_its_back_is_found_and_named(path, tampering, says):
    with RunWriter.open(path) as run:
        for i in range(4):
            run.append(observation(i))
    with sqlite3.connect(path) as db:
        for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            db.execute(f"DROP TRIGGER {name}")
        db.execute(tampering)
    db.close()
    with RunReader.open(path) as reader, pytest.raises(RunFileError) as caught:
        reader.verify()
    assert says in str(caught.value)
    with pytest.raises(RunFileError):
        RunWriter.open(path)


def test_a_finished_run_is_one_ordinary_file_and_a_cut_tail_shows(path):
    with RunWriter.open(path) as run:
        run.append(observation(0))
        run.finish(Record(1, "end", 20.0, 1e9, status="complete"))
    assert [p.name for p in path.parent.iterdir()] == [path.name]
    with RunReader.open(path) as reader:
        reader.verify()
        assert fold(reader.records()).ended == "complete"


def test_only_one_controller_at_a_time(path):
    with RunWriter.open(path), pytest.raises(BusyError, match="in use by another controller"):
        RunWriter.open(path)
    RunWriter.open(path).close()


def test_a_reader_that_is_still_looking_does_not_turn_the_end_into_a_fault(path):
    with RunWriter.open(path) as run:
        run.append(observation(0))
        with sqlite3.connect(path) as looking:
            looking.execute("BEGIN")
            looking.execute("SELECT count(*) FROM record").fetchall()
            run.finish(Record(1, "end", 20.0, 1e9, status="complete"))
        looking.close()
    with RunReader.open(path) as reader:
        reader.verify()
        assert fold(reader.records()).ended == "complete"


def test_readers_do_not_disturb_the_writer(path):
    with RunWriter.open(path) as run, RunReader.open(path) as reader:
        for i in range(5):
            run.append(observation(i))
            assert len(fold(reader.records()).accepted) == i + 1


def test_uncommitted_records_become_durable_with_the_next_commit(path):
    with RunWriter.open(path) as run:
        run.append(observation(0), commit=False)
        with RunReader.open(path) as reader:
            assert not fold(reader.records()).accepted
        run.append(observation(1))
        with RunReader.open(path) as reader:
            assert fold(reader.records()).accepted == {0, 1}
            reader.verify()


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "not a run file"),
        (b"hello", "not a run file"),
        (b"SQLite format 3\0" + bytes(100), "another program"),
    ],
)
def test_what_is_no_run_file_is_refused(tmp_path, content, says):
    path = tmp_path / "x.sqlite"
    path.write_bytes(content)
    for cls in (RunReader, RunWriter):
        with pytest.raises(UsageError, match=says):
            cls.open(path)
    assert path.read_bytes() == content


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(UsageError, match="there is no run file"):
        RunReader.open(tmp_path / "none.sqlite")


def test_damage_in_the_middle_is_reported_not_raised_as_a_traceback(path):
    with RunWriter.open(path) as run:
        for i in range(10):
            run.append(observation(i))
        run.finish(Record(1, "end", 100.0, 1e9, status="complete"))
    whole = path.read_bytes()
    for at in range(4096, len(whole), 1021):
        damaged = bytearray(whole)
        damaged[at] ^= 0x10
        path.write_bytes(bytes(damaged))
        try:
            with RunReader.open(path) as reader:
                reader.verify()
                assert len(fold(reader.records()).accepted) == 10, f"byte {at}"
        except RunFileError as error:
            assert "rig export" in str(error), f"byte {at}"


def test_creating_on_a_full_disk_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("rig.run_file.storage.os.replace", _refuse)
    with pytest.raises(StorageError, match="nothing is left behind"):
        create(tmp_path / "a.sqlite", genesis(), elapsed_s=0, utc_s=0)
    assert list(tmp_path.iterdir()) == []


def _refuse(*_: object) -> None:
    raise OSError(28, "No space left on device")


def test_a_damaged_file_gives_what_can_still_be_read(path):
    with RunWriter.open(path) as run:
        for i in range(10):
            run.append(observation(i))
        run.finish(Record(1, "end", 100.0, 1e9, status="complete"))
    with sqlite3.connect(path) as db:
        for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            db.execute(f"DROP TRIGGER {name}")
        db.execute("UPDATE record SET body = '{}' WHERE seq = 3")
    db.close()
    with RunReader.open(path) as reader:
        kept = [r.run_index for r in reader.salvage() if r.kind == "observation" and r.body != "{}"]
    assert kept == [0, 2, 3, 4, 5, 6, 7, 8, 9]


_KILLED = """
import os, signal, sys
sys.path.insert(0, {tests!r})
from pathlib import Path
from test_run_file import observation
from rig.run_file.verify.verification import verify_file
from rig.run_file.write.writer import RunWriter
run = RunWriter.open(Path({path!r}))
for i in range(5):
    run.append(observation(i))
os.kill(os.getpid(), signal.SIGKILL)
"""


def _killed_writer(path: Path) -> None:
    script = _KILLED.format(tests=str(Path(__file__).parent), path=str(path))
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == -9


def test_what_was_committed_survives_a_sigkill(path):
    _killed_writer(path)
    state = wal.inspect(path)
    assert state.frames > 0
    assert state.dropped == 0
    with RunWriter.open(path) as run:
        assert run.dropped.damage == ""
        assert fold(run.records()).accepted == {0, 1, 2, 3, 4}


def test_a_torn_or_flipped_log_is_counted_before_sqlite_drops_it(path):
    _killed_writer(path)
    log = path.with_name(path.name + "-wal")
    shm = path.with_name(path.name + "-shm")
    main, whole = path.read_bytes(), log.read_bytes()
    frame = 24 + int.from_bytes(whole[8:12], "big")
    cuts = [32 + frame * k + extra for k in range((len(whole) - 32) // frame) for extra in (0, 10, frame - 1)]
    outcomes = set()
    for cut in [*cuts, len(whole)]:
        path.write_bytes(main)
        log.write_bytes(whole[:cut])
        shm.unlink(missing_ok=True)
        seen = wal.inspect(path)
        with RunWriter.open(path) as run:
            accepted = fold(run.records()).accepted
        assert accepted == set(range(len(accepted)))
        outcomes.add(len(accepted))
        assert (seen.damage != "") == ((cut - 32) % frame != 0)
    assert outcomes == {0, 1, 2, 3, 4, 5}

    path.write_bytes(main)
    flipped = bytearray(whole)
    flipped[32 + frame + 100] ^= 1
    log.write_bytes(bytes(flipped))
    shm.unlink(missing_ok=True)
    seen = wal.inspect(path)
    assert seen.damage == "frame 2 fails its checksum"
    assert seen.lost_commits > 0
    with RunWriter.open(path) as run:
        assert 5 - len(fold(run.records()).accepted) == seen.lost_commits


def test_what_was_lost_is_known_until_a_session_has_written_it_down(path):
    with RunWriter.open(path) as run:
        run.append(observation(9))
    _killed_writer(path)
    Path(f"{path}-wal").unlink()
    for _ in range(2):  # killed before its first record, or kept from the bench
        with RunWriter.open(path) as run:
            assert run.dropped.lost_commits == 5
            assert run.dropped.damage == "its last 5 record(s) are not there"
    with RunWriter.open(path) as run:
        run.append(observation(0))
    with RunWriter.open(path) as run:
        assert run.dropped.lost_commits == 0


def test_a_damaged_frame_is_told_from_one_left_over_from_an_earlier_log(path):
    with RunWriter.open(path) as run:
        for i in range(4):
            run.append(observation(i))
        run._db.wal_checkpoint(mode=apsw.SQLITE_CHECKPOINT_RESTART)
        run.append(observation(4))
        log = path.with_name(path.name + "-wal")
        whole = log.read_bytes()
    frame = 24 + int.from_bytes(whole[8:12], "big")
    salts = whole[16:24]
    present = sum(whole[at + 8 : at + 16] == salts for at in range(32, len(whole), frame))
    assert 0 < present < (len(whole) - 32) // frame
    log.write_bytes(whole)
    assert wal.inspect(path) == wal.WalState(present, present, 0, "")
    last = 32 + frame * (present - 1)
    for byte in range(24):
        for bit in range(8):
            damaged = bytearray(whole)
            damaged[last + byte] ^= 1 << bit
            log.write_bytes(bytes(damaged))
            seen = wal.inspect(path)
            assert (seen.frames, seen.replayed, seen.lost_commits) == (present, 0, 1), (byte, bit)
            assert seen.damage, (byte, bit)


@pytest.mark.parametrize("how", ["moved", "deleted", "replaced"])
def test_a_file_that_loses_its_name_is_noticed_and_rescued(path, tmp_path, how):
    run = RunWriter.open(path)
    try:
        run.append(observation(0))
        if how == "replaced":
            create(tmp_path / "other.sqlite", genesis(), elapsed_s=0.0, utc_s=1e9)
            (tmp_path / "other.sqlite").replace(path)
        elif how == "moved":
            path.rename(tmp_path / "elsewhere.sqlite")
        else:
            path.unlink()
        for _ in range(2):
            with pytest.raises(StorageError, match=r"moved, deleted or replaced.*rig resume"):
                run.append(observation(1))
    finally:
        run.close()
    (copy,) = tmp_path.glob("a-run-rescued-*.sqlite")
    with RunWriter.open(copy) as rescued:
        rescued.verify()
        assert fold(rescued.records()).accepted == {0}
        rescued.append(observation(1))


def cut(file: Path) -> None:
    os.truncate(file, file.stat().st_size // 2)


def overwrite(file: Path) -> None:
    with file.open("r+b") as there:
        there.seek(4096)
        there.write(bytes(4096 * 4))


DAMAGE = {
    "the log is cut": lambda path: cut(path.with_name(path.name + "-wal")),
    "the log is emptied": lambda path: os.truncate(path.with_name(path.name + "-wal"), 0),
    "the log is removed": lambda path: path.with_name(path.name + "-wal").unlink(),
    "the file is cut": cut,
    "the file is emptied": lambda path: os.truncate(path, 0),
    "the file is overwritten": overwrite,
    "the folder is a file": lambda path: (path.parent.rename(path.parent.parent / "away"), path.parent.touch()),
}


@pytest.mark.parametrize("how", DAMAGE)
def test_a_file_that_is_damaged_while_it_is_written_is_noticed_at_the_next_commit(tmp_path, how, monkeypatch):
    elsewhere = tmp_path / "temporary"
    elsewhere.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(elsewhere))
    path = tmp_path / "runs" / "a-run.sqlite"
    create(path, genesis(), elapsed_s=0.0, utc_s=1e9)
    run = RunWriter.open(path)
    try:
        for i in range(6):
            run.append(observation(i))
        DAMAGE[how](path)
        for _ in range(2):
            with pytest.raises(StorageError, match=r"while the run was writing, it.*rig resume") as told:
                run.append(observation(6))
    finally:
        run.close()
    (copy,) = tmp_path.glob("*/a-run-rescued-*.sqlite")
    assert str(copy) in str(told.value)
    with RunWriter.open(copy) as rescued:
        rescued.verify()
        assert fold(rescued.records()).accepted == set(range(6))
        rescued.append(observation(6))


@pytest.mark.parametrize("cut_to", [0, 2000])
@pytest.mark.parametrize("notices", [True, False])
def test_a_file_whose_log_is_cut_is_left_as_it_was(path, cut_to, notices, monkeypatch):
    run = RunWriter.open(path)
    try:
        for i in range(6):
            run.append(observation(i))
        run._db.wal_checkpoint()
        run.append(observation(6))
        log, before = Path(f"{path}-wal"), path.read_bytes()
        os.truncate(log, cut_to)
        monkeypatch.setattr(run._mirror, "_db", None)  # a run too large for memory: no copy can be made
        if notices:
            with pytest.raises(StorageError, match=r"no copy could be made.*--restore"):
                run.append(observation(7))
    finally:
        run.close()
    assert path.read_bytes() == before
    assert not list(path.parent.glob("*-rescued-*.sqlite"))
    with RunReader.open(path) as reader:
        reader.verify()
        assert fold(reader.records()).accepted == set(range(6))


def edit(statement: str) -> Callable[[sqlite3.Connection], None]:
    def change(db: sqlite3.Connection) -> None:
        triggers = db.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
        for name, _ in triggers:
            db.execute(f"DROP TRIGGER {name}")
        db.execute(statement)
        for _, sql in triggers:
            db.execute(sql)

    return change


@pytest.mark.parametrize(
    "statement",
    [
        "CREATE TABLE hello (a)",
        "UPDATE record SET body = replace(body, '0.1', '0.7') WHERE run_index = 1",
        "UPDATE record SET status = 'rejected' WHERE run_index = 3",
        "UPDATE document SET body = 'x = 2' WHERE name = 'procedure.toml'",
    ],
)
def test_a_file_that_another_program_edits_is_rescued_from_memory(path, tmp_path, statement):
    run = RunWriter.open(path)
    try:
        for i in range(6):
            run.append(observation(i))
        with contextlib.closing(sqlite3.connect(path)) as other:
            edit(statement)(other)
            other.commit()
        with pytest.raises(StorageError, match=r"changed by another program.*rescued.*rig resume") as told:
            run.append(observation(6))
    finally:
        run.close()
    (copy,) = tmp_path.glob("a-run-rescued-*.sqlite")
    assert str(copy) in str(told.value)
    with RunWriter.open(copy) as rescued:
        rescued.verify()
        assert fold(rescued.records()).accepted == set(range(6))
        assert next(rescued.chained("run_index = 1"))[1] == observation(1)
    with pytest.raises(RunFileError, match=rf"edited or damaged.*rig resume {re.escape(str(copy))}"):
        RunWriter.open(path)
    assert any(f"rig resume {copy}" in note for note in verify_file(path).notes)


def test_a_copy_rescued_from_a_rescued_copy_is_the_one_in_which_the_run_goes_on(path, tmp_path, monkeypatch):
    at, files = path, [path]
    for i, pid in enumerate((1001, 1002)):
        monkeypatch.setattr(os, "getpid", lambda pid=pid: pid)
        run = RunWriter.open(at)
        try:
            for n in range(3):
                run.append(observation(3 * i + n))
            cut(at.with_name(f"{at.name}-wal"))
            with pytest.raises(StorageError, match="its log was cut"):
                run.append(observation(9))
        finally:
            run.close()
        at = next(file for file in tmp_path.glob("*-rescued-*.sqlite") if file not in files)
        files.append(at)
    first, second, third = files
    for file, other in ((first, third), (second, third), (third, None)):
        with RunReader.open(file) as reader:
            assert goes_on_in(reader, fold(reader.records())) == other, file


@pytest.mark.parametrize("records", [1, 40])
def test_a_file_that_is_damaged_at_the_very_end_is_not_called_complete(path, tmp_path, monkeypatch, records):
    run = RunWriter.open(path)
    for i in range(records):
        run.append(observation(i % 10, "accepted" if i < 10 else "rejected"))
    monkeypatch.setattr(storage.Storage, "sync_folder", lambda *_: overwrite(path))  # the last that is done
    with pytest.raises(StorageError, match="it does not hold what was written into it"):
        run.finish(Record(1, "end", 1.0, 1e9, status="complete"))
    run.close()
    monkeypatch.undo()
    (copy,) = tmp_path.glob("a-run-rescued-*.sqlite")
    with RunReader.open(copy) as rescued:
        rescued.verify()
        assert fold(rescued.records()).ended == "complete"


def test_a_file_that_is_only_touched_goes_on(path):
    with RunWriter.open(path) as run:
        for i in range(4):
            os.utime(path)
            os.utime(path.with_name(path.name + "-wal")) if i else None
            run.append(observation(i))
        assert fold(run.records()).accepted == {0, 1, 2, 3}


def not_listed(folder: Path) -> Iterator[Path]:
    """A folder that may be entered and not listed."""
    raise PermissionError(13, "Permission denied", str(folder))


def test_a_second_name_of_a_run_under_way_is_refused(path, tmp_path, monkeypatch):
    killed = tmp_path / "killed"
    killed.mkdir()
    with RunWriter.open(path) as run:
        run.append(observation(0))
        for left in tmp_path.glob("a-run*"):
            shutil.copy(left, killed)
    first, second = killed / "a-run.sqlite", killed / "copy.sqlite"
    os.link(first, second)
    for open_it in (RunWriter.open, RunReader.open):
        with pytest.raises(UsageError, match=r"second name \(hard link\).*a-run\.sqlite"):
            open_it(second)
    with monkeypatch.context() as unlisted:
        unlisted.setattr("pathlib.Path.iterdir", not_listed)
        with pytest.raises(UsageError, match="by the first: somewhere else"):
            RunReader.open(second)
    with RunWriter.open(first) as run:
        assert fold(run.records()).accepted == {0}
        run.finish(Record(1, "end", 1.0, 1e9, status="complete"))
    with RunReader.open(second) as finished:  # its log is folded: one file, whatever its names
        assert fold(finished.records()).accepted == {0}


def test_through_a_symbolic_link_what_is_beside_the_file_is_seen_and_written_there(path, tmp_path):
    with RunWriter.open(path) as run:
        run.append(observation(9))
    _killed_writer(path)
    log, link = Path(f"{path}-wal"), tmp_path / "links" / "tonight.sqlite"
    log.write_bytes(log.read_bytes()[: log.stat().st_size // 2 // 4096 * 4096 + 4096])
    link.parent.mkdir()
    link.symlink_to(path)
    direct, through = verify_file(path), verify_file(link)
    assert "head" in {f.where for f in direct.findings}
    assert through == direct
    with RunWriter.open(link) as run:
        assert run.path == path
        assert run.dropped.lost_commits > 0
        run.append(observation(9, "rejected"))
        assert os.listdir(link.parent) == [link.name]
        cut(log)
        with pytest.raises(StorageError, match="its log was cut"):
            run.append(observation(8))
    assert list(tmp_path.glob("a-run-rescued-*.sqlite"))


@pytest.mark.parametrize("make", [os.symlink, os.link])
def test_another_file_under_the_name_of_the_last_word_is_left_as_it_is(path, tmp_path, make):
    with RunWriter.open(path) as run:
        run.append(observation(0))
    head, victim = path.with_suffix(".head"), tmp_path / "victim"
    said = head.read_bytes()
    victim.write_bytes(said + b"and more")
    head.unlink()
    make(victim, head)
    with RunWriter.open(path) as run:
        run.append(observation(1))
        assert read_last_word(path) == run.written
    assert victim.read_bytes() == said + b"and more"
    assert not head.is_symlink()


@pytest.mark.parametrize("suffix", ["wal", "shm", "journal"])
def test_a_link_in_place_of_the_log_is_named(path, tmp_path, suffix):
    _killed_writer(path)
    beside = Path(f"{path}-{suffix}")
    beside.rename(tmp_path / "moved") if beside.exists() else (tmp_path / "moved").touch()
    beside.symlink_to("moved")
    for look in (RunReader.open, RunWriter.open, verify_file):
        with pytest.raises(RunFileError, match=rf"-{suffix} is not a file of .*: it is a symbolic link.* Move "):
            look(path)


def test_a_folder_in_place_of_the_log_is_named(path):
    Path(f"{path}-wal").mkdir()
    with pytest.raises(RunFileError, match=r"it is a folder\. Nothing was changed\. Move "):
        verify_file(path)


def test_news_and_requests_that_are_none_hold_nobody_up(path):
    live_path(path).write_text('{"state": 5}')
    assert read_live(path) is None
    with RunWriter.open(path):
        for garbage in ('{"state": 5}', "[]", "{", "[" * 100_000, '{"state": "x", "elapsed_s": NaN}'):
            live_path(path).write_text(garbage)
            assert (read_live(path) or {})["state"] == "running"
        os.mkfifo(request_path(path))
        assert read_json(request_path(path)) is None
