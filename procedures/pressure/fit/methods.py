"""The paper's calibration methods, side by side on the same data (McCollum, Commo and Parker, sections II to V).

Every method here is linear in the readings, b = A V, so its covariance under the estimated errors of the readings is A
Cov(V) A' (`errors`), independent of its weights or assumptions: model-based, and valid for methods whose weights are
not the inverse of a variance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from rig.fitter import Triangle
from rig.fitter.arrays import FloatArray
from rig.fitter.json_values import coefficient_table
from rig.fitter.split_plot import fit_split_plot
from rig.procedures.pressure.fit.errors import Errors, estimate_errors
from rig.procedures.pressure.fit.in_use import InUse, in_use
from rig.procedures.pressure.fit.models import of_whole_plot
from rig.procedures.pressure.fit.problem import Problem
from rig.procedures.pressure.fit.reading_error import ReadingError, reading_error

BIASED = "biased: it fits V/P by the terms of the model and so cannot follow V; shown as a warning"


@dataclass(frozen=True, eq=False)
class Estimate:
    """Linear operators of a method on the readings V.

    Attributes:
        estimator: (k, n) A: the coefficients are A V.
        hat: (n, n) H: the fitted outputs are H V. With indicators these include each whole plot's intercept.
        knows_whole_plot: whether `hat` includes the whole plots' errors, as after reading a zero in flight.
    """

    estimator: FloatArray
    hat: FloatArray
    knows_whole_plot: bool


def gls(problem: Problem) -> Estimate:
    """Generalised least squares at the REML variances (eq. 2)."""
    v = problem.reml.variances
    even = Errors(v.subplot, 0.0, v.wholeplot, v.replicate, np.zeros((4, 4)), float("nan"))
    estimator = problem.reml.covariance @ problem.layout.solve(even, problem.columns).T
    return Estimate(estimator, problem.columns @ estimator, knows_whole_plot=False)


def weighted_response(problem: Problem) -> Estimate:
    """Only the response times the weight (eq. 4 to 6): V/P = x b, so V is predicted by P x b. Biased."""
    weight = problem.weight
    used = problem.columns * (weight > 0)[:, None]
    estimator = _pseudo_inverse(used, problem.names) * weight
    predicted = problem.columns * np.maximum(problem.data.pressure_psia, 0.0)[:, None] ** problem.power
    return Estimate(estimator, predicted @ estimator, knows_whole_plot=False)


def weighted(problem: Problem) -> Estimate:
    """Rows times 1/P^power (eq. 7 to 9), which is least squares with weights 1/P^(2 power)."""
    weight = problem.weight
    estimator = _pseudo_inverse(problem.columns * weight[:, None], problem.names) * weight
    return Estimate(estimator, problem.columns @ estimator, knows_whole_plot=False)


def in_flight_zero(problem: Problem) -> Estimate:
    """An indicator for every whole plot, replacing the constant and terms in temperature alone (eq. 10)."""
    return _with_indicators(problem, np.ones(len(problem.data)))


def in_flight_zero_weighted(problem: Problem) -> Estimate:
    """Indicators, and rows times 1/P^power."""
    return _with_indicators(problem, problem.weight)


METHODS: Mapping[str, Callable[[Problem], Estimate]] = {
    "GLS": gls,
    "weighted response": weighted_response,
    "WLS": weighted,
    "in-flight zero": in_flight_zero,
    "in-flight zero + WLS": in_flight_zero_weighted,
}
"""In the order of the paper's figures 3 to 9."""

METHOD = "GLS"
"""Default method of a calibration: it does not prefer any pressure."""


