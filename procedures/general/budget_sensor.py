"""One sensor of a general run in its budget: calibration, scatter, coefficients, outputs and inferred values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rig.fitter import LinearFit
from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.strata import Strata, reversed_by, sides_of, strata
from rig.procedures.column_names import spelled, stem_of, unit_of
from rig.procedures.evaluate.scatter_for_budgets import Scatter, scatter
from rig.procedures.general.declared import Declared, Model, model_of
from rig.procedures.general.fit import calibration_of
from rig.procedures.general.infer import CurveCalibration
from rig.procedures.general.strata_of_run import in_time, points_of, replication_of, side_of
from rig.procedures.tables.table import Columns, Table

_ITERATIONS, _TOLERANCE = 50, 1e-13


@dataclass(frozen=True, eq=False)
class Sensor:
    """One output of the run.

    Attributes:
        name: its output.
        table: of the run.
        declared: its model.
        plots: columns that identify whole plots.
        at: (p,) values of every variable of the model, by name.
        expected: sum of squares that stated errors leave in the residuals; None if that is not known.
        beside: (n, q) effects that were fitted and taken off the output.
        slopes: (n, c) how what was taken off changes with its searched constants.
        by_side: (n,) the part of what was taken off that is of the direction of approach.
        abscissa: the variable that is inferred, at the points' values of the others; None for the only one.
    """

    name: str
    table: Table
    declared: Declared
    plots: tuple[str, ...]
    at: Mapping[str, FloatArray]
    expected: float | None = None
    beside: FloatArray | None = None
    slopes: FloatArray | None = None
    by_side: FloatArray | None = None
    abscissa: str | None = None

    @property
    def uses(self) -> set[str]:
        """Columns that its calibration depends on: variables of its formula, and its output."""
        return {*self.plain.formula.names, self.name}

    def _model(self, moved: Columns) -> Model:
        every = self.table.columns
        table = replace(self.table, columns={**every, **{name: every[name] + more for name, more in moved.items()}})
        return model_of(self.declared, table, self.name, self.plots, None)

    @cached_property
    def plain(self) -> CurveCalibration:
        """Calibration of the run, with the scatter of its residuals."""
        model = self._model({})
        rows = np.arange(len(self.table))
        return calibration_of(model.rows.fitted(), self.name, model, self.table, rows, ())

    @cached_property
    def calibration(self) -> CurveCalibration:
        """Calibration of the run, with the scatter that its budget has."""
        one, found = self.plain, self.readings_scatter
        if found is None or not found.explained:
            return one
        ratio = found.variance / float(one.variances[0])
        factor = None if one.factor is None else replace(one.factor, covariance=ratio * one.factor.covariance)
        spread = np.array([[2.0 * found.variance**2 / found.df]])
        return replace(
            one, covariance=ratio * one.covariance, variances=np.array([found.variance]), spread=spread, factor=factor
        )

    def residuals(self, moved: Columns) -> FloatArray:
        """(n,) residuals with additions to columns."""
        rows = self._model(moved).rows
        return np.asarray(rows.y - rows.values(rows.fitted()))

    @cached_property
    def readings_scatter(self) -> Scatter | None:
        """Scatter of independent rows; None if it is stated, or has whole plots."""
        rows = self._model({}).rows
        fit = rows.fitted()
        even = isinstance(fit, LinearFit) and float(np.ptp(rows.scale_at(fit))) == 0.0
        if not even or len(self.plain.variances) != 1 or self.plain.reading is not None or fit.df < 1:
            return None
        left, point = self.residuals({}), points_of(self.table)
        inside = left - (np.bincount(point, left) / np.bincount(point))[point]
        pure_df = len(left) - len(np.unique(point))
        total = float(self.plain.variances[0]) * float(np.max(fit.df))
        return scatter(total, float(np.max(fit.df)), float(inside @ inside), pure_df, self.expected or 0.0)

    @cached_property
    def strata(self) -> Strata | None:
        """Series, replications and neighbours in time among the rows; None where `readings_scatter` is."""
        found = self.readings_scatter
        if found is None:
            return None
        time, pure = in_time(self.table), (found.variance, found.df) if found.explained else None
        beside, slopes = (None if one is None else one[time] for one in (self.beside, self.slopes))
        left, replicate, side = self.residuals({}), replication_of(self.table), side_of(self.table)
        return strata(self._tangent[time], left[time], replicate[time], side[time], beside, pure, slopes)

    @cached_property
    def _tangent(self) -> FloatArray:
        """(n, k) derivative of the rows by the coefficients."""
        rows = self._model({}).rows
        fit = rows.fitted()
        return np.asarray(rows.tangent(fit)[0] / rows.scale_at(fit)[:, None])

    @property
    def reversibility(self) -> tuple[FloatArray, FloatArray] | None:
        """See `Calibrated`. The size is as uncertain as the results are by the fit."""
        found = None if self.strata is None else self.strata.reversed
        if self.by_side is not None:
            side = side_of(self.table)
            side = side if side.any() else np.sign(self.by_side)  # of one of several factors that go up and down
            off = sides_of(reversed_by(self._tangent, self.by_side, side))
            found = off if found is None else found + off
        return None if found is None else (found @ self._jacobian.T, self.scatter()[2])

    def coefficients(self, moved: Columns) -> FloatArray:
        """(k,) coefficients with additions to columns that it uses."""
        return np.asarray(self._model(moved).rows.fitted().coefficients)

    @property
    def fitted(self) -> FloatArray:
        """(k,) coefficients of the calibration."""
        return self.calibration.coefficients

    @cached_property
    def _inverse(self) -> CurveCalibration:
        """The calibration as a curve of its abscissa, at the points' values of the other variables."""
        if self.abscissa is None or not self.has_points:
            return self.calibration
        return self.calibration.at({name: v for name, v in self._given.items() if name != self.abscissa})

    @property
    def variable(self) -> str | None:
        """The variable that a reading determines; None if there are several."""
        try:
            return self._inverse.variable
        except FitError:
            return None

    @property
    def not_inferred(self) -> str:
        """Why no quantity is inferred from a model of several variables, a sentence; "" if one is."""
        names = self.calibration.formula.names
        if len(names) < 2:
            return ""
        if lacking := [name for name in names if name not in self.at]:
            told = ", ".join(lacking)
            return f"{self.name}: no output is stated and nothing is inferred, since the points lack {told}: --at"
        if self.variable is None:
            return (
                f'{self.name}: nothing is inferred, since its model has {", ".join(names)}: abscissa = "{names[0]}" in '
                f"[model] says which of them a reading determines"
            )
        return ""

    @property
    def about_inferred(self) -> str:
        """How a variable of several is inferred, a sentence; "" if none is, or it is the only one."""
        others = [_plainly(name) for name in self.calibration.formula.names if name != self.variable]
        if not others or self.not_inferred or self.variable is None:
            return ""
        its = "its error in use is" if len(others) == 1 else "their errors in use are"
        known = (
            f"{self.name}: {_plainly(self.variable)} is inferred with {' and '.join(others)} as stated at each point"
        )
        return f"{known}; {its} not in the uncertainty"

    @cached_property
    def _given(self) -> Mapping[str, FloatArray]:
        return {name: self.at[name] for name in self.calibration.formula.names}

    @property
    def has_points(self) -> bool:
        """Whether every variable of the model is given at the points."""
        return set(self.calibration.formula.names) <= set(self.at)

    @cached_property
    def readings(self) -> FloatArray:
        """(p,) outputs at the points; none if they have not every variable."""
        if not self.has_points:
            return np.zeros(0)
        return self.calibration.formula.value(self.calibration.coefficients, self._given)

    @property
    def places(self) -> Sequence[Mapping[str, float]]:
        """Settings at each of the (p,) points."""
        given = self.at if self.has_points else {}
        every = zip(*(values.tolist() for values in given.values()), strict=True)
        return [dict(zip(given, values, strict=True)) for values in every]

    @cached_property
    def rows(self) -> FloatArray:
        """(p, k) derivative of the outputs by the coefficients."""
        return np.asarray(self.calibration.formula.rows(self.calibration.coefficients, self._given))

    @cached_property
    def slope(self) -> FloatArray:
        """(p,) derivative of the output by the variable."""
        return self._inverse.slope(self._given[self._inverse.variable])

    def values(self, coefficients: FloatArray, readings: FloatArray) -> FloatArray:
        """Coefficients, outputs, and inferred values of (p,) readings."""
        if not self.has_points:
            return coefficients
        found = [coefficients, self.calibration.formula.value(coefficients, self._given)]
        if self.variable is not None:
            found.append(self._inferred(coefficients, readings))
        return np.concatenate(found)

    def _inferred(self, coefficients: FloatArray, readings: FloatArray) -> FloatArray:
        """(p,) values of the variable, by Newton's method from the points; NaN where it does not converge."""
        used, name = replace(self._inverse, coefficients=coefficients), self._inverse.variable
        low, high = self.calibration.ranges[name]
        x = self._given[name].astype(np.float64)
        for _ in range(_ITERATIONS):
            try:
                curve = used.curve(x)
            except FitError:  # a root or a logarithm, a step beyond the end of its domain
                x = np.clip(x, low, high)
                curve = used.curve(x)
            with np.errstate(all="ignore"):
                step = (readings - curve) / used.slope(x)
            x = x + np.where(np.isfinite(step), step, 0.0)
            if np.all(np.abs(step) <= _TOLERANCE * max(high - low, 1e-300)):
                break
        return np.where(np.abs(step) <= 1e-9 * (high - low), x, np.nan)

    def named(self) -> Iterator[tuple[str, str]]:
        """Name and unit of every result."""
        stem, unit = stem_of(self.name), spelled(unit_of(self.name))
        yield from ((f"{stem} coefficient {one}", _unit(one, unit)) for one in self.terms)
        if not self.has_points:
            return
        where = []
        for values in zip(*self._given.values(), strict=True):
            parts = (f"{_plain(n)} {v:g} {spelled(unit_of(n))}" for n, v in zip(self._given, values, strict=True))
            where.append(f"at {', '.join(parts)}")
        yield from ((f"{stem} output {place}", unit) for place in where)
        if self.variable is not None:
            name = self.variable
            yield from ((f"{stem} inferred {_plain(name)} {place}", spelled(unit_of(name))) for place in where)

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of its coefficients."""
        return tuple(self._model({}).rows.fitted().names)

    def scatter(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(m, m) covariance of the results, that of inferred values with one reading in use; (m,) df; (m,) variances by
        the fit alone.
        """
        one, J, found = self.calibration, self._jacobian, self.strata
        p = len(J) - len(one.coefficients) - len(self.readings)
        if found is None:
            covariance, df = J @ one.covariance @ J.T, one.curve_variance(J)[1]
        else:
            covariance, df = found.of(J)
        of_fit, df = np.diag(covariance).copy(), np.where(df > 0, df, 1.0)
        if p:
            last = np.arange(len(J) - p, len(J))
            variance, of_reading = one.reading_variance(self.rows)
            if found is not None:
                curve, reading = of_fit[last] * self.slope**2, found.variance
                variance = curve + reading
                of_reading = variance**2 / (curve**2 / df[last] + reading**2 / found.df)
            covariance[last, last], df[last] = variance / self.slope**2, of_reading
        return covariance, df, of_fit

    @cached_property
    def _jacobian(self) -> FloatArray:
        """(m, k) derivative of the results by the coefficients."""
        J = np.eye(len(self.calibration.coefficients))
        if self.has_points:
            J = np.vstack([J, self.rows])
            if self.variable is not None:
                J = np.vstack([J, -self.rows / self.slope[:, None]])
        return J


def _plain(name: str) -> str:
    """A factor's name without its unit."""
    return stem_of(name).replace("_", " ")


def _plainly(name: str) -> str:
    """A column for people: without its unit."""
    return (stem_of(name) or name).replace("_", " ")


def _unit(term: str, unit: str) -> str:
    """Unit of a term's coefficient; that of the output for the constant."""
    return unit if term == "1" else f"{unit} per unit of {term}"
