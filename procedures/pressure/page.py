"""The report of a pressure calibration in whole plots: findings, error before and after, residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fitter.trace.outcome import Outcome
from procedures.effect_plots import drawn
from procedures.effects_page import effects_part
from procedures.pressure.plots import Residuals, between_whole_plots, reading_errors, within_whole_plots
from procedures.results import Page

if TYPE_CHECKING:
    from procedures.pressure.evaluate import WholePlotTraced

_ROWS = (
    ("sigma_subplot", "within whole plots / mV", "standard deviation of one reading at constant temperature"),
    ("sigma_wholeplot", "between whole plots / mV", "of the error that every temperature change draws again"),
    ("cv_rms", "left-out error / mV", "rms error at whole plots the fit has not seen, their own error included"),
)


def trace_page(traced: WholePlotTraced) -> Page:
    """The report of a trace."""
    result = traced.to_json()
    contents = {
        "whole_plots": len(traced.data.whole_plots),
        "sensors": [_transducer(one, result["sensors"][one.sensor], traced) for one in traced.outcomes],
    }
    span_s = float(np.ptp(traced.data.elapsed_s))
    return Page("procedures.pressure", "page.html.j2", traced.table, span_s, result["unused"], contents)


def _transducer(outcome: Outcome, result: dict[str, Any], traced: WholePlotTraced) -> dict[str, Any]:
    name, before, after = outcome.sensor, result["before"], result["after"]
    found = traced.trace.sensors[name]
    residuals = Residuals(traced.data, found.before.residual_mV, found.after.residual_mV, found.sensitivity)
    return {
        **result,
        "name": name,
        "rows": [
            {"label": label, "before": _number(before[key]), "after": _number(after[key]), "meaning": meaning}
            for key, label, meaning in _ROWS
        ],
        "reading_errors": [
            {"pressure": pressure, "before": _number(value), "after": _number(after["reading_error_pct"].get(pressure))}
            for pressure, value in before["reading_error_pct"].items()
        ],
        "coefficients": [
            {
                "name": term,
                **{key: _number(value[key], 6 if key == "estimate" else 3) for key in ("estimate", "stderr")},
            }
            | {"df": _number(value["df"], 3)}
            for term, value in result["fitted"]["coefficients"].items()
        ],
        **effects_part(result, drawn(outcome.figures)),
        "plots": [
            {"alt": f"{name}: reading error over pressure, before and after", "figure": reading_errors(residuals)},
            {"alt": f"{name}: residuals within whole plots over pressure", "figure": within_whole_plots(residuals)},
            {"alt": f"{name}: mean residual of each whole plot", "figure": between_whole_plots(residuals)},
        ],
    }


def _number(value: float | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}g}"
