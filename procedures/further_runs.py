"""Further runs that may distinguish confounded effects: a procedure varied in one respect, from cheap to expensive.

Which of them does is for the fitter to say (`fitter.confirm.separation`); a kind says what a bench and a person can do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

Limits = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Variation:
    """A run that could be made.

    Attributes:
        what: what is done otherwise than in the first run, in words; variations with the same words differ in size.
        procedure: the run.
        turned: whether a person has to mount the package again first.
        warmer_degC: how much warmer the sensors will be.
        by_weather: whether nothing on the bench can make them so.

    """

    what: str
    procedure: Any
    turned: bool = False
    warmer_degC: float = 0.0
    by_weather: bool = False


def possible(every: Iterable[Variation], limits: Limits) -> Iterator[Variation]:
    """Those that stay within the limits of the bench, by quantity ("pitch_deg", "enclosure_degC")."""
    for variation in every:
        if next(variation.procedure.expand().beyond(limits), None) is None:
            yield variation
