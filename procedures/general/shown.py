"""Display of tables of any kind on the command line: roles of columns and fits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.markup import escape

from rig.fitter.rounding import guard_digits, with_error
from rig.procedures.present.blocks import Block, Grid, Line, simulated_mark
from rig.procedures.present.gross_shown import show_gross, show_left_out
from rig.procedures.present.numbers import number
from rig.procedures.present.terms import in_words

_PREDICTED = {"value", "standard_uncertainty", "df", "confidence95", "prediction95", "outside"}
_MOST_CORRELATED = 6
"""Coefficients at most whose correlations are shown; the JSON has them of all."""


def show_general_fit(file: str, result: Mapping[str, Any]) -> Iterator[Block]:
    """Coefficients with standard errors and degrees of freedom, and the underlying errors."""
    title = f"{escape(result['response'])} ~ {escape(result['formula'])}"
    data = result["data"]
    yield Line(f"{simulated_mark(data['simulated'])}[bold]{escape(file)}[/]: {data['points']} rows")
    guard = guard_digits(result["calibration"]["covariance"])
    table = Grid(("term", "estimate", "standard error", "df"), title=title)
    for name, value in result["coefficients"].items():
        table.add_row(
            escape(in_words(name)), *with_error(value["estimate"], value["stderr"], guard=guard), number(value["df"], 4)
        )
    yield table
    if "model" in result:
        yield Line(f"  {escape(result['model']['title'])}; {escape(result['model']['source'])}", wrapped=True)
    for name, value in result.get("derived", {}).items():
        unit, meaning = f" {value['unit']}" if value["unit"] else "", value["meaning"]
        estimate, stderr = with_error(value["estimate"], value["stderr"])
        error = f" +- {stderr}" if value["stderr"] is not None else ""
        yield Line(f"  {escape(name):<16} {estimate}{error}{escape(unit)}  {escape(meaning)}")
    for key, what in (
        ("sigma_E", "standard error of one row"),
        ("sigma_subplot", "of one row within its whole plot"),
        ("sigma_wholeplot", "shared by the rows of a whole plot"),
        ("sigma_replicate", "shared by the whole plots of a replication"),
    ):
        if result.get(key) is not None:
            yield Line(f"  {key:<16} {number(result[key], 5)}  {what}", wrapped=True)
    yield from _tests(result)
    yield from _predictions(result)
    yield from _of_series(result)
    yield from show_left_out(data)
    yield from show_gross(result["gross_errors"])
    for note in result.get("notes", ()):
        yield Line(f"  [yellow]{escape(note)}[/]")


def _tests(result: Mapping[str, Any]) -> Iterator[Block]:
    """Chi-squared of stated uncertainties, lack of fit, tolerance."""
    if (told := result.get("chi_squared")) is not None:
        yield Line(
            f"  {'chi_squared':<16} {number(told['value'], 4)}  with {told['df']} degrees of freedom; 95 % limit "
            f"{number(told['limit95'], 4)}",
            wrapped=True,
        )
    if (told := result.get("lack_of_fit")) is not None:
        between, within = told["df"]
        yield Line(f"  {'lack_of_fit':<16} F = {number(told['F'], 3)} with {between} and {within}, p = {told['p']:.2g}")
    if (told := result.get("acceptance")) is not None:
        half = "no end" if told["half_width95"] is None else number(told["half_width95"], 4)
        word = "[green]inside[/]" if told["inside"] else "[bold red]OUTSIDE[/]"
        yield Line(
            f"  {'tolerance':<16} {word}: widest 95 % half-width of an inferred value {half}, tolerance "
            f"{number(told['tolerance'], 4)}",
            wrapped=True,
        )


def _predictions(result: Mapping[str, Any]) -> Iterator[Block]:
    """The curve over its range, or at points that were asked for, with intervals."""
    rows = result.get("predictions", ())
    if not rows:
        return
    asked = "standard_uncertainty" in rows[0]
    names = [name for name in rows[0] if name not in _PREDICTED]
    own = ("standard uncertainty",) if asked else ()
    table = Grid((*map(escape, names), escape(result["response"]), *own, "95 %: curve +-", "one row +-"))
    for row in rows:
        value, error = with_error(row["value"], row["standard_uncertainty" if asked else "confidence95"])
        intervals = [with_error(row["value"], row[key])[1] for key in ("confidence95", "prediction95")]
        table.add_row(*(number(row[name], 6) for name in names), value, *([error] if asked else []), *intervals)
    yield table
    for row in rows:
        if outside := row.get("outside"):
            place = ", ".join(f"{name} = {number(row[name], 6)}" for name in outside)
            yield Line(f"  [yellow]{escape(place)} is outside what was measured: the model is taken to hold there[/]")
    if asked and result.get("correlation") and len(result["coefficients"]) <= _MOST_CORRELATED:
        yield _correlations(list(result["coefficients"]), result["correlation"])


def _correlations(terms: Sequence[str], values: Sequence[Sequence[float]]) -> Grid:
    """Correlations of the coefficients."""
    table = Grid(("correlation", *map(escape, terms)))
    for term, row in zip(terms, values, strict=True):
        table.add_row(escape(term), *(f"{value:.3f}" for value in row))
    return table


def _of_series(result: Mapping[str, Any]) -> Iterator[Block]:
    """Figures of series of forces."""
    rows = result.get("iso376", ())
    if not rows:
        return
    name, *keys = rows[0]
    table = Grid((escape(name), *keys), title="ISO 376, figures in % of the mean deflection")
    for row in rows:
        table.add_row(number(row[name], 6), number(row["mean"], 8), *(number(row[key], 3) for key in keys[1:]))
    yield table
