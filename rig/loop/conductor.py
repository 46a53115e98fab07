"""The conductor of a loop: run, trace, further runs, calibration, report, certificate.

Every step is a record of the program file before the next one begins. A session folds the records and goes on with the
first step that is missing, so it does not matter where the session before was cut. A result of a step (a trace, a
judgement) is computed again in a new session, from the same run files; what it decided, ran or wrote is not repeated.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from rig.engine.session import Nobody, Observer, Outcome, Progress, Signals
from rig.errors import BenchFault, RigError
from rig.fitter.errors import FitError
from rig.loop import products
from rig.loop.between_runs import BetweenRuns, safe_again
from rig.loop.decide import Considers, Decision, Left, decide, decided
from rig.loop.ends import Ending, Told, began, each_h, ended, not_made
from rig.loop.evaluation import Evaluation, with_left_over
from rig.loop.findings import found_by_first, found_by_later
from rig.loop.goal import Next
from rig.loop.program import SUFFIX, LoopRun, Program
from rig.loop.replications import GoalStep, for_a_name, for_goal, procedure_with
from rig.loop.timeline import EVALUATION_S, Timeline
from rig.procedures.errors import DataError
from rig.procedures.plan.settings import GoalSettings
from rig.run_file.chain import Record, encode
from rig.run_file.events.event import Event
from rig.run_file.events.loops import (
    LoopClosed,
    LoopContinued,
    LoopDecided,
    LoopRunPlanned,
)
from rig.run_file.write.writer import RunWriter
from rig.runs.controller import Result, Site, resume_run, start_run
from rig.runs.plans import Plan, plan_of
from rig.verbs.confirm import Confirmed, First, Proposal, consider, traces_kept
from rig.verbs.confirm.further_plan import procedure_text
from rig.who import Operator

FAULTS = (RigError, DataError, FitError)
"""Errors of data and files that a loop closes with; any other one is a defect of this program."""


@dataclass
class Conductor:
    """A session of a loop.

    Attributes:
        writer: its program file.
        program: state by the records.
        plan: of its first run.
        signals: checked wherever a run waits, and between steps.
        told: receives what happens.
        on_progress: called with the progress of its runs.
        observer: receives the records of its runs.
        site: how benches are opened.
        by: operator.
        dry_gap_s: of a dry loop, bench seconds without power before an open run is resumed.
        considered: gives the possible further runs.
        certified: whether a certificate is tried.
        recorded: called with the name of the last event after every commit; campaigns kill there.
    """

    writer: RunWriter
    program: Program
    plan: Plan
    signals: Signals
    told: Told
    on_progress: Callable[[Progress], None]
    by: Operator
    observer: Observer = field(default_factory=Nobody)
    site: Site = field(default_factory=Site)
    dry_gap_s: float = 120.0
    considered: Considers = consider
    certified: bool = True
    recorded: Callable[[str], None] = lambda _: None
    _begun: bool = False

    def __post_init__(self) -> None:
        self.timeline = Timeline(self.plan, self.program.run)
        self.evaluation = Evaluation(self.program)
        permitted = self.program.bounds.bounds.between_runs == "chamber"
        self.between = BetweenRuns(self.site, permitted, self.signals)
        self._session = self.program.run.sessions + 1

    def conduct(self) -> Ending:
        """Go on to the end of the loop, or of the session.

        Raises:
            RigError: a record could not be made durable, or a file cannot be used; the loop can be resumed.
        """
        with traces_kept(), self.between:
            return self._conducted()

    def _conducted(self) -> Ending:
        if not self._begun:
            self._begin()
        ended = self._left_on() or self._first_run() or self._steps()
        self._rest("no further run" if ended is None else "the loop's session ends")
        if ended is not None:
            return self._ending(ended.outcome, ended.message, unsafe=ended.unsafe)
        self._close()
        return self._ending(Outcome.COMPLETE)

    def continues(self, event: LoopContinued) -> None:
        """Open the closed loop again, for `conduct`."""
        self._begin()
        self.record(event)
        self._begun = True

    # --- records --------------------------------------------------------------------------------------------------

    def record(self, *events: Event, last: bool = False) -> None:
        """Write events, durable together; the `last` one makes the file an ordinary one."""
        times = round(self.timeline.elapsed_s, 3), round(self.timeline.utc_s, 3)
        records = [
            Record(self._session, one.kind, *times, status=one.status, body=encode(one.body())) for one in events
        ]
        for record in records[:-1]:
            self.writer.append(record, commit=False)
        if last:
            self.writer.correct(records[-1], ended=True)
        else:
            self.writer.append(records[-1])
        for record in records:
            self.program.add(record)
            self.told.says(record)
        self.recorded(type(events[-1]).__name__)

    def _begin(self) -> None:
        self.record(began(self.plan, self.timeline, self.program, self.writer.dropped, self.by))

    def _ending(self, outcome: Outcome, message: str = "", *, unsafe: bool = False) -> Ending:
        runs = (run.ended for run in self.program.runs if run.ended is not None)
        unsafe |= bool(self.program.unsafe) or any(one.how == Outcome.UNSAFE.value for one in runs)
        return Ending(self.program, outcome, message, self.writer.written[1].hex(), unsafe)

    # --- between runs ---------------------------------------------------------------------------------------------

    def _left_on(self) -> Ending | None:
        """Make safe what a session that was killed between two runs has left on, before anything else."""
        on = self.program.on_between_runs
        if not on:
            return None
        why = "the session before was cut between two runs"
        try:
            with self.site.opened(self.plan, start=self.timeline.elapsed_s) as (bench, clock, _):
                self.record(safe_again(bench, clock, bench.chambers, why))
        except BenchFault as error:
            words = f"{'; '.join(on)}, as far as known: {error}"
            return self._ending(Outcome.UNSAFE, words, unsafe=True)
        return None

    def _rest(self, why: str) -> None:
        """Make safe what stays on after the last run, and record it."""
        self.between.rest(why)
        self._made_safe()

    def _made_safe(self) -> None:
        while self.between.made:
            self.record(self.between.made.pop(0))

    # --- runs -----------------------------------------------------------------------------------------------------

    def _first_run(self) -> Ending | None:
        """Plan and make the first run. A fault of it ends the session: without it there is nothing to evaluate."""
        if not self.program.runs:
            bounds = self.program.bounds
            self.record(self._planned(self.plan.procedure.name, bounds.first_h, self.plan.documents["procedure.toml"]))
        run = self.program.runs[0]
        if run.ended is not None:
            return None
        result = self._made(run, self.plan)
        if result.outcome is not Outcome.COMPLETE:
            return self._ending(result.outcome, result.message)
        self.record(ended(run, result, self.between.left_on))
        return None

    def _planned(self, what: str, hours: float, procedure: str) -> LoopRunPlanned:
        number = len(self.program.runs) + 1
        name = self.program.path.name.removesuffix(SUFFIX)
        return LoopRunPlanned(
            number=number,
            run_id=f"{name}-{number}",
            what=what,
            hours=round(hours, 3),
            procedure=procedure,
            begins_s=round(self.timeline.elapsed_s, 3),
        )

    def _made(self, run: LoopRun, plan: Plan) -> Result:
        """Make a run, or go on with it: its file shows which."""
        path, begins_s = self.program.file_of(run), run.planned.begins_s
        common: dict[str, Any] = {"signals": self.signals, "on_progress": self.on_progress, "by": self.by}
        common |= {"observer": self.observer, "site": self.between.of_runs}
        self.between.hand_over(plan)
        self._made_safe()
        if path.exists():
            self.told.run_begins(path)
            result = resume_run(path, dry_gap_s=self.dry_gap_s, **common)
        else:
            result = start_run(
                plan,
                path.parent,
                announce=self.told.run_begins,
                world_start_s=begins_s if plan.dry else 0.0,
                run_id=run.planned.run_id,
                **common,
            )
        self.timeline.passes(begins_s + result.state.elapsed_s)
        return result

    def _further_run(self, run: LoopRun) -> Ending | None:
        """Make a further run. A fault of it is recorded: the loop closes with what it has."""
        documents = {**self.program.documents, "procedure.toml": run.planned.procedure}
        if not self.plan.dry:
            documents.pop("world.toml", None)
        try:
            result = self._made(run, plan_of(documents, dry=self.plan.dry))
        except BenchFault as error:
            self.record(not_made(self.program.file_of(run), run, error))
            return None
        # A fault that the run file could not record is one of the disk: nothing can be decided without it.
        if result.outcome in (Outcome.INTERRUPTED, Outcome.STOPPED) or (
            result.outcome is not Outcome.COMPLETE and result.state.rested != "faulted"
        ):
            return self._ending(result.outcome, result.message)
        self.record(ended(run, result, self.between.left_on))
        return None

    def _for_goal(self) -> bool:
        """Plan one more replication, or the further run that helps more, if the goal needs it; False otherwise."""
        program, procedure = self.program, self.plan.procedure
        goal: GoalSettings | None = getattr(procedure, "goal", None)
        if goal is None or program.goal is not None:
            return False
        elapsed_s = self.timeline.elapsed_s
        left_h, loop_h = ((end_s - elapsed_s) / 3600.0 for end_s in (program.goal_ends_s, program.ends_s))
        with contextlib.suppress(*FAULTS):
            self._evaluated()  # what a further run tells comes before what it means for the goal
        further = partial(self._decision, closing=False)
        try:
            stands = self.between.stands_at
            step = for_goal(goal, self.evaluation, procedure.replications, left_h, loop_h, further, stands)
        except FAULTS as error:
            step = GoalStep(None, f"the goal cannot be judged: {error}")
        if step.decision is not None:
            if not self._regrouped(step.decision):
                self._decide(replace(step.decision, why=f"{step.why}. {step.decision.why}"))
                self._anew(step.decision)
            return True
        after, more = len(program.runs), step.more
        said = LoopDecided(
            after=after, next="trace" if more is None else "segment", why=step.why, left_h=round(left_h, 3)
        )
        if more is None:
            self.record(said)
            return False
        number = procedure.replications + program.replications + 1
        self.record(said, self._replications(number, 1) if more.run is None else self._points(more, number))
        return True

    def _points(self, more: Next, number: int) -> LoopRunPlanned:
        """A run of the best points for the goal, one with the first run."""
        assert more.run is not None  # by the caller
        procedure = procedure_with(more.run.procedure, seed=self.plan.procedure.seed + number, goal=None)
        what = f"{more.what} for the goal, {self.first.confirming.size(procedure)}"
        text = procedure_text(procedure, routine=more.run.routine)
        return replace(self._planned(what, more.hours, text), segment=True)

    def _replications(self, number: int, count: int) -> LoopRunPlanned:
        """A run of so many further replications, one with the first run; the first of them has this number."""
        procedure = self.plan.procedure
        again = procedure_with(procedure, replications=count, seed=procedure.seed + number, goal=None)
        hours = count * each_h(self.program.runs, procedure.replications)
        what = f"replication {number}" if count == 1 else f"replications {number} to {number + count - 1}"
        return replace(self._planned(what, hours, procedure_text(again)), segment=True)

    def _again_for_a_name(self, decision: Decision) -> bool:
        """Plan further replications in place of the end, if error is left that the first run is too short to name."""
        program, procedure = self.program, self.plan.procedure
        left_h = (program.ends_s - self.timeline.elapsed_s) / 3600.0
        try:
            count, why = for_a_name(decision, self.evaluation, procedure, left_h)
        except FAULTS:
            return False  # the decision says that the runs cannot be evaluated
        if count:
            planned = self._replications(procedure.replications + program.replications + 1, count)
            after = len(program.runs)
            self.record(LoopDecided(after=after, next="segment", why=why, left_h=round(left_h, 3)), planned)
        return count > 0

    # --- evaluation -----------------------------------------------------------------------------------------------

    @property
    def first(self) -> First:
        """The first run, traced."""
        return self.evaluation.first

    def _steps(self) -> Ending | None:
        """Make replications and further runs, until no more of them helps."""
        while True:
            if self.signals.interrupt:
                return self._ending(Outcome.INTERRUPTED, f"interrupted ({self.signals.interrupt}) between two steps")
            run = self.program.open_run
            if run is not None and (ended := self._further_run(run)) is not None:
                return ended
            if self.program.decided is not None:
                return None
            if self._for_goal():
                continue
            decision = self._decision()
            if self._regrouped(decision) or self._again_for_a_name(decision):
                continue
            self._decide(decision)
            if decision.run is None:
                return None
            self._anew(decision)

    def _anew(self, decision: Decision) -> None:
        if decision.anew:
            self._rest("an effect of time or temperature is confirmed after it has settled anew")

    @property
    def _runs_left(self) -> int:
        """Number of further runs that may still be made; 0 after one that ended by a fault."""
        further, before = self.program.further_runs, self.program.closed_runs
        if len(further) > before and not further[-1].complete:
            return 0
        return self.program.bounds.bounds.most_runs - (len(further) - before)

    def _regrouped(self, decision: Decision) -> bool:
        """Whether a further run is one with the first from now on, or no longer, so that more can be decided."""
        event = self.evaluation.regrouped(decision, self._runs_left)
        if event is not None:
            self.record(event)
        return event is not None

    def _decision(self, *, closing: bool = True, helps: Callable[[Proposal], float] | None = None) -> Decision:
        """The next step, from all runs so far; runs for a person only if the loop closes without one. `helps` as for
        `decide`.
        """
        try:
            told = self._evaluated()
        except FAULTS as error:
            return Decision(None, f"the runs cannot be evaluated: {error}")
        further, before = self.program.further_runs, self.program.closed_runs
        last = further[-1] if len(further) > before else None
        if last is not None and last.ended is not None and not last.complete:
            why = f"run {last.planned.number} ended by a fault: {last.ended.message or last.ended.how}"
            return Decision(None, f"{why}; the loop closes with what it has", told is not None and told.settled)
        bounds = self.program.bounds.bounds
        elapsed_s = self.timeline.elapsed_s
        left = Left((self.program.ends_s - elapsed_s) / 3600.0, self._runs_left, self.program.allow)
        first = replace(self.first, begins_s=elapsed_s)
        first = replace(first, confirming=first.confirming.at_rest(self.between.stands_at))
        decision = decide(first, told, bounds, left, self.considered, closing=closing, helps=helps)
        return with_left_over(decision, first, told)

    def _evaluated(self) -> Confirmed | None:
        """The judgement so far; what it tells is recorded once."""
        first, told, count = self.first, self.evaluation.told, self.program.complete
        if count not in self.program.found:
            found = found_by_first(first, count) if told is None else found_by_later(told, count)
            self.timeline.passes(self.timeline.elapsed_s + EVALUATION_S)
            self.record(found)
        return told

    def _decide(self, decision: Decision) -> None:
        run, after = decision.run, len(self.program.runs)
        left_h = (self.program.ends_s - self.timeline.elapsed_s) / 3600.0
        events: list[Event] = list(decided(decision, after, left_h, self.first if decision.for_person else None))
        if run is not None:
            variation = run.variation
            text = procedure_text(variation.procedure, variation.steps, routine=variation.routine)
            events.append(self._planned(variation.what, run.hours, text))
        self.record(*events)

    # --- the end --------------------------------------------------------------------------------------------------

    def _close(self) -> None:
        program = self.program
        if program.closed is not None:
            return
        if "calibration" not in program.wrote:
            self.record(products.calibration(program))
        if self.certified and "certificate" not in program.wrote:
            self._certificate()
        decided = program.decided
        assert decided is not None  # by `_steps`
        if "report" not in program.wrote:
            self.record(products.report(program, self._confirmed_or_none()))
        heads = {program.file_of(run).name: run.ended.head for run in program.runs if run.ended is not None}
        for_people = f"; {len(program.for_person)} for a person" if program.for_person else ""
        self.record(
            LoopClosed(
                settled=decided.settled,
                fault=any(not run.complete for run in program.runs),
                heads=heads,
                why=f"{decided.why}{for_people}",
                bench_h=round(sum(run.ended.took_s for run in program.runs if run.ended is not None) / 3600.0, 3),
            ),
            last=True,
        )

    def _confirmed_or_none(self) -> Confirmed | None:
        with contextlib.suppress(*FAULTS):
            return self.evaluation.told
        return None

    def _certificate(self) -> None:
        """Issue a certificate, if the laboratory has settled one and the register allows it."""
        settings = products.certificate_settings(self.program)
        if settings is not None:
            self.record(products.certificate(self.program, settings, self.timeline.utc_s))
