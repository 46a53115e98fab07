"""Open questions of a trace: for every effect found, the explanations that its data cannot distinguish."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from rig.fitter import ties
from rig.fitter.quantiles import DISTINGUISHED, t_limit
from rig.fitter.trace.found import Explanation
from rig.fitter.trace.outcome import Finding

CLEARLY = 0.99993666
"""Probability of four standard errors (`rig.fitter.trace.aliases.NEARLY`), for a known error."""


class Judged(Protocol):
    """Findings of a trace in one sensor."""

    @property
    def effects(self) -> Sequence[Finding]:
        """Largest share first."""


class Traced(Protocol):
    """Findings of a trace of any kind of run."""

    @property
    def sensors(self) -> Mapping[str, Judged]:
        """By column name."""

    @property
    def chosen(self) -> Sequence[Any]:
        """Terms in the model."""

    @property
    def explanations(self) -> Mapping[str, Sequence[Explanation]]:
        """All explanations of each effect found."""


@dataclass(frozen=True)
class Hypothesis:
    """One member of a class of explanations.

    Attributes:
        effect: name in the catalogue; of several causes together their names.
        terms: its terms, on the sensors they concern.
        sigmas: standard errors by which it is worse than the best in the traced run.
        near: whether the traced run excludes it, but barely: further data have to exclude it more clearly.
        several: names of the causes, if they are several together.
        last: terms of the last of them; in forecasts it has a notable share.
    """

    effect: str
    terms: tuple[Any, ...]
    sigmas: float
    near: bool = False
    several: tuple[str, ...] = ()
    last: tuple[Any, ...] = ()

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of its causes."""
        return self.several or (self.effect,)

    def limit(self, df: float) -> float:
        """Standard errors behind the best by which it is excluded; `df` degrees of freedom of the error."""
        return t_limit(CLEARLY if self.near else DISTINGUISHED, df)

    def has(self, other: Hypothesis) -> bool:
        """Whether all causes of another are among its own, with the same terms."""
        mine = {id(term) for term in self.terms}
        return all(id(term) in mine for term in other.terms)

    def beside(self, other: Hypothesis) -> Hypothesis:
        """Both together."""
        causes = (*self.causes, *other.causes)
        terms, sigmas = (*self.terms, *other.terms), min(self.sigmas, other.sigmas)
        return Hypothesis(" with ".join(causes), terms, sigmas, several=causes, last=other.terms)


@dataclass(frozen=True, eq=False)
class Question:
    """An effect that was found, and its alternatives.

    Attributes:
        members: explanations that the run's data cannot distinguish, the named one first; and those barely excluded.
        terms: of the named effect, in the model of the run.
        rest: terms of the other effects found; they stay in the model.
    """

    members: tuple[Hypothesis, ...]
    terms: tuple[Any, ...]
    rest: tuple[Any, ...]

    @property
    def effect(self) -> str:
        """The named explanation."""
        return self.members[0].effect


def questions_of(found: Traced) -> tuple[Question, ...]:
    """One question for every effect found, in order of size."""
    shares: dict[str, float] = {}
    for sensor in found.sensors.values():
        for effect in sensor.effects:
            if effect.stratum != "noise":
                shares[effect.effect] = max(effect.share, shares.get(effect.effect, 0.0))
    asked = []
    for name in ties.ordered(shares, key=lambda effect: -shares[effect], unit=1.0):
        alike = [
            Hypothesis(e.effect, e.terms, e.sigmas, near=e.near)
            for e in found.explanations[name]
            if e.alias or e.near or e.effect == name
        ]
        alike.sort(key=lambda member: (member.effect != name, member.sigmas))
        own = tuple(c for c in found.chosen if c.effect.name == name)
        asked.append(Question(tuple(alike), own, tuple(c for c in found.chosen if c.effect.name != name)))
    return tuple(asked)
