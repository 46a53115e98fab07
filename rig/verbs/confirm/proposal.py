"""A possible run, its expected results and its cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from rig.fitter.confirm import NOTHING, Pair, Separation
from rig.procedures.plan.further_runs import Variation

SURE = 0.95
"""Probability of excluding a false cause, or of showing a true one, from which a run is sufficient."""
LIKELY = 0.5
"""Below this probability a run is unlikely to settle a question, and does not come first for it, whatever its
duration.
"""
HARDLY = 0.2
"""Below this probability a run is not worth its duration."""
PERSON_H = 0.5
"""Cost of a person at the bench, to mount the package again or for a change by hand, in addition to bench time, hours.
"""


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
        """Worth of the proposal without questions that are unlikely to be settled."""
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
