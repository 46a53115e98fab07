"""The report of an attitude calibration: what was found, error before and after, residuals, provenance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fitter import fit_attitude
from fitter.effects.noise import OUTLIERS
from fitter.linear import orthonormal
from fitter.trace.result import FoundEffect
from rig.report.attitude_plots import SCALE, UNIT, Picture, residual_map, residuals_against
from rig.report.effect_plots import EffectView, effect_plot, noise_plot
from rig.report.effects import effects_part
from rig.report.frame import render
from rig.report.parameters import LABELS, NO_DIRECTION, parameters
from rig.report.words import TESTS, little_help, significant

if TYPE_CHECKING:
    from rig.closed_loop import AttitudeTraced

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


def attitude_report(traced: AttitudeTraced) -> str:
    """The report as HTML."""
    result = traced.to_json()
    return render(
        "attitude.html.j2",
        traced.table,
        span_s=float(np.ptp(traced.data.elapsed_s)),
        sensors=[_sensor(name, result["sensors"][name], traced) for name in traced.trace.sensors],
    )


def _sensor(name: str, result: dict[str, Any], traced: AttitudeTraced) -> dict[str, Any]:
    before, after = result["before"], result["after"]
    estimates, plots = parameters(traced, name), _effect_plots(traced, name)
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
        "parameters": estimates,
        "at_words": traced.at_words(name),
        "no_direction": NO_DIRECTION if LABELS["mx_V"] in {p.name for p in estimates} else "",
        **effects_part(result, plots),
        "little_help": little_help(result),
        "notes": result.get("notes", []),
        "plots": _plots(name, _picture(traced, name)),
    }


_VARIABLES = {
    "pitch_deg": ("pitch / deg", 1.0),
    "roll_deg": ("roll / deg", 1.0),
    "elapsed_s": ("bench time / h", 1 / 3600.0),
    "sensor_temperature_degC": ("sensor temperature / degC", 1.0),
}
"""Label and scale of the fields of the data that effects are looked at against."""


def _effect_plots(traced: AttitudeTraced, name: str) -> dict[str, str]:
    """A figure for every effect and finding of one sensor, by its name."""
    data, found = traced.data, traced.trace.sensors[name]
    to_unit = np.degrees(1.0 / found.S_V) * SCALE
    residual = found.residual_after_V * to_unit
    fit = fit_attitude(data, name, temperature=traced.temperature)
    basis = orthonormal(np.column_stack([fit.columns(data.pitch_deg, data.roll_deg), fit.beside(data)]))
    every = np.arange(len(data))
    kept = np.setdiff1d(every, traced.trace.outliers)
    plots = {}
    for effect in (*found.effects, *found.noise):
        name, (label, scale) = _variable(effect.against)
        rows = every if effect.effect == OUTLIERS else kept
        x, left = getattr(data, name)[rows] * scale, residual[rows]
        if isinstance(effect, FoundEffect):
            adds = (effect.contribution_V - basis @ (basis.T @ effect.contribution_V)) * to_unit
            plots[effect.effect] = effect_plot(EffectView(x, label, adds[rows], left, UNIT))
        else:
            plots[effect.effect] = noise_plot(x, label, left, UNIT)
    return plots


def _variable(against: str) -> tuple[str, tuple[str, float]]:
    """Field of the data to plot an effect against, with label and scale; the time for one that has no label here."""
    name = against if against in _VARIABLES else "elapsed_s"
    return name, _VARIABLES[name]


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


def _plots(name: str, picture: Picture) -> list[dict[str, str]]:
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
            "png": residuals_against(picture, x, label, legend=i == 0),
        }
        for i, (x, label) in enumerate((x, label) for x, label in over if np.ptp(x) > 0)
    ]
    if np.ptp(picture.roll_deg) > 0:
        plots.append({"alt": f"{name}: mean residual over pitch and roll", "png": residual_map(picture)})
    return plots


def _number(value: float | None, scale: float) -> str:
    return "-" if value is None else f"{value * scale:.3g}"
