"""Tests between whole plots whose errors are correlated with the errors of their neighbours in time.

A chamber, a room or a supply that wanders over hours makes neighbouring whole plots alike, and whatever is slow, a
drift, a step, a memory, looks like that. Few whole plots do not say how alike they are: every test is done at several
correlations and averaged by how likely each of them is beside what is tested (restricted likelihood).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from weakref import ReferenceType, WeakKeyDictionary, ref

import numpy as np
from scipy import linalg, special

from rig.fitter.arrays import FloatArray, IntArray
from rig.procedures.pressure.trace.problem import Problem
from rig.procedures.pressure.trace.strata import Strata

RHO = np.array([0.0, 0.25, 0.5, 0.7, 0.85])
"""Tried correlations of neighbours."""
PRIOR = np.array([0.2, 0.15, 0.2, 0.25, 0.2])
"""Prior probability of each: chosen for 5 % of false alarms, at a correlation of 0.7 too."""

REMARKABLE = 0.05
"""Smaller ones are not examined further."""
TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Alike:
    """One transducer's whole plots at each of K correlations.

    Attributes:
        covariance: (K, W, W) of what the declared model leaves, over the variance of independent ones.
        mean: (K,) of its diagonal over the degrees of freedom.
        df: (K,) that a chi-square with the spread of the residual's sum of squares would have.
        white: (K, d, W) that makes what is left independent.
        log_determinant: (K,) of that covariance.

    """

    covariance: FloatArray
    mean: FloatArray
    df: FloatArray
    white: FloatArray
    log_determinant: FloatArray

    def likelihood(self, columns: FloatArray, outputs: FloatArray) -> FloatArray:
        """(K, J) restricted log likelihood of outputs (W,) with each column (W, J) by itself in the model."""
        y, x = self.white @ outputs, self.white @ columns
        length, total = np.maximum(np.sum(x**2, axis=1), TINY), np.sum(y**2, axis=1)[:, None]
        rss = np.maximum(total - (y[:, None] @ x)[:, 0] ** 2 / length, 1e-9 * np.maximum(total, TINY))
        before = np.maximum(np.sum(columns**2, axis=0), TINY)
        return self._log(rss, 1, np.log(length / before))

    def likelihood_of(self, basis: FloatArray, outputs: FloatArray) -> FloatArray:
        """(K,) the same with an orthonormal basis (W, q) in the model."""
        y, (q, r) = self.white @ outputs, np.linalg.qr(self.white @ basis)
        total, along = np.sum(y**2, axis=1), (y[:, None] @ q)[:, 0]
        rss = np.maximum(total - np.sum(along**2, axis=1), 1e-9 * np.maximum(total, TINY))
        size = np.log(np.maximum(np.abs(np.diagonal(r, axis1=1, axis2=2)), TINY))
        return self._log(rss[:, None], basis.shape[1], 2.0 * np.sum(size, axis=1)[:, None])[:, 0]

    def _log(self, rss: FloatArray, fitted: int, determinant: FloatArray) -> FloatArray:
        free = self.white.shape[1] - fitted
        return np.asarray(-0.5 * (free * np.log(rss) + self.log_determinant[:, None] + determinant))


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Whole plots of a run beside some candidates.

    Attributes:
        run: the run; who asks has it, and it has these.
        chosen: candidates judged between whole plots that are in the model.

    """

    run: ReferenceType[Problem]
    chosen: IntArray

    @property
    def problem(self) -> Problem:
        """The run."""
        problem = self.run()
        assert problem is not None
        return problem

    @cached_property
    def of(self) -> tuple[Alike, ...]:
        """Each transducer at the correlations of `RHO`."""
        made: list[Alike] = []
        stratum = self.problem.at["whole-plot"]
        for i, strata in enumerate(self.problem.strata):
            own = stratum.columns[i][:, self.chosen]
            own = own[:, np.any(own != 0.0, axis=0)]
            if not own.size and strata in _OF_STRATA:
                made.append(_OF_STRATA[strata])
                continue
            taken = np.column_stack([strata.between, own / np.maximum(np.linalg.norm(own, axis=0), TINY)])
            made.append(self._alike(taken, strata.ratio, strata.total))
            if not own.size:
                _OF_STRATA[strata] = made[-1]
        return tuple(made)

    def _alike(self, taken: FloatArray, ratio: float, total: FloatArray) -> Alike:
        q, r, _ = linalg.qr(taken, pivoting=True)
        rank = int(np.sum(np.abs(np.diag(r)) > 1e-6 * max(abs(float(r[0, 0])), TINY))) if r.size else 0
        free = q[:, rank:]
        shared = np.sqrt(ratio / (ratio + 1.0 / total))
        covariance = np.where(np.eye(total.size, dtype=bool), 1.0, np.outer(shared, shared) * self._near)
        left = free.T @ covariance @ free
        triangle = np.linalg.cholesky(left)
        trace = np.trace(left, axis1=1, axis2=2)
        return Alike(
            covariance,
            trace / max(left.shape[1], 1),
            trace**2 / np.maximum(np.sum(left**2, axis=(1, 2)), TINY),
            np.linalg.solve(triangle, free.T),
            2.0 * np.sum(np.log(np.diagonal(triangle, axis1=1, axis2=2)), axis=1),
        )

    @cached_property
    def _near(self) -> FloatArray:
        """(K, W, W) correlation of whole plots by their distance in time."""
        place = np.argsort(self.problem.plots_in_time)
        return np.asarray(RHO[:, None, None] ** np.abs(np.subtract.outer(place, place)))

    def p(self, ts: FloatArray, df: FloatArray, columns: FloatArray, outputs: FloatArray) -> FloatArray:
        """(K, J) probability of a larger score by chance, from scores (K, J) that take whole plots as independent.

        What is not remarkable as it is stays as it is.

        Args:
            ts: coefficients over their standard errors, one way to work these out or several.
            df: (J,) degrees of freedom of these.
            columns: (S, W, J) beside the chosen, over each transducer's error.
            outputs: (S, W) the same.

        """
        out = 2.0 * special.stdtr(df, -np.abs(ts))
        some = np.flatnonzero(np.min(out, axis=0) < REMARKABLE)
        if some.size:
            out[:, some] = self._p(ts[:, some], df[some], columns[:, :, some], outputs)
        return np.asarray(out)

    def _p(self, ts: FloatArray, df: FloatArray, columns: FloatArray, outputs: FloatArray) -> FloatArray:
        squares = np.sum(columns**2, axis=1)
        length = np.maximum(np.sum(squares, axis=0), TINY)
        log, (spread, freedom) = np.log(PRIOR)[:, None] + np.zeros(df.size), np.zeros((2, RHO.size, df.size))
        for one, x, y, square in zip(self.of, columns, outputs, squares, strict=True):
            if one.df[0] <= 1.0:
                continue
            spread += np.sum(x * (one.covariance @ x), axis=1) / one.mean[:, None]
            freedom += square * (one.df / one.df[0])[:, None]
            log += np.where(square > 1e-6 * length, one.likelihood(x, y), 0.0)
        factor = np.sqrt(np.maximum(spread / length, TINY))
        share = np.clip(np.where(freedom > 0, freedom / length, 1.0), 0.1, 1.0)
        ps = 2.0 * special.stdtr(np.maximum(df * share, 1.0)[:, None], -np.abs(ts) / factor[:, None])
        return _averaged(ps, log[:, None])

    def p_of_block(self, i: int, basis: FloatArray, outputs: FloatArray) -> float:
        """Probability by chance of the part of transducer `i` that an orthonormal basis (W, q) explains."""
        one, q = self.of[i], basis.shape[1]
        below = one.df * (1.0 - q / one.df[0])
        if np.min(below) < 1.0:
            return 1.0
        gain, rss = float(np.sum((basis.T @ outputs) ** 2)), float(outputs @ outputs)
        held = np.sum(basis * (one.covariance @ basis), axis=(1, 2))
        rest = np.maximum(one.mean * one.df[0] - held, 0.05) / max(one.df[0] - q, 1.0)
        error = max(rss - gain, TINY) / max(one.df[0] - q, 1.0) / rest
        log = np.log(PRIOR) + one.likelihood_of(basis, outputs)
        return float(_averaged(special.fdtrc(q, below, gain / held / error), log))


def _averaged(ps: FloatArray, log: FloatArray) -> FloatArray:
    """Geometric mean of probabilities (K, ...), each as likely as the exponential of (K, ...)."""
    weight = np.exp(log - log.max(axis=0))
    return np.asarray(np.exp(np.sum(weight * np.log(np.maximum(ps, TINY)), axis=0) / np.sum(weight, axis=0)))


_OF_STRATA: WeakKeyDictionary[Strata, Alike] = WeakKeyDictionary()
"""Beside the declared model alone they are the same for a transducer among others and by itself."""
_KNOWN: WeakKeyDictionary[Problem, dict[tuple[int, ...], Neighbours]] = WeakKeyDictionary()
"""Cached, because a search needs the same ones many times."""


def neighbours(problem: Problem, chosen: Sequence[int]) -> Neighbours:
    """Neighbours of a run beside the `chosen` candidates."""
    known, here = _KNOWN.setdefault(problem, {}), problem.within("whole-plot", chosen)
    return known.setdefault(tuple(sorted(here.tolist())), Neighbours(ref(problem), here))
