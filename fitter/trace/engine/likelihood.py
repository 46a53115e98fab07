"""Common noise of rows, estimated with a model by restricted maximum likelihood on a grid."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.engine.noise import BoolArray, Noise
from rig.fitter.trace.engine.white import White

_TINY = np.finfo(float).tiny
_MOST = 600.0
PLAUSIBLE = 3.84
"""Difference of twice the restricted log-likelihood at which a covariance is excluded at 5 %."""
_ALIKE = 1e-6
"""Minimum remaining share of a column beside the others."""
AT_ONCE = 4_000_000
"""Numbers of simulated responses, whitened, that are held at once."""


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
        return ties.highest(np.where(possible, self.reml + np.log(self.noise.prior), -np.inf))

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
    """Products of response and model under every covariance of the grid, for tests of columns further or fewer.

    Columns are first made orthonormal, and the response is taken beside them, in the rows' own metric. So products lose
    no digits but those by which covariances differ from it.

    Attributes:
        noise: the grid.
        basis: (n, k) orthonormal, of the model's columns.
        triangle: (k, k') these columns in that basis; fewer than k' where they depend on each other.
        along: (k,) the response in that basis.
        left: (n,) its residual.
        white: the basis, and
        white_left: the residual whitened.
        root: (G, k, k) lower triangle that makes the basis orthonormal in each metric.
        across: (G, k) the residual along it then.
        rss: (G,) residual sum of squares beside it.
    """

    noise: Noise
    basis: FloatArray
    triangle: FloatArray
    along: FloatArray
    left: FloatArray
    white: White
    white_left: White
    root: FloatArray
    across: FloatArray
    rss: FloatArray

    @classmethod
    def of(cls, noise: Noise, y: FloatArray, model: FloatArray) -> Grid:
        """Response (n,) and columns (n, k), which are already divided by each row's own sd."""
        basis, triangle = _beyond(np.empty((len(y), 0)), model)
        white = noise.white(_every(noise), basis)
        none = np.empty(0)
        known = cls(noise, basis, triangle, none, none, white, white, _root(white.products(white)), none, none)
        return known.of_response(y)

    def of_response(self, y: FloatArray) -> Grid:
        """The same of another response."""
        along = self.basis.T @ y
        return self._of_left(along, y - self.basis @ along)

    def beside(self, extra: FloatArray | None = None) -> Likelihoods:
        """Likelihoods with the model and further columns (n, d), which are already divided by each row's own sd."""
        rss, det_x, k = self.rss, self._log_det_x, self.basis.shape[1]
        if extra is not None and extra.shape[1]:
            own, triangle = _beyond(self.basis, extra)
            white = self.noise.white(_every(self.noise), own)
            corner, along = self._apart(white)
            root = _root(corner)
            rss = rss - np.sum(np.matmul(root, along[:, :, None])[:, :, 0] ** 2, axis=1)
            det_x, k = det_x + _log_det(root) + _log_size(triangle), k + own.shape[1]
        return self._beside(rss, det_x, k)

    def each(self, extra: FloatArray) -> FloatArray:
        """(G, d) restricted log-likelihood with each of further columns (n, d) by itself, as `beside` has it."""
        length = np.maximum(np.linalg.norm(extra, axis=0), _TINY)
        units = extra / length
        for _ in range(2):
            units = units - self.basis @ (self.basis.T @ units)
        share = np.linalg.norm(units, axis=0)
        kept = share > _ALIKE
        white = self.noise.white(_every(self.noise), units * np.where(kept, 1.0 / np.maximum(share, _TINY), 0.0))
        along = self._along(white)
        size = np.maximum(white.squares() - np.sum(along**2, axis=1), _TINY)
        dots = white.products(self.white_left)[:, :, 0] - np.einsum("gkd,gk->gd", along, self.across)
        fall = np.where(kept, dots**2 / size, 0.0)
        n, k = self.left.size, self.basis.shape[1] + 1
        rss = np.maximum(self.rss[:, None] - fall, _TINY)
        det_x = self._log_det_x[:, None] + np.where(kept, np.log(size), 0.0) + 2.0 * np.log(np.where(kept, share, 1.0))
        det_x = det_x + 2.0 * np.log(length)
        return np.asarray(-0.5 * (max(n - k, 1) * np.log(rss) + self.noise.log_det[:, None] + det_x))

    def without(self, taken: IntArray) -> Likelihoods | None:
        """Likelihoods without some of the model's columns; None where these depend on each other.

        What a column adds is along its dual, which is orthogonal to all others: a row of the inverse triangle.
        """
        k, width = self.triangle.shape
        if k < width:
            return None
        dual = np.linalg.solve(self.triangle.T, np.eye(k)[:, taken])  # (k, t)
        own = np.matmul(self.root, dual)
        root = _root(np.matmul(own.mT, own))
        added = np.einsum("gkt,gk->gt", own, self.across) + self.along @ dual
        rss = self.rss + np.sum(np.matmul(root, added[:, :, None])[:, :, 0] ** 2, axis=1)
        return self._beside(rss, self._log_det_x + _log_det(root), k - len(taken))

    def with_columns(self, extra: FloatArray) -> Grid:
        """The same with further columns (n, d) in the model, which are already divided by each row's own sd."""
        own, corner = _beyond(self.basis, extra)
        white = self.noise.white(_every(self.noise), own)
        along, (k, d) = self._along(white), (self.basis.shape[1], own.shape[1])
        root = np.zeros((len(self.root), k + d, k + d))
        root[:, :k, :k], root[:, k:, k:] = self.root, _root(white.products(white) - np.matmul(along.mT, along))
        root[:, k:, :k] = -np.matmul(root[:, k:, k:], np.matmul(along.mT, self.root))
        upper = np.hstack([self.triangle, self.basis.T @ extra])
        lower = np.hstack([np.zeros((d, self.triangle.shape[1])), corner])
        wider = replace(
            self,
            basis=np.hstack([self.basis, own]),
            triangle=np.vstack([upper, lower]),
            white=self.white.beside(white),
            root=root,
        )
        taken = own.T @ self.left
        return wider._of_left(np.concatenate([self.along, taken]), self.left - own @ taken)

    def _of_left(self, along: FloatArray, left: FloatArray) -> Grid:
        white = self.noise.white(_every(self.noise), left[:, None])
        across = self._along(white)[:, :, 0]
        rss = white.squares()[:, 0] - np.sum(across**2, axis=1)
        return replace(self, along=along, left=left, white_left=white, across=across, rss=rss)

    def _apart(self, white: White) -> tuple[FloatArray, FloatArray]:
        """(G, d, d) products of further columns beside the model, and (G, d) these with the response."""
        along = self._along(white)
        corner = white.products(white) - np.matmul(along.mT, along)
        return corner, white.products(self.white_left)[:, :, 0] - np.einsum("gkd,gk->gd", along, self.across)

    def _along(self, white: White) -> FloatArray:
        """(G, k, d) further columns along the basis, orthonormal in each metric."""
        return np.asarray(np.matmul(self.root, self.white.products(white)))

    @cached_property
    def _log_det_x(self) -> FloatArray:
        """(G,) of the model's columns whitened."""
        return _log_det(self.root) + _log_size(self.triangle)

    def _beside(self, rss: FloatArray, det_x: FloatArray, k: int) -> Likelihoods:
        n = self.left.size
        rss, df = np.maximum(rss, _TINY), max(n - k, 1)
        reml = -0.5 * (df * np.log(rss) + self.noise.log_det + det_x)
        ml = -0.5 * (n * np.log(rss) + self.noise.log_det)
        return Likelihoods(self.noise, n, reml, ml, rss / df)


def deviances(noise: Noise, which: IntArray, model: FloatArray, drawn: FloatArray) -> FloatArray:
    """(len(which), m) minus twice the log-likelihood of responses (n, m) under covariances, with a model (n, k)."""
    basis, _ = _beyond(np.empty((len(model), 0)), model)
    left = drawn - basis @ (basis.T @ drawn)
    out = np.empty((len(which), drawn.shape[1]))
    at_once = max(AT_ONCE // left.size, 1)
    for first in range(0, len(which), at_once):
        some = which[first : first + at_once]
        white, own = noise.white(some, left), noise.white(some, basis)
        along = np.matmul(_root(own.products(own)), own.products(white))
        rss = np.maximum(white.squares() - np.sum(along**2, axis=1), _TINY)
        out[first : first + at_once] = len(model) * np.log(rss) + noise.log_det[some, None]
    return out


def _every(noise: Noise) -> IntArray:
    return np.arange(len(noise.prior))


def _beyond(basis: FloatArray, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, r) orthonormal, what columns (n, d) have beyond a basis (n, k), and (r, d) these in it.

    A column that the others replace adds none.
    """
    length = np.maximum(np.linalg.norm(columns, axis=0), _TINY)
    left = columns / length
    for _ in range(2 if basis.shape[1] else 0):
        left = left - basis @ (basis.T @ left)
    kept = np.arange(columns.shape[1])
    while True:
        q, r = np.linalg.qr(left[:, kept])
        lost = np.flatnonzero(np.abs(np.diag(r)) <= _ALIKE)
        if not lost.size:
            return q, (r if len(kept) == len(length) else q.T @ left) * length
        kept = np.delete(kept, lost[0])


def _root(products: FloatArray) -> FloatArray:
    """(G, k, k) inverse of the lower triangle of products of columns, by which these become orthonormal."""
    if products.shape[1] == 1:  # most calls
        return np.asarray(1.0 / np.sqrt(np.maximum(products, _TINY)))
    return np.asarray(np.linalg.inv(np.linalg.cholesky(products)))


def _log_det(root: FloatArray) -> FloatArray:
    """(G,) logarithm of the determinant of products of columns, from their `_root`."""
    return np.asarray(-2.0 * np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1))


def _log_size(triangle: FloatArray) -> float:
    """Logarithm of the determinant of products of columns in the rows' own metric, from their triangle."""
    own = np.abs(np.diagonal(triangle)) if triangle.shape[0] == triangle.shape[1] else np.linalg.norm(triangle, axis=1)
    return float(2.0 * np.sum(np.log(np.maximum(own, _TINY))))
