"""What a damaged run file still proves is in the new one, to the last bit, and nothing else is."""

from __future__ import annotations

import random
import shutil
import struct
import time

import apsw
import pytest
from command import rig
from dry import LAB
from ideal_bench import new_run, run_session
from small_run import write_small

from proving.crashes.damages import small_finished
from rig.engine.session import Outcome
from rig.errors import RigError, RunFileError, UsageError
from rig.run_file.chain import link
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.verification import restored


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
    from proving.crashes.kills import rig as process  # noqa: PLC0415

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


# --- the name of the new file -----------------------------------------------------------------------------------------


def test_no_file_is_deleted_that_restoring_did_not_make(tmp_path, finished):
    whole, records = finished
    path = tmp_path / "x.sqlite.part"
    path.write_bytes(whole)
    assert restored(path, tmp_path / "x.sqlite").records == len(records)
    assert path.read_bytes() == whole
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x.sqlite", "x.sqlite.part"]


@pytest.mark.parametrize("beside", ["-wal", "-journal", "-shm", ".head", ".live", ".request"])
def test_a_name_beside_which_something_lies_from_an_earlier_file_is_refused(tmp_path, finished, beside):
    path, left = damaged(tmp_path, finished[0]), tmp_path / ("new" + (".sqlite" if beside[0] == "-" else "") + beside)
    left.write_text("of another")
    with pytest.raises(UsageError, match=f"{left} is there.*nothing was written"):
        restored(path, tmp_path / "new.sqlite")
    with pytest.raises(UsageError):
        restored(path, left)
    assert {p.name for p in tmp_path.iterdir()} == {path.name, left.name}


def test_a_link_to_nowhere_and_a_name_for_what_lies_beside_are_refused(tmp_path, finished):
    path, new = damaged(tmp_path, finished[0]), tmp_path / "new.sqlite"
    new.symlink_to(tmp_path / "nowhere")
    with pytest.raises(UsageError, match="exists already"):
        restored(path, new)
    with pytest.raises(UsageError, match=r"ends in \.sqlite"):
        restored(path, tmp_path / "other.head")
    assert not (tmp_path / "nowhere").exists()


# --- several chains ---------------------------------------------------------------------------------------------------


def as_log(content):
    """Every page of a file, as a log would have it."""
    pages = (content[at : at + 4096] for at in range(0, len(content), 4096))
    return bytes(32) + b"".join(struct.pack(">I", n) + bytes(20) + page for n, page in enumerate(pages, 1))


