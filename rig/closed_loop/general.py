"""Tables of any kind: a response, a formula, and whole plots where readings share an error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fitter import LinearFit, least_squares
from fitter.formula import Formula
from fitter.inverse import CurveCalibration
from fitter.split_plot import SplitPlotFit, fit_split_plot
from rig.errors import UsageError
from rig.tables import Table, read_any_csv
from rig.tables.unused import unused_columns


def fit_general(
    path: Path, response: str, formula: str, whole_plot: Sequence[str] = (), replicate: str | None = None
) -> dict[str, Any]:
    """Fit a formula to a column of a CSV table; JSON-ready.

    Args:
        path: the table.
        response: the column to be explained.
        formula: the model; see `fitter.formula`.
        whole_plot: columns whose values together say which rows share a whole-plot error; none: all independent.
        replicate: column of replications that whole plots are nested in.

    Raises:
        UsageError: a column is missing, the formula cannot be read, or the rows do not determine it.

    """
    try:
        model = Formula.parse(formula)
    except ValueError as error:
        raise UsageError(f"--formula: {error}") from error
    extra = [*whole_plot, *([replicate] if replicate else [])]
    table = read_any_csv(path, dict.fromkeys([response, *model.names, *extra]))
    if response not in table.columns:
        raise UsageError(f"{path}: the response {response} is not a column of numbers")
    y = table.columns[response]
    try:
        names, exact = model.exact_columns({**table.columns, **table.text})
        if not names:
            raise ValueError(f"the formula {formula!r} has no terms: there is nothing to fit")
        fit: LinearFit | SplitPlotFit
        if not whole_plot:
            fit = least_squares(exact.hi, y, names, tails=exact.lo)
            found = _of_rows(fit)
        else:
            blocks = None if replicate is None else _identities(table, [replicate])
            fit = fit_split_plot(exact.hi, y, _identities(table, extra), names, replicate=blocks)
            found = _of_whole_plots(fit)
    except (ValueError, KeyError) as error:
        raise UsageError(f"{path}: {error.args[0] if error.args else error}") from error
    simulated = bool(np.any(table.columns.get("simulated", 0.0)))
    used = [response, *model.names, *extra, "simulated"]
    return {
        "data": {"file": path.name, "points": len(y), "kind": "general", "simulated": simulated},
        "response": response,
        "formula": str(model),
        **found,
        "unused": unused_columns(table, used).to_json(),
        "calibration": _calibration(fit, response, model, table).to_dict(),
    }


def _of_rows(fit: LinearFit) -> dict[str, Any]:
    """Coefficients and errors of a fit of independent rows; null where the rows leave nothing to tell them."""
    known = fit.df > 0
    stderr = fit.stderr.tolist() if known else [None] * len(fit.names)
    notes = [] if known else [no_error(fit.n, len(fit.names))]
    df = [float(fit.df)] * len(fit.names)
    return {
        "coefficients": _coefficients(fit.names, fit.coefficients.tolist(), stderr, df),
        "sigma_E": fit.sigma if known else None,
        "notes": notes,
    }


def _of_whole_plots(fit: SplitPlotFit) -> dict[str, Any]:
    """The same of a fit with whole plots."""
    stderr = [_finite(error) for error in fit.kenward_roger().stderr]
    return {
        "coefficients": _coefficients(fit.names, fit.coefficients.tolist(), stderr, [_finite(df) for df in fit.df]),
        "sigma_subplot": fit.sigma_subplot,
        "sigma_wholeplot": fit.sigma_wholeplot,
        "sigma_replicate": fit.sigma_replicate,
        "reml_loglik": fit.reml_loglik,
        "df_method": fit.df_method,
        "notes": list(fit.notes),
    }


def no_error(rows: int, coefficients: int) -> str:
    """Why a fit has no errors, and what it takes."""
    return (
        f"{rows} rows for {coefficients} coefficients: the curve goes through every row, so no error can be estimated, "
        f"and a reading cannot be given an interval; it takes more rows than coefficients"
    )


def _coefficients(
    names: Sequence[str], estimates: Sequence[float], stderr: Sequence[float | None], df: Sequence[float | None]
) -> dict[str, Any]:
    return {
        name: {"estimate": b, "stderr": error, "df": freedom}
        for name, b, error, freedom in zip(names, estimates, stderr, df, strict=True)
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _calibration(fit: LinearFit | SplitPlotFit, response: str, formula: Formula, table: Table) -> CurveCalibration:
    """What `rig infer` and `rig chart` need of a fit."""
    if isinstance(fit, SplitPlotFit):
        covariance, variances = fit.kenward_roger().covariance, fit.structure.variances
        derivatives, spread = fit.moments.derivatives, fit.moments.inverse_information
    else:
        shape = fit.root @ fit.root.T
        known = fit.df > 0
        variances = np.array([fit.sigma**2] if known else [])
        covariance = fit.sigma**2 * shape if known else 0.0 * shape
        derivatives = np.array([shape] if known else [])
        spread = np.array([[2.0 * fit.sigma**4 / fit.df]] if known else [])
    ranges = {
        name: (float(table.columns[name].min()), float(table.columns[name].max()))
        for name in formula.names
        if name in table.columns
    }
    return CurveCalibration(
        response, formula, fit.coefficients, covariance, np.asarray(variances), derivatives, spread, ranges
    )


def _identities(table: Table, names: Sequence[str]) -> np.ndarray[Any, np.dtype[np.int64]]:
    """One whole number for each combination of values of these columns."""
    every: Mapping[str, np.ndarray[Any, Any]] = {**table.columns, **table.text}
    keys = [np.unique(every[name], return_inverse=True)[1] for name in names]
    return np.asarray(np.unique(np.column_stack(keys), axis=0, return_inverse=True)[1], np.int64).reshape(-1)
