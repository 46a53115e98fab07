"""Words common to report and terminal about a trace: its JSON as text for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rig.fitter.rounding import with_error
from rig.procedures.column_names import spelled
from rig.procedures.present.numbers import interval_text

TESTS = {"T_bias": "F_bias_95", "T_b": "F_bS_95", "T_S": "F_bS_95", "T_drift": "F_drift_95"}
"""Every test of Table 2 with its 95 % limit."""

SMALLEST = 1e-6
"""Limit of probabilities: smaller ones depend on tails of distributions that are not verified, and are given as below
it.
"""


_ONE_PERCENT, _NEARLY_ALL = 0.01, 0.99
_ROUNDING = 1e-9
"""Tolerance of a share for "all" and for whole percent."""


_SKIPPED_TOLD = 5


def constants_of(effect: Mapping[str, Any]) -> list[str]:
    """Searched constants of an effect with their 95 % intervals: "time constant 236 s (234 to 239 s)"."""
    told = []
    for one in effect.get("constants", ()):
        unit = f" {spelled(one['unit'])}" if one["unit"] else ""
        known = one["stderr"] and one["interval_95"]
        value = with_error(one["estimate"], one["stderr"])[0] if known else f"{one['estimate']:.3g}"
        interval = f"{interval_text(one['interval_95'], one['stderr'])}{unit}" if known else "no interval"
        told.append(f"{one['name']} {value}{unit} ({interval})")
    return told


def incomplete(provenance: Mapping[str, Any]) -> str:
    """Sentence for a run with fewer observations than points, with reasons; "" if complete or unknown."""
    planned, observed = provenance.get("points_planned"), provenance.get("points_observed")
    skipped = provenance.get("skipped") or []
    if planned is None or observed is None or (planned <= observed and not skipped):
        return ""
    words = [f"{observed} of {planned} points"]
    if not skipped:
        words.append("the others were skipped" if provenance.get("complete") else "the run is not complete")
    else:
        told = [f"point {s['point']} ({s['where']}): {s['reason']}" for s in skipped[:_SKIPPED_TOLD]]
        more = f" and {len(skipped) - _SKIPPED_TOLD} more" if len(skipped) > _SKIPPED_TOLD else ""
        words.append(f"{len(skipped)} skipped: {', '.join(told)}{more}")
        if not provenance.get("complete"):
            words.append("the run is not complete")
        words.append(_unbalanced(skipped))
    return "; ".join(words)


def _unbalanced(skipped: Sequence[Mapping[str, Any]]) -> str:
    """Consequences of missing points for the design."""
    whole_plots = sorted({s["whole_plot"] for s in skipped if s.get("whole_plot") is not None})
    which = "whole plot" if whole_plots else "replication"
    numbers = whole_plots or sorted({s["replication"] for s in skipped})
    listed = ", ".join(str(n) for n in numbers)
    return (
        f"the design is not balanced: {which}{'s' if len(numbers) > 1 else ''} {listed} "
        f"{'lack' if len(numbers) > 1 else 'lacks'} points, so effects of order and time do not cancel exactly there"
    )


def significant(table: Mapping[str, Any], test: str) -> bool:
    """Whether a test of Table 2 exceeds its 95 % limit."""
    value, limit = table.get(test), table.get(TESTS[test])
    return value is not None and limit is not None and value > limit


def chance(effect: Mapping[str, Any]) -> str:
    """Family-wise p of an effect: "= 0.003", or "< 5.8e-05" at the limit of the simulation."""
    p = max(effect["p_adjusted"], SMALLEST)
    return f"{'<' if effect.get('p_adjusted_is_bound') or p == SMALLEST else '='} {p:.2g}"


def share(effect: Mapping[str, Any]) -> str:
    """Share of an effect in the whole error beyond scatter; a finding about noise has none."""
    if effect["stratum"] == "noise":
        return "a finding about the noise"
    return f"{part(effect['share'])} of the error beyond scatter"


def verdict(word: str, causes: Sequence[str]) -> str:
    """A verdict, with findings about noise, which add nothing to the model.

    Args:
        word: the verdict.
        causes: of the findings about noise.
    """
    to_model = " to the model" if word == "nothing to add" and causes else ""
    return f"{word}{to_model}{noise_of(causes)}"


def doubts_of(doubts: Mapping[str, str | None]) -> str:
    """Names that are doubtful, with the reasons, as the end of a sentence; "" if there are none.

    Args:
        doubts: reason by name of the effect; None for a name without doubt.
    """
    told = [f"{name} ({why})" for name, why in doubts.items() if why]
    return f"; doubtful: {'; '.join(told)}" if told else ""


def noise_of(causes: Sequence[str]) -> str:
    """Findings about noise, after those for the model; "" if there are none."""
    return f"; the noise is not what the model assumes: {'; '.join(causes)}" if causes else ""


def verdict_of(sensor: Mapping[str, Any]) -> str:
    """Verdict and its causes in words, from a sensor's JSON."""
    causes = [effect["cause"] for effect in sensor["effects"] if effect["stratum"] == "noise"]
    return verdict(sensor["verdict"], causes)


def percent(part: float) -> str:
    """A share in whole percent, rounded down so that the sum is at most 100; less than one is "less than 1 %"."""
    return "less than 1 %" if 0 < part < _ONE_PERCENT else f"{int(100 * part + _ROUNDING)} %"


def part(share: float) -> str:
    """A share in words: "all" if nothing remains for another, "nearly all" if less than a percent does."""
    if share > _NEARLY_ALL:
        return "all" if share > 1.0 - _ROUNDING else "nearly all"
    return percent(max(share, _ROUNDING))


def units(effect: Mapping[str, Any]) -> list[str]:
    """Unit of each coefficient of an effect."""
    terms, unit = effect["terms"], str(effect["unit"])
    if "columns" in effect:  # for a table of any kind: one unit, with names of columns in it
        return [unit] * len(terms)
    given = unit.split(", ")
    return given if len(given) == len(terms) else [unit] * len(terms)


def unnamed(sensor: Mapping[str, Any]) -> list[str]:
    """The remainder that no effect of the catalogue explains, one sentence each."""
    return [
        f"{'Without a name' if rest.get('added') else 'Unexplained'}: {part(rest['share'])} of the error beyond "
        f"scatter, {rest['where']}{_shape(rest.get('shape'))}."
        for rest in sensor["unnamed"]
    ]


def instead(sensor: Mapping[str, Any]) -> str:
    """What one shape without a name would be in place of the doubtful effects, a sentence; "" if none is doubtful."""
    one = sensor.get("instead")
    if not one:
        return ""
    first, last = one["effects"][:-1], one["effects"][-1]
    names = f"{', '.join(first)} and {last}" if first else last
    return f"In place of {names} may stand one shape without a name: {one['where']}{_shape(one['shape'])}."


def _shape(shape: Mapping[str, Any] | None) -> str:
    """Size and nearest names of a shape, as the end of a sentence."""
    if shape is None:
        return ""
    return f"; its shape has {size_of(shape)} rms; {shape['nearest_sentence']}"


def size_of(shape: Mapping[str, Any]) -> str:
    """Size of a shape without a name."""
    return f"{shape['rms']:.3g} {shape['unit']}".rstrip()


def capitalised(text: str) -> str:
    """A sentence with a capital first letter; unchanged if it begins with a column's name."""
    first = text.partition(" ")[0]
    return text[:1].upper() + text[1:] if first.isalpha() and first.islower() else text
