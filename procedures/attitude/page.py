"""The report of an attitude calibration: findings, error before and after, residuals, provenance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fitter.trace.outcome import Outcome, WithError
from procedures.attitude.parameters import NO_DIRECTION
from procedures.attitude.plots import Picture, residual_map, residuals_against
from procedures.attitude.words import little_help
from procedures.effect_plots import drawn
from procedures.effects_page import effects_part
from procedures.numbers import with_error
from procedures.results import Page
from procedures.words import TESTS, significant

if TYPE_CHECKING:
    from procedures.attitude.evaluate import AttitudeTraced

_ROWS = (
    ("sigma_E_deg", "sigma_E / 1e-4 deg", 1e4, "standard error of one observation"),
    ("sigma_bias_deg", "sigma_bias / 1e-4 deg", 1e4, "its part from lack of fit"),
    ("sigma_prec_deg", "sigma_prec / 1e-4 deg", 1e4, "its part from scatter between replications"),
    ("T_bias", "T_bias", 1.0, "lack of fit against scatter"),
    ("F_bias_95", "its 95 % limit", 1.0, ""),
    ("T_b", "T_b", 1.0, "offset between replications"),
    ("T_S", "T_S", 1.0, "sensitivity between replications"),
    ("F_bS_95", "their 95 % limit", 1.0, ""),
    ("cv_rms_deg", "left-out error / 1e-4 deg", 1e4, "rms error at replications the fit has not seen"),
)


def trace_page(traced: AttitudeTraced) -> Page:
    """The report of a trace."""
    result = traced.to_json()
    sensors = [_sensor(one, result["sensors"][one.sensor], traced) for one in traced.outcomes]
    span_s = float(np.ptp(traced.data.elapsed_s))
    return Page("procedures.attitude", "page.html.j2", traced.table, span_s, result["unused"], {"sensors": sensors})


def _sensor(outcome: Outcome, result: dict[str, Any], traced: AttitudeTraced) -> dict[str, Any]:
    name, before, after = outcome.sensor, result["before"], result["after"]
    return {
        **result,
        "name": name,
        "rows": [
            {
                "label": label,
                "before": _number(before[key], scale),
                "after": _number(after[key], scale),
                "meaning": what,
                "above": [key in TESTS and significant(side, key) for side in (before, after)],
            }
            for key, label, scale, what in _ROWS
        ],
        "parameters": [
            {"name": one.label, "before": _text(one.before), "after": _text(one.after)} for one in outcome.parameters
        ],
        "at_words": traced.at_words(name),
        "no_direction": NO_DIRECTION if "mx_V" in {one.name for one in outcome.parameters} else "",
        **effects_part(result, drawn(outcome.figures)),
        "little_help": little_help(result),
        "notes": result.get("notes", []),
        "plots": _plots(name, _picture(traced, name)),
    }


def _picture(traced: AttitudeTraced, name: str) -> Picture:
    data, found = traced.data, traced.trace.sensors[name]
    to_deg = np.degrees(1.0 / found.S_V)
    return Picture(
        pitch_deg=data.pitch_deg,
        roll_deg=data.roll_deg,
        elapsed_h=data.elapsed_s / 3600.0,
        temperature_degC=data.sensor_temperature_degC,
        replicate=data.replicate,
        before_deg=found.residual_before_V * to_deg,
        after_deg=found.residual_after_V * to_deg,
        interval_deg=(1.96 * found.before.sigma_E * to_deg, 1.96 * found.after.sigma_E * to_deg),
    )


def _plots(name: str, picture: Picture) -> list[dict[str, Any]]:
    over = [
        (picture.pitch_deg, "pitch / deg"),
        (picture.roll_deg, "roll / deg"),
        (picture.elapsed_h, "bench time / h"),
    ]
    if picture.temperature_degC is not None:
        over.append((picture.temperature_degC, "sensor temperature / degC"))
    plots = [
        {
            "alt": f"{name}: residuals over {label}, before and after",
            "figure": residuals_against(picture, x, label, legend=i == 0),
        }
        for i, (x, label) in enumerate((x, label) for x, label in over if np.ptp(x) > 0)
    ]
    if np.ptp(picture.roll_deg) > 0:
        plots.append({"alt": f"{name}: mean residual over pitch and roll", "figure": residual_map(picture)})
    return plots


def _number(value: float | None, scale: float) -> str:
    return "-" if value is None else f"{value * scale:.3g}"


def _text(one: WithError | None) -> tuple[str, str]:
    return ("-", "-") if one is None else with_error(one.value, one.stderr)
