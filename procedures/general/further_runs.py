"""Further runs of any laboratory: the same procedure with another order, other settings, or other waits."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rig.procedures.general.design import MOST_POINTS
from rig.procedures.general.factors import RANDOM, UP_DOWN
from rig.procedures.general.settings import GeneralProcedure
from rig.procedures.plan.further_runs import Limits, Variation, named
from rig.procedures.plan.settings import Varies

_LONGER, _SHORTEST_S, _LONGEST_S = 4.0, 30.0, 1800.0
"""Factor of the wait at a setting, its smallest result, and its largest, that tell what still moves from what stays."""
LEAST_LEVELS = 3
"""Minimum number of levels that a sweep, or settings between them, need."""

Values = dict[str, Any]


def further_runs(first: GeneralProcedure, limits: Limits, *, chamber: bool) -> Iterator[Variation]:
    """Runs after `first` on any bench, each kind from the smallest to the largest."""
    for what, varies, changes in _kinds(first):
        for times in sorted({1, first.replications, 2 * first.replications}):
            own = {"name": named(first.name, what), "seed": first.seed + 1, "replications": times}
            run = with_routine(GeneralProcedure.model_validate({**values_of(first), **changes, **own}), first)
            wait_s = run.settle.dwell_s - first.settle.dwell_s
            yield Variation(what, run, wait_s=wait_s, routine=True, varies=varies)


def values_of(procedure: GeneralProcedure) -> Values:
    """The procedure as its file, without steps by hand."""
    values = procedure.model_dump(mode="json", exclude_unset=True)
    values.pop("by_hand", None)
    return values


def with_routine(run: GeneralProcedure, first: GeneralProcedure) -> GeneralProcedure:
    """A further run with those steps by hand of the first run that it has places for.

    A step before every whole plot, or before every replication, is one before every one of the further run.
    """
    steps = first.model_dump(mode="json", exclude_none=True)["by_hand"]
    if not steps:
        return run
    places = {
        "before_replication": (first.replications, run.replications),
        "before_whole_plot": (first.expand().whole_plots, run.expand().whole_plots),
        "before": (len(first.expand()), len(run.expand())),
    }
    kept: list[Values] = []
    told: set[tuple[str, str]] = set()
    for step in steps:
        if "before_every" in step:
            kept.append(step)
            continue
        place = next(name for name in places if name in step)
        before, now = places[place]
        same = [one for one in steps if _but(one, place) == _but(step, place) and place in one]
        if place != "before" and {one[place] for one in same} == set(range(1, before + 1)):
            if (place, step["say"]) not in told:
                kept += [{**step, place: number} for number in range(1, now + 1)]
                told.add((place, step["say"]))
        elif step[place] <= now:
            kept.append(step)
    return GeneralProcedure.model_validate({**values_of(run), "by_hand": kept})


def _but(step: Mapping[str, Any], place: str) -> Values:
    return {name: value for name, value in step.items() if name != place}


def _kinds(first: GeneralProcedure) -> Iterator[tuple[str, Varies, Values]]:
    """Differences from the first run, in words, as a respect, and as values of the file."""
    values = values_of(first)
    factors: Mapping[str, Values] = values["factors"]
    easy = [name for name, factor in first.factors.items() if not factor.hard]
    yield "the same again", "again", {}
    if any(first.factors[name].order != RANDOM for name in easy):
        yield "settings in random order", "order", {"factors": _with(factors, easy, order=RANDOM)}
    for what, changes in _sweeps(first, factors, easy):
        yield what, "order", changes
    if first.design.type == "grid":
        for what, changes in _between(first, factors):
            yield what, "settings", changes
    wait = max(_LONGER * first.settle.dwell_s, _SHORTEST_S)
    if easy and first.settle.dwell_s < wait <= _LONGEST_S:
        settle = {**values.get("settle", {}), "dwell_s": wait}
        yield f"{wait:g} s at each setting before it is read", "wait", {"settle": settle}


def _sweeps(
    first: GeneralProcedure, factors: Mapping[str, Values], easy: Sequence[str]
) -> Iterator[tuple[str, Values]]:
    """Settings up and down, for what depends on the side from which a setting is approached."""
    for name in easy:
        if first.factors[name].order != UP_DOWN and len(set(first.expand().column(name))) >= LEAST_LEVELS:
            yield f"{name} up and down", {"factors": _with(factors, [name], order=UP_DOWN)}


def _between(first: GeneralProcedure, factors: Mapping[str, Values]) -> Iterator[tuple[str, Values]]:
    """Settings between those of the first run, of each factor and of all easy ones."""
    found = {name: between(factor["levels"]) for name, factor in factors.items()}
    found = {name: levels for name, levels in found.items() if len(levels) >= LEAST_LEVELS - 1}
    easy = [name for name in found if not first.factors[name].hard]
    groups = [[name] for name in found] + ([easy] if len(easy) > 1 else [])
    points = len(first.expand()) // first.replications
    for names in groups:
        more = {name: {**factors[name], "levels": found[name]} for name in names}
        yield f"{' and '.join(names)} between the settings of the first run", {"factors": {**factors, **more}}
        if points * 2 ** len(names) <= MOST_POINTS:
            both = {
                name: {**one, "levels": sorted({*one["levels"], *factors[name]["levels"]})}
                for name, one in more.items()
            }
            what = f"{' and '.join(names)} at the settings of the first run and between them"
            yield what, {"factors": {**factors, **both}}


def _with(factors: Mapping[str, Values], names: Sequence[str], **changes: Any) -> dict[str, Values]:
    return {name: {**factor, **(changes if name in names else {})} for name, factor in factors.items()}


def between(levels: Sequence[float]) -> list[float]:
    """The middles between neighbouring levels."""
    ordered = sorted(levels)
    middles = ((low, high, (low + high) / 2.0) for low, high in itertools.pairwise(ordered))
    return [float(f"{middle:.12g}") for low, high, middle in middles if low < middle < high]
