"""Budgets of sensors of any kind: coefficients, outputs and inferred values as functions of the recorded columns."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fitter import LinearFit
from fitter.arrays import FloatArray, IntArray
from fitter.errors import FitError
from fitter.formula import Formula
from fitter.strata import Strata, reversed_by, strata
from procedures.budget_by_sensor import EvaluationBySensor
from procedures.column_names import spelled, stem_of, unit_of
from procedures.errors import DataError
from procedures.general.declared import Declared, Model, model_of
from procedures.general.fit import calibration_of
from procedures.general.infer import CurveCalibration
from procedures.general.of_runs import declared_of, has_whole_plots, models_of
from procedures.general.settings import SensorModel
from procedures.general.strata_of_run import (
    in_time,
    points_of,
    replication_of,
    setting_of,
    side_of,
    told_of,
)
from procedures.scatter import Scatter, scatter
from procedures.table import Columns, Table

_AT = "the points of results (`--at`, or `at` in certificate.toml)"
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
        by_side: (n,) the part of them that is of the direction of approach.
    """

    name: str
    table: Table
    declared: Declared
    plots: tuple[str, ...]
    at: Mapping[str, FloatArray]
    expected: float | None = None
    beside: FloatArray | None = None
    by_side: FloatArray | None = None

    def _model(self, columns: Columns) -> Model:
        table = replace(self.table, columns={**self.table.columns, **columns})
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

    def residuals(self, columns: Columns) -> FloatArray:
        """(n,) residuals with other columns."""
        rows = self._model(columns).rows
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
        beside = None if self.beside is None else self.beside[time]
        left, replicate, side = self.residuals({}), replication_of(self.table), side_of(self.table)
        return strata(self._tangent[time], left[time], replicate[time], side[time], beside, pure)

    @cached_property
    def _tangent(self) -> FloatArray:
        """(n, k) derivative of the rows by the coefficients."""
        rows = self._model({}).rows
        fit = rows.fitted()
        return np.asarray(rows.tangent(fit)[0] / rows.scale_at(fit)[:, None])

    @property
    def reversibility(self) -> FloatArray | None:
        """(m,) results of rising series less those of falling ones; None if they do not differ."""
        found = None if self.strata is None else self.strata.reversed
        if self.by_side is not None:
            off = reversed_by(self._tangent, self.by_side, side_of(self.table))
            found = off if found is None else found + off
        return None if found is None else self._jacobian @ found

    def coefficients(self, columns: Columns) -> FloatArray:
        """(k,) coefficients with other columns."""
        return np.asarray(self._model(columns).rows.fitted().coefficients)

    @property
    def fitted(self) -> FloatArray:
        """(k,) coefficients of the calibration."""
        return self.calibration.coefficients

    @property
    def variable(self) -> str | None:
        """The variable that a reading determines; None if there are several."""
        try:
            return self.calibration.variable
        except FitError:
            return None

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
        return self.calibration.slope(self._given[self.calibration.variable])

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
        used, name = replace(self.calibration, coefficients=coefficients), self.calibration.variable
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


def _unit(term: str, unit: str) -> str:
    """Unit of a term's coefficient; that of the output for the constant."""
    return unit if term == "1" else f"{unit} per unit of {term}"


