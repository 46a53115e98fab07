"""Results of a further run: as JSON, and as sentences for a certificate."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from rig.errors import UsageError
from rig.fitter.arrays import FloatArray
from rig.fitter.confirm import Confirmation, Later, Member, SensorError, confirm_all, still_open
from rig.fitter.confirm import Confirmed as Judged
from rig.fitter.confirm.judgement import CHANGED, PREDICTED
from rig.fitter.errors import FitError
from rig.fitter.json_values import if_finite
from rig.procedures.evaluate.confirming import SETTLED
from rig.procedures.present.words import SMALLEST
from rig.verbs.confirm.first import First, read_later

Value = TypeVar("Value", float, FloatArray)


@dataclass(frozen=True, eq=False)
class Confirmed:
    """Results of a later run about the effects found in a first run.

    Attributes:
        first: the traced run.
        paths: the later run files, in order of time.
        later: the same, read.
        judged: every question, and both models.
    """

    first: First
    paths: tuple[Path, ...]
    later: tuple[Later, ...]
    judged: Judged

    @property
    def path(self) -> Path:
        """The last one."""
        return self.paths[-1]

    @property
    def bench_h(self) -> float:
        """Bench time of the later runs, hours: from begin to last reading."""
        return float(sum(one.data.elapsed_s.max() for one in self.later)) / 3600.0

    def recorded(self, name: str) -> FloatArray | None:
        """(m,) what was recorded in the later runs; None if it is not known of all."""
        if not all(hasattr(one.data, name) for one in self.later):
            return None
        begins = [one.after_s if name == "elapsed_s" and len(self.later) > 1 else 0.0 for one in self.later]
        values = (np.asarray(getattr(one.data, name), np.float64) for one in self.later)
        return np.concatenate([own + begin for own, begin in zip(values, begins, strict=True)])

    @property
    def answers(self) -> tuple[Confirmation, ...]:
        """One answer per question."""
        return self.judged.answers

    @property
    def settled(self) -> bool:
        """Whether exactly one explanation remains for every effect."""
        return all(answer.verdict in SETTLED for answer in self.answers)

    @property
    def unit(self) -> str:
        """Unit of the inferred quantity, in which errors are given."""
        return self.first.confirming.unit

    def named(self, output: str) -> str:
        """An output with the unit of its errors, where outputs have different ones."""
        own = self.first.confirming.unit_for(output)
        return output if own == self.unit or not own else f"{output} / {own}"

    @property
    def own(self) -> str:
        """Parameters estimated from the further run itself for its prediction, in words; "" if there are none."""
        return self.first.confirming.own_words(realigned=self.judged.realigned)

    def inferred(self, error: SensorError, value: Value) -> Value:
        """An error of the output converted to an error of the inferred quantity, in `unit`; small angles."""
        return value * self.first.confirming.per_slope / abs(error.slope)

    def to_json(self) -> dict[str, Any]:
        """Values for `--json`."""
        told = [
            self._answer(a)
            | {"sentence": _sentence(a), "evidence": evidence(a), "caution": may_be_beside(a)}
            | {"shared": self.first.shared(a.effect)}
            for a in self.answers
        ]
        errors = {name: self._error(name, e) for name, e in self.judged.errors.items()}
        about = {
            "run": str(self.path),
            "runs": [str(path) for path in self.paths],
            "bench_h": self.bench_h,
            "points": sum(len(one.data) for one in self.later),
            "taken_out": self.own,
        }
        return about | {"error": errors, "effects": told}

    def _answer(self, answer: Confirmation) -> dict[str, Any]:
        return {
            "named": answer.effect,
            "verdict": answer.verdict,
            "holds": list(answer.holding),
            "outliers": list(answer.outliers),
            "beside": [{"effect": one.effect, "up_to": one.up_to} for one in answer.minor_causes],
            "members": [
                {
                    "effect": m.effect,
                    "causes": list(m.causes),
                    "sigmas_behind": m.sigmas,
                    "p_changed": m.p_changed,
                    "missed": if_finite(m.missed),
                    "sigmas_shown": m.shown,
                    "sigmas_expected": m.expected,
                    "p_shown": m.p_shown,
                    "limit_sigmas": m.limit,
                    "fits": m.fits,
                    "p_fits": m.p_fits,
                    "misfit": m.place,
                    "terms": list(m.terms),
                    "coefficients": list(map(if_finite, m.coefficients)),
                    "interval_95": [list(map(if_finite, ends)) for ends in m.intervals],
                    "interval_holds_zero": list(m.zero),
                    "coefficients_both_runs": list(map(if_finite, m.together)),
                    "interval_95_both_runs": [list(map(if_finite, ends)) for ends in m.intervals_together],
                    "size": dict(m.sizes),
                }
                for m in answer.members
            ],
        }

    def _error(self, name: str, error: SensorError) -> dict[str, float]:
        output, unit = self.first.confirming.output_unit, self.first.confirming.unit_for(name).replace("/", "_per_")
        output = unit if output == self.unit else output
        values = {"before": error.before, "after": error.after, "reading": error.sigma}
        return {f"{name}_{output}": value for name, value in values.items()} | {
            f"{name}_{unit}": self.inferred(error, value) for name, value in values.items()
        }


def judge(first: First, *later: Path, anywhen: bool = False) -> Confirmed:
    """Judge every effect found by one or several later runs together.

    Args:
        first: the traced run.
        later: files of the others.
        anywhen: whether they may be earlier.

    Raises:
        UsageError: a run has another kind or other sensors, is not later, or is given twice.
    """
    every = ((read_later(first, path, anywhen=anywhen), path) for path in later)
    read = sorted(every, key=lambda run: run[0].after_s)
    runs, paths = tuple(run for run, _ in read), tuple(path for _, path in read)
    for (one, path), (other, _) in itertools.pairwise(read):
        if one.after_s == other.after_s:
            raise UsageError(f"{path} is given twice, or began at the time of another one: give every further run once")
    *earlier, last = runs
    try:
        both = first.confirming.after(earlier).beside(last.data, last.after_s, last.done)
        judged = confirm_all(both, first.questions)
    except FitError as error:
        raise UsageError(f"{', '.join(map(str, paths))}: {error}") from error
    return Confirmed(first, paths, runs, judged)


def following(confirmed: Confirmed, *, alone: bool = True) -> First | None:
    """The first run with the further ones and what they leave open, for the next run; None if nothing is open.

    With `alone` a confirmed cause is open if another one may be there beside it.
    """
    left = [one for one in confirmed.answers if alone or one.verdict not in SETTLED]
    questions = tuple(filter(None, map(still_open, left)))
    if not questions:
        return None
    first = confirmed.first
    return replace(first, confirming=first.confirming.after(confirmed.later), questions=questions)


def sentences(confirmed: Confirmed) -> Iterator[str]:
    """Confirmed effects, in sentences for a certificate; the errors of both models last."""
    for answer in confirmed.answers:
        shared = confirmed.first.shared(answer.effect)
        told = (_sentence(answer), evidence(answer), may_be_beside(answer), shared and f"{shared}.")
        yield " ".join(filter(None, told))
    errors = confirmed.judged.errors
    name = max(errors, key=lambda sensor: errors[sensor].before / errors[sensor].sigma)
    if not np.isfinite(errors[name].before):
        yield "The further run is too short to determine the error of either model."
        return
    before, after = (confirmed.inferred(errors[name], v) for v in (errors[name].before, errors[name].after))
    unit = confirmed.first.confirming.unit_for(name)
    yield (
        f"On data not used by either model the error of {name} is {before:.3g} {unit} rms with the "
        f"declared model and {after:.3g} {unit} with the effects."
    )


def _sentence(answer: Confirmation) -> str:
    if answer.verdict == "confirmed":
        others = [m.effect for m in answer.members[1:]]
        excluded = f"; {listed(others)} {'is' if len(others) == 1 else 'are'} excluded" if others else ""
        return f"{answer.effect} is confirmed by a further run{excluded}."
    if answer.verdict == "replaced":
        return f"What was named {answer.effect} is {answer.members[0].effect}: a further run distinguishes them."
    if answer.cannot_tell:
        return _cannot_tell(answer)
    if answer.verdict == "not shown":
        return f"The further run does not show {answer.effect}: it is not distinguishable from zero."
    if answer.verdict == "undecided":
        return f"A further run leaves {listed(answer.holding)} undecided."
    why = "; ".join(f"{m.effect}: {_against(m)}" for m in answer.members)
    return f"No explanation holds: {why}. The cause is a different one, or it changed between the runs."


def _cannot_tell(answer: Confirmation) -> str:
    largest = max(member.expected for member in answer.members if member.holds)
    why = (
        f": its {answer.used_up} groups of readings with a common error (whole plots or replications) leave no degrees "
        "of freedom beside the coefficients of the declared model that differ between them"
        if answer.used_up
        else ""
    )
    return (
        f"The further run cannot tell whether {' or '.join(answer.holding)} is there: as large as in the first run, it "
        f"would show it by {largest:.1f} standard errors{why}. A longer further run, or one with more whole plots, is "
        "needed."
    )


def evidence(answer: Confirmation) -> str:
    """Evidence for the verdict: separation of the confirmed explanation and of the excluded ones, with limits.

    "" if several hold, or none does.
    """
    if len(answer.holding) != 1:
        return ""
    best, limit = answer.members[0], f"limit {answer.members[0].limit:.1f}"
    shows = (
        f"The further run shows {best.effect} by" if best.seen else f"In the further run {best.effect} stands out by"
    )
    text = f"{shows} {best.shown:.1f} standard errors ({limit}, p {chance(best.p_shown)})"
    why = [f"{m.effect}: {_against(m)}" for m in answer.members[1:]]
    text += f"; excluded: {'; '.join(why)}." if why else "."
    if answer.verdict in ("confirmed", "replaced") and best.zero:
        text += (
            f" By the further run alone the 95 % interval of {listed(best.zero)} contains zero: that run also has "
            "to determine the declared model and the other effects; the verdict uses both runs together, with "
            f"{ends(best)}."
        )
    return text


def may_be_beside(answer: Confirmation) -> str:
    """Causes that the two runs do not exclude beside the confirmed one; "" if there are none of a notable size."""
    if not answer.minor_causes or answer.verdict not in ("confirmed", "replaced"):
        return ""
    parts = [f"{one.effect} up to {100 * one.up_to:.0f} %" for one in answer.minor_causes]
    return (
        f"Two causes at once are not excluded: of what was found, beside {answer.holding[0]} may be {listed(parts)} "
        "(95 %), and its size would be another by as much. A longer further run narrows this."
    )


def _against(member: Member) -> str:
    """Reason why an explanation is excluded."""
    reasons = []
    if member.sigmas > member.limit:
        reasons.append(f"{member.sigmas:.1f} standard errors worse (limit {member.limit:.1f})")
    if member.p_changed < CHANGED:
        reasons.append(f"another size than in the first run (p {chance(member.p_changed)}, limit {CHANGED:g})")
    if not member.fits:
        reasons.append(unfit(member))
    if PREDICTED < member.missed < math.inf:
        reasons.append(
            f"the first run does not predict {100 * member.missed:.2g} % of it (limit {100 * PREDICTED:g} %)"
        )
    return ", ".join(reasons)


def ends(member: Member, sensor: str = "") -> str:
    """95 % intervals of a cause by both runs, each with its term: of all sensors, or where they have terms of their
    own, of one.
    """
    pairs = list(zip(member.terms, member.intervals_together, strict=True))
    pairs = [one for one in pairs if sensor and one[0].endswith(f"({sensor})")] or pairs
    return ", ".join(f"{_range(low, high)} for {name}" for name, (low, high) in pairs)


def _range(low: float, high: float) -> str:
    """A 95 % interval, open where the data set no end."""
    if math.isfinite(low) and math.isfinite(high):
        return f"{low:.3g} to {high:.3g}"
    if math.isfinite(low) or math.isfinite(high):
        return f"at least {low:.3g}" if math.isfinite(low) else f"at most {high:.3g}"
    return "any value"


def chance(p: float) -> str:
    """A probability; values below the limit of reliable tails are given as below that limit."""
    return f"< {SMALLEST:g}" if p < SMALLEST else f"= {p:.2g}"


def unfit(member: Member) -> str:
    """Why a cause does not fit the further run: where, and with what probability by chance."""
    left = f"follows a shape {member.place}" if member.place else "is larger than its error"
    return f"what it leaves in the further run {left} (p {chance(member.p_fits)}, limit {CHANGED:g})"


def sizes(member: Member) -> list[str]:
    """Size of a cause in the further run, one line per sensor, or one line if all are the same."""
    different = dict.fromkeys(member.sizes.values())
    return list(different) if len(different) == 1 else [f"{name}: {size}" for name, size in member.sizes.items()]


def listed(names: Sequence[str]) -> str:
    """Names in a sentence: "a, b and c"."""
    return " and ".join(names) if len(names) < 3 else ", ".join(names[:-1]) + " and " + names[-1]
