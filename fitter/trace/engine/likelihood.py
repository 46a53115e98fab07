"""Common noise of rows, estimated with a model by restricted maximum likelihood on a grid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.engine.noise import BoolArray, Noise

_TINY = np.finfo(float).tiny
_MOST = 600.0
PLAUSIBLE = 3.84
"""Difference of twice the restricted log-likelihood at which a covariance is excluded at 5 %."""
_ALIKE = 1e-6
"""Minimum remaining share of a column beside the others."""


@dataclass(frozen=True, eq=False)
class Likelihoods:
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


def ratio(
    without: Likelihoods, beside: Likelihoods, possible: tuple[BoolArray, BoolArray], rank: int, df: int
) -> float:
    """F equivalent to the likelihood ratio of `rank` columns, with `df` degrees of freedom left.

    Noise is fitted without and with the columns, each time among `possible` ((G,), (G,)). With independent errors it is
    the usual F. It is negative if the noise without the columns fits better.
    """
    gained = 2.0 * float(beside.ml[possible[1]].max() - without.ml[possible[0]].max()) / without.n
    return float(np.expm1(min(gained, _MOST)) if gained > 0.0 else gained) * df / rank


@dataclass(frozen=True, eq=False)
class Grid:
    """Response and model whitened by every covariance of the grid, for tests of columns further or fewer.

    Attributes:
        noise: the grid.
        basis: (G, n, k) for each an orthonormal basis of the model's columns.
        triangle: (G, k, k) these columns, each over its length, in that basis.
        log_length: (G, k) logarithms of these lengths.
        along: (G, k) parts of the response along the basis.
        left: (G, n) residual of the response after the model.
    """

    noise: Noise
    basis: FloatArray
    triangle: FloatArray
    log_length: FloatArray
    along: FloatArray
    left: FloatArray

    @classmethod
    def of(cls, noise: Noise, y: FloatArray, model: FloatArray) -> Grid:
        """Whiten response (n,) and columns (n, k), which are already divided by each row's own sd."""
        white = noise.whiten(np.arange(len(noise.prior)), model)
        basis, triangle, log_length = _bases(white, np.linalg.norm(white, axis=1))
        return cls(noise, basis, triangle, log_length, np.empty(0), np.empty(0)).of_response(y)

    def of_response(self, y: FloatArray) -> Grid:
        """The same of another response."""
        white = self.noise.whiten(np.arange(len(self.basis)), y[:, None])
        along = np.matmul(self.basis.transpose(0, 2, 1), white)
        left = white - np.matmul(self.basis, along)
        return replace(self, along=along[:, :, 0], left=left[:, :, 0])

    def beside(self, extra: FloatArray | None = None) -> Likelihoods:
        """Likelihoods with the model and further columns (n, d), which are already divided by each row's own sd."""
        rss, det_x, k = np.sum(self.left**2, axis=1), self._log_det_x, self.basis.shape[2]
        if extra is not None and extra.shape[1]:
            white = self.noise.whiten(np.arange(len(self.left)), extra)
            units, triangle, log_length = _bases(_off(self.basis, white), np.linalg.norm(white, axis=1))
            rss = rss - np.sum(np.matmul(units.transpose(0, 2, 1), self.left[:, :, None])[:, :, 0] ** 2, axis=1)
            det_x, k = det_x + _log_det(triangle, log_length), k + extra.shape[1]
        return self._beside(rss, det_x, k)

    def each(self, extra: FloatArray) -> FloatArray:
        """(G, d) restricted log-likelihood with each of further columns (n, d) by itself, as `beside` has it."""
        white = self.noise.whiten(np.arange(len(self.left)), extra)
        length = np.maximum(np.linalg.norm(white, axis=1), _TINY)
        units = _off(self.basis, white) / length[:, None, :]
        size = np.sum(units**2, axis=1)
        along = np.matmul(self.left[:, None], units)[:, 0]
        kept = size > _ALIKE**2
        fall = np.divide(along**2, size, out=np.zeros_like(size), where=kept)
        n, k = self.left.shape[1], self.basis.shape[2] + 1
        rss = np.maximum(np.sum(self.left**2, axis=1)[:, None] - fall, _TINY)
        det_x = self._log_det_x[:, None] + np.log(np.maximum(size, _ALIKE**2)) + 2.0 * np.log(length)
        return np.asarray(-0.5 * (max(n - k, 1) * np.log(rss) + self.noise.log_det[:, None] + det_x))

    def without(self, taken: IntArray) -> Likelihoods | None:
        """Likelihoods without some of the model's columns; None where these depend on each other.

        What a column adds is along its dual, which is orthogonal to all others: a column of the inverse triangle.
        """
        k = self.basis.shape[2]
        if np.any(np.abs(np.diagonal(self.triangle, axis1=1, axis2=2)) <= _ALIKE):
            return None
        picked = np.broadcast_to(np.eye(k)[:, taken], (len(self.left), k, len(taken)))
        added, size = np.linalg.qr(np.linalg.solve(self.triangle.transpose(0, 2, 1), picked))
        rss = np.sum(self.left**2, axis=1) + np.sum(np.matmul(self.along[:, None], added)[:, 0] ** 2, axis=1)
        return self._beside(rss, self._log_det_x + _log_det(size, -self.log_length[:, taken]), k - len(taken))

    def with_columns(self, extra: FloatArray) -> Grid:
        """The same with further columns (n, d) in the model, which are already divided by each row's own sd."""
        white = self.noise.whiten(np.arange(len(self.left)), extra)
        length, across = np.linalg.norm(white, axis=1), np.zeros((len(white), self.basis.shape[2], extra.shape[1]))
        for _ in range(2):
            part = np.matmul(self.basis.transpose(0, 2, 1), white)
            white, across = white - np.matmul(self.basis, part), across + part
        units, corner, log_length = _bases(white, length)
        upper = np.concatenate([self.triangle, across / np.maximum(length, _TINY)[:, None, :]], axis=2)
        lower = np.concatenate([np.zeros_like(across.transpose(0, 2, 1)), corner], axis=2)
        along = np.matmul(units.transpose(0, 2, 1), self.left[:, :, None])
        return replace(
            self,
            basis=np.concatenate([self.basis, units], axis=2),
            triangle=np.concatenate([upper, lower], axis=1),
            log_length=np.concatenate([self.log_length, log_length], axis=1),
            along=np.concatenate([self.along, along[:, :, 0]], axis=1),
            left=self.left - np.matmul(units, along)[:, :, 0],
        )

    @property
    def _log_det_x(self) -> FloatArray:
        """(G,) of the model's columns whitened."""
        return _log_det(self.triangle, self.log_length)

    def _beside(self, rss: FloatArray, det_x: FloatArray, k: int) -> Likelihoods:
        n = self.left.shape[1]
        rss, df = np.maximum(rss, _TINY), max(n - k, 1)
        reml = -0.5 * (df * np.log(rss) + self.noise.log_det + det_x)
        ml = -0.5 * (n * np.log(rss) + self.noise.log_det)
        return Likelihoods(self.noise, n, reml, ml, rss / df)


