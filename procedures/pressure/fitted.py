"""Pressure transducers in whole plots: calibrations by every method, in JSON and in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.fitter.errors import FitError
from rig.fitter.misfit import COVERED_BY_WHOLE_PLOTS
from rig.procedures.errors import DataError
from rig.procedures.evaluate.left_out import FitSummary, LeaveOut, Searched, kept_with, search
from rig.procedures.present.blocks import Block, headline
from rig.procedures.pressure.fit import PressureFit, fit_transducers, named_formula, variance_inflation
from rig.procedures.pressure.fit.methods import METHOD
from rig.procedures.pressure.fit.models import ONE_TEMPERATURE, coefficient_unit, usual
from rig.procedures.pressure.gross import of_whole_plots
from rig.procedures.pressure.table import KNOWN, UNIT, whole_plot_data
from rig.procedures.tables.file_rows import rows_of_file
from rig.procedures.tables.unused import unused_in_fit

if TYPE_CHECKING:
    from rig.fitter.arrays import IntArray
    from rig.fitter.gross import GrossErrors
    from rig.procedures.evaluate.results import Page
    from rig.procedures.pressure.data import WholePlotData
    from rig.procedures.tables.table import Table


@dataclass(frozen=True)
class Declared:
    """The declared model of a whole-plot table.

    Attributes:
        model: a name of terms, or a formula.
        source: its source: "--formula", "procedure" or "default".
        procedure: the declaration of the run's procedure; None without.
    """

    model: str
    source: str
    procedure: str | None

    @staticmethod
    def of(table: Table, asked: str | None, data: WholePlotData) -> Declared:
        """As requested; otherwise as declared by the procedure of the table's run; otherwise of second order."""
        told = table.declared.get("formula")
        if asked is not None:
            return Declared(asked, "--formula", told)
        return Declared(usual(data), "default", None) if told is None else Declared(told, "procedure", told)

    def to_dict(self) -> dict[str, str | None]:
        """JSON values, with a sentence."""
        if self.source == "procedure":
            said = f"model {self.model}, as the run's procedure declares it"
        elif self.source == "default":
            said = f"model {self.model}: none is declared"
            if self.model == ONE_TEMPERATURE:
                said += (
                    ", and the temperatures that were set do not determine terms of T_SSE; it holds where T_SSE "
                    "follows T_sensor as in these data"
                )
        elif self.procedure is None:
            said = f"model {self.model}, as --formula says"
        else:
            said = f"model {self.model}, as --formula says; the run's procedure declares {self.procedure}"
        return {"fitted": self.model, "source": self.source, "procedure": self.procedure, "sentence": said}


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
        unused = unused_in_fit(table, KNOWN, UNIT).to_json()
        return {**alone, "data": data, "sensors": sensors, "left_out": dict(self.dead), "unused": unused}

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        from rig.procedures.pressure.shown import show_whole_plot_fit  # noqa: PLC0415 - which needs this module

        yield headline(PurePath(self.table.source).name, self.table)
        yield from show_whole_plot_fit(self.to_json())

    def page(self) -> Page:
        """Its report: the paper's methods side by side."""
        from rig.procedures.pressure.methods_report import fit_page  # noqa: PLC0415 - plots take a second to import

        return fit_page(self)

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
    data, dead = alive(table)
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


def alive(table: Table) -> tuple[WholePlotData, dict[str, str]]:
    """The data of usable transducers, and the defects of the others."""
    data = whole_plot_data(table)
    dead = {n: f"reads {v[0]:g} mV throughout" for n, v in data.outputs.items() if float(np.ptp(v)) == 0.0}
    outputs = {name: values for name, values in data.outputs.items() if name not in dead}
    if not outputs:
        raise DataError(f"{table.source}: {'; '.join(f'{n} {why}' for n, why in dead.items())}: nothing to calibrate")
    return (replace(data, outputs=outputs) if dead else data), dead


def with_units(sensor: dict[str, Any]) -> dict[str, Any]:
    """A transducer's JSON with the unit of every coefficient."""
    tables = [sensor["coefficients"], *(method["coefficients"] for method in sensor["methods"].values())]
    for table in tables:
        for term, value in table.items():
            value["unit"] = coefficient_unit(term)
    return sensor


def errors_in_words(sensor: Mapping[str, Any]) -> str:
    """Sentence about the errors of a reading, with growth with pressure."""
    errors = sensor["errors"]
    s_0, growth = errors["subplot_variance"] ** 0.5, errors["growth_per_psia"]
    between = f"{errors['wholeplot_variance'] ** 0.5:.3g} mV between whole plots"
    if growth == 0.0:
        return f"errors: {s_0:.3g} mV within whole plots, {between}"
    return f"errors: {s_0:.3g} mV + {s_0 * growth:.3g} mV/psi x P within whole plots, {between}"


HOLD_AT = "coefficients are of P in psia and temperatures in degC as measured: each holds where the others are zero"
LOW_PSIA = 0.12
"""Pressure at which the paper compares its methods."""


def low_pressure(result: Mapping[str, Any]) -> tuple[int, float]:
    """Index and value of a fit's pressure nearest to the comparison pressure of methods."""
    sensor = next(iter(result["sensors"].values()))
    pressures = next(iter(sensor["methods"].values()))["reading_error"]["pressure_psia"]
    low = min((p for p in pressures if p > 0), key=lambda p: abs(p - LOW_PSIA))
    return pressures.index(low), low


IN_USE = (
    "in use: readings predicted by other whole plots, or with in-flight zero by one zero reading of their own, whose "
    "error counts; ± is the 95 % interval of one reading, ? where no reading can be compared with a prediction"
)


def in_use_words(fitted: Mapping[str, Any], at: int) -> str:
    """A method's largest error in use at one pressure, and the 95 % interval of a reading there: "3.3±2.9"."""
    largest, half = fitted["in_use"]["max_pct"][at], fitted["in_use"]["half95_pct"][at]
    if half is None:
        return "-"
    return f"{'?' if largest is None else f'{largest:.3g}'}±{half:.2g}"


def largest_words(fitted: Mapping[str, Any], at: int) -> str:
    """A method's largest error in use at one pressure in a clause, with its probable range."""
    use = fitted["in_use"]
    largest, half = use["max_pct"][at], use["half95_pct"][at]
    if half is None:
        return "unknown in use"
    if largest is None:
        return f"not measured in use, because there is no other reading as zero; 95 % of readings within ±{half:.2g} %"
    low, high = use["max_by_chance_pct"][at]
    return (
        f"{largest:.3g} % in use, the largest of {use['count'][at]} (by chance {low:.2g} to {high:.2g} %; 95 % of "
        f"readings within ±{half:.2g} %)"
    )
