"""Error that a loop leaves on its further runs when no question is open: is it more than scatter, and of what?

The trace of the first run may miss an effect because it is small there: a temperature that hardly changed. A further
run that differs can show it. Its own trace then names it, and the other runs say whether they show it as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from rig.errors import UsageError
from rig.fitter.confirm.judgement import CHANGED, MISFIT
from rig.fitter.errors import FitError
from rig.fitter.quantiles import f_tail
from rig.loop.decide import Decision
from rig.procedures.errors import DataError
from rig.verbs.confirm import Confirmed, First, judge, open_traced
from rig.verbs.confirm.answers import listed


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
    rows = len(next(iter(first.traced.table.columns.values())))
    errors = {
        sensor: one.after / one.sigma
        for sensor, one in told.judged.errors.items()
        if one.after**2 > MISFIT * one.sigma**2
        and f_tail((one.after / one.sigma) ** 2, len(one.residual_after), rows) < CHANGED
    }
    if not errors:
        return ""
    times = listed([f"{ratio:.1f} times the scatter in {sensor}" for sensor, ratio in errors.items()])
    found = list(_found_later(told))
    named = "; ".join(found) or "no trace of a further run by itself names a cause"
    return f"the error on the further runs is {times}, with the effects: {named}"


def _found_later(told: Confirmed) -> Iterator[str]:
    """Effects that the traces of further runs by themselves name, and that the first run's does not."""
    known = {member.effect for one in told.answers for member in one.members}
    paths = (told.first.path, *told.paths)
    for path in told.paths:
        try:
            own = open_traced(path, told.first.read)
        except (UsageError, DataError, FitError):  # too few points, or too few settings, for a trace
            continue
        new = [question for question in own.questions if not known & {one.effect for one in question.members}]
        for question in new:
            known |= {one.effect for one in question.members}
            names = " or ".join(one.effect for one in question.members if not one.near)
            yield f"{path.name} shows {names}{_by_others(own, question.effect, [one for one in paths if one != path])}"


def _by_others(own: First, effect: str, others: Sequence[Path]) -> str:
    """Verdict of the other runs on an effect that the trace of one run names, in brackets; "" without one."""
    try:
        answers = judge(own, *others, anywhen=True).answers
    except (UsageError, FitError):
        return ""
    verdict = next((one.verdict for one in answers if one.effect == effect), "")
    return f" (by the other runs: {verdict})" if verdict else ""
