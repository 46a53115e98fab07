"""What an effect is held against: the noise that explains a table in its place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fitter.arrays import FloatArray
from fitter.trace.tables.likelihood import Beside
from fitter.trace.tables.noise import BoolArray, Noise

Rivalry = Literal["any", "fast", "slow"]
"""The noise that fits best, without an effect and beside it; the same of noise that forgets soon; or, with noise that
forgets soon beside it, slow wanders without it."""


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


def possible_of(noise: Noise, rival: Rivalry) -> tuple[BoolArray, BoolArray]:
    """(G,) covariances that are fitted without a candidate, and those that are fitted beside it."""
    every = np.ones(len(noise.slow), np.bool_)
    return {"any": (every, every), "fast": (~noise.slow, ~noise.slow), "slow": (noise.slow, ~noise.slow)}[rival]
