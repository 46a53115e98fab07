"""Pressure transducers in whole plots: calibrations by every method, in JSON and in words."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.fitter.errors import FitError
from rig.fitter.misfit import COVERED_BY_WHOLE_PLOTS
from rig.procedures.errors import DataError
from rig.procedures.evaluate.acceptance import Verdict, gross_words
from rig.procedures.evaluate.fit_in_short import MANY
from rig.procedures.evaluate.left_out import FitSummary, LeaveOut, Searched, kept_with, search
from rig.procedures.present.blocks import Block, headline
from rig.procedures.pressure.declared import ACCEPTED_BY, Declared
from rig.procedures.pressure.fit import PressureFit, fit_transducers, named_formula, variance_inflation
from rig.procedures.pressure.fit.methods import METHOD
from rig.procedures.pressure.fit.models import coefficient_unit
from rig.procedures.pressure.gross import of_whole_plots
from rig.procedures.pressure.shown import show_whole_plot_fit, show_whole_plot_fit_in_short
from rig.procedures.pressure.table import unused as unused_columns
from rig.procedures.pressure.table import usable
from rig.procedures.pressure.words import HOLD_AT, largest_words
from rig.procedures.tables.file_rows import rows_of_file

if TYPE_CHECKING:
    from rig.fitter.arrays import IntArray
    from rig.fitter.gross import GrossErrors
    from rig.procedures.evaluate.results import Page
    from rig.procedures.pressure.data import WholePlotData
    from rig.procedures.pressure.settings import WholePlotProcedure
    from rig.procedures.tables.table import Table


@dataclass(frozen=True, eq=False)
class WholePlotFitted:
    """A table and its calibrations.

    Attributes:
        table: source of the data.
        data: the same as arrays.
        fits: by transducer.
        method: method of each stored calibration.
        dead: reasons for left-out transducers, by output.
        searched: result of the search for gross errors; `data` and `fits` are of its used rows.
        declared: the model, and its source.
        others: fits with the gross errors if `fits` are without them, and vice versa; or the reason why there are none;
            None if no row is named.
    """

    table: Table
    data: WholePlotData
    fits: Mapping[str, PressureFit]
    method: str
    dead: Mapping[str, str]
    searched: Searched
    declared: Declared
    others: Mapping[str, PressureFit] | str | None = None

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig fit --json`; with one transducer its keys are at the top level too.

        Raises:
            DataError: the method cannot be used, or gives no usable calibration.
        """
        sensors = {}
        for name, fit in self.fits.items():
            try:
                calibration = fit.calibration(self.method).to_dict()
            except FitError as error:
                raise DataError(f"{self.table.source}: {name}: {error}") from error
            try:
                inflation = variance_inflation(fit.formula, self.data.table)
            except FitError:  # terms that coded variables cannot replace, such as logarithms, have none
                inflation = {}
            calibration |= kept_with(self.searched)
            more: dict[str, Any] = {"calibration": calibration, "variance_inflation": inflation}
            more |= {"gross_errors": self.gross(name), "intervals_cover": COVERED_BY_WHOLE_PLOTS}
            sensors[name] = with_units({**fit.to_dict(), **more})
        table = self.table
        points: dict[str, Any] = {"points": len(self.data), "rows_left_out": self.searched.rows_left_out}
        points["model"] = self.declared.to_dict()
        points["coefficients_hold_at"] = HOLD_AT
        data = {**points, "kind": "whole-plot", "simulated": table.simulated, **table.provenance}
        alone = next(iter(sensors.values())) if len(sensors) == 1 else {}
        unused = unused_columns(table).to_json()
        return {**alone, "data": data, "sensors": sensors, "left_out": dict(self.dead), "unused": unused}

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        yield headline(PurePath(self.table.source).name, self.table)
        yield from show_whole_plot_fit(self.to_json())

    def short(self) -> Iterable[Block]:
        """Blocks for one screen; up to three transducers have all."""
        told = self.to_json()
        if len(told["sensors"]) <= MANY:
            return self.blocks()
        return (headline(PurePath(self.table.source).name, self.table), *show_whole_plot_fit_in_short(told))

    def page(self) -> Page:
        """Its report: the paper's methods side by side."""
        from rig.procedures.pressure.methods_report import fit_page  # noqa: PLC0415 - plots take a second to import

        return fit_page(self.table, self.data, self.fits, self.method, self.to_json())

    def gross(self, name: str) -> dict[str, Any]:
        """The gross errors of a transducer as JSON values."""
        columns, others = self.table.columns, self.others
        other = _summary(others[name]) if isinstance(others, Mapping) else others

        def where(row: int) -> str:
            return f"order {columns['order'][row]:.0f} at {columns['pressure_psia'][row]:.3g} psia"

        return self.searched.of_sensor(name, "mV", where, _summary(self.fits[name]), other)


