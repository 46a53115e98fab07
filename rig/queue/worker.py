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
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from rig.drivers.clock import Clock
from rig.engine.session import Signals
from rig.errors import ExitCode, RigError, StorageError
from rig.loop import SUFFIX, open_program
from rig.queue.file import Item, Keeps, Queue
from rig.run_file.events.event import Event
from rig.run_file.events.queues import QueueBegan, QueueEnded
from rig.run_file.live import controller_alive
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import read_state
from rig.who import BY_PASSWORD, VARIABLE

RIG = (sys.executable, "-m", "rig")
_POLL_S = 0.5
_AWAY_S = 5.0
"""Seconds between two tries to reach a queue that is kept elsewhere."""
_MOST_STARTS = 5
"""Number of starts of an item's command after which an interruption counts as a fault."""


@dataclass
class _Worker:
    file: Keeps
    has: frozenset[str]
    signals: Signals
    said: Callable[[str], None]
    children: dict[int, subprocess.Popen[bytes]] = field(default_factory=dict)

    def start(self, item: Item) -> None:
        """Start an item's command, or resume what is there of it, unless another worker has."""
        folder = self.folder_of(item)
        folder.mkdir(parents=True, exist_ok=True)
        made, asked = file_in(folder), item.asked
        command = [*RIG]
        if made is not None:
            command += ["resume", str(made)]
        elif asked.command == "resume":
            command += ["resume", asked.procedure]
        else:
            command += [asked.command, asked.procedure, "--bench", asked.bench, "--out", str(folder), *asked.options]
        own = {} if asked.who is None else {VARIABLE: asked.who, BY_PASSWORD: asked.who_by or ""}
        lock = os.open(folder / "lock", os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # first: who reads that it began finds it at work
            if not self._begins(item, folder):
                return
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

    def _begins(self, item: Item, folder: Path) -> bool:
        """Write that an item begins or goes on; False where it is not any more as it was read."""
        began: list[Event] = []

        def decided(queue: Queue) -> list[Event]:
            now = queue.items.get(item.number)
            own = now is not None and (now.begun, now.ended) == (item.begun, item.ended)
            there = str(folder.absolute()) if self.file.machine else None
            began[:] = [QueueBegan(item=item.number, folder=there)] if own else []
            return list(began)

        self.file.decide(decided)
        return bool(began)

    def folder_of(self, item: Item) -> Path:
        """Folder of an item's files."""
        return Path(item.folder) if item.folder else self.file.folder_of(item.number)

    def _another_alive(self, item: Item) -> bool:
        """Whether the worker who began an item in a folder of its own is alive."""
        own, lock = self.file.lock_of(self.file.folder_of(0)).absolute(), self.file.lock_of(Path(item.folder or "-"))
        return bool(item.folder) and lock != own and controller_alive(lock)

    def mine(self, items: list[Item]) -> list[Item]:
        """Those of this machine."""
        return [one for one in items if one.machine in ("", self.file.machine)]

    def look(self, item: Item) -> None:
        """See whether an item at work has ended; one that was cut is resumed."""
        child = self.children.get(item.number)
        folder = self.folder_of(item)
        if child is not None:
            if child.poll() is None:
                return
            code = child.returncode if child.returncode >= 0 else int(ExitCode.INTERRUPTED)
        elif controller_alive(folder / "lock") or self._another_alive(item):
            return  # still at work, of a worker that is gone; or of another one, who looks after it
        else:
            code = code_of(file_in(folder) or resumed(item))
        if code == ExitCode.INTERRUPTED and not self.signals.interrupt:
            if item.begun < _MOST_STARTS:
                self.children.pop(item.number, None)
                self.start(item)
                return
            code = ExitCode.FAULT
        if code == ExitCode.INTERRUPTED:
            return  # it goes on with the next worker
        made = file_in(folder) or resumed(item)
        self.file.append(QueueEnded(item=item.number, code=int(code), file="" if made is None else str(made)))
        self.children.pop(item.number, None)  # only now: where that could not be written, the next look tells it
        self.said(f"item {item.number} ended with exit code {int(code)}")


def work(
    file: Keeps,
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
    with file.only_worker():
        return _work(_Worker(file, has, signals, said), clock, stay=stay, leave=leave)


def _work(worker: _Worker, clock: Clock, *, stay: bool, leave: Callable[[], bool]) -> Queue:
    file, signals = worker.file, worker.signals
    queue, seen, away = Queue(), None, False
    while not leave():
        try:
            now = file.changes()
            idle = stay and not (worker.mine(queue.at_work) or worker.mine(queue.waiting) or signals.interrupt)
            if idle and (now == seen or now is None):
                clock.sleep(_POLL_S)
                continue
            queue, seen = file.read(), now
            if signals.interrupt:
                return _ended(worker)
            queue = _look(worker, clock)
            away = False
        except StorageError as error:
            if not file.patient or signals.interrupt:
                raise
            if not away:
                worker.said(f"{error}; what is at work goes on, nothing begins, and it is tried again")
            away = True
            clock.sleep(_AWAY_S)
            continue
        waiting = worker.mine(queue.waiting)
        later = any((one.asked.not_before_s or 0.0) > clock.utc() for one in waiting) and not queue.paused
        if not worker.mine(queue.at_work) and not stay and not later:
            return queue
        clock.sleep(_POLL_S)
    return queue


def _look(worker: _Worker, clock: Clock) -> Queue:
    """See what has ended, and begin what may; returns the state afterwards."""
    file = worker.file
    for item in worker.mine(file.read().at_work):
        worker.look(item)
    for item in file.read().next(clock.utc(), worker.has, file.machine):
        worker.start(item)
    return file.read()


def _ended(worker: _Worker) -> Queue:
    """Pass an interrupt on, and write what has ended by then."""
    for child in worker.children.values():
        with contextlib.suppress(ProcessLookupError):
            child.send_signal(signal.SIGTERM)
    for child in worker.children.values():
        child.wait()
    for item in worker.mine(worker.file.read().at_work):
        worker.look(item)
    return worker.file.read()


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
