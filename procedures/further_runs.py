"""Further runs that may distinguish confounded effects: a procedure varied in one respect, from cheap to expensive.

The fitter computes their separation (`fitter.confirm.separation`); a kind gives the possible variations.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

Limits = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Variation:
    """A possible run.

    Attributes:
        what: its difference from the first run, in words; variations with the same words differ in size.
        procedure: the run.
        turned: whether a person has to mount the package again first.
        warmer_degC: temperature increase of the sensors, degrees Celsius.
        by_weather: whether no instrument on the bench can set this temperature.
    """

    what: str
    procedure: Any
    turned: bool = False
    warmer_degC: float = 0.0
    by_weather: bool = False


def possible(every: Iterable[Variation], limits: Limits) -> Iterator[Variation]:
    """The variations within the limits of the bench, by quantity ("pitch_deg", "enclosure_degC")."""
    for variation in every:
        if next(variation.procedure.expand().beyond(limits), None) is None:
            yield variation
