"""Calibrations that depend on the choice among several indistinguishable causes: intervals that cover all.

The stored calibration uses one member of each class of causes. Another member would move an interval's ends; moves of
several classes are added, as for small effects.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.infer.answer import InferredAttitude
from rig.procedures.present.numbers import interval_text

MATTERS = 0.1
"""Minimum change relative to the half-width for a remark that an interval depends on the cause."""


@dataclass(frozen=True)
class Covering:
    """An interval that is valid for every member of each class.

    Attributes:
        low: its lower end.
        high: its upper end.
        depends_on: for each class on which it depends, its members, the named one first.
    """

    low: float
    high: float
    depends_on: tuple[tuple[str, ...], ...]


def covering(named: tuple[float, float], others: Sequence[tuple[str, str, tuple[float, float]]]) -> Covering:
    """The interval that covers all members of all classes.

    Args:
        named: 95 % interval with the named effects.
        others: for every other member the effect that it replaces, its name, and its 95 % interval.
    """
    room = MATTERS * (named[1] - named[0]) / 2.0
    low, high, depends = 0.0, 0.0, []
    for effect in dict.fromkeys(effect for effect, _, _ in others):
        of = [(member, ends) for name, member, ends in others if name == effect]
        down = min(0.0, *(ends[0] - named[0] for _, ends in of))
        up = max(0.0, *(ends[1] - named[1] for _, ends in of))
        low, high = low + down, high + up
        if max(-down, up) > room:
            depends.append((effect, *(member for member, _ in of)))
    return Covering(named[0] + low, named[1] + high, tuple(depends))


def cover_rows(
    table: Mapping[str, Mapping[str, Any]], others: Sequence[tuple[str, str, Mapping[str, Mapping[str, Any]]]]
) -> dict[str, dict[str, Any]]:
    """A parameter table whose intervals cover every member of every class.

    Rows keep their keys: `interval95` is then valid for every member. If it is wider for that, `interval95_as_named` is
    the interval for the named effects, `depends_on` names the classes, and `sentence` states it.

    Args:
        table: with the named effects, from `rig.procedures.attitude.fit.parameter_table`.
        others: the same with every other member: the effect that it replaces, its name, table.
    """
    out = {name: dict(row) for name, row in table.items()}
    for name, row in out.items():
        ends = [(effect, member, _ends(other.get(name))) for effect, member, other in others]
        own = _ends(row)
        known = [(effect, member, pair) for effect, member, pair in ends if pair is not None]
        if own is None or not known:
            continue
        wide = covering(own, known)
        if wide.depends_on:
            row["interval95_as_named"] = list(own)
            row["interval95"] = [wide.low, wide.high]
            row["depends_on"] = [list(members) for members in wide.depends_on]
            row["sentence"] = depends(name, wide)
    return out


def depends(parameter: str, wide: Covering) -> str:
    """Sentence that a parameter depends on the cause, with its possible range."""
    which = " and on ".join(f"which of {_listed(members)} holds" for members in wide.depends_on)
    name, _, unit = parameter.partition("_")
    ends = interval_text((wide.low, wide.high), (wide.high - wide.low) / 2.0)
    return f"{name} depends on {which}: from {ends} {unit.replace('_per_', '/')} (95 %, whichever holds)"


def widened(
    value: FloatArray, ends: tuple[FloatArray, FloatArray], others: Sequence[tuple[str, FloatArray, FloatArray]]
) -> tuple[FloatArray, FloatArray]:
    """(n,) ends of intervals of angles that cover every member of every class, in degrees.

    Args:
        value: (n,) with the named effects.
        ends: (n,) each, of its interval.
        others: for every other member the effect that it replaces, and its ends.

    A member without an interval has no influence.
    """
    low, high = (np.array(end, np.float64) for end in ends)
    for effect in dict.fromkeys(effect for effect, _, _ in others):
        down, up = np.zeros_like(value), np.zeros_like(value)
        for _, lower, upper in (other for other in others if other[0] == effect):
            turns = 360.0 * np.round(((lower + upper) / 2.0 - value) / 360.0)
            down = np.fmin(down, lower - turns - ends[0])
            up = np.fmax(up, upper - turns - ends[1])
        low, high = low + down, high + up
    return low, high


def cover(out: InferredAttitude, found: Sequence[tuple[str, InferredAttitude]], angle: str) -> None:
    """Widen the intervals of "pitch" or "roll", in place, to cover every other member of each class."""
    if not found:
        return
    value, low, high = (getattr(out, f"{angle}{which}_deg") for which in ("", "_lo95", "_hi95"))
    others = [
        (named, getattr(other, f"{angle}_lo95_deg"), getattr(other, f"{angle}_hi95_deg")) for named, other in found
    ]
    low[:], high[:] = widened(value, (low.copy(), high.copy()), others)


def by_class(pairs: Sequence[tuple[str, str]]) -> Iterator[tuple[str, ...]]:
    """Members of every class, the named one first, from (named, other member) pairs."""
    for effect in dict.fromkeys(effect for effect, _ in pairs):
        yield (effect, *(member for name, member in pairs if name == effect))


def _ends(row: Mapping[str, Any] | None) -> tuple[float, float] | None:
    pair = None if row is None else row["interval95"]
    return None if pair is None or None in pair else (float(pair[0]), float(pair[1]))


def _listed(names: Sequence[str]) -> str:
    return " or ".join(names) if len(names) < 3 else ", ".join(names[:-1]) + " or " + names[-1]
