"""The hours that are left of a loop with a goal: whether the next of them goes into one more replication, or into a
further run that may settle an open question.

Both are measured by what they take from the error of the aimed values, over their goals. Its square is the sum of two:
the half-width of the interval, by the formula of the goal, of which replications make smaller what is scatter; and
what hangs on each open question, the change of the value if the calibration has its effect. A further run takes that
away, and the part of the scatter that is the effect, with the probability of settling the question.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from rig.by_kind import fit_table, known
from rig.errors import RigError
from rig.fitter.arrays import FloatArray
from rig.fitter.confirm import Hypothesis, Question, still_open
from rig.fitter.errors import FitError
from rig.loop.goal_of_results import Aim
from rig.procedures.errors import DataError
from rig.procedures.evaluate.confirming import SETTLED, ConfirmedFit
from rig.procedures.present.durations import duration
from rig.runs.forecast import ALLOWANCE
from rig.verbs.confirm import Confirmed, First, Proposal, settled_as, with_confirmed

AimsBy = Callable[[ConfirmedFit | None], Sequence[Aim]]
"""The aimed values by a calibration; None for the declared model."""


@dataclass(frozen=True, eq=False)
class Stake:
    """The error of m aimed values, and what hangs on q open questions.

    Attributes:
        goal: (m,) largest half-widths.
        half: (m,) half-widths of the intervals.
        least: (m,) half-widths that no number of replications goes below.
        shift: (q, m) change of the values if a question is settled, rms over its explanations.
        without: (q, m) half-widths then.
        effects: names of the questions.
    """

    goal: FloatArray
    half: FloatArray
    least: FloatArray
    shift: FloatArray
    without: FloatArray
    effects: tuple[str, ...]

    def error(self, count: float, more: int = 0, run: Proposal | None = None) -> float:
        """Expected error over the goal, rms, of the value that is farthest from its goal.

        Args:
            count: number of replications so far; of points, what the observations so far are worth.
            more: further replications.
            run: a further run.
        """
        chances = np.zeros(len(self.effects)) if run is None else np.array([chance(run, one) for one in self.effects])
        scatter = self.half**2 - chances @ (self.half**2 - self.without**2)
        scatter = np.maximum(scatter - self.least**2, 0.0) * count / (count + more)
        return float(np.sqrt(np.max((scatter + self.least**2 + (1.0 - chances) @ self.shift**2) / self.goal**2)))

    def gain_per_h(self, count: float, run: Proposal) -> float:
        """Part of the error that a further run takes away, by forecast, per hour of its bench time."""
        return (1.0 - self.error(count, 0, run) / self.error(count)) / run.hours


def chance(run: Proposal, effect: str) -> float:
    """Probability that a run settles the question of an effect; 0 if it was not planned for it."""
    return min((one for s in run.separations if s.effect == effect for one in s.chances.values()), default=0.0)


def confirmed_model(first: First, told: Confirmed | None) -> ConfirmedFit | None:
    """The calibration with the causes that further runs settled; None if they settled none, or it cannot be fitted."""
    if told is None or not any(one.verdict in SETTLED for one in told.answers):
        return None
    with contextlib.suppress(*_REFUSED):
        return with_confirmed(first, told, known(first.traced.table).fit_options())
    return None


_REFUSED = (RigError, DataError, FitError)


def open_questions(first: First, told: Confirmed | None, *, alone: bool) -> dict[str, Question]:
    """The open questions, by the effects that the trace named; with `alone` also second causes beside settled ones."""
    if told is None:
        return {one.effect: one for one in first.questions}
    asked = {one.effect: still_open(one) for one in told.answers if alone or one.verdict not in SETTLED}
    return {effect: question for effect, question in asked.items() if question is not None}


def stake(first: First, told: Confirmed | None, asked: Mapping[str, Question], aims: AimsBy) -> Stake:
    """What hangs on the open questions, by the calibrations that the first run gives with and without their effects.

    Args:
        first: the traced run.
        told: its judgement by the further runs so far; None without one.
        asked: the open questions, as by `open_questions`.
        aims: the aimed values by a calibration.

    Raises:
        RigError: the declared model cannot be evaluated; `FitError` and `DataError` likewise.
    """
    table = first.traced.table
    kind = known(table)
    declared = ConfirmedFit(fit_table(table), {}, partial(kind.evaluation, table, kind.budget_options()))
    now = aims(confirmed_model(first, told) or declared)
    shift, without = np.zeros((len(asked), len(now))), np.zeros((len(asked), len(now)))
    for k, (effect, question) in enumerate(asked.items()):
        moved, halves = zip(*_by_explanation(first, told, effect, question.members, now, aims), strict=True)
        shift[k] = np.sqrt(np.mean(np.square(moved), axis=0))
        without[k] = np.sqrt(np.mean(np.square(halves), axis=0))
    goal, half, least = (np.array([getattr(one, key) for one in now]) for key in ("goal", "half", "least"))
    return Stake(goal, half, least, shift, without, tuple(one.effect for one in asked.values()))


def _by_explanation(
    first: First,
    told: Confirmed | None,
    effect: str,
    members: Sequence[Hypothesis],
    now: Sequence[Aim],
    aims: AimsBy,
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """(m,) changes of the values, and (m,) half-widths, for each explanation that may be left; none if no fit can be
    made.
    """
    half, value = (np.array([getattr(one, key) for one in now]) for key in ("half", "value"))
    made = False
    for member in members:
        if member.near:
            continue
        with contextlib.suppress(*_REFUSED):
            found = aims(settled_as(first, told, {effect: member}))
            made = True
            yield np.array([one.value for one in found]) - value, np.array([one.half for one in found])
    if not made:
        yield np.zeros_like(half), half


@dataclass(frozen=True)
class HourPlan:
    """A plan of the hours that are left.

    Attributes:
        run_next: whether the further run is made next; otherwise one more replication.
        why: with the numbers of both.
    """

    run_next: bool
    why: str


@dataclass(frozen=True)
class HoursLeft:
    """Hours that are left, and what they are asked for.

    Attributes:
        loop_h: to the end of the loop, without that of parking.
        goal_h: to the end of the time for replications.
        each_h: bench time of one more replication.
        needed: further replications that meet the goal, by forecast.
        what: what a replication is called: also points may be added.
    """

    loop_h: float
    goal_h: float
    each_h: float
    needed: int
    what: str = "replication"

    def replications(self, *, before_h: float = 0.0, beside_h: float = 0.0) -> int:
        """Number of needed replications that there is time for, after a run and beside one that follows."""
        left = min(self.goal_h - before_h, self.loop_h - before_h - beside_h)
        return max(0, min(self.needed, int(left / (self.each_h * (1.0 + ALLOWANCE)))))


def planned(stake: Stake, count: float, run: Proposal, left: HoursLeft, *, returns: bool = True) -> HourPlan:
    """Where the next hour helps most.

    If the hours with the run end with a smaller error than those without it, the one comes first that takes more from
    the error per hour. Replications come first if they would miss their deadline after the run.

    Args:
        stake: the error, and what hangs on the open questions.
        count: number of replications so far.
        run: the best further run.
        left: the hours.
        returns: whether replications can be made after the run: nobody has changed the bench in it.
    """
    run_h = run.hours * (1.0 + ALLOWANCE)
    before = left.replications(beside_h=run_h)
    after = left.replications(before_h=run_h) if returns else 0
    beside, alone = max(before, after), left.replications()
    now, with_run, without = stake.error(count), stake.error(count, beside, run), stake.error(count, alone)
    run_per_h, by_one = stake.gain_per_h(count, run), 1.0 - stake.error(count, 1) / now
    why = (
        f"by forecast one more {left.what} takes {_percent(by_one)} from the error of the aimed values "
        f"({by_one / left.each_h:.2g} per hour), and a further run, {run.variation.what}, {run.size}, "
        f"{duration(3600.0 * run.hours)}, {_percent(run_per_h * run.hours)} ({run_per_h:.2g} per hour); at the end it "
        f"would be {with_run:.2g} of the goal with the run and {_more(beside, left.what)}, {without:.2g} with "
        f"{_more(alone, left.what)} alone"
    )
    if with_run >= without:
        return HourPlan(False, f"{why}: the goal has the time")
    if before > after:
        later = "the run would pass their deadline" if returns else "somebody changes the bench in the run"
        return HourPlan(False, f"{why}: replications come first, because {later}")
    first = beside == 0 or run_per_h > by_one / left.each_h
    return HourPlan(first, f"{why}: {'the run' if first else f'a {left.what}'} comes first")


def _more(count: int, what: str) -> str:
    head, of, tail = what.partition(" of ")
    return f"{count} more {head}{'' if count == 1 else 's'}{of}{tail}"


def _percent(part: float) -> str:
    return f"{max(part, 0.0):.0%}"
