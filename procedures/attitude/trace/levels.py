"""The levels of a replicated run: parts that are removed from an output before the search for an effect.

declared       the declared model
replications   the declared model in every replication, so that effects of a whole replication are removed
points         also the mean of every point, so that only variation point by replication remains

Effects between points are judged at `replications`, effects of time, temperature or direction at `points`: so neither
offsets of replications nor lack of fit can be taken for them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.sums_of_squares import centred, own_parameters, project_out
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.model import attitude_columns
from rig.procedures.attitude.trace.walks import STEPS, WIDE, Walks, walks_of

Level = Literal["declared", "replications", "points"]
LEVELS: tuple[Level, ...] = ("declared", "replications", "points")
COINCIDENCE = 10
"""Degrees of freedom within replications for each of points visited again, from which such visits are coincidences."""
AT_ONCE = 64
"""Columns that are handled together where libraries copy them."""


@dataclass(frozen=True, eq=False)
class Levels:
    """Projections onto the remainder of each level.

    Attributes:
        declared: (n, L) orthonormal basis of the declared model.
        replications: (n, n_rep L) of the model in every replication.
        points: (n, rank) of the same after removing the points' means.
        point: (n,) point of the design.
        stretch: (n,) index of the stretch of consecutive observations, a quarter of a replication, of each row.
        executed: (n,) rows in the order of running, replication by replication.
        replicate: (n,) replication of each row, from 0.
        alone: for each replication, (L, n_r) from its rows to the parameters of its own fit, scaled so that scatter of
            readings gives all of them its own standard deviation.
        beside: number of further columns of the declared model removed for each sensor; they cost degrees of freedom.
    """

    declared: FloatArray
    replications: FloatArray
    points: FloatArray
    point: IntArray
    stretch: IntArray
    executed: IntArray
    replicate: IntArray
    alone: tuple[FloatArray, ...]
    beside: int = 0

    @property
    def n_points(self) -> int:
        """K, number of points of the design."""
        return int(self.point.max()) + 1

    @property
    def of_error(self) -> Level:
        """The level with the error of a reading: points that are visited again, else each replication beside its fit.

        Where no point is visited twice, or a few by coincidence, a residual of the declared model would have the
        replications' own offsets in it, and hide every effect that is smaller.
        """
        again = self.df("points")
        return "points" if again > 0 and COINCIDENCE * again >= self.df("replications") else "replications"

    def df(self, level: Level) -> int:
        """Remaining degrees of freedom at a level."""
        taken = int(self._basis(level).shape[1]) + (self.n_points if level == "points" else 0)
        return len(self.point) - taken - self.beside

    def leave(self, columns: FloatArray, level: Level, *, overwrite: bool = False) -> FloatArray:
        """(n, q) remainder of `columns` (n, q) at a level, with `overwrite` in their place."""
        if level == "points":
            return project_out(centred(columns, self.point), self._basis(level), overwrite=True)
        return project_out(columns, self._basis(level), overwrite=overwrite)

    @cached_property
    def _rows(self) -> list[slice | NDArray[np.bool_]]:
        """Rows of each replication; a slice, which copies nothing, where they follow one another."""
        each = [self.replicate == r for r in range(len(self.alone))]
        ends = [(int(np.argmax(one)), one.size - int(np.argmax(one[::-1]))) for one in each]
        return [slice(*end) if end[1] - end[0] == one.sum() else one for one, end in zip(each, ends, strict=True)]

    @cached_property
    def _added(self) -> Any:
        """(p, n) sparse matrix that adds rows up to points."""
        ahead, ends = np.argsort(self.point, kind="stable"), np.concatenate([[0], np.cumsum(self._visits)])
        return sparse.csr_array((np.ones(ahead.size), ahead, ends), shape=(self.n_points, ahead.size))

    def leave_beside(
        self, columns: FloatArray, beside: FloatArray, level: Level, *, overwrite: bool = False
    ) -> FloatArray:
        """(n, q) remainder of `columns` (n, q) at a level, with one sensor's further columns (n, p) removed too."""
        left = self.leave(columns, level, overwrite=overwrite)
        if not beside.shape[1]:
            return left
        return project_out(left, orthonormal(self.leave(beside, level), np.linalg.norm(beside, axis=0)), overwrite=True)

    def products(self, columns: FloatArray, beside: FloatArray) -> dict[Level, FloatArray]:
        """(q + 1, q + 1) products of the remainders of `columns` (n, q) at each level, and zeros last. One sensor's
        further columns (n, p) are removed. They are computed from products of the columns, without projections.
        """
        whole, out = columns.T @ columns, dict[Level, FloatArray]()
        for level in LEVELS:
            basis = self._basis(level)
            further = beside
            if beside.shape[1]:
                further = orthonormal(self.leave(beside, level), np.linalg.norm(beside, axis=0))
            points = self.n_points if level == "points" else 0
            along = np.empty((basis.shape[1] + points + further.shape[1], columns.shape[1]))
            along[: basis.shape[1]] = basis.T @ columns
            if points:
                sums = along[basis.shape[1] : basis.shape[1] + points]
                for k in range(0, columns.shape[1], AT_ONCE):
                    sums[:, k : k + AT_ONCE] = self._added @ columns[:, k : k + AT_ONCE]
                sums /= np.sqrt(self._visits)[:, None]
            along[basis.shape[1] + points :] = further.T @ columns
            out[level] = np.zeros((len(whole) + 1,) * 2)
            np.subtract(whole, along.T @ along, out=out[level][:-1, :-1])
        return out

    def own(self, columns: FloatArray) -> FloatArray:
        """(n_rep, L, q) parameters of each replication's own fit to `columns` (n, q), minus their means."""
        each = np.stack([fit @ columns[rows] for fit, rows in zip(self.alone, self._rows, strict=True)])
        return np.asarray(each - each.mean(axis=0))

    def walks(self, level: Level, *, wide: bool = False) -> Walks:
        """Likelihoods of the remainder at a level, for random walks of the offset, if `wide` also for large ones."""
        if (level, wide) not in self._walks:
            known = self.walks(level).widths if wide else ()
            df, steps = float(max(self.df(level), 1)), WIDE if wide else STEPS
            more = walks_of(self.executed, self.replicate, self._basis(level), df, steps[len(known) :])
            self._walks[level, wide] = replace(more, widths=(*known, *more.widths))
        return self._walks[level, wide]

    @cached_property
    def _walks(self) -> dict[tuple[Level, bool], Walks]:
        return {}

    @cached_property
    def _visits(self) -> IntArray:
        return np.bincount(self.point)

    def _basis(self, level: Level) -> FloatArray:
        return {"declared": self.declared, "replications": self.replications, "points": self.points}[level]


