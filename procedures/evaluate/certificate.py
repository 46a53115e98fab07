"""Findings in a sensor for a certificate: sizes with intervals, a sentence per effect, a paragraph.

An effect is selected with the same data that estimate it, so every interval is conditional on the selection. It is
valid if the selected effect is the true one; effects that the data cannot distinguish from it are listed with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

from rig.fitter.trace.found import CONFIRMED
from rig.fitter.trace.outcome import Finding, Outcome
from rig.procedures.present.words import SMALLEST, TESTS, capitalised, chance, instead, part, significant, unnamed

Interval = tuple[float, float] | None
_NAMED = 3
"""Maximum number of aliases in a sentence."""
_BY_CHANCE = 0.01
"""Probability from which a single test beyond its 95 % limit is not reported as an effect."""


@dataclass(frozen=True)
class Change:
    """An error before and after, with all findings.

    Attributes:
        of: name of the error, as the subject of a sentence.
        before: with the declared model.
        after: with the findings.
        unit: of both.
    """

    of: str
    before: float
    after: float
    unit: str = ""

    def from_to(self, verb: str = "") -> str:
        """A part of a sentence, with a verb or after one."""
        return f"{self.of}{verb} from {self.before:.3g} to {self.after:.3g} {self.unit}".rstrip()

    @property
    def unchanged(self) -> str:
        """A part of a sentence, if nothing was added to the model."""
        return f"{self.of} is {self.before:.3g} {self.unit}".rstrip()


@dataclass(frozen=True)
class Errors:
    """The errors of one sensor, before and after.

    Attributes:
        of_fit: in the fitted data.
        left_out: in left-out data; None if nothing was left out.
        hides: why the left-out error does not test the findings, as the end of a sentence; "" if it does.
        floor: scatter of repeated readings, with its unit; "" without repeats.
    """

    of_fit: Sequence[Change]
    left_out: Change | None = None
    hides: str = ""
    floor: str = ""


def intervals(coefficients: Iterable[float], halves: Iterable[float | None]) -> list[Interval]:
    """95 % interval of each coefficient, None if its half-width is unknown."""
    pairs = zip(coefficients, halves, strict=True)
    return [None if half is None or not isfinite(half) else (value - half, value + half) for value, half in pairs]


def with_words(sensor: str, effect: Finding, halves: Iterable[float | None], size: str) -> Finding:
    """A finding with intervals of its coefficients and its size, and a self-contained sentence.

    Args:
        sensor: name of the output or response.
        effect: from the trace.
        halves: half-width of each coefficient's 95 % interval; None if there is none.
        size: 95 % interval of its size in words, "" if there is none.
    """
    pairs = tuple(intervals(effect.coefficients, halves))
    worded = replace(effect, interval_95=pairs, size_95=size or None)
    told = worded.to_json()
    if effect.kind == "noise":
        return replace(worded, sentence=f"{sensor}: {_of_noise(told)}.")
    lacks = f"{sensor}: the declared model lacks {_lacking(told)}. Found and sized on the same data."
    return replace(worded, sentence=lacks)


def certified(outcome: Outcome, sentence: str, errors: Errors, **more: Any) -> Outcome:
    """A sensor's outcome with its sentence, the paragraph for a certificate, and further keys of its kind.

    Args:
        outcome: its findings from `with_words`.
        sentence: summary of the findings.
        errors: before and after.
        more: keys of JSON of its kind only.
    """
    return replace(outcome, sentence=sentence, certificate=certificate(outcome, errors), more=more)


def certificate(outcome: Outcome, errors: Errors) -> str:
    """Findings in one sensor, a paragraph: every effect, errors before and after, unexplained remainder.

    Args:
        outcome: its findings from `with_words`.
        errors: before and after.
    """
    sensor, found = outcome.sensor, outcome.to_json()
    added = [effect for effect in found["effects"] if effect["stratum"] != "noise"]
    noise = [effect for effect in found["effects"] if effect["stratum"] == "noise"]
    rest = [text.removesuffix(".") for text in unnamed(found)]
    model = f"the declared model ({found['declared']})"
    texts = []
    if added:
        texts += [f"{sensor}: {model} lacks {_lacking(added[0])}"]
        texts += [f"It also lacks {_lacking(effect)}" for effect in added[1:]]
    elif rest:
        texts += [f"{sensor}: no effect that was looked for explains what {model} leaves"]
    else:
        beside = ", which is not what the model assumes" if noise else ""
        texts += [f"{sensor}: no effect beyond {model} stands out from the noise{beside}"]
    texts += [capitalised(_of_noise(effect)) for effect in noise]
    count = len(added) + sum(left.get("added", False) for left in found["unnamed"])
    texts += _change(errors, count)
    texts += rest or [*(["Nothing else stands out from the noise"] if found["effects"] else []), *_still(found)]
    if one := instead(found):
        texts += [one.removesuffix(".")]
    if errors.floor:
        texts += [f"Readings that repeat one setting scatter by {errors.floor}"]
    if count:
        texts += ["Found and sized on the same data; not confirmed by a measurement of its own"]
    return ". ".join(texts) + "."


def _still(found: Mapping[str, Any]) -> list[str]:
    """Reasons why a test of lack of fit or drift exceeds its limit without further findings; one sentence each."""
    after = found.get("after", {})
    texts = []
    for test, p in (("T_bias", "p_bias"), ("T_b", "p_b"), ("T_S", "p_S")):
        if not significant(after, test):
            continue
        value = f"{test} is {after[test]:.3g}, above its 95 % limit of {after[TESTS[test]]:.3g}"
        if after[p] >= _BY_CHANCE:
            texts.append(
                f"{value}: by chance this happens in 5 % of sensors; the search, with a limit of 5 % for all effects "
                f"together, found nothing more"
            )
        else:
            what = "lack of fit" if test == "T_bias" else "drift between replications"
            texts.append(f"{value}, by more than chance (p {_p(after[p])}): {what} is left that no effect explains")
    return texts


def _p(p: float) -> str:
    return f"below {SMALLEST:.0e}" if p < SMALLEST else f"{p:.2g}"


def _lacking(effect: Mapping[str, Any]) -> str:
    """Sentence about an effect: confounded effects, size, share, and probability by chance."""
    others, cause = effect["aliases"], effect["cause"].partition(": ")[0].partition("; ")[0]
    more = f" and {len(others) - _NAMED} more" if len(others) > _NAMED else ""
    alike = f", or what these data cannot tell from it: {', '.join(others[:_NAMED])}{more}" if others else ""
    interval = f" (95 % interval {effect['size_95']})" if effect["size_95"] else ""
    its = "If it is the former, its" if others else "Its"
    doubt = f"The name is doubtful: {effect['doubtful']}. " if effect["doubtful"] else ""
    return (
        f"{effect['effect']} ({cause}){alike}. {doubt}{its} size is {effect['size']}{interval}; "
        f"it explains {part(effect['share'])} of the error beyond scatter; {_chance(effect)}"
    )


def _of_noise(effect: Mapping[str, Any]) -> str:
    """Sentence about a finding about noise; its influence on other intervals is part of its size."""
    size = effect["size"] if "intervals" not in effect else effect["size"].partition("; ")[0]
    return f"{effect['cause']} ({size}); {_chance(effect)}; nothing is added to the model for it"


def _change(errors: Errors, added: int) -> list[str]:
    """Errors before and after if something was `added`, otherwise their values; one sentence each."""
    left_out = errors.left_out
    if not added:
        return [capitalised(change.unchanged) for change in (*errors.of_fit, *([left_out] if left_out else []))]
    first, *others = errors.of_fit
    changes = " and ".join([first.from_to(" goes"), *(change.from_to() for change in others)])
    texts = [f"With all that was found, {changes}"]
    if left_out is not None:
        told = _grew(left_out) or errors.hides or _supported(left_out, "it" if added == 1 else "them")
        texts.append(f"{capitalised(left_out.from_to(' goes'))}, {told}")
        if _grew(left_out) and errors.hides:
            texts[-1] += f" ({errors.hides})"
    return texts


def _grew(left_out: Change) -> str:
    """Words for a left-out error that did not decrease, as the end of a sentence; "" if it did."""
    if left_out.after < left_out.before:
        return ""
    how = "grew" if left_out.after > left_out.before else "did not fall"
    return f"this {how}: the data left out do not confirm what was found"


def _supported(left_out: Change, it: str) -> str:
    """Words for a left-out error that decreased."""
    if left_out.after > CONFIRMED * left_out.before:
        return f"which supports {it}, but weakly: it falls by less than {1 - CONFIRMED:.0%}".replace("%", " %")
    return f"which supports {it}"


def _chance(effect: Mapping[str, Any]) -> str:
    p = chance(effect).replace("= ", "").replace("< ", "below ")
    return f"the probability of anything so clear by chance is {p}"
