"""An effect that was found, as it can go into a certificate: size and coefficients with intervals, and a sentence.

An effect is chosen on the data that it is then estimated from, so every interval here is conditional on the choice. It
is the interval of that effect if it is the one; what the data cannot tell from it stands beside it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import hypot, isfinite
from typing import Any

from fitter.effects.sizes import Size, amplitude, between
from rig.report.words import chance, percent

Interval = tuple[float, float] | None
_NAMED = 4
"""Aliases that a sentence names."""


@dataclass(frozen=True)
class Change:
    """An error before and after, with all effects found.

    Attributes:
        of: what it is the error of.
        before: with the declared model.
        after: with the effects.
        unit: of both.
        tells: whether it would fall if the effects are real, and so speaks against them where it does not.

    """

    of: str
    before: float
    after: float
    unit: str
    tells: bool = True

    def __str__(self) -> str:
        """As part of a sentence."""
        return f"{self.of} from {self.before:.3g} to {self.after:.3g} {self.unit}".rstrip()


def intervals(coefficients: Iterable[float], halves: Iterable[float | None]) -> list[Interval]:
    """95 % interval of each coefficient, None where its half-width is not known."""
    pairs = zip(coefficients, halves, strict=True)
    return [None if half is None or not isfinite(half) else (value - half, value + half) for value, half in pairs]


def size_95(size: Size, values: Mapping[str, float], halves: Mapping[str, float], sensitivity: float) -> str:
    """95 % interval of an effect's size, in the words of the catalogue: "1.49e-3 to 1.51e-3 deg/g".

    Args:
        size: the catalogue's words for it.
        values: coefficients by name of the term, in the terms' own units.
        halves: half-widths of their 95 % intervals.
        sensitivity: of the sensor, as `size` takes it.

    Of an effect with several sizes an interval each, in the order of `size`.

    """
    if size is amplitude and len(values) > 1:  # of sine and cosine together, whose errors hardly correlate
        total = hypot(*values.values())
        part = hypot(*(value * halves[name] for name, value in values.items())) / total**2
        scaled = ({name: value * max(scale, 0.0) for name, value in values.items()} for scale in (1 - part, 1 + part))
        return between(*(size(end, sensitivity) for end in scaled))
    texts = []
    for name, value in values.items():
        ends = value - halves[name], value + halves[name]
        texts.append(between(*(size({name: end}, sensitivity) for end in ends)))
    return ", ".join(texts)


def with_words(
    sensor: str,
    effect: dict[str, Any],
    halves: Iterable[float | None],
    size: str,
    changes: Iterable[Change],
    left_out: Change | None,
    remains: Iterable[Mapping[str, Any]],
    floor: str = "",
) -> dict[str, Any]:
    """An effect's JSON with `interval_95` of its coefficients, `size_95` and `sentence`.

    Args:
        sensor: name of the output or response.
        effect: as the trace has it.
        halves: half-width of each coefficient's 95 % interval; None where there is none.
        size: 95 % interval of its size in words, "" where there is none.
        changes: errors before and after.
        left_out: the error on what was left out of search and fit.
        remains: what is left unnamed.
        floor: pure error with its unit, below which no model of the settings comes; "" where nothing is repeated.

    """
    words = {
        "interval_95": [None if pair is None else list(pair) for pair in intervals(effect["coefficients"], halves)],
        "size_95": size or None,
    }
    if effect["stratum"] == "noise":
        sentence = f"{sensor}: {effect['cause']} ({effect['size']}; {_chance(effect)}); nothing is added to the model"
        return {**effect, **words, "sentence": f"{sentence} for it."}
    return {**effect, **words, "sentence": _sentence(sensor, effect, size, changes, left_out, remains, floor)}


def _sentence(
    sensor: str,
    effect: Mapping[str, Any],
    size: str,
    changes: Iterable[Change],
    left_out: Change | None,
    remains: Iterable[Mapping[str, Any]],
    floor: str,
) -> str:
    name, others = effect["effect"], effect["aliases"]
    lacks = f"{sensor}: the declared model lacks {name} ({effect['cause']})"
    more = f" and {len(others) - _NAMED} more" if len(others) > _NAMED else ""
    alike = f", or what these data cannot tell from it: {', '.join(others[:_NAMED])}{more}" if others else ""
    interval = f" (95 % interval {size}, conditional on the selection)" if size else ""
    left = [f"{percent(rest['share'])} of the excess, {rest['where']}" for rest in remains]
    texts = [
        lacks + alike,
        f"{'If it is the former, its' if others else 'Its'} size is {effect['size']}{interval}; it explains "
        f"{percent(effect['share'])} of the error in excess of scatter; {_chance(effect)}",
        f"With all that was found, {', '.join(map(str, changes))}{_borne_out(left_out)}",
        (f"Unexplained remains: {'; '.join(left)}" if left else "Beside that nothing stands out from the noise")
        + (f"; readings that repeat one setting scatter by {floor}" if floor else ""),
        "Found and sized on the same data; not confirmed by a measurement of its own",
    ]
    return ". ".join(texts) + "."


def _borne_out(left_out: Change | None) -> str:
    """The left-out error as part of a sentence, with a warning where it does not fall."""
    if left_out is None:
        return ""
    against = left_out.tells and left_out.after >= left_out.before
    return f", {left_out}{', which does not bear it out' if against else ''}"


def _chance(effect: Mapping[str, Any]) -> str:
    p = chance(effect).replace("= ", "").replace("< ", "below ")
    return f"the probability of the like by chance, over all that was searched, is {p}"
