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
from rig.errors import ExitCode, RigError
from rig.loop import SUFFIX, open_program
from rig.queue.file import Item, Queue, QueueFile
from rig.run_file.events.queues import QueueBegan, QueueEnded
from rig.run_file.live import controller_alive
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import read_state

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

    def folder(self, item: Item) -> Path:
        """Folder of an item's files."""
        return self.file.path.with_name(f"{self.file.path.stem}-{item.number}")

    def start(self, item: Item) -> None:
        """Start an item's command, or resume what is there of it."""
        folder = self.folder(item)
        folder.mkdir(parents=True, exist_ok=True)
        made, asked = file_in(folder), item.asked
        command = [*RIG]
        if made is not None:
            command += ["resume", str(made)]
        else:
            command += [asked.command, asked.procedure, "--bench", asked.bench, "--out", str(folder), *asked.options]
        self.file.append(QueueBegan(item=item.number))
        lock = os.open(folder / "lock", os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with open(folder / "output.txt", "ab") as output:
                self.children[item.number] = subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=output, stderr=output, pass_fds=(lock,)
                )
        finally:
            os.close(lock)  # the process has its own
        self.said(f"item {item.number}: rig {' '.join(command[len(RIG) :])}")

    def look(self, item: Item) -> None:
        """See whether an item at work has ended; one that was cut is resumed."""
        child = self.children.get(item.number)
        folder = self.folder(item)
        if child is not None:
            if child.poll() is None:
                return
            del self.children[item.number]
            code = child.returncode if child.returncode >= 0 else int(ExitCode.INTERRUPTED)
        elif controller_alive(folder / "lock"):
            return  # of a worker that is gone, and still at work
        else:
            code = code_of(file_in(folder))
        if code == ExitCode.INTERRUPTED and not self.signals.interrupt:
            if item.begun < _MOST_STARTS:
                self.start(item)
                return
            code = ExitCode.FAULT
        if code == ExitCode.INTERRUPTED:
            return  # it goes on with the next worker
        made = file_in(folder)
        self.file.append(QueueEnded(item=item.number, code=int(code), file="" if made is None else str(made)))
        self.said(f"item {item.number} ended with exit code {int(code)}")


def work(
    file: QueueFile, clock: Clock, *, has: frozenset[str], signals: Signals, said: Callable[[str], None], stay: bool
) -> Queue:
    """Carry out what is in a queue, until nothing is left that may begin; returns its state.

    Args:
        file: the queue.
        clock: for dates, and waits between looks.
        has: what is there of what items need.
        signals: an interrupt is passed on to the processes; they can be resumed.
        said: called with a sentence about every step.
        stay: whether to wait for further items.

    Raises:
        RigError: the queue cannot be read or written.
    """
    worker = _Worker(file, has, signals, said)
    while True:
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
