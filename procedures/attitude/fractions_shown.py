"""Display of fractions of a run on the command line: `rig fit RUN --points fraction`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.markup import escape

from rig.fitter.rounding import with_error
from rig.procedures.attitude.fractions import FAMILY
from rig.procedures.attitude.parameters import LABELS, shown
from rig.procedures.present.blocks import Block, Grid, Line, headline
from rig.procedures.present.durations import duration
from rig.procedures.present.numbers import number
from rig.procedures.present.words import TESTS, significant
from rig.procedures.tables.table import Table


def show_fractions(name: str, table: Table, result: Mapping[str, Any], which: str) -> Iterator[Block]:
    """Table 2 and precision of every fraction and the whole run; for a single one also its parameters."""
    yield headline(name, table)
    full = result["full"]
    if full["missing"]:
        yield Line(f"  [yellow]{full['missing']} visits are missing in some replications[/]", wrapped=True)
    model = "the declared model with temperature" if result["temperature"] else "the declared model"
    yield Line(f"  {full['name']} points, {duration(full['hours'] * 3600)}, fitted with {model}\n")
    rows = [{**full, "share": 1.0}, *result["fractions"]]
    for sensor in full["sensors"]:
        yield Line(f"[bold]{escape(sensor)}[/]", wrapped=True)
        for one in (_tests(sensor, rows), _precision(sensor, rows)):
            yield one
            yield Line()
        if which != FAMILY:
            yield _parameters(sensor, *rows)
            yield Line()
    yield from _notes(decimated=any(row.get("K_alpha", 1) > 1 for row in rows))
    advice = result["advice"]
    yield Line(f"[bold]{escape(advice['name'])}[/] {escape(advice['why'])}:")
    yield Line(f"[bold]{escape(advice['sentence'])}[/]")
    yield Line("In a procedure, under \\[design]:")
    yield Line("\n".join(f"  {escape(line)}" for line in advice["procedure"].splitlines()))


def _table(*headings: str, apart: int = 1) -> Grid:
    """A table for 80 columns, with `apart` extra spaces between its columns."""
    return Grid(headings, frame="rule", apart=apart)


def _tests(sensor: str, rows: Sequence[Mapping[str, Any]]) -> Grid:
    """The columns of Table 2."""
    table = _table("design", "points", "sigma_E", "bias", "prec", "T_bias", "limit", "T_b", "T_S", "limit", apart=0)
    for row in rows:
        s = row["sensors"][sensor]
        sigmas = [_small(s[f"{key}_deg"]) for key in ("sigma_E", "sigma_bias", "sigma_prec")]
        tests = {test: _marked(s, test) for test in ("T_bias", "T_b", "T_S")}
        limits = [number(s[key], 3) for key in (TESTS["T_bias"], TESTS["T_b"])]
        table.add_row(
            escape(row["name"]),
            str(row["points"]),
            *sigmas,
            tests["T_bias"],
            limits[0],
            tests["T_b"],
            tests["T_S"],
            limits[1],
        )
    return table


def _precision(sensor: str, rows: Sequence[Mapping[str, Any]]) -> Grid:
    """Precision per time of each, and its errors for the whole run."""
    table = _table("design", "time", "interval", "times", "all data", "in 95 %", "shift of the coefficients")
    for row in rows:
        s = row["sensors"][sensor]
        inside = "-" if s["coverage95"] is None else f"{100.0 * s['coverage95']:.0f} %"
        ratio = "-" if s["interval_ratio"] is None else f"{s['interval_ratio']:.2f}"
        shift = "" if row is rows[0] else " ".join(f"{value:+.1f}" for value in _shifts(s))
        table.add_row(
            escape(row["name"]),
            f"{100.0 * row['share']:.0f} %",
            _small(s["interval95_deg"]),
            ratio,
            _small(s["residual_deg"]),
            inside,
            shift,
        )
    return table


def _shifts(sensor: Mapping[str, Any]) -> list[float]:
    return [float("nan") if value is None else value for value in sensor["shift"].values()]


def _parameters(sensor: str, full: Mapping[str, Any], part: Mapping[str, Any]) -> Grid:
    """The paper's parameters of the whole run and of the fraction, side by side."""
    names = (full["name"], part["name"])
    headings = [text for name in names for text in (escape(name), "standard error")]
    table = _table("parameter", *headings)
    sides = [entry["sensors"][sensor]["parameters"] for entry in (full, part)]
    for name in shown(sides[0]):
        cells = [text for side in sides for text in with_error(side[name]["estimate"], side[name]["stderr"])]
        table.add_row(LABELS[name], *cells)
    return table


def _small(value: float | None) -> str:
    """A standard error in the 1e-4 deg of Table 2."""
    return "-" if value is None else number(1e4 * value, 3)


def _marked(sensor: Mapping[str, Any], test: str) -> str:
    value = sensor[test]
    text = number(value, 3) if value is None or value < 100.0 else f"{value:.0f}"
    return f"[yellow]{text}*[/]" if significant(sensor, test) else text


def _notes(*, decimated: bool) -> Iterator[Block]:
    yield Line(
        "  sigmas, interval, all data: 1e-4 deg. *: above its 95 % limit. interval: widest 95 % calibration interval, "
        "half-width; times: that over the whole run's. all data: standard error of the whole run's residuals under "
        "these coefficients. in 95 %: how many of its readings are within these prediction intervals. shift: of each "
        "coefficient, in its own standard errors"
    )
    if decimated:
        yield Line(
            "  N x M (a, b): a coarser grid, of which every a-th pitch is kept at all rolls and every b-th roll at all "
            "pitches (NASA/TP-1999-209835, eq. 109)"
        )
