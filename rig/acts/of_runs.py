"""Acts on a running controller, through the request file beside its run file; and a further session of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import Field

from rig.acts.act import Act, Told
from rig.acts.places import Places, is_loop
from rig.errors import UsageError
from rig.loop import run_at_work
from rig.run_file.events.queues import Queued
from rig.run_file.live import asked_by_hand, controller_alive, live_path, read_json
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import read_state
from rig.verbs.run.requests import ask
from rig.who import Operator

RUN = Field(description="name of the run", json_schema_extra={"of": "runs"})


def _asked(run: str, verb: str, places: Places, by: Operator, **more: Any) -> Told:
    return Told(ask(run_at_work(places.run(run)), verb, who=by.name, **more), page=f"run/{run}")


def _must_run(places: Places, run: str) -> Path:
    at = run_at_work(places.run(run))
    if not controller_alive(at):
        raise UsageError(f"no controller is running on {run}")
    return at


class Hold(Act, act="hold"):
    """Stop all motion of a run, leave chambers as they are, and wait."""

    run: str = RUN

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Ask its controller."""
        return _asked(self.run, "hold", places, by)


class Release(Act, act="release", moves=True):
    """Continue a held run: its axes move again."""

    run: str = RUN

    def will(self, places: Places) -> str:
        """Which run moves again."""
        _must_run(places, self.run)
        return f"Run {self.run} continues: its axes move again."

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Ask its controller."""
        return _asked(self.run, "release", places, by)


class Stop(Act, act="stop", moves=True):
    """Park the bench and end the session; the run can be resumed later."""

    run: str = RUN

    def will(self, places: Places) -> str:
        """Which run parks."""
        _must_run(places, self.run)
        return f"Run {self.run} stops: its bench moves to its parking positions."

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Ask its controller."""
        return _asked(self.run, "stop", places, by)


class Done(Act, act="done", moves=True):
    """Say that a step by hand is done, with the number that it asks for; the run goes on."""

    run: str = RUN
    value: str | None = Field(None, max_length=100, description="the number that the step asks for, in its unit")
    step: int = Field(0, ge=0, description="ordinal of the step that is meant, 0 for the present one")

    def will(self, places: Places) -> str:
        """The step, and the number stated. Raises `UsageError` if nobody is waited for, or the number is missing."""
        asked = asked_by_hand(read_json(live_path(_must_run(places, self.run))) or {})
        if asked is None:
            raise UsageError(f"run {self.run} waits for nobody at present")
        if asked.value and self.value is None:
            raise UsageError(f"the step asks for {asked.value}: {asked.say}")
        stated = f" The number is {self.value}{f' ({asked.value})' if asked.value else ''}." if self.value else ""
        return f"This was done: {asked.say.rstrip('. ')}.{stated} Run {self.run} goes on, and may move."

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Ask its controller."""
        return _asked(self.run, "done", places, by, step=self.step, value=self.value)


class Resume(Act, act="resume", moves=True):
    """Continue a run that was stopped or interrupted, through the queue."""

    run: str = RUN

    def will(self, places: Places) -> str:
        """Which run goes on. Raises `UsageError` if it cannot."""
        path = places.run(self.run)
        if controller_alive(path):
            raise UsageError(f"a controller is at work on {self.run}: it has nothing to resume")
        if is_loop(path):
            return f"Loop {self.run} goes on: its bench moves."
        with RunReader.open(path) as reader:
            state, dry = read_state(reader), reader.about().runs_dry
        if state.ended is not None:
            raise UsageError(f"run {self.run} is {state.ended}: nothing to resume")
        return f"Run {self.run} goes on: {'simulated instruments move' if dry else 'its bench moves'}."

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Put it into the queue, first of its bench."""
        self.will(places)
        path, (file, now) = places.run(self.run), places.queue()
        bench = next((one.bench for one in now.items.values() if path.parent == file.folder_of(one.number)), str(path))
        first = 1 + max((one.priority for one in now.waiting), default=0)
        item = Queued(
            item=0, command="resume", procedure=str(path), bench=bench, priority=first, who=by.name, who_by=by.by
        )
        added = file.append(item).added
        return Told(f"item {added} of the queue: {self.run} goes on", {"item": added}, "queue")
