"""Acts on the queue of a laboratory: what runs next on its benches."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from rig.acts.act import Act, Told
from rig.acts.places import Places
from rig.bench.config import parse_toml
from rig.errors import UsageError
from rig.lab.proposals import known
from rig.queue import Item
from rig.run_file.approval import digest_of, digests_of
from rig.run_file.events.laboratory import Proposed
from rig.run_file.events.queues import Queued, QueueMoved, QueuePaused, QueueRemoved
from rig.runs.plans import load_plan
from rig.who import Operator

PROCEDURE = Field(description="procedure file", json_schema_extra={"of": "procedures"})
BENCH = Field(description="bench file", json_schema_extra={"of": "benches"})
HOURS = Field(None, gt=0, le=1000, description="as a loop of this many hours; empty: a single run")
PRIORITY = Field(0, ge=-1000, le=1000, description="a larger one comes first")
ITEM = Field(ge=1, description="number of the item")


def _only(asked: Proposed) -> str:
    return digest_of(asked.documents, asked.run_list)


def _add(places: Places, by: Operator, act: Dry | Start, files: tuple[Path, Path], *options: str, then: str) -> Told:
    """Put a procedure on a bench into the queue, for the time and with the priority of an act."""
    file, _ = places.queue()
    places.runs_folder.mkdir(exist_ok=True)
    procedure, bench = map(str, files)
    item = Queued(
        item=0,
        command="run" if act.hours is None else "loop",
        procedure=procedure,
        bench=bench,
        options=[*options, *([] if act.hours is None else ["--hours", f"{act.hours:g}"])],
        priority=act.priority,
        then=then,
        who=by.name,
        who_by=by.by,
    )
    added = file.append(item).added
    return Told(f"item {added} of the queue was added", {"item": added}, "queue")


class Dry(Act, act="dry-run"):
    """Run a procedure on simulated instruments, through the queue."""

    procedure: str = PROCEDURE
    bench: str = BENCH
    hours: float | None = HOURS
    priority: int = PRIORITY

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Check the files, and add it."""
        procedure, bench = places.procedure(self.procedure), places.bench(self.bench)
        world = bench.with_name("world.toml")
        given = world if world.is_file() else None
        load_plan(procedure, bench, dry=True, world=given)
        options = ["--dry", *(["--world", str(given)] if given else [])]
        return _add(places, by, self, (procedure, bench), *options, then="go on")


class Start(Act, act="start", moves=True):
    """Run a proposal on its real bench, through the queue, after its dry run and its approval if it needs one."""

    proposal: int = Field(ge=1, description="number of the proposal")
    hours: float | None = HOURS
    priority: int = PRIORITY

    def will(self, places: Places) -> str:
        """Which bench moves. Raises `UsageError` if it may not."""
        asked = self._checked(places)
        hours = f"about {asked.dry.get('hours')} h" if self.hours is None else f"up to {self.hours:g} h, as a loop"
        simulated = parse_toml(asked.documents["bench.toml"], asked.bench).get("simulated") is True
        kind = "simulated" if simulated else "real"
        return f"{asked.bench} carries out {asked.procedure} on its {kind} instruments: they move, for {hours}."

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Check everything again, and add it."""
        asked = self._checked(places)
        files = places.procedure(asked.procedure), places.bench(asked.bench)
        return _add(places, by, self, files, "--only", _only(asked), then="hold")

    def _checked(self, places: Places) -> Proposed:
        """The proposal. Raises `UsageError`.

        Its files changed, its dry run failed, its approval is missing, or the queue has it already.
        """
        proposal = known(places.laboratory.log(), self.proposal)
        asked = proposal.asked
        plan = load_plan(places.procedure(asked.procedure), places.bench(asked.bench))
        if (digests_of(plan.documents), plan.run_list.sha256()) != (digests_of(asked.documents), asked.run_list):
            raise UsageError(f"a file of proposal {self.proposal} was changed after its dry run: propose it again")
        if asked.dry.get("outcome") != "complete":
            raise UsageError(f"the dry run of proposal {self.proposal} was not complete: nothing is started by it")
        if proposal.state in ("declined", "used"):
            raise UsageError(f"proposal {self.proposal} is {proposal.state}: propose it again")
        if plan.needs_approval and self.hours is not None:
            raise UsageError("the further runs of a loop are approved by nobody: start it as a single run")
        plan.permission()
        for item in places.queue()[1].items.values():
            if item.state in ("waiting", "at work") and _only(asked) in item.asked.options:
                raise UsageError(f"item {item.number} of the queue is the same run, and is {item.state}")
        return asked


class Move(Act, act="move"):
    """Give a waiting item of the queue another priority."""

    item: int = ITEM
    priority: int = Field(ge=-1000, le=1000, description="a larger one comes first")

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it into the queue."""
        file, _ = places.queue()
        file.append(QueueMoved(item=_waiting(places, self.item).number, priority=self.priority, who=by.name))
        return Told(f"item {self.item} has priority {self.priority}", page="queue")


class Remove(Act, act="remove"):
    """Remove a waiting item from the queue."""

    item: int = ITEM

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it into the queue."""
        file, _ = places.queue()
        file.append(QueueRemoved(item=_waiting(places, self.item).number, who=by.name))
        return Told(f"item {self.item} was removed", page="queue")


class Pause(Act, act="pause"):
    """Begin nothing more from the queue; what is at work goes on."""

    why: str = Field("", max_length=200, description="reason")

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it into the queue."""
        places.queue()[0].append(QueuePaused(on=True, why=self.why, who=by.name))
        return Told("the queue is paused", page="queue")


class GoOn(Act, act="go-on", moves=True):
    """Begin items of the queue again, also on benches that a fault or a stop holds."""

    def will(self, places: Places) -> str:
        """Which items may begin."""
        waiting = ", ".join(str(one.number) for one in places.queue()[1].waiting)
        return f"Items of the queue begin as soon as their bench is free: {waiting or 'none waits now'}."

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it into the queue."""
        places.queue()[0].append(QueuePaused(on=False, who=by.name))
        return Told("the queue goes on", page="queue")


def _waiting(places: Places, number: int) -> Item:
    """A waiting item. Raises `UsageError`."""
    item = places.queue()[1].items.get(number)
    if item is None or item.state != "waiting":
        raise UsageError(f"item {number} does not wait in the queue")
    return item
