"""`rig plan`: the evening question."""

from __future__ import annotations

import shutil
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from rig.cli import app
from rig.cli.run import BenchOption, JsonOption, ProcedureArgument
from rig.cli.show import duration, out, print_json, run_progress
from rig.controller import BYTES_PER_POINT, load_plan
from rig.errors import ExitCode


@app.command(rich_help_panel="Running")
def plan(
    procedure: ProcedureArgument,
    bench: BenchOption,
    out_dir: Annotated[Path, typer.Option("--out", "-o", help="folder the run file would go to")] = Path("runs"),
    as_json: JsonOption = False,
) -> int:
    """Answer the evening question: how many points, done when and how sure, how precise, is anything in the way?

    The time comes from a rehearsal of the first points on simulated instruments with the bench file's own speeds.

    Example: `rig plan night.toml --bench bench.toml`
    """
    from drivers.clock import RealClock  # noqa: PLC0415
    from rig.forecast import ALLOWANCE, precision, rehearse  # noqa: PLC0415

    planned = load_plan(procedure, bench)
    with run_progress(simulated=True) as show:
        forecast = rehearse(planned, show)
    now = datetime.fromtimestamp(RealClock().utc(), UTC).astimezone()
    end = now + timedelta(seconds=forecast.latest_s)
    overdue = _due(planned.bench.instruments, end.date())
    existing = next(p for p in (out_dir, *out_dir.absolute().parents) if p.exists())
    free, needed = shutil.disk_usage(existing).free, len(planned.run_list) * BYTES_PER_POINT
    angles = precision(planned.run_list, planned.procedure.expect.sigma_deg)
    reach = planned.run_list.extremes()
    result: dict[str, Any] = {
        "procedure": planned.procedure.name,
        "bench": planned.bench.name,
        "points": len(planned.run_list),
        "replications": planned.procedure.replications,
        "run_list": planned.run_list.sha256(),
        "seconds": {
            "preparation": forecast.preparation_s,
            "point": forecast.point_s,
            "total": forecast.total_s,
            "latest": forecast.latest_s,
        },
        "rehearsed_points": forecast.rehearsed,
        "finish": (now + timedelta(seconds=forecast.total_s)).isoformat(timespec="minutes"),
        "finish_latest": end.isoformat(timespec="minutes"),
        "precision_deg": angles,
        "reach": reach,
        "limits": planned.bench.limits,
        "overdue": overdue,
        "disk_free_bytes": free,
        "disk_needed_bytes": needed,
    }
    if as_json:
        print_json(result)
        return ExitCode.DONE
    out.print(f"[bold]{planned.procedure.name}[/] on {planned.bench.name}")
    out.print(f"  {len(planned.run_list)} points, {planned.procedure.replications} replications")
    out.print(
        f"  started now, done {_when(now, forecast.total_s)} ({duration(forecast.total_s)}), "
        f"at the latest {_when(now, forecast.latest_s)}"
    )
    out.print(
        f"  {forecast.point_s:.1f} s a point (sd {forecast.point_sd_s:.1f} s, {forecast.rehearsed} points rehearsed), "
        f"{duration(forecast.preparation_s)} of preparation; the latest allows {ALLOWANCE:.0%} for repeats and retries"
    )
    table = Table(
        "pitch / deg",
        "sd of the calibrated output / deg",
        "95 % interval / deg",
        title="Predicted precision",
        title_justify="left",
    )
    for row in angles:
        table.add_row(f"{row['pitch_deg']:g}", f"{row['sd_deg']:.2e}", f"+-{row['interval95_deg']:.2e}")
    out.print(table)
    out.print(
        f"  (if one observation has a standard error of {planned.procedure.expect.sigma_deg:.1e} deg, expect.sigma_deg)"
    )
    for name, (low, high) in reach.items():
        allowed = planned.bench.limits.get(name)
        shown = f"limits {allowed[0]:g} to {allowed[1]:g}: ok" if allowed else "[yellow]no limit in the bench file[/]"
        out.print(f"  {name} goes from {low:g} to {high:g}, overtravel included; {shown}")
    for line in overdue:
        out.print(f"  [yellow]{line}[/]")
    if not overdue:
        out.print("  every instrument's own calibration is in date until then")
    verdict = "ok" if free > needed else "[red]not enough[/]"
    out.print(f"  disk: needs {needed / 1e6:.0f} MB, {free / 1e9:.1f} GB free: {verdict}")
    return ExitCode.DONE


def _when(now: datetime, seconds: float) -> str:
    moment = now + timedelta(seconds=seconds)
    return f"{moment:%H:%M}" if moment.date() == now.date() else f"{moment:%A %H:%M}"


def _due(instruments: Any, on: date) -> list[str]:
    lines = []
    for name, instrument in instruments.items():
        if instrument.due is None:
            lines.append(f"{name}: the bench file does not say when its calibration is due")
        elif instrument.due < on:
            lines.append(f"{name}: its calibration is due {instrument.due}, before this run would end")
    return lines
