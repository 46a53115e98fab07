"""Tables of any kind: a response, a formula, and whole plots if readings have common errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import numpy as np

from fitter import LinearFit, least_squares
from fitter.arithmetic_text import column_name
from fitter.arrays import FloatArray, IntArray
from fitter.errors import FitError
from fitter.formula import Formula
from fitter.gross import GrossErrors
from fitter.json_values import coefficient_table, if_finite
from fitter.scatter import uneven_scatter
from fitter.split_plot import SplitPlotFit, fit_split_plot
from procedures.blocks import Block
from procedures.errors import DataError
from procedures.file_rows import rows_of_file
from procedures.general.gross import of_table
from procedures.general.infer import CurveCalibration, Factored
from procedures.general.order import identities
from procedures.left_out import FitSummary, LeaveOut, Where, kept_with, search
from procedures.results import PlainFitted
from procedures.table import Reader, Table
from procedures.unused import unused_columns


def fit_general(
    read: Reader,
    response: str,
    formula: str,
    whole_plot: Sequence[str] = (),
    replicate: str | None = None,
    leave_out: Sequence[str] = (),
) -> dict[str, Any]:
    """Fit a formula to a column of a CSV table; returns JSON values.

    Args:
        read: the table.
        response: the explained column, with or without back-ticks.
        formula: the model; see `fitter.formula`.
        whole_plot: columns whose values together identify rows with a common whole-plot error; none for independent
            rows.
        replicate: column of the replications of whole plots.
        leave_out: "gross" for the rows named by the search for gross errors, or row numbers of the file.

    Raises:
        DataError: a column is missing, the formula cannot be read, or the rows do not determine it.
    """
    try:
        model = Formula.parse(formula)
    except FitError as error:
        raise DataError(f"--formula: {error}") from error
    response = column_name(response)
    extra = [*whole_plot, *([replicate] if replicate else [])]
    table = read(dict.fromkeys([response, *model.names, *extra]))
    if response not in table.columns:
        raise DataError(f"{table.source}: the response {response} is not a column of numbers")
    y = table.columns[response]
    asked = LeaveOut.of(leave_out, table)
    try:
        with rows_of_file(table):
            names, exact = model.exact_columns({**table.columns, **table.text})
        if not names:
            raise FitError(f"the formula {formula!r} has no terms: there is nothing to fit")
        columns = {**table.columns, **table.text}
        plots = identities(columns, extra) if whole_plot else None
        blocks = identities(columns, [replicate]) if whole_plot and replicate else None
        every = _Rows(names, exact.hi, exact.lo, y, plots, blocks)
        searched = search(table, asked, lambda rows: {response: every.take(rows).gross()})
        fit = every.take(searched.used).fitted()
        others = searched.with_the_others(lambda rows: every.take(rows).fitted())
        found = _of_rows(fit) if isinstance(fit, LinearFit) else _of_whole_plots(fit)
        uneven = _uneven(fit, every.take(searched.used), model, table, searched.used)
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error
    simulated = bool(np.any(table.columns.get("simulated", 0.0)))
    used = [response, *model.names, *extra, "simulated"]
    return {
        "data": {
            "file": PurePath(table.source).name,
            "points": len(searched.used),
            "rows_left_out": searched.rows_left_out,
            "kind": "general",
            "simulated": simulated,
        },
        "response": response,
        "formula": str(model),
        **found,
        "notes": [*found["notes"], *uneven],
        "unused": unused_columns(table, used).to_json(),
        "gross_errors": searched.of_sensor(
            response,
            "",
            _order_of(table),
            _summary(fit),
            _summary(others) if isinstance(others, LinearFit | SplitPlotFit) else others,
        ),
        "calibration": _calibration(fit, response, model, table, searched.used, uneven).to_dict() | kept_with(searched),
    }


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of a table and their model.

    Attributes:
        names: of the k columns.
        columns: (n, k).
        tails: (n, k) rounding errors of the doubles in `columns`.
        y: (n,) response.
        plots: (n,) identity of each row's whole plot; None for independent rows.
        blocks: (n,) replication of each row's whole plot; None if they are not nested.
    """

    names: Sequence[str]
    columns: FloatArray
    tails: FloatArray
    y: FloatArray
    plots: IntArray | None
    blocks: IntArray | None

    def take(self, rows: IntArray) -> _Rows:
        """Some of the rows."""
        plots, blocks = (None if given is None else given[rows] for given in (self.plots, self.blocks))
        return _Rows(self.names, self.columns[rows], self.tails[rows], self.y[rows], plots, blocks)

    def gross(self) -> GrossErrors:
        """The gross errors among them."""
        plots = None if self.plots is None else np.unique(self.plots, return_inverse=True)[1].reshape(-1)
        return of_table(self.y, self.columns, plots)

    def fitted(self) -> LinearFit | SplitPlotFit:
        """The model fitted to them. Raises `FitError`."""
        if self.plots is None:
            return least_squares(self.columns, self.y, self.names, tails=self.tails)
        return fit_split_plot(self.columns, self.y, self.plots, self.names, replicate=self.blocks)


