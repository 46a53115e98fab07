"""`rig fit`, `rig trace`: what the data say."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from rig.atomic import check_files, write_whole
from rig.cli import app
from rig.cli.general import (
    CandidatesOption,
    DirectionOption,
    GroupOption,
    IgnoreOption,
    ReplicateOption,
    TimeOption,
    WholePlotOption,
    WrapOption,
    check_no_parts,
    trace_any,
)
from rig.cli.run import JsonOption
from rig.cli.show import err, headline, out, print_json, show_unused
from rig.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from rig.closed_loop import Traced
    from rig.tables import Table

DataArgument = Annotated[Path, typer.Argument(help="a run file, or a CSV table", show_default=False)]
FormulaOption = Annotated[
    str | None,
    typer.Option(
        "--formula",
        help="the model: for any table with --response ('1 + x + x^2'); for whole plots instead of the one that "
        "the run's procedure declares (full, II.C, eq10, hierarchical, or '1 + P + P:T_sensor')",
        show_default=False,
    ),
]


TemperatureOption = Annotated[
    bool | None,
    typer.Option(
        "--temperature/--no-temperature",
        help="attitude: whether offset and sensitivity follow the sensor temperature in the declared model",
        show_default="as the run's procedure has it under [model], else not",
    ),
]


@app.command()
def fit(
    data: DataArgument,
    as_json: JsonOption = False,
    out_file: Annotated[
        Path | None, typer.Option("--out", "-o", help="write the calibration to this JSON file", show_default=False)
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="whole plots: write the methods' tables and plots as HTML", show_default=False)
    ] = None,
    formula: FormulaOption = None,
    method: Annotated[
        str | None,
        typer.Option(
            help="whole plots: by which method the calibration is kept: GLS, WLS, 'in-flight zero' or "
            "'in-flight zero + WLS'",
            show_default="GLS",
        ),
    ] = None,
    add: Annotated[
        list[str] | None,
        typer.Option(help="whole plots: a further term, such as an effect that was traced: --add 'P^3'; repeatable"),
    ] = None,
    response: Annotated[
        str | None, typer.Option(help="any table: the column to be explained", show_default=False)
    ] = None,
    whole_plot: Annotated[
        str | None,
        typer.Option("--whole-plot", help="any table: column(s, comma between) of whole plots", show_default=False),
    ] = None,
    replicate: Annotated[
        str | None, typer.Option(help="any table: column of replications that hold whole plots", show_default=False)
    ] = None,
    power: Annotated[
        float | None,
        typer.Option(
            help="whole plots: weighted methods multiply rows by 1/P^POWER", show_default="1", min=0.0, max=10.0
        ),
    ] = None,
    exclude_zero: Annotated[
        bool, typer.Option("--exclude-zero", help="whole plots: weighted methods leave out readings at zero pressure")
    ] = False,
    traced: Annotated[
        bool, typer.Option("--traced", help="attitude: keep a calibration with the effects that a trace finds")
    ] = False,
    confirmed_by: Annotated[
        Path | None,
        typer.Option(
            "--confirmed-by",
            help="keep the calibration with the causes that this later run file confirmed (see rig confirm); attitude: "
            "as with --traced; whole plots: their terms are added",
            show_default=False,
        ),
    ] = None,
    temperature: TemperatureOption = None,
    at_degC: Annotated[
        float | None,
        typer.Option(
            "--at-degC",
            help="attitude with temperature: the sensor temperature at which parameters are given, 20 or 23 say",
            show_default="the mean of the run",
        ),
    ] = None,
    leave_out: Annotated[
        list[str] | None,
        typer.Option(
            "--leave-out",
            help="fit without these rows and say so in the calibration: 'gross' for the gross errors found, or row "
            "numbers of the file (12,31); repeatable",
            show_default="every row is fitted, and gross errors are named",
        ),
    ] = None,
    points: Annotated[
        str | None,
        typer.Option(
            help="attitude: what fewer points would have cost: 'fraction' for a family of fractions of the grid, a "
            "number for the one with about so many points, 'tumble' for design T",
            show_default=False,
        ),
    ] = None,
) -> int:
    """Fit the declared model to every sensor; analyse replications, or whole plots with all methods side by side.

    Examples: `rig fit runs/20260115T180000-night-1a2b.sqlite`, `rig fit RUN --traced --temperature --out package.json`,
    `rig fit RUN --points 73`, `rig fit table.csv --response y --formula "1 + x"`
    """
    check_files([out_file, report], [data, *filter(None, (confirmed_by,))])
    if response is not None:
        for option, value in (
            ("--report", report),
            ("--method", method),
            ("--add", add),
            ("--exclude-zero", exclude_zero),
            ("--at-degC", at_degC is not None),
            ("--confirmed-by", confirmed_by),
        ):
            if value:
                kind = "attitude sensors" if option == "--at-degC" else "whole plots"
                raise UsageError(f"{option} is for {kind}, not for tables of any kind")
        if points is not None:
            raise UsageError("--points is for pitch-roll calibrations, not for tables of any kind")
        result, show = _general(data, response, formula, whole_plot, replicate, leave_out or ())
    elif whole_plot is not None or replicate is not None:
        raise UsageError(
            "--whole-plot and --replicate name columns of any table; they go with --response and --formula"
        )
    elif points is not None:
        others: dict[str, Any] = {
            "--out": out_file,
            "--report": report,
            "--formula": formula,
            "--method": method,
            "--add": add,
        }
        others |= {"--at-degC": at_degC is not None, "--leave-out": leave_out, "--power": power}
        others |= {"--exclude-zero": exclude_zero, "--traced": traced, "--confirmed-by": confirmed_by}
        result, show = _fractions(data, points, temperature, others)
    else:
        options = {"method": method, "add": tuple(add or ()), "power": power, "exclude_zero": exclude_zero}
        attitude = {"traced": traced, "temperature": temperature, "at_degC": at_degC}
        if confirmed_by is not None and (leave_out or at_degC is not None):
            raise UsageError(
                "--confirmed-by keeps every row, at the run's mean temperature: leave --leave-out and --at-degC away"
            )
        result, show = _calibration(data, formula, report, options, attitude, leave_out or (), confirmed_by)
    if out_file is not None:
        write_whole(out_file, lambda file: json.dump(result, file, indent=2, allow_nan=False))
        err.print(f"calibration: {escape(str(out_file))}", soft_wrap=True)
    if as_json:
        print_json(result)
    else:
        show()
    show_unused(result["unused"])
    return ExitCode.DONE


Shown = tuple[dict[str, Any], Callable[[], None]]
"""A result, and what shows it to a person."""


def _general(
    data: Path,
    response: str,
    formula: str | None,
    whole_plot: str | None,
    replicate: str | None,
    leave_out: Sequence[str],
) -> Shown:
    from rig.cli.general import show_general_fit  # noqa: PLC0415
    from rig.closed_loop.general import fit_general  # noqa: PLC0415

    if formula is None:
        raise UsageError("--response needs --formula, such as --formula '1 + x'")
    columns = [name.strip() for name in whole_plot.split(",")] if whole_plot else []
    result = fit_general(data, response, formula, columns, replicate, leave_out)
    return result, lambda: show_general_fit(data.name, result)


def _fractions(data: Path, points: str, temperature: bool | None, others: Mapping[str, Any]) -> Shown:
    from rig.cli.fractions import show_fractions  # noqa: PLC0415
    from rig.closed_loop.fractions import compare_fractions  # noqa: PLC0415
    from rig.tables import read_table  # noqa: PLC0415

    for option, value in others.items():
        if value:
            raise UsageError(f"--points holds fractions against the whole run and keeps nothing; leave {option} away")
    table = read_table(data)
    result = compare_fractions(table, points, temperature=temperature)
    return result, lambda: show_fractions(data.name, table, result, points)


def _calibration(
    data: Path,
    formula: str | None,
    report: Path | None,
    options: Mapping[str, Any],
    attitude: Mapping[str, Any],
    leave_out: Sequence[str],
    later: Path | None,
) -> Shown:
    from rig.closed_loop import fit_whole_plots  # noqa: PLC0415
    from rig.closed_loop.attitude import fit_attitude_table  # noqa: PLC0415
    from rig.tables import read_table  # noqa: PLC0415

    table = read_table(data)
    if table.kind == "pitch-roll":
        given = {"--formula": formula, "--report": report} | {f"--{k.replace('_', '-')}": v for k, v in options.items()}
        for option, value in given.items():
            if value:
                raise UsageError(f"{option} is for whole plots; {data} holds a pitch-roll calibration")
        if later is None:
            result = fit_attitude_table(
                table,
                traced=bool(attitude["traced"]),
                temperature=attitude["temperature"],
                at_degC=attitude["at_degC"],
                leave_out=leave_out,
            )
        else:
            from rig.closed_loop.confirm import confirmed_by, fit_attitude_confirmed  # noqa: PLC0415

            result = fit_attitude_confirmed(*confirmed_by(data, later, temperature=attitude["temperature"]))
        return result, lambda: show_fit(data.name, table, result)
    for name, asked in attitude.items():
        if asked or (name == "at_degC" and asked is not None):
            hint = "; add terms that rig trace prints with --add, or --confirmed-by RUN" if name == "traced" else ""
            option = f"--{name.replace('_', '-')}"
            raise UsageError(f"{option} is for attitude sensors; {data} is no pitch-roll calibration{hint}")
    chosen = {name: value for name, value in options.items() if value is not None}
    if later is None:
        fitted, record = fit_whole_plots(table, formula, leave_out=leave_out, **chosen), {}
    else:
        from rig.closed_loop.confirm import confirmed_by, fit_whole_plots_confirmed  # noqa: PLC0415

        model = formula or table.declared.get("formula") or "full"
        fitted, told = fit_whole_plots_confirmed(*confirmed_by(data, later, formula), model, chosen)
        record = {"confirmed_by": told}
    result = fitted.to_json() | record
    if report is not None:
        from rig.report import write_fit_report  # noqa: PLC0415

        write_fit_report(report, fitted)
        err.print(f"report: {escape(str(report))}", soft_wrap=True)
    return result, lambda: show_fit(data.name, table, result)


def show_fit(name: str, table: Table, result: Mapping[str, Any]) -> None:
    """Show what `fit_table` found."""
    from rig.cli.attitude import show_attitude_fit  # noqa: PLC0415
    from rig.cli.whole_plot import show_whole_plot_fit  # noqa: PLC0415

    headline(name, table)
    if table.kind == "whole-plot":
        show_whole_plot_fit(result)
    else:
        show_attitude_fit(result)
    if "confirmed_by" in result:
        told = result["confirmed_by"]
        out.print(f"\njudged by {escape(told['by_run_id'])}", soft_wrap=True)
        for effect in told["effects"]:
            out.print(escape(f"  {effect['used']}. {effect['evidence']}"), soft_wrap=True)


@app.command()
def trace(
    data: DataArgument,
    as_json: JsonOption = False,
    report: Annotated[Path | None, typer.Option(help="write a self-contained HTML report", show_default=False)] = None,
    formula: Annotated[
        str | None,
        typer.Option(
            "--formula",
            help="the declared model: of any table with --response ('1 + x'); of whole plots instead of the one "
            "that the run's procedure declares (II.C, eq10, or a formula)",
            show_default=False,
        ),
    ] = None,
    temperature: TemperatureOption = None,
    unnamed: Annotated[
        bool,
        typer.Option("--unnamed", help="attitude: let smooth terms without a cause take up what no effect explains"),
    ] = False,
    response: Annotated[
        str | None,
        typer.Option(help="any table: the column to be explained, or arithmetic of columns", show_default=False),
    ] = None,
    group: GroupOption = None,
    whole_plot: WholePlotOption = None,
    replicate: ReplicateOption = None,
    time: TimeOption = None,
    direction: DirectionOption = None,
    candidates: CandidatesOption = None,
    ignore: IgnoreOption = None,
    wrap: WrapOption = None,
) -> int:
    """Find what the declared model lacks: residual, effect, error before and after.

    Examples: `rig trace runs/20260115T180000-night-1a2b.sqlite --report night.html`,
    `rig trace table.csv --response y --formula "1 + x" --group batch --time t_s`
    """
    from rig.closed_loop import trace_table  # noqa: PLC0415
    from rig.tables import read_table  # noqa: PLC0415

    check_files([report], [data])
    parts: dict[str, Any] = {
        "group": group,
        "whole_plot": whole_plot,
        "replicate": replicate,
        "time": time,
        "direction": direction,
    }
    parts |= {"candidates": candidates, "ignore": ignore, "wrap": wrap}
    if response is not None:
        if temperature is not None:
            raise UsageError("--temperature is for attitude sensors; in any other table name its column as a candidate")
        if unnamed:
            raise UsageError("--unnamed is for attitude sensors; elsewhere what remains is told with its curve")
        trace_any(data, response, formula, parts, as_json=as_json, report=report)
        return ExitCode.DONE
    check_no_parts(parts)
    table = read_table(data)
    if temperature and table.kind != "pitch-roll":
        raise UsageError(f"--temperature is for attitude sensors; {data} is no pitch-roll calibration")
    if unnamed and table.kind != "pitch-roll":
        raise UsageError(f"--unnamed is for attitude sensors; in {data} what remains is said with its curve anyway")
    traced = trace_table(table, formula, temperature=temperature, unnamed=unnamed)
    if report is not None:
        from rig.report import write_report  # noqa: PLC0415

        write_report(report, traced)
        err.print(f"report: {escape(str(report))}", soft_wrap=True)
    result = traced.to_json()
    if as_json:
        print_json(result)
    else:
        show_trace(traced)
    show_unused(result["unused"])
    return ExitCode.DONE


def show_trace(traced: Traced) -> None:
    """Show what `trace_table` found."""
    from rig.cli.attitude import show_attitude_trace  # noqa: PLC0415
    from rig.cli.whole_plot import show_whole_plot_trace  # noqa: PLC0415
    from rig.closed_loop import WholePlotTraced  # noqa: PLC0415

    if isinstance(traced, WholePlotTraced):
        show_whole_plot_trace(traced)
    else:
        show_attitude_trace(traced)
    found = any(e.stratum != "noise" for sensor in traced.trace.sensors.values() for e in sensor.effects)
    if found and "run_id" in traced.table.provenance:
        out.print(
            f"\nto confirm what was found by a further run: rig confirm {escape(traced.table.source)} --list",
            soft_wrap=True,
        )
