"""How much noise rows share, estimated beside a model by restricted maximum likelihood on a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fitter.arrays import FloatArray
from procedures.general.trace.noise import BoolArray, Noise

_TINY = np.finfo(float).tiny
_MOST = 600.0
PLAUSIBLE = 3.84
"""Of twice the restricted log-likelihood: a covariance that is further behind the best is excluded at 5 %."""
_ALIKE = 1e-6
"""A column of which less is left beside the others adds nothing."""


@dataclass(frozen=True, eq=False)
class Beside:
    """What the grid's covariances say beside a model.

    Attributes:
        noise: the grid.
        n: rows.
        reml: (G,) restricted log-likelihood of each.
        ml: (G,) log-likelihood of each.
        sigma2: (G,) variance of one row, in the covariance's unit.

    """

    noise: Noise
    n: int
    reml: FloatArray
    ml: FloatArray
    sigma2: FloatArray

    @property
    def best(self) -> int:
        """The covariance that has most for it, the prior counted."""
        return self.best_of(np.ones(len(self.reml), np.bool_))

    def best_of(self, possible: BoolArray) -> int:
        """The same of those that are `possible` (G,)."""
        return int(np.argmax(np.where(possible, self.reml + np.log(self.noise.prior), -np.inf)))

    def slowest_of(self, possible: BoolArray) -> int:
        """Of those `possible` (G,) that data do not exclude at 5 % beside the best, the one with the longest memory."""
        kept = possible & (self.reml >= self.reml[possible].max() - 0.5 * PLAUSIBLE)
        return self.best_of(kept & (self.noise.memory == self.noise.memory[kept].max()))


def ratio(without: Beside, beside: Beside, possible: tuple[BoolArray, BoolArray], rank: int, df: int) -> float:
    """F that the likelihood ratio of `rank` columns amounts to; `df` are left beside them.

    Noise is fitted without the columns and beside them, each time among what is `possible` ((G,), (G,)). With
    independent errors it is the usual F. Below zero where the noise that is possible without is ahead.
    """
    gained = 2.0 * float(beside.ml[possible[1]].max() - without.ml[possible[0]].max()) / without.n
    return float(np.expm1(min(gained, _MOST)) if gained > 0.0 else gained) * df / rank


@dataclass(frozen=True, eq=False)
class Grid:
    """Response and model whitened by every covariance of the grid, to be asked about further columns.

    Attributes:
        noise: the grid.
        basis: (G, n, k) for each an orthonormal basis of the model's columns.
        left: (G, n) what the model leaves of the response.
        log_det_x: (G,) of the model's columns whitened.

    """

    noise: Noise
    basis: FloatArray
    left: FloatArray
    log_det_x: FloatArray

    @classmethod
    def of(cls, noise: Noise, y: FloatArray, model: FloatArray) -> Grid:
        """Whiten response (n,) and columns (n, k), already over each row's own sd."""
        white = noise.whiten(np.arange(len(noise.prior)), np.column_stack([model, y]))
        basis, det = _bases(white[:, :, :-1], np.linalg.norm(white[:, :, :-1], axis=1))
        return cls(noise, basis, _off(basis, white[:, :, -1:])[:, :, 0], det)

    def beside(self, extra: FloatArray | None = None) -> Beside:
        """Likelihoods beside the model and further columns (n, d), already over each row's own sd."""
        n, df = self.left.shape[1], self.left.shape[1] - self.basis.shape[2]
        rss, det_x = np.sum(self.left**2, axis=1), self.log_det_x
        if extra is not None and extra.shape[1]:
            white = self.noise.whiten(np.arange(len(self.left)), extra)
            units, det = _bases(_off(self.basis, white), np.linalg.norm(white, axis=1))
            rss = rss - np.sum(np.matmul(units.transpose(0, 2, 1), self.left[:, :, None])[:, :, 0] ** 2, axis=1)
            det_x, df = det_x + det, df - extra.shape[1]
        rss, df = np.maximum(rss, _TINY), max(df, 1)
        reml = -0.5 * (df * np.log(rss) + self.noise.log_det + det_x)
        ml = -0.5 * (n * np.log(rss) + self.noise.log_det)
        return Beside(self.noise, n, reml, ml, rss / df)


def _off(basis: FloatArray, columns: FloatArray) -> FloatArray:
    """(G, n, d) columns less what lies in the bases (G, n, k)."""
    return np.asarray(columns - np.matmul(basis, np.matmul(basis.transpose(0, 2, 1), columns)))


def _bases(columns: FloatArray, length: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(G, n, d) orthonormal bases of columns (G, n, d), zero for those that add nothing, and (G,) log |X'X|."""
    q, r = np.linalg.qr(columns / np.maximum(length, _TINY)[:, None, :])
    own = np.abs(np.diagonal(r, axis1=1, axis2=2))
    kept = own > _ALIKE
    det = 2.0 * np.sum(np.log(np.maximum(own, _ALIKE)) + np.log(np.maximum(length, _TINY)), axis=1)
    return q * kept[:, None, :], det
