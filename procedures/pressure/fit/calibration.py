"""Fit of one transducer of a whole-plot calibration, with the data for its use in flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.fitter.json_values import coefficient_table
from rig.fitter.split_plot import SplitPlotFit, fit_split_plot
from rig.fitter.steps import steps
from rig.fitter.sums_of_squares import FTest
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.fit import lack_of_fit
from rig.procedures.pressure.fit.errors import Errors, Layout, estimate_errors
from rig.procedures.pressure.fit.methods import METHODS, MethodFit, fit_method
from rig.procedures.pressure.fit.models import HIERARCHICAL, check_determined, named_formula, reduced
from rig.procedures.pressure.fit.problem import Problem

NOT_NESTED = "too few measurements for an own error of replications: it is part of the whole-plot error"

IN_FLIGHT = frozenset({"P", "T_sensor", "T_SSE"})
"""Variables that are known in flight, or inferred."""


@dataclass(frozen=True, eq=False)
class PressureCalibration:
    """All data for inferring pressure from a transducer's output.

    Attributes:
        output: name of the transducer's output.
        method: its calibration method.
        formula: the model of the output, mV, in P (psia), T_sensor and T_SSE (degC).
        coefficients: (k,) of its columns.
        covariance: (k, k).
        derivatives: (p, k, k) of the covariance by the parameters of `errors`.
        errors: of one reading.
        ranges: lowest and highest value calibrated of P, T_sensor and T_SSE.
        notes: the fit's notes about its intervals.
    """

    output: str
    method: str
    formula: Formula
    coefficients: FloatArray
    covariance: FloatArray
    derivatives: FloatArray
    errors: Errors
    ranges: Mapping[str, tuple[float, float]]
    notes: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """JSON values; `from_dict` restores the same object."""
        return {
            "kind": "pressure",
            "output": self.output,
            "method": self.method,
            "model": str(self.formula),
            "coefficients": self.coefficients.tolist(),
            "covariance": self.covariance.tolist(),
            "derivatives": self.derivatives.tolist(),
            "errors": self.errors.to_dict(),
            "ranges": {name: list(pair) for name, pair in self.ranges.items()},
            "notes": list(self.notes),
        }

    @staticmethod
    def from_dict(given: Mapping[str, Any]) -> PressureCalibration:
        """Restore from `to_dict`.

        Raises:
            FitError: it is not such a calibration; the message names the defect.
        """
        if given.get("kind") != "pressure":
            raise FitError(f"this is not a calibration of pressure, its kind is {given.get('kind')!r}")
        try:
            calibration = PressureCalibration(
                output=str(given["output"]),
                method=str(given["method"]),
                formula=Formula.parse(given["model"]),
                coefficients=np.array(given["coefficients"], np.float64),
                covariance=np.array(given["covariance"], np.float64),
                derivatives=np.array(given["derivatives"], np.float64),
                errors=Errors.from_dict(given["errors"]),
                ranges={name: (float(low), float(high)) for name, (low, high) in given["ranges"].items()},
                notes=tuple(str(note) for note in given.get("notes", ())),
            )
        except (KeyError, TypeError) as problem:
            raise FitError(f"a calibration of pressure lacks or garbles {problem}") from problem
        missing = IN_FLIGHT - set(calibration.ranges)
        if missing:
            raise FitError(f"a calibration of pressure lacks the range of {', '.join(sorted(missing))}")
        numbers = (calibration.coefficients, calibration.covariance, calibration.derivatives)
        if not all(np.all(np.isfinite(n)) for n in numbers):
            raise FitError("a calibration of pressure holds a number that is none")
        k = len(calibration.formula.terms)
        shapes = calibration.coefficients.shape, calibration.covariance.shape, calibration.derivatives.shape[1:]
        if shapes != ((k,), (k, k), (k, k)):
            raise FitError(f"a calibration of {k} terms has numbers for {shapes[0]}, {shapes[1]} and {shapes[2]}")
        if calibration.errors.spread.shape != (len(calibration.derivatives),) * 2:
            raise FitError("a calibration of pressure has derivatives by other parameters than its errors")
        return calibration


@dataclass(frozen=True, eq=False)
class PressureFit:
    """Calibration of one transducer, by all methods.

    Attributes:
        model: the requested model.
        problem: readings, model, split-plot fit and errors.
        sensitivity_mV_per_psi: conversion of mV to psi in reading errors; None for the fitted one.
    """

    model: str
    problem: Problem
    sensitivity_mV_per_psi: float | None = None

    @property
    def formula(self) -> Formula:
        """The model's terms."""
        return self.problem.formula

    @property
    def reml(self) -> SplitPlotFit:
        """The split-plot fit with one subplot variance."""
        return self.problem.reml

    @property
    def errors(self) -> Errors:
        """Errors of a reading; the source of all intervals."""
        return self.problem.errors

    @cached_property
    def _outcomes(self) -> dict[str, MethodFit | str]:
        outcomes: dict[str, MethodFit | str] = {}
        for method in METHODS:
            try:
                outcomes[method] = fit_method(self.problem, method, self.sensitivity_mV_per_psi)
            except FitError as problem:
                outcomes[method] = str(problem)
        return outcomes

    @property
    def methods(self) -> dict[str, MethodFit]:
        """The methods that can be used on these readings, by name."""
        return {name: fit for name, fit in self._outcomes.items() if isinstance(fit, MethodFit)}

    @property
    def not_possible(self) -> dict[str, str]:
        """Reasons why the others cannot be used, by name."""
        return {name: reason for name, reason in self._outcomes.items() if isinstance(reason, str)}

    @cached_property
    def lack_of_fit(self) -> FTest:
        """Test of lack of fit within whole plots; NaN if no pressure repeats there."""
        return lack_of_fit.lack_of_fit(self.problem)

    @property
    def _misfit(self) -> tuple[str, ...]:
        said = lack_of_fit.in_words(self.lack_of_fit)
        return (said,) if said else ()

    def calibration(self, method: str = "GLS") -> PressureCalibration:
        """Data for the use of the transducer, by one of the methods.

        Raises:
            FitError: the method is biased or impossible here, or the model has variables that are unknown in flight.
        """
        if method not in METHODS:
            raise FitError(f"there is no method {method!r}, only {', '.join(METHODS)}")
        fit = fit_method(self.problem, method, self.sensitivity_mV_per_psi)
        if fit.biased:
            raise FitError(f"{method} is {fit.note}, not a calibration to use")
        unknown = [name for name in self.formula.names if name not in IN_FLIGHT]
        if unknown:
            raise FitError(f"the model needs {', '.join(unknown)}; in flight P, T_sensor and T_SSE are all there is")
        if "P" not in self.formula.names:
            raise FitError("the model has no pressure in it")
        table = self.problem.data.table
        try:
            self.formula.columns({**table, "P": np.zeros_like(table["P"])})
        except FitError as problem:
            raise FitError(f"the model has no value at zero pressure, where its zero is read: {problem}") from problem
        return PressureCalibration(
            output=self.problem.output,
            method=method,
            formula=self.formula,
            coefficients=fit.coefficients,
            covariance=fit.covariance,
            derivatives=fit.derivatives,
            errors=self.errors,
            ranges={name: (float(table[name].min()), float(table[name].max())) for name in sorted(IN_FLIGHT)},
            notes=self._misfit,
        )

    def to_dict(self) -> dict[str, Any]:
        """JSON values: missing numbers are None, never NaN. Top-level coefficients are those of GLS."""
        reml, errors = self.reml, self.errors
        roger = reml.kenward_roger()
        return {
            "model": self.model,
            "formula": str(self.formula),
            "points": reml.n,
            "whole_plots": len(reml.whole_plots),
            "coefficients": coefficient_table(reml.names, reml.coefficients, roger.stderr, reml.df),
            "df_method": reml.df_method,
            "sigma_subplot": reml.sigma_subplot,
            "sigma_wholeplot": reml.sigma_wholeplot,
            "sigma_replicate": reml.sigma_replicate,
            "reml_loglik": reml.reml_loglik,
            "notes": [*reml.notes, *self._misfit],
            "lack_of_fit": lack_of_fit.to_dict(self.lack_of_fit),
            "errors": errors.to_dict(),
            "methods": {name: fit.to_dict() for name, fit in self.methods.items()},
            "not_possible": self.not_possible,
        }


