"""Work of a person: the run holds, says what is to be done, set or read, and goes on when it is said to be done.

Nothing is guessed. A step that is recorded as done is never asked for again; one that is not recorded is asked for
again, in any session.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rig.drivers.clock import Clock
from rig.engine.by_hand.to_read import ReadByHand as Readings
from rig.engine.by_hand.to_read import ToRead
from rig.engine.by_hand.to_set import SetByHand as Settings
from rig.engine.by_hand.to_set import ToSet
from rig.engine.journal import Journal
from rig.instruments.person_at_bench import Person
from rig.procedures.plan.hand_steps import HandStep, next_step
from rig.procedures.plan.run_list import Point, RunList
from rig.procedures.present.shell import shell_word
from rig.run_file.events.by_hand import AskedByHand, AskedToRead, AskedToSet, DoneByHand, ReadByHand, SetByHand
from rig.run_file.live import Request, done_command

_LOOK_S = 5.0
"""Seconds between looks whether a person has answered."""


class ByHand:
    """The steps of a run.

    Args:
        run_list: has the steps.
        journal: where they are recorded; its state says which are done.
        clock: bench time.
        path: the run file, for the command that a person types.
        stop_motion: stops all motion.
        person: a simulated person, or the bench of `rig sim`; None on a real bench.
        hold_max_s: longest wait for a step without a time-out of its own, seconds.
        settings: factors that a person sets.
        readings: readings that a person takes.

    Attributes:
        asked: the step, the setting or the reading that the run waits for; None if there is none.
    """

    def __init__(
        self,
        run_list: RunList,
        journal: Journal,
        clock: Clock,
        path: Path,
        *,
        stop_motion: Callable[[], object],
        person: Person | None,
        hold_max_s: float,
        settings: Settings,
        readings: Readings,
    ) -> None:
        self._settings, self._readings = settings, readings
        self._steps, self._journal, self._clock, self._path = run_list.steps, journal, clock, path
        self._stop_motion, self._person, self._hold_max_s = stop_motion, person, hold_max_s
        self._number = 0
        self._asked_s = 0.0
        self._there = False
        self._point = 0
        self._answer: tuple[str | None, str] | None = None
        self.asked: HandStep | ToSet | ToRead | None = None
        if person is not None:
            for done in journal.fold.by_hand.values():
                person.recall(done.change, done.number)

    def due(self, following: Point | None) -> bool:
        """Whether a step has to be done before this point."""
        number = next_step(self._steps, self._journal.fold.by_hand) if self._steps else None
        return following is not None and number is not None and self._steps[number - 1].before <= following.index

    def ask(self) -> str:
        """Stop motion and ask for the next step. Returns the trigger "hold"."""
        number = next_step(self._steps, self._journal.fold.by_hand)
        assert number is not None
        self._stop_motion()
        step = self._steps[number - 1]
        self._journal.write(
            AskedByHand(
                step=number,
                before=step.before,
                say=step.say,
                change=step.change,
                value=step.value,
                timeout_s=self._timeout_s(step),
            )
        )
        self._number, self.asked, self._answer = number, step, None
        self._asked_s = self._journal.elapsed()
        self._there = self._person is not None and self._person.asked(step)
        self._journal.asked = self._told(step)
        return "hold"

    def unset(self, point: Point) -> bool:
        """Whether a person has to set a factor for this point."""
        return self._settings.missing(point) is not None

    def unset_for_plot(self, point: Point) -> bool:
        """Whether a person has to set a hard factor for this point's whole plot."""
        wanted = self._settings.missing(point)
        return wanted is not None and wanted.whole_plot is not None

    def ask_to_set(self, point: Point) -> str:
        """Stop motion and ask for the next setting. Returns the trigger "hold"."""
        wanted = self._settings.missing(point)
        assert wanted is not None
        self._stop_motion()
        name, say = wanted.factor.name, wanted.instruction
        self._journal.write(
            AskedToSet(before=point.index, factor=name, setpoint=wanted.setpoint, say=say, timeout_s=self._hold_max_s)
        )
        self._number, self.asked, self._answer = self._number + 1, wanted, None
        self._point, self._asked_s = point.index, self._journal.elapsed()
        self._there = self._person is not None and self._person.asked_to_set(name, wanted.setpoint)
        self._journal.asked = {"step": self._number, "of": 0, "say": say, "change": "set", "value": "", "factor": name}
        return "hold"

    def unread(self, point: Point) -> bool:
        """Whether a person has to take a reading at this point."""
        return self._readings.missing(point) is not None

    def ask_to_read(self, point: Point) -> str:
        """Ask for the next reading; the bench stays at its setting. Returns the trigger "hold"."""
        wanted = self._readings.missing(point)
        assert wanted is not None
        column, say = wanted.column, wanted.instruction
        there = self._person is not None and self._person.asked_to_read(column)
        self._journal.write(
            AskedToRead(column=column.name, number=wanted.number, unit=column.unit, say=say, timeout_s=self._hold_max_s)
        )
        self._number, self.asked, self._answer = self._number + 1, wanted, None
        self._asked_s, self._there = self._journal.elapsed(), there
        self._journal.asked = {"step": self._number, "of": 0, "say": say, "change": "read", "value": column.name}
        return "hold"

    @property
    def reads(self) -> bool:
        """Whether the run waits for a reading, at its point."""
        return isinstance(self.asked, ToRead)

    def _timeout_s(self, asked: HandStep | ToSet | ToRead) -> float:
        hours = asked.timeout_h if isinstance(asked, HandStep) else None
        return self._hold_max_s if hours is None else 3600.0 * hours

    def _told(self, step: HandStep) -> dict[str, Any]:
        """The step for the live state."""
        about = {"step": self._number, "of": len(self._steps), "say": step.instruction, "change": step.change}
        return {**about, "value": step.value}

    @property
    def message(self) -> str:
        """The task, and the command to type then."""
        assert self.asked is not None
        what = f"to do by hand: {self.asked.instruction}"
        if isinstance(self.asked, ToSet):
            command = done_command(self._path, "")
            return f"{what}; then `{command}`, with --value V for the exact {self.asked.factor.name} if it is known"
        if isinstance(self.asked, ToRead):
            return f"{what}; then `{done_command(self._path, self.asked.column.name)}`, where V is the reading"
        return f"{what}; then `{done_command(self._path, self.asked.value)}`{value_words(self.asked.value)}"

    def take(self, request: Request) -> str:
        """Take a request to go on. Returns why it is refused, as a sentence; "" if it is accepted."""
        if self.asked is None:
            return (
                "" if request.verb == "release" else "nothing has to be done by hand at present; nothing was recorded"
            )
        if request.verb == "release":
            return f"`rig release` does not say that it was done: {self.message}"
        if request.step not in (0, self._number):
            return f"step {request.step} is not what the run waits for, it is step {self._number}: {self.message}"
        refused = self.asked.refuses(request.value)
        if refused:
            return f"{refused}; the run still waits: {self.message}"
        self._answer = request.value, request.who
        return ""

    def done(self) -> bool:
        """Whether the step has been done; this is then recorded."""
        step, person, by_request = self.asked, self._person, self._answer is not None
        if not by_request and self._there and person is not None:
            self._answer = person.answer()
        if self._answer is None or step is None:
            return False
        if not by_request and person is not None and isinstance(step, HandStep) and step.refuses(self._answer[0]):
            self._answer, self._there = None, person.asked(step)  # as a real person: asked again
            return False
        value, who = self._answer
        waited_s = round(self._journal.elapsed() - self._asked_s, 3)
        if isinstance(step, ToRead):
            return self._read(step, value, who, waited_s, by_request=by_request)
        number = None if value is None else float(value)
        if isinstance(step, ToSet):
            name = step.factor.name
            if by_request and person is not None:
                person.recall_setting(name, step.setpoint if number is None else number)
            self._journal.write(
                SetByHand(
                    before=self._point,
                    factor=name,
                    setpoint=step.setpoint,
                    number=number,
                    who=who,
                    waited_s=waited_s,
                )
            )
            self._settings.made(step, number)
            return True
        if by_request and person is not None:
            person.done(step.change, number)  # a real person says that it was done on a simulated bench
        self._journal.write(
            DoneByHand(
                step=self._number,
                before=step.before,
                say=step.say,
                change=step.change,
                value=step.value,
                number=number,
                who=who,
                waited_s=waited_s,
            )
        )
        return True

    def _read(self, step: ToRead, value: str | None, who: str, waited_s: float, *, by_request: bool) -> bool:
        """Record a reading; a simulated person repeats one that is far off, and reads again if it is refused."""
        if not by_request and step.refuses(value) and step.refuses(value):
            assert self._person is not None
            self._answer, self._there = None, self._person.asked_to_read(step.column)
            return False
        column, number = step.column, step.column.number(value)
        assert isinstance(number, float)
        event = ReadByHand(
            column=column.name,
            number=step.number,
            unit=column.unit,
            typed=number,
            confirmed=step.confirmed,
            who=who,
            waited_s=waited_s,
        )
        self._journal.write(event)
        self._readings.read(column)
        return True

    def forget(self) -> None:
        """The run no longer waits."""
        self.asked = self._answer = self._journal.asked = None

    @property
    def overdue(self) -> str:
        """What to say if nobody has come in time; "" before."""
        assert self.asked is not None
        limit_s = self._timeout_s(self.asked)
        if self._journal.elapsed() - self._asked_s <= limit_s:
            return ""
        waited = f"nobody said within {limit_s / 3600.0:g} h that this was done: {self.asked.instruction}"
        return f"{waited}; parked. `rig resume {shell_word(self._path)}` asks again"

    def wait(self) -> None:
        """Let some time pass: bench time for a simulated person, real time for others."""
        if self._there:
            self._clock.sleep(_LOOK_S)
        else:
            self._clock.idle(1.0)


def value_words(value: str) -> str:
    """What V is in the command, in parentheses; "" without one."""
    return f" (V: {value})" if value else ""
