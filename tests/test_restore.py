"""What a damaged run file still proves is in the new one, to the last bit, and nothing else is."""

from __future__ import annotations

import random

import apsw
import pytest
from command import rig
from damages import small_finished
from dry import LAB
from small_run import write_small

from rig.engine.run_reader import RunReader
from rig.engine.verification import restored
from rig.errors import RigError, RunFileError, UsageError


@pytest.fixture(scope="module", params=["attitude", "pressure"])
def finished(request, tmp_path_factory):
    """A finished run file, its bytes and its records."""
    path = small_finished(request.param, tmp_path_factory.mktemp(request.param))
    with RunReader.open(path) as run:
        return path.read_bytes(), list(run.chained())


def damaged(folder, content):
    path = folder / "damaged.sqlite"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("byte", [0, 16, 30, 60, 68, 100, 103, 108])
def test_a_header_that_sqlite_refuses_loses_nothing(tmp_path, finished, byte):
    whole, records = finished
    content = bytearray(whole)
    content[byte] ^= 0x55
    path, new = damaged(tmp_path, content), tmp_path / "new.sqlite"
    found = restored(path, new)
    assert (found.records, found.known) == (len(records), len(records))
    with RunReader.open(new) as run:
        run.verify()
        assert list(run.chained()) == records
    assert path.read_bytes() == content


def test_whatever_is_damaged_only_what_is_proven_is_kept(tmp_path, finished):
    whole, records = finished
    seed = 7
    draw = random.Random(seed)
    share = []
    for _ in range(25):
        content = bytearray(whole)
        for _ in range(draw.choice((1, 3, 20))):
            content[draw.randrange(len(whole))] ^= 1 << draw.randrange(8)
        new = tmp_path / "new.sqlite"
        try:
            count = restored(damaged(tmp_path, content), new).records
        except RunFileError as error:
            assert "can" in str(error), f"seed {seed}"
            assert not new.exists()
            share.append(0.0)
            continue
        with RunReader.open(new) as run:
            run.verify()
            assert list(run.chained()) == records[:count], f"seed {seed}"
        share.append(count / len(records))
        new.unlink()
    assert sum(s > 0 for s in share) > 8
    assert not list(tmp_path.glob("*.part*"))


def test_a_file_cut_anywhere_gives_back_what_is_before_the_cut_or_says_why_not(tmp_path, finished):
    whole, records = finished
    new, counts = tmp_path / "new.sqlite", []
    for end in range(0, len(whole), 3 * 4096):
        try:
            counts.append(restored(damaged(tmp_path, whole[:end]), new).records)
        except RigError:
            counts.append(0)
            continue
        with RunReader.open(new) as run:
            assert list(run.chained()) == records[: counts[-1]]
        new.unlink()
    assert max(counts) > 0


def test_a_changed_record_ends_what_is_restored_and_the_rest_is_measured_again(tmp_path):
    made = rig("run", write_small(tmp_path), "-b", LAB / "bench.toml", "--dry", "--out", tmp_path)
    path, new = made.stdout.strip(), tmp_path / "new.sqlite"
    db = apsw.Connection(path)
    db.execute("DROP TRIGGER record_refuses_update")
    db.execute("UPDATE record SET body = replace(body, '1', '2') WHERE seq = 15")
    db.close()
    refused = rig("verify", path)
    assert "--restore NEW.sqlite" in refused.stderr
    saved = rig("verify", path, "--restore", new)
    assert saved.returncode == 0, saved.stderr
    assert "14 records, each proven by its hash, of 23 known" in saved.stdout
    assert f"rig resume {new}" in saved.stdout
    done = rig("resume", new)
    assert done.returncode == 0, done.stderr
    assert rig("verify", new).returncode == 0
    again = rig("verify", path, "--restore", new)
    assert again.returncode == 2
    assert "exists already" in again.stderr


def test_what_is_in_the_log_alone_is_restored_too(tmp_path):
    from kills import rig as process  # noqa: PLC0415

    arguments = (write_small(tmp_path), "--bench", LAB / "bench.toml", "--dry", "--out", tmp_path)
    killed = process("run", *arguments, "--kill-at-point", 6)
    said, _ = killed.communicate(timeout=60)
    path = tmp_path / said.split()[0].rpartition("/")[2]
    log = path.with_name(path.name + "-wal")
    assert log.stat().st_size > 0
    main = bytearray(path.read_bytes())
    main[:100] = bytes(100)
    path.write_bytes(main)
    with pytest.raises(UsageError):
        RunReader.open(path)
    found = restored(path, tmp_path / "new.sqlite")
    assert found.records == found.known > 10
