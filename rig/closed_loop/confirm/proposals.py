"""Proposals for the further run with the best information per cost."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from drivers.roles import Chamber
from fitter.confirm import NOTHING, Pair, Separation, separation
from procedures.durations import duration
from procedures.further_runs import Variation, possible
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
TURN_H = 0.5
"""Cost of mounting the package again, in addition to bench time, hours."""


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
    def rank(self) -> tuple[float, float]:
        """Sort key within a kind of run, smallest is best: number of separated pairs first, then cost."""
        told = sum(chance for s in self.separations for chance in s.chances.values())
        return -round(told, 1), self.cost_h

    @property
    def place(self) -> tuple[float, float, float]:
        """Sort key over all kinds, smallest is best: runs that are unlikely to succeed have no worth."""
        chances = [chance for s in self.separations for chance in s.chances.values()]
        fair = sum(chance for chance in chances if chance >= LIKELY)
        return -round(fair, 1), self.cost_h, -sum(chances)

    @property
    def cost_h(self) -> float:
        """Cost: hours of bench time and of a person."""
        return self.hours + TURN_H * self.variation.turned

    @property
    def _alike(self) -> list[tuple[Separation, Pair]]:
        return [(s, pair) for s in self.separations for pair in s.sigmas if pair[1] != NOTHING]

    def to_json(self) -> dict[str, Any]:
        """Values for `--json`."""
        run = self.variation.procedure
        return {
            "what": self.variation.what,
            "mounting": None if self.mounting is None else dict(self.mounting),
            "turn_the_package": self.variation.turned,
            "points": len(run.expand()),
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


def consider(first: First) -> tuple[Proposal, ...]:
    """The most informative run per cost of every kind; the best of all first."""
    kind, best = first.confirming, dict[str, Proposal]()
    for variation in possible(_further_runs(first), first.bench.limits):
        known = best.get(variation.what)
        if known is not None and known.enough:
            continue  # the smallest sufficient run
        run_list = variation.procedure.expand()
        both = kind.ways(variation, run_list, first.questions, first.later_s)
        run = variation.procedure
        proposal = Proposal(
            variation,
            separation(both, first.questions),
            kind.hours(variation, run_list),
            kind.size(run),
            kind.mounting(run),
        )
        if known is None or proposal.rank < known.rank:
            best[variation.what] = proposal
    return tuple(sorted(best.values(), key=lambda proposal: proposal.place))


def _further_runs(first: First) -> Iterator[Variation]:
    chamber = bool(playing(first.bench, Chamber))
    return kind_of(first.procedure).further_runs(first.procedure, first.bench.limits, chamber=chamber)


def propose(considered: Sequence[Proposal]) -> tuple[Proposal, ...]:
    """The considered runs that may settle a question."""
    return tuple(proposal for proposal in considered if proposal.tells)


@dataclass(frozen=True)
class Inseparable:
    """Two explanations that no run of this bench separates.

    Attributes:
        pair: their names.
        sigmas: maximum expected standard errors between them in any run.
        would: the change that a person would have to make, in words.
    """

    pair: Pair
    sigmas: float
    would: str

    def to_json(self) -> dict[str, Any]:
        """Values for `--json`."""
        return {"pair": list(self.pair), "most_sigmas": self.sigmas, "would": self.would}


def inseparable(first: First, considered: Sequence[Proposal]) -> tuple[Inseparable, ...]:
    """Pairs of explanations that no considered run is likely to separate."""
    told = [s for proposal in considered for s in proposal.separations]
    pairs = dict.fromkeys(pair for s in told for pair in s.chances if pair[1] != NOTHING)
    best = {pair: max(s.chances[pair] for s in told if pair in s.chances) for pair in pairs}
    most = {pair: max(s.sigmas[pair] for s in told if pair in s.sigmas) for pair in pairs}
    return tuple(Inseparable(pair, most[pair], _would(first, pair)) for pair in pairs if best[pair] < HARDLY)


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
    members = {m.effect: m.terms[0].effect for q in first.questions for m in q.members}
    return first.confirming.separated_by(members[pair[0]], members[pair[1]])
