"""A log or journal beside a run file that is not its own is refused, and nothing is changed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import apsw
import pytest
from command import rig
from test_run_file import RUN_LIST

from rig.errors import RunFileError
from rig.procedures.plan.run_list import Point, RunList
from rig.run_file import wal
from rig.run_file.chain import Record, encode
from rig.run_file.read import safe_opening as opening
from rig.run_file.read.beside import ForeignFileError
from rig.run_file.read.reader import RunReader
from rig.run_file.read.safe_opening import opened_without_log
from rig.run_file.write.creation import Genesis, create
from rig.run_file.write.writer import RunWriter

POINTS = 120
STEP = 20
PAGE = 4096
_MAGIC = bytes.fromhex("d9d505f920a163d7")
Files = Mapping[str, bytes]
Nights = tuple[list[Files], Files, list[Files], Files]


def points(count: int) -> RunList:
    return RunList(RUN_LIST.factors, [Point(i, 1, None, (float(i), -30.0), (1, -1)) for i in range(count)], seed=3)


def observation(index: int) -> Record:
    body = encode({"outputs": {"x_V": {"mean": 0.1 * index}}, "readings": [0.125] * (40 + index % 7 * 150)})
    return Record(1, "observation", 10.0 * index, 1e9 + index, index, None, 1, "accepted", body)


def taken(path: Path) -> Files:
    """The run file and its log, by what follows its name."""
    return {s: p.read_bytes() for s in ("", "-wal", "-journal") if (p := Path(f"{path}{s}")).exists()}


def laid(folder: Path, files: Files) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    for suffix, content in files.items():
        (folder / f"r.sqlite{suffix}").write_bytes(content)
    return folder / "r.sqlite"


def night(folder: Path, run_id: str, count: int = POINTS) -> tuple[list[Files], Files]:
    """A run as it stood every few points, its log folded into it now and then; and finished."""
    path = folder / f"{run_id}.sqlite"
    create(path, Genesis(run_id, {"procedure.toml": run_id}, points(count), True, {}), elapsed_s=0.0, utc_s=1e9)
    stood = []
    with RunWriter.open(path) as run:
        run._db.wal_autocheckpoint(60)
        for index in range(count):
            if index % STEP == 5:
                stood.append(taken(path))
            run.append(observation(index))
        run.finish(Record(1, "end", 10.0 * count, 1e9 + count, status="complete", body="{}"))
    return stood, taken(path)


@pytest.fixture(scope="module")
def nights(tmp_path_factory: pytest.TempPathFactory) -> Nights:
    folder = tmp_path_factory.mktemp("nights")
    return *night(folder, "one"), *night(folder, "two", POINTS // 2)


def by_itself(path: Path) -> list[bytes]:
    with RunReader(path, opened_without_log(path)) as run:
        return [own for *_, own in run.chained()]


def records(path: Path) -> list[bytes]:
    with RunReader.open(path) as run:
        run.verify()
        return [own for *_, own in run.chained()]


def refused(path: Path, files: Files) -> str:
    """What reader and writer say of it; "" if they open it, and then nothing is lost."""
    before, said = by_itself(path), []
    for kind in (RunReader, RunWriter):
        try:
            with kind.open(path) as run:
                run.verify()
                found = [own for *_, own in run.chained()]
            assert found[: len(before)] == before
            said.append("")
        except RunFileError as error:
            assert isinstance(error, ForeignFileError), error
            assert taken(path) == files
            said.append(str(error))
    assert [bool(s) for s in said] in ([False, False], [True, True])
    assert by_itself(path)[: len(before)] == before
    return said[1]


def test_only_the_present_generation_of_a_log_can_hide_records(tmp_path: Path, nights: Nights):
    shorter = 0
    for files in nights[0]:
        path = laid(tmp_path / "stood", files)
        whole, present = opening.by_itself(path), 32 + wal.inspect(path).frames * (24 + PAGE)
        cut = laid(tmp_path / "cut", {**files, "-wal": files["-wal"][:present]})
        shorter += present < len(files["-wal"])
        assert opening.by_itself(cut) == whole
    assert shorter


def test_of_every_file_and_log_of_two_nights_each_pair_opens_whole_or_is_refused(tmp_path: Path, nights: Nights):
    ones, done, twos, other = nights
    opened = 0
    for i, main in enumerate([*ones, done, *twos, other]):
        for j, log in enumerate([*ones, *twos]):
            files = {"": main[""], "-wal": log["-wal"]}
            path = laid(tmp_path / "pair", files)
            said = refused(path, files)
            same = main.get("-wal") == log["-wal"]
            assert not (same and said), (i, j, said)
            if said:
                assert f"Move {path}-wal to another folder" in said, (i, j)
            opened += not said
    assert opened >= len(ones) + len(twos)


def test_pieces_of_a_log_are_refused_beside_a_finished_run_unless_nothing_of_them_is_taken(tmp_path, nights):
    ones, done, twos, _ = nights
    for log in (ones[3]["-wal"], ones[-1]["-wal"], twos[2]["-wal"]):
        for frames in (0, 1, 2, 3, 5, 8):
            files = {"": done[""], "-wal": log[: 32 + frames * (24 + 4096)]}
            path = laid(tmp_path / "piece", files)
            refused(path, files)
    path = laid(tmp_path / "piece", {**done, "-wal": b""})
    assert refused(path, {}) == ""


@pytest.mark.parametrize(
    "command",
    [
        ["verify"],
        ["status"],
        ["fit"],
        ["export", "--out", "data.csv"],
        ["export", "--salvage", "--out", "data.csv"],
        ["resume"],
    ],
)
def test_every_command_refuses_a_finished_run_with_a_log_from_before(tmp_path, monkeypatch, nights, command):
    ones, done, _, _ = nights
    files = {"": done[""], "-wal": ones[5]["-wal"]}
    path = laid(tmp_path / "runs", files)
    monkeypatch.chdir(tmp_path)
    said = rig(command[0], path, *command[1:])
    assert said.returncode == 1, said.stderr
    assert f"{path.name}-wal is not the log of" in said.stderr.replace("\n", "")
    assert taken(path) == files


def changing_mode(folder: Path, files: Files, to: str) -> list[Files]:
    """A run file and its journal as they stood at every write while its mode was changed."""
    path, seen = laid(folder, files), []

    class Watching(apsw.VFSFile):
        def xWrite(self, data: bytes, offset: int) -> None:
            super().xWrite(data, offset)
            seen.append(taken(path))

        def xSync(self, flags: int) -> None:
            super().xSync(flags)
            seen.append(taken(path))

    class Disk(apsw.VFS):
        def __init__(self) -> None:
            super().__init__("watching", "")

        def xOpen(self, name: str | apsw.URIFilename | None, flags: list[int]) -> apsw.VFSFile:
            return Watching("", name, flags)

    disk = Disk()
    db = apsw.Connection(str(path), vfs="watching")
    db.pragma("synchronous", "extra")
    assert db.pragma("journal_mode", to) == to
    db.close()
    disk.unregister()
    return [files for files in seen if "-journal" in files]


@pytest.mark.parametrize("to", ["wal", "delete"])
def test_a_journal_of_a_change_of_mode_is_gone_on_with_and_beside_another_file_refused(tmp_path, nights, to):
    ones, done, _, other = nights
    before = done if to == "wal" else laid_over(tmp_path / "mode", done)
    stood = changing_mode(tmp_path / "own", before, to)
    hot = [files for files in stood if files["-journal"][:8] == _MAGIC]
    assert len(stood) >= 4
    assert hot
    whole = len(records(laid(tmp_path / "whole", done)))
    for files in stood:
        for kind in (RunReader, RunWriter):
            with kind.open(laid(tmp_path / "cut", {**files, "-wal": b""})) as run:
                run.verify()
                assert run.head()[0] == whole
    for main in (other, ones[4], {"": done[""] + bytes(4096)}):
        for files in hot:
            pair = {"": main[""], "-journal": files["-journal"]}
            for kind in (RunReader, RunWriter):
                path = laid(tmp_path / "pair", pair)
                with pytest.raises(ForeignFileError, match=r"(?s)is not the journal of .* Move .*-journal to another"):
                    kind.open(path)
                assert taken(path) == pair


def laid_over(folder: Path, done: Files) -> Files:
    """A finished run put back into the mode of one under way."""
    path = laid(folder, done)
    db = apsw.Connection(str(path))
    db.pragma("journal_mode", "wal")
    db.close()
    return taken(path)
