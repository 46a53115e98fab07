"""`rig plan --compare`: procedures side by side, what each costs and what it gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from rich import box
from rich.markup import escape
from rich.table import Table

from procedures.attitude.advice import design_points, usage_of
from procedures.attitude.merit import Comparison, Usage, compare, curve, recommend
from procedures.attitude.settings import PitchRollProcedure
from rig.atomic import check_files, write_whole_bytes
from rig.cli.show import err, number, out, print_json, run_progress
from rig.errors import ConfigurationError, UsageError
from rig.plans import Plan, load_plan


def compare_files(
    files: Sequence[Path], bench: Path, usage_deg: float | None, plot: Path | None, *, as_json: bool
) -> None:
    """Rehearse procedures one after the other and show them side by side; arguments and errors as for `compare_plans`.

    Raises:
        ConfigurationError: one of the files is wrong.

    """
    from rig.forecast import rehearse  # noqa: PLC0415

    check_files([plot], [bench, *files])
    plans, hours = {path: _load(path, bench) for path in files}, []
    for path, plan in plans.items():
        err.print(f"rehearsing {escape(str(path))}", soft_wrap=True)
        with run_progress(simulated=True) as show:
            hours.append(rehearse(plan, show, points=100).total_s / 3600.0)
    compare_plans(plans, hours, usage_deg, plot, as_json=as_json)


def _load(path: Path, bench: Path) -> Plan:
    """A procedure to be compared, on a bench. Raises `ConfigurationError` that names it."""
    try:
        return load_plan(path, bench)
    except ConfigurationError as error:
        raise error if str(path) in str(error) else ConfigurationError(f"{path}: {error}") from error


def compare_plans(
    plans: Mapping[Path, Plan], hours: Sequence[float], usage_deg: float | None, plot: Path | None, *, as_json: bool
) -> None:
    """Show pitch-roll procedures side by side and recommend one.

    Args:
        plans: what is compared, on one bench, by file.
        hours: bench time of each.
        usage_deg: pitch range the sensors will be used in, plus and minus; None for that of the first procedure, or
            30 deg.
        plot: a PNG file for the standard deviation over pitch; None for none.
        as_json: print JSON instead of a table.

    Raises:
        UsageError: a procedure is of another kind, or the plot cannot be written.

    """
    procedures = []
    for path, plan in plans.items():
        if not isinstance(plan.procedure, PitchRollProcedure):
            raise UsageError(f"{path} is of kind {plan.procedure.kind}; pitch-roll designs are compared")
        procedures.append(plan.procedure)
    usage = usage_of(procedures[0], usage_deg) or Usage.within(30.0)
    names = [p.name for p in procedures]
    if len(set(names)) < len(names):
        names = [str(path) for path in plans]
    designs = [replace(design_points(p), name=name) for p, name in zip(procedures, names, strict=True)]
    sigma = procedures[0].expect.sigma_deg
    across = sorted({str(s.axis) for s in next(iter(plans.values())).bench.sensors.values()} - {"x"})
    rows = [_seen_by(row, across) for row in compare(designs, usage, sigma)]
    best = recommend(rows, cost=list(hours))
    if plot is not None:
        _plot([curve(d, usage, sigma) for d, row in zip(designs, rows, strict=True) if not row.undetermined], plot)
    if as_json:
        listed: list[dict[str, Any]] = [
            asdict(row) | {"procedure": p.name, "file": str(path), "hours": h}
            for row, p, path, h in zip(rows, procedures, plans, hours, strict=True)
        ]
        print_json(
            {
                "usage_deg": usage.pitch_half_deg,
                "sigma_deg": sigma,
                "designs": listed,
                "recommended": best and asdict(best),
            }
        )
        return
    title = f"Used within {usage}, one observation {sigma:.1e} deg (expect.sigma_deg)"
    headings = ("procedure", "points", "time", "mean sd", "worst sd", "at", "V^1/2", "pads from")
    table = Table(*headings, title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
    table.title_justify = "left"
    for row, time_h in zip(rows, hours, strict=True):
        table.add_row(escape(row.name), *_cells(row, time_h))
    out.print(table)
    out.print(
        "  sd of the calibrated output / 1e-4 deg; V^1/2: figure of merit, eq. (53); pads from: smallest deflection / "
        "1e-4 deg that lack of fit shows nine times in ten",
        soft_wrap=True,
    )
    for row in rows:
        if row.undetermined:
            out.print(f"  [yellow]{escape(row.name)}:[/] {escape(row.undetermined)}", soft_wrap=True)
        elif row.extrapolated:
            out.print(f"  [yellow]{escape(row.name)}[/] is not calibrated over all of that range", soft_wrap=True)
    if best is None:
        out.print("  none of them determines the sensors over that range: none is recommended", soft_wrap=True)
    else:
        out.print(f"  [bold]recommended: {escape(best.name)}[/]; {escape(best.why)}", soft_wrap=True)


def _seen_by(row: Comparison, across: Sequence[str]) -> Comparison:
    """A design without roll determines no sensor across the pitch plane, whatever it does for one along x."""
    if row.roll or row.undetermined or not across:
        return row
    sensors = " and ".join(across)
    return Comparison(
        row.name,
        row.roll,
        row.points,
        row.replications,
        row.observations,
        row.df,
        undetermined=f"without roll it does not calibrate the {sensors} sensors of this bench",
    )


def _cells(row: Comparison, time_h: float) -> list[str]:
    if row.undetermined:
        return [str(row.observations), f"{time_h:.1f} h", *"-----"]
    pads = "never" if row.smallest_pad_deg == float("inf") else number(1e4 * row.smallest_pad_deg, 2)
    return [
        str(row.observations),
        f"{time_h:.1f} h",
        number(1e4 * row.mean_sd_deg, 3),
        number(1e4 * row.worst_sd_deg, 3),
        f"{row.worst_pitch_deg:.0f} deg",
        f"{row.figure_of_merit:.3f}",
        pads,
    ]


def _plot(curves: Sequence[Any], path: Path) -> None:
    """Standard deviation over pitch, as the paper's figures 1 to 5, to a PNG file."""
    from rig.report.pictures import side_by_side  # noqa: PLC0415 - plots take a second to import

    figure, (axis,) = side_by_side(3.6, 1, width=7.0)
    for one in curves:
        axis.plot(one.pitch_deg, 1e4 * one.sd_deg[0], label=one.name)
    axis.set_xlabel("pitch / deg")
    axis.set_ylabel("sd of the calibrated output / 1e-4 deg")
    axis.grid(color="0.9", linewidth=0.6)
    axis.set_ylim(bottom=0)
    axis.legend(fontsize=8, frameon=False)
    write_whole_bytes(path, lambda file: figure.savefig(file, format="png", metadata={"Software": None}))
