"""Which further run would tell most for least."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from drivers.roles import Chamber
from fitter.confirm import NOTHING, Separation, separation
from fitter.effects import separate, separate_pressure
from procedures import PitchRollProcedure, WholePlotProcedure
from procedures.separating import Variation, variations
from rig.bench import playing
from rig.closed_loop.confirm.first import First
from rig.closed_loop.confirm.plans import hours, planned

ENOUGH = 6.0
"""Standard errors by which look-alikes should be expected to part: three tell them apart, luck takes up to three."""
USELESS = 3.0
"""So many will hardly tell anything apart."""
TURN_H = 0.5
"""What mounting the package anew costs beside bench time."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A run that could be made, and what it would tell.

    Attributes:
        variation: what is run.
        separations: expected, of every effect found.
        hours: of bench time.

    """

    variation: Variation
    separations: tuple[Separation, ...]
    hours: float

    @property
    def least(self) -> float:
        """Expected separation of the pair that would be nearest, in standard errors."""
        return min((s.least for s in self.separations), default=float("inf"))

    @property
    def parted(self) -> tuple[int, int]:
        """How many pairs of look-alikes it would part, and how many there are."""
        alike = [v for s in self.separations for (_, other), v in s.sigmas.items() if other != NOTHING]
        return sum(v >= ENOUGH for v in alike), len(alike)

    @property
    def nearest(self) -> float | None:
        """Expected separation of the nearest pair of look-alikes that it parts, in standard errors; None without."""
        every = (v for s in self.separations for (_, other), v in s.sigmas.items() if other != NOTHING)
        return min((v for v in every if v >= ENOUGH), default=None)

    @property
    def shown(self) -> float:
        """Expected separation from nothing of the explanation that would show least."""
        return min(v for s in self.separations for (_, other), v in s.sigmas.items() if other == NOTHING)

    @property
    def open_pairs(self) -> tuple[tuple[str, str], ...]:
        """Pairs that it would not part by enough."""
        return tuple(pair for s in self.separations for pair, v in s.sigmas.items() if v < ENOUGH)

    @property
    def rank(self) -> tuple[float, float]:
        """The best is the least: how many pairs it parts (half parted in proportion) comes before what it costs."""
        sigmas = [v for s in self.separations for v in s.sigmas.values()]
        told = sum(min(max(v - USELESS, 0.0) / (ENOUGH - USELESS), 1.0) for v in sigmas)
        return -round(told, 1), self.hours + TURN_H * self.variation.turned

    @property
    def size(self) -> str:
        """Points and replications, for a table."""
        run = self.variation.procedure
        if isinstance(run, WholePlotProcedure):
            plots = len(run.design.pairs()) * run.replications
            return f"{plots} whole plots x {len(run.design.pressures_psia) + len(run.design.repeated_psia)}"
        return f"{len(run.design.build())} x {run.replications}"

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        run = self.variation.procedure
        turned = isinstance(run, PitchRollProcedure) and run.mounting.turned
        return {
            "what": self.variation.what,
            "mounting": run.mounting.model_dump() if isinstance(run, PitchRollProcedure) and turned else None,
            "turn_the_package": self.variation.turned,
            "points": len(run.expand()),
            "hours": self.hours,
            "sigmas": [{"pair": list(pair), "sigmas": v} for s in self.separations for pair, v in s.sigmas.items()],
            "enough": self.least >= ENOUGH,
        }


def propose(first: First) -> tuple[Proposal, ...]:
    """Of every kind of run the one that would tell most for least; the best of all first."""
    chamber = bool(playing(first.bench, Chamber))
    best: dict[str, Proposal] = {}
    for variation in variations(first.procedure, first.bench.limits, chamber=chamber):
        known = best.get(variation.what)
        if known is not None and known.least >= ENOUGH:
            continue  # the smallest that is enough
        run_list = variation.procedure.expand()
        both = first.beside(planned(first, variation, run_list), first.later_s)
        proposal = Proposal(variation, separation(both, first.questions), hours(first, variation, run_list))
        if known is None or proposal.rank < known.rank:
            best[variation.what] = proposal
    return tuple(sorted(best.values(), key=lambda proposal: proposal.rank))


def otherwise(first: First, proposal: Proposal) -> Iterator[str]:
    """What else would tell apart the pairs of look-alikes that a proposal leaves, a sentence each."""
    members = {m.effect: m.terms[0].effect for q in first.questions for m in q.members}
    how = separate_pressure if isinstance(first.procedure, WholePlotProcedure) else separate
    for one, other in proposal.open_pairs:
        if other == NOTHING:
            yield f"it would hardly show whether {one} is there at all: it is small for so short a run"
        else:
            yield f"it would hardly tell {one} from {other}; this would: {how(members[one], members[other])}"
