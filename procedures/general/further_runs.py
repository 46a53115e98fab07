"""Further runs of any laboratory: the same again, in another order, with settings between, with longer waits."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

from procedures.further_runs import Variation
from procedures.general.design import MOST_POINTS
from procedures.general.factors import RANDOM, UP_DOWN
from procedures.general.settings import GeneralProcedure

_LONGER, _SHORTEST_S = 4.0, 30.0
"""Factor of the wait at a setting, and its smallest result, that tell what still moves from what stays."""


def further_runs(first: GeneralProcedure) -> Iterator[Variation]:
    """Runs after `first`, each kind from the smallest to the largest."""
    for what, changes in _kinds(first):
        for times in sorted({1, first.replications, 2 * first.replications}):
            named = {"name": f"{first.name}: {what}"[:80], "seed": first.seed + 1, "replications": times}
            values = {**_values(first), **changes, **named}
            run = GeneralProcedure.model_validate(values)
            yield Variation(what, run, wait_s=run.settle.dwell_s - first.settle.dwell_s)


def _values(first: GeneralProcedure) -> dict[str, Any]:
    """The procedure as its file; steps by hand belong to its own places."""
    values = first.model_dump(mode="json", exclude_unset=True)
    values.pop("by_hand", None)
    return values


def _kinds(first: GeneralProcedure) -> Iterator[tuple[str, dict[str, Any]]]:
    """Differences from the first run, in words and as values of the file."""
    values = _values(first)
    factors: Mapping[str, dict[str, Any]] = values["factors"]
    easy = [name for name, factor in first.factors.items() if not factor.hard]
    yield "the same again", {}
    if any(first.factors[name].order != RANDOM for name in easy):
        yield "settings in random order", {"factors": _with(factors, easy, order=RANDOM)}
    if len(easy) == 1 and first.factors[easy[0]].order != UP_DOWN:
        yield "settings up and down", {"factors": _with(factors, easy, order=UP_DOWN)}
    if first.design.type == "grid":
        between = {name: _between(factors[name]["levels"]) for name in easy if len(factors[name]["levels"]) > 1}
        points = len(first.expand()) // first.replications * 2 ** len(between)
        if between and points <= MOST_POINTS:
            more = {name: {**factors[name], "levels": levels} for name, levels in between.items()}
            yield "settings between those of the first run too", {"factors": {**factors, **more}}
    wait = max(_LONGER * first.settle.dwell_s, _SHORTEST_S)
    yield f"{wait:g} s at each setting before it is read", {"settle": {**values.get("settle", {}), "dwell_s": wait}}


def _with(factors: Mapping[str, dict[str, Any]], names: list[str], **changes: Any) -> dict[str, dict[str, Any]]:
    return {name: {**factor, **(changes if name in names else {})} for name, factor in factors.items()}


def _between(levels: list[float]) -> list[float]:
    """The levels and the middles between them."""
    ordered = sorted(levels)
    middles = [(low + high) / 2.0 for low, high in itertools.pairwise(ordered)]
    return sorted({*ordered, *middles})