def _summary(fit: PressureFit) -> FitSummary:
    reml = fit.reml
    sigmas = {"sigma_subplot": reml.sigma_subplot, "sigma_wholeplot": reml.sigma_wholeplot}
    return FitSummary.of(sigmas, "mV", reml.names, reml.coefficients, np.sqrt(np.diag(reml.covariance)))


def fit_whole_plots(
    table: Table,
    model: str | None = None,
    *,
    method: str = METHOD,
    add: Sequence[str] = (),
    power: float = 1.0,
    exclude_zero: bool = False,
    leave_out: Sequence[str] = (),
) -> WholePlotFitted:
    """Calibrate every transducer of a whole-plot table by every method.

    Args:
        table: of kind whole-plot.
        model: "full", "II.C", "eq10", "hierarchical" or a formula; as the table's procedure declares it if None.
        method: method of each stored calibration.
        add: further terms, for example traced effects.
        power: weighted methods multiply rows by 1/P^power.
        exclude_zero: weighted methods leave out readings at zero pressure.
        leave_out: "gross" for the rows named by the search for gross errors, or row numbers of the file.

    Raises:
        DataError: columns or values are missing, or the rows do not determine the model or its errors.
    """
    data, dead = usable(table)
    declared = Declared.of(table, model, data)
    asked = LeaveOut.of(leave_out, table)

    def fitted(rows: IntArray) -> Mapping[str, PressureFit]:
        with rows_of_file(table, rows):
            return fit_transducers(
                data.take(rows), declared.model, extra=tuple(add), power=power, exclude_zero=exclude_zero
            )

    def gross(rows: IntArray) -> Mapping[str, GrossErrors]:
        with rows_of_file(table, rows):
            return of_whole_plots(data.take(rows), formula)

    try:
        formula = named_formula(declared.model, tuple(add))
        searched = search(table, asked, gross)
        fits = fitted(searched.used)
        others = searched.with_the_others(fitted)
        return WholePlotFitted(table, data.take(searched.used), fits, method, dead, searched, declared, others)
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error


def with_units(sensor: dict[str, Any]) -> dict[str, Any]:
    """A transducer's JSON with the unit of every coefficient."""
    tables = [sensor["coefficients"], *(method["coefficients"] for method in sensor["methods"].values())]
    for table in tables:
        for term, value in table.items():
            value["unit"] = coefficient_unit(term)
    return sensor


def judge(procedure: WholePlotProcedure, table: Table) -> list[Verdict]:
    """Every transducer's reading error in use compared with its limit; [] without one."""
    limit, psia = procedure.acceptance.reading_error_pct, procedure.acceptance.at_psia
    if limit is None:
        return []
    words = f"reading error in use at {psia:g} psia up to {limit:g} %, {ACCEPTED_BY}"
    fitted = fit_whole_plots(table)
    verdicts = [Verdict(name, why, words, inside=False) for name, why in fitted.dead.items()]
    for name, fit in fitted.fits.items():
        method = fit.methods.get(ACCEPTED_BY)
        if method is None:
            raise DataError(f"{name}: {ACCEPTED_BY} is not possible: {fit.not_possible[ACCEPTED_BY]}")
        errors, use = method.reading_error, method.in_use
        at = int(abs(errors.pressure_psia - psia).argmin())
        if abs(errors.pressure_psia[at] - psia) > 0.05 * psia:
            raise DataError(f"no pressure near acceptance.at_psia = {psia:g} was measured")
        # if no other reading of the whole plot can serve as zero, the interval of a reading in use is judged
        found = float(use.max_pct[at] if np.isfinite(use.max_pct[at]) else use.half95_pct[at])
        shown = {"in_use": use.to_dict()}
        gross = gross_words(fitted.gross(name))
        said = f"reading error at {psia:g} psia {largest_words(shown, at)}, limit {limit:g} %{gross}"
        verdicts.append(Verdict(name, said, words, found <= limit))
    return verdicts
