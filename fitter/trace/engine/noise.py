"""Common noise of the rows of a table: none, a slow walk in the order of measurement, or an error per group of rows.

Each is a grid of covariance matrices, known up to a factor, so that its size can be estimated with any candidate, with
its uncertainty. No array is larger than rows times columns.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtbtrs

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.engine.white import ByRows, White

SHARES = (1.0, 0.7, 0.4, 0.15)
"""Shares of the slow part in the variance of one row; the rest is independent."""
CORRELATIONS = (0.2, 0.4, 0.6, 0.75, 0.83, 0.89, 0.93, 0.96, 0.98, 0.99)
"""Correlations of the slow part between neighbouring rows. If long tables determine more, values between two of these
are simulated with too little or too much slow noise: between 0.87 and 0.94 a third too little.
"""
WALKS = (0.001, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 30.0)
"""Variance of a random walk's step over that of the independent part."""
LEAST_WHITE = 0.01
WIDE = 160
"""Columns from which a recursion is faster row by row, over all columns at once, than by LAPACK, column by column; and
a filter faster by products of several rows at once.
"""
FEW = 8000
"""Numbers that are filtered at once, of several covariances if the columns are short."""
AT_ONCE = 16
"""Rows of a filter that are worked out at once."""
SLOW, MEMORIES = 0.9, 6.0
"""Correlation of neighbours of the slow part above which it is a drift of unknown shape instead of noise; it is also
slow if its memory, the time of a decrease of correlation by a factor e, fits into the table less often than this.
"""


BoolArray = NDArray[np.bool_]


class Noise(Protocol):
    """A grid of covariance matrices; the first is that of independent rows."""

    @property
    def prior(self) -> FloatArray:
        """(G,) prior of each, not normalised."""

    @property
    def log_det(self) -> FloatArray:
        """(G,) logarithm of each determinant."""

    @property
    def slow(self) -> BoolArray:
        """(G,) whether errors have such a long memory that they look like an effect in time."""

    @property
    def drifting(self) -> BoolArray:
        """(G,) whether it is slower than noise, a drift of unknown shape."""

    @property
    def memory(self) -> FloatArray:
        """(G,) variance of the mean of all rows over that of independent ones; ones if the order is irrelevant."""

    def whiten(self, which: IntArray, columns: FloatArray) -> FloatArray:
        """(len(which), n, m) whitened `columns` (n, m): independent errors with one variance."""

    def white(self, which: IntArray, columns: FloatArray) -> White:
        """The same as far as products of columns are asked for."""

    def back(self, at: int, white: FloatArray) -> FloatArray:
        """(n, m) transposed whitening of (n, m): its products with columns are those of `white` with whitened ones."""

    def colour(self, at: int, white: FloatArray) -> FloatArray:
        """(n, m) errors of covariance `at` from independent ones (n, m): the inverse of `whiten`."""

    def root(self, at: int, columns: FloatArray) -> FloatArray:
        """(n, m) transposed colouring of `columns` (n, m): its products are covariances of the weighted sums
        of rows.
        """

    def variances(self, at: int) -> FloatArray:
        """(n,) variance of every row under covariance `at`."""

    def rows(self, kept: IntArray) -> Noise:
        """The same for some of the rows."""

    def only(self, at: int) -> Noise:
        """A grid of one covariance."""

    def over(self, sd: FloatArray) -> Noise:
        """The same for rows divided by (n,) standard deviations of their own: what they share is larger where these are
        small.
        """


