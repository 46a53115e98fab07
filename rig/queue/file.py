"""A queue and where it is kept: a file `queue.sqlite`, append-only and hash-chained like a run file."""

from __future__ import annotations

import contextlib
import fcntl
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path

from rig.errors import BusyError
from rig.run_file.chain import Record
from rig.run_file.events.event import Event
from rig.run_file.events.queues import QueueBegan, Queued, QueueEnded, QueueMoved, QueuePaused, QueueRemoved
from rig.run_file.verify.verification import QUEUE
from rig.run_file.write.ledger import Ledger

THEN = ("go on", "hold", "stop")


@dataclass
class Item:
    """An item of a queue.

    Attributes:
        asked: as it was added.
        priority: as it is now.
        begun: how often its command was started.
        folder: of its files, "" if it is the usual one.
        ended: how it ended; None while it waits or is at work.
    """

    asked: Queued
    priority: int
    begun: int = 0
    folder: str = ""
    ended: QueueEnded | None = None

    @property
    def number(self) -> int:
        """Its number."""
        return self.asked.item

    @property
    def bench(self) -> str:
        """Its bench: the path of the bench file, after the machine if it is of a certain one."""
        return f"{self.machine}:{self.asked.bench}" if self.machine else self.asked.bench

    @property
    def machine(self) -> str:
        """The machine that carries it out; "" in a queue of one machine."""
        return self.asked.machine or ""

    @property
    def state(self) -> str:
        """One word: "waiting", "at work", "done", "outside", "stopped", "fault"."""
        if self.ended is None:
            return "at work" if self.begun else "waiting"
        return {0: "done", 3: "outside", 4: "stopped"}.get(self.ended.code, "fault")


@dataclass
class Queue:
    """State of a queue, folded from its records.

    Attributes:
        items: by number, without removed ones.
        paused: whether nothing more begins.
        held: benches on which nothing begins, with the item that held them.
        added: number of items ever added.
    """

    items: dict[int, Item] = field(default_factory=dict)
    paused: bool = False
    held: dict[str, int] = field(default_factory=dict)
    added: int = 0

    def add(self, record: Record) -> None:
        """Take the next record."""
        match event := record.event:
            case Queued():
                self.items[event.item] = Item(event, event.priority)
                self.added = event.item
            case QueueMoved() if event.item in self.items:
                self.items[event.item].priority = event.priority
            case QueueRemoved():
                self.items.pop(event.item, None)
            case QueueBegan() if event.item in self.items:
                self.items[event.item].begun += 1
                self.items[event.item].folder = event.folder or ""
            case QueueEnded() if event.item in self.items:
                self._ended(self.items[event.item], event)
            case QueuePaused():
                self.paused = event.on
                if not event.on:
                    self.held.clear()
            case _:
                pass

    def _ended(self, item: Item, event: QueueEnded) -> None:
        item.ended = event
        if item.state == "stopped" or (item.state in ("fault", "outside") and item.asked.then == "hold"):
            self.held[item.bench] = item.number
        elif item.state in ("fault", "outside") and item.asked.then == "stop":
            self.paused = True
        elif item.asked.command == "resume":
            self.held.pop(item.bench, None)

    @property
    def waiting(self) -> list[Item]:
        """Items that have not begun, in their order."""
        waiting = [item for item in self.items.values() if item.state == "waiting"]
        return sorted(waiting, key=lambda item: (-item.priority, item.number))

    @property
    def at_work(self) -> list[Item]:
        """Items that have begun and not ended."""
        return [item for item in self.items.values() if item.state == "at work"]

    def next(self, utc_s: float, has: frozenset[str], machine: str = "") -> Iterator[Item]:
        """Items that may begin now, in their order, at most one of a bench.

        Args:
            utc_s: the present time.
            has: what is there of what items need.
            machine: where they would begin.
        """
        if self.paused:
            return
        busy = {item.bench for item in self.at_work}
        for item in self.waiting:
            held = item.bench in self.held and item.asked.command != "resume"  # a person wants just that run
            if (
                item.machine not in ("", machine)
                or item.bench in busy
                or held
                or (item.asked.not_before_s or 0.0) > utc_s
                or not set(item.asked.needs) <= has
            ):
                continue
            busy.add(item.bench)
            yield item


