"""Rows of a table with their declared model, linear or not, with weights or stated uncertainties."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.fitter import LinearFit, least_squares
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError
from rig.fitter.gross import GrossErrors
from rig.fitter.nonlinear import Distance, Solved, Weighted, solve, solve_lowest
from rig.fitter.split_plot import SplitPlotFit, fit_split_plot
from rig.procedures.general.gross import of_table

_ROUNDS, _SAME = 50, 1e-10
CLEARLY = 0.5
"""Ratio of standard deviations below which one set of rows explains the scatter clearly better than another."""


class Rows(ABC):
    """Rows and their model.

    Attributes:
        y: (n,) response.
        plots: (n,) identity of each row's whole plot; None for independent rows.
        blocks: (n,) replication of each row's whole plot; None if they are not nested.
    """

    y: FloatArray
    plots: IntArray | None
    blocks: IntArray | None

    @abstractmethod
    def take(self, rows: IntArray) -> Rows:
        """Some of the rows."""

    @abstractmethod
    def gross(self) -> GrossErrors:
        """The gross errors among them."""

    @abstractmethod
    def fitted(self) -> LinearFit | SplitPlotFit:
        """The model fitted to them. Raises `FitError`."""

    @abstractmethod
    def tangent(self, fit: LinearFit | SplitPlotFit) -> tuple[FloatArray, FloatArray]:
        """(n, k) columns and (n,) responses of the linear model at a fit of these rows, in standard deviations if they
        are weighted: the responses less the columns times the coefficients are the residuals.
        """

    @abstractmethod
    def values(self, fit: LinearFit | SplitPlotFit) -> FloatArray:
        """(n,) fitted responses."""

    @abstractmethod
    def scale_at(self, fit: LinearFit | SplitPlotFit) -> FloatArray:
        """(n,) one over the standard deviation of a response less the curve, up to a factor."""

    def _taken(self, rows: IntArray) -> tuple[IntArray | None, IntArray | None]:
        plots, blocks = (None if given is None else given[rows] for given in (self.plots, self.blocks))
        return plots, blocks

    def _numbered_plots(self) -> IntArray | None:
        return None if self.plots is None else np.unique(self.plots, return_inverse=True)[1].reshape(-1)


@dataclass(frozen=True, eq=False)
class LinearRows(Rows):
    """Rows of a model that is linear in its coefficients.

    Attributes:
        names: of the k columns.
        columns: (n, k).
        tails: (n, k) rounding errors of the doubles in `columns`.
        y: see `Rows`.
        plots: see `Rows`.
        blocks: see `Rows`.
        scale: (n,) one over the standard deviation of a row, up to a common factor; None if all are equal.
    """

    names: Sequence[str]
    columns: FloatArray
    tails: FloatArray
    y: FloatArray
    plots: IntArray | None
    blocks: IntArray | None
    scale: FloatArray | None = None

    def take(self, rows: IntArray) -> LinearRows:
        """Some of the rows."""
        scale = None if self.scale is None else self.scale[rows]
        return LinearRows(self.names, self.columns[rows], self.tails[rows], self.y[rows], *self._taken(rows), scale)

    def gross(self) -> GrossErrors:
        """The gross errors among them."""
        if self.scale is not None:
            return of_table(*self._scaled(), self._numbered_plots(), measured=self.y, scale=self.scale)
        return of_table(self.y, self.columns, self._numbered_plots())

    def fitted(self) -> LinearFit | SplitPlotFit:
        """The model fitted to them. Raises `FitError`."""
        if self.plots is not None:
            return fit_split_plot(self.columns, self.y, self.plots, self.names, replicate=self.blocks)
        if self.scale is None:
            return least_squares(self.columns, self.y, self.names, tails=self.tails)
        y, columns = self._scaled()
        return least_squares(columns, y, self.names)

    def _scaled(self) -> tuple[FloatArray, FloatArray]:
        scale = np.ones(len(self.y)) if self.scale is None else self.scale
        return scale * self.y, scale[:, None] * self.columns

    def scale_at(self, fit: LinearFit | SplitPlotFit) -> FloatArray:
        """(n,) one over the standard deviation of a response less the curve, up to a factor."""
        return np.ones(len(self.y)) if self.scale is None else self.scale

    def tangent(self, fit: LinearFit | SplitPlotFit) -> tuple[FloatArray, FloatArray]:
        """(n, k) columns and (n,) responses of the linear model at a fit of these rows, in standard deviations if they
        are weighted: the responses less the columns times the coefficients are the residuals.
        """
        y, columns = self._scaled()
        return columns, y

    def values(self, fit: LinearFit | SplitPlotFit) -> FloatArray:
        """(n,) fitted responses."""
        return np.asarray(self.columns @ fit.coefficients)


@dataclass(frozen=True, eq=False)
class CurveRows(Rows):
    """Rows of a curve that is not linear in its parameters, or with errors in the abscissa.

    Attributes:
        problem: residuals of the rows.
        start: (k,) parameters to begin with.
        plots: see `Rows`.
        blocks: see `Rows`.
    """

    problem: Weighted | Distance
    start: FloatArray
    plots: IntArray | None
    blocks: IntArray | None

    @property
    def y(self) -> FloatArray:  # type: ignore[override]
        """(n,) measured responses."""
        return self.problem.y

    def take(self, rows: IntArray) -> CurveRows:
        """Some of the rows."""
        return CurveRows(self.problem.take(rows), self.start, *self._taken(rows))

    def gross(self) -> GrossErrors:
        """The gross errors among them. The curve is made linear at a fit that a few gross errors do not pull.

        Very large ones pull that, too: so it is made again without the rows that are off from the curve at its start,
        and counts if the others scatter clearly less.
        """
        found = self._off_at(self._solved(robust=True).fit.coefficients)
        first = self._off_at(self.start)
        if np.setdiff1d(first.rows, found.rows).size:
            others = np.setdiff1d(np.arange(len(self.y)), first.rows)
            try:
                again = self._off_at(self.take(others)._solved(robust=True).fit.coefficients)
            except FitError:
                return found
            if np.median(again.sd) < CLEARLY * np.median(found.sd):
                return again
        return found

    def _off_at(self, b: FloatArray) -> GrossErrors:
        # Columns at abscissae as measured: the point of the curve nearest to a very bad row is far beyond all others,
        # and its row would determine the slope.
        scale = self.problem.scale_at(b)
        columns = scale[:, None] * self.problem.curve.rows(b, self.problem.table)
        y = self.problem.residuals(b) + columns @ b
        if np.ptp(scale) > 0.0:
            return of_table(y, columns, self._numbered_plots(), measured=self.y, scale=scale)
        return of_table(y / scale, columns / scale[:, None], self._numbered_plots(), measured=self.y)  # in its units

    def fitted(self) -> LinearFit | SplitPlotFit:
        """The model fitted to them. With whole plots: linear fits at the last parameters, until those stay."""
        solved = self._solved()
        if self.plots is None:
            return solved.fit
        b, fit = solved.fit.coefficients, self._split(solved)
        for _ in range(_ROUNDS):
            moved = np.abs(fit.coefficients - b) / np.maximum(np.abs(fit.coefficients), 1e-300)
            b = fit.coefficients
            if moved.max() < _SAME:
                return fit
            columns, residuals = self.problem.columns(b), self.problem.residuals(b)
            fit = self._split(Solved(replace(solved.fit, coefficients=b), columns, residuals))
        raise FitError("the curve was not found with whole plots; give start values nearer to the solution")

    def _solved(self, *, robust: bool = False) -> Solved:
        """With errors in the abscissa there are many minima: the lowest of those from several starts."""
        if isinstance(self.problem, Distance):
            return solve_lowest(self.problem, self.start, robust=robust)
        return solve(self.problem, self.start, robust=robust)

    def _split(self, solved: Solved) -> SplitPlotFit:
        if self.plots is None:
            raise ValueError("rows without whole plots")
        y = solved.residuals + solved.columns @ solved.fit.coefficients
        return fit_split_plot(solved.columns, y, self.plots, self.problem.parameters, replicate=self.blocks)

    def scale_at(self, fit: LinearFit | SplitPlotFit) -> FloatArray:
        """(n,) one over the standard deviation of a response less the curve, up to a factor."""
        return self.problem.scale_at(fit.coefficients)

    def tangent(self, fit: LinearFit | SplitPlotFit) -> tuple[FloatArray, FloatArray]:
        """(n, k) columns and (n,) responses of the linear model at a fit of these rows, in standard deviations if they
        are weighted: the responses less the columns times the coefficients are the residuals.
        """
        columns = self.problem.columns(fit.coefficients)
        return columns, self.problem.residuals(fit.coefficients) + columns @ fit.coefficients

    def values(self, fit: LinearFit | SplitPlotFit) -> FloatArray:
        """(n,) fitted responses."""
        return self.problem.curve.value(fit.coefficients, self.problem.table)
