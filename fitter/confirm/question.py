"""What a trace leaves open: for every effect it found, the explanations its data could not tell apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from fitter.trace.found import Explanation, Found


class Judged(Protocol):
    """What was found in one sensor."""

    @property
    def effects(self) -> Sequence[Found]:
        """Largest share first."""


class Traced(Protocol):
    """What was found in a run of any kind."""

    @property
    def sensors(self) -> Mapping[str, Judged]:
        """By column name."""

    @property
    def chosen(self) -> Sequence[Any]:
        """Terms in the model."""

    @property
    def explanations(self) -> Mapping[str, Sequence[Explanation]]:
        """All of them for each effect found."""


@dataclass(frozen=True)
class Hypothesis:
    """One member of a class.

    Attributes:
        effect: name in the catalogue.
        terms: its terms, on the sensors they concern.
        sigmas: standard errors by which it falls behind the best in the run that was traced.

    """

    effect: str
    terms: tuple[Any, ...]
    sigmas: float


@dataclass(frozen=True, eq=False)
class Question:
    """An effect that was found, and what else it may be.

    Attributes:
        members: explanations the data of the run cannot tell apart, the one it named first.
        terms: of the effect as it was named, in the model of the run.
        rest: terms of the other effects found; they stay in the model.

    """

    members: tuple[Hypothesis, ...]
    terms: tuple[Any, ...]
    rest: tuple[Any, ...]

    @property
    def effect(self) -> str:
        """The one that was named."""
        return self.members[0].effect


def questions_of(found: Traced) -> tuple[Question, ...]:
    """One for every effect that was found, in the order of its size."""
    shares: dict[str, float] = {}
    for sensor in found.sensors.values():
        for effect in sensor.effects:
            if effect.stratum != "noise":
                shares[effect.effect] = max(effect.share, shares.get(effect.effect, 0.0))
    asked = []
    for name in sorted(shares, key=lambda effect: -shares[effect]):
        alike = [
            Hypothesis(e.effect, e.terms, e.sigmas) for e in found.explanations[name] if e.alias or e.effect == name
        ]
        alike.sort(key=lambda member: (member.effect != name, member.sigmas))
        own = tuple(c for c in found.chosen if c.effect.name == name)
        asked.append(Question(tuple(alike), own, tuple(c for c in found.chosen if c.effect.name != name)))
    return tuple(asked)
