"""Least-squares problems: residuals in standard deviations as a function of the parameters, and their derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.linalg import solve_triangular

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError
from rig.fitter.nonlinear.curve import Curve
from rig.fitter.nonlinear.nearest import Measured


class Problem(Protocol):
    """Residuals of m numbers, each with standard deviation one (or with one unknown standard deviation)."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the k parameters."""

    @property
    def size(self) -> float:
        """Root sum of squares of the measured responses in standard deviations, for rounding errors."""

    def residuals(self, b: FloatArray) -> FloatArray:
        """(m,) measured minus fitted. Raises `FitError` where the curve is undefined."""

    def columns(self, b: FloatArray) -> FloatArray:
        """(m, k) derivative of what is fitted: minus that of the residuals."""


@dataclass(frozen=True, eq=False)
class Weighted:
    """Errors in the response only.

    Attributes:
        curve: of k parameters.
        table: (n,) columns by name.
        y: (n,) response.
        scale: (n,) one over the standard deviation, up to a common factor.
    """

    curve: Curve
    table: Mapping[str, FloatArray]
    y: FloatArray
    scale: FloatArray

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the k parameters."""
        return self.curve.parameters

    @property
    def size(self) -> float:
        """Root sum of squares of the measured responses in standard deviations, for rounding errors."""
        return float(np.linalg.norm(self.scale * self.y))

    def residuals(self, b: FloatArray) -> FloatArray:
        """(m,) measured minus fitted. Raises `FitError` where the curve is undefined."""
        return np.asarray(self.scale * (self.y - self.curve.value(b, self.table)))

    def columns(self, b: FloatArray) -> FloatArray:
        """(m, k) derivative of what is fitted: minus that of the residuals."""
        return np.asarray(self.scale[:, None] * self.curve.rows(b, self.table))

    def scale_at(self, b: FloatArray) -> FloatArray:
        """(n,) one over the standard deviation of a response less the curve."""
        return self.scale

    def take(self, rows: IntArray) -> Weighted:
        """Some of the rows."""
        return Weighted(self.curve, _taken(self.table, rows), self.y[rows], self.scale[rows])


@dataclass(frozen=True, eq=False)
class Distance:
    """Errors in the response and in one column, all independent: generalised distance regression.

    The sum of ((x - xi) / u_x)^2 + ((y - f(xi, b)) / u_y)^2 is minimised over the true values xi of each row and over
    b (ISO/TS 28037:2010, clause 7, for a straight line). For given b each xi is found by itself, on all branches of the
    curve. Each row then has one residual, its distance from the curve with the sign of y - f, whose derivative is
    -df/db / (u_y^2 + f'^2 u_x^2)^0.5, at xi: at the minimum over xi, moving xi changes nothing to first order.

    Attributes:
        curve: of k parameters.
        table: (n,) columns by name.
        name: of the column with errors.
        y: (n,) response.
        u_x: (n,) standard uncertainty of the column, may be zero.
        u_y: (n,) standard uncertainty of the response, above zero.
        known: true values of the last parameters.
    """

    curve: Curve
    table: Mapping[str, FloatArray]
    name: str
    y: FloatArray
    u_x: FloatArray
    u_y: FloatArray
    known: dict[bytes, dict[str, FloatArray]] = field(default_factory=dict, repr=False)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the k parameters."""
        return self.curve.parameters

    @property
    def size(self) -> float:
        """Root sum of squares of the measured responses in standard deviations, for rounding errors."""
        return float(np.linalg.norm(self.y / self.u_y))

    def residuals(self, b: FloatArray) -> FloatArray:
        """(m,) measured minus fitted. Raises `FitError` where the curve is undefined."""
        return self._measured(b).residuals(self.true_values(b)[self.name])

    def columns(self, b: FloatArray) -> FloatArray:
        """(m, k) derivative of what is fitted: minus that of the residuals."""
        at = self.true_values(b)
        return np.asarray(self.curve.rows(b, at) / self._effective(b, at)[:, None])

    def _effective(self, b: FloatArray, at: Mapping[str, FloatArray]) -> FloatArray:
        """(n,) standard uncertainty of a response less the curve."""
        return np.asarray(np.hypot(self.u_y, self.curve.slope(b, at, self.name) * self.u_x))

    def true_values(self, b: FloatArray) -> dict[str, FloatArray]:
        """The columns, with the estimated true values of that with errors."""
        key = b.tobytes()
        if key not in self.known:
            last = next(iter(self.known.values()), self.table)[self.name]
            xi, square = self._measured(b).nearest(last)
            if not np.isfinite(square).all():
                self.curve.value(b, self.table)  # raises the error that says where
            self.known.clear()
            self.known[key] = {**self.table, self.name: xi}
        return self.known[key]

    def _measured(self, b: FloatArray) -> Measured:
        return Measured(self.curve, b, self.table, self.name, self.y, self.u_x, self.u_y)

    def scale_at(self, b: FloatArray) -> FloatArray:
        """(n,) one over the standard deviation of a response less the curve."""
        return np.asarray(1.0 / self._effective(b, self.true_values(b)))

    def take(self, rows: IntArray) -> Distance:
        """Some of the rows."""
        given = (self.y[rows], self.u_x[rows], self.u_y[rows])
        return Distance(self.curve, _taken(self.table, rows), self.name, *given)


@dataclass(frozen=True, eq=False)
class Correlated:
    """Errors in the response and in one column, with any covariance: generalised Gauss-Markov regression.

    ISO/TS 28037:2010, clauses 8 to 10, for a straight line. The true values of the column are parameters too, before
    those of the curve.

    Attributes:
        curve: of k parameters.
        table: (n,) columns by name.
        name: of the column with errors.
        y: (n,) response.
        covariance: (2n, 2n) of the column's values and then the responses; positive definite.
    """

    curve: Curve
    table: Mapping[str, FloatArray]
    name: str
    y: FloatArray
    covariance: FloatArray

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the k parameters."""
        return (*(f"{self.name}[{i}]" for i in range(len(self.y))), *self.curve.parameters)

    @property
    def size(self) -> float:
        """Root sum of squares of the measured responses in standard deviations, for rounding errors."""
        both = np.concatenate([self.table[self.name], self.y])
        return float(np.linalg.norm(solve_triangular(self._root, both, lower=True)))

    @cached_property
    def _root(self) -> FloatArray:
        try:
            return np.asarray(np.linalg.cholesky(self.covariance))
        except np.linalg.LinAlgError as problem:
            raise FitError("the covariance of abscissa and response is not positive definite") from problem

    def start(self, b: FloatArray) -> FloatArray:
        """(n + k,) parameters from (k,) of the curve."""
        return np.concatenate([self.table[self.name], b])

    def residuals(self, b: FloatArray) -> FloatArray:
        """(m,) measured minus fitted. Raises `FitError` where the curve is undefined."""
        xi, curve, at = self._parts(b)
        left = np.concatenate([self.table[self.name] - xi, self.y - self.curve.value(curve, at)])
        return np.asarray(solve_triangular(self._root, left, lower=True))

    def columns(self, b: FloatArray) -> FloatArray:
        """(m, k) derivative of what is fitted: minus that of the residuals."""
        xi, curve, at = self._parts(b)
        slope = np.diag(self.curve.slope(curve, at, self.name))
        made = np.block([[np.eye(len(xi)), np.zeros((len(xi), len(curve)))], [slope, self.curve.rows(curve, at)]])
        return np.asarray(solve_triangular(self._root, made, lower=True))

    def _parts(self, b: FloatArray) -> tuple[FloatArray, FloatArray, dict[str, FloatArray]]:
        n = len(self.y)
        return b[:n], b[n:], {**self.table, self.name: b[:n]}


def _taken(table: Mapping[str, FloatArray], rows: IntArray) -> dict[str, FloatArray]:
    return {name: values[rows] for name, values in table.items()}
