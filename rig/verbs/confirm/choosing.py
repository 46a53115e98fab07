"""Choice among possible runs that differ in size and points only."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from rig.bench.bench_file import playing
from rig.drivers.roles import Chamber
from rig.fitter.confirm import Choice, Pair, Points, separation
from rig.fitter.quantiles import DISTINGUISHED, t_limit
from rig.procedures.kinds import kind_of
from rig.procedures.plan.further_runs import Variation, possible
from rig.verbs.confirm.first import First
from rig.verbs.confirm.proposal import Proposal

STEP = 0.05
"""Difference of probabilities, summed over all questions, that is no advantage; those above `SURE` are equal."""
MORE_SIGMAS = 0.15
"""Standard errors by which a longer run has to separate more than a shorter one."""
ABOUT = 0.05
"""Part by which times of runs may differ that are equally long."""
WORTH_A_FORECAST = 0.5
"""Standard errors below the limit by which a choice of points may fall short, and still be simulated."""


@dataclass(frozen=True, eq=False)
class OfPoints:
    """A run of chosen points.

    Attributes:
        whole: the run with all candidates.
        choice: the points, before exchanges.
        hours: about its bench time.
    """

    whole: Variation
    choice: Choice
    hours: float

    def variation(self, first: First) -> Variation:
        """The run, its points exchanged for better ones."""
        return first.confirming.chosen(self.whole, self.choice.better.units)


def groups_of(first: First, only: Callable[[Variation], bool] = lambda _: True) -> list[list[Variation]]:
    """Possible runs that differ in size only, from the smallest to the largest; `only` selects among them."""
    groups: dict[str, list[Variation]] = {}
    for variation in possible(_further_runs(first), first.bench.limits):
        if not only(variation) or not first.confirming.suits(variation, first.procedure, first.questions):
            continue
        standing = first.confirming.standing(variation)
        if first.most_h == math.inf or first.confirming.hours(standing, standing.run_list) <= first.most_h:
            groups.setdefault(variation.what, []).append(standing)
    return list(groups.values())


def best(first: First, group: Sequence[Variation]) -> Proposal:
    """The smallest sufficient run of a group; otherwise the most informative one that is worth its time."""
    chosen, hopeful = _of_chosen_points(first, group)
    tried = _bisected([partial(_proposal_of, first, run) for run in chosen], hopeful)
    settled = [proposal.hours for proposal in tried if proposal.settles(hopeful)]
    if settled:
        return _cheapest([proposal for proposal in tried if proposal.hours <= min(settled)])
    largest = _proposal(first, group[-1])
    if not tried or largest.told > max(proposal.told for proposal in tried) + STEP:
        worth = [proposal for proposal in tried if proposal.likely or proposal.hours <= _first_h(first)]
        most = max((proposal.points for proposal in worth), default=0)
        tried += _whole(first, [variation for variation in group[:-1] if len(variation.run_list) > most], largest)
    return _worth_its_time(first, [*tried, largest])


def _whole(first: First, group: Sequence[Variation], largest: Proposal) -> list[Proposal]:
    """Whole designs, from small to large, that may be worth their time: the shortest that tells as much as the largest,
    or as the largest which is no longer than the first run was if that is unlikely to settle everything.
    """
    if not largest.likely:
        most_h, kind = _first_h(first), first.confirming
        group = [one for one in group if kind.hours(one, one.run_list) <= most_h] or group[:1]
    known = [largest] if largest.likely else []
    return _bisected([*(partial(_proposal, first, one) for one in group), *(partial(_same, one) for one in known)])


def _same(known: Proposal) -> Proposal:
    return known


def _first_h(first: First) -> float:
    """Bench time of the first run, made again, and a little more, hours."""
    again = Variation("", first.procedure)
    return first.confirming.hours(again, again.run_list) * (1.0 + ABOUT)


def _worth_its_time(first: First, proposals: Sequence[Proposal]) -> Proposal:
    """The most informative run. One that is unlikely to settle everything may not be longer than the first run was.

    With more replications such a run excludes a few more causes, and leaves the question as it is.
    """
    most_h = _first_h(first)
    likely = [one for one in proposals if one.likely]
    short = likely or [one for one in proposals if one.hours <= most_h]
    return _cheapest(short or [min(proposals, key=lambda one: one.hours)])


def _bisected(runs: Sequence[Callable[[], Proposal]], pairs: frozenset[Pair] | None = None) -> list[Proposal]:
    """The longest of these runs, from short to long, and others that find the shortest which tells as much, or settles
    the pairs.

    A longer run tells more, so that a few forecasts are enough.
    """
    if not runs:
        return []
    tried = [runs[-1]()]
    low, high = 0, len(runs) - 1
    while low < high:
        middle = (low + high) // 2
        tried.append(runs[middle]())
        if tried[-1].told >= tried[0].told - STEP or (pairs is not None and tried[-1].settles(pairs)):
            high = middle
        else:
            low = middle + 1
    return tried


def _cheapest(proposals: Sequence[Proposal]) -> Proposal:
    """The cheapest of those that tell about as much as the best."""
    most = max(proposal.told for proposal in proposals)
    return min((p for p in proposals if p.told >= most - STEP), key=lambda proposal: proposal.cost_h)


def _of_chosen_points(first: First, group: Sequence[Variation]) -> tuple[list[OfPoints], frozenset[Pair] | None]:
    """The run with the points that separate best, from short to long, without those that are certainly too short.

    And the pairs that a run of the group can separate at all; None if that is unknown.
    """
    kind = first.confirming
    found: list[OfPoints] = []
    pairs: frozenset[Pair] | None = None
    most = max(len(variation.run_list) for variation in group)
    for times in kind.passes:
        whole = kind.whole(group, times)
        if whole is None:
            break
        run_list = whole.run_list
        ways = kind.ways(whole, run_list, first.questions, first.later_s)
        least = t_limit(DISTINGUISHED, ways[0].df) - WORTH_A_FORECAST
        points = Points.of([ways[0], ways[-1]][: len(ways)], first.questions, kind.units(run_list), most)
        pairs = points.pairs if pairs is None else pairs
        for one in points.choose(kind.counts, least):
            variation = kind.chosen(whole, one.units)
            hours = kind.hours(variation, variation.run_list)
            if hours <= first.most_h:
                found.append(OfPoints(whole, one, hours))
    most_sigmas, kept = 0.0, []
    for run in sorted(found, key=lambda run: run.hours):
        if run.choice.sigmas > most_sigmas + MORE_SIGMAS:  # a longer run with less separation is not worth a forecast
            most_sigmas = run.choice.sigmas
            kept.append(run)
    return kept, pairs


def _proposal_of(first: First, run: OfPoints) -> Proposal:
    return _proposal(first, run.variation(first))


def _proposal(first: First, variation: Variation) -> Proposal:
    kind, run, run_list = first.confirming, variation.procedure, variation.run_list
    both = kind.ways(variation, run_list, first.questions, first.later_s)
    expected = separation(both, first.questions)
    return Proposal(variation, expected, kind.hours(variation, run_list), kind.size(run), kind.mounting(run))


def _further_runs(first: First) -> Iterator[Variation]:
    chamber = bool(playing(first.bench, Chamber))
    return kind_of(first.procedure).further_runs(first.procedure, first.bench.limits, chamber=chamber)