class Keeps(ABC):
    """A place where a queue is kept, and the folder on this machine in which its items have theirs."""

    @property
    def machine(self) -> str:
        """Whose items are carried out here; "" in a queue of one machine."""
        return ""

    @property
    def patient(self) -> bool:
        """Whether its worker waits where the queue cannot be reached."""
        return False

    def append(self, *events: Event) -> Queue:
        """Write events; the queue is made if there is none. Returns the state with them.

        Raises:
            BusyError: somebody else writes for more than ten seconds.
            RunFileError: its records were changed, or the last ones are missing.
            StorageError: they could not be made durable.
        """
        return self.decide(lambda queue: events)

    @abstractmethod
    def decide(self, by: Callable[[Queue], Sequence[Event]]) -> Queue:
        """The same for the events that `by` returns for the present state, while nobody else writes."""

    @abstractmethod
    def read(self) -> Queue:
        """The state. Raises as `append` does."""

    @abstractmethod
    def changes(self) -> object:
        """A value that changes with the queue; None while there is none, or if that is not known."""

    @abstractmethod
    def folder_of(self, item: int) -> Path:
        """Folder of an item's files, if it begins here."""

    def lock_of(self, folder: Path) -> Path:
        """The lock file of the worker who began an item in a folder."""
        return folder.with_name(folder.name.rpartition("-")[0] + ".worker")

    @abstractmethod
    def only_worker(self) -> AbstractContextManager[None]:
        """For the one who carries it out. Raises `BusyError` if another does."""


@dataclass(frozen=True)
class QueueFile(Keeps):
    """A queue in a file, by its path."""

    path: Path

    def folder_of(self, item: int) -> Path:
        """See `Keeps`: beside the file."""
        return self.path.with_name(f"{self.path.stem}-{item}")

    @property
    def _ledger(self) -> Ledger:
        return Ledger(self.path, QUEUE, "queue")

    def decide(self, by: Callable[[Queue], Sequence[Event]]) -> Queue:
        """See `Keeps`."""
        return self._ledger.append(Queue(), lambda queue: list(numbered(queue, by(queue))))

    def read(self) -> Queue:
        """See `Keeps`. Raises `UsageError` if there is no such file."""
        return self._ledger.read(Queue())

    def changes(self) -> object:
        """See `Keeps`."""
        found: list[object] = []
        for one in (self.path, self.path.with_name(self.path.name + "-wal")):
            with contextlib.suppress(OSError):
                stat = one.stat()
                found.append((stat.st_size, stat.st_mtime_ns))
        return tuple(found) if self.path.exists() else None

    def only_worker(self) -> AbstractContextManager[None]:
        """See `Keeps`."""
        return only_worker(self.path.with_suffix(".worker"), str(self.path))


@contextlib.contextmanager
def only_worker(path: Path, what: str) -> Iterator[None]:
    """Hold the lock file of a queue's worker. Raises `BusyError`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "ab") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BusyError(f"{what} is carried out by another `rig queue run` or `rig serve`") from None
        yield


def numbered(queue: Queue, events: Sequence[Event]) -> Iterator[Event]:
    """Events with the numbers of items that are added."""
    added = queue.added
    for event in events:
        if isinstance(event, Queued) and event.item == 0:
            added += 1
            yield replace(event, item=added)
        else:
            yield event


def open_queue(path: Path) -> tuple[QueueFile, Queue]:
    """A queue and its state; an empty one if there is no file yet."""
    file = QueueFile(path)
    return file, file.read() if path.exists() else Queue()