@dataclass(frozen=True, eq=False)
class Independent(ByRows):
    """No common errors of rows."""

    n: int

    @property
    def prior(self) -> FloatArray:
        """See `Noise`."""
        return np.ones(1)

    @property
    def log_det(self) -> FloatArray:
        """See `Noise`."""
        return np.zeros(1)

    @property
    def slow(self) -> BoolArray:
        """See `Noise`."""
        return np.zeros(1, np.bool_)

    @property
    def drifting(self) -> BoolArray:
        """See `Noise`."""
        return np.zeros(1, np.bool_)

    @property
    def memory(self) -> FloatArray:
        """See `Noise`."""
        return np.ones(1)

    def whiten(self, which: IntArray, columns: FloatArray) -> FloatArray:
        """See `Noise`."""
        return columns[None]

    def back(self, at: int, white: FloatArray) -> FloatArray:
        """See `Noise`."""
        return white

    def colour(self, at: int, white: FloatArray) -> FloatArray:
        """See `Noise`."""
        return white

    def root(self, at: int, columns: FloatArray) -> FloatArray:
        """See `Noise`."""
        return columns

    def variances(self, at: int) -> FloatArray:
        """See `Noise`."""
        return np.ones(self.n)

    def rows(self, kept: IntArray) -> Independent:
        """See `Noise`."""
        return Independent(len(kept))

    def only(self, at: int) -> Independent:
        """See `Noise`."""
        return self

    def over(self, sd: FloatArray) -> Independent:
        """See `Noise`."""
        return self


