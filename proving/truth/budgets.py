"""Laboratories drawn at random: sources of error with what their certificates say, and measurements that err so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SHAPES = ("normal", "rectangular", "triangular", "arcsine")


@dataclass(frozen=True, eq=False)
class Laboratory:
    """Sources of error of m results.

    Attributes:
        sd: (p, m) signed displacement of the results for one standard deviation of each source.
        df: (p,) degrees of freedom with which that is known; infinite for a bounded source.
        shape: of each source.
        pair: correlated sources, or none; with infinite degrees of freedom, or the same number.
        r: correlation of the pair.
        scatter: (m, m) root of the covariance of repeated observations; none if there are none.
        scatter_df: of that covariance.

    """

    sd: Floats
    df: Floats
    shape: tuple[str, ...]
    pair: tuple[int, int] | None
    r: float
    scatter: Floats | None
    scatter_df: float

    @property
    def covariance(self) -> Floats:
        """(m, m) covariance of repeated observations."""
        return np.zeros((self.sd.shape[1],) * 2) if self.scatter is None else self.scatter @ self.scatter.T

    def errors(self, rng: np.random.Generator, count: int) -> Floats:
        """(count, m) errors of the results in so many measurements."""
        unit = np.stack([_drawn(shape, rng, count) for shape in self.shape], axis=1)
        if self.pair is not None:
            i, j = self.pair
            unit[:, j] = self.r * unit[:, i] + np.sqrt(1.0 - self.r**2) * unit[:, j]
        total: Floats = unit @ self.sd
        return total if self.scatter is None else total + rng.normal(size=total.shape) @ self.scatter.T

    def seen(self, rng: np.random.Generator, count: int) -> tuple[Floats, Floats]:
        """Factors between standard deviations as a laboratory knows them and as they are.

        Returns:
            (count, p) of the sources, and (count,) of repeated observations. Sources of a pair have one factor.
        """
        factors = np.ones((count, len(self.df)))
        for i, df in enumerate(self.df):
            if np.isfinite(df):
                factors[:, i] = np.sqrt(rng.chisquare(df, count) / df)
        if self.pair is not None:
            factors[:, self.pair[1]] = factors[:, self.pair[0]]
        return factors, np.sqrt(rng.chisquare(self.scatter_df, count) / self.scatter_df)


def laboratory(rng: np.random.Generator, shapes: Sequence[str] = SHAPES, results: int = 3) -> Laboratory:
    """Draw a laboratory: 2 to 9 sources of sizes within a factor of 30, in a unit of any size."""
    p, scale = int(rng.integers(2, 10)), 10.0 ** rng.uniform(-6, 6)
    size = scale * 10.0 ** rng.uniform(-1.0, 0.5, p)
    sd = size[:, None] * rng.normal(size=(p, results))
    shape = tuple(str(rng.choice(list(shapes))) if rng.random() < 0.6 else "normal" for _ in range(p))
    known = [shape[i] != "normal" or rng.random() < 0.5 for i in range(p)]
    df = np.array([np.inf if exact else rng.uniform(4.0, 60.0) for exact in known])
    normal = [i for i in range(p) if shape[i] == "normal"]
    pair = (normal[0], normal[1]) if len(normal) > 1 and rng.random() < 0.5 else None
    if pair is not None:
        df[pair[1]] = df[pair[0]]
    scatter = scale * rng.normal(size=(results, results)) if rng.random() < 0.8 else None
    return Laboratory(sd, df, shape, pair, float(rng.uniform(-0.9, 0.9)), scatter, float(rng.integers(5, 40)))


def _drawn(shape: str, rng: np.random.Generator, count: int) -> Floats:
    """Unit standard deviation."""
    turn = rng.random(count)
    if shape == "rectangular":
        return np.asarray(np.sqrt(12.0) * (turn - 0.5))
    if shape == "triangular":
        return np.asarray(np.sqrt(6.0) * (turn + rng.random(count) - 1.0))
    if shape == "arcsine":
        return np.asarray(np.sqrt(2.0) * np.cos(np.pi * turn))
    return rng.normal(size=count)
