"""Rows of several sensors over their errors, beside a model and some candidates, in the strata of these errors.

Whitened by one covariance of each sensor, its rows have orthogonal parts: one number of each group, which has the
group's offset; one more where groups have slopes; and the rest. Each part has a mean square of its own. So few groups
count as few, and in a balanced design these are the strata of its analysis of variance.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.quantiles import t_limit
from rig.fitter.trace.engine.components import Components
from rig.fitter.trace.engine.noise import Noise
from rig.fitter.trace.whitened import Whitened

Level = Literal["subplot", "whole-plot"]
LEVELS: tuple[Level, ...] = ("whole-plot", "subplot")

RESOLVED = 1e-12
"""Relative size of an output's range below which differences are rounding."""
NOTHING_LEFT = 1e-3
"""Minimum remaining share of a column beside the model."""
FREE = 0.5
"""Share of a direction between groups that the model leaves, from which it is free."""
LEAST_DF = 0.5
"""Degrees of freedom from which a part has a mean square of its own."""
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class Coefficient:
    """Estimate of one candidate beside the others, in its own unit."""

    value: float
    stderr: float
    df: float

    @property
    def half_width_95(self) -> float:
        """Half-width of its 95 % interval."""
        return t_limit(0.95, self.df) * self.stderr


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors of the rows of one sensor.

    Attributes:
        noise: one covariance, of rows over `sd`; levels are those of its components of groups, if it has any.
        sd: (n,) of each row over the usual one.
    """

    noise: Noise
    sd: FloatArray

    def white(self, columns: FloatArray) -> FloatArray:
        """(n, m) columns over these errors."""
        return np.asarray(self.noise.whiten(np.array([0]), columns / self.sd[:, None])[0])

    @property
    def slopes_differ(self) -> bool:
        """Whether groups have slopes of their own."""
        return isinstance(self.noise, Components) and bool(self.noise.grid[0, 1] > 0.0)

    @cached_property
    def members(self) -> FloatArray:
        """(n, W) one where a row is of a group, else zero."""
        if not isinstance(self.noise, Components):
            return np.empty((len(self.sd), 0))
        group = self.noise.group
        return np.asarray(group[:, None] == np.arange(int(group.max()) + 1), np.float64)

    @cached_property
    def length(self) -> FloatArray:
        """(W,) an offset of one of each group, over its own error."""
        return np.asarray(np.linalg.norm(self.white(self.members), axis=0))

    @cached_property
    def offsets(self) -> FloatArray:
        """(n, W) unit columns along the groups' offsets."""
        return np.asarray(self.white(self.members) / self.length)

    @cached_property
    def slopes(self) -> FloatArray:
        """(n, W) unit columns along the groups' slopes beside their offsets; zero where a group has none."""
        variable = self.noise.variable if isinstance(self.noise, Components) else self.sd
        own = self.white(self.members * variable[:, None])
        own = own - self.offsets * np.sum(self.offsets * own, axis=0)
        length = np.linalg.norm(own, axis=0)
        return np.where(length > NOTHING_LEFT * np.max(length, initial=TINY), own / np.maximum(length, TINY), 0.0)

    @cached_property
    def parts(self) -> tuple[FloatArray, ...]:
        """(n, w) of offsets, and of slopes if they differ."""
        return (self.offsets, self.slopes) if self.slopes_differ else (self.offsets,)


