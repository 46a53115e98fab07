"""A real controller under chaos: started, carried on as its own messages say, and held to what it once had accepted."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from proving.chaos.bench import PROJECT, Disk, Lab, ServedBench
from proving.chaos.tape import accepted_in

LOSS = re.compile(
    r"\d+ record\(s\) that had been written are lost|\d+ are lost|each proven by its hash|"
    r"NOT saved|could not be saved|no copy could be made"
)
"""What a program says that has lost something."""
CODES = {0, 1, 2, 4, 5, 75, 78, -signal.SIGKILL}
_TOLD = re.compile(r"(\d+)(?: record\(s\) that had been written)? are lost")
_FACES = re.compile(r"Traceback|unforeseen", re.IGNORECASE)
_OTHER = re.compile(r"rig resume (\S+\.sqlite)")
_STEPS = 60


class Stuck(Exception):
    """The run cannot be carried on by what its messages say."""


class ChaosRun:
    """One run, from its creation to its end.

    Args:
        lab: where.
        folder: where everything goes.
        rng: chooses.
        say: told what happens.

    Attributes:
        path: the run file; another one after a rescue.
        ledger: what was accepted and has not been said to be lost.
        pending: what was accepted, is not in the file any more, and nobody has said so yet.
        findings: what must not be.
        said: what was lost, and in which words.
        outages: when instruments could not be reached, by the bench clock.

    """

    def __init__(self, lab: Lab, folder: Path, rng: random.Random) -> None:
        self.lab, self.folder, self.rng = lab, folder, rng
        self.disk = Disk(folder / "disk")
        self.runs = self.disk.folder / "runs"
        self.runs.mkdir()
        (folder / "tmp").mkdir()
        self.bench = ServedBench(lab, folder)
        self.process: subprocess.Popen[bytes] | None = None
        self.path = Path()
        self.ledger: dict[tuple[int, int], str] = {}
        self.pending: dict[tuple[int, int], str] = {}
        self.findings: list[str] = []
        self.said: list[str] = []
        self.outages: list[tuple[float, float]] = []
        self.said_lost = self.refusals = self.rescues = self.sessions = 0
        self.complete = False
        self._log = (folder / "chaos.log").open("w")
        self._backup = folder / "backup"
        self._backup.mkdir()
        self._out = folder / "out"
        self._failures = 0

    def note(self, words: str) -> None:
        """A line for whoever looks for the reason of a finding."""
        print(f"{time.monotonic():.3f} {words}", file=self._log, flush=True)

    # --- processes ------------------------------------------------------------------------------------------

    def spawn(self, *words: object, out: Path | None = None, before: tuple[str, ...] = ()) -> subprocess.Popen[bytes]:
        """Start `rig` with these words; what it says goes to a file."""
        out = out or self._out
        command = [*before, sys.executable, "-m", "rig", *map(str, words)]
        env = {**os.environ, "TMPDIR": str(self.folder / "tmp")}
        with out.open("wb") as file:
            return subprocess.Popen(command, cwd=PROJECT, env=env, stdout=file, stderr=subprocess.STDOUT)

    def begin(self) -> None:
        """`rig run`, until its file exists."""
        self.bench.start()
        procedure = self.folder / "procedure.toml"
        procedure.write_text(self.lab.procedure.format(gap=self.lab.gap_s, seed=self.rng.randrange(1000)))
        self.process = self.spawn("run", procedure, "--bench", self.bench.file, "--out", self.runs)
        self.sessions += 1
        end = time.monotonic() + 60
        while not (found := [*self.runs.glob("*.sqlite")]):
            if self.process.poll() is not None or time.monotonic() > end:
                raise RuntimeError(f"the run did not begin: {self.words()}")
            time.sleep(0.01)
        self.path = found[0]

    def resume(self, *options: object, before: tuple[str, ...] = ()) -> None:
        """`rig resume` of the run, in the background."""
        assert not self.alive
        options = options or ("--bench", self.bench.file)
        self._out = self.folder / "out"
        self.process = self.spawn("resume", self.path, *options, before=before)
        self.sessions += 1

    @property
    def alive(self) -> bool:
        """Whether the controller lives."""
        return self.process is not None and self.process.poll() is None

    def adopt(self, out: Path) -> None:
        """Another process has become the controller; what it says goes there."""
        self._out, self.sessions = out, self.sessions + 1

    def words(self) -> str:
        """What the controller has said."""
        return self._out.read_text(errors="replace") if self._out.exists() else ""

    def signal(self, number: signal.Signals) -> None:
        """To the controller itself, also where another program started it."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, number)

    @property
    def pid(self) -> int:
        """Of the controller itself."""
        assert self.process is not None
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        with contextlib.suppress(OSError):
            words = Path(f"/proc/{self.process.pid}/cmdline").read_bytes()
            if words.startswith(b"unshare") and (inner := children.read_text().split()):
                return int(inner[0])
        return self.process.pid

    def freeze(self) -> None:
        """SIGSTOP, and wait until it stands."""
        self.signal(signal.SIGSTOP)
        end = time.monotonic() + 1
        while time.monotonic() < end:
            with contextlib.suppress(OSError):
                if Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()[0] in "TtZ":
                    return
            time.sleep(0.002)

    def kill(self) -> None:
        """SIGKILL, and wait."""
        assert self.process is not None
        self.signal(signal.SIGKILL)
        self.process.wait()

    @contextlib.contextmanager
    def outage(self) -> Iterator[None]:
        """Around what keeps instruments from answering."""
        began = time.clock_gettime(time.CLOCK_BOOTTIME)
        yield
        ended = time.clock_gettime(time.CLOCK_BOOTTIME) + 1.0  # until the controller has tried again
        self.outages.append((began * self.lab.speed, ended * self.lab.speed))

    # --- the ledger -----------------------------------------------------------------------------------------

    def copied(self) -> Path | None:
        """A copy of the run file with its log, for looking into; None if there is nothing that can be read."""
        copy = self.folder / "look.sqlite"
        for suffix in ("", "-wal", "-shm"):
            Path(f"{copy}{suffix}").unlink(missing_ok=True)
        try:
            for suffix in ("", "-wal"):
                if Path(f"{self.path}{suffix}").exists():
                    shutil.copy(f"{self.path}{suffix}", f"{copy}{suffix}")
        except OSError:
            return None
        return copy if copy.exists() else None

    def look(self) -> None:
        """Learn what is accepted now; what was and is not any more has to be said by somebody."""
        copy = self.copied()
        try:
            now = accepted_in(copy) if copy else None
        except (sqlite3.Error, ValueError, KeyError, OSError):
            now = None
        if now is None:
            return  # unreadable: whatever is carried on instead is held against the ledger
        for key in [k for k, body in self.ledger.items() if now.get(k) != body]:
            self.pending[key] = self.ledger.pop(key)
        for key in [k for k, body in self.pending.items() if now.get(k) == body]:
            del self.pending[key]
        self.ledger.update(now)
        for suffix in ("", "-wal"):  # what a careful person has: a copy of the last that could be read
            Path(f"{self._backup}/{self.path.name}{suffix}").unlink(missing_ok=True)
            with contextlib.suppress(OSError):
                shutil.copy(f"{copy}{suffix}", f"{self._backup}/{self.path.name}{suffix}")

    def hear(self, words: str) -> None:
        """What was said may explain what is missing."""
        if not (LOSS.search(words) and self.pending):
            return
        missing, told = len(self.pending), [int(n) for n in _TOLD.findall(words)]
        said = " ".join(line for line in words.splitlines() if LOSS.search(line))
        self.said.append(f"{missing} lost: {said}")
        self.note(self.said[-1])
        if told and max(told) < missing:
            self.findings.append(f"{missing} observations are lost, and fewer are told: {said}")
        self.said_lost += missing
        self.pending.clear()

    # --- ends ---------------------------------------------------------------------------------------------

    def ended(self, *, killed: bool = False) -> None:
        """A session has ended: was it as it may, and how does the run go on?"""
        assert self.process is not None
        code, words = self.process.wait(), self.words()
        if code > 128:  # another program had started it
            code = 128 - code
        last = " | ".join(words.strip().splitlines()[-4:])
        self.note(f"exit {code}: {last}")
        # Python itself, before it has come to a line of the project, ends with one on Ctrl-C
        unborn = -code in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP) and f"{PROJECT}/" not in words
        if _FACES.search(words) and not unborn:
            self.findings.append(f"a traceback: {words[-2000:]}")
        if code not in CODES and not killed and not unborn:
            self.findings.append(f"exit code {code}: {last}")
        if code in (1, 2, 5, 78) and len(words.strip()) < 20:
            self.findings.append(f"exit code {code} without a sentence: {words!r}")
        if code == 0:
            self.complete = True
        if code in (1, 2, 5, 78):
            self.refusals += 1
            self._go_on(words)
        self.look()
        self.hear(words)
        self.process = None

    def _go_on(self, words: str) -> None:
        """Do what the message says."""
        other = next((p for p in map(Path, _OTHER.findall(words)) if p != self.path and p.exists()), None)
        if other is not None:
            self.rescues += 1
            self.note(f"goes on in {other}")
            self.look_at(other)
        elif re.search(r"-wal is not the log|Move \S+-wal", words):
            log = Path(f"{self.path}-wal")
            self.note("the log is moved away, as it says")
            shutil.move(log, self.folder / f"moved-{time.monotonic_ns()}-wal")
        elif "there is no run file" in words:
            self.put_back(words)
        elif re.search(r"--restore|damaged|edited|not a run file|makes no sense", words):
            self.restore()

    def look_at(self, other: Path) -> None:
        """Carry on with another file; everything accepted has to be in it."""
        self.path = other

    def restore(self) -> None:
        """`rig verify --restore`, and if that finds nothing, the copy from before."""
        new = self.path.with_name(f"{self.path.stem[:40]}-restored-{time.monotonic_ns()}.sqlite")
        out = self.folder / "restore.out"
        code = self.spawn("verify", self.path, "--restore", new, out=out).wait()
        words = out.read_text(errors="replace")
        self.note(f"restore: exit {code}: {words.strip()}")
        if _FACES.search(words):
            self.findings.append(f"a traceback: {words[-2000:]}")
        named = re.search(r"(?:goes on|continues) in (\S+\.sqlite)", words)
        if named and Path(named[1]).exists():
            self.rescues += 1
            self.look_at(Path(named[1]))
        elif code == 0:
            self.path = new
            self.look()
            self.hear(words)
        else:
            self.put_back(words)

    def put_back(self, words: str) -> None:
        """Go on with the copy from before; that this one is damaged, or not there, was said."""
        kept = self._backup / self.path.name
        if not kept.exists():
            raise Stuck(f"nothing to go on with: {words}")
        for suffix in ("", "-wal", "-shm", "-journal"):
            Path(f"{self.path}{suffix}").unlink(missing_ok=True)
            with contextlib.suppress(OSError):
                shutil.copy(f"{kept}{suffix}", f"{self.path}{suffix}")
        self.note("goes on with a copy from before")
        self.look()
        if self.pending:
            self.said.append(f"{len(self.pending)} lost, as there is only a copy from before: {words.strip()[:300]}")
        self.said_lost += len(self.pending)
        self.pending.clear()

    def live_state(self) -> str:
        """What the controller says it is doing."""
        with contextlib.suppress(OSError, ValueError):
            return str(json.loads(self.path.with_suffix(".live").read_text())["state"])
        return ""

    def wait(self, seconds: float) -> None:
        """Let it work for so long; carry it on if it ends meanwhile, release it if it holds."""
        end, held = time.monotonic() + seconds, 0.0
        while not self.complete and time.monotonic() < end:
            if not self.alive:
                self.ended()
                self._carry_on()
            time.sleep(min(0.02, max(end - time.monotonic(), 0.0)))
            held = held + 0.02 if self.live_state() == "holding" else 0.0
            if held > 0.5:
                self.spawn("release", self.path, out=self.folder / "release.out").wait()
                held = 0.0

    def _carry_on(self) -> None:
        if not self.complete:
            self._failures += 1
            if self._failures > _STEPS:
                raise Stuck(f"{_STEPS} sessions ended by themselves; last: {self.words()[-1000:]}")
            self.resume()

    def finish(self) -> None:
        """Leave it alone until it is complete."""
        for _ in range(20):
            if self.complete:
                break
            if self.process is None:
                self.resume()
            self.wait(60)
        if not self.complete:
            raise Stuck(f"not complete after 20 minutes; {self.live_state()}; {self.words()[-500:]}")
        if self.pending:
            self.findings.append(f"{len(self.pending)} accepted observations are gone, and nothing has said so")

    def close(self) -> None:
        """End everything that was started."""
        if self.alive:
            self.kill()
        self.bench.close()
        with contextlib.suppress(OSError):
            for file in self.runs.iterdir():
                shutil.copy(file, self.folder)
        self.disk.close()
        self._log.close()
