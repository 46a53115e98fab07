"""Further replications or points of a loop's first run: one by one for its goal, or many at once for a name."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from rig.loop.best_points import Candidates, candidates, chosen_points
from rig.loop.decide import PARKING_H, PERSON, Decision, Left, asks_somebody
from rig.loop.ends import each_h
from rig.loop.evaluation import Evaluation, left_over
from rig.loop.goal import Next, aims_by, looked
from rig.loop.goal_of_results import Aim, Made
from rig.loop.hours import HoursLeft, confirmed_model, open_questions, planned, stake
from rig.loop.program import Program
from rig.procedures.kind import Procedure
from rig.procedures.plan.settings import GoalSettings
from rig.procedures.present.durations import duration


@dataclass(frozen=True)
class GoalStep:
    """The next step for a goal.

    Attributes:
        more: the addition; None for none.
        why: reason, with numbers.
        decision: the further run that comes first; None if none does.
    """

    more: Next | None
    why: str
    decision: Decision | None = None


def procedure_with(procedure: Procedure, **changes: Any) -> Any:
    """A procedure with other values."""
    changed: Any = procedure
    return changed.model_copy(update=changes)


def for_goal(
    goal: GoalSettings,
    evaluation: Evaluation,
    replications: int,
    left_h: float,
    loop_h: float,
    decision: Callable[..., Decision],
    stands_degC: float | None = None,
) -> GoalStep:
    """The next step, by all runs so far.

    Args:
        goal: of the procedure.
        evaluation: of the runs.
        replications: number of those of the first run.
        left_h: time left for replications, hours.
        loop_h: time left for the loop, hours.
        decision: gives the best further run, by its gain per hour; asked if one more replication would be made.
        stands_degC: setting at which the environment stands; None if it would settle before added points.

    Raises:
        RigError: the goal cannot be judged, or a file cannot be read; `DataError` and `FitError` likewise.
    """
    program, told = evaluation.program, evaluation.told
    first = evaluation.first
    standing = replace(first, confirming=first.confirming.at_rest(stands_degC))
    of = candidates(standing) if goal.add == "points" else None
    made, last = made_by(goal, program, replications, 1.0 if of is None else of.part), program.runs[-1]
    added = partial(_added, of, made, each_h(program.runs, replications))
    look = looked(goal, made, added, left_h, None if told is None else confirmed_model(evaluation.first, told))
    if look.more is None:
        return GoalStep(None, look.why)
    if not last.complete:
        return GoalStep(None, f"run {last.planned.number} ({last.planned.what}) ended by a fault; {look.why}")
    if touched := evaluation.touched:
        return GoalStep(None, f"no replication is added after somebody changed the bench in {touched}; {look.why}")
    asked = open_questions(first, told, alone=program.bounds.bounds.stop_when == "alone")
    if not asked:
        return GoalStep(look.more, look.why)
    at_stake, worth = stake(first, told, asked, partial(aims_by, made)), look.more.worth
    further = decision(helps=partial(at_stake.gain_per_h, worth))
    if further.run is None:
        return GoalStep(look.more, look.why)
    left = HoursLeft(loop_h - PARKING_H, left_h - PARKING_H, look.more.hours, look.needed)
    left = left if look.more.run is None else replace(left, what="group of points")
    plan = planned(at_stake, worth, further.run, left, returns=not further.run.variation.person)
    return GoalStep(look.more, f"{look.why}; {plan.why}", further if plan.run_next else None)


def made_by(goal: GoalSettings, program: Program, replications: int, part: float) -> Made:
    """The observations so far: `replications` in the first run, and `part` of one added at once."""
    first = program.runs[0].ended
    assert first is not None  # a goal is judged after the first run
    of_replication = first.points / replications
    more = [run.ended.points for run in program.runs if run.planned.segment and run.complete and run.ended is not None]
    whole = [points for points in more if points == of_replication]
    points = sum(more) - sum(whole)
    return Made(goal, program.segments, replications, replications + len(whole), points, of_replication, part)


def _added(of: Candidates | None, made: Made, each: float, aims: Sequence[Aim]) -> Next:
    """The next addition: the best points, or a whole replication where they are not known."""
    best = None if of is None else chosen_points(of, made, {aim.name: aim.over for aim in aims})
    if best is None:
        return Next(
            "one more" if of is None else "one more replication, since no best points are known,", each, made.count
        )
    count = len(best.run.run_list)
    return Next(f"{count} more points", best.hours, best.worth, count / made.of_replication, best.run)


def for_a_name(decision: Decision, evaluation: Evaluation, procedure: Procedure, left_h: float) -> tuple[int, str]:
    """Number of replications that follow a decision to close the loop, and why; 0 if the loop closes.

    They follow if the trace leaves error without a name, and are traced with the first run as one. The whole design is
    made twice at most: a name that half as many readings do not show is not looked for after every further replication.

    Args:
        decision: the next step without them.
        evaluation: of the runs.
        procedure: of the first run.
        left_h: time left for the loop, hours.
    """
    program, first = evaluation.program, evaluation.first
    count = procedure.replications - program.replications
    told = decision.run is not None or decision.settled or evaluation.told is not None
    if told or count < 1 or "again" not in program.allow or not program.runs[-1].complete or not left_over(first, None):
        return 0, ""
    if PERSON not in program.allow and asks_somebody(first, procedure):
        return 0, ""
    each, total = each_h(program.runs, procedure.replications), procedure.replications + program.replications
    count = min(count, int(Left(left_h, 0, ()).most_h / each))
    if count < 1:
        return 0, ""
    more = "one further replication of {} is" if count == 1 else f"{count} further replications of {{}} together are"
    size, hours = math.sqrt(total / (total + count)), duration(3600.0 * count * each)
    return count, (
        f"{decision.why}; {more.format(hours)} traced with the first run as one: together they name effects of "
        f"{size:.2f} times the size"
    )