def _off(basis: FloatArray, columns: FloatArray) -> FloatArray:
    """(G, n, d) columns minus their projection on the bases (G, n, k)."""
    return np.asarray(columns - np.matmul(basis, np.matmul(basis.transpose(0, 2, 1), columns)))


def _bases(columns: FloatArray, length: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(G, n, d) orthonormal bases of columns (G, n, d), zero for dependent ones; (G, d, d) triangles of columns over
    their lengths (G, d); and (G, d) logarithms of these.
    """
    columns = columns / np.maximum(length, _TINY)[:, None, :]
    if columns.shape[2] == 1:  # most calls
        r = np.linalg.norm(columns, axis=1)[:, :, None]
        q = columns / np.maximum(r, _TINY)
    else:
        q, r = np.linalg.qr(columns)
    kept = np.abs(np.diagonal(r, axis1=1, axis2=2)) > _ALIKE
    return q * kept[:, None, :], r, np.log(np.maximum(length, _TINY))


def _log_det(triangle: FloatArray, log_length: FloatArray) -> FloatArray:
    """(G,) logarithm of the determinant of products of columns, by their triangle (G, d, d) over their lengths."""
    own = np.abs(np.diagonal(triangle, axis1=1, axis2=2))
    return np.asarray(2.0 * np.sum(np.log(np.maximum(own, _ALIKE)) + log_length, axis=1))
