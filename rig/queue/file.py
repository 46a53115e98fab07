"""The file of a queue, `queue.sqlite`: append-only and hash-chained like a run file, and opened for a moment only."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

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
        ended: how it ended; None while it waits or is at work.
    """

    asked: Queued
    priority: int
    begun: int = 0
    ended: QueueEnded | None = None

    @property
    def number(self) -> int:
        """Its number."""
        return self.asked.item

    @property
    def bench(self) -> str:
        """Path of its bench file."""
        return self.asked.bench

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

    def next(self, utc_s: float, has: frozenset[str]) -> Iterator[Item]:
        """Items that may begin now, in their order, at most one of a bench.

        Args:
            utc_s: the present time.
            has: what is there of what items need.
        """
        if self.paused:
            return
        busy = {item.bench for item in self.at_work}
        for item in self.waiting:
            held = item.bench in self.held and item.asked.command != "resume"  # a person wants just that run
            if (
                item.bench in busy
                or held
                or (item.asked.not_before_s or 0.0) > utc_s
                or not set(item.asked.needs) <= has
            ):
                continue
            busy.add(item.bench)
            yield item


@dataclass(frozen=True)
class QueueFile:
    """The file, by its path."""

    path: Path

    def folder_of(self, item: int) -> Path:
        """Folder of an item's files."""
        return self.path.with_name(f"{self.path.stem}-{item}")

    @property
    def _ledger(self) -> Ledger:
        return Ledger(self.path, QUEUE, "queue")

    def append(self, *events: Event) -> Queue:
        """Write events; the file is created if there is none. Returns the state with them.

        Raises:
            BusyError: somebody else writes for more than ten seconds.
            StorageError: they could not be made durable.
        """
        return self._ledger.append(Queue(), lambda queue: list(_numbered(queue, events)))

    def read(self) -> Queue:
        """The state. Raises `RunFileError`, or `UsageError` if there is no such file."""
        return self._ledger.read(Queue())


def _numbered(queue: Queue, events: tuple[Event, ...]) -> Iterator[Event]:
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
