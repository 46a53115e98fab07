"""Smooth shapes in few numbers whose errors may be like those of their neighbours.

One number a whole plot, some twenty in all, do not carry a test of every shape by itself. Here each shape is a Gaussian
process of unknown size beside errors of unknown correlation, and what is asked is how much likelier the numbers are
with one of the shapes than with none (restricted likelihood, averaged over sizes and correlations). How large that
becomes by chance is simulated at chosen correlations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray

SIZES = 4.0 ** np.arange(-1, 5)
"""Variances of a shape that are tried, over that of an error."""
DRAWS = 4000
SCREEN = 1.0
"""Nats: below, chance does as well about every fifth time, and nothing is simulated."""
FIRST, COMMON = 200, 0.06
"""Draws that are looked at first; where chance does as well so often, no more are made."""
FEWEST = 3
"""Degrees of freedom."""


@dataclass(frozen=True, eq=False)
class Alike:
    """The numbers' errors at one correlation.

    Attributes:
        white: (d, m) that makes what the model leaves of them independent, of one variance.
        log_determinant: of their covariance there.
        root: (m, m) that makes such errors of independent ones.
        log_prior: how likely the correlation is beforehand, nats.

    """

    white: FloatArray
    log_determinant: float
    root: FloatArray
    log_prior: float


@dataclass(frozen=True)
class Shape:
    """The shape that a series follows.

    Attributes:
        at: index of the place.
        p: probability by chance of so much over all places, the largest over the correlations asked.
        p_independent: probability that independent errors without a shape look as correlated, or as much like one.
        share: of the sum of squares that the shape takes up.

    """

    at: int
    p: float
    p_independent: float
    share: float


@dataclass(frozen=True, eq=False)
class Shapes:
    """Places of one series.

    Attributes:
        alike: the errors at each correlation, independent ones first.
        columns: (m, q) of each place, of unit size all together, the rougher the smaller.

    """

    alike: tuple[Alike, ...]
    columns: tuple[FloatArray, ...]

    @cached_property
    def _parts(self) -> list[list[tuple[FloatArray, FloatArray]]]:
        """Directions and strengths of each place at each correlation."""
        out = []
        for one in self.alike:
            each = (np.linalg.svd(one.white @ columns, full_matrices=False) for columns in self.columns)
            out.append([(u, s**2) for u, s, _ in each])
        return out

    def evidence(self, series: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Nats by which series (N, m) are likelier than without any shape, however their errors are correlated.

        Returns:
            (N, places) with the shape of each place; (N,) without a shape, over those with independent errors.

        """
        white = [series @ one.white.T for one in self.alike]
        rss = [np.maximum(np.sum(z**2, axis=1), np.finfo(float).tiny) for z in white]
        each = zip(self.alike, rss, strict=True)
        without = np.stack([one.log_prior + self._log(one, r) for one, r in each])
        with_shape = np.full((len(self.columns), len(series)), -np.inf)
        for one, z, r, parts in zip(self.alike, white, rss, self._parts, strict=True):
            for a, (u, strength) in enumerate(parts):
                along = (z @ u) ** 2
                for size in SIZES:
                    grown = size * strength
                    rest = np.maximum(r - along @ (grown / (1.0 + grown)), 1e-9 * r)
                    log = self._log(one, rest) - 0.5 * float(np.sum(np.log1p(grown)))
                    with_shape[a] = np.logaddexp(with_shape[a], one.log_prior + log - np.log(SIZES.size))
        both = np.logaddexp.reduce(without, axis=0)
        return np.asarray((with_shape - both).T), np.asarray(both - without[0] + self.alike[0].log_prior)

    def clearest(self, series: FloatArray, correlated: Sequence[int], seed: int) -> Shape | None:
        """The place that a series (m,) follows most clearly; None where chance does as well or there is nothing.

        Args:
            series: of the model's residual.
            correlated: indices of the correlations at which chance is asked, besides independent errors.
            seed: of the simulation.

        """
        free = self.alike[0].white.shape[0]
        if not self.columns or free < FEWEST or not np.any(series):
            return None
        found, memory = self.evidence(series[None])
        total, either = _any(found)[0], _either(found, memory)[0]
        if max(total, either) < SCREEN:
            return None
        rng, p = np.random.default_rng(seed), []
        noise = rng.standard_normal((DRAWS, series.size))
        drawn, remembered = self.evidence(noise[:FIRST])
        if min(_rare(_any(drawn), total), _rare(_either(drawn, remembered), either)) > COMMON:
            return None
        for k in (0, *correlated):
            drawn, remembered = self.evidence(noise @ self.alike[k].root.T)
            p.append(_rare(_any(drawn), total))
            if k == 0:
                independent = _rare(_either(drawn, remembered), either)
        at = ties.highest(found[0])
        return Shape(at, max(p), independent, self._share(series, at))

    def _log(self, one: Alike, rss: FloatArray) -> FloatArray:
        return np.asarray(-0.5 * (one.white.shape[0] * np.log(rss) + one.log_determinant))

    def _share(self, series: FloatArray, at: int) -> float:
        """Part of a series' sum of squares that a place takes up at its likeliest size, errors independent."""
        z, (u, strength) = self.alike[0].white @ series, self._parts[0][at]
        rss, along, best = float(z @ z), (u.T @ z) ** 2, (-np.inf, 0.0)
        for size in SIZES:
            grown = size * strength
            held = float(along @ (grown / (1.0 + grown)))
            log = -0.5 * (z.size * np.log(max(rss - held, 1e-9 * rss)) + float(np.sum(np.log1p(grown))))
            best = max(best, (log, held / rss))
        return best[1]


def _any(evidence: FloatArray) -> FloatArray:
    """(N,) evidence for any of the places, each as likely beforehand."""
    return np.asarray(np.logaddexp.reduce(evidence, axis=1) - np.log(evidence.shape[1]))


def _either(evidence: FloatArray, memory: FloatArray) -> FloatArray:
    """(N,) evidence against independent errors, for correlated ones or a shape."""
    return np.asarray(memory + np.logaddexp(0.0, _any(evidence)))


def _rare(drawn: FloatArray, seen: float) -> float:
    return float((1 + np.sum(drawn >= seen)) / (1 + drawn.size))
