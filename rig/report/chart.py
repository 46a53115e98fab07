"""The report of control charts: changes, due date of the last calibration, and charts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from procedures.numbers import with_error as estimate_and_error
from procedures.results import Page
from procedures.unused import Unused
from procedures.words import capitalised
from rig.closed_loop.chart import ControlCharts, SensorChart
from rig.closed_loop.chart_inputs import as_table
from rig.closed_loop.chart_words import due_date, probability, with_error
from rig.report.chart_plots import error_chart, parameter_charts


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
    return Page("rig.report", "chart.html.j2", table, span_s, Unused().to_json(), contents)


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
        "due_rows": [] if result["due"]["status"] == "too few" else [_due(due) for due in result["due_by_tolerance"]],
        "unit": sensor.view.unit,
        "usage": sensor.view.usage_words,
        "plots": plots,
    }


def _row(sensor: SensorChart, row: Mapping[str, Any]) -> dict[str, Any]:
    degC = row["sensor_temperature_degC"]
    return {
        "date": row["date"],
        "values": [" ± ".join(estimate_and_error(v["estimate"], v["stderr"])) for v in row["parameters"].values()],
        "degC": "-" if degC is None else f"{degC:.2f}",
        "outside": ", ".join(f"{sensor.view.shown[name].label} {limit}" for name, limit in row["outside"].items()),
    }


def _tests(sensor: SensorChart, name: str, q: Mapping[str, Any]) -> dict[str, Any]:
    shown = sensor.view.shown[name]
    scale, unit = shown.scale, shown.unit
    trend, step, spread = q["trend"], q["step"], q["homogeneity"]
    found = next(each for each in sensor.chart.quantities if each.name == name)
    rate = "-" if trend is None else f"{with_error(scale * trend['per_year'], scale * trend['stderr'])} {unit}"
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
