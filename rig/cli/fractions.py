"""How the command line shows fractions of a run: `rig fit RUN --points fraction`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.markup import escape
from rich.table import Table as RichTable

from procedures.attitude.fractions_compared import FAMILY
from procedures.attitude.parameters import LABELS, shown
from procedures.table import Table
from procedures.words import TESTS, significant
from rig.cli.show import headline, number, out
from rig.durations import duration


def show_fractions(name: str, table: Table, result: Mapping[str, Any], which: str) -> None:
    """Table 2 and precision of every fraction beside the whole run; of a single one, its parameters too."""
    headline(name, table)
    full = result["full"]
    if full["missing"]:
        out.print(f"  [yellow]{full['missing']} visits are missing in some replications[/]")
    model = "the declared model with temperature" if result["temperature"] else "the declared model"
    out.print(f"  {full['name']} points, {duration(full['hours'] * 3600)}, fitted with {model}\n", soft_wrap=True)
    rows = [{**full, "share": 1.0}, *result["fractions"]]
    for sensor in full["sensors"]:
        out.print(f"[bold]{escape(sensor)}[/]")
        for one in (_tests(sensor, rows), _precision(sensor, rows)):
            out.print(one)
            out.print()
        if which != FAMILY:
            out.print(_parameters(sensor, *rows))
            out.print()
    _notes(decimated=any(row.get("K_alpha", 1) > 1 for row in rows))
    advice = result["advice"]
    out.print(f"[bold]{escape(advice['name'])}[/] {escape(advice['why'])}:", soft_wrap=True)
    out.print(f"[bold]{escape(advice['sentence'])}[/]", soft_wrap=True)
    out.print("In a procedure, under \\[design]:", soft_wrap=True)
    out.print("\n".join(f"  {escape(line)}" for line in advice["procedure"].splitlines()), soft_wrap=True)


def _table(*headings: str, apart: int = 1) -> RichTable:
    """A table that fits 80 columns, `apart` more than one space between its own."""
    table = RichTable(*headings, box=box.SIMPLE_HEAD, padding=(0, apart, 0, 0), pad_edge=False, show_edge=False)
    for column in table.columns[1:]:
        column.justify = "right"
    table.columns[0].no_wrap = True
    return table


def _tests(sensor: str, rows: Sequence[Mapping[str, Any]]) -> RichTable:
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


def _precision(sensor: str, rows: Sequence[Mapping[str, Any]]) -> RichTable:
    """What each gives for its time, and whether it would have been right."""
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


def _parameters(sensor: str, full: Mapping[str, Any], part: Mapping[str, Any]) -> RichTable:
    """The paper's parameters of the whole run and of the fraction, beside each other."""
    names = (full["name"], part["name"])
    headings = [text for name in names for text in (escape(name), "standard error")]
    table = _table("parameter", *headings)
    sides = [entry["sensors"][sensor]["parameters"] for entry in (full, part)]
    for name in shown(sides[0]):
        cells = [
            text for side in sides for text in (number(side[name]["estimate"], 8), number(side[name]["stderr"], 2))
        ]
        table.add_row(LABELS[name], *cells)
    return table


def _small(value: float | None) -> str:
    """A standard error in the 1e-4 deg of Table 2."""
    return "-" if value is None else number(1e4 * value, 3)


def _marked(sensor: Mapping[str, Any], test: str) -> str:
    value = sensor[test]
    text = number(value, 3) if value is None or value < 100.0 else f"{value:.0f}"
    return f"[yellow]{text}*[/]" if significant(sensor, test) else text


def _notes(*, decimated: bool) -> None:
    out.print(
        "  sigmas, interval, all data: 1e-4 deg. *: above its 95 % limit. interval: widest 95 % calibration interval, "
        "half-width; times: that over the whole run's. all data: standard error of the whole run's residuals under "
        "these coefficients. in 95 %: how many of its readings are within these prediction intervals. shift: of each "
        "coefficient, in its own standard errors",
        soft_wrap=True,
    )
    if decimated:
        out.print(
            "  N x M (a, b): a coarser grid, of which every a-th pitch is kept at all rolls and every b-th roll at all "
            "pitches (NASA/TP-1999-209835, eq. 109)",
            soft_wrap=True,
        )
