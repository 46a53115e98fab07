"""Which further run would tell most for least."""

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
"""Probability of excluding the cause that is not true, or of showing the one that is, from which a run is enough."""
LIKELY = 0.5
"""Below this a run is unlikely to settle a thing, and does not come first for it, however many hours it takes."""
HARDLY = 0.2
"""Below this a run tells nothing worth its hours."""
TURN_H = 0.5
"""What mounting the package again costs beside bench time."""


class Weakest(NamedTuple):
    """What is least likely to be settled.

    Attributes:
        chance: probability that it is.
        sigmas: expected standard errors.

    """

    chance: float
    sigmas: float


@dataclass(frozen=True, eq=False)
class Proposal:
    """A run that could be made, and what it would tell.

    Attributes:
        variation: what is run.
        separations: expected, of every effect found.
        hours: of bench time.
        size: points and replications, for a table.
        mounting: how the package is turned, deg about each axis; None where it is as usual.

    """

    variation: Variation
    separations: tuple[Separation, ...]
    hours: float
    size: str
    mounting: Mapping[str, float] | None

    @property
    def enough(self) -> bool:
        """Whether it will very likely settle everything."""
        return all(chance >= SURE for s in self.separations for chance in s.chances.values())

    @property
    def separated(self) -> tuple[int, int]:
        """How many pairs of explanations it will very likely separate, and how many there are."""
        alike = [s.chances[pair] for s, pair in self._alike]
        return sum(chance >= SURE for chance in alike), len(alike)

    @property
    def nearest(self) -> Weakest | None:
        """The pair of explanations that it is least likely to separate; None where no effect has two."""
        return min((Weakest(s.chances[pair], s.sigmas[pair]) for s, pair in self._alike), default=None)

    @property
    def shown(self) -> Weakest:
        """The explanation that it is least likely to show."""
        nothing = ((s, pair) for s in self.separations for pair in s.sigmas if pair[1] == NOTHING)
        return min(Weakest(s.chances[pair], s.sigmas[pair]) for s, pair in nothing)

    @property
    def tells(self) -> bool:
        """Whether it may settle anything that is open: a pair of explanations, or an effect that has but one."""
        return any(
            chance >= HARDLY
            for s in self.separations
            for pair, chance in s.chances.items()
            if pair[1] != NOTHING or len(s.chances) == 1
        )

    @property
    def open_pairs(self) -> tuple[tuple[str, str], ...]:
        """Pairs that it may well not separate."""
        return tuple(pair for s in self.separations for pair, chance in s.chances.items() if chance < SURE)

    @property
    def likely(self) -> bool:
        """Whether it is as likely as not to settle everything."""
        return self.least.chance >= LIKELY

    @property
    def least(self) -> Weakest:
        """What it is least likely to settle."""
        return self.shown if self.nearest is None else min(self.shown, self.nearest)

    @property
    def rank(self) -> tuple[float, float]:
        """The best of its kind is the least: how many pairs it will separate comes before what it costs."""
        told = sum(chance for s in self.separations for chance in s.chances.values())
        return -round(told, 1), self.cost_h

    @property
    def place(self) -> tuple[float, float, float]:
        """The best of all kinds is the least: chances that a run is unlikely to be right by are worth no hours."""
        chances = [chance for s in self.separations for chance in s.chances.values()]
        fair = sum(chance for chance in chances if chance >= LIKELY)
        return -round(fair, 1), self.cost_h, -sum(chances)

    @property
    def cost_h(self) -> float:
        """Hours of bench time, and of a person's."""
        return self.hours + TURN_H * self.variation.turned

    @property
    def _alike(self) -> list[tuple[Separation, Pair]]:
        return [(s, pair) for s in self.separations for pair in s.sigmas if pair[1] != NOTHING]

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
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
    """Of every kind of run the one that would tell most for least; the best of all first."""
    kind, best = first.confirming, dict[str, Proposal]()
    for variation in possible(_further_runs(first), first.bench.limits):
        known = best.get(variation.what)
        if known is not None and known.enough:
            continue  # the smallest that is enough
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
    """Those of the runs considered that may settle something."""
    return tuple(proposal for proposal in considered if proposal.tells)


@dataclass(frozen=True)
class Inseparable:
    """Two explanations that no run of this bench separates.

    Attributes:
        pair: their names.
        sigmas: the most standard errors that any run is expected to bring between them.
        would: what a person would have to change, in words.

    """

    pair: Pair
    sigmas: float
    would: str

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {"pair": list(self.pair), "most_sigmas": self.sigmas, "would": self.would}


def inseparable(first: First, considered: Sequence[Proposal]) -> tuple[Inseparable, ...]:
    """Pairs of explanations that none of the runs considered has a fair chance to separate."""
    told = [s for proposal in considered for s in proposal.separations]
    pairs = dict.fromkeys(pair for s in told for pair in s.chances if pair[1] != NOTHING)
    best = {pair: max(s.chances[pair] for s in told if pair in s.chances) for pair in pairs}
    most = {pair: max(s.sigmas[pair] for s in told if pair in s.sigmas) for pair in pairs}
    return tuple(Inseparable(pair, most[pair], _would(first, pair)) for pair in pairs if best[pair] < HARDLY)


def otherwise(first: First, proposal: Proposal, never: Sequence[Inseparable] = ()) -> Iterator[str]:
    """What else would separate the pairs of explanations that a proposal may leave, a sentence each.

    Args:
        first: the run that was traced.
        proposal: what would be run.
        never: pairs of which it has been said that no run of this bench separates them.

    """
    if not proposal.likely:
        least = proposal.least
        yield (
            f"it is UNLIKELY to settle everything: a chance of {least.chance:.0%} for what it settles least, and "
            f"{duration(3600.0 * proposal.hours)} of bench time"
        )
    chances = {pair: chance for s in proposal.separations for pair, chance in s.chances.items()}
    if first.confirming.caution and any(other != NOTHING for _, other in chances):
        yield first.confirming.caution
    for pair in proposal.open_pairs:
        if pair in (one.pair for one in never):
            continue
        one, other = pair
        chance = f"a chance of {chances[pair]:.0%}"
        if other == NOTHING:
            yield f"it has {chance} of showing whether {one} is there at all: it is small for so short a run"
        else:
            yield f"it has {chance} of telling {one} from {other}; this would: {_would(first, pair)}"


def _would(first: First, pair: Pair) -> str:
    members = {m.effect: m.terms[0].effect for q in first.questions for m in q.members}
    return first.confirming.separated_by(members[pair[0]], members[pair[1]])
