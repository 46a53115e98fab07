"""Candidates that are left out and named: combinations of others, too large for computation, of no help, or outdone."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.outcome import Finding, remains

DEPENDENT = 1e-6
"""Minimum share of a column's length outside the columns before it; less is a combination of them and rounding."""
LARGEST = 1e75
"""Values beyond this have squares and products beyond the range of a double."""


Why = Literal["error", "rises", "dependent", "overflow", "shape"]

_WHY: dict[Why, str] = {
    "error": "it is significant (p {p:.2g}), but {error} is not smaller with it",
    "rises": "it is significant (p {p:.2g}), but the error of all strata is larger with it than without any effect",
    "dependent": "these data cannot distinguish it from effects in the model",
    "overflow": "its values are too large to be computed with",
    "shape": "it is doubtful, and a shape without a name, {error}, explains more than it does",
}


@dataclass(frozen=True)
class NotKept:
    """A candidate that was left out.

    Attributes:
        effect: its name.
        sensor: its sensor; None for all.
        why: "error" if the declared error is not smaller with it, "rises" if that of all strata is larger,
            "dependent" if its column is a combination of others, "overflow" if its values are too large for a double,
            "shape" if one without a name outdoes it.
        p: family-wise, beside the others; one if it was not judged.
        error: name of the error that is not smaller with it, or place of the shape; "" if not relevant.
        share: of the residual that it would explain, where it raises the error.
    """

    effect: str
    sensor: str | None
    why: Why
    p: float = 1.0
    error: str = ""
    share: float = 0.0

    @property
    def sentence(self) -> str:
        """A sentence about it."""
        return f"{self.effect} was left out: {_WHY[self.why].format(p=self.p, error=self.error)}"


def in_place_of(left_out: Iterable[NotKept], sensor: str | None = None) -> tuple[Finding, ...]:
    """What stands in place of effects that raise the error: something is there, and it is not what they are."""
    return tuple(
        remains(f"in the rows where {one.effect} would act, but with it the error rises", one.share)
        for one in left_out
        if one.why == "rises" and one.sensor in (None, sensor)
    )


def for_others(effect: str) -> str:
    """A sentence about an effect of several sensors that does not reduce the error of one of them."""
    return f"{effect} is kept because other sensors show it; the error of this one is not smaller with it"


def independent(columns: FloatArray) -> list[int]:
    """Indices of (n, q) columns that are not combinations of those before them, ascending."""
    basis, kept = np.zeros((len(columns), 0)), list[int]()
    for j, column in enumerate(columns.T):
        length = float(np.linalg.norm(column))
        left = column - basis @ (basis.T @ column)
        left -= basis @ (basis.T @ left)
        rest = float(np.linalg.norm(left))
        if rest > DEPENDENT * length:
            kept.append(j)
            basis = np.column_stack([basis, left / rest])
    return kept


def overflows(values: FloatArray) -> bool:
    """Whether values are too large to be squared and summed, or are NaN."""
    return not bool(np.all(np.abs(values) <= LARGEST))
