"""Physical signs of coefficients: a cause that significantly needs the other sign is not an explanation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray

SURE = 3.0
"""Standard errors on the wrong side of zero from which a coefficient is impossible; nearer it may be zero."""


@dataclass(frozen=True)
class Impossible:
    """A term whose coefficient has a physically impossible sign.

    Attributes:
        candidate: index of the term.
        value: its coefficient, in the term's unit.
        stderr: its standard error.
    """

    candidate: int
    value: float
    stderr: float


@dataclass(frozen=True)
class Refused:
    """A cause that fits, except for its required sign.

    Attributes:
        effect: its name in the catalogue.
        instead_of: the effect named in its place; "" if there is none.
        sensors: its sensors.
        quantity: name of the quantity that would be negative.
        value: of the quantity, below zero, in the unit of the term.
        stderr: standard error of that.
        size: value and standard error in the terms of people at the bench.
        otherwise: what a negative value would require; "" if nothing is known.
        largest: its largest plausible size, if it is refused for its size; otherwise "".
    """

    effect: str
    instead_of: str
    sensors: tuple[str, ...]
    quantity: str
    value: float
    stderr: float
    size: str
    otherwise: str
    largest: str = ""

    @property
    def sentence(self) -> str:
        """For a report."""
        if self.largest:
            return (
                f"{self.effect} in {', '.join(self.sensors)} would need a size of {self.size}, and no cause of that "
                f"name reaches more than {self.largest}: refused"
            )
        other = f". A negative value would take {self.otherwise}" if self.otherwise else ""
        return f"{self.effect} would need negative {self.quantity} ({self.size}): refused{other}"

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig trace --json`."""
        return {
            "effect": self.effect,
            "in_place_of": self.instead_of or None,
            "quantity": self.quantity,
            "value": self.value,
            "stderr": self.stderr,
            "largest": self.largest or None,
            "sentence": self.sentence,
        }


def impossible(gram: FloatArray, dot: FloatArray, terms: tuple[int, ...], signs: FloatArray) -> tuple[Impossible, ...]:
    """Terms whose coefficients, fitted together, certainly have the wrong sign.

    Args:
        gram: (J, J) products of the candidates' columns, in units of the error.
        dot: (J,) of these and the outputs.
        terms: the fitted ones.
        signs: (J,) of their coefficients; 0 if both are possible.
    """
    picked = list(terms)
    if not np.any(signs[picked]):
        return ()
    length = np.sqrt(np.maximum(np.diag(gram)[picked], np.finfo(float).tiny))
    spread = np.linalg.pinv(gram[picked][:, picked] / np.outer(length, length), rcond=1e-10)
    value = (spread @ (dot[picked] / length)) / length
    stderr = np.sqrt(np.maximum(np.diag(spread), 0.0)) / length
    return tuple(
        Impossible(j, float(v), float(e))
        for j, v, e in zip(picked, value, stderr, strict=True)
        if signs[j] * v < -SURE * e
    )


def refused(
    term: Any, found: Impossible, instead_of: str, slopes: Mapping[str, float], concerned: tuple[str, ...]
) -> Refused:
    """Report of a term that would need the wrong sign.

    Args:
        term: the candidate; it has `effect`, `term` and `sensor`.
        found: its coefficient.
        instead_of: the effect named in its place; "" for none.
        slopes: output per unit of the measured quantity, of every sensor, for `Entry.size`.
        concerned: its sensors.
    """
    signed, name = term.effect.signed, term.term.name
    sign = signed.of(name)
    value = sign * found.value
    size = term.effect.size({name: value}, slopes[concerned[0]], {name: found.stderr}, both=True)
    return Refused(
        effect=term.effect.name,
        instead_of=instead_of,
        sensors=concerned,
        quantity=signed.quantity,
        value=value,
        stderr=found.stderr,
        size=size,
        otherwise=signed.otherwise,
    )
