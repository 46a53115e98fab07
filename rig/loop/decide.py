"""The next step of a loop: a further run, or its end; what remains for a person; and why, in numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from rig.bench.bench_file import playing
from rig.drivers.roles import ByHand, Typing
from rig.fitter.confirm import NOTHING, Confirmation, Question, lasting
from rig.procedures.plan.further_runs import Variation
from rig.procedures.plan.settings import LoopSettings
from rig.procedures.present.durations import duration
from rig.run_file.events.event import Event
from rig.run_file.events.loops import LoopDecided, LoopForPerson
from rig.runs.forecast import ALLOWANCE
from rig.verbs.confirm import Confirmed, First, Proposal, consider, following, propose
from rig.verbs.confirm.proposal import HARDLY, LIKELY
from rig.verbs.confirm.proposals import MANY

PARKING_H = 0.1
"""Time left for parking and evaluation after the last run, hours."""
PERSON = "person"
Considers = Callable[..., Sequence[Proposal]]
_FOR_PERSON = 3
"""Maximum number of runs that are proposed to a person."""


@dataclass(frozen=True, eq=False)
class Decision:
    """The next step.

    Attributes:
        run: the further run; None to close the loop.
        why: the reason, with numbers.
        settled: whether one explanation remains for every effect found.
        for_person: runs that a person, or more time, would make possible.
        anew: whether its environment has to settle anew, because an open question is of time or temperature: a run that
            only goes on in the state in which the last one ended confirms whatever followed that state.
    """

    run: Proposal | None
    why: str
    settled: bool = False
    for_person: tuple[Proposal, ...] = ()
    anew: bool = False

    @property
    def chance(self) -> float | None:
        """Probability that the run settles its most difficult question."""
        return None if self.run is None else self.run.least.chance

    @property
    def gain_per_h(self) -> float | None:
        """Gain of the run."""
        return None if self.run is None else gain_per_h(self.run)


@dataclass(frozen=True)
class Left:
    """Time, runs and permissions that are left.

    Attributes:
        hours: time until its end.
        runs: further runs.
        allow: in what they may differ from the first run.
    """

    hours: float
    runs: int
    allow: tuple[str, ...]

    @property
    def most_h(self) -> float:
        """Longest bench time, by forecast, of a run that ends in time."""
        return max(0.0, (self.hours - PARKING_H) / (1.0 + ALLOWANCE))


def gain_per_h(run: Proposal) -> float:
    """Probability that a run settles an open question, on average over these, per hour of bench time."""
    questions = sum(len(one.chances) for one in run.separations)
    return run.told / questions / run.hours if run.hours > 0 else 0.0


def needs_person(first: First, variation: Variation) -> bool:
    """Whether somebody has to be there for a run: for a change, for its own steps by hand, to set or to read."""
    return bool(variation.person) or asks_somebody(first, variation.procedure)


def asks_somebody(first: First, procedure: Any) -> bool:
    """Whether a procedure on the bench of the first run has steps by hand, or somebody sets or reads something."""
    asks = [*playing(first.bench, ByHand), *playing(first.bench, Typing)]
    return bool(asks or procedure.expand().steps)


def permitted(first: First, variation: Variation, allow: Sequence[str]) -> bool:
    """Whether the loop may make a run: its difference is allowed, and the bench can set it."""
    if variation.by_weather or variation.varies not in allow:
        return False
    if variation.turned and not first.dry:
        return False  # nothing would tell whether somebody has turned the package before the run begins
    return PERSON in allow or not needs_person(first, variation)


def open_words(first: First) -> str:
    """The open questions, in words."""
    parts = []
    for question in first.questions:
        alike = [member for member in question.members if not member.near]
        names = " or ".join(member.effect for member in alike)
        if len(alike) > 1:
            apart = max(member.sigmas for member in alike)
            parts.append(f"{names} are open (these data: {apart:.1f} sd)")
        else:
            parts.append(f"{names} is not confirmed")
    return "; ".join(parts)


def not_fewer(first: First, question: Question) -> bool:
    """Whether a question has many explanations, and the further runs have excluded none of them.

    These runs were planned to tell them apart. Others like them would take the rest of the night.
    """
    before = next((len(one.members) for one in first.questions if one.effect == question.effect), 0)
    return len(question.members) > MANY and len(question.members) >= before


def decide(
    first: First,
    told: Confirmed | None,
    bounds: LoopSettings,
    left: Left,
    considered: Considers = consider,
    *,
    closing: bool = True,
    helps: Callable[[Proposal], float] | None = None,
) -> Decision:
    """The next step.

    Args:
        first: the traced run.
        told: its judgement by the further runs so far; None before the first of them.
        bounds: `[loop]` of the procedure.
        left: time, runs and permissions that are left.
        considered: gives the possible runs, the best first.
        closing: whether the loop closes without a run, so that runs for a person are looked for.
        helps: what a run brings per hour, by what hangs on each question; by default the order of the possible runs.
    """
    if not first.questions:
        return Decision(None, "the trace of the first run found nothing that would have to be confirmed", settled=True)
    settled = told is not None and told.settled
    asked = first if told is None else following(told, alone=bounds.stop_when == "alone")
    if told is not None and asked is None:
        verdicts = "; ".join(f"{one.effect}: {one.verdict}{_beside(one)}" for one in told.answers)
        return Decision(None, f"no question is open: {verdicts}", settled=settled)
    assert asked is not None  # there are questions
    words = open_words(asked)
    if told is not None and all(not_fewer(first, question) for question in asked.questions):
        why = f"{words}; the further runs leave as many explanations as before, so no other run is made"
        return Decision(None, f"{why}: the finding is near the noise, or its cause is none of them", settled)
    alone = all(sum(not member.near for member in one.members) == 1 for one in asked.questions)
    if bounds.stop_when == "explained" and alone:
        return Decision(
            None, f"every effect has one explanation, which is enough by stop_when = 'explained': {words}", settled
        )
    anew = not all(lasting(question) for question in asked.questions)
    confirming = asked.confirming.at_rest(None if anew else first.confirming.stands_degC)
    asked, known = replace(asked, begins_s=first.begins_s, confirming=confirming), dict[tuple[str, int], Proposal]()
    considered = partial(considered, known=known)
    for_people: Callable[[], tuple[Proposal, ...]] = partial(_for_person, asked, considered) if closing else tuple
    if left.runs < 1:
        why = f"{words}; all runs that most_runs permits have been made"
        return Decision(None, why, settled, for_people())

    def mine(within: First, **how: Any) -> list[Proposal]:
        of_bench = {"only": lambda one: permitted(first, one, left.allow), "changes": PERSON in left.allow}
        runs = considered(within, **of_bench, **how)
        return [run for run in propose(runs) if permitted(first, run.variation, left.allow)]

    runs = mine(asked)
    short = [run for run in runs if run.hours <= left.most_h]
    if runs and not short:
        short = [run for run in mine(replace(asked, most_h=left.most_h), known={}) if run.hours <= left.most_h]
    time = duration(3600.0 * max(left.hours, 0.0))
    if not runs:
        why = f"{words}; no run that the bench makes by itself would decide it"
        return Decision(None, why, settled, for_people())
    if not short:
        least = min(runs, key=lambda run: run.hours)
        takes = f"the shortest run that may decide it takes {duration(3600.0 * least.hours)}"
        return Decision(None, f"{words}; {time} are left, and {takes}", settled, for_people())
    best = short[0]
    if helps is not None:
        best = max((run for run in short if run.worth > 0), key=helps, default=best)
    what = f"{best.variation.what}, {best.size}, takes {duration(3600.0 * best.hours)} of {time}"
    gain = gain_per_h(best)
    if gain < bounds.least_gain:
        why = (
            f"{words}; the best run ({what}) settles an open question with a probability of {gain:.3f} per hour, less "
            f"than least_gain = {bounds.least_gain:g}"
        )
        return Decision(None, why, settled, for_people())
    why = f"{words}; {what} {_said(best)} ({gain:.2f} per hour)"
    if (better := runs[0]).hours > left.most_h:
        takes = f"{better.variation.what}, {better.size}, takes {duration(3600.0 * better.hours)} {_said(better)}"
        why += f"; given up for lack of time: {takes}"
    return Decision(best, why, settled, anew=anew)


def _said(run: Proposal) -> str:
    return f"and settles everything with {run.least.chance:.0%}" if run.likely else f"and {_settles(run)}"


def _beside(answer: Confirmation) -> str:
    """Causes that may be there beside the confirmed one, in brackets; "" without one of a notable size."""
    parts = " and ".join(f"{one.effect} up to {one.up_to:.0%} of it" for one in answer.minor_causes)
    return f" (beside it may be {parts}; stop_when = 'alone' would go on)" if parts else ""


def _for_person(asked: First, considered: Considers) -> tuple[Proposal, ...]:
    """The best runs that a person, or more time, would make possible."""
    return tuple(run for run in propose(considered(asked)) if not run.variation.by_weather)[:_FOR_PERSON]


def _settles(run: Proposal) -> str:
    """Questions that a run is likely to settle, and others."""
    questions = [(pair, chance) for one in run.separations for pair, chance in one.chances.items()]
    sure = [_pair(pair) for pair, chance in questions if chance >= LIKELY]
    left = [f"{_pair(pair)} ({chance:.0%})" for pair, chance in questions if chance < LIKELY]
    return f"settles {', '.join(sure) or 'little'}, and leaves {', '.join(left)} open"


def _pair(pair: tuple[str, str]) -> str:
    return f"whether {pair[0]} is there" if pair[1] == NOTHING else f"{pair[0]} or {pair[1]}"


def decided(decision: Decision, after: int, left_h: float, first: First | None) -> Iterator[Event]:
    """The records of a decision.

    Args:
        decision: the next step.
        after: number of the runs before it.
        left_h: time left, hours.
        first: the traced run, if runs are left to a person.
    """
    run = decision.run
    yield LoopDecided(
        after=after,
        next="close" if run is None else "run",
        why=decision.why,
        left_h=round(left_h, 3),
        hours=None if run is None else round(run.hours, 3),
        chance=decision.chance,
        gain_per_h=decision.gain_per_h,
        settled=decision.settled,
    )
    for do, what, hours, decides in for_person(first, decision.for_person) if run is None and first is not None else ():
        yield LoopForPerson(after=after, do=do, what=what, hours=round(hours, 3), decides=decides)


def for_person(first: First, runs: Sequence[Proposal]) -> Iterator[tuple[str, str, float, str]]:
    """Task, run, hours, and questions that it would decide, for each run that is left to a person."""
    for run in runs:
        steps = [step.words for step in run.variation.steps]
        turn = ["mount the package as the procedure says"] if run.variation.turned else []
        own = (
            ["be there for its steps by hand"] if needs_person(first, run.variation) and not steps and not turn else []
        )
        chances = [
            f"{_pair(pair)} with {chance:.0%}"
            for one in run.separations
            for pair, chance in one.chances.items()
            if chance >= HARDLY
        ]
        yield "; ".join([*turn, *steps, *own]), run.variation.what, run.hours, ", ".join(chances)
