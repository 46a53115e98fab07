"""Events of a queue of runs and loops, the records of `queue.sqlite`, which has the form of a run file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rig.run_file.bodies import Count, Seconds, Text, Truth, Whole, Words
from rig.run_file.events.event import DECISION, EMPTY, SESSION, STEP, Event

if TYPE_CHECKING:
    from rig.run_file.columns import Columns


@dataclass(frozen=True, kw_only=True)
class Queued(Event, kind="queue", status="added", matters=STEP):
    """An item was added.

    Attributes:
        item: its number, from 1.
        command: "run", "loop" or "resume".
        procedure: path of its procedure file; of the run file to resume.
        bench: path of its bench file.
        options: further arguments of the command.
        not_before_s: UTC before which it does not begin.
        needs: what has to be there for it, in words.
        priority: a larger one comes first.
        then: what the next items of its bench do after a fault, or outside acceptance: "go on", "hold", "stop".
        who: operator of its runs, None for the one who carries out the queue.
        who_by: source of that name.
        machine: name of the one that carries it out, None in a queue of one machine.
    """

    item: Count
    command: Text
    procedure: Text
    bench: Text
    options: Words = EMPTY
    not_before_s: Seconds | None = None
    needs: Words = EMPTY
    priority: Whole = 0
    then: Text = "hold"
    who: Text | None = None
    who_by: Text | None = None
    machine: Text | None = None

    def sentence(self, record: Columns) -> str:
        """The item and its command."""
        bench = f" --bench {self.bench}" if self.command != "resume" else ""
        by = f" by {self.who}" if self.who else ""
        on = f" for {self.machine}" if self.machine else ""
        return f"item {self.item} added{by}{on}: rig {self.command} {self.procedure}{bench}"


@dataclass(frozen=True, kw_only=True)
class QueueMoved(Event, kind="queue", status="moved", matters=STEP, says="item {item} has priority {priority}"):
    """An item was given another priority, by `who` if that is known."""

    item: Count
    priority: Whole
    who: Text | None = None


@dataclass(frozen=True, kw_only=True)
class QueueRemoved(Event, kind="queue", status="removed", matters=STEP, says="item {item} removed"):
    """An item that had not begun was removed, by `who` if that is known."""

    item: Count
    who: Text | None = None


@dataclass(frozen=True, kw_only=True)
class QueueBegan(Event, kind="queue", status="began", matters=SESSION, says="item {item} begins, or goes on"):
    """An item is about to begin, or to go on, in a folder of that machine; None for the usual one."""

    item: Count
    folder: Text | None = None


@dataclass(frozen=True, kw_only=True)
class QueueEnded(Event, kind="queue", status="ended", matters=SESSION):
    """An item ended.

    Attributes:
        item: its number.
        code: exit code of its command.
        file: its run file or program file, "" if there is none.
    """

    item: Count
    code: Count
    file: Text = ""

    def sentence(self, record: Columns) -> str:
        """The item and its exit code."""
        return f"item {self.item} ended with exit code {self.code}{f': {self.file}' if self.file else ''}"


@dataclass(frozen=True, kw_only=True)
class QueuePaused(Event, kind="queue", status="paused", matters=DECISION):
    """The queue begins nothing more, or begins items again and forgets holds.

    Attributes:
        on: whether it is paused from now on.
        why: reason.
        who: name of the person, None if unknown.
    """

    on: Truth
    why: Text = ""
    who: Text | None = None

    def sentence(self, record: Columns) -> str:
        """Whether it is paused, by whom, and why."""
        by = f" by {self.who}" if self.who else ""
        return f"{'paused' if self.on else 'goes on'}{by}{f': {self.why}' if self.why else ''}"
