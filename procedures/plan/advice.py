"""Recommendations for a procedure before its run, and whether it follows them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Advice:
    """One recommendation and its application to a procedure.

    Attributes:
        number: of the recommendation; 0 if it has none.
        recommendation: in short.
        holds: whether it is followed; true if it does not apply.
        sentence: the properties of this procedure, with numbers.
        applies: whether it concerns this procedure.
    """

    number: int
    recommendation: str
    holds: bool
    sentence: str
    applies: bool = True
