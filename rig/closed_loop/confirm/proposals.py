"""Proposals for the further run with the best information per cost."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from drivers.roles import Chamber
from fitter.confirm import NOTHING, Pair, Points, Separation, separation
from fitter.effects.entry import Entry
from fitter.effects.hands import Change
from fitter.quantiles import DISTINGUISHED, t_limit
from procedures.durations import duration
from procedures.further_runs import Variation, possible, with_step
from procedures.kind import kind_of
from rig.bench import playing
from rig.closed_loop.confirm.first import First

SURE = 0.95
"""Probability of excluding a false cause, or of showing a true one, from which a run is sufficient."""
LIKELY = 0.5
"""Below this probability a run is unlikely to settle a question, and does not come first for it, whatever its
duration.
"""
HARDLY = 0.2
"""Below this probability a run is not worth its duration."""
STEP = 0.05
"""Difference of probabilities, summed over all questions, that is no advantage; those above `SURE` are equal."""
PERSON_H = 0.5
"""Cost of a person at the bench, to mount the package again or for a change by hand, in addition to bench time, hours.
"""
CHANGED = 3
"""Number of the best kinds of runs that are also considered with a change by a person, besides those of the same bench.
"""
MORE_SIGMAS = 0.15
"""Standard errors by which a longer run has to separate more than a shorter one."""
WORTH_A_FORECAST = 0.5
"""Standard errors below the limit by which a choice of points may fall short, and still be simulated."""


class Weakest(NamedTuple):
    """The question that is least likely to be settled.

    Attributes:
        chance: probability of settling it.
        sigmas: expected standard errors.
    """

    chance: float
    sigmas: float


@dataclass(frozen=True, eq=False)
class Proposal:
    """A possible run and its expected results.

    Attributes:
        variation: the run.
        separations: expected separations, for every effect found.
        hours: bench time.
        size: points and replications, for a table.
        mounting: orientation of the package, degrees about each axis; None for the usual one.
    """

    variation: Variation
    separations: tuple[Separation, ...]
    hours: float
    size: str
    mounting: Mapping[str, float] | None

    @property
    def enough(self) -> bool:
        """Whether it will very likely settle all questions."""
        return all(chance >= SURE for s in self.separations for chance in s.chances.values())

    def settles(self, pairs: frozenset[Pair] | None) -> bool:
        """Whether it will very likely settle these questions; all for None."""
        if pairs is None:
            return self.enough
        return all(chance >= SURE for s in self.separations for pair, chance in s.chances.items() if pair in pairs)

    @property
    def points(self) -> int:
        """Number of its points."""
        return len(self.variation.procedure.expand())

    @property
    def separated(self) -> tuple[int, int]:
        """Number of pairs of explanations that it very likely separates, and number of all pairs."""
        alike = [s.chances[pair] for s, pair in self._alike]
        return sum(chance >= SURE for chance in alike), len(alike)

    @property
    def nearest(self) -> Weakest | None:
        """The pair of explanations that it is least likely to separate; None if no effect has two."""
        return min((Weakest(s.chances[pair], s.sigmas[pair]) for s, pair in self._alike), default=None)

    @property
    def shown(self) -> Weakest:
        """The explanation that it is least likely to show."""
        nothing = ((s, pair) for s in self.separations for pair in s.sigmas if pair[1] == NOTHING)
        return min(Weakest(s.chances[pair], s.sigmas[pair]) for s, pair in nothing)

    @property
    def tells(self) -> bool:
        """Whether it may settle any open question: a pair of explanations, or an effect with only one."""
        return any(
            chance >= HARDLY
            for s in self.separations
            for pair, chance in s.chances.items()
            if pair[1] != NOTHING or len(s.chances) == 1
        )

    @property
    def open_pairs(self) -> tuple[tuple[str, str], ...]:
        """Pairs that it may fail to separate."""
        return tuple(pair for s in self.separations for pair, chance in s.chances.items() if chance < SURE)

    @property
    def likely(self) -> bool:
        """Whether settling all questions has a probability of at least one half."""
        return self.least.chance >= LIKELY

    @property
    def least(self) -> Weakest:
        """The question that it is least likely to settle."""
        return self.shown if self.nearest is None else min(self.shown, self.nearest)

    @property
    def told(self) -> float:
        """Sum of the probabilities of settling a question, over all questions; above `SURE` they are equal."""
        return sum(min(chance, SURE) for s in self.separations for chance in s.chances.values())

    @property
    def worth(self) -> float:
        """The same without questions that are unlikely to be settled."""
        chances = [min(chance, SURE) for s in self.separations for chance in s.chances.values()]
        return sum(chance for chance in chances if chance >= LIKELY)

    @property
    def cost_h(self) -> float:
        """Cost: hours of bench time and of a person."""
        return self.hours + PERSON_H * self.variation.person

    @property
    def _alike(self) -> list[tuple[Separation, Pair]]:
        return [(s, pair) for s in self.separations for pair in s.sigmas if pair[1] != NOTHING]

    def to_json(self) -> dict[str, Any]:
        """Values for `--json`."""
        return {
            "what": self.variation.what,
            "mounting": None if self.mounting is None else dict(self.mounting),
            "turn_the_package": self.variation.turned,
            "by_hand": [step.table() for step in self.variation.steps],
            "person_hours": PERSON_H * self.variation.person,
            "points": self.points,
            "hours": self.hours,
            "sigmas": [
                {
                    "pair": list(pair),
                    "sigmas": sigmas,
                    "interval_90": list(s.intervals[pair]),
                    "chance": s.chances[pair],
                }
                for s in self.separations
                for pair, sigmas in s.sigmas.items()
            ],
            "enough": self.enough,
            "likely": self.likely,
        }


def consider(first: First, choice: type[Points] | None = Points) -> tuple[Proposal, ...]:
    """The most informative run per cost of every kind; the best of all first.

    Runs with a change by a person are considered for the pairs that no setting of the bench separates.

    Args:
        first: the traced run.
        choice: how the points of runs are chosen; None for whole designs only.
    """
    groups = _groups(_further_runs(first), first)
    best = {id(proposal): (proposal, group) for proposal, group in ((_best(first, g, choice), g) for g in groups)}
    proposals = ordered(proposal for proposal, _ in best.values())
    changes = {change.word: change for one in inseparable(first, proposals) for change in changes_for(first, one.pair)}
    in_order = [best[id(proposal)][1] for proposal in proposals]
    changed = [group for k, group in enumerate(in_order) if k < CHANGED or _untouched(group[0])]
    for change in changes.values():
        proposals += [_best(first, [with_step(variation, change) for variation in group], choice) for group in changed]
    return tuple(ordered(proposals))


def _groups(every: Iterable[Variation], first: First) -> list[list[Variation]]:
    """Possible runs that differ in size only, from the smallest to the largest."""
    groups: dict[str, list[Variation]] = {}
    for variation in possible(every, first.bench.limits):
        groups.setdefault(variation.what, []).append(variation)
    return list(groups.values())


def _untouched(variation: Variation) -> bool:
    """Whether a run changes nothing but points and their order."""
    return not (variation.turned or variation.warmer_degC or variation.by_weather)


def _best(first: First, group: Sequence[Variation], choice: type[Points] | None) -> Proposal:
    """The smallest sufficient run of a group; otherwise the most informative one."""
    chosen, hopeful = _of_chosen_points(first, group, choice)
    tried = _bisected(first, chosen, hopeful)
    settled = [proposal.hours for proposal in tried if proposal.settles(hopeful)]
    if settled:
        return _cheapest([proposal for proposal in tried if proposal.hours <= min(settled)])
    largest = _proposal(first, group[-1])
    if not tried or largest.told > max(proposal.told for proposal in tried) + STEP:
        most = max((proposal.points for proposal in tried), default=0)
        for variation in group[:-1]:
            if len(variation.procedure.expand()) > most:
                tried.append(_proposal(first, variation))
                if tried[-1].settles(hopeful):
                    break
    return _cheapest([*tried, largest])


def _bisected(first: First, runs: Sequence[Variation], pairs: frozenset[Pair] | None) -> list[Proposal]:
    """The longest of these runs, from short to long, and others that find the shortest which tells as much or settles.

    A longer run tells more, so that a few forecasts are enough.
    """
    if not runs:
        return []
    tried = [_proposal(first, runs[-1])]
    low, high = 0, len(runs) - 1
    while low < high:
        middle = (low + high) // 2
        tried.append(_proposal(first, runs[middle]))
        if tried[-1].settles(pairs) or tried[-1].told >= tried[0].told - STEP:
            high = middle
        else:
            low = middle + 1
    return tried


def _cheapest(proposals: Sequence[Proposal]) -> Proposal:
    """The cheapest of those that tell about as much as the best."""
    most = max(proposal.told for proposal in proposals)
    return min((p for p in proposals if p.told >= most - STEP), key=lambda proposal: proposal.cost_h)


def ordered(proposals: Iterable[Proposal]) -> list[Proposal]:
    """The best first, over all kinds of runs.

    Runs that are unlikely to succeed have no worth. Of runs that are worth about as much, one without a change by a
    person is better, then the cheaper one.
    """
    proposals = list(proposals)
    most = max((proposal.worth for proposal in proposals), default=0.0)

    def place(proposal: Proposal) -> tuple[int, bool, float, float]:
        less = int((most - proposal.worth) / STEP)
        return less, bool(proposal.variation.steps), proposal.cost_h, -proposal.told

    return sorted(proposals, key=place)


def _of_chosen_points(
    first: First, group: Sequence[Variation], choice: type[Points] | None
) -> tuple[list[Variation], frozenset[Pair] | None]:
    """The run with the points that separate best, from short to long, without those that are certainly too short.

    And the pairs that a run of the group can separate at all; None if that is unknown.
    """
    kind = first.confirming
    found: list[tuple[float, float, Variation]] = []
    pairs: frozenset[Pair] | None = None
    most = max(len(variation.procedure.expand()) for variation in group)
    for times in kind.passes:
        whole = kind.whole(group, times)
        if whole is None or choice is None:
            break
        run_list = whole.procedure.expand()
        ways = kind.ways(whole, run_list, first.questions, first.later_s)
        least = t_limit(DISTINGUISHED, ways[0].df) - WORTH_A_FORECAST
        points = choice.of([ways[0], ways[-1]][: len(ways)], first.questions, kind.units(run_list), most)
        pairs = points.pairs if pairs is None else pairs
        for one in points.choose(kind.counts, least):
            variation = kind.chosen(whole, one.units)
            found.append((kind.hours(variation, variation.procedure.expand()), one.sigmas, variation))
    best, kept = 0.0, []
    for _, sigmas, variation in sorted(found, key=lambda one: one[0]):
        if sigmas > best + MORE_SIGMAS:  # a longer run with less separation is not worth a forecast
            best = sigmas
            kept.append(variation)
    return kept, pairs


def _proposal(first: First, variation: Variation) -> Proposal:
    kind, run = first.confirming, variation.procedure
    run_list = run.expand()
    both = kind.ways(variation, run_list, first.questions, first.later_s)
    expected = separation(both, first.questions)
    return Proposal(variation, expected, kind.hours(variation, run_list), kind.size(run), kind.mounting(run))


def changes_for(first: First, pair: Pair) -> tuple[Change, ...]:
    """Changes by a person that have different influences on two explanations."""
    one, other = (_effect(first, name) for name in pair)
    known = {own.change.word: own.change for effect in (one, other) for own in effect.by_hand}
    return tuple(change for word, change in known.items() if one.influence(word) != other.influence(word))


def _effect(first: First, name: str) -> Entry:
    members = (member for question in first.questions for member in question.members)
    effect: Entry = next(member.terms[0].effect for member in members if member.effect == name)
    return effect


def _further_runs(first: First) -> Iterator[Variation]:
    chamber = bool(playing(first.bench, Chamber))
    return kind_of(first.procedure).further_runs(first.procedure, first.bench.limits, chamber=chamber)


def propose(considered: Sequence[Proposal]) -> tuple[Proposal, ...]:
    """The considered runs that may settle a question."""
    return tuple(proposal for proposal in considered if proposal.tells)


@dataclass(frozen=True)
class Inseparable:
    """Two explanations that no run of this bench separates as the bench stands.

    Attributes:
        pair: their names.
        sigmas: maximum expected standard errors between them in any run without a change by a person.
        would: the change that a person would have to make, in words.
        by_hand: what a person has to do in considered runs that may separate them.
    """

    pair: Pair
    sigmas: float
    would: str
    by_hand: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Values for `--json`."""
        pair, by_hand = list(self.pair), list(self.by_hand)
        return {"pair": pair, "most_sigmas": self.sigmas, "would": self.would, "by_hand": by_hand}