@dataclass(frozen=True, eq=False)
class MethodFit:
    """One method's calibration.

    Attributes:
        method: its name in `METHODS`.
        names: of the k coefficients.
        coefficients: (k,) mV per unit of the column. With indicators, those of the constant and of temperature alone
            are fitted to the remainder of the others, by generalised least squares, to complete the model.
        covariance: (k, k).
        derivatives: (p, k, k) of the covariance by the parameters of the errors.
        df: (k,) degrees of freedom.
        residuals_mV: (n,) marginal residuals.
        reading_error: by pressure.
        in_use: the same in use: readings predicted by others, with the in-flight zero's own error.
        note: note for readers; empty without.
    """

    method: str
    names: tuple[str, ...]
    coefficients: FloatArray
    covariance: FloatArray
    derivatives: FloatArray
    df: FloatArray
    residuals_mV: FloatArray
    reading_error: ReadingError
    in_use: InUse
    note: str

    @property
    def biased(self) -> bool:
        """Whether its predictions are biased for any data."""
        return self.note == BIASED

    @property
    def stderr(self) -> FloatArray:
        """(k,) standard errors."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def to_dict(self) -> dict[str, object]:
        """JSON values."""
        return {
            "coefficients": coefficient_table(self.names, self.coefficients, self.stderr, self.df),
            "reading_error": self.reading_error.to_dict(),
            "in_use": {"pressure_psia": self.reading_error.pressure_psia.tolist(), **self.in_use.to_dict()},
            "biased": self.biased,
            "note": self.note,
        }


def fit_method(problem: Problem, method: str, sensitivity_mV_per_psi: float | None = None) -> MethodFit:
    """Calibrate by one of `METHODS`.

    Args:
        problem: readings and model.
        method: its name.
        sensitivity_mV_per_psi: conversion of mV to psi in reading errors (the paper uses 2); None for the fitted dV/dP
            at each reading.

    Raises:
        FitError: the method cannot be used on these readings.
        rig.fitter.linear.RankError: it cannot estimate all its coefficients from them.
    """
    y, data, layout = problem.data.outputs[problem.output], problem.data, problem.layout
    estimate = METHODS[method](problem)
    covariance, derivatives, df = _precision(problem, method, estimate)
    new, by_parameter = problem.errors.of_reading(data.pressure_psia, new_whole_plot=not estimate.knows_whole_plot)
    fixed, fixed_by = layout.variances(problem.errors, estimate.hat, shared=not estimate.knows_whole_plot)
    limit = special.stdtrit(problem.errors.df(new + fixed, by_parameter + fixed_by), 0.975).astype(np.float64)
    if sensitivity_mV_per_psi is None:
        slope = np.asarray(problem.formula.derivative(data.table, "P") @ problem.reml.coefficients)
    else:
        slope = np.full(len(data), sensitivity_mV_per_psi)
    residuals = y - estimate.hat @ y
    coefficients = estimate.estimator @ y
    zeroed = (coefficients, covariance, derivatives) if estimate.knows_whole_plot else None
    half = limit * np.sqrt(new + fixed)
    return MethodFit(
        method=method,
        names=problem.names,
        coefficients=coefficients,
        covariance=covariance,
        derivatives=derivatives,
        df=df,
        residuals_mV=residuals,
        reading_error=reading_error(
            residuals,
            half,
            np.where(problem.without_pressure, 0.0, data.pressure_psia),
            slope,
            data.pressure_levels,
        ),
        in_use=in_use(problem, estimate.hat, residuals, half, slope, zeroed),
        note=BIASED if method == "weighted response" else "",
    )


def _precision(problem: Problem, method: str, estimate: Estimate) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(k, k) covariance, its (p, k, k) derivatives by the parameters of the errors, (k,) degrees of freedom."""
    covariance, derivatives = problem.layout.covariance(problem.errors, estimate.estimator)
    if method == METHOD and problem.errors.growth_per_psia == 0.0:
        return problem.reml.kenward_roger().covariance, derivatives, problem.reml.df
    df = problem.errors.df(np.diag(covariance), np.diagonal(derivatives, axis1=1, axis2=2).T)
    return covariance, derivatives, df


def errors_beside(problem: Problem, more: FloatArray) -> tuple[Errors, FloatArray, FloatArray]:
    """Errors of a reading with (n, q) columns beside the model, (k, k) covariance of the model's coefficients by GLS,
    and its (p, k, k) derivatives by the parameters of the errors.
    """
    k, columns = len(problem.names), np.column_stack([problem.columns, more])
    names = (*problem.names, *(f"beside {i}" for i in range(more.shape[1])))
    data = problem.data
    replicate = None if problem.layout.replicate is None else data.replicate
    reml = fit_split_plot(columns, data.outputs[problem.output], data.whole_plot, names, replicate=replicate)
    errors = estimate_errors(reml, columns, problem.layout)
    every = replace(problem, names=names, columns=columns, reml=reml, errors=errors)
    covariance, derivatives, _ = _precision(every, METHOD, gls(every))
    return errors, covariance[:k, :k], derivatives[:, :k, :k]


def _with_indicators(problem: Problem, weight: FloatArray) -> Estimate:
    alone = np.array([of_whole_plot(term) for term in problem.formula.terms])
    inside, outside = problem.columns[:, ~alone], problem.columns[:, alone]
    varying = [name for name, constant in zip(problem.names, alone, strict=True) if not constant]
    labels = [*varying, *(f"whole plot {identity}" for identity in problem.data.whole_plots)]
    both = np.column_stack([inside, problem.layout.wholeplot])
    within = _pseudo_inverse(both * weight[:, None], labels) * weight
    estimator = np.empty((len(alone), len(weight)))
    estimator[~alone] = within[: len(varying)]
    if np.any(alone):
        solved = problem.layout.solve(problem.errors, outside)
        left = np.eye(len(weight)) - inside @ estimator[~alone]
        estimator[alone] = np.linalg.solve(outside.T @ solved, solved.T) @ left
    return Estimate(estimator, both @ within, knows_whole_plot=True)


def _pseudo_inverse(columns: FloatArray, names: Sequence[str]) -> FloatArray:
    """(k, n) least-squares solution of `columns` as a matrix; RankError if there is none."""
    root = Triangle(tuple(names)).add(columns, np.zeros(len(columns))).solve().root
    return np.asarray(root @ (root.T @ columns.T))
