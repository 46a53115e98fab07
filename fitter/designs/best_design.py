"""Search for the best design among combinations of levels: many random starts, improved side by side.

Points are exchanged one at a time against all settings of the easy factors, and whole plots against all settings of the
hard ones (V. V. Fedorov, 1972; P. Goos and M. Vandebroek, Technometrics 45 (2003) 235). If there are too many settings,
one factor is changed at a time (R. K. Meyer and C. J. Nachtsheim, Technometrics 37 (1995) 60; with whole plots
B. Jones and P. Goos, Appl. Statist. 56 (2007) 347).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.designs.plots import share

MOVES = 100
"""Settings up to which a point is compared with all of them at once."""
SWEEPS = 60
GAIN = 1e-9
"""Relative improvement that counts; smaller ones are rounding errors."""
RIDGE = 1e-3
"""Information added in the first sweep, per point, so that a start that determines nothing yet can be improved."""
SHAKEN = 0.15
"""Share of the points and whole plots of a good design that are drawn anew."""
LEFT = 1e-10
"""Information added after the first sweep, per point: without influence on the result, which is computed without it."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Settings that points can have, and the whole plots they are put into.

    Attributes:
        rows: (H, E, p) model rows at H combinations of hard levels and E of easy ones.
        allowed: (H, E) which may be set.
        hard_shape: numbers of levels of each hard factor, product H.
        easy_shape: the same of the easy ones, product E.
        sizes: (W,) points of each whole plot.
        eta: variance between whole plots over that within.
        known: (p, p) information of points that are there already.
        target: (p, p) of the criterion tr(M^-1 target) to be made small; None to make |M| large.
    """

    rows: FloatArray
    allowed: NDArray[np.bool_]
    hard_shape: tuple[int, ...]
    easy_shape: tuple[int, ...]
    sizes: IntArray
    eta: float
    known: FloatArray
    target: FloatArray | None

    @property
    def plot_of(self) -> IntArray:
        """(n,) whole plot of each point."""
        return np.repeat(np.arange(self.sizes.size), self.sizes)


@dataclass(frozen=True, eq=False)
class Starts:
    """Designs that are improved side by side.

    Attributes:
        hard: (S, W) hard combination of each whole plot.
        easy: (S, n) easy combination of each point.
    """

    hard: IntArray
    easy: IntArray

    def __getitem__(self, which: NDArray[np.bool_] | IntArray) -> Starts:
        return Starts(self.hard[which], self.easy[which])


def random_starts(problem: Problem, count: int, random: np.random.Generator) -> Starts:
    """Random allowed designs."""
    possible = np.flatnonzero(problem.allowed.any(axis=1))
    hard = np.asarray(random.choice(possible, (count, problem.sizes.size)), np.int64)
    return Starts(hard, _random_easy(problem, hard, random))


def shaken(problem: Problem, starts: Starts, random: np.random.Generator) -> Starts:
    """The designs with some points and whole plots drawn anew, as starts near good designs."""
    fresh = random_starts(problem, len(starts.hard), random)
    hard = np.where(random.random(starts.hard.shape) < SHAKEN, fresh.hard, starts.hard)
    kept = random.random(starts.easy.shape) >= SHAKEN
    kept &= problem.allowed[hard[:, problem.plot_of], starts.easy]
    return Starts(hard, np.where(kept, starts.easy, _random_easy(problem, hard, random)))


def _random_easy(problem: Problem, hard: IntArray, random: np.random.Generator) -> IntArray:
    """(S, n) random easy combinations that are allowed with the (S, W) hard ones."""
    possible = problem.allowed[hard[:, problem.plot_of]]
    return np.asarray(np.argmax(random.random(possible.shape) * possible, axis=2), np.int64)


def improved(problem: Problem, starts: Starts) -> tuple[Starts, FloatArray]:
    """The designs after exchanges until none helps, and the criterion of each: large is good.

    The criterion is log |M|, or -tr(M^-1 target); -inf for a design that does not determine the terms.
    """
    starts = Starts(starts.hard.copy(), starts.easy.copy())
    busy = np.ones(len(starts.hard), np.bool_)
    points = int(problem.sizes.sum())
    for sweep in range(SWEEPS):
        part = Exchange(problem, starts[busy], (RIDGE if sweep == 0 else LEFT) * points)
        changed = part.sweep()
        starts.hard[busy], starts.easy[busy] = part.starts.hard, part.starts.easy
        if sweep > 0:
            busy[np.flatnonzero(busy)[~changed]] = False
        if not busy.any():
            break
    return starts, criterion(problem, information(problem, starts))


def criterion(problem: Problem, m: FloatArray) -> FloatArray:
    """(S,) criteria of (S, p, p) information matrices."""
    values = np.linalg.eigvalsh(m)
    good = values[:, 0] > 1e-12 * values[:, -1]
    out = np.full(len(m), -np.inf)
    if problem.target is None:
        out[good] = np.sum(np.log(values[good]), axis=1)
    elif good.any():
        out[good] = -np.sum(np.linalg.inv(m[good]) * problem.target, axis=(1, 2))
    return out


def information(problem: Problem, starts: Starts) -> FloatArray:
    """(S, p, p) information of the designs, with that of known points."""
    rows = problem.rows[starts.hard[:, problem.plot_of], starts.easy]
    m = problem.known + np.matmul(rows.transpose(0, 2, 1), rows)
    sums = np.add.reduceat(rows, np.concatenate([[0], np.cumsum(problem.sizes)[:-1]]), axis=1)
    weight = _between(problem.sizes, problem.eta)
    return np.asarray(m - np.matmul(sums.transpose(0, 2, 1), sums * weight[:, None]))


def _between(size: IntArray, eta: float) -> FloatArray:
    """(W,) eta / (1 + m eta): V^-1 of a whole plot is the unit matrix less this in all places."""
    return np.asarray(eta / (1.0 + size * eta))


def moves(shape: tuple[int, ...]) -> list[list[int]]:
    """Factors that are changed together: all of them, or one after the other if there are too many combinations."""
    if int(np.prod(shape, dtype=np.int64)) <= MOVES:
        return [list(range(len(shape)))]
    return [[axis] for axis in range(len(shape))]


def alternatives(now: IntArray, shape: tuple[int, ...], axes: list[int]) -> IntArray:
    """(S, q) combinations that differ from (S,) in these factors only."""
    place = [np.repeat(index[:, None], 1, axis=1) for index in np.unravel_index(now, shape)]
    choice = np.array(list(product(*[range(shape[axis]) for axis in axes])), np.int64)
    for position, axis in enumerate(axes):
        place[axis] = np.broadcast_to(choice[:, position], (now.size, len(choice)))
    full = [np.broadcast_to(each, (now.size, len(choice))) for each in place]
    return np.asarray(np.ravel_multi_index(tuple(full), shape), np.int64)


class Exchange:
    """One sweep of exchanges through all points and whole plots of designs."""

    def __init__(self, problem: Problem, starts: Starts, ridge: float) -> None:
        self.problem, self.starts = problem, starts
        self._each = np.arange(len(starts.hard))
        self._ridge = ridge * np.eye(problem.rows.shape[2])
        self._m = information(problem, starts) + self._ridge
        self._inverse = np.linalg.inv(self._m)
        self._changed = np.zeros(len(starts.hard), np.bool_)

    def sweep(self) -> NDArray[np.bool_]:
        """(S,) whether a design was changed."""
        first = 0
        for plot, size in enumerate(self.problem.sizes):
            if self.problem.rows.shape[0] > 1:
                for axes in moves(self.problem.hard_shape):
                    self._exchange_plot(plot, slice(first, first + size), axes)
            if self.problem.rows.shape[1] > 1:
                for point in range(first, first + size):
                    for axes in moves(self.problem.easy_shape):
                        self._exchange_point(plot, point, slice(first, first + size), axes)
            first += int(size)
        return self._changed

    def _exchange_point(self, plot: int, point: int, members: slice, axes: list[int]) -> None:
        """The determinant lemma for M + U C U' with U = [new row, old row, sum of the whole plot]."""
        problem, hard, easy = self.problem, self.starts.hard[:, plot], self.starts.easy
        choice = alternatives(easy[:, point], problem.easy_shape, axes)
        c = float(_between(problem.sizes[plot : plot + 1], problem.eta)[0])
        z = problem.rows[hard[:, None], choice]
        x = problem.rows[hard, easy[:, point]]
        s = problem.rows[hard[:, None], easy[:, members]].sum(axis=1)
        core = np.array([[1.0 - c, c, -c], [c, -1.0 - c, c], [-c, c, 0.0]])
        grown = np.eye(3) + core @ _products(z, x, s, self._inverse)
        adjugate, determinant = _adjugate(grown)
        if problem.target is None:
            gain = np.log(np.maximum(determinant, 1e-300))
        else:
            k = self._inverse @ problem.target @ self._inverse
            trace = np.sum(adjugate * (core @ _products(z, x, s, k)).swapaxes(2, 3), axis=(2, 3))
            now = np.sum(self._inverse * problem.target, axis=(1, 2))[:, None]
            with np.errstate(divide="ignore", invalid="ignore"):
                gain = np.where(determinant > 1e-12, trace / determinant / now, -np.inf)
        gain = np.where(problem.allowed[hard[:, None], choice], gain, -np.inf)
        best, better = _choose(gain)
        easy[better, point] = choice[self._each, best][better]
        self._update(better)

    def _exchange_plot(self, plot: int, members: slice, axes: list[int]) -> None:
        problem, hard, easy = self.problem, self.starts.hard, self.starts.easy[:, members]
        choice = alternatives(hard[:, plot], problem.hard_shape, axes)
        now = self._of_plot(problem.rows[hard[:, plot, None], easy][:, None], plot)
        new = self._of_plot(problem.rows[choice[:, :, None], easy[:, None, :]], plot)
        m = self._m[:, None] - now + new
        if problem.target is None:
            sign, value = np.linalg.slogdet(m)
            gain = np.where(sign > 0, value - np.linalg.slogdet(self._m)[1][:, None], -np.inf)
        else:
            old = np.sum(self._inverse * problem.target, axis=(1, 2))
            new_value = np.sum(np.linalg.inv(m) * problem.target, axis=(2, 3))
            gain = np.where(new_value > 0, 1.0 - new_value / old[:, None], -np.inf)
        gain = np.where(problem.allowed[choice[:, :, None], easy[:, None, :]].all(axis=2), gain, -np.inf)
        best, better = _choose(gain)
        hard[better, plot] = choice[self._each, best][better]
        self._update(better)

    def _of_plot(self, rows: FloatArray, plot: int) -> FloatArray:
        """(S, q, p, p) information of a whole plot from its (S, q, m, p) rows."""
        mean = rows.mean(axis=2, keepdims=True)
        rows = rows - float(share(self.problem.sizes[plot], self.problem.eta)) * mean
        return np.asarray(np.matmul(rows.transpose(0, 1, 3, 2), rows))

    def _update(self, better: NDArray[np.bool_]) -> None:
        """Information of the changed designs, computed anew so that no rounding errors add up."""
        if not better.any():
            return
        self._m[better] = information(self.problem, self.starts[better]) + self._ridge
        self._inverse[better] = np.linalg.inv(self._m[better])
        self._changed |= better


