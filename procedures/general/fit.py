"""Tables of any kind: a response, a formula, and whole plots if readings have common errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import PurePath
from typing import Any

import numpy as np

from rig.fitter import LinearFit, RankError
from rig.fitter.arithmetic_text import column_name
from rig.fitter.arrays import IntArray
from rig.fitter.errors import FitError
from rig.fitter.formula import check_numbers
from rig.fitter.json_values import coefficient_table, if_finite
from rig.fitter.nonlinear import Curve
from rig.fitter.split_plot import SplitPlotFit
from rig.procedures.errors import DataError
from rig.procedures.evaluate.left_out import FitSummary, LeaveOut, Where, kept_with, not_searched, search
from rig.procedures.evaluate.results import PlainFitted
from rig.procedures.general.declared import Declared, Model, model_of
from rig.procedures.general.infer import CurveCalibration, Factored
from rig.procedures.general.iso376 import figures, rising
from rig.procedures.general.judged import derived_table, judged_fit, predicted_at, prediction_table, within_tolerance
from rig.procedures.general.shown import show_general_fit
from rig.procedures.present.blocks import Block
from rig.procedures.tables.file_rows import rows_of_file
from rig.procedures.tables.table import Reader, Table
from rig.procedures.tables.unused import unused_columns


def fit_general(
    read: Reader,
    response: str,
    formula: str | None = None,
    whole_plot: Sequence[str] = (),
    replicate: str | None = None,
    leave_out: Sequence[str] = (),
    declared: Declared | None = None,
    tolerance: float | None = None,
    *,
    between: tuple[float, float] | None = None,
    at: Sequence[Mapping[str, float]] = (),
    first_look: bool = False,
) -> dict[str, Any]:
    """Fit a declared model to a column of a CSV table; returns JSON values.

    Args:
        read: the table.
        response: the explained column, with or without back-ticks.
        formula: the model, if it is a formula and no more is declared; see `rig.fitter.formula`.
        whole_plot: columns whose values together identify rows with a common whole-plot error; none for independent
            rows.
        replicate: column of the replications of whole plots.
        leave_out: "gross" for the rows named by the search for gross errors, or row numbers of the file.
        declared: the model and the errors of the rows, in place of `formula`.
        tolerance: largest accepted half-width of the 95 % interval of an inferred value, in units of the abscissa.
        between: range of the abscissa for which `tolerance` holds; None for all of it.
        at: values of the model's columns at which the response is predicted.
        first_look: whether nothing but the coefficients is wanted, so that gross errors need not be searched.

    Raises:
        DataError: a column is missing, the model cannot be read, or the rows do not determine it.
    """
    declared = declared or Declared(formula)
    response = column_name(response)
    extra = [*whole_plot, *([replicate] if replicate else [])]
    table = read(dict.fromkeys([response, *declared.columns(), *extra]))
    every, falling = table, ""
    try:
        if response not in table.columns:
            with rows_of_file(table):
                check_numbers(response, table.text[response])
            raise FitError(f"the response {response} is not a column of numbers")
        if declared.series is not None:
            table, falling = rising(table, declared.series)
        asked = LeaveOut.of(leave_out, table)
        with rows_of_file(table):
            model = model_of(declared, table, response, whole_plot, replicate)
        searched = search(
            table, asked, lambda rows: {response: not_searched(rows) if first_look else model.rows.take(rows).gross()}
        )
        used = searched.used
        fit = model.rows.take(used).fitted()
        others = searched.with_the_others(lambda rows: model.rows.take(rows).fitted())
        judged = judged_fit(fit, model, table, used)
        notes = [*([falling] if falling else []), *judged.notes]
        calibration = calibration_of(fit, response, model, table, used, notes)
        of_series = {} if declared.series is None else figures(every, declared.series, calibration)
    except RankError as error:
        raise DataError(f"{table.source}: {error}{_hint(declared)}") from error
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error
    found = _of_rows(fit, model) if isinstance(fit, LinearFit) else _of_whole_plots(fit)
    simulated = bool(np.any(table.columns.get("simulated", 0.0)))
    summary = partial(_summary, stated=model.stated is not None)
    return {
        "data": {
            "file": PurePath(table.source).name,
            "points": len(used),
            "rows_left_out": searched.rows_left_out,
            "kind": "general",
            "simulated": simulated,
        },
        "response": response,
        "formula": str(model.curve),
        **_described(model.curve),
        **found,
        **judged.figures,
        **derived_table(model.curve, calibration),
        **(predicted_at(calibration, at, table.source) if at else prediction_table(calibration)),
        **within_tolerance(calibration, tolerance, table.source, between),
        **of_series,
        "notes": [*found["notes"], *calibration.notes],
        "unused": unused_columns(table, [response, *model.names, *extra, "simulated"]).to_json(),
        "gross_errors": searched.of_sensor(
            response,
            "",
            _order_of(table),
            summary(fit),
            summary(others) if isinstance(others, LinearFit | SplitPlotFit) else others,
        ),
        "calibration": calibration.to_dict() | kept_with(searched),
    }


def _hint(declared: Declared) -> str:
    """Advice where the rows do not determine a standard model."""
    if declared.model is None:
        return ""
    from rig.procedures.general.models.named import standard_model  # noqa: PLC0415

    hint = standard_model(declared.model).hint
    return f"; {hint}" if hint else ""


def _described(curve: Curve) -> dict[str, Any]:
    """The standard model as JSON values; nothing for a formula."""
    from rig.procedures.general.models import NamedCurve  # noqa: PLC0415

    if not isinstance(curve, NamedCurve):
        return {}
    model = curve.model
    meanings = {one.name: {"unit": one.unit, "meaning": one.meaning} for one in model.parameters}
    return {
        "model": {
            "name": model.name,
            "title": model.title,
            "source": model.source,
            "valid": {"abscissa": curve.variable, "unit": model.abscissa.unit, "range": [*map(if_finite, model.valid)]},
            "parameters": meanings,
        }
    }


def _summary(fit: LinearFit | SplitPlotFit, *, stated: bool) -> FitSummary:
    if isinstance(fit, LinearFit):
        sigmas: dict[str, float | None] = {"sigma_E": if_finite(fit.sigma)}
        if stated:
            sigmas = {"chi_squared": fit.rss}
        stderr = np.linalg.norm(fit.root, axis=1) if stated else fit.stderr
    else:
        sigmas = {name: getattr(fit, name) for name in ("sigma_subplot", "sigma_wholeplot", "sigma_replicate")}
        stderr = fit.kenward_roger().stderr
    return FitSummary.of(sigmas, "", fit.names, fit.coefficients, stderr)


def _order_of(table: Table) -> Where:
    """Place of a row in words: its order, if the table has one that its number in the file does not tell."""
    order = table.columns.get("order")
    told = order is None or bool(np.ptp(order - table.numbers) == 0.0)
    return lambda row: "" if told or order is None else f"order {order[row]:.0f}"


def _of_rows(fit: LinearFit, model: Model) -> dict[str, Any]:
    """Coefficients and errors of a fit of independent rows; null without degrees of freedom.

    Stated uncertainties give the standard errors whatever the scatter, without degrees of freedom.
    """
    every = np.ones(len(fit.names))
    if model.stated is not None:
        errors = np.linalg.norm(fit.root, axis=1)
        return {
            "coefficients": coefficient_table(fit.names, fit.coefficients, errors, every * np.inf),
            "correlation": _correlation(fit),
            "sigma_E": None,
            "notes": [],
        }
    known = fit.df > 0
    notes = [] if known else [no_error(fit.n, len(fit.names))]
    stderr = fit.stderr if known else every * np.nan
    return {
        "coefficients": coefficient_table(fit.names, fit.coefficients, stderr, every * fit.df),
        "correlation": _correlation(fit),
        "sigma_E": fit.sigma if known else None,
        "notes": notes,
    }


def _correlation(fit: LinearFit) -> list[list[float]]:
    """(k, k) of the coefficients."""
    root = fit.root / np.linalg.norm(fit.root, axis=1)[:, None]
    found: list[list[float]] = np.clip(root @ root.T, -1.0, 1.0).tolist()
    return found


def _of_whole_plots(fit: SplitPlotFit) -> dict[str, Any]:
    """Coefficients and error of a fit with whole plots, as JSON values."""
    return {
        "coefficients": coefficient_table(fit.names, fit.coefficients, fit.kenward_roger().stderr, fit.df),
        "sigma_subplot": fit.sigma_subplot,
        "sigma_wholeplot": fit.sigma_wholeplot,
        "sigma_replicate": fit.sigma_replicate,
        "reml_loglik": fit.reml_loglik,
        "df_method": fit.df_method,
        "notes": list(fit.notes),
    }


def no_error(rows: int, coefficients: int) -> str:
    """Reason why a fit has no errors, with the next step."""
    return (
        f"{rows} rows for {coefficients} coefficients: the curve goes through every row, so no error can be estimated, "
        f"and a reading cannot be given an interval; it takes more rows than coefficients"
    )


def calibration_of(
    fit: LinearFit | SplitPlotFit, response: str, model: Model, table: Table, rows: IntArray, notes: Sequence[str]
) -> CurveCalibration:
    """Data of a fit to these rows for `rig infer` and `rig chart`."""
    reading, told = _reading(model, rows)
    factor = Factored.of(fit)
    if isinstance(fit, SplitPlotFit):
        covariance, variances = fit.kenward_roger().covariance, fit.structure.variances
        derivatives, spread = fit.moments.derivatives, fit.moments.inverse_information
    elif model.stated is not None:
        covariance, variances, spread = fit.root @ fit.root.T, np.ones(1), np.zeros((1, 1))
        derivatives, unit = covariance[None], np.eye(len(fit.names))
        factor = Factored(fit.root, unit, unit[None])
    else:
        shape = fit.root @ fit.root.T
        known = fit.df > 0
        variances = np.array([fit.sigma**2] if known else [])
        covariance = fit.sigma**2 * shape if known else 0.0 * shape
        derivatives = np.array([shape] if known else [])
        spread = np.array([[2.0 * fit.sigma**4 / fit.df]] if known else [])
    ranges = {
        name: (float(table.columns[name][rows].min()), float(table.columns[name][rows].max()))
        for name in model.curve.names
        if name in table.columns
    }
    return CurveCalibration(
        response,
        model.curve,
        fit.coefficients,
        covariance,
        np.asarray(variances),
        derivatives,
        spread,
        ranges,
        factor,
        (*notes, *told),
        reading,
    )


def _reading(model: Model, rows: IntArray) -> tuple[float | None, tuple[str, ...]]:
    """Stated standard uncertainty of a reading in use, and what a user of the calibration has to know."""
    if model.weight is not None and np.ptp(model.weight[rows]) > 0.0:
        return None, (
            "rows had weights: intervals are those of a reading of weight 1; rig infer --u-reading gives the standard "
            "uncertainty of a reading in use",
        )
    if model.stated is None:
        return None, ()
    stated = model.stated[rows]
    largest = float(stated.max())
    if np.ptp(stated) == 0.0:
        return largest, ()
    return largest, (
        f"the stated uncertainties of the readings differ: a reading in use is taken to have the largest, "
        f"{largest:.4g}; rig infer --u-reading gives its own",
    )


@dataclass(frozen=True)
class GeneralFitted(PlainFitted):
    """A fit to any table, as JSON values."""

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        return show_general_fit(self.result["data"]["file"], self.result)
