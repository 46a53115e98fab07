"""`rig plan`: the evening question."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from drivers.roles import Chamber
from fitter.errors import FitError
from procedures.durations import duration
from procedures.kind import kind_of
from procedures.precision import Precision
from rig.cli import app
from rig.cli.run import BenchOption, JsonOption, ProcedureArgument
from rig.cli.show import out, print_json, run_progress
from rig.engine.guard import Guard
from rig.errors import ConfigurationError, ExitCode, UsageError
from rig.plans import Plan, load_plan
from rig.plugins import driver_class
from rig.room import needed_bytes


@app.command()
def plan(
    procedure: ProcedureArgument,
    bench: BenchOption,
    out_dir: Annotated[Path, typer.Option("--out", "-o", help="folder the run file would go to")] = Path("runs"),
    as_json: JsonOption = False,
    compare: Annotated[
        list[Path] | None,
        typer.Option(
            help="put other procedures of its kind beside it and recommend one; repeatable", show_default=False
        ),
    ] = None,
    usage: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            max=180,
            help="range the sensors will be used in, +- deg, for kinds that know one",
            show_default="of the procedure",
        ),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="with --compare: a PNG of precision over the range of use", show_default=False)
    ] = None,
) -> int:
    """Answer the evening question: how many points, done when and how sure, how precise, is anything in the way?

    The time comes from a rehearsal of the first points on simulated instruments with the bench file's own speeds.

    Examples: `rig plan night.toml -b bench.toml`, `rig plan night.toml --compare short.toml --usage 30 -b bench.toml`
    """
    from drivers.clock import RealClock  # noqa: PLC0415
    from rig.forecast import ALLOWANCE, SOAK_ALLOWANCE, rehearse  # noqa: PLC0415

    if plot is not None and not compare:
        raise UsageError("--plot shows designs side by side: it goes with --compare")
    if compare:
        from rig.cli.compare import compare_files  # noqa: PLC0415

        compare_files([procedure, *compare], bench, usage, plot, as_json=as_json)
        return ExitCode.DONE
    planned = load_plan(procedure, bench)
    try:
        precise = kind_of(planned.procedure).precision(planned.procedure, planned.run_list)
    except FitError as error:
        why = f"the design does not determine a sensor: {error}; visit more settings"
        raise ConfigurationError(f"{procedure}: {why}") from error
    advice = _advice(planned, usage)
    with run_progress(simulated=True) as show:
        forecast = rehearse(planned, show)
    now = datetime.fromtimestamp(RealClock().utc(), UTC).astimezone()
    end = now + timedelta(seconds=forecast.latest_s)
    overdue = _due(planned.bench.instruments, end.date())
    existing = next(p for p in (out_dir, *out_dir.absolute().parents) if p.exists())
    free, needed = shutil.disk_usage(existing).free, needed_bytes(len(planned.run_list))
    reach, limits = planned.run_list.extremes(), Guard(planned.bench.limits, planned.bench.factors).limits
    result: dict[str, Any] = {
        "procedure": planned.procedure.name,
        "bench": planned.bench.name,
        "points": len(planned.run_list),
        "replications": planned.procedure.replications,
        "whole_plots": planned.run_list.whole_plots,
        "run_list": planned.run_list.sha256(),
        "seconds": {
            "preparation": forecast.preparation_s,
            "point": forecast.point_s,
            "soak": forecast.soak_s,
            "total": forecast.total_s,
            "latest": forecast.latest_s,
        },
        "rehearsed_points": forecast.rehearsed,
        "assumed": forecast.assumed,
        "finish": (now + timedelta(seconds=forecast.total_s)).isoformat(timespec="minutes"),
        "finish_latest": end.isoformat(timespec="minutes"),
        "precision": precise.rows,
        "reach": reach,
        "limits": limits,
        "overdue": overdue,
        "disk_free_bytes": free,
        "disk_needed_bytes": needed,
        "environment": _environment(planned),
        "advice": advice,
    }
    if as_json:
        print_json(result)
        return ExitCode.DONE
    out.print(f"[bold]{escape(planned.procedure.name)}[/] on {escape(planned.bench.name)}", soft_wrap=True)
    plots = f"{planned.run_list.whole_plots} whole plots, " if planned.run_list.whole_plots else ""
    out.print(f"  {len(planned.run_list)} points, {plots}{planned.procedure.replications} replication(s)")
    out.print(
        f"  started now, done {_when(now, forecast.total_s)} ({duration(forecast.total_s)}),\n"
        f"  at the latest {_when(now, forecast.latest_s)}"
    )
    soaks = "" if forecast.soak_s is None else f", {duration(forecast.soak_s)} a soak between whole plots"
    out.print(
        f"  {forecast.point_s:.1f} s a point (sd {forecast.point_sd_s:.1f} s, {forecast.rehearsed} points rehearsed),\n"
        f"  {duration(forecast.preparation_s)} of preparation{soaks};\n"
        f"  the latest allows {ALLOWANCE:.0%} for repeats and retries"
        + ("" if forecast.soak_s is None else f" and {SOAK_ALLOWANCE:.0%} for soaks")
    )
    for line in forecast.assumed:
        out.print(f"  {line}", soft_wrap=True)
    _show_precision(precise)
    _show_advice(advice)
    for name, (low, high) in reach.items():
        allowed = limits.get(name)
        shown = f"limits {allowed[0]:g} to {allowed[1]:g}: ok" if allowed else "[yellow]no limit in the bench file[/]"
        out.print(f"  {name} goes from {low:g} to {high:g}, overtravel included; {shown}", soft_wrap=True)
    if result["environment"]:
        out.print(f"  environment: {escape(result['environment'])}", soft_wrap=True)
    for line in overdue:
        out.print(f"  [yellow]{escape(line)}[/]", soft_wrap=True)
    if not overdue:
        out.print("  every instrument's own calibration is in date until then")
    verdict = "ok" if free > needed else "[red]not enough[/]"
    out.print(f"  disk: needs {needed / 1e6:.0f} MB, {free / 1e9:.1f} GB free: {verdict}")
    return ExitCode.DONE


def _advice(planned: Plan, usage_deg: float | None) -> list[dict[str, Any]]:
    """What is recommended for this kind of procedure, held against it with numbers."""
    axes = [s.axis for s in planned.bench.sensors.values() if s.axis is not None]
    try:
        advice = kind_of(planned.procedure).advice(planned.procedure, axes, usage_deg)
    except FitError as error:
        raise UsageError(str(error)) from error
    return [
        {"number": a.number, "recommendation": a.recommendation, "holds": a.holds, "sentence": a.sentence}
        for a in advice
    ]


def _show_precision(precise: Precision) -> None:
    if precise.columns:
        table = Table(*precise.columns, title="Predicted precision", title_justify="left")
        for row in precise.cells:
            table.add_row(*row)
        out.print(table)
    for line in precise.further:
        out.print(f"  {line}", soft_wrap=True)
    if precise.assuming:
        out.print(f"  ({precise.assuming})", soft_wrap=True)


def _show_advice(advice: Sequence[Mapping[str, Any]]) -> None:
    for item in advice:
        if not item["holds"]:
            out.print(f"  [yellow]advice:[/] {escape(item['sentence'])}", soft_wrap=True)
    followed = [str(item["number"]) for item in advice if item["holds"] and item["number"]]
    if followed:
        numbers = ", ".join(followed)
        out.print(f"  follows the paper's recommendations {numbers}; --json says with which numbers", soft_wrap=True)


def _when(now: datetime, seconds: float) -> str:
    moment = now + timedelta(seconds=seconds)
    return f"{moment:%A %Y-%m-%d %H:%M} {_zone(moment)}"


def _zone(moment: datetime) -> str:
    """The zone's name beside its offset, since names are not unique; the offset alone where it has no other name."""
    offset, name = f"{moment:%z}", moment.tzname() or ""
    offset = f"UTC{offset[:3]}:{offset[3:5]}"
    return name if name == "UTC" else f"{name} ({offset})" if name.isalpha() else offset


def _environment(planned: Plan) -> str | None:
    """What the procedure asks of the environment, or that nothing on the bench can give it; None if not asked."""
    wanted = planned.procedure.conduct.environment
    if wanted is None:
        return None
    asked = f"{wanted.setpoint_degC:g} degC for {duration(wanted.dwell_s)}"
    drivers: dict[str, Any] = {n: driver_class(i.driver) for n, i in planned.bench.instruments.items()}
    names = [name for name, driver in drivers.items() if issubclass(driver, Chamber)]
    if not names:
        return f"the procedure wants {asked}; there is nothing on this bench to control it"
    return f"{', '.join(names)}: {asked}"


def _due(instruments: Any, on: date) -> list[str]:
    lines = []
    for name, instrument in instruments.items():
        if instrument.due is None:
            lines.append(f"{name}: the bench file does not say when its calibration is due")
        elif instrument.due < on:
            lines.append(f"{name}: its calibration is due {instrument.due}, before this run would end")
    return lines
