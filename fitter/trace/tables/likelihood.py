"""How much noise rows share, estimated beside a model by restricted maximum likelihood on a grid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.linear import orthonormal
from fitter.trace.tables.noise import Noise

_TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Beside:
    """What the grid's covariances say beside a model.

    Attributes:
        noise: the grid.
        reml: (G,) restricted log-likelihood of each.
        ml: (G,) log-likelihood of each.
        sigma2: (G,) variance of one row, in the covariance's unit.

    """

    noise: Noise
    reml: FloatArray
    ml: FloatArray
    sigma2: FloatArray

    @property
    def best(self) -> int:
        """The covariance that has most for it, the prior counted."""
        return int(np.argmax(self.reml + np.log(self.noise.prior)))

    @cached_property
    def posterior(self) -> FloatArray:
        """(G,) how probable each is."""
        log = self.reml + np.log(self.noise.prior)
        weight = np.exp(log - log.max())
        return np.asarray(weight / weight.sum())

    def inflation(self, at: int, units: FloatArray) -> float:
        """By how much the variance of sums of whitened rows may exceed what covariance `at` says, on the average."""
        if len(self.reml) == 1:
            return 1.0
        scale = self.sigma2 / self.sigma2[at]
        return max(1.0, float(self.posterior @ (scale * self.noise.variance(at, units))))


@dataclass(frozen=True, eq=False)
class Grid:
    """Response and model whitened by every covariance of the grid, to be asked about further columns.

    Attributes:
        noise: the grid.
        which: (G',) the covariances looked at.
        basis: for each an orthonormal basis of the model's columns.
        left: (G', n) what the model leaves of the response.
        log_det: (G',) of the covariance, and of the model's columns whitened by it.

    """

    noise: Noise
    which: IntArray
    basis: tuple[FloatArray, ...]
    left: FloatArray
    log_det: tuple[FloatArray, FloatArray]

    @classmethod
    def of(cls, noise: Noise, y: FloatArray, model: FloatArray) -> Grid:
        """Whiten response (n,) and columns (n, k), already over each row's own sd."""
        which = np.arange(len(noise.prior))
        white = noise.whiten(which, np.column_stack([model, y]))
        basis, left, det = [], [], []
        for one in white:
            q = orthonormal(one[:, :-1])
            basis.append(q)
            left.append(one[:, -1] - q @ (q.T @ one[:, -1]))
            det.append(_log_det(one[:, :-1]))
        return cls(noise, which, tuple(basis), np.array(left), (noise.log_det, np.array(det)))

    def beside(self, extra: FloatArray | None = None) -> Beside:
        """Likelihoods beside the model and further columns (n, d), already over each row's own sd."""
        n, used = self.left.shape[1], self.basis[0].shape[1]
        rss = np.sum(self.left**2, axis=1)
        det_v, det_x = self.log_det
        if extra is not None and extra.shape[1]:
            det_x = det_x.copy()
            rss = rss.copy()
            white = self.noise.whiten(self.which, extra)
            for i, (one, q) in enumerate(zip(white, self.basis, strict=True)):
                own = one - q @ (q.T @ one)
                units = orthonormal(own, np.linalg.norm(one, axis=0), 1e-4)
                rss[i] -= float(np.sum((units.T @ self.left[i]) ** 2))
                det_x[i] += _log_det(own)
            used += extra.shape[1]
        rss = np.maximum(rss, _TINY)
        df = max(n - used, 1)
        reml = -0.5 * (df * np.log(rss) + det_v + det_x)
        ml = -0.5 * (n * np.log(rss) + det_v)
        return Beside(self.noise, reml, ml, rss / df)


def _log_det(columns: FloatArray) -> float:
    """log |X'X|, of columns scaled to length one and back; columns that add nothing count alike everywhere."""
    if not columns.shape[1]:
        return 0.0
    length = np.maximum(np.linalg.norm(columns, axis=0), _TINY)
    values = np.linalg.svd(columns / length, compute_uv=False)
    return float(2.0 * np.sum(np.log(np.maximum(values, 1e-8))) + 2.0 * np.sum(np.log(length)))
