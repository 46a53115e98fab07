"""The simulated disk under the run file: power cuts, full disks and failed syncs, and that none loses a record."""

from __future__ import annotations

import errno
import os
import random
import shutil
from pathlib import Path

import apsw
import pytest
from test_run_file import genesis, observation

from proving.disk import Crash, Disk
from rig.drivers.clock import Clock
from rig.errors import StorageError
from rig.run_file import storage
from rig.run_file.chain import Record
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import fold
from rig.run_file.write.creation import create
from rig.run_file.write.writer import RunWriter
from rig.sims.world import World


def made(folder: Path, disk: Disk) -> Path:
    path = folder / "a-run.sqlite"
    create(path, genesis(), elapsed_s=0.0, utc_s=1e9, vfs=disk.name)
    return path


def accepted(path: Path) -> set[int]:
    with RunReader.open(path) as reader:
        reader.verify()
        return fold(reader.records()).accepted


def append_until_it_fails(run: RunWriter, kept: set[int]) -> None:
    for i in range(len(kept), 10):
        run.append(observation(i))
        kept.add(i)


@pytest.mark.parametrize("lost", ["all", "none", "some"])
def test_what_was_committed_survives_a_power_cut(tmp_path, lost):
    with Disk(seed=1) as disk:
        path = made(tmp_path, disk)
        run = RunWriter.open(path, vfs=disk.name)
        for i in range(5):
            run.append(observation(i))
            disk.power_cut(lost)
            run.close()
            assert accepted(path) == set(range(i + 1))
            run = RunWriter.open(path, vfs=disk.name)
        run.close()
    assert disk.writes > 20
    assert disk.syncs > 5


def test_a_failed_sync_stops_the_run_and_what_is_written_after_it_is_not_lost_with_it(tmp_path):
    # Linux marks the pages clean: the log reads well, syncs again without a word, and loses the pages to a power cut.
    with Disk(seed=1) as disk:
        path = made(tmp_path, disk)
        with RunWriter.open(path, vfs=disk.name) as run:
            run.append(observation(0))
            disk.fail_sync()
            with pytest.raises(StorageError, match="rig resume"):
                run.append(observation(1))
            disk.power_cut("none")
        with RunWriter.open(path, vfs=disk.name) as run:
            for i in range(2, 5):
                run.append(observation(i))
            disk.power_cut("all")
        assert accepted(path) >= {0, 2, 3, 4}


def test_a_full_disk_stops_the_run_and_with_room_again_it_goes_on(tmp_path):
    with Disk(seed=1) as disk:
        path = made(tmp_path, disk)
        kept: set[int] = set()
        for room in (0, 100, 5000, 20_000):
            with RunWriter.open(path, vfs=disk.name) as run:
                kept = fold(run.records()).accepted
                disk.full_after(room)
                with pytest.raises(StorageError, match="full"):
                    append_until_it_fails(run, kept)
                disk.full_after(None)
            assert accepted(path) == kept


@pytest.mark.parametrize("sync", range(1, 4))
def test_a_record_is_not_written_twice_where_only_the_log_could_not_be_moved_into_the_file(tmp_path, sync):
    """SQLite's COMMIT fails after it has committed, too: a night of 28 hours on a full disk has shown it."""
    with Disk(seed=1) as disk:
        path = made(tmp_path, disk)
        with RunWriter.open(path, vfs=disk.name) as run:
            run._db.wal_autocheckpoint(1)
            disk.fail_sync(nth=sync)
            with pytest.raises(StorageError, match="rig resume"):
                append_until_it_fails(run, set())
            run.append(observation(9))
        assert 9 in accepted(path)


