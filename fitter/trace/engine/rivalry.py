"""Rival explanations of an effect by noise, and its coefficient, as far as they forbid it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.engine.likelihood import Likelihoods
from rig.fitter.trace.engine.noise import BoolArray
from rig.fitter.trace.engine.problem import Problem
from rig.fitter.trace.engine.score import Scores, View
from rig.fitter.trace.signs import SURE

Rivalry = Literal["any", "fast", "slow"]
"""Kinds of rivals: the best-fitting noise, without an effect and with it; the same for noise of short memory; or, with
noise of short memory beside it, slow walks without it, as far as they are noise.
"""


@dataclass(frozen=True, eq=False)
class Trial:
    """One candidate beside those in the model.

    Attributes:
        y: (n,) the response with isolated outliers reduced.
        without: likelihoods of the covariances without the candidate.
        beside: likelihoods with it.
    """

    y: FloatArray
    without: Likelihoods
    beside: Likelihoods

    @property
    def gained(self) -> float:
        """Twice the logarithm of the likelihood ratio."""
        return 2.0 * float(self.beside.ml.max() - self.without.ml.max())

    @property
    def ahead(self) -> float:
        """Twice the log-likelihood ratio to slow walks, with noise of short memory beside it.

        Minus infinity if one of them is impossible.
        """
        slow = self.without.noise.slow
        if not np.any(slow) or np.all(slow):
            return -np.inf
        return 2.0 * float(self.beside.ml[~slow].max() - self.without.ml[slow].max())


def possible_of(problem: Problem, rival: Rivalry) -> tuple[BoolArray, BoolArray]:
    """(G,) covariances fitted without a candidate, and those fitted with it.

    A slow walk that is a drift itself is as valid an explanation as any effect in time: the more probable of the two is
    used. Only if the order of the rows is not declared, an effect has to be significant against it.
    """
    noise = problem.noise
    every = np.ones(len(noise.slow), np.bool_)
    soon, slow = ~noise.slow, noise.slow if problem.presumed else noise.slow & ~noise.drifting
    return {"any": (every, every), "fast": (soon, soon), "slow": (slow, soon)}[rival]


def possible(problem: Problem, view: View, y: FloatArray, chosen: Sequence[int], scores: Scores) -> BoolArray:
    """(J,) candidates whose coefficient beside those `chosen` has a possible sign and size, within three standard
    errors.

    Args:
        problem: the candidates.
        view: of it under one covariance.
        y: (n,) whitened response.
        chosen: candidates in the model.
        scores: of all candidates beside these.
    """
    taken = view.taken(chosen)
    rest = y - taken @ (taken.T @ y)
    along = (rest @ view.columns)[problem.start[:-1]]
    t = np.sqrt(np.maximum(scores.ratio, 0.0))
    gain, _ = view.gains(chosen, y)
    size = np.divide(gain, np.abs(along), out=np.zeros_like(gain), where=along != 0.0)
    small = size * (1.0 - SURE / np.maximum(t, SURE)) <= problem.most
    return np.asarray(small & ~((problem.signs * along < 0.0) & (t > SURE)))
