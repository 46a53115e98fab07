"""A whole-plot run as it is planned: its precision, and outputs of a straight transducer with the expected errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.split_plot import SplitPlotDesign, plan_precision
from rig.procedures.evaluate.budgeting import Expected
from rig.procedures.plan.precision import Precision, source_of
from rig.procedures.plan.run_list import RunList
from rig.procedures.pressure.fit import named_formula
from rig.procedures.pressure.settings import WholePlotProcedure
from rig.procedures.tables.table import Table


def precision(procedure: WholePlotProcedure, run_list: RunList) -> Precision:
    """Precision of each term of the pressure model, as its change from the middle of the design to its end."""
    expect = procedure.expect
    set_to = np.array([p.setpoints for p in run_list.points])
    middle, half = _coding(set_to)
    whole_plot = np.array([p.whole_plot for p in run_list.points])
    formula = named_formula(procedure.declared_model)
    names, columns = coded_columns(procedure, run_list)
    try:
        found = plan_precision(columns, whole_plot, expect.sigma_wholeplot_mV, expect.sigma_subplot_mV, names)
    except FitError as error:
        raise FitError(f"{error}; or plan a smaller model ([model] formula)") from error
    sensitivity = expect.sensitivity_mV_per_psi
    rows = [
        {
            "term": name,
            "stratum": "whole plot" if _shared(columns[:, i], whole_plot) else "subplot",
            "sd_mV": float(found.stderr[i]),
            "sd_psi": float(found.stderr[i]) / sensitivity,
            "df": float(found.df[i]) if np.isfinite(found.df[i]) else None,
        }
        for i, name in enumerate(names)
    ]
    cells = [
        (
            str(row["term"]),
            str(row["stratum"]),
            f"{row['sd_mV']:.2e}",
            f"{row['sd_psi']:.2e}",
            "-" if row["df"] is None else f"{row['df']:.0f}",
        )
        for row in rows
    ]
    pressures = sorted({p for p in set_to[:, 0] if p > 0})[:3]
    further = [
        _known_to(psia, procedure, found.covariance, lambda p: formula.columns(_at(p, middle, half))[1][0])
        for psia in pressures
    ]
    return Precision(
        ("term", "stratum", "sd / mV", "sd / psi", "df"),
        rows,
        cells,
        "each variable coded from -1 to 1 over the design; if temperature changes have an error of "
        f"{expect.sigma_wholeplot_mV:g} mV and observations one of {expect.sigma_subplot_mV:g} mV: "
        f"{source_of(['sigma_wholeplot_mV', 'sigma_subplot_mV'], expect.model_fields_set)}",
        tuple(further),
    )


def coded_columns(procedure: WholePlotProcedure, run_list: RunList) -> tuple[tuple[str, ...], FloatArray]:
    """Names and columns (n, k) of the declared model, each variable coded from -1 to 1 over the design."""
    set_to = np.array([p.setpoints for p in run_list.points])
    middle, half = _coding(set_to)
    coded = (set_to - middle) / half
    names, columns = named_formula(procedure.declared_model).columns(dict(zip(_VARIABLES, coded.T, strict=True)))
    return tuple(names), columns


def _coding(set_to: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Middle and half range of each variable over (n, 3) settings; one in place of a range of zero."""
    half = np.ptp(set_to, axis=0) / 2.0
    return (set_to.max(axis=0) + set_to.min(axis=0)) / 2.0, np.where(half > 0, half, 1.0)


_VARIABLES = ("P", "T_sensor", "T_SSE")


def _at(psia: float, middle: FloatArray, half: FloatArray) -> dict[str, FloatArray]:
    """One coded setting: a pressure at the middle of both temperatures."""
    coded = (np.array([psia, middle[1], middle[2]]) - middle) / half
    return {name: np.array([value]) for name, value in zip(_VARIABLES, coded, strict=True)}


def _known_to(
    psia: float, procedure: WholePlotProcedure, covariance: FloatArray, columns: Callable[[float], FloatArray]
) -> str:
    """Precision of a pressure in use, with and without a zero read in vacuum before."""
    expect, h, h_0 = procedure.expect, columns(psia), columns(0.0)
    shared, own = expect.sigma_wholeplot_mV**2, expect.sigma_subplot_mV**2
    plain = shared + own + float(h @ covariance @ h)
    zeroed = 2.0 * own + float((h - h_0) @ covariance @ (h - h_0))
    pct = [196.0 * np.sqrt(v) / expect.sensitivity_mV_per_psi / psia for v in (plain, zeroed)]
    return f"{psia:g} psia in use: +-{pct[0]:.2g} %; after reading the zero in vacuum +-{pct[1]:.2g} % (95 % intervals)"


def _shared(column: FloatArray, whole_plot: np.ndarray[Any, Any]) -> bool:
    """Whether a column is constant in every whole plot."""
    return all(float(np.ptp(column[whole_plot == w])) == 0.0 for w in np.unique(whole_plot))


_SEED = 20260115


def expected_run(procedure: WholePlotProcedure, run_list: RunList, sensors: Mapping[str, str]) -> Expected:
    """A run as it is planned, for a forecast: the first transducer stands for all."""
    expect = procedure.expect
    names = ("pressure_psia", "sensor_temperature_degC", "sse_temperature_degC")
    pressure, sensor, sse = (np.array(run_list.column(name), np.float64) for name in names)
    plot = np.array([point.whole_plot for point in run_list.points], np.int64)
    rng, n = np.random.default_rng(_SEED), len(pressure)
    terms, fixed = coded_columns(procedure, run_list)
    ratio = (expect.sigma_wholeplot_mV / expect.sigma_subplot_mV) ** 2
    errors = expect.sigma_subplot_mV * SplitPlotDesign(fixed, plot, terms).expected_errors(ratio, rng)
    output = expect.sensitivity_mV_per_psi * pressure + errors
    column = next(iter(sensors))
    columns = {
        "whole_plot": plot.astype(np.float64),
        "replicate": np.array([point.replication for point in run_list.points], np.float64),
        "order": np.arange(1.0, n + 1.0),
        "elapsed_s": np.arange(float(n)),
        "pressure_psia": pressure,
        "sensor_temperature_degC": sensor,
        "sse_temperature_degC": sse,
        column: output,
    }
    words = (
        f"transducers of {expect.sensitivity_mV_per_psi:g} mV/psi, {expect.sigma_wholeplot_mV:g} mV between whole "
        f"plots and {expect.sigma_subplot_mV:g} mV within, [expect]"
    )
    declared = {"formula": procedure.declared_model}
    table = Table("the plan", columns, True, {}, declared=declared, kind="whole-plot", outputs={column: column})
    return Expected(table, meter=True, assuming=words)
