"""Common noise of rows, estimated with a model by restricted maximum likelihood on a grid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fitter.arrays import FloatArray
from procedures.general.trace.noise import BoolArray, Noise

_TINY = np.finfo(float).tiny
_MOST = 600.0
PLAUSIBLE = 3.84
"""Difference of twice the restricted log-likelihood at which a covariance is excluded at 5 %."""
_ALIKE = 1e-6
"""Minimum remaining share of a column beside the others."""


@dataclass(frozen=True, eq=False)
class Beside:
    """Likelihoods of the grid's covariances with a model.

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
        """The most probable covariance, with the prior."""
        return self.best_of(np.ones(len(self.reml), np.bool_))

    def best_of(self, possible: BoolArray) -> int:
        """The same among those that are `possible` (G,)."""
        return int(np.argmax(np.where(possible, self.reml + np.log(self.noise.prior), -np.inf)))

    def slowest_of(self, possible: BoolArray) -> int:
        """Among those `possible` (G,) that are not excluded at 5 % relative to the best, the one with the longest
        memory.
        """
        kept = possible & (self.reml >= self.reml[possible].max() - 0.5 * PLAUSIBLE)
        return self.best_of(kept & (self.noise.memory == self.noise.memory[kept].max()))


def ratio(without: Beside, beside: Beside, possible: tuple[BoolArray, BoolArray], rank: int, df: int) -> float:
    """F equivalent to the likelihood ratio of `rank` columns, with `df` degrees of freedom left.

    Noise is fitted without and with the columns, each time among `possible` ((G,), (G,)). With independent errors it is
    the usual F. It is negative if the noise without the columns fits better.
    """
    gained = 2.0 * float(beside.ml[possible[1]].max() - without.ml[possible[0]].max()) / without.n
    return float(np.expm1(min(gained, _MOST)) if gained > 0.0 else gained) * df / rank


@dataclass(frozen=True, eq=False)
class Grid:
    """Response and model whitened by every covariance of the grid, for tests of further columns.

    Attributes:
        noise: the grid.
        basis: (G, n, k) for each an orthonormal basis of the model's columns.
        left: (G, n) residual of the response after the model.
        log_det_x: (G,) of the model's columns whitened.
    """

    noise: Noise
    basis: FloatArray
    left: FloatArray
    log_det_x: FloatArray

    @classmethod
    def of(cls, noise: Noise, y: FloatArray, model: FloatArray) -> Grid:
        """Whiten response (n,) and columns (n, k), which are already divided by each row's own sd."""
        white = noise.whiten(np.arange(len(noise.prior)), model)
        basis, det = _bases(white, np.linalg.norm(white, axis=1))
        return cls(noise, basis, np.empty(0), det).of_response(y)

    def of_response(self, y: FloatArray) -> Grid:
        """The same of another response."""
        white = self.noise.whiten(np.arange(len(self.basis)), y[:, None])
        return replace(self, left=_off(self.basis, white)[:, :, 0])

    def beside(self, extra: FloatArray | None = None) -> Beside:
        """Likelihoods with the model and further columns (n, d), which are already divided by each row's own sd."""
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
    """(G, n, d) columns minus their projection on the bases (G, n, k)."""
    return np.asarray(columns - np.matmul(basis, np.matmul(basis.transpose(0, 2, 1), columns)))


def _bases(columns: FloatArray, length: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(G, n, d) orthonormal bases of columns (G, n, d), zero for dependent ones, and (G,) log |X'X|."""
    columns = columns / np.maximum(length, _TINY)[:, None, :]
    if columns.shape[2] == 1:  # most calls
        r = np.linalg.norm(columns, axis=1)[:, :, None]
        q = columns / np.maximum(r, _TINY)
    else:
        q, r = np.linalg.qr(columns)
    own = np.abs(np.diagonal(r, axis1=1, axis2=2))
    kept = own > _ALIKE
    det = 2.0 * np.sum(np.log(np.maximum(own, _ALIKE)) + np.log(np.maximum(length, _TINY)), axis=1)
    return q * kept[:, None, :], det