def gone_on_otherwise(folder, content, since, until):
    """The run as it might have gone on otherwise: its records again from `since` on, a little later, up to `until`."""
    path = folder / "otherwise"
    path.write_bytes(content)
    with RunReader.open(path) as run:
        records = list(run.chained())
    db = apsw.Connection(str(path))
    for (name,) in list(db.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'")):
        db.execute(f"DROP TRIGGER {name}")
    db.execute("DELETE FROM record WHERE seq > ?", (until,))
    head = records[since - 2][3]
    for seq, record, _, _ in records[since - 1 : until]:
        later = record._replace(elapsed_s=record.elapsed_s + 1e-6)
        values = (later.elapsed_s, head, head := link(head, seq, later), seq)
        db.execute("UPDATE record SET elapsed_s = ?, previous = ?, hash = ? WHERE seq = ?", values)
    db.close()
    content = path.read_bytes()
    path.unlink()
    return content, head.hex()


@pytest.mark.parametrize("in_log", [False, True])
def test_the_longest_of_several_chains_is_restored_and_the_others_are_named(tmp_path, finished, in_log):
    whole, records = finished
    n = len(records)
    other, head = gone_on_otherwise(tmp_path, whole, 8, n - 3)
    main, log = (other, whole) if in_log else (whole, other)
    path, new = damaged(tmp_path, main), tmp_path / "new.sqlite"
    path.with_name(path.name + "-wal").write_bytes(as_log(log))
    found = restored(path, new)
    assert (found.records, found.known) == (n, n)
    with RunReader.open(new) as run:
        assert list(run.chained()) == records
    (told,) = found.others
    assert (told.records, told.same_until, told.head, told.ended) == (n - 3, 7, head, False)
    asked = restored(path, tmp_path / "asked.sqlite", head[:16])
    assert asked.records == n - 3
    assert [(one.records, one.ended) for one in asked.others] == [(n, True)]


def test_of_chains_of_one_length_the_one_that_was_ended_is_restored(tmp_path, finished):
    whole, records = finished
    n = len(records)
    shorter, _ = gone_on_otherwise(tmp_path, whole, n - 1, n)
    db_path = damaged(tmp_path, shorter)
    db = apsw.Connection(str(db_path))
    last = records[-1][1]._replace(kind="event", status="note")
    before = next(iter(db.execute("SELECT hash FROM record WHERE seq = ?", (n - 1,))))[0]
    values = (last.kind, last.status, last.elapsed_s, link(before, n, last), n)
    db.execute("UPDATE record SET kind = ?, status = ?, elapsed_s = ?, hash = ? WHERE seq = ?", values)
    db.close()
    path = damaged(tmp_path, db_path.read_bytes())
    path.with_name(path.name + "-wal").write_bytes(as_log(whole))
    found = restored(path, tmp_path / "new.sqlite")
    assert found.records == n
    assert [(one.records, one.ended) for one in found.others] == [(n, False)]


def test_of_two_runs_the_longer_is_restored_and_only_its_records_count_as_known(tmp_path):
    contents, lengths = {}, {}
    for lab in ("attitude", "pressure"):
        (tmp_path / lab).mkdir()
        made = small_finished(lab, tmp_path / lab)
        contents[lab] = made.read_bytes()
        with RunReader.open(made) as run:
            lengths[lab] = run.head()[0]
    longer, shorter = sorted(lengths, key=lengths.__getitem__, reverse=True)
    for main, log in ((longer, shorter), (shorter, longer)):
        folder = tmp_path / f"{main}-first"
        folder.mkdir()
        path = damaged(folder, contents[main])
        path.with_name(path.name + "-wal").write_bytes(as_log(contents[log]))
        found = restored(path, folder / "new.sqlite")
        assert (found.records, found.known) == (lengths[longer], lengths[longer])
        (told,) = found.others
        assert (told.records, told.same_until) == (lengths[shorter], 0)
        assert told.run
        said = rig("verify", path, "--restore", folder / "other.sqlite", "--head", told.head[:16])
        assert said.returncode == 0, said.stderr
        assert f"{told.records} records, each proven by its hash, of {told.records} known" in said.stdout
        assert "not restored: another run" in said.stdout
        assert rig("verify", folder / "other.sqlite").returncode == 0


def test_a_head_that_no_proven_chain_has_is_refused_and_one_that_is_no_hash_too(tmp_path, finished):
    path, new = damaged(tmp_path, finished[0]), tmp_path / "new.sqlite"
    refused = rig("verify", path, "--restore", new, "--head", "0123456789abcdef")
    assert refused.returncode == 1
    assert f"Without --head the longest is, of {len(finished[1])} records" in refused.stderr
    assert rig("verify", path, "--restore", new, "--head", "nonsense").returncode == 2
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("spoilt", ["log", "file"])
def test_what_the_log_spoils_is_taken_from_the_file_and_the_other_way_round(tmp_path, finished, spoilt):
    whole, records = finished
    seed = 11
    noise = random.Random(seed).randbytes(len(whole))
    path = damaged(tmp_path, noise if spoilt == "file" else whole)
    path.with_name(path.name + "-wal").write_bytes(as_log(noise if spoilt == "log" else whole))
    found = restored(path, tmp_path / "new.sqlite")
    assert (found.records, found.known, found.others) == (len(records), len(records), ()), f"seed {seed}"


# --- files made to hold a reader up -----------------------------------------------------------------------------------


def varint(value):
    found = [value & 0x7F]
    while value := value >> 7:
        found.insert(0, 0x80 | value & 0x7F)
    return bytes(found)


def circle(size, number, of):
    """A page of nothing but pointers to cells that lie in one another, of `size` bytes, led on to themselves."""
    here = (4096 - 12) * 32 // 255 - 23 + (size - ((4096 - 12) * 32 // 255 - 23)) % 4092
    here = here if here <= 4061 else (4096 - 12) * 32 // 255 - 23
    length = next(n for n in range(2, 9) if 1 + len(varint(12 + 2 * (size - n))) == n)
    head = varint(length) + varint(12 + 2 * (size - length))
    cell = varint(size) + b"\x05" + head + bytes(here - len(head)) + struct.pack(">I", number % of + 1)
    page = bytearray(4096)
    page[-len(cell) :] = cell
    page[:4] = struct.pack(">I", number % of + 1)
    for at in range(108 if number == 1 else 8, 4096 - len(cell) - 1, 2):
        page[at : at + 2] = struct.pack(">H", 4096 - len(cell))
    return bytes(page)


@pytest.mark.parametrize(("size", "pages"), [(1 << 24, 1), (3000 + 4096, 1), (200 * 4000, 200), (4093 * 60, 64)])
def test_pages_that_lead_in_circles_hold_nobody_up(tmp_path, size, pages):
    path = damaged(tmp_path, b"".join(circle(size, n, pages) for n in range(1, pages + 1)))
    began = time.process_time()
    with pytest.raises(RunFileError):
        restored(path, tmp_path / "new.sqlite")
    assert time.process_time() - began < 2
    assert list(tmp_path.iterdir()) == [path]


def test_cells_that_lie_in_one_another_hold_nobody_up(tmp_path):
    page = bytearray(4096)
    page[2048:] = b"\x20\x05\x20" + bytes(2045)  # whatever byte is pointed to, a row may begin there
    for at in range(2048, 4090):
        page[at] = 0x20 if at % 2 else 0x05
    for at in range(8, 2048, 2):
        page[at : at + 2] = struct.pack(">H", 2048 + at)
    path = damaged(tmp_path, bytes(page) * 60)
    began = time.process_time()
    with pytest.raises(RunFileError):
        restored(path, tmp_path / "new.sqlite")
    assert time.process_time() - began < 2


# --- a run that goes on elsewhere -------------------------------------------------------------------------------------


def test_a_restored_run_that_goes_on_in_a_rescued_copy_says_so(tmp_path):
    made, path = new_run(tmp_path), tmp_path / "renamed.sqlite"

    def progress(told):
        if told.done == 3 and made.exists():
            made.rename(path)

    assert run_session(made, on_progress=progress)[0] is Outcome.FAULT
    (copy,) = tmp_path.glob("*-rescued-*.sqlite")
    said = rig("verify", path, "--restore", tmp_path / "new" / "n.sqlite")
    assert said.returncode == 0, said.stderr
    assert f"the run goes on in {copy}, which has the missing records: rig resume {copy}" in said.stdout
    assert "measure again" not in said.stdout
    shutil.move(copy, tmp_path / "hidden")
    said = rig("verify", path, "--restore", tmp_path / "new" / "again.sqlite")
    assert "which does not exist: look for it before you resume" in said.stdout


def test_what_is_restored_of_a_damaged_rescued_copy_goes_on_although_the_copy_lies_beside_it(tmp_path):
    path, new = new_run(tmp_path), tmp_path / "new.sqlite"
    assert run_session(path)[0] is Outcome.COMPLETE
    copy = path.rename(tmp_path / "small-rescued-7.sqlite")
    db = apsw.Connection(str(copy))
    db.execute("DROP TRIGGER record_refuses_update")
    db.execute("UPDATE record SET body = replace(body, '1', '2') WHERE seq = 15")
    db.close()
    said = rig("verify", copy, "--restore", new)
    assert f"measure again what is missing: rig resume {new}" in said.stdout, said.stderr
    assert str(copy) not in rig("status", new).stdout
    assert run_session(new)[0] is Outcome.COMPLETE
    assert rig("verify", new).returncode == 0
