"""Carries out the items of a queue: each is a process of its own, `rig run` or `rig loop`, with a folder of its own.

A process holds a lock in its folder as long as it lives, also after the death of the worker that started it. So a new
worker finds out whether an item is still at work, whether it has to be resumed, or how it ended.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from rig.drivers.clock import Clock
from rig.engine.session import Signals
from rig.errors import BusyError, ExitCode, RigError
from rig.loop import SUFFIX, open_program
from rig.queue.file import Item, Queue, QueueFile
from rig.run_file.events.queues import QueueBegan, QueueEnded
from rig.run_file.live import controller_alive
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import read_state
from rig.who import BY_PASSWORD, VARIABLE

RIG = (sys.executable, "-m", "rig")
_POLL_S = 0.5
_MOST_STARTS = 5
"""Number of starts of an item's command after which an interruption counts as a fault."""


@dataclass
class _Worker:
    file: QueueFile
    has: frozenset[str]
    signals: Signals
    said: Callable[[str], None]
    children: dict[int, subprocess.Popen[bytes]] = field(default_factory=dict)

    def start(self, item: Item) -> None:
        """Start an item's command, or resume what is there of it."""
        folder = self.file.folder_of(item.number)
        folder.mkdir(parents=True, exist_ok=True)
        made, asked = file_in(folder), item.asked
        command = [*RIG]
        if made is not None:
            command += ["resume", str(made)]
        elif asked.command == "resume":
            command += ["resume", asked.procedure]
        else:
            command += [asked.command, asked.procedure, "--bench", asked.bench, "--out", str(folder), *asked.options]
        self.file.append(QueueBegan(item=item.number))
        own = {} if asked.who is None else {VARIABLE: asked.who, BY_PASSWORD: asked.who_by or ""}
        lock = os.open(folder / "lock", os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with open(folder / "output.txt", "ab") as output:
                self.children[item.number] = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=output,
                    pass_fds=(lock,),
                    env={**os.environ, **own},
                    start_new_session=True,  # Ctrl-C is for the worker, which passes it on, or leaves runs alone
                )
        finally:
            os.close(lock)  # the process has its own
        self.said(f"item {item.number}: rig {' '.join(command[len(RIG) :])}")

    def look(self, item: Item) -> None:
        """See whether an item at work has ended; one that was cut is resumed."""
        child = self.children.get(item.number)
        folder = self.file.folder_of(item.number)
        if child is not None:
            if child.poll() is None:
                return
            del self.children[item.number]
            code = child.returncode if child.returncode >= 0 else int(ExitCode.INTERRUPTED)
        elif controller_alive(folder / "lock"):
            return  # of a worker that is gone, and still at work
        else:
            code = code_of(file_in(folder) or resumed(item))
        if code == ExitCode.INTERRUPTED and not self.signals.interrupt:
            if item.begun < _MOST_STARTS:
                self.start(item)
                return
            code = ExitCode.FAULT
        if code == ExitCode.INTERRUPTED:
            return  # it goes on with the next worker
        made = file_in(folder) or resumed(item)
        self.file.append(QueueEnded(item=item.number, code=int(code), file="" if made is None else str(made)))
        self.said(f"item {item.number} ended with exit code {int(code)}")


def work(
    file: QueueFile,
    clock: Clock,
    *,
    has: frozenset[str],
    signals: Signals,
    said: Callable[[str], None],
    stay: bool,
    leave: Callable[[], bool] = lambda: False,
) -> Queue:
    """Carry out what is in a queue, until nothing is left that may begin; returns its state.

    Args:
        file: the queue.
        clock: for dates, and waits between looks.
        has: what is there of what items need.
        signals: an interrupt is passed on to the processes; they can be resumed.
        said: called with a sentence about every step.
        stay: whether to wait for further items.
        leave: whether to end now, and leave the processes at work to the next worker.

    Raises:
        BusyError: another worker carries it out.
        RigError: the queue cannot be read or written.
    """
    with _only_worker(file.path):
        return _work(_Worker(file, has, signals, said), clock, stay=stay, leave=leave)


@contextlib.contextmanager
def _only_worker(path: Path) -> Iterator[None]:
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path.with_suffix(".worker"), "ab") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BusyError(f"{path} is carried out by another `rig queue run` or `rig serve`") from None
        yield


def _work(worker: _Worker, clock: Clock, *, stay: bool, leave: Callable[[], bool]) -> Queue:
    file, has, signals = worker.file, worker.has, worker.signals
    seen: tuple[object, ...] = ()
    queue = Queue()
    while not leave():
        now = _changes(file.path)
        idle = stay and not (queue.at_work or queue.waiting or signals.interrupt)
        if idle and (now == seen or not file.path.exists()):
            clock.sleep(_POLL_S)
            continue
        seen = now
        queue = file.read()
        if signals.interrupt:
            for child in worker.children.values():
                with contextlib.suppress(ProcessLookupError):
                    child.send_signal(signal.SIGTERM)
            for child in worker.children.values():
                child.wait()
        for item in queue.at_work:
            worker.look(item)
        if signals.interrupt:
            return file.read()
        queue = file.read()
        for item in queue.next(clock.utc(), has):
            worker.start(item)
        queue = file.read()
        later = any((one.asked.not_before_s or 0.0) > clock.utc() for one in queue.waiting) and not queue.paused
        if not queue.at_work and not stay and not later:
            return queue
        clock.sleep(_POLL_S)
    return queue


def _changes(path: Path) -> tuple[object, ...]:
    """Values that change with a queue's file."""
    found: list[object] = []
    for one in (path, path.with_name(path.name + "-wal")):
        with contextlib.suppress(OSError):
            stat = one.stat()
            found.append((stat.st_size, stat.st_mtime_ns))
    return tuple(found)


def resumed(item: Item) -> Path | None:
    """The file that an item resumes; None if it begins one."""
    return Path(item.asked.procedure) if item.asked.command == "resume" else None


def file_in(folder: Path) -> Path | None:
    """The program file, or the run file, in an item's folder; None if there is none."""
    loops = sorted(folder.glob(f"*{SUFFIX}"))
    runs = [one for one in sorted(folder.glob("*.sqlite")) if one not in loops]
    return next(iter([*loops, *runs]), None)


def code_of(path: Path | None) -> int:
    """Exit code of a command whose worker is gone, by its file; `INTERRUPTED` if it has to go on."""
    if path is None:
        return ExitCode.INTERRUPTED
    try:
        if path.name.endswith(SUFFIX):
            closed = open_program(path).closed
            if closed is None:
                return ExitCode.INTERRUPTED
            return ExitCode.DONE if closed.settled and not closed.fault else ExitCode.OUTSIDE_ACCEPTANCE
        with RunReader.open(path) as reader:
            state = read_state(reader)
    except RigError:
        return ExitCode.FAULT
    if state.ended is not None:
        return ExitCode.OUTSIDE_ACCEPTANCE if state.too_few else ExitCode.DONE
    if state.unsafe:
        return ExitCode.UNSAFE
    return {"stopped": ExitCode.STOPPED, "faulted": ExitCode.FAULT}.get(state.rested, ExitCode.INTERRUPTED)