@dataclass(frozen=True, eq=False)
class White:
    """A run over its errors.

    Attributes:
        errors: of each of S sensors.
        declared: (n, k) columns of the declared model.
        outputs: (S, n).
        columns: (S, n, J) of the candidates, zero for sensors that they do not concern.
    """

    errors: tuple[Errors, ...]
    declared: FloatArray
    outputs: FloatArray
    columns: FloatArray

    @cached_property
    def bases(self) -> tuple[FloatArray, ...]:
        """(n, r) for each sensor, orthonormal, of the declared columns."""
        return tuple(orthonormal(errors.white(self.declared)) for errors in self.errors)

    @cached_property
    def beside(self) -> tuple[Whitened, FloatArray]:
        """Outputs (S, n) and columns (S, n, J) beside the declared ones; and (S, J) lengths of columns before that."""
        count, n, every = self.columns.shape
        outputs, columns, length = np.empty((count, n)), np.zeros(self.columns.shape), np.zeros((count, every))
        for i, errors in enumerate(self.errors):
            mine = np.flatnonzero(np.any(self.columns[i] != 0.0, axis=0))
            own = errors.white(np.column_stack([self.outputs[i], self.columns[i][:, mine]]))
            length[i, mine] = np.linalg.norm(own[:, 1:], axis=0)
            for _ in range(2):  # once leaves rounding errors
                own = own - self.bases[i] @ (self.bases[i].T @ own)
            outputs[i], columns[i][:, mine] = own[:, 0], own[:, 1:]
        return Whitened(outputs, columns), length

    def view(self, level: Level | None, taken: Sequence[int], sigma: FloatArray | None = None) -> View:
        """A level, or all rows, beside some candidates."""
        return View(self, level, tuple(taken), sigma)

    @cached_property
    def rounding(self) -> FloatArray:
        """(S,) errors that are rounding."""
        return np.asarray(np.maximum(RESOLVED * np.ptp(self.outputs, axis=1), TINY))

    def coefficients(self, chosen: Sequence[int]) -> dict[int, Coefficient]:
        """The `chosen` candidates fitted together, each with the errors of the parts of rows that tell it."""
        if not len(chosen):
            return {}
        view = self.view(None, chosen)
        columns = view.scaled(chosen)
        length = np.maximum(np.linalg.norm(columns, axis=0), TINY)
        dual = np.linalg.pinv(columns / length, rcond=1e-9).T / length
        y = (self.beside[0].outputs / view.sigma[:, None]).ravel()
        variance, df = view.variances(dual)
        each = zip(chosen, (dual.T @ y).tolist(), np.sqrt(variance).tolist(), df.tolist(), strict=True)
        return {j: Coefficient(value, error, free) for j, value, error, free in each}

    def alone(self, chosen: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """(J,) coefficients of all candidates, each by itself beside those `chosen`, and standard errors; 0 and 1 for
        none.
        """
        view, count = self.view(None, chosen), self.columns.shape[2]
        columns = view.of(range(count), range(len(self.errors)))
        square = np.sum(columns**2, axis=0)
        length = np.linalg.norm(self.beside[1] / view.sigma[:, None], axis=0)
        able = square > (NOTHING_LEFT * length) ** 2
        dual = np.where(able, columns / np.where(able, square, 1.0), 0.0)
        value, error = dual.T @ view.outputs.ravel(), np.ones(count)
        error[able] = np.sqrt(view.variances(dual[:, able])[0])
        return value, error


class View:
    """Outputs and columns at a level, over the sensors' errors there, beside some candidates.

    Args:
        white: the run.
        level: between groups: one row of each; within them: rows without the offset of their group; None for all rows.
        taken: candidates in the model.
        sigma: (S,) errors that count as one; None for those beside the candidates.
    """

    def __init__(self, white: White, level: Level | None, taken: tuple[int, ...], sigma: FloatArray | None) -> None:
        self.white, self.level = white, level
        (rows, length), (count, n) = white.beside, white.outputs.shape
        columns, length = rows.columns[:, :, list(taken)], length[:, list(taken)]
        self._own = [orthonormal(one, size, NOTHING_LEFT) for one, size in zip(columns, length, strict=True)]
        left = [y - basis @ (basis.T @ y) for y, basis in zip(rows.outputs, self._own, strict=True)]
        free = [n - one.shape[1] - own.shape[1] for one, own in zip(white.bases, self._own, strict=True)]
        self._first = np.sqrt(np.sum(np.square(left), axis=1) / np.maximum(free, 1.0))
        self._first = np.maximum(self._first, white.rounding)
        stacked = (columns / self._first[:, None, None]).reshape(count * n, len(taken))
        self._joint = orthonormal(stacked, np.linalg.norm(length / self._first[:, None], axis=0), 1e-6)
        y = (rows.outputs / self._first[:, None]).ravel()
        self.residual = (y - self._joint @ (self._joint.T @ y)).reshape(count, n)
        along = [errors.offsets.T @ self._basis(i) for i, errors in enumerate(white.errors)]
        self._directions = [np.linalg.eigh(np.eye(len(one)) - one @ one.T) for one in along]
        self.df = np.array(free, np.float64)
        if level == "whole-plot":
            self.df = np.array([float(np.sum(values > FREE)) for values, _ in self._directions])
        elif level == "subplot":
            self.df = self.df - [float(np.sum(values)) for values, _ in self._directions]
        outputs = np.stack([self._at(y[:, None], i)[:, 0] for i, y in enumerate(self.residual)])
        own = np.sqrt(np.sum(outputs**2, axis=1) / np.maximum(self.df, 1.0))
        own = np.where(self.df > 0, np.maximum(own, white.rounding / self._first), 1.0)
        self.sigma = self._first * own if sigma is None else sigma
        self._scale = self._first / self.sigma
        self.outputs = outputs * self._scale[:, None]

    def _basis(self, i: int) -> FloatArray:
        """(n, r) what the model has of the rows of a sensor."""
        n = self.residual.shape[1]
        return np.hstack([self.white.bases[i], self._joint[i * n : (i + 1) * n]])

    def _at(self, rows: FloatArray, i: int) -> FloatArray:
        """(m, q) what rows (n, q) of a sensor, beside the model, have at the level."""
        offsets = self.white.errors[i].offsets
        if self.level is None:
            return rows
        if self.level == "subplot":
            return np.asarray(rows - offsets @ (offsets.T @ rows))
        values, vectors = self._directions[i]
        kept = values > FREE
        return np.asarray((vectors[:, kept] / np.sqrt(values[kept])) @ (vectors[:, kept].T @ (offsets.T @ rows)))

    def free(self, i: int) -> FloatArray:
        """(W, d) orthonormal directions between groups that the model leaves free."""
        values, vectors = self._directions[i]
        return vectors[:, values > FREE]

    def scaled(self, picked: Sequence[int]) -> FloatArray:
        """(S n, q) rows of some candidates beside the declared columns, over the sensors' errors."""
        some = self.white.beside[0].columns[:, :, list(picked)] / self._first[:, None, None]
        return np.asarray(some.reshape(self.residual.size, len(picked)))

    def of(self, picked: Sequence[int], sensors: Sequence[int]) -> FloatArray:
        """(s m, q) of candidates in some sensors."""
        some = self.scaled(picked)
        some = (some - self._joint @ (self._joint.T @ some)).reshape(*self.residual.shape, len(picked))
        return np.concatenate([self._scale[i] * self._at(some[i], i) for i in sensors])

    def length(self, columns: FloatArray, i: int) -> FloatArray:
        """(q,) lengths of columns (n, q) in a sensor at the level, before anything of the model is removed."""
        own = self.white.errors[i].white(columns)
        own = self.white.errors[i].offsets.T @ own if self.level == "whole-plot" else own
        return np.asarray(np.linalg.norm(own, axis=0) / self.sigma[i])

    def project(self, columns: FloatArray, i: int) -> FloatArray:
        """(m, q) columns (n, q) of a sensor, with the model removed."""
        left = self.white.errors[i].white(columns)
        for basis in (self.white.bases[i], self._own[i]):
            left = left - basis @ (basis.T @ left)
        return np.asarray(self._at(left, i) / self.sigma[i])

    def variances(self, dual: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(q,) variances of sums of all rows with such weights (S n, q), and their degrees of freedom.

        By the mean square of each part of the rows (Satterthwaite, Biometrics Bulletin 2 (1946) 110).
        """
        n, variance, spread = self.residual.shape[1], np.zeros(dual.shape[1]), np.zeros(dual.shape[1])
        for i in range(len(self.residual)):
            own = dual[i * n : (i + 1) * n]
            if np.any(own):
                for share, mean, df in self._parts(i, own):
                    variance += share * mean
                    spread += (share * mean) ** 2 / df
        return np.maximum(variance, TINY), np.maximum(variance, TINY) ** 2 / np.maximum(spread, TINY)

    def _parts(self, i: int, own: FloatArray) -> Iterator[tuple[FloatArray, float, float]]:
        """(q,) sums of squares of columns (n, q) in each part of a sensor's rows, its mean square, and its df."""
        left, basis = self.residual[i], self._basis(i)
        total, rest, df = np.sum(own**2, axis=0), float(left @ left), float(len(left) - np.sum(basis**2))
        pooled = max(rest / max(df, 1.0), TINY), max(df, 1.0)
        for part in self.white.errors[i].parts:
            free = float(np.sum(np.any(part != 0.0, axis=0)) - np.sum((part.T @ basis) ** 2))
            square, share = float(np.sum((part.T @ left) ** 2)), np.sum((part.T @ own) ** 2, axis=0)
            total, rest, df = total - share, rest - square, df - free
            yield (share, max(square / free, TINY), free) if free > LEAST_DF else (share, *pooled)
        total = np.maximum(total, 0.0)
        yield (total, max(rest / df, TINY), df) if df > LEAST_DF else (total, *pooled)