def fit_pressure(
    data: WholePlotData,
    output: str,
    model: str = "full",
    *,
    extra: Sequence[str] = (),
    nested: bool | None = None,
    growth: bool | None = None,
    power: float = 1.0,
    exclude_zero: bool = False,
    sensitivity_mV_per_psi: float | None = None,
) -> PressureFit:
    """Calibrate one transducer.

    Args:
        data: the observations.
        output: name of its output.
        model: "full", "II.C", "eq10" or "hierarchical" (`rig.procedures.pressure.fit.models`), or a formula.
        extra: further terms, each a formula: effects found, such as "P^3".
        nested: whether whole plots are nested in replications with their own error; None: if there is more than one
            replication, with enough whole plots in each to estimate it.
        growth: whether the subplot error grows with pressure; None to let a test decide (`errors`).
        power: weighted methods multiply rows by 1 / P^power.
        exclude_zero: whether to leave readings at P = 0 out of weighted methods; otherwise these are impossible with
            such readings.
        sensitivity_mV_per_psi: conversion of mV to psi in reading errors (the paper uses 2); None for the fitted one.

    Raises:
        KeyError: there is no such output, or the data lack a variable of the formula.
        rig.fitter.formula.FormulaError: the model is neither a name nor a formula.
        rig.fitter.linear.RankError: the observations do not determine the model.
        FitError: there are no degrees of freedom for the errors, or the model has categories.
    """
    if output not in data.outputs:
        raise FitError(f"there is no output {output}, only {', '.join(data.outputs)}")
    y = data.outputs[output]
    if np.ptp(y) == 0:
        raise FitError(f"{output} reads {y[0]:g} mV throughout: there is nothing to calibrate")
    formula = named_formula(model, tuple(extra))
    if formula.has_categories:
        raise FitError("the model of a transducer has no categories; write steps as numbers: I(block)")
    check_determined(data, formula)
    several = bool(np.ptp(data.replicate) > 0)
    try:
        formula, reml = _fit(data, output, formula, model, nested=several if nested is None else nested)
    except FitError:
        if nested is not None or not several:
            raise
        formula, reml = _fit(data, output, formula, model, nested=False)
        reml = replace(reml, notes=(*reml.notes, NOT_NESTED))
    names, columns = formula.columns(data.table)
    nested = reml.replicates is not None
    layout = Layout.of(data, nested=nested)
    errors = estimate_errors(reml, columns, layout, growth=growth)
    problem = Problem(data, output, formula, names, columns, reml, errors, layout, power, exclude_zero)
    return PressureFit(model, problem, sensitivity_mV_per_psi)


def _fit(
    data: WholePlotData, output: str, formula: Formula, model: str, *, nested: bool
) -> tuple[Formula, SplitPlotFit]:
    if model == HIERARCHICAL:
        return reduced(data, output, formula, nested=nested)
    names, columns = formula.columns(data.table)
    replicate = data.replicate if nested else None
    return formula, fit_split_plot(columns, data.outputs[output], data.whole_plot, names, replicate=replicate)


def fit_transducers(data: WholePlotData, model: str = "full", **options: Any) -> Mapping[str, PressureFit]:
    """`fit_pressure` for every output."""
    return {output: fit_pressure(data, output, model, **options) for output in steps(data.transducers)}