class GeneralEvaluation(EvaluationBySensor):
    """All sensors of a run, each by its declared model."""

    def __init__(
        self, table: Table, at: Sequence[Mapping[str, float]], models: Mapping[str, SensorModel] | None = None
    ) -> None:
        plots = ("whole_plot",) if has_whole_plots(table) else ()
        points = {name: np.array([one[name] for one in at]) for name in (at[0] if at else ())}
        self._table = table
        self._each = [
            Sensor(name, table, declared_of(model, table), plots, points)
            for name, model in (models_of(table) if models is None else models).items()
        ]
        for one in self._each:
            if not len(one.plain.variances):
                raise FitError(f"{one.name}: as many rows as coefficients: its scatter is not known; measure more")

    def explain(self, expected: Mapping[str, float]) -> None:
        """See `Evaluation`."""
        self._each = [replace(one, expected=expected.get(one.name)) for one in self._each]

    def residuals(self, columns: Mapping[str, FloatArray]) -> Mapping[str, FloatArray]:
        """See `Evaluation`."""
        found = {}
        for one in self._each:
            uses = {*one.plain.formula.names, one.name}
            found[one.name] = one.residuals({n: self.columns[n] + moved for n, moved in columns.items() if n in uses})
        return found

    def stored(self) -> Any:
        """See `Evaluation`."""
        return {one.name: one.calibration.to_dict() for one in self._each}

    def notes(self) -> Iterable[str]:
        """See `Evaluation`."""
        for one in self._each:
            if one.readings_scatter is not None and (words := one.readings_scatter.sentence(one.name)):
                yield words
            if one.strata is not None:
                yield from told_of(one.name, one.strata)

    def described(self, sensor: str) -> str:
        """See `Evaluation`."""
        formula = next(one for one in self._each if one.name == sensor).calibration.formula
        unit = spelled(unit_of(sensor))
        if isinstance(formula, Formula):
            return f"Output in {unit}: the sum of all coefficients, each times its term, by the model {formula}"
        return f"Output in {unit}: {formula}"

    def charted(self, sensor: str) -> tuple[str, FloatArray]:
        """See `Evaluation`: errors of curves are in the output's unit."""
        one = next(one for one in self._each if one.name == sensor)
        return unit_of(sensor), np.ones_like(one.readings)

    @property
    def each(self) -> Sequence[Sensor]:
        """See `EvaluationBySensor`."""
        return self._each

    @cached_property
    def columns(self) -> Columns:
        """See `Evaluation`."""
        used = {name for one in self._each for name in one.calibration.formula.names}
        used |= {one.name for one in self._each}
        return {name: values for name, values in self._table.columns.items() if name in used}

    @cached_property
    def settings(self) -> Mapping[str, IntArray]:
        """See `Evaluation`."""
        number = {name: setting_of(self._table, name) for name in self._table.factors}
        return {**number, "": points_of(self._table)}

    @cached_property
    def replication(self) -> IntArray:
        """See `Evaluation`."""
        return replication_of(self._table)

    def coefficients(self, columns: Mapping[str, FloatArray]) -> Mapping[str, FloatArray]:
        """See `Evaluation`."""
        found = {}
        for one in self._each:
            uses = {*one.calibration.formula.names, one.name}
            mine = {n: self.columns[n] + moved for n, moved in columns.items() if n in uses}
            found[one.name] = one.coefficients(mine) if mine else one.calibration.coefficients
        return found


def general_evaluation(table: Table, at: Sequence[Mapping[str, float]], *, traced: bool = False) -> GeneralEvaluation:
    """The evaluation of a table; arguments and errors as for `Kind.evaluation`.

    Args:
        traced: with the effects that a trace finds.
    """
    made: type[GeneralEvaluation] = GeneralEvaluation
    if traced:
        from procedures.general.budget_traced import TracedEvaluation  # noqa: PLC0415 - which derives from this module

        made = TracedEvaluation

    if not table.outputs:
        raise DataError(f"{table.source}: budgets are made of runs, whose bench says what reads what")
    _check_names(table, at)
    try:
        found = made(table, at or _points(table))
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error
    for name in table.factors if at else ():
        if name not in at[0] and (by := [one.name for one in found.each if name in one.plain.formula.names]):
            raise DataError(f"{_AT}: they lack {name}, on which results of {', '.join(by)} depend; add it")
    return found


def _check_names(table: Table, at: Sequence[Mapping[str, float]]) -> None:
    """Refuse points of unknown quantities, or of different ones."""
    for one in at:
        if unknown := [name for name in one if name not in table.columns]:
            raise DataError(f"{_AT}: the run has no {unknown[0]}; its factors are {', '.join(table.factors)}")
        if set(one) != set(at[0]):
            raise DataError(f"{_AT}: they have different quantities, {', '.join(at[0])} and {', '.join(one)}")


def _points(table: Table) -> list[Mapping[str, float]]:
    """Three values of the only factor of a run; the middle of all factors if there are several."""
    ends = {name: (float(table.columns[name].min()), float(table.columns[name].max())) for name in table.factors}
    middle = {name: float(f"{(low + high) / 2:.3g}") for name, (low, high) in ends.items()}
    if len(ends) != 1:
        return [middle]
    ((name, (low, high)),) = ends.items()
    return [{name: float(f"{value:.3g}")} for value in (low + 0.1 * (high - low), middle[name], high)]