def _summary(fit: LinearFit | SplitPlotFit) -> FitSummary:
    if isinstance(fit, LinearFit):
        sigmas: dict[str, float | None] = {"sigma_E": if_finite(fit.sigma)}
        stderr = fit.stderr
    else:
        sigmas = {name: getattr(fit, name) for name in ("sigma_subplot", "sigma_wholeplot", "sigma_replicate")}
        stderr = fit.kenward_roger().stderr
    return FitSummary.of(sigmas, "", fit.names, fit.coefficients, stderr)


def _order_of(table: Table) -> Where:
    """Place of a row in words: its order, if the table has one."""
    order = table.columns.get("order")
    return lambda row: "" if order is None else f"order {order[row]:.0f}"


def _of_rows(fit: LinearFit) -> dict[str, Any]:
    """Coefficients and errors of a fit of independent rows; null without degrees of freedom."""
    known = fit.df > 0
    every = np.ones(len(fit.names))
    notes = [] if known else [no_error(fit.n, len(fit.names))]
    stderr = fit.stderr if known else every * np.nan
    return {
        "coefficients": coefficient_table(fit.names, fit.coefficients, stderr, every * fit.df),
        "sigma_E": fit.sigma if known else None,
        "notes": notes,
    }


def _of_whole_plots(fit: SplitPlotFit) -> dict[str, Any]:
    """The same for a fit with whole plots."""
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


def _uneven(
    fit: LinearFit | SplitPlotFit, given: _Rows, model: Formula, table: Table, rows: IntArray
) -> tuple[str, ...]:
    """Sentence about unequal scatter of the rows; nothing if it is equal."""
    if isinstance(fit, LinearFit):
        left, own = given.y - fit.predict(given.columns), 1.0 - fit.variance_function(given.columns)
    else:
        spectrum, k = fit.structure.spectrum, len(fit.names)
        taken = 1.0 - 1.0 / (1.0 + fit.structure.ratio * spectrum.xi)
        own = 1.0 - np.sum(spectrum.basis[:, :k] ** 2, axis=1) - spectrum.left**2 @ taken
        left = fit.conditional_residuals
    seen = own > 1e-6  # a row that the fit reproduces exactly has no information
    along = {name: table.columns[name][rows][seen] for name in model.names if name in table.columns}
    along["the fitted value"] = (given.columns @ fit.coefficients)[seen]
    said = uneven_scatter(left[seen] / np.sqrt(own[seen]), along)
    return (said,) if said else ()


def _calibration(
    fit: LinearFit | SplitPlotFit, response: str, formula: Formula, table: Table, rows: IntArray, notes: Sequence[str]
) -> CurveCalibration:
    """Data of a fit to these rows for `rig infer` and `rig chart`."""
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
        name: (float(table.columns[name][rows].min()), float(table.columns[name][rows].max()))
        for name in formula.names
        if name in table.columns
    }
    return CurveCalibration(
        response,
        formula,
        fit.coefficients,
        covariance,
        np.asarray(variances),
        derivatives,
        spread,
        ranges,
        Factored.of(fit),
        tuple(notes),
    )


@dataclass(frozen=True)
class GeneralFitted(PlainFitted):
    """A fit to any table, as JSON values."""

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        from procedures.general.shown import show_general_fit  # noqa: PLC0415

        return show_general_fit(self.result["data"]["file"], self.result)
