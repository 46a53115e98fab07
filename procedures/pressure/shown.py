"""Display of pressure calibrations in whole plots on the command line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.markup import escape

from rig.fitter.rounding import guard_digits, with_error
from rig.procedures.evaluate.fit_in_short import sensors_in_short
from rig.procedures.evaluate.trace_shown import left_out
from rig.procedures.present.blocks import Block, Grid, Line
from rig.procedures.present.gross_shown import show_gross, show_left_out
from rig.procedures.present.numbers import number
from rig.procedures.pressure.words import IN_USE, errors_as_cells, errors_in_words, in_use_words, low_pressure

_MEASURES = (
    ("in_use", "max_pct", "largest reading error in use / %"),
    ("in_use", "half95_pct", "±, the 95 % interval of one reading in use / %"),
    (
        "reading_error",
        "max_pct",
        "largest residual / %: no error in use, where a method fits whole plots, or a reading, as they come",
    ),
    ("reading_error", "width_pct", "full width of the 95 % prediction interval / %"),
    ("reading_error", "bias_pct", "bias / %"),
)


def show_whole_plot_summary(result: Mapping[str, Any]) -> Iterator[Block]:
    """Largest reading error of every transducer by every method, at the lowest pressure of interest."""
    sensors = result["sensors"]
    first = next(iter(sensors.values()))["methods"]
    at, low = low_pressure(result)
    title = "Largest reading error in use / % by method"
    table = Grid((f"at {low:.3g} psia", *first), title=title)
    for name, sensor in sensors.items():
        fits = (sensor["methods"].get(method) for method in first)
        table.add_row(name, *(in_use_words(fit, at) if fit else "-" for fit in fits))
    yield table
    yield Line(f"  {IN_USE}")


def show_whole_plot_fit(result: Mapping[str, Any]) -> Iterator[Block]:
    """A summary, then methods side by side and the coefficients of GLS, one transducer after another."""
    yield from left_out(result)
    yield Line(escape(result["data"]["model"]["sentence"]))
    yield Line(result["data"]["coefficients_hold_at"])
    yield from show_left_out(result["data"])
    if len(result["sensors"]) > 1:
        yield from show_whole_plot_summary(result)
    for name, sensor in result["sensors"].items():
        yield Line(f"\n[bold]{name}[/] ~ {escape(sensor['formula'])}")
        yield Line(f"  {errors_in_words(sensor)}")
        yield from show_gross(sensor["gross_errors"])
        yield Line(f"  {IN_USE}")
        for part, key, title in _MEASURES:
            yield Line(f"  {title}")
            yield _methods(sensor["methods"], part, key)
        for method, reason in sensor["not_possible"].items():
            yield Line(f"  [yellow]{method}: not possible:[/] {escape(reason)}")
        for method, fitted in sensor["methods"].items():
            if fitted["note"]:
                yield Line(f"  [yellow]{method}:[/] {escape(fitted['note'])}")
        yield _kept(sensor)
        spans = (f"{name} {low:.4g} to {high:.4g}" for name, (low, high) in sensor["calibration"]["ranges"].items())
        yield Line(f"  {sensor['intervals_cover']}")
        yield Line(f"  valid for {', '.join(spans)} (psia, degC)")
        for note in sensor["notes"]:
            yield Line(f"  [yellow]{escape(note)}[/]")


def show_whole_plot_fit_in_short(result: Mapping[str, Any]) -> Iterator[Block]:
    """The methods at the lowest pressure, and a row a transducer."""
    yield from left_out(result)
    yield Line(escape(result["data"]["model"]["sentence"]))
    yield from show_left_out(result["data"])
    yield from show_whole_plot_summary(result)
    cells = {name: errors_as_cells(sensor) for name, sensor in result["sensors"].items()}
    yield from sensors_in_short(result["sensors"], ("error of a reading / mV", "of a whole plot / mV"), cells)


def _methods(methods: Mapping[str, Any], part: str, key: str) -> Grid:
    """One measure of every method at every pressure."""
    pressures = next(iter(methods.values()))["reading_error"]["pressure_psia"]
    table = Grid(("  psia", *(f"{p:.3g}" for p in pressures)), frame="none")
    for method, fitted in methods.items():
        values = fitted[part][key]
        shown = (
            _percent(v) if key == "bias_pct" else "?" if v is None and part == "in_use" else number(v, 3)
            for v in values
        )
        table.add_row(f"  [yellow]{method}[/]" if fitted["biased"] else f"  {method}", *shown)
    return table


def _percent(value: float | None) -> str:
    """Few digits of equal width: a bias is read across its row."""
    return "-" if value is None else f"{value:.2f}" if abs(value) < 10 else f"{value:.0f}"


def _kept(sensor: Mapping[str, Any]) -> Grid:
    """The stored calibration."""
    method = sensor["calibration"]["method"]
    title = f"calibration kept, by {method}"
    table = Grid(("term", "estimate", "standard error", "df", "VIF", "unit"), title=title)
    guard = guard_digits(sensor["calibration"]["covariance"])
    for term, value in sensor["methods"][method]["coefficients"].items():
        inflation = sensor["variance_inflation"].get(term)
        both = with_error(value["estimate"], value["stderr"], guard=guard)
        numbers = (*both, number(value["df"]), number(inflation))
        table.add_row(escape(term), *numbers, value["unit"])
    return table
