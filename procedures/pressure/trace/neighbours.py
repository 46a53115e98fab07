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

from fitter.arrays import FloatArray, IntArray
from procedures.pressure.trace.problem import Problem
from procedures.pressure.trace.strata import Strata

RHO = np.array([0.0, 0.25, 0.5, 0.7, 0.85])
"""Tried correlations of neighbours."""
PRIOR = np.array([0.2, 0.15, 0.2, 0.25, 0.2])
"""Prior probability of each: chosen for 5 % of false alarms, at a correlation of 0.7 too."""

REMARKABLE = 0.05
"""Smaller ones are not examined further."""
TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Alike:
    """One transducer's whole plots at one correlation.

    Attributes:
        covariance: (W, W) of what the declared model leaves, over the variance of independent ones.
        mean: of its diagonal over the degrees of freedom.
        df: that a chi-square with the spread of the residual's sum of squares would have.
        white: (d, W) that makes what is left independent.
        log_determinant: of that covariance.

    """

    covariance: FloatArray
    mean: float
    df: float
    white: FloatArray
    log_determinant: float


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

    def of(self, i: int) -> tuple[Alike, ...]:
        """Transducer `i` at each correlation of `RHO`."""
        return self._of[i]

    @cached_property
    def _of(self) -> tuple[tuple[Alike, ...], ...]:
        """For each transducer, one for each correlation."""
        made: list[tuple[Alike, ...]] = []
        stratum = self.problem.at["whole-plot"]
        for i, strata in enumerate(self.problem.strata):
            own = stratum.columns[i][:, self.chosen]
            own = own[:, np.any(own != 0.0, axis=0)]
            if not own.size and strata in _OF_STRATA:
                made.append(_OF_STRATA[strata])
                continue
            taken = np.column_stack([strata.between, own / np.maximum(np.linalg.norm(own, axis=0), TINY)])
            made.append(tuple(self._alike(taken, strata.ratio, strata.total, rho) for rho in RHO))
            if not own.size:
                _OF_STRATA[strata] = made[-1]
        return tuple(made)

    def _alike(self, taken: FloatArray, ratio: float, total: FloatArray, rho: float) -> Alike:
        q, r, _ = linalg.qr(taken, pivoting=True)
        rank = int(np.sum(np.abs(np.diag(r)) > 1e-6 * max(abs(float(r[0, 0])), TINY))) if r.size else 0
        free = q[:, rank:]
        shared = ratio / (ratio + 1.0 / total)
        near = rho ** np.abs(np.subtract.outer(self._place, self._place))
        covariance = np.sqrt(np.outer(shared, shared)) * near
        covariance[np.diag_indices_from(covariance)] = 1.0
        left = free.T @ covariance @ free
        triangle = np.linalg.cholesky(left)
        trace = float(np.trace(left))
        return Alike(
            covariance,
            trace / max(left.shape[0], 1),
            trace**2 / max(float(np.sum(left**2)), TINY),
            linalg.solve_triangular(triangle, free.T, lower=True),
            2.0 * float(np.sum(np.log(np.diag(triangle)))),
        )

    @cached_property
    def _place(self) -> FloatArray:
        """(W,) position of each whole plot in time."""
        return np.argsort(self.problem.plots_in_time).astype(np.float64)

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
        log, ps = np.tile(np.log(PRIOR)[:, None], (1, df.size)), np.empty((RHO.size, *ts.shape))
        for k in range(RHO.size):
            spread, freedom = np.zeros(df.size), np.zeros(df.size)
            for i, of in enumerate(self._of):
                if of[0].df <= 1.0:
                    continue
                one = of[k]
                spread += np.sum(columns[i] * (one.covariance @ columns[i]), axis=0) / one.mean
                freedom += squares[i] * (one.df / of[0].df)
                log[k] += np.where(squares[i] > 1e-6 * length, _likelihood(one, columns[i], outputs[i]), 0.0)
            factor = np.sqrt(np.maximum(spread / length, TINY))
            share = np.clip(np.where(freedom > 0, freedom / length, 1.0), 0.1, 1.0)
            ps[k] = 2.0 * special.stdtr(np.maximum(df * share, 1.0), -np.abs(ts) / factor)
        weight = np.exp(log - log.max(axis=0))
        mean = np.sum(weight[:, None] * np.log(np.maximum(ps, TINY)), axis=0) / np.sum(weight, axis=0)
        return np.asarray(np.exp(mean))

    def p_of_block(self, i: int, basis: FloatArray, outputs: FloatArray) -> float:
        """Probability by chance of the part of transducer `i` that an orthonormal basis (W, q) explains."""
        q, log, ps = basis.shape[1], np.log(PRIOR), np.ones(RHO.size)
        gain, rss = float(np.sum((basis.T @ outputs) ** 2)), float(outputs @ outputs)
        for k, one in enumerate(self._of[i]):
            below = one.df * (1.0 - q / self._of[i][0].df)
            if below < 1.0:
                return 1.0
            held = float(np.sum(basis * (one.covariance @ basis)))
            rest = max(one.mean * self._of[i][0].df - held, 0.05) / max(self._of[i][0].df - q, 1.0)
            error = max(rss - gain, TINY) / max(self._of[i][0].df - q, 1.0) / rest
            ps[k] = special.fdtrc(q, below, gain / held / error)
            log[k] += float(_likelihood_of(one, basis, outputs))
        weight = np.exp(log - log.max())
        return float(np.exp(weight @ np.log(np.maximum(ps, TINY)) / weight.sum()))


def _likelihood(one: Alike, columns: FloatArray, outputs: FloatArray) -> FloatArray:
    """(J,) restricted log likelihood of one transducer with each column by itself in the model."""
    y, x = one.white @ outputs, one.white @ columns
    length = np.maximum(np.sum(x**2, axis=0), TINY)
    rss = np.maximum(y @ y - (y @ x) ** 2 / length, 1e-9 * max(float(y @ y), TINY))
    before = np.maximum(np.sum(columns**2, axis=0), TINY)
    return np.asarray(-0.5 * ((y.size - 1) * np.log(rss) + one.log_determinant + np.log(length / before)))


def _likelihood_of(one: Alike, basis: FloatArray, outputs: FloatArray) -> float:
    y, x = one.white @ outputs, one.white @ basis
    q, r = np.linalg.qr(x)
    rss = max(float(y @ y - np.sum((q.T @ y) ** 2)), 1e-9 * max(float(y @ y), TINY))
    extra = 2.0 * float(np.sum(np.log(np.maximum(np.abs(np.diag(r)), TINY))))
    return float(-0.5 * ((y.size - basis.shape[1]) * np.log(rss) + one.log_determinant + extra))


_OF_STRATA: WeakKeyDictionary[Strata, tuple[Alike, ...]] = WeakKeyDictionary()
"""Beside the declared model alone they are the same for a transducer among others and by itself."""
_KNOWN: WeakKeyDictionary[Problem, dict[tuple[int, ...], Neighbours]] = WeakKeyDictionary()
"""Cached, because a search needs the same ones many times."""


def neighbours(problem: Problem, chosen: Sequence[int]) -> Neighbours:
    """Neighbours of a run beside the `chosen` candidates."""
    known, here = _KNOWN.setdefault(problem, {}), problem.within("whole-plot", chosen)
    return known.setdefault(tuple(sorted(here.tolist())), Neighbours(ref(problem), here))
