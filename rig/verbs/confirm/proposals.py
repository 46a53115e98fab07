"""Proposals for the further run with the best information per cost."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from rig.fitter.confirm import NOTHING, Pair
from rig.fitter.effects.entry import Entry
from rig.fitter.effects.manual_changes import Change
from rig.fitter.steps import steps
from rig.procedures.plan.further_runs import Variation, with_step
from rig.procedures.present.durations import duration
from rig.procedures.present.joined import some
from rig.verbs.confirm.choosing import STEP, best, groups_of
from rig.verbs.confirm.first import First
from rig.verbs.confirm.proposal import HARDLY, LIKELY, Proposal

CHANGED = 3
"""Number of the best kinds of runs that are also considered with a change by a person, besides those of the same bench.
"""


MANY = 12
"""Explanations of one effect from which on no run is planned for them while others are open. An effect near the noise
has so many; their pairs would outweigh every other question, and no run decides them.
"""


def planned(first: First) -> First:
    """The traced run with the questions for which further runs are planned; all if each has many explanations."""
    few = tuple(question for question in first.questions if len(question.members) <= MANY)
    return first if len(few) in (0, len(first.questions)) else replace(first, questions=few)


def consider(
    first: First,
    *,
    only: Callable[[Variation], bool] = lambda _: True,
    changes: bool = True,
    known: dict[tuple[str, int], Proposal] | None = None,
) -> tuple[Proposal, ...]:
    """The most informative run per cost of every kind; the best of all first.

    Runs with a change by a person are considered for the pairs that no setting of the bench separates.

    Args:
        first: the traced run.
        only: whether a variation is considered.
        changes: whether changes by a person are considered.
        known: the best run of each kind of runs, by its name and their number, of the same questions, where it was
            computed before; what is computed here is added.
    """
    known = {} if known is None else known
    first = planned(first)
    groups = {}
    for group in steps(groups_of(first, only), lambda group: group[0].what):
        key = group[0].what, len(group)
        known[key] = known[key] if key in known else best(first, group)
        groups[known[key]] = group
    proposals = ordered(groups)
    if not changes:
        return tuple(proposals)
    made = {change.word: change for one in inseparable(first, proposals) for change in changes_for(first, one.pair)}
    likely = [groups[proposal] for k, proposal in enumerate(proposals) if k < CHANGED or proposal.variation.untouched]
    for change in steps(list(made.values()), lambda change: change.word):
        proposals += [best(first, [with_step(variation, change) for variation in group]) for group in likely]
    return tuple(ordered(proposals))


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


def changes_for(first: First, pair: Pair) -> tuple[Change, ...]:
    """Changes by a person that have different influences on two explanations."""
    one, other = (_effect(first, name) for name in pair)
    known = {own.change.word: own.change for effect in (one, other) for own in effect.by_hand}
    return tuple(change for word, change in known.items() if one.influence(word) != other.influence(word))


def _effect(first: First, name: str) -> Entry:
    """The effect of an explanation; of several causes the last, in which they differ from those without it."""
    members = (member for question in first.questions for member in question.members)
    effect: Entry = next(member.terms[-1].effect for member in members if member.effect == name)
    return effect


def propose(considered: Sequence[Proposal]) -> tuple[Proposal, ...]:
    """The considered runs that may settle a question."""
    return tuple(proposal for proposal in considered if proposal.tells)


@dataclass(frozen=True)
class Inseparable:
    """Two explanations that no run of this bench separates as the bench stands.

    Attributes:
        effect: the effect found that both may be.
        pair: their names.
        sigmas: maximum expected standard errors between them in any run without a change by a person.
        would: the change that a person would have to make, in words.
        by_hand: what a person has to do in considered runs that may separate them.
    """

    effect: str
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
    pairs = {pair: s.effect for s in told for pair in s.chances if pair[1] != NOTHING}
    likeliest = {pair: max(s.chances[pair] for s in told if pair in s.chances) for pair in pairs}
    most = {pair: max(s.sigmas[pair] for s in told if pair in s.sigmas) for pair in pairs}
    return tuple(
        Inseparable(pairs[pair], pair, most[pair], _would(first, pair), _by_hand(considered, pair))
        for pair in pairs
        if likeliest[pair] < HARDLY
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


def unlikely(proposals: Sequence[Proposal]) -> str:
    """Why no proposed run is likely to settle all questions, in words; "" if one is."""
    if any(proposal.likely for proposal in proposals):
        return ""
    chances: dict[Pair, float] = {}
    for pair, chance in (told for p in proposals for s in p.separations for told in s.chances.items()):
        chances[pair] = max(chance, chances.get(pair, 0.0))
    never = [
        f"{one} and {'nothing' if other == NOTHING else other} (probability {chance:.0%} at most)"
        for (one, other), chance in chances.items()
        if chance < LIKELY
    ]
    why = f"none decides between {some(never, '; ')}" if never else "each of them leaves another question open"
    return f"no run of this bench is likely to settle everything: {why}"


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
