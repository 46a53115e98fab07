"""Run files damaged byte by byte: what opening them says, and whether they can be gone on with.

The quick tests do a share of it, `python -m proving crashes` all of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from proving.crashes.runs import Run, crash_once
from proving.disk import Disk
from rig.errors import RigError
from rig.run_file.chain import Record
from rig.run_file.live import live_path, read_json
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import fold
from rig.run_file.verify.verification import restored
from rig.run_file.write.writer import RunWriter
from rig.runs.controller import _losses
from rig.tables.table_of_run import run_table

FLIPS = 512
"""In a finished file one bit is flipped in every so many bytes."""

Damage = tuple[str, bytes]
"""What was done, and the damaged file."""


@dataclass
class Interrupted:
    """A run whose program was killed: its files as they lay there, and what it had acknowledged.

    Attributes:
        run: the run; its disk is gone.
        files: content by name.
        log: name of the write-ahead log.
        frame: bytes in a frame of the log.
        end: where the present generation of the log ends, in bytes.
        commits: where each of its commits begins.

    """

    run: Run
    files: dict[str, bytes]
    log: str
    frame: int
    end: int
    commits: list[int]

    @classmethod
    def make(cls, lab: str, folder: Path, at: int = 152) -> Interrupted:
        """Kill a run at a write, a few commits after its log was begun again."""
        for nth in range(at, at + 200, 6):
            made = cls._killed(lab, folder / str(nth), nth)
            if 3 <= len(made.commits) <= 9 and len(made.files[made.log]) > made.end:
                return made
        raise AssertionError("no crash point with a few commits in a log begun again")

    @classmethod
    def _killed(cls, lab: str, folder: Path, nth: int) -> Interrupted:
        folder.mkdir(parents=True)
        with Disk(seed=nth, default=True) as disk:
            run = Run(lab, folder, disk)
            disk.crash_at(nth)
            assert not run.go_on()
            disk.power_cut("none")
        assert run.path is not None
        files = {p.name: p.read_bytes() for p in folder.iterdir() if p.suffix != ".toml" and "-shm" not in p.name}
        log = f"{run.path.name}-wal"
        data = files.get(log, b"")
        frame = 24 + int.from_bytes(data[8:12], "big")
        places = [at for at in range(32, len(data), frame) if data[at + 8 : at + 16] == data[16:24]]
        ends = [at + frame for at in places if any(data[at + 4 : at + 8])]
        return cls(run, files, log, frame, ends[-1] if ends else 0, [32, *ends[:-1]])

    def put(self, folder: Path, log: bytes) -> Path:
        """Lay the files out again, with another log."""
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.iterdir():
            old.unlink()
        for name, content in self.files.items():
            (folder / name).write_bytes(log if name == self.log else content)
        assert self.run.path is not None
        return folder / self.run.path.name

    def damages(self, every: int) -> Iterator[Damage]:
        """A bit flipped, and a cut, at every byte of the last two commits and of the log's header; a cut at every
        edge of a frame; the log gone.
        """
        whole = self.files[self.log]
        start = self.commits[-2]
        for at in (*range(0, 32, every), *range(start, self.end, every)):
            flipped = bytearray(whole)
            flipped[at] ^= 1 << at % 8
            yield f"bit flipped in byte {at}", bytes(flipped)
        for at in range(start, self.end, every):
            yield f"cut at byte {at}", whole[:at]
        for at in range(32, len(whole) + 1, self.frame):
            yield f"cut at frame edge {at}", whole[:at]
        yield "emptied", b""


def _observations(records: Iterable[tuple[int, Record, bytes, bytes]]) -> dict[int, bytes]:
    return {seq: own for seq, r, _, own in records if r.kind == "observation" and r.status == "accepted"}


def log_damages(killed: Interrupted, every: int) -> tuple[Counter[str], list[str]]:
    """Open and verify each damaged log; resume once for each distinct outcome.

    Returns:
        how often which outcome, and what is wrong: an acknowledged observation that is gone without a word, an error
        that names no way forward, a run that cannot be brought to its end.

    """
    counts: Counter[str] = Counter()
    wrong: list[str] = []
    resumed: set[object] = set()
    folder = killed.run.folder / "damaged"
    with Disk(seed=1, default=True) as disk:
        for what, log in killed.damages(every):
            path = killed.put(folder, log)
            told = int((read_json(live_path(path)) or {}).get("done", 0))
            try:
                with RunWriter.open(path) as run:
                    state, found = fold(run.records()), _observations(run.chained())
                    said = list(_losses(run, state, told))
                    disk.power_cut("none")  # closing it must not fold the log away
            except RigError as error:
                disk.power_cut("none")
                counts[f"refused: {type(error).__name__}"] += 1
                if not way_forward(str(error)):
                    wrong.append(f"{what}: {error}")
                continue
            gone = sum(found.get(seq) != own for seq, own in killed.run.acknowledged.items())
            counts[f"{gone} acknowledged observation(s) gone, {'said' if said else 'not said'}"] += 1
            if gone and not said:
                wrong.append(f"{what}: {gone} acknowledged observation(s) gone without a word")
            outcome = (state.elapsed_s, tuple(sorted(found)), bool(said))
            if outcome not in resumed:
                resumed.add(outcome)
                again = Run(killed.run.lab, folder, disk)
                killed.put(folder, log)
                again.go_on()
                if (verdict := again.judge()) or bool(said) != bool(again.warnings):
                    wrong.append(f"{what}, resumed: {verdict} {again.warnings}")
                counts["distinct outcomes resumed to the end"] += 1
                disk.power_cut("none")
    return counts, wrong


def way_forward(message: str) -> bool:
    """Whether a message says what to do next."""
    return "rig export" in message or "rig verify" in message or "rig resume" in message


def small_finished(lab: str, folder: Path) -> Path:
    """A finished run file."""
    _, run, verdict = crash_once(lab, folder, 1_000_000, "none", 1)
    assert not verdict, verdict
    assert run.path is not None
    return run.path


def file_damages(path: Path, flips: int, every: int) -> tuple[Counter[str], list[str]]:
    """Damage a finished file: its header, and a bit in every so many bytes of every page.

    Returns:
        how often which outcome, and what is wrong: a damage that neither shows nor leaves every record as it was, an
        error that names no way forward, or a way forward that leads nowhere.

    """
    counts: Counter[str] = Counter()
    wrong: list[str] = []
    whole = path.read_bytes()
    with RunReader.open(path) as reader:
        before = list(reader.chained())
    rows = len(run_table(path))
    header, body = range(0, 100, every), range(100, len(whole), flips * every)
    cuts = [(f"cut at byte {at}", whole[:at]) for at in range(0, len(whole), 4096 * every)]
    for what, damaged in (*_flipped(whole, (*header, *body)), *cuts):
        path.write_bytes(damaged)
        try:
            with RunReader.open(path) as reader:
                reader.verify()
                same = list(reader.chained()) == before
            counts["verifies, every record as it was" if same else "verifies, changed"] += 1
            if not same:
                wrong.append(f"{what}: verifies, and is not what it was")
        except RigError as error:
            if not way_forward(str(error)):
                wrong.append(f"{what}: {error}")
            kept = _salvaged(path)
            share = "all" if kept == rows else "some" if kept else "none"
            count, same = _restored(path, before)
            new = "all" if count == len(before) else "some" if count else "none"
            if not same:
                wrong.append(f"{what}: what was restored is not what was written")
            counts[f"refused ({type(error).__name__}), {share} of the observations salvaged"] += 1
            counts[f"of those refused: {new} of the records restored"] += 1
    path.write_bytes(whole)
    return counts, wrong


def _flipped(whole: bytes, places: Iterable[int]) -> Iterator[Damage]:
    for at in places:
        damaged = bytearray(whole)
        damaged[at] ^= 1 << at // 7 % 8
        yield f"bit flipped in byte {at}", bytes(damaged)


def _restored(path: Path, before: list[tuple[int, Record, bytes, bytes]]) -> tuple[int, bool]:
    """How many records a damaged file gives back, and whether they are those that were written."""
    new = path.with_name("restored.sqlite")
    try:
        count = restored(path, new).records
        with RunReader.open(new) as reader:
            return count, list(reader.chained()) == before[:count]
    except RigError:
        return 0, True
    finally:
        new.unlink(missing_ok=True)


def _salvaged(path: Path) -> int:
    try:
        return len(run_table(path, salvage=True))
    except RigError:
        return 0
