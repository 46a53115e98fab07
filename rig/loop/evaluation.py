"""Evaluation of a loop's runs: the first one traced, judged by further ones, and which of them are one run with it.

The trace of the first run may miss an effect because it is small there: a temperature that hardly changed. A further
run that differs can show it. Then both are traced as one run, with the effect as a further question, and only other
runs judge: the run that shows an effect never confirms it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from rig.errors import RigError
from rig.fitter.confirm import Question
from rig.fitter.confirm.judgement import CHANGED, MISFIT
from rig.fitter.errors import FitError
from rig.fitter.quantiles import f_tail
from rig.loop.decide import Decision
from rig.loop.program import LoopRun, Program
from rig.procedures.errors import DataError
from rig.procedures.evaluate.confirming import SETTLED
from rig.run_file.events.by_hand import DoneByHand
from rig.run_file.events.loops import LoopJoined
from rig.run_file.read.reader import RunReader
from rig.tables.segments import table_of
from rig.verbs.confirm import Confirmed, First, judge, open_traced
from rig.verbs.confirm.answers import listed

_REFUSED = (RigError, DataError, FitError)
"""Too few points or settings for a trace, other columns, as of a package that is turned, or a damaged file."""


@dataclass
class Evaluation:
    """The runs of a loop, evaluated; what was computed of the same runs is kept for the session.

    Attributes:
        program: state of the loop.
    """

    program: Program
    _first: dict[tuple[Path, ...], First] = field(default_factory=dict)
    _told: dict[tuple[tuple[Path, ...], tuple[Path, ...]], Confirmed] = field(default_factory=dict)

    @property
    def first(self) -> First:
        """The first run, traced: with its further replications, and with the runs that are joined to it."""
        return self.traced(self.program.segments)

    @property
    def told(self) -> Confirmed | None:
        """The judgement by all other complete further runs; None without one."""
        return self.judged(self.program.segments, self.program.further)

    def traced(self, segments: Sequence[Path]) -> First:
        """Some runs, traced as one. Raises `UsageError`, `DataError` or `FitError`."""
        key = tuple(segments)
        if key not in self._first:
            self._first[key] = open_traced(key[0], partial(table_of, key)) if key[1:] else open_traced(key[0])
        return self._first[key]

    def judged(self, segments: Sequence[Path], later: Sequence[Path]) -> Confirmed | None:
        """The judgement of runs that are one by others; None without others. Raises as `traced`."""
        key = tuple(segments), tuple(later)
        if later and key not in self._told:
            self._told[key] = judge(self.traced(segments), *later)
        return self._told.get(key)

    @property
    def touched(self) -> str:
        """The further run in which somebody changed the bench, in words; "" if there is none."""
        untouched = list(self._joinable(joined=True))
        changed = [run for run in self.program.further_runs if run.complete and run not in untouched]
        return f"run {changed[-1].planned.number}" if changed else ""

    def regrouped(self, decision: Decision, runs_left: int) -> LoopJoined | None:
        """The run that is joined to the first one, or taken from it, in place of a decision; None if none is.

        Args:
            decision: the next step, with the runs as they are.
            runs_left: number of further runs that can still be made.
        """
        joined = [run for run in self.program.further_runs if run.joined]
        if joined and decision.run is None and not decision.settled and (lost := self._lost()):
            why = f"together with run {joined[-1].planned.number} other runs leave {listed(lost)} open: they are apart"
            return LoopJoined(number=joined[-1].planned.number, why=f"{why}, as before", apart=True)
        return None if self.program.apart else self._joined(runs_left)

    def _lost(self) -> list[str]:
        """Explanations that the first run alone and all others settle, and that the joined ones leave open."""
        program = self.program
        apart = [program.file_of(run) for run in program.further_runs if run.complete]
        own = [path for path in program.segments if path not in apart]
        try:
            before = _settled(self.judged(own, apart))
        except _REFUSED:
            return []
        try:
            return sorted(before - _settled(self.told))
        except _REFUSED:
            return sorted(before)

    def _joined(self, runs_left: int) -> LoopJoined | None:
        """The longest further run that shows, together with the first, what that one does not, if error is left."""
        try:
            told = self.told
        except _REFUSED:
            return None
        if told is None or not (why := _unexplained(told)):
            return None
        known = {member.effect for one in told.answers for member in one.members}
        segments = self.program.segments
        for run in sorted(self._joinable(), key=lambda one: -_points(one)):
            path = self.program.file_of(run)
            if runs_left < 1 and told.paths == (path,):
                continue  # nothing would judge
            try:
                both = self.traced([*segments, path])
            except _REFUSED:
                continue
            new = [names for one in both.questions if not known & set(names := _names(one))]
            if new:
                shown = listed([" or ".join(names) for names in new])
                number = run.planned.number
                return LoopJoined(
                    number=number,
                    why=f"{why}; together with run {number} the first run shows {shown}: from now on they are one "
                    f"run, and the others judge",
                )
        return None

    def _joinable(self, *, joined: bool = False) -> Iterator[LoopRun]:
        """Complete further runs in which nobody changed anything; with `joined` those that are one with the first."""
        for run in self.program.further_runs:
            if run.complete and (joined or not run.joined):
                with RunReader.open(self.program.file_of(run)) as reader:
                    if not any(True for _ in reader.records(DoneByHand.kind)):
                        yield run


def _points(run: LoopRun) -> int:
    return run.ended.accepted if run.ended is not None else 0


def _names(question: Question) -> list[str]:
    return [one.effect for one in question.members if not one.near]


def _settled(told: Confirmed | None) -> set[str]:
    return set() if told is None else {one.holding[0] for one in told.answers if one.verdict in SETTLED}


def _unexplained(told: Confirmed) -> str:
    """Why the effects are not enough, in words; "" if they may be."""
    wrong = [one.effect for one in told.answers if one.verdict == "none holds"]
    return f"no explanation of {listed(wrong)} holds" if wrong else _left_words(told)


def beyond_scatter(told: Confirmed) -> Mapping[str, float]:
    """Error on the further runs with the effects over the scatter of a reading, of sensors that have more than error:
    a mean square of more than 1.5 times that of a reading, which is significant.
    """
    rows = len(next(iter(told.first.traced.table.columns.values())))
    return {
        sensor: one.after / one.sigma
        for sensor, one in told.judged.errors.items()
        if one.after**2 > MISFIT * one.sigma**2
        and f_tail((one.after / one.sigma) ** 2, len(one.residual_after), rows) < CHANGED
    }


def _left_words(told: Confirmed) -> str:
    times = [f"{ratio:.1f} times the scatter in {sensor}" for sensor, ratio in beyond_scatter(told).items()]
    return f"the error on the further runs is {listed(times)}, with the effects" if times else ""


def with_left_over(decision: Decision, first: First, told: Confirmed | None) -> Decision:
    """The decision; one to close the loop with everything settled is none if error is left, and says so."""
    if decision.run is None and decision.settled and (more := left_over(first, told)):
        return replace(decision, why=f"{decision.why}; but {more}", settled=False)
    return decision


def left_over(first: First, told: Confirmed | None) -> str:
    """Error that no effect explains, in words; "" if there is none.

    Args:
        first: the traced run.
        told: its judgement by the further runs; None without one.
    """
    if told is None:
        nameless = [one.sensor for one in first.traced.outcomes if one.unnamed]
        return f"{listed(nameless)} has more than error, without a name" if nameless and not first.questions else ""
    words = _left_words(told)
    return f"{words}: no trace of the first run and a further one together names a cause" if words else ""
