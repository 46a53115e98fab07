"""What a further run told: in JSON, and in words for a certificate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from fitter.arrays import FloatArray
from fitter.confirm import Confirmation, Member, SensorError, confirm_all
from fitter.confirm import Confirmed as Judged
from fitter.confirm.judge import CHANGED
from fitter.errors import FitError
from procedures.words import SMALLEST
from rig.closed_loop.confirm.first import First, read_later
from rig.errors import UsageError

Value = TypeVar("Value", float, FloatArray)


@dataclass(frozen=True, eq=False)
class Confirmed:
    """What a later run told of the effects that were found in a first.

    Attributes:
        first: the run that was traced.
        path: the later run file.
        data: its observations.
        judged: every question, and both models.

    """

    first: First
    path: Path
    data: Any
    judged: Judged

    @property
    def answers(self) -> tuple[Confirmation, ...]:
        """A question each."""
        return self.judged.answers

    @property
    def settled(self) -> bool:
        """Whether one explanation is left of every effect."""
        return all(answer.verdict in ("confirmed", "replaced") for answer in self.answers)

    @property
    def unit(self) -> str:
        """Of what is inferred: errors are said in it."""
        return self.first.confirming.unit

    @property
    def own(self) -> str:
        """What is taken from the further run itself when it is predicted, in words; "" where nothing is."""
        return self.first.confirming.own_words(realigned=self.judged.realigned)

    def inferred(self, error: SensorError, value: Value) -> Value:
        """An error of the output as one of what is inferred from it, in `unit`; small angles."""
        return value * self.first.confirming.per_slope / abs(error.slope)

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        told = [self._answer(a) | {"sentence": _sentence(a), "evidence": evidence(a)} for a in self.answers]
        errors = {name: self._error(e) for name, e in self.judged.errors.items()}
        about = {"run": str(self.path), "points": len(self.data), "taken_out": self.own}
        return about | {"error": errors, "effects": told}

    def _answer(self, answer: Confirmation) -> dict[str, Any]:
        return {
            "named": answer.effect,
            "verdict": answer.verdict,
            "holds": list(answer.holding),
            "outliers": list(answer.outliers),
            "members": [
                {
                    "effect": m.effect,
                    "sigmas_behind": m.sigmas,
                    "p_changed": m.p_changed,
                    "sigmas_shown": m.shown,
                    "p_shown": m.p_shown,
                    "limit_sigmas": m.limit,
                    "fits": m.fits,
                    "terms": list(m.terms),
                    "coefficients": list(m.coefficients),
                    "interval_95": [list(i) for i in m.intervals],
                    "interval_holds_zero": list(m.zero),
                    "coefficients_both_runs": list(m.together),
                    "interval_95_both_runs": [list(i) for i in m.intervals_together],
                    "size": dict(m.sizes),
                }
                for m in answer.members
            ],
        }

    def _error(self, error: SensorError) -> dict[str, float]:
        output = self.first.confirming.output_unit
        values = {"before": error.before, "after": error.after, "reading": error.sigma}
        return {f"{name}_{output}": value for name, value in values.items()} | {
            f"{name}_{self.unit}": self.inferred(error, value) for name, value in values.items()
        }


def judge(first: First, later: Path) -> Confirmed:
    """Hold every effect found against a later run.

    Raises:
        UsageError: that is none of the same kind and sensors, or not later.

    """
    data, after_s = read_later(first, later)
    try:
        both = first.confirming.beside(data, after_s)
        judged = confirm_all(both, first.questions)
    except FitError as error:
        raise UsageError(f"{later}: {error}") from error
    return Confirmed(first, later, data, judged)


def sentences(confirmed: Confirmed) -> Iterator[str]:
    """What was confirmed, in words that can go into a certificate; the errors of both models last."""
    for answer in confirmed.answers:
        yield " ".join(filter(None, (_sentence(answer), evidence(answer))))
    errors = confirmed.judged.errors
    name = max(errors, key=lambda sensor: errors[sensor].before / errors[sensor].sigma)
    if not np.isfinite(errors[name].before):
        yield "The further run is too short to tell the error of either model."
        return
    before, after = (confirmed.inferred(errors[name], v) for v in (errors[name].before, errors[name].after))
    yield (
        f"On data that neither model has seen the error of {name} is {before:.3g} {confirmed.unit} rms with the "
        f"declared model and {after:.3g} {confirmed.unit} with the effects."
    )


def _sentence(answer: Confirmation) -> str:
    if answer.verdict == "confirmed":
        others = [m.effect for m in answer.members[1:]]
        excluded = f"; {_listed(others)} {'is' if len(others) == 1 else 'are'} excluded" if others else ""
        return f"{answer.effect} is confirmed by a further run{excluded}."
    if answer.verdict == "replaced":
        return f"What was named {answer.effect} is {answer.members[0].effect}: a further run tells them apart."
    if answer.verdict == "not shown":
        return f"The further run does not show {answer.effect}: it cannot be distinguished from nothing there."
    if answer.verdict == "undecided":
        return f"A further run leaves {_listed(answer.holding)} undecided."
    return (
        f"{_listed([m.effect for m in answer.members])}: not of one size in both runs, or more than error is left "
        f"beside it. What was found is something else, or it changed between them."
    )


def evidence(answer: Confirmation) -> str:
    """What decided: by how much the further run shows what holds and excludes the others, with limits.

    "" where several hold, or none does.
    """
    if len(answer.holding) != 1:
        return ""
    best, limit = answer.members[0], f"limit {answer.members[0].limit:.1f}"
    text = (
        f"The further run shows {best.effect} by {best.shown:.1f} standard errors ({limit}, p {chance(best.p_shown)})"
    )
    why = [f"{m.effect}: {_against(m)}" for m in answer.members[1:]]
    text += f"; excluded: {'; '.join(why)}." if why else "."
    if answer.verdict in ("confirmed", "replaced") and best.zero:
        text += (
            f" By the further run alone the 95 % interval of {_listed(best.zero)} holds zero, since that run also has "
            "to tell the declared model and the other effects; the verdict rests on both runs together, which give "
            f"{_ends(best)}."
        )
    return text


def _against(member: Member) -> str:
    """Why an explanation is excluded."""
    reasons = []
    if member.sigmas > member.limit:
        reasons.append(f"{member.sigmas:.1f} standard errors behind (limit {member.limit:.1f})")
    if member.p_changed < CHANGED:
        reasons.append(f"another size than in the first run (p {chance(member.p_changed)}, limit {CHANGED:g})")
    if not member.fits:
        reasons.append("leaves more than error of the further run")
    return ", ".join(reasons)


def _ends(member: Member) -> str:
    pairs = zip(member.terms, member.intervals_together, strict=True)
    return ", ".join(f"{low:.3g} to {high:.3g} for {name}" for name, (low, high) in pairs)


def chance(p: float) -> str:
    """A probability; what is below the smallest that tails can be trusted with is told as below it."""
    return f"< {SMALLEST:g}" if p < SMALLEST else f"= {p:.2g}"


def sizes(member: Member) -> list[str]:
    """Of a cause in the further run, a line for each sensor, or one where all show the same."""
    different = dict.fromkeys(member.sizes.values())
    return list(different) if len(different) == 1 else [f"{name}: {size}" for name, size in member.sizes.items()]


def _listed(names: Sequence[str]) -> str:
    return " and ".join(names) if len(names) < 3 else ", ".join(names[:-1]) + " and " + names[-1]
