"""How the command line shows pressure calibrations in whole plots, and their traces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.markup import escape
from rich.table import Table

from rig.cli.show import headline, number, out
from rig.closed_loop import WholePlotTraced
from rig.report.words import chance, unnamed


def show_whole_plot_trace(traced: WholePlotTraced) -> None:
    """A short table a transducer: error before and after, and the effects found."""
    result = traced.to_json()
    headline(result["data"]["file"], traced.table)
    for name, sensor in result["sensors"].items():
        out.print(f"\n[bold]{name}[/] (declared {escape(sensor['declared'])}): [bold]{sensor['verdict']}[/]")
        out.print(_before_after(sensor))
        for effect in sensor["effects"]:
            _show_effect(effect)
        for line in unnamed(sensor):
            out.print(f"  [yellow]{escape(line)}[/]", soft_wrap=True)


def _before_after(sensor: Mapping[str, Any]) -> Table:
    table = Table("", "before", "after")
    sides = sensor["before"], sensor["after"]
    for key, label in (
        ("sigma_subplot", "within whole plots / mV"),
        ("sigma_wholeplot", "between whole plots / mV"),
        ("cv_rms", "left-out error / mV"),
    ):
        table.add_row(label, *(number(side[key], 3) for side in sides))
    pressures = list(sensor["before"]["reading_error_pct"])
    for pressure in pressures[:_SHOWN]:
        shown = (number(side["reading_error_pct"].get(pressure), 3) for side in sides)
        table.add_row(f"reading error at {pressure} psia / %", *shown)
    return table


_SHOWN = 3
"""Reading errors of the lowest pressures stand in the table; the others are in the JSON and the report."""


def _show_effect(effect: Mapping[str, Any]) -> None:
    out.print(
        f"  [green]{effect['effect']}[/] ({effect['stratum']}): {effect['share']:.0%} of the excess error, "
        f"p {chance(effect)}",
        soft_wrap=True,
    )
    out.print(f"    {escape(effect['size'])}", soft_wrap=True)
    for term, value, error in zip(effect["terms"], effect["coefficients"], effect["stderr"], strict=True):
        out.print(f"    {value:.4g} +- {error:.2g} {effect['unit']}  {escape(term)}", soft_wrap=True)
    if effect["aliases"]:
        out.print(f"    these data cannot tell it from: {', '.join(effect['aliases'])}", soft_wrap=True)
        out.print(f"    would separate them: {effect['separate_by']}", soft_wrap=True)