@dataclass(frozen=True, eq=False)
class Wandering(ByRows):
    """A slow part in the order of measurement plus independent errors: exponentially correlated, or a random walk.

    Whitened by its Kalman filter, with one innovation per row.

    Attributes:
        when: (n,) times of the rows in units of the usual gap, ascending.
        picked: the only used covariance of the grid; None for all.
        sd: (n,) standard deviation that each row was divided by; None for one of all.
    """

    when: FloatArray
    picked: int | None = None
    sd: FloatArray | None = field(default=None, kw_only=True)

    @cached_property
    def _share(self) -> FloatArray:
        """(n,) of the slow part in each row."""
        return np.ones(len(self.when)) if self.sd is None else 1.0 / self.sd

    @cached_property
    def _grid(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """(G,) correlation over the usual gap, stationary variance, step variance of a walk, white variance."""
        rows = [(0.0, 0.0, 0.0, 1.0)]
        for c in CORRELATIONS:
            for share in SHARES if c > 0.5 else SHARES[:2]:
                white = max(1.0 - share, LEAST_WHITE)
                rows.append((c, share, 0.0, white))
        rows += [(1.0, 0.0, q, 1.0) for q in WALKS]
        wanted = rows if self.picked is None else rows[self.picked : self.picked + 1]
        correlation, share, step, white = np.array(wanted).T
        return correlation, share, step, white

    @property
    def prior(self) -> FloatArray:
        """(G,) independence counts as four others, slow ones count less."""
        correlation = self._grid[0]
        return np.where(correlation == 0.0, 4.0, np.where(correlation > 0.95, 0.3, 1.0))

    @property
    def correlation(self) -> FloatArray:
        """(G,) correlation of two neighbouring rows' errors; one for a walk."""
        correlation, share, step, _ = self._grid
        return np.where(step > 0, 1.0, correlation * share)

    @property
    def slow(self) -> BoolArray:
        """See `Noise`."""
        correlation = self._grid[0]
        shortest = np.exp(-MEMORIES / max(float(np.ptp(self.when)), 1.0))
        return np.asarray(correlation > min(SLOW, shortest))

    @property
    def drifting(self) -> BoolArray:
        """See `Noise`."""
        return np.asarray(self._grid[0] > SLOW)

    def nearest(self, correlation: float, share: float) -> int:
        """The covariance of such a wander, by what wanders' correlation between neighbours and its share."""
        own, part, step, _ = self._grid
        return ties.lowest(np.where(step > 0, np.inf, np.abs(own - correlation) + 0.1 * np.abs(part - share)))

    def walk(self, step: float) -> int:
        """The covariance of a random walk of such steps."""
        return ties.lowest(np.abs(self._grid[2] - step), step)

    @cached_property
    def memory(self) -> FloatArray:
        """See `Noise`."""
        ones = np.ones((len(self.when), 1))
        every = range(len(self._grid[0]))
        return np.array([np.sum(self.root(g, ones) ** 2) / np.sum(self.variances(g)) for g in every])

    @cached_property
    def _filter(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n, G) decay from the previous row, gain, and the innovation's standard deviation."""
        correlation, share, step, white = self._grid
        gap, own = np.diff(self.when, prepend=self.when[:1])[:, None], self._share[:, None]
        decay = correlation**gap
        kept = decay**2
        came, scale = (1.0 - kept) * share + step * gap, own**2
        before, total, state = np.empty_like(decay), np.empty_like(decay), share.copy()
        for kept_t, came_t, scale_t, before_t, total_t in zip(kept, came, scale, before, total, strict=True):
            np.multiply(kept_t, state, out=before_t)
            np.add(before_t, came_t, out=before_t)
            np.multiply(before_t, scale_t, out=total_t)
            np.add(total_t, white, out=total_t)
            np.multiply(before_t, white, out=state)
            np.divide(state, total_t, out=state)
        gain, sd = before * own / total, np.sqrt(total)
        return decay, gain, sd

    @cached_property
    def _steps(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """(G, n) share of the state that is kept from row to row, gain, what a row sees of it, and sd."""
        decay, gain, sd = (np.ascontiguousarray(part.T) for part in self._filter)
        return decay * (1.0 - gain * self._share), gain, decay * self._share, sd

    @cached_property
    def _bands(self) -> FloatArray:
        """(G, n, 2) for each covariance the matrix that `_recursion` solves; the first row begins anew."""
        band = np.ones((*self._steps[0].shape, 2))
        np.negative(self._steps[0][:, 1:], out=band[:, :-1, 1])
        band[:, -1, 1] = 0.0
        return band

    @cached_property
    def log_det(self) -> FloatArray:
        """See `Noise`."""
        return np.asarray(2.0 * np.sum(np.log(self._filter[2]), axis=0))

    def whiten(self, which: IntArray, columns: FloatArray) -> FloatArray:
        """See `Noise`."""
        n, m = columns.shape
        if m >= WIDE:
            out = np.empty((len(which), n, m), columns.dtype)
            for g, white in zip(which.tolist(), out, strict=True):
                if self._grid[0][g] == 0.0:
                    white[:] = columns
                else:
                    _filtered(self._at_once(g), columns, white)
            return out
        # column by column, as LAPACK solves them
        few, given = np.empty((m, len(which), n)), np.ascontiguousarray(columns.T)
        at_once = max(FEW // max(columns.size, 1), 1) if np.all(np.diff(which) == 1) else 1
        for i in range(0, len(which), at_once):
            self._whiten(int(which[i]), given, few[:, i : i + at_once])
        return few.transpose(1, 2, 0)

    def _whiten(self, first: int, columns: FloatArray, white: FloatArray) -> None:
        """Whiten (m, n) by neighbouring covariances (m, g, n): the state begins anew with the first row of each."""
        if white.shape[1] == 1 and self._grid[0][first] == 0.0:
            white[:, 0] = columns
            return
        some = slice(first, first + white.shape[1])
        _, gain, own, sd = (part[some] for part in self._steps)
        given = (gain * columns[:, None]).reshape(len(columns), gain.size)
        state = _solved(self._bands[some].reshape(gain.size, 2), given.T).T.reshape(white.shape)
        white[:, :, 0] = columns[:, None, 0]
        np.multiply(own[:, 1:], state[:, :, :-1], out=white[:, :, 1:])
        np.subtract(columns[:, None, 1:], white[:, :, 1:], out=white[:, :, 1:])
        white /= sd

    def back(self, at: int, white: FloatArray) -> FloatArray:
        """See `Noise`. The filter's stretches of rows from the last one back."""
        if self._grid[0][at] == 0.0:
            return white
        return _filtered(self._at_once(at)[::-1].transpose(0, 2, 1), white, np.empty_like(white), last_first=True)

    def _at_once(self, at: int) -> FloatArray:
        """(s, r + 1, r + 1) for each stretch of r rows its whitened rows, and the state after it, from the rows and the
        state before it; the last stretch may have fewer rows.
        """
        r, n = AT_ONCE, len(self.when)
        kept, gain, own, sd = (
            np.concatenate([part[at], np.ones(-n % r)]).reshape(-1, r, 1).swapaxes(0, 1) for part in self._steps
        )
        out, state = np.zeros((r + 1, len(kept[0]), r + 1)), np.zeros((len(kept[0]), r + 1))
        state[:, r] = 1.0
        for t in range(r):
            out[t] = -own[t] / sd[t] * state
            out[t, :, t] += 1.0 / sd[t, :, 0]
            state *= kept[t]
            state[:, t] += gain[t, :, 0]
        out[r] = state
        return np.ascontiguousarray(out.swapaxes(0, 1))

    def colour(self, at: int, white: FloatArray) -> FloatArray:
        """See `Noise`."""
        decay, gain, sd = (part[:, at, None].astype(white.dtype) for part in self._filter)
        innovation = sd * white
        state = _recursion(decay[:, 0], gain * innovation)
        own = decay * self._share[:, None].astype(white.dtype)
        return np.asarray(innovation + own * np.concatenate([np.zeros_like(state[:1]), state[:-1]]))

    def root(self, at: int, columns: FloatArray) -> FloatArray:
        """See `Noise`. The adjoint of the filter, from the last row back."""
        decay, gain, sd = (part[::-1, at] for part in self._filter)
        back = columns[::-1]
        factor = np.concatenate([[0.0], decay[:-1]])
        later = np.concatenate([np.zeros_like(back[:1]), (self._share[::-1, None] * back)[:-1]])
        ahead = _recursion(factor, factor[:, None] * later)
        return np.asarray((sd[:, None] * (back + gain[:, None] * ahead))[::-1])

    def variances(self, at: int) -> FloatArray:
        """See `Noise`."""
        _, share, step, white = (part[at] for part in self._grid)
        return np.asarray((share + step * (self.when - self.when[0])) * self._share**2 + white)

    def rows(self, kept: IntArray) -> Wandering:
        """See `Noise`."""
        return replace(self, when=self.when[kept], sd=None if self.sd is None else self.sd[kept])

    def only(self, at: int) -> Noise:
        """See `Noise`."""
        return Independent(len(self.when)) if at == 0 else replace(self, picked=at)

    def over(self, sd: FloatArray) -> Wandering:
        """See `Noise`."""
        return self if np.array_equal(1.0 / sd, self._share) else replace(self, sd=sd)


def _filtered(stretches: FloatArray, given: FloatArray, out: FloatArray, *, last_first: bool = False) -> FloatArray:
    """(n, m) `out`, worked out from `given` (n, m) one stretch of rows after the other, in this order or backwards.

    Args:
        stretches: (s, r + 1, r + 1) what comes of the rows of each and of a state, and the next state.
        given: rows.
        out: takes the result.
        last_first: whether the last stretch is the first one.
    """
    stretches, r = stretches.astype(given.dtype), stretches.shape[1] - 1
    state = np.zeros(given.shape[1], given.dtype)
    starts = range(0, len(given), r)
    for one, first in zip(stretches, reversed(starts) if last_first else starts, strict=True):
        some, white = given[first : first + r], out[first : first + r]
        m = len(some)
        np.matmul(one[:m, :m], some, out=white)
        white += one[:m, r:] * state
        state = one[r, :m] @ some + one[r, r] * state
    return out


def _recursion(factor: FloatArray, given: FloatArray) -> FloatArray:
    """(n, m) s with s[t] = factor[t] s[t - 1] + given[t]; it may take the place of `given`."""
    if given.shape[1] >= WIDE:
        for t in range(1, len(given)):
            given[t] += factor[t] * given[t - 1]
        return given
    band = np.ones((len(factor), 2))
    np.negative(factor[1:], out=band[:-1, 1])
    return _solved(band, given)


def _solved(band: FloatArray, given: FloatArray) -> FloatArray:
    """(n, m) the recursion by LAPACK, column by column; the band (n, 2) is transposed, or its wrapper would copy it."""
    if not given.shape[1]:  # LAPACK's wrapper writes beyond an array without columns
        return given
    solved, _ = dtbtrs(band.T, given, uplo="L", trans="N", diag="U", overwrite_b=True)
    return np.asarray(solved)