def test_an_error_of_the_disk_is_one_message(tmp_path):
    with Disk(seed=1) as disk:
        path = made(tmp_path, disk)
        with RunWriter.open(path, vfs=disk.name) as run:
            disk.fail_write(nth=2)
            with pytest.raises(StorageError):
                run.append(observation(0))
            run.commit()
            disk.power_cut("none")  # else closing it folds the log into the file
        disk.fail_sync(times=1000)
        with pytest.raises(StorageError, match="rig resume"):
            RunWriter.open(path, vfs=disk.name)
        disk.fail_sync(times=0)
        assert accepted(path) == {0}


def test_a_crash_leaves_everything_as_it_is_and_the_disk_shut(tmp_path):
    with Disk(seed=1) as disk:
        path = made(tmp_path, disk)
        with RunWriter.open(path, vfs=disk.name) as run:
            run.append(observation(0))
            disk.crash_at(3)
            with pytest.raises(Crash):
                run.append(observation(1))
            with pytest.raises(Crash):
                run.append(observation(2))
            with pytest.raises(Crash):
                run.close()
        files = {p.name: p.read_bytes() for p in tmp_path.iterdir() if not p.name.endswith("-shm")}
        assert set(files) == {path.name, path.name + "-wal", "a-run.head"}
        disk.power_cut("none")
        assert {name: (tmp_path / name).read_bytes() for name in files} == files
        assert accepted(path) == {0}


def test_what_is_open_from_before_a_power_cut_must_be_closed_first(tmp_path):
    with Disk(seed=1) as disk:
        path = made(tmp_path, disk)
        run = RunWriter.open(path, vfs=disk.name)
        disk.power_cut()
        with pytest.raises(RuntimeError, match="close it first"):
            apsw.Connection(str(path), vfs=disk.name).execute("SELECT * FROM record")
        run.close()


def test_a_run_file_is_created_whole_or_not_at_all(tmp_path):
    rng = random.Random(7)
    seen = set()
    for nth in range(1, 200):
        folder = tmp_path / str(nth)
        with Disk(seed=nth) as disk:
            disk.crash_at(nth)
            try:
                path = made(folder, disk)
            except Crash:
                disk.power_cut(rng.choice(["all", "none", rng]))
                path = folder / "a-run.sqlite"
                seen.add(path.exists())
                if path.exists():
                    assert accepted(path) == set()
                continue
            disk.power_cut("all")
            assert accepted(path) == set()
            break
    assert seen == {True, False}
    assert nth < 199


@pytest.mark.parametrize("nth", [1, 2])
def test_a_run_file_that_cannot_be_made_durable_is_not_left_behind(tmp_path, nth):
    with Disk(seed=1) as disk:
        disk.crash_at(10_000)
        made(tmp_path / "whole", disk)
        syncs = disk.syncs
        disk.fail_sync(nth=syncs + 1 - nth)
        with pytest.raises(StorageError, match="nothing is left behind"):
            made(tmp_path / "torn", disk)
    assert not list((tmp_path / "torn").iterdir())


def test_a_slow_disk_takes_time_on_its_clock(tmp_path):
    world: Clock = World()
    with Disk(seed=1) as disk:
        path = made(tmp_path, disk)
        disk.slow(world, write_s=0.01, sync_s=2.0)
        with RunWriter.open(path, vfs=disk.name) as run:
            before, syncs = world.now(), disk.syncs
            run.append(observation(0))
            assert disk.syncs > syncs
            assert world.now() - before >= 2.0 * (disk.syncs - syncs)


@pytest.fixture
def synced(monkeypatch):
    """What was synced through the real storage, by path, in order; the renames between them."""
    done: list[tuple[str, str]] = []
    fsync, replace = os.fsync, os.replace

    def noted(descriptor):
        done.append(("sync", os.readlink(f"/proc/self/fd/{descriptor}")))
        fsync(descriptor)

    def noted_rename(source, target):
        done.append(("rename", str(target)))
        replace(source, target)

    monkeypatch.setattr(os, "fsync", noted)
    monkeypatch.setattr(os, "replace", noted_rename)
    return done


