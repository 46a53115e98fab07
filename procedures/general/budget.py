"""Budgets of sensors of any kind: coefficients, outputs and inferred values as functions of the recorded columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.errors import DataError
from rig.procedures.evaluate.budget_by_sensor import EvaluationBySensor
from rig.procedures.evaluate.budgeting import OF_PLOTS, SCATTER
from rig.procedures.general.budget_sensor import Sensor
from rig.procedures.general.model_settings import SensorModel
from rig.procedures.general.of_runs import declared_of, has_whole_plots, models_of
from rig.procedures.general.strata_of_run import (
    points_of,
    replication_of,
    setting_of,
    told_of,
)
from rig.procedures.present.meant import meant
from rig.procedures.present.terms import in_words
from rig.procedures.tables.table import Columns, Table

GRID = 33
"""Points over the calibrated range at which lines of budgets are kept for use; between them they are interpolated."""
_AT = "the points of results (`--at`, or `at` in certificate.toml)"


def _abscissa(output: str, model: SensorModel, table: Table) -> str | None:
    """The variable of a formula that is inferred: the declared one, or the only factor of the run in it.

    Raises:
        DataError: the declared one is not in the formula.
    """
    if model.formula is None:
        return None
    names = Formula.parse(model.formula).names
    if model.abscissa is not None and model.abscissa not in names:
        where = f"the model of {output}: abscissa = {model.abscissa!r}"
        raise DataError(f"{where} is not in its formula, {model.formula}{meant(model.abscissa, names)}")
    factors = [name for name in names if name in table.factors]
    return model.abscissa or (factors[0] if len(factors) == 1 and len(names) > 1 else None)


class GeneralEvaluation(EvaluationBySensor):
    """All sensors of a run, each by its declared model."""

    def __init__(
        self, table: Table, at: Sequence[Mapping[str, float]], models: Mapping[str, SensorModel] | None = None
    ) -> None:
        plots = ("whole_plot",) if has_whole_plots(table) else ()
        points = {name: np.array([one[name] for one in at]) for name in (at[0] if at else ())}
        self._table = table
        self.scatter = OF_PLOTS if plots else SCATTER
        self._each = [
            Sensor(name, table, declared_of(model, table), plots, points, abscissa=_abscissa(name, model, table))
            for name, model in (models_of(table) if models is None else models).items()
        ]
        for one in self._each:
            if not len(one.plain.variances):
                raise FitError(f"{one.name}: as many rows as coefficients: its scatter is not known; measure more")

    def explain(self, expected: Mapping[str, float]) -> None:
        """Say before anything else what sum of squares stated errors leave in the residuals, by sensor."""
        self._each = [replace(one, expected=expected.get(one.name)) for one in self._each]

    def residuals(self, columns: Mapping[str, FloatArray]) -> Mapping[str, FloatArray]:
        """(n,) residuals of the fit by sensor, with additions to columns; none where scatter needs no repeats."""
        return {one.name: one.residuals({n: v for n, v in columns.items() if n in one.uses}) for one in self._each}

    def stored(self) -> Any:
        """The calibration to use with these results, as JSON values, if it is not that of the fit; None if it is."""
        return {one.name: one.calibration.to_dict() for one in self._each}

    def grids(self) -> Mapping[str, tuple[str, Sequence[Mapping[str, float]]]]:
        """By output, the quantity that a reading determines, and points along it at which lines of the budget that are
        no change of coefficients are kept for the use of a calibration; {} where a kind keeps none. Over all that was
        calibrated, at the means of the other quantities.
        """
        table, found = self._table, {}
        names = {*table.factors, *(name for one in self._each for name in one.calibration.formula.names)}
        means = {name: float(table.columns[name].mean()) for name in names if name in table.columns}
        for one in self._each:
            if one.variable is not None:
                values = table.columns[one.variable]
                places = np.linspace(values.min(), values.max(), GRID)
                found[one.name] = (one.variable, [{**means, one.variable: float(x)} for x in places])
        return found

    def kept_variance(self, output: str) -> FloatArray:
        """(p,) variance of values inferred from an output at the points, by the calibration alone that is kept."""
        one = next(one for one in self._each if one.name == output)
        return np.asarray(one.calibration.reading_variance(one.rows)[0] / one.slope**2)

    def notes(self) -> Iterable[str]:
        """Sentences about the scatter."""
        for one in self._each:
            if one.readings_scatter is not None and (words := one.readings_scatter.sentence(one.name)):
                yield words
            if one.strata is not None:
                yield from told_of(one.name, one.strata)
            if one.about_inferred:
                yield one.about_inferred

    def hints(self) -> Iterable[str]:
        """Sentences for the person who asks for a budget: which results are not there, and what would state them."""
        return (one.not_inferred for one in self._each if one.not_inferred)

    def described(self, sensor: str) -> str:
        """How a sensor's output follows from its coefficients, a sentence; "" if it is not said."""
        formula = next(one for one in self._each if one.name == sensor).calibration.formula
        unit = spelled(unit_of(sensor))
        if isinstance(formula, Formula):
            model = in_words(str(formula))
            return f"Output in {unit}: the sum of all coefficients, each times its term, by the model {model}"
        return f"Output in {unit}: {formula}"

    def charted(self, sensor: str) -> tuple[str, FloatArray]:
        """Unit of a sensor's errors in its control chart, and (p,) its output at the points per such a unit. Errors of
        curves are in the output's unit.
        """
        one = next(one for one in self._each if one.name == sensor)
        return unit_of(sensor), np.ones_like(one.readings)

    @property
    def each(self) -> Sequence[Sensor]:
        """The sensors, in the order of the results."""
        return self._each

    def lack(self, column: str) -> Sequence[str]:
        """Outputs whose model has not a column, if that of others has."""
        without = [one.name for one in self._each if column not in one.calibration.formula.names]
        return without if len(without) < len(self._each) else ()

    @cached_property
    def columns(self) -> Columns:
        """The recorded columns that it uses, corrected."""
        used = {name for one in self._each for name in one.uses}
        return {name: values for name, values in self._table.columns.items() if name in used}

    @cached_property
    def settings(self) -> Mapping[str, IntArray]:
        """(n,) number of the setting of each observation, from 0, by the column of a factor; "" for points of all."""
        number = {name: setting_of(self._table, name) for name in self._table.factors}
        return {**number, "": points_of(self._table)}

    @cached_property
    def replication(self) -> IntArray:
        """(n,) number of the replication of each observation, from 0."""
        return replication_of(self._table)
