"""What further runs have left open: the question for the next one."""

from __future__ import annotations

from dataclasses import replace

from rig.fitter.confirm.judgement import Confirmation
from rig.fitter.confirm.question import Question


def still_open(answer: Confirmation) -> Question | None:
    """The explanations between which a further run would decide; None if there is nothing to decide.

    A confirmed cause beside which another one may be has the rival "both together". If none holds, the cause is none of
    the class, and a further run does not help.
    """
    question = answer.question
    if question is None or not answer.holding:
        return None
    by_name = {member.effect: member for member in question.members}
    members = [by_name[name] for name in answer.holding]
    if answer.verdict in ("confirmed", "replaced"):
        members += [members[0].beside(by_name[one.effect]) for one in answer.minor_causes]
        if len(members) == 1:
            return None
    return replace(question, members=tuple(members), terms=members[0].terms)
