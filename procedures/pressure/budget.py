"""Budgets of pressure transducers: coefficients, outputs and inferred pressures as functions of the recorded columns.

By generalised least squares with the weights of the run: errors of instruments move the readings, not their weights.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.strata import by_side, covariance_of_sides, reversed_by, sides_of
from rig.fitter.sums_of_squares import FTest, project_out
from rig.procedures.evaluate.budget_by_sensor import EvaluationBySensor
from rig.procedures.evaluate.budgeting import OF_PLOTS, Shift, Shifts
from rig.procedures.evaluate.reversibility import in_words
from rig.procedures.evaluate.stated import PlaceConstant
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.fit import Errors, PressureCalibration, PressureFit, fit_transducers
from rig.procedures.pressure.fit.methods import METHOD, errors_beside
from rig.procedures.pressure.fit.models import coefficient_unit
from rig.procedures.pressure.infer import infer_pressure
from rig.procedures.pressure.influences import COLUMN_PER_M
from rig.procedures.tables.table import Columns

PRESSURE, SENSOR, SSE = "pressure_psia", "sensor_temperature_degC", "sse_temperature_degC"
NAMES = {"P": PRESSURE, "T_sensor": SENSOR, "T_SSE": SSE}
Point = tuple[float, float, float]
"""Pressure, sensor temperature, SSE temperature."""


@dataclass(frozen=True, eq=False)
class Transducer:
    """One transducer of the run, with the weights of its fit.

    Attributes:
        name: its output.
        fit: of the run.
        calibration: by GLS.
        at: (p, 3) points.
        by_side: (n,) the part of traced effects, taken off the output, that is of the direction of approach, mV.
    """

    name: str
    fit: PressureFit
    calibration: PressureCalibration
    at: FloatArray
    by_side: FloatArray | None = None

    @cached_property
    def _even(self) -> Errors:
        v = self.fit.reml.variances
        return Errors(v.subplot, 0.0, v.wholeplot, v.replicate, np.zeros((4, 4)), float("nan"))

    @property
    def uses(self) -> set[str]:
        """Columns that its calibration depends on: pressure, temperatures, and its output."""
        return {*NAMES.values(), self.name}

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of its coefficients."""
        return tuple(self.fit.problem.names)

    @property
    def fitted(self) -> FloatArray:
        """(k,) coefficients of the calibration."""
        return self.calibration.coefficients

    def coefficients(self, moved: Mapping[str, FloatArray]) -> FloatArray:
        """(k,) coefficients with additions to columns that it uses."""
        problem = self.fit.problem
        table = dict(problem.data.table)
        for short, column in NAMES.items():
            if column in moved:
                table[short] = table[column] = table[column] + moved[column]
        y = problem.data.outputs[self.name] + moved.get(self.name, 0.0)
        columns = problem.formula.columns(table)[1]
        unit = np.linalg.norm(columns, axis=0)
        solved = problem.layout.solve(self._even, columns / unit)
        return np.asarray(np.linalg.solve(solved.T @ (columns / unit), solved.T @ y) / unit)

    @cached_property
    def rows(self) -> FloatArray:
        """(p, k) columns of the model at the points."""
        P, sensor, sse = self.at.T
        return self.calibration.formula.columns({"P": P, "T_sensor": sensor, "T_SSE": sse})[1]

    @cached_property
    def slope(self) -> FloatArray:
        """(p,) dV/dP at the points, mV/psi."""
        P, sensor, sse = self.at.T
        derivative = self.calibration.formula.derivative({"P": P, "T_sensor": sensor, "T_SSE": sse}, "P")
        return np.asarray(derivative @ self.calibration.coefficients)

    @property
    def places(self) -> Sequence[Mapping[str, float]]:
        """Settings at each of the (p,) points."""
        return [dict(zip((PRESSURE, SENSOR, SSE), one, strict=True)) for one in self.at.tolist()]

    @cached_property
    def readings(self) -> FloatArray:
        """(p,) outputs at the points, mV."""
        return np.asarray(self.rows @ self.calibration.coefficients)

    def values(self, coefficients: FloatArray, readings: FloatArray) -> FloatArray:
        """Coefficients, outputs, and inferred pressures of (p,) readings."""
        used = replace(self.calibration, coefficients=coefficients)
        pressure = infer_pressure(used, readings, self.at[:, 1], self.at[:, 2]).pressure_psia
        return np.concatenate([coefficients, self.rows @ coefficients, pressure])

    def named(self) -> Iterator[tuple[str, str]]:
        """Name and unit of every result."""
        stem = self.name.removesuffix("_mV")
        yield from ((f"{stem} coefficient {one}", coefficient_unit(one)) for one in self.terms)
        where = [f"at {P:g} psia, sensor {sensor:g} degC, SSE {sse:g} degC" for P, sensor, sse in self.at.tolist()]
        yield from ((f"{stem} output {place}", "mV") for place in where)
        yield from ((f"{stem} inferred pressure {place}", "psi") for place in where)

    def scatter(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(m, m) covariance of the results, with one reading in a new whole plot for inferred pressures; (m,) df;
        (m,) variances by the fit alone.
        """
        one, errors, h = self._beside_loop, self._beside_loop.errors, self.rows
        k, p, J = len(one.coefficients), len(h), self._jacobian
        covariance = J @ one.covariance @ J.T
        gradient, of_fit = np.einsum("mk,pkl,ml->mp", J, one.derivatives, J), np.diag(covariance).copy()
        variance, by = errors.of_reading(self.at[:, 0], new_whole_plot=True)
        last = np.arange(k + p, k + 2 * p)
        covariance[last, last] += variance / self.slope**2
        gradient[last] += by / self.slope[:, None] ** 2
        return covariance, errors.df(np.diag(covariance), gradient), of_fit

    @cached_property
    def _jacobian(self) -> FloatArray:
        """(m, k) derivative of the results by the coefficients."""
        h = self.rows
        return np.vstack([np.eye(h.shape[1]), h, -h / self.slope[:, None]])

    @property
    def sides(self) -> tuple[FloatArray | None, FTest]:
        """(2, k) coefficients of rising and of falling pressures, less those of the fit, in whole plots; their test."""
        return self._sides[:2]

    @cached_property
    def _beside_loop(self) -> PressureCalibration:
        """The calibration, with the errors of readings of one direction where rising and falling pressures differ."""
        loop = self._sides[2]
        if not loop.shape[1]:
            return self.calibration
        errors, covariance, derivatives = errors_beside(self.fit.problem, loop)
        return replace(self.calibration, errors=errors, covariance=covariance, derivatives=derivatives)

    @cached_property
    def _within(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Within whole plots, over the standard deviation of each reading: (n,) one over that, (n, k) columns of the
        model, (n, q) of those, whole plots and levels an orthonormal basis, (n,) sides.

        The ends of the range are reached from one side each, so that a curve that the model lacks is none of the sides.
        """
        data = self.fit.problem.data
        each = 1.0 / self.calibration.errors.subplot_sd(data.pressure_psia)
        columns = each[:, None] * self.fit.problem.formula.columns(data.table)[1]
        levels, level = data.pressure_levels
        at_level = level[:, None] == np.arange(len(levels))
        inside = (data.whole_plot[:, None] == data.whole_plots) * each[:, None]
        basis = orthonormal(np.column_stack([inside, columns, at_level * each[:, None]]))
        return each, columns, basis, data.pressure_side.astype(np.float64)

    @cached_property
    def _sides(self) -> tuple[FloatArray | None, FTest, FloatArray]:
        """See `sides`; and (n, q) columns of the loop that was found in the readings."""
        data, (each, columns, basis, side) = self.fit.problem.data, self._within
        # a sensitivity that is another one in each whole plot is none of the sides
        inside = data.whole_plot[:, None] == data.whole_plots
        slopes = inside * (each * data.pressure_psia)[:, None]
        left = project_out(each * data.outputs[self.name], basis)
        wide = orthonormal(np.column_stack([basis, slopes]))
        found, test, _, _ = by_side(columns, wide, project_out(left, wide), side, len(data.outputs))
        loop = basis[:, :0]
        if found is not None:  # its size is known better without slopes
            found, _, _, every = by_side(columns, basis, left, side)
            loop = every[:, basis.shape[1] :] / each[:, None]
        if self.by_side is not None:
            more = sides_of(reversed_by(columns, each * self.by_side, side, basis))
            found = more if found is None else found + more
        return found, test, loop

    @property
    def reversibility(self) -> tuple[FloatArray, FloatArray] | None:
        """See `Calibrated`. Errors of whole plots are on both sides alike."""
        found = self.sides[0]
        if found is None:
            return None
        _, columns, basis, side = self._within
        variance = self._beside_loop.errors.subplot_variance / self.calibration.errors.subplot_variance
        covariance = variance * covariance_of_sides(columns, side, basis)
        return found @ self._jacobian.T, np.einsum("mk,kl,ml->m", self._jacobian, covariance, self._jacobian)


class PressureEvaluation(EvaluationBySensor):
    """All transducers of a run, by the declared model and GLS."""

    scatter = OF_PLOTS

    def __init__(self, data: WholePlotData, model: str, at: Sequence[Point], extra: Sequence[str] = ()) -> None:
        self._data = data
        points = np.array(at, np.float64).reshape(-1, 3)
        fits = fit_transducers(data, model, extra=tuple(extra))
        self._each = [Transducer(name, fit, fit.calibration(METHOD), points) for name, fit in fits.items()]

    @property
    def each(self) -> Sequence[Transducer]:
        """The sensors, in the order of the results."""
        return self._each

    def at_rest(self) -> Mapping[str, FloatArray]:
        """(n,) output of each observation by the model alone, by sensor."""
        return {
            one.name: one.fit.problem.formula.columns(one.fit.problem.data.table)[1] @ one.fitted for one in self._each
        }

    def described(self, sensor: str) -> str:
        """How a sensor's output follows from its coefficients, a sentence; "" if it is not said."""
        return (
            "Output in mV: the sum of all coefficients, each times its term, with the pressure P in psia and the "
            "temperatures T_sensor and T_SSE in degC"
        )

    def charted(self, sensor: str) -> tuple[str, FloatArray]:
        """Unit of a sensor's errors in its control chart, and (p,) its output at the points per such a unit."""
        return "psi", next(one.slope for one in self._each if one.name == sensor)

    def notes(self) -> Iterable[str]:
        """Sentences about the scatter."""
        return (in_words(one.name, one.sides[1]) for one in self._each if one.sides[0] is not None)

    @cached_property
    def columns(self) -> Columns:
        """The recorded columns that it uses, corrected."""
        d = self._data
        return {
            PRESSURE: d.pressure_psia,
            SENSOR: d.sensor_temperature_degC,
            SSE: d.sse_temperature_degC,
            **d.outputs,
        }

    @cached_property
    def settings(self) -> Mapping[str, IntArray]:
        """(n,) number of the setting of each observation, from 0, by the column of a factor; "" for points of all."""
        number = {}
        for short, column in NAMES.items():
            number[column] = np.asarray(np.unique(self._data.nominal[short], return_inverse=True)[1], np.int64)
        every = np.column_stack([*number.values()])
        points = np.asarray(np.unique(every, axis=0, return_inverse=True)[1], np.int64).ravel()
        return {**number, "": points}

    @cached_property
    def replication(self) -> IntArray:
        """(n,) number of the replication of each observation, from 0."""
        return np.asarray(np.unique(self._data.replicate, return_inverse=True)[1], np.int64)

    def of_place(self, constant: PlaceConstant) -> Iterable[tuple[str, Shifts]]:
        """The height of the transducers as a share of the pressure."""
        if constant.name == "line_head":
            pressure = self.columns[PRESSURE]
            yield "", lambda times: Shift({PRESSURE: times * constant.standard * COLUMN_PER_M * pressure})
