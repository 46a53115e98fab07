"""The report of a whole-plot fit: the paper's methods side by side, as tables and as its figures 3 to 9."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.fitter.rounding import guard_digits, with_error
from rig.procedures.evaluate.results import Page
from rig.procedures.present.numbers import number
from rig.procedures.present.pictures import grid
from rig.procedures.pressure.fit import METHODS, PressureFit
from rig.procedures.pressure.words import HOLD_AT, IN_USE, errors_in_words, in_use_words, low_pressure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rig.procedures.pressure.data import WholePlotData
    from rig.procedures.tables.table import Table

_MEASURES = (
    ("max_pct", "Largest residual / % (no error in use where a method fits whole plots as they come)"),
    ("rms_pct", "Root-mean-square residual / %"),
    ("width_pct", "Full width of the 95 % prediction interval / % (eq. 11)"),
    ("bias_pct", "Bias / % (eq. 12)"),
)


def fit_page(
    table: Table, data: WholePlotData, fits: Mapping[str, PressureFit], method: str, result: Mapping[str, Any]
) -> Page:
    """The report of a fit."""
    at, low = low_pressure(result)
    methods = [m for m in METHODS if all(m in sensor["methods"] for sensor in result["sensors"].values())]
    contents = {
        "whole_plots": len(data.whole_plots),
        "method": method,
        "low": f"{low:.3g}",
        "summary": [
            {"name": name, "values": [in_use_words(sensor["methods"][m], at) for m in methods]}
            for name, sensor in result["sensors"].items()
        ],
        "methods": methods,
        "sensors": [_transducer(name, result["sensors"][name], fit, method) for name, fit in fits.items()],
    }
    span_s = float(np.ptp(data.elapsed_s))
    return Page("rig.procedures.pressure", "methods.html.j2", table, span_s, result["unused"], contents)


def _transducer(name: str, result: Mapping[str, Any], fit: PressureFit, method: str) -> dict[str, Any]:
    methods = result["methods"]
    guard = guard_digits(result["calibration"]["covariance"])
    pressures = next(iter(methods.values()))["reading_error"]["pressure_psia"]
    return {
        **result,
        "name": name,
        "errors_in_words": errors_in_words(result),
        "ranges": [(n, f"{low:.4g} to {high:.4g}") for n, (low, high) in result["calibration"]["ranges"].items()],
        "pressures": [f"{p:.3g}" for p in pressures],
        "measures": [
            {
                "title": f"Largest reading error in use / %; {IN_USE}",
                "rows": [
                    {
                        "method": m,
                        "biased": v["biased"],
                        "values": [in_use_words(v, i) for i in range(len(pressures))],
                    }
                    for m, v in methods.items()
                ],
            }
        ]
        + [
            {
                "title": title,
                "rows": [
                    {"method": m, "biased": v["biased"], "values": [number(x) for x in v["reading_error"][key]]}
                    for m, v in methods.items()
                ],
            }
            for key, title in _MEASURES
        ],
        "remarks": [HOLD_AT, result["gross_errors"]["sentence"]]
        + [f"{m}: {v['note']}" for m, v in methods.items() if v["note"]]
        + [f"{m} is not possible: {why}" for m, why in result["not_possible"].items()]
        + [*result["notes"], result["intervals_cover"]],
        "rows": [
            {
                "term": term,
                "both": with_error(value["estimate"], value["stderr"], guard=guard),
                "df": number(value["df"]),
                "vif": number(result["variance_inflation"].get(term)),
                "unit": value["unit"],
            }
            for term, value in methods[method]["coefficients"].items()
        ],
        "plot": {"alt": f"{name}: reading error over pressure by every method", "figure": methods_plot(fit)},
    }


def methods_plot(fit: PressureFit) -> Figure:
    """Residuals over pressure in percent of it, one plot per method, and the 95 % prediction interval. All methods have
    one scale except the biased ones, which would dominate it.
    """
    data = fit.problem.data
    at = data.pressure_psia > 0
    figure, axes = grid(len(fit.methods), columns=3, height=2.6)
    slope = np.asarray(fit.formula.derivative(data.table, "P") @ fit.reml.coefficients)
    bound = 0.0
    for axis, (method, fitted) in zip(axes, fit.methods.items(), strict=False):
        error = 100.0 * fitted.residuals_mV[at] / (slope[at] * data.pressure_psia[at])
        axis.plot(data.pressure_psia[at], error, "o", ms=2.5, alpha=0.5, color="C3" if fitted.biased else "C0")
        shown = fitted.reading_error
        for side in (-0.5, 0.5):
            axis.plot(shown.pressure_psia, side * shown.width_pct, color="0.3", lw=0.9, ls="-.")
        axis.set_title(method + (" (biased; its own scale)" if fitted.biased else ""), fontsize=9)
        axis.set_xscale("log")
        axis.set_yscale("symlog", linthresh=2.0)
        axis.set_xlabel("pressure / psia", fontsize=8)
        axis.set_ylabel("reading error / %", fontsize=8)
        axis.grid(color="0.9", linewidth=0.6)
        axis.tick_params(labelsize=7)
        axis.axhline(0, color="0.5", linewidth=0.7)
        if not fitted.biased:
            bound = max(bound, float(np.nanmax(shown.width_pct)), float(np.abs(error).max()))
    for axis, fitted in zip(axes, fit.methods.values(), strict=False):
        if not fitted.biased:
            axis.set_ylim(-1.2 * bound, 1.2 * bound)
    return figure