def test_on_a_real_disk_a_new_run_file_is_durable_under_its_name(tmp_path, synced):
    folder = tmp_path / "runs" / "2026"
    path = folder / "a-run.sqlite"
    create(path, genesis(), elapsed_s=0.0, utc_s=1e9)
    # Each new folder's entry in the one above it, then the file's own entry after it has its name.
    above = [("sync", str(tmp_path)), ("sync", str(tmp_path / "runs"))]
    assert synced == [*above, ("rename", str(path)), ("sync", str(folder))]


def test_on_a_real_disk_a_log_is_renewed_before_anything_is_built_on_it(tmp_path, synced):
    running, killed = tmp_path / "a-run.sqlite", tmp_path / "killed"
    killed.mkdir()
    create(running, genesis(), elapsed_s=0.0, utc_s=1e9)
    with RunWriter.open(running) as run:
        run.append(observation(0))
        for left in tmp_path.glob("a-run.sqlite*"):  # what a kill would leave, log included
            shutil.copy(left, killed)
    synced.clear()
    with RunWriter.open(killed / "a-run.sqlite") as run:
        assert synced == [("sync", str(killed / "a-run.sqlite-wal"))]
        assert accepted(run.path) == {0}


def test_on_a_real_disk_the_end_of_a_run_is_durable_in_its_folder(tmp_path, synced):
    path = tmp_path / "a-run.sqlite"
    create(path, genesis(), elapsed_s=0.0, utc_s=1e9)
    with RunWriter.open(path) as run:
        run.append(observation(0))
        synced.clear()
        run.finish(Record(1, "end", 1.0, 1e9, status="complete"))
    assert synced == [("sync", str(tmp_path))]
    assert not path.with_name(path.name + "-wal").exists()


def test_on_a_real_disk_every_byte_of_a_log_is_written_over_itself_in_its_place(tmp_path, monkeypatch):
    log, content = tmp_path / "log", random.Random(4).randbytes(1000)
    log.write_bytes(content)
    written = bytearray(len(content))

    def pwrite(_descriptor, data, at):
        written[at : at + len(data)] = data
        return len(data)

    monkeypatch.setattr(storage, "_CHUNK", 96)
    monkeypatch.setattr(os, "pwrite", pwrite)
    storage.Storage().rewrite(log)
    assert written == content


def test_a_real_disk_that_takes_less_than_it_is_given_is_full(tmp_path, monkeypatch):
    log = tmp_path / "log"
    log.write_bytes(b"twelve bytes")
    monkeypatch.setattr(os, "pwrite", lambda _descriptor, data, _at: len(data) - 1)
    with pytest.raises(OSError, match="No space left on device") as told:
        storage.Storage().rewrite(log)
    assert (told.value.errno, told.value.filename) == (errno.ENOSPC, str(log))
    assert told.value.strerror == os.strerror(errno.ENOSPC)


def test_on_a_real_disk_a_folder_that_another_program_makes_meanwhile_is_no_error(tmp_path, synced, monkeypatch):
    folder, exists = tmp_path / "runs", Path.exists

    def made_after_the_look(path):
        found = exists(path)
        folder.mkdir(exist_ok=True)
        return found

    monkeypatch.setattr(Path, "exists", made_after_the_look)
    storage.Storage().make_folder(folder)
    assert synced == [("sync", str(tmp_path))]


def test_on_a_real_disk_what_is_synced_as_a_folder_is_one(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(NotADirectoryError):
        storage.Storage().sync_folder(tmp_path / "file")


def test_a_storage_that_stood_in_for_another_gives_its_place_back():
    first, second = storage.Storage(), storage.Storage()
    assert storage.register("test-disk", first) is None
    assert storage.register("test-disk", second) is first
    assert storage.storage_of("test-disk") is second
    storage.unregister("test-disk", first)
    assert storage.storage_of("test-disk") is first
    storage.unregister("test-disk", None)
    assert storage.storage_of("test-disk") is storage.storage_of("")
    storage.unregister("test-disk", None)  # whose place is empty already
