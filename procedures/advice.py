"""Advice on a procedure before it is run: what is recommended, and what holds of it here."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Advice:
    """One recommendation and what holds of it here.

    Attributes:
        number: of the recommendation; 0 where it has none.
        recommendation: in short.
        holds: whether it is followed; true where it does not apply.
        sentence: what this procedure does, with numbers.
        applies: whether it concerns this procedure at all.

    """

    number: int
    recommendation: str
    holds: bool
    sentence: str
    applies: bool = True
