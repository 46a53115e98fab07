"""`rig doctor`: checks before an unattended run."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from rig.cli.commands import app
from rig.cli.options import JsonOption
from rig.cli.show import err, mark, out, print_json
from rig.cli.unattended import NotifyFileOption
from rig.errors import ExitCode
from rig.procedures.present.terminal import print_whole

if TYPE_CHECKING:
    from rig.unattended.doctor.findings import Finding, Level

_STYLES: dict[Level, str] = {"ok": "green", "warning": "yellow", "problem": "bold red"}


@app.command()
def doctor(
    bench: Annotated[Path | None, typer.Option("--bench", "-b", help="the bench file", show_default=False)] = None,
    procedure: Annotated[
        Path | None, typer.Option("--procedure", "-p", help="the procedure file", show_default=False)
    ] = None,
    run_file: Annotated[Path | None, typer.Option("--run", help="a run to be resumed", show_default=False)] = None,
    out_dir: Annotated[Path, typer.Option("--out", "-o", help="folder of the new run file")] = Path("runs"),
    dry: Annotated[bool, typer.Option("--dry", help="ask simulated instruments")] = False,
    world: Annotated[Path | None, typer.Option(help="with --dry: the world file", show_default=False)] = None,
    notify: Annotated[bool, typer.Option("--notify", help="send a test message over every channel")] = False,
    notify_file: NotifyFileOption = None,
    as_json: JsonOption = False,
) -> int:
    """Check bench, disk, clock, machine and notifications before an unattended run.

    Asks every instrument for its identity and changes nothing. Ends with 78 if a file is wrong, with 1 if there is
    another problem, with 0 otherwise.

    Examples:

    - `rig doctor --bench bench.toml`
    - `rig doctor --bench bench.toml --procedure night.toml`
    - `rig doctor --bench bench.toml --dry --json`
    """
    from rig.unattended.doctor import Visit, examine  # noqa: PLC0415

    visit = Visit(bench, procedure, run_file, out_dir, dry, world, notify, notify_file)
    findings = list(examine(visit))
    problems = any(finding.level == "problem" for finding in findings)
    if as_json:
        print_json({"ready": not problems, "findings": [finding.as_json() for finding in findings]})
    else:
        _show(findings, dry=dry, looked=bench is not None or run_file is not None)
    return max((finding.exit_code for finding in findings), default=int(ExitCode.DONE))


def _show(findings: list[Finding], *, dry: bool, looked: bool) -> None:
    table = Table("", "check", "found, and what to do next", box=None, pad_edge=False)
    for finding in findings:
        text = escape(finding.found) + (f"\n[bold]→ {escape(finding.next_step)}[/]" if finding.next_step else "")
        table.add_row(f"[{_STYLES[finding.level]}]{finding.level}[/]", escape(finding.check), text)
    print_whole(table, out)
    counts = Counter(finding.level for finding in findings)
    words = ", ".join(f"{counts[level]} {level}" for level in _STYLES if counts[level])
    ready = "ready for the night" if looked else "this machine is ready; no bench was checked (--bench BENCH)"
    verdict = "not ready for the night" if counts["problem"] else ready
    err.print(f"{mark(dry)}{verdict}: {words}")