def levels_of(data: AttitudeData, beside: int = 0) -> Levels:
    """The levels of a pitch-roll run whose declared model has this number of columns beside those of attitude."""
    h = attitude_columns(data.pitch_deg, data.roll_deg, roll=data.has_roll)
    own = own_parameters(h, data.replicate_index)
    return Levels(
        declared=orthonormal(h),
        replications=orthonormal(own),
        points=orthonormal(centred(own, data.point), np.linalg.norm(own, axis=0)),
        point=data.point,
        stretch=stretches(data, -(-len(data) // (4 * data.replicates.size))),
        executed=np.lexsort((data.order, data.replicate_index)),
        replicate=data.replicate_index,
        alone=_alone(h, data.replicate_index),
        beside=beside,
    )


def _alone(h: FloatArray, replicate: IntArray) -> tuple[FloatArray, ...]:
    count = int(replicate.max()) + 1
    metric = np.linalg.qr(h, mode="r") / np.sqrt(count)
    return tuple(metric @ np.linalg.pinv(h[replicate == r]) for r in range(count))


def stretches(data: AttitudeData, length: int) -> IntArray:
    """(n,) index of the stretch of about `length` consecutive observations of one replication, for each row."""
    stretch = np.empty(len(data), np.int64)
    first = 0
    for index in range(data.replicates.size):
        rows = np.flatnonzero(data.replicate_index == index)
        count = max(round(rows.size / length), 1)
        stretch[rows[np.argsort(data.order[rows])]] = first + np.arange(rows.size) * count // rows.size
        first += count
    return stretch
