"""What an effect is held against: the noise that explains a table in its place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fitter.arrays import FloatArray
from procedures.general.trace.likelihood import Beside
from procedures.general.trace.noise import BoolArray
from procedures.general.trace.problem import Problem

Rivalry = Literal["any", "fast", "slow"]
"""The noise that fits best, without an effect and beside it; the same of noise that forgets soon; or, with noise that
forgets soon beside it, slow wanders without it, as far as they are noise."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One candidate beside those in the model.

    Attributes:
        y: (n,) the response, readings that stand alone brought back.
        without: the candidate, what the covariances say.
        beside: it.

    """

    y: FloatArray
    without: Beside
    beside: Beside

    @property
    def gained(self) -> float:
        """Twice the logarithm of the likelihood ratio."""
        return 2.0 * float(self.beside.ml.max() - self.without.ml.max())

    @property
    def ahead(self) -> float:
        """Twice the log-likelihood by which it is ahead of slow wanders, with noise that forgets soon beside it.

        Minus infinity where there are not both.
        """
        slow = self.without.noise.slow
        if not np.any(slow) or np.all(slow):
            return -np.inf
        return 2.0 * float(self.beside.ml[~slow].max() - self.without.ml[slow].max())


def possible_of(problem: Problem, rival: Rivalry) -> tuple[BoolArray, BoolArray]:
    """(G,) covariances that are fitted without a candidate, and those that are fitted beside it.

    A slow wander that is a drift itself is as much an answer as any effect in time: of the two the more probable one
    holds. Only where the order of the rows is not declared does an effect have to be shown against it.
    """
    noise = problem.noise
    every = np.ones(len(noise.slow), np.bool_)
    soon, slow = ~noise.slow, noise.slow if problem.presumed else noise.slow & ~noise.drifting
    return {"any": (every, every), "fast": (soon, soon), "slow": (slow, soon)}[rival]
