"""`rig plan --compare`: procedures side by side, with duration and precision."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.markup import escape

from rig.cli.progress import run_progress
from rig.cli.show import err, out, print_json
from rig.errors import ConfigurationError, UsageError
from rig.files.atomic import check_files, write_whole_bytes
from rig.procedures.kinds import kind_of
from rig.procedures.present.terminal import show
from rig.runs.plans import Plan, load_plan


def compare_files(
    files: Sequence[Path], bench: Path, usage_deg: float | None, plot: Path | None, *, as_json: bool
) -> None:
    """Rehearse several procedures and show them side by side; arguments and errors as for `compare_plans`.

    Raises:
        ConfigurationError: one of the files is wrong.
    """
    from rig.runs.forecast import rehearse  # noqa: PLC0415

    check_files([plot], [bench, *files])
    plans, hours = {path: _load(path, bench) for path in files}, []
    for path, plan in plans.items():
        err.print(f"rehearsing {escape(str(path))}", soft_wrap=True)
        with run_progress(simulated=True) as progress:
            hours.append(rehearse(plan, progress, points=100).total_s / 3600.0)
    compare_plans(plans, hours, usage_deg, plot, as_json=as_json)


def _load(path: Path, bench: Path) -> Plan:
    """A procedure for the comparison, on a bench. Raises `ConfigurationError` with its name."""
    try:
        return load_plan(path, bench)
    except ConfigurationError as error:
        raise error if str(path) in str(error) else ConfigurationError(f"{path}: {error}") from error


def compare_plans(
    plans: Mapping[Path, Plan], hours: Sequence[float], usage: float | None, plot: Path | None, *, as_json: bool
) -> None:
    """Show procedures of one kind side by side and recommend one.

    Args:
        plans: the compared plans, on one bench, by file.
        hours: bench time of each.
        usage: range of use of the sensors, plus and minus, degrees; None for that of the first procedure, or the kind's
            own.
        plot: a PNG file for the precision over that range; None for none.
        as_json: print JSON instead of a table.

    Raises:
        UsageError: a procedure is of another kind, or the plot cannot be written.
    """
    first = next(iter(plans.values()))
    kind = kind_of(first.procedure)
    for path, plan in plans.items():
        if plan.procedure.kind != kind.name:
            raise UsageError(f"{path} is of kind {plan.procedure.kind}; {kind.name} designs are compared")
    names = [plan.procedure.name for plan in plans.values()]
    shown = names if len(set(names)) == len(names) else [str(path) for path in plans]
    axes = {str(s.axis) for s in first.bench.sensors.values()}
    found = kind.compare([plan.procedure for plan in plans.values()], shown, axes, usage, hours)
    if plot is not None:
        write_whole_bytes(plot, found.draw)
    if as_json:
        result = found.to_json()
        named = zip(result["designs"], names, plans, strict=True)
        result["designs"] = [one | {"procedure": name, "file": str(path)} for one, name, path in named]
        print_json(result)
    else:
        show(found.blocks(), out)
