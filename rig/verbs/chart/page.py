"""The report of control charts: changes, due date of the last calibration, and charts."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LinearLocator

from rig.fitter.history import Between, QuantityChart
from rig.fitter.history.forecast import predict
from rig.fitter.quantiles import t_limit
from rig.fitter.rounding import with_error
from rig.procedures.evaluate.charting import Shown
from rig.procedures.evaluate.results import Page
from rig.procedures.present.pictures import grid, legend_below
from rig.procedures.present.words import capitalised
from rig.procedures.tables.unused import Unused
from rig.verbs.chart.charted import DAYS, SHORT_DAYS, ControlCharts, SensorChart
from rig.verbs.chart.inputs import as_table
from rig.verbs.chart.sentences import due_date, probability

Array = np.ndarray[Any, np.dtype[np.float64]]

_COLOURS = {Between.SCATTER: "#4477aa", Between.WALK: "#b3460b"}
_WORDS = {Between.SCATTER: "if calibrations scatter", Between.WALK: "if the sensor wanders"}


def parameter_charts(sensor: SensorChart) -> Figure:
    """One chart per parameter: points with error bars, centre, limits, trend, forecast, due date."""
    charts = sensor.chart.quantities
    figure, axes = grid(len(charts), columns=2, height=3.0)
    due = sensor.due(sensor.tolerance)
    when = np.array([_day(one.when) for one in sensor.given])
    reach = None if sensor.chart.bound is None else _reach(sensor)
    for axis, q in zip(axes, charts, strict=False):
        draw_history(axis, q, sensor.view.shown[q.name], when, sensor.given[0].date, reach)
        draw_dates(axis, due)
    handles, labels = axes[0].get_legend_handles_labels()
    legend_below(figure, handles, labels, 7)
    return figure


def draw_history(axis: Axes, q: QuantityChart, how: Shown, when: Array, since: str, reach: float | None) -> None:
    """Draw a quantity over its calibrations: points with error bars, centre, limits, trend, forecast.

    Args:
        axis: is drawn on.
        q: the quantity.
        how: its unit and name for people.
        when: (m,) days since 1970 of the calibrations.
        since: date of the first one, for the title.
        reach: years ahead to be forecast; None for no forecast.
    """
    series = q.series
    start = float(series.values[0])

    def shown(values: Array | float) -> Any:
        return how.scale * (np.asarray(values) - start)

    bars = t_limit(0.95, series.df) * how.scale * np.sqrt(series.variance)
    axis.errorbar(when, shown(series.values), bars, fmt="o", color="0.15", markersize=4, capsize=2, label="calibration")
    if q.limits is not None:
        axis.axhline(shown(q.limits.centre), color="0.55", linewidth=0.8, label="centre")
        for half, style, words in ((q.limits.warning, "--", "95 % limits"), (q.limits.action, "-.", "99.7 % limits")):
            for sign in (-1, 1):
                edge = shown(q.limits.centre + sign * half)
                axis.plot(when, edge, style, color="0.45", linewidth=0.9, label=words if sign > 0 else None)
        out = q.limits.out
        if out.any():
            axis.plot(when[out], shown(series.values[out]), "o", color="#c00", ms=6)
    if reach is not None and q.trend is not None:
        _forecast(axis, q, float(when[-1]), reach, shown)
    axis.set_title(f"{how.label}, change since {since} / {how.unit}", fontsize=9)
    axis.grid(color="0.92", linewidth=0.6)


def _forecast(axis: Axes, q: QuantityChart, last_day: float, reach: float, shown: Any) -> None:
    """Prediction of the parameter under the variation favoured by the data, up to the last due date shown."""
    assert q.trend is not None
    ages = np.linspace(0.0, reach, 25)
    found = predict(q.series, q.trend.favoured, ages)
    mean, half = np.median(found.mean, axis=0), _quantile_half(found.mean, found.sd)
    later = last_day + DAYS * ages
    last, colour = float(q.series.values[-1]), _COLOURS[q.trend.favoured]
    axis.plot(later, shown(last + mean), color=colour, linewidth=1.2, label="forecast")
    axis.fill_between(
        later, shown(last + mean - half), shown(last + mean + half), color=colour, alpha=0.15, linewidth=0
    )
    slope, (t0, t1) = q.trend.per_year, (q.series.years[0], q.series.years[-1])
    middle = float(np.mean(q.series.values)), float(np.mean(q.series.years))
    ends = [middle[0] + slope * (t - middle[1]) for t in (t0, t1)]
    axis.plot(
        last_day + DAYS * (q.series.years[[0, -1]] - t1),
        shown(np.array(ends)),
        color="#228833",
        linewidth=1.2,
        label="trend",
    )


def _quantile_half(mean: Array, sd: Array) -> Array:
    """(T,) half-width of the 95 % interval about the median of a mixture of normal distributions."""
    rng = np.random.default_rng(0)
    node = np.arange(4096) % len(mean)
    drawn = mean[node] + sd[node] * rng.standard_normal((len(node), 1))
    return np.asarray(np.quantile(np.abs(drawn - np.median(mean, axis=0)), 0.95, axis=0))


def error_chart(sensor: SensorChart) -> Figure:
    """Bound on the error of the output over date, tolerance and due date."""
    bound = sensor.chart.bound
    assert bound is not None
    figure, (axis,) = grid(1, columns=1, height=3.0, width=7.0)
    unit, scale = sensor.view.drawn
    shown = bound.years <= _reach(sensor) + 1e-9
    for kind, values in bound.bounds.items():
        later = _later(sensor, bound.years[shown])
        axis.plot(later, scale * values[shown], color=_COLOURS[kind], label=_WORDS[kind])
    axis.axhline(scale * sensor.tolerance, color="0.3", linewidth=0.9, linestyle="--", label="tolerance")
    draw_dates(axis, sensor.due(sensor.tolerance))
    axis.set_ylim(bottom=0)
    axis.set_title(f"error of the last calibration's output, 95 % / {unit}", fontsize=9)
    axis.grid(color="0.92", linewidth=0.6)
    axis.legend(fontsize=7, frameon=False)
    return figure


def _reach(sensor: SensorChart) -> float:
    """Years ahead to be shown: somewhat beyond the due date, within the forecast."""
    bound = sensor.chart.bound
    assert bound is not None
    held = bound.holds_for(sensor.tolerance) or 0.0
    return float(min(bound.years[-1], max(1.5 * held, 0.25 * bound.years[-1])))


def _later(sensor: SensorChart, ages: Array) -> Array:
    """(T,) days since 1970 at these ages of the last calibration, in years."""
    return np.asarray(_day(sensor.last) + DAYS * ages)


def _day(moment: datetime) -> float:
    return moment.timestamp() / 86400.0


def _moment(day: float) -> datetime:
    return datetime.fromtimestamp(86400.0 * day, UTC)


def draw_dates(axis: Axes, due: Mapping[str, Any]) -> None:
    """Draw the due date, and write dates below the axis."""
    if "date" in due:
        axis.axvline(
            _day(datetime.fromisoformat(due["date"]).replace(tzinfo=UTC)),
            color="#c00",
            linewidth=1.0,
            linestyle=":",
            label="forecast ends" if due["at_least"] else "due",
        )
    low, high = axis.get_xlim()
    form = "%Y-%m" if high - low > 150 else "%Y-%m-%d"
    axis.xaxis.set_major_locator(LinearLocator(5))
    axis.xaxis.set_major_formatter(FuncFormatter(lambda day, _: f"{_moment(day):{form}}"))
    axis.tick_params(labelsize=8)


def chart_page(charted: ControlCharts) -> Page:
    """The report as HTML."""
    result = charted.to_json()
    title = f"Control charts of {', '.join(charted.sensors)}"
    first, last = charted.given[0], charted.given[-1]
    contents = {
        "first": first.date,
        "last": last.date,
        "notes": [capitalised(note) for note in charted.notes],
        "sensors": [_sensor(sensor, result["sensors"][name]) for name, sensor in charted.sensors.items()],
    }
    table, span_s = as_table(charted.given, title), (last.when - first.when).total_seconds()
    return Page("rig.verbs", "chart.html.j2", table, span_s, Unused().to_json(), contents)


def _sensor(sensor: SensorChart, result: Mapping[str, Any]) -> dict[str, Any]:
    plots = [{"alt": f"{sensor.name}: control charts of its parameters", "figure": parameter_charts(sensor)}]
    if sensor.chart.bound is not None:
        plots.append({"alt": f"{sensor.name}: error of the last calibration over date", "figure": error_chart(sensor)})
    return {
        "name": sensor.name,
        "model": result["model"],
        "sentences": result["sentences"],
        "parameters": list(result["calibrations"][0]["parameters"]),
        "rows": [_row(sensor, row) for row in result["calibrations"]],
        "tests": [_tests(sensor, name, q) for name, q in result["quantities"].items()],
        "due_rows": [_due(due) for due in result["due_by_tolerance"]] if "by_variation" in result["due"] else [],
        "unit": sensor.view.unit,
        "usage": sensor.view.usage_words,
        "plots": plots,
    }


def _row(sensor: SensorChart, row: Mapping[str, Any]) -> dict[str, Any]:
    degC = row["sensor_temperature_degC"]
    return {
        "date": row["date"],
        "values": [" ± ".join(with_error(v["estimate"], v["stderr"])) for v in row["parameters"].values()],
        "degC": "-" if degC is None else f"{degC:.2f}",
        "outside": ", ".join(f"{sensor.view.shown[name].label} {limit}" for name, limit in row["outside"].items()),
    }


def _tests(sensor: SensorChart, name: str, q: Mapping[str, Any]) -> dict[str, Any]:
    shown = sensor.view.shown[name]
    scale, unit = shown.scale, shown.unit
    trend, step, spread = q["trend"], q["step"], q["homogeneity"]
    found = next(each for each in sensor.chart.quantities if each.name == name)
    short = sensor.span_days < SHORT_DAYS  # a rate per year does not follow from a few days
    rate = "-"
    if trend is not None and not short:
        rate = f"{' +- '.join(with_error(scale * trend['per_year'], scale * trend['stderr']))} {unit}"
    return {
        "name": shown.label,
        "rate": rate,
        "p_trend": "-" if trend is None else probability(trend["p_adjusted"]),
        "p_walk": "-" if trend is None else probability(trend["p_walk"]),
        "p_homogeneity": probability(spread["p_adjusted"]),
        "between": f"{scale * spread['between_sd']:.2g} {unit}",
        "p_step": "-" if step is None else probability(step["p_adjusted"]),
        "drifts": found.significant("trend"),
        "differs": found.significant("homogeneity"),
        "stepped": found.significant("step"),
    }


def _due(due: Mapping[str, Any]) -> dict[str, str]:
    by = due["by_variation"]
    return {
        "tolerance": f"{due['tolerance']:.2g}",
        "date": due_date(due),
        "scatter": by["scatter"] or "-",
        "walk": by["walk"] or "-",
    }