def _choose(gain: FloatArray) -> tuple[IntArray, NDArray[np.bool_]]:
    """(S,) best alternative of each design, the first of equal ones, and whether it is an improvement."""
    best = np.argmax(np.round(gain, 10), axis=1)
    return best, gain[np.arange(len(gain)), best] > GAIN


def _products(z: FloatArray, x: FloatArray, s: FloatArray, k: NDArray[np.floating[Any]]) -> FloatArray:
    """(S, q, 3, 3) products U' K U for U = [z, x, s], with (S, q, p) z, (S, p) x and s, and (S, p, p) K."""
    zk = np.matmul(z, k)
    fixed = np.stack([x, s], axis=2)
    out = np.empty((*z.shape[:2], 3, 3))
    out[:, :, 0, 0] = np.einsum("sqp,sqp->sq", zk, z)
    out[:, :, 0, 1:] = np.matmul(zk, fixed)
    out[:, :, 1:, 0] = out[:, :, 0, 1:]
    out[:, :, 1:, 1:] = np.matmul(fixed.transpose(0, 2, 1), np.matmul(k, fixed))[:, None]
    return out


def _adjugate(a: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Adjugates and determinants of (.., 3, 3) matrices."""
    rows = a[..., 0, :], a[..., 1, :], a[..., 2, :]
    columns = [np.cross(rows[1], rows[2]), np.cross(rows[2], rows[0]), np.cross(rows[0], rows[1])]
    return np.stack(columns, axis=-1), np.sum(rows[0] * columns[0], axis=-1)
