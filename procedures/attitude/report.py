"""The report of a trace in an attitude calibration: findings, error before and after, residuals, provenance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.fitter.trace.outcome import Outcome
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.parameters import NO_DIRECTION, SCALE, UNIT
from rig.procedures.attitude.words import little_help
from rig.procedures.evaluate.results import Page
from rig.procedures.evaluate.trace_page import trace_page
from rig.procedures.present.pictures import BEFORE_AFTER, colour_scale, dress, legend_below, side_by_side

if TYPE_CHECKING:
    from rig.procedures.attitude.trace import SensorTrace, Trace
    from rig.procedures.evaluate.results import Traced

Array = np.ndarray[Any, np.dtype[np.float64]]

_MARKS = "osD^v<>ph*"


@dataclass(frozen=True)
class Picture:
    """Plotted values of one sensor.

    Attributes:
        pitch_deg: (n,) setpoints.
        roll_deg: (n,) setpoints.
        elapsed_h: (n,) hours since the start of the run.
        temperature_degC: (n,) at the sensor, None if it was not recorded.
        replicate: (n,) number of the pass over the design.
        before_deg: (n,) residual of the declared model.
        after_deg: (n,) residual with the effects found.
        interval_deg: half-width of the 95 % prediction interval before and after, one number each.
    """

    pitch_deg: Array
    roll_deg: Array
    elapsed_h: Array
    temperature_degC: Array | None
    replicate: np.ndarray[Any, np.dtype[np.int64]]
    before_deg: Array
    after_deg: Array
    interval_deg: tuple[float, float]


def residuals_against(picture: Picture, x: Array, label: str, *, legend: bool) -> Figure:
    """Residuals before and after over one variable, with a colour for each replication, and a legend on request."""
    figure, axes = side_by_side(3.2)
    sides = picture.before_deg, picture.after_deg
    for axis, residual, half, title in zip(axes, sides, picture.interval_deg, BEFORE_AFTER, strict=True):
        _by_replication(axis, x, residual, picture.replicate)
        for side in (-half, half):
            axis.axhline(side * SCALE, color="0.35", linewidth=0.9, linestyle="-.")
        dress(axis, title, label)
    axes[0].set_ylabel(f"residual / {UNIT}", fontsize=9)
    if legend:
        handles, labels = axes[0].get_legend_handles_labels()
        legend_below(figure, handles, labels, 10, markerscale=2)
    bound = 1.15 * SCALE * float(np.percentile(np.abs(picture.before_deg), 99.8))
    axes[0].set_ylim(-bound, bound)
    return figure


def _by_replication(axis: Axes, x: Array, residual: Array, replicate: np.ndarray[Any, np.dtype[np.int64]]) -> None:
    for i, r in enumerate(np.unique(replicate)):
        rows = replicate == r
        axis.plot(
            x[rows],
            residual[rows] * SCALE,
            _MARKS[i % len(_MARKS)],
            markersize=2.2,
            alpha=0.55,
            label=f"replication {r}",
        )


def residual_map(picture: Picture) -> Figure:
    """Mean residual over pitch and roll, before and after, on one colour scale."""
    figure, axes = side_by_side(2.9)
    pitch, i = np.unique(np.round(picture.pitch_deg, 3), return_inverse=True)
    roll, j = np.unique(np.round(picture.roll_deg, 3), return_inverse=True)
    shape = (len(roll), len(pitch))
    cell = j * len(pitch) + i
    count = np.bincount(cell, minlength=shape[0] * shape[1])
    means = []
    for residual in (picture.before_deg, picture.after_deg):
        total = np.bincount(cell, residual, minlength=shape[0] * shape[1])
        with np.errstate(invalid="ignore"):
            means.append((SCALE * total / np.where(count, count, np.nan)).reshape(shape))
    bound = float(np.nanmax(np.abs(means[0])))
    for axis, mean, title in zip(axes, means, ("before", "after"), strict=True):
        mesh = axis.pcolormesh(pitch, roll, mean, vmin=-bound, vmax=bound, cmap="RdBu_r", shading="nearest")
        axis.set_title(f"mean residual, {title}", fontsize=9)
        axis.set_xlabel("pitch / deg", fontsize=9)
        axis.tick_params(labelsize=8)
    axes[0].set_ylabel("roll / deg", fontsize=9)
    colour_scale(figure, mesh, UNIT)
    return figure


def page_of(traced: Traced, data: AttitudeData, trace: Trace) -> Page:
    """The report of a trace of these data."""
    return trace_page(
        traced,
        "rig.procedures.attitude",
        lambda name: _plots(name, _picture(data, trace.sensors[name])),
        float(np.ptp(data.elapsed_s)),
        _of_sensor,
    )


def _of_sensor(outcome: Outcome, result: Mapping[str, Any]) -> dict[str, Any]:
    no_direction = NO_DIRECTION if "mx_V" in {one.name for one in outcome.parameters} else ""
    return {"no_direction": no_direction, "little_help": little_help(result)}


def _picture(data: AttitudeData, found: SensorTrace) -> Picture:
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
