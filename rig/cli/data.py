"""`rig fit`, `trace`, `export`: what the data say."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable

from rig.atomic import write_whole
from rig.cli import app
from rig.cli.run import JsonOption
from rig.cli.show import err, mark, out, print_json
from rig.errors import ExitCode
from rig.report.words import TESTS, chance, incomplete, little_help, significant, unnamed

if TYPE_CHECKING:
    from rig.closed_loop import Traced
    from rig.tables import Table

DataArgument = Annotated[Path, typer.Argument(help="a run file, or a CSV table", show_default=False)]


@app.command(rich_help_panel="Data")
def fit(
    data: DataArgument,
    as_json: JsonOption = False,
    out_file: Annotated[
        Path | None, typer.Option("--out", "-o", help="write the calibration to this JSON file", show_default=False)
    ] = None,
) -> int:
    """Fit the declared model to every sensor and analyse the replications.

    Example: `rig fit runs/20260115T180000-night-1a2b.sqlite`
    """
    from rig.closed_loop import fit_table  # noqa: PLC0415
    from rig.tables import read_table  # noqa: PLC0415

    table = read_table(data)
    result = fit_table(table)
    if out_file is not None:
        write_whole(out_file, lambda file: json.dump(result, file, indent=2, allow_nan=False))
    if as_json:
        print_json(result)
        return ExitCode.DONE
    _headline(data.name, table)
    for name, sensor in result["sensors"].items():
        _show_fit(name, sensor)
    if any(significant(sensor, test) for sensor in result["sensors"].values() for test in TESTS):
        out.print("some tests are significant: these standard errors are too small; see rig trace", soft_wrap=True)
    return ExitCode.DONE


def _show_fit(name: str, sensor: Mapping[str, Any]) -> None:
    table = RichTable(
        "parameter", "estimate", "standard error", title=f"{name}, {sensor['model']}", title_justify="left"
    )
    for parameter, value in sensor["parameters"].items():
        table.add_row(parameter, number(value["estimate"], 8), number(value["stderr"], 3))
    out.print(table)
    out.print(
        f"  sigma_E {degrees(sensor['sigma_E_deg'])} = bias {degrees(sensor['sigma_bias_deg'])} and "
        f"precision {degrees(sensor['sigma_prec_deg'])}"
    )
    for test, what in (
        ("T_bias", "lack of fit"),
        ("T_b", "offset drift"),
        ("T_S", "sensitivity drift"),
        ("T_drift", "drift of any kind"),
    ):
        value, bound = sensor[test], sensor[TESTS[test]]
        if value is None:
            out.print(f"  {test:<8} cannot be tested with these data: {what}")
            continue
        verdict = "[yellow]significant[/]" if significant(sensor, test) else "not significant"
        out.print(f"  {test:<8} {value:9.3g}  (95 % limit {bound:.3g})  {what}: {verdict}")
    out.print()


@app.command(rich_help_panel="Data")
def trace(
    data: DataArgument,
    as_json: JsonOption = False,
    report: Annotated[Path | None, typer.Option(help="write a self-contained HTML report", show_default=False)] = None,
) -> int:
    """Find what the declared model lacks: residual, effect, error before and after.

    Example: `rig trace runs/20260115T180000-night-1a2b.sqlite --report night.html`
    """
    from rig.closed_loop import trace_table  # noqa: PLC0415
    from rig.tables import read_table  # noqa: PLC0415

    traced = trace_table(read_table(data))
    if report is not None:
        from rig.report import write_report  # noqa: PLC0415

        write_report(report, traced)
        err.print(f"report: {escape(str(report))}", soft_wrap=True)
    if as_json:
        print_json(traced.to_json())
    else:
        show_trace(traced)
    return ExitCode.DONE


_BEFORE_AFTER = (
    ("sigma_E_deg", "sigma_E / 1e-4 deg", 1e4),
    ("sigma_bias_deg", "sigma_bias / 1e-4 deg", 1e4),
    ("sigma_prec_deg", "sigma_prec / 1e-4 deg", 1e4),
    ("T_bias", "T_bias", 1.0),
    ("T_b", "T_b", 1.0),
    ("T_S", "T_S", 1.0),
    ("cv_rms_deg", "left-out error / 1e-4 deg", 1e4),
)


def show_trace(traced: Traced) -> None:
    """A short table a sensor: error before and after, and the effects found."""
    result = traced.to_json()
    _headline(result["data"]["file"], traced.table)
    for name, sensor in result["sensors"].items():
        out.print(f"\n[bold]{name}[/] ({sensor['declared']}): [bold]{sensor['verdict']}[/]")
        table = RichTable("", "before", "after")
        for key, label, scale in _BEFORE_AFTER:
            table.add_row(label, *(_cell(sensor[side], key, scale) for side in ("before", "after")))
        out.print(table)
        if any(significant(sensor[side], test) for side in ("before", "after") for test in _MARKED):
            out.print("  * above its 95 % limit")
        _show_parameters(traced, name)
        for effect in sensor["effects"]:
            out.print(
                f"  [green]{effect['effect']}[/] ({effect['stratum']}): {effect['share']:.0%} of the excess error"
            )
            out.print(f"    {effect['size']}, p {chance(effect)}")
            for term, value, error in zip(effect["terms"], effect["coefficients"], effect["stderr"], strict=True):
                out.print(f"    {value:.4g} +- {error:.2g} {effect['unit']}  {term}")
            if effect["aliases"]:
                out.print(f"    these data cannot tell it from: {', '.join(effect['aliases'])}")
                out.print(f"    would separate them: {effect['separate_by']}")
        for line in (*unnamed(sensor), little_help(sensor)):
            if line:
                out.print(f"  [yellow]{line}[/]")


_MARKED = ("T_bias", "T_b", "T_S")


def _cell(side: Mapping[str, Any], key: str, scale: float) -> str:
    text = number(None if side[key] is None else side[key] * scale, 3)
    return f"[yellow]{text} *[/]" if key in _MARKED and significant(side, key) else text


def _show_parameters(traced: Traced, sensor: str) -> None:
    from rig.report.parameters import parameters  # noqa: PLC0415

    table = RichTable("parameter", "before", "standard error", "after", "standard error")
    for parameter in parameters(traced, sensor):
        table.add_row(parameter.name, *parameter.before, *parameter.after)
    out.print(table)


def _headline(file: str, table: Table, console: Console = out) -> None:
    """Whose observations, how many, and whether more are to come."""
    missing = incomplete(table.provenance)
    more = f" ([yellow]{missing}[/])" if missing else ""
    console.print(f"{mark(table.simulated)}[bold]{escape(file)}[/]: {len(table)} observations{more}", soft_wrap=True)


def degrees(value: float | None) -> str:
    """A standard error in degrees, as the paper prints it."""
    return "unknown" if value is None else f"{value * 1e4:.3g}e-4 deg"


def number(value: float | None, digits: int) -> str:
    """A number, or a dash where there is none."""
    return "-" if value is None else f"{value:.{digits}g}"


@app.command(rich_help_panel="Data")
def export(
    run_file: Annotated[Path, typer.Argument(help="the run file", show_default=False)],
    out_file: Annotated[Path, typer.Option("--out", "-o", help="the CSV file to write", show_default=False)],
    everything: Annotated[bool, typer.Option("--all", help="rejected observations too, with their status")] = False,
    salvage: Annotated[
        bool, typer.Option("--salvage", help="take what can still be read of a damaged or edited file, unverified")
    ] = False,
) -> int:
    """Write a run's observations as CSV, units in the column names.

    Example: `rig export runs/20260115T180000-night-1a2b.sqlite --out night.csv`
    """
    from rig.tables import run_table, write_csv  # noqa: PLC0415

    table = run_table(run_file, everything=everything, salvage=salvage)
    if salvage:
        err.print("[bold yellow]NOT VERIFIED:[/] nobody vouches for these values; see `rig verify`")
    write_csv(table.columns, out_file)
    if everything:
        seen = int(table.columns["accepted"].sum())
        table = replace(table, provenance={**table.provenance, "points_observed": seen})
    _headline(str(out_file), table, err)
    return ExitCode.DONE