def inseparable(first: First, considered: Sequence[Proposal]) -> tuple[Inseparable, ...]:
    """Pairs of explanations that no considered run is likely to separate without a change by a person."""
    told = [s for proposal in considered if not proposal.variation.steps for s in proposal.separations]
    pairs = dict.fromkeys(pair for s in told for pair in s.chances if pair[1] != NOTHING)
    best = {pair: max(s.chances[pair] for s in told if pair in s.chances) for pair in pairs}
    most = {pair: max(s.sigmas[pair] for s in told if pair in s.sigmas) for pair in pairs}
    return tuple(
        Inseparable(pair, most[pair], _would(first, pair), _by_hand(considered, pair))
        for pair in pairs
        if best[pair] < HARDLY
    )


def _by_hand(considered: Sequence[Proposal], pair: Pair) -> tuple[str, ...]:
    """Instructions for a person in the runs that may separate a pair."""
    says = (
        step.change.say
        for proposal in considered
        for step in proposal.variation.steps
        if any(s.chances.get(pair, 0.0) >= HARDLY for s in proposal.separations)
    )
    return tuple(dict.fromkeys(says))


def otherwise(first: First, proposal: Proposal, never: Sequence[Inseparable] = ()) -> Iterator[str]:
    """Other ways to separate the pairs of explanations that a proposal may leave, one sentence each.

    Args:
        first: the traced run.
        proposal: the proposed run.
        never: pairs already reported as not separable on this bench.
    """
    if not proposal.likely:
        least = proposal.least
        yield (
            f"it is UNLIKELY to settle everything: probability {least.chance:.0%} for its most difficult question, and "
            f"{duration(3600.0 * proposal.hours)} of bench time"
        )
    chances = {pair: chance for s in proposal.separations for pair, chance in s.chances.items()}
    if first.confirming.caution and any(other != NOTHING for _, other in chances):
        yield first.confirming.caution
    for pair in proposal.open_pairs:
        if pair in (one.pair for one in never):
            continue
        one, other = pair
        chance = f"a probability of {chances[pair]:.0%}"
        if other == NOTHING:
            yield f"it has {chance} of showing whether {one} exists: it is small for such a short run"
        else:
            yield f"it has {chance} of distinguishing {one} from {other}; this would: {_would(first, pair)}"


def _would(first: First, pair: Pair) -> str:
    return first.confirming.separated_by(*(_effect(first, name) for name in pair))
