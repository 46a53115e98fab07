"""Whether the coefficient of a name is a constant: a right name predicts one part of the data from another.

The contribution of a name is multiplied by smooth functions of everything that was recorded, and of its own size.
Beside the model the residual follows such a product where the coefficient is larger at one end than at the other. With
a law that is right it does not. With one that only looks like the true law over the whole run it does, even where the
error of the law is too small to be seen as a shape of its own: these are few columns, at the place of the name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.doubts import CHANGES, not_constant
from rig.fitter.trace.flexible import Block, waves

ENDS = 2
"""Number of half waves over a variable: larger at one end, larger in the middle."""
OWN_SIZE = "from where the effect is small to where it is large"


@dataclass(frozen=True)
class Change:
    """A variable with which a coefficient changes.

    Attributes:
        over: in words: "with the temperature".
        p: probability by chance, over all variables that were tried.

    """

    over: str
    p: float


def products(contribution: FloatArray, variables: Mapping[str, FloatArray]) -> list[Block]:
    """The contribution (n,) of a name times smooth columns (n, m) of each variable, by its words, and of its size."""
    every = {**variables, OWN_SIZE: waves(contribution, ENDS)}
    made = ((over, contribution[:, None] * smooth) for over, smooth in every.items() if smooth.shape[1])
    return [Block(over, own, (own.shape[1],), np.ones(own.shape[1])) for over, own in made]


def change(found: Mapping[str, Sequence[float]]) -> Change | None:
    """The clearest change, from the probabilities by chance of each variable in one sensor or in several.

    Those of several sensors are combined by Fisher's method: a cause that changes does so in all that show it.
    """
    if not found:
        return None
    every = {over: float(special.chdtrc(2 * len(ps), -2.0 * sum(map(_log, ps)))) for over, ps in found.items()}
    over = min(every, key=lambda name: every[name])
    return Change(over, min(every[over] * len(every), 1.0))


def changing(found: Mapping[str, Change]) -> dict[str, str]:
    """Reasons for doubt about names whose coefficients are no constants, from the clearest change of each."""
    return {name: not_constant(one.over, one.p) for name, one in found.items() if one.p < CHANGES}


def _log(p: float) -> float:
    return float(np.log(max(p, np.finfo(float).tiny)))
