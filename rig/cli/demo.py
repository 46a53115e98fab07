"""`rig demo`: a simulated night, killed and resumed, fitted, traced, reported."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from rig.bench.config import parse_toml
from rig.cli.commands import app
from rig.cli.options import JsonOption
from rig.cli.progress import run_progress
from rig.cli.run import conclude
from rig.cli.show import err, out, print_json
from rig.cli.unattended import Listening
from rig.engine.session import Outcome, Signals
from rig.errors import ExitCode, RigError
from rig.files.toml_text import toml_text
from rig.procedures.present import terminal
from rig.runs.controller import resume_run


class Lab(StrEnum):
    """The example laboratories."""

    ATTITUDE = "attitude"
    PRESSURE = "pressure"
    LOAD_CELL = "load-cell"
    BATH = "bath"
    VOLTMETER = "voltmeter"


@dataclass(frozen=True)
class _Night:
    """The demo run in a laboratory, and the point of its kill.

    Attributes:
        folder: of the laboratory.
        procedure: its procedure file.
        kill_at_point: number of points after which it is killed.
        shortened: change of the procedure for a short one.
        short_kill_at_point: the kill of that.
        smaller: changes of the procedure for a loop, which has its further runs beside it.
        without: sensors that the bench of a loop does not have.
        hours: of a loop.
    """

    folder: str
    procedure: str
    kill_at_point: int
    shortened: tuple[str, str]
    short_kill_at_point: int
    smaller: tuple[tuple[str, str], ...] = ()
    without: tuple[str, ...] = ()
    hours: int = 72


_BY_A_PERSON = (
    '\n[loop]\nallow = ["again", "order", "settings", "temperature", "wait", "person"]\nbetween_runs = "safe"\n'
)
"""A simulated bench has a simulated person, who locks the pads when a further run asks for it. Its enclosure
does not stay on between runs: the example's noise, and the figures of its picture, are those of runs that settle anew.
"""
_NIGHTS = {
    # A loop of three sensors takes twice as long: its forecasts of possible further runs are of all of them.
    Lab.ATTITUDE: _Night(
        "attitude-lab",
        "night.toml",
        1180,
        ("replications = 6 ", "replications = 2 "),
        390,
        (
            ("three sensors, 37 x 13", "one sensor, 37 x 7"),
            ("roll_count = 13", "roll_count = 7"),
            ("replications = 6 ", "replications = 3 "),
        ),
        ("y", "z"),
        13,
    ),
    # The 104th point is the fifth of its whole plot; the power cut loses this whole plot.
    Lab.PRESSURE: _Night("pressure-lab", "procedure.toml", 104, ("centre = 6 ", "centre = 2 "), 71),
    Lab.LOAD_CELL: _Night("load-cell-lab", "procedure.toml", 42, ("replications = 3", "replications = 2"), 21),
    Lab.BATH: _Night("bath-lab", "procedure.toml", 18, ("replications = 2", "replications = 1"), 10),
    Lab.VOLTMETER: _Night("voltmeter-lab", "procedure.toml", 30, ("-1000, -500, ", "-1000, "), 20),
}


@app.command()
def demo(
    lab: Annotated[Lab, typer.Argument(help="example laboratory", show_default=True)] = Lab.ATTITUDE,
    out_dir: Annotated[Path, typer.Option("--out", "-o", help="folder for the run file and the report")] = Path("runs"),
    as_json: JsonOption = False,
    short: Annotated[bool, typer.Option("--short", help="a shorter night, for a first look")] = False,
    loop: Annotated[
        bool,
        typer.Option("--loop", help="as `rig loop`: further runs confirm the effects, and a calibration has them"),
    ] = False,
) -> int:
    """Run a simulated night with undeclared effects, kill it partway, resume it, and find the effects.

    With --loop, as `make demo` does, further runs confirm them, and the calibration has them: of attitude that is a
    night with one sensor.

    attitude: three inertial sensors on a dividing head, 37 x 13 points, six replications: 28 hours of bench time. The
    package rests on soft isolation pads, and its sensitivity depends on temperature; the declared model has neither
    effect.

    pressure: seven pressure transducers over two temperatures, 20 whole plots of 11 pressures: about 37 hours. Every
    temperature change draws a new error, the noise grows with pressure, and there is an undeclared cubic term. The kill
    is a power cut in the middle of a whole plot, which is measured again.

    load-cell: a load cell under dead weights, which a person sets one after the other, up and down, three times: about
    80 minutes. After every change of load the cell creeps, which the declared parabola has no term for.

    bath: four resistance thermometers and a thermocouple in a stirred bath beside a reference thermometer, five
    temperatures as whole plots: about 5 hours. The measuring current heats the thermometers, undeclared.

    voltmeter: a voltmeter of six ranges against a calibrator: 13 minutes. The two highest ranges have an offset of
    their own, which the declared straight line has no term for.

    Examples:

    - `rig demo pressure`
    - `rig demo --loop`
    - `rig demo load-cell --short --out night`
    """
    from rig.by_kind import trace_table  # noqa: PLC0415
    from rig.examples import example  # noqa: PLC0415
    from rig.procedures.evaluate.in_short import in_short  # noqa: PLC0415
    from rig.tables.table_of_run import run_table  # noqa: PLC0415
    from rig.verbs.write_page import write_page  # noqa: PLC0415

    night = _NIGHTS[lab]
    folder = example(night.folder)
    with tempfile.TemporaryDirectory(prefix="rig-demo-") as temporary:
        procedure, lab_files = folder / night.procedure, folder
        if loop and night.smaller:
            lab_files = _smaller(folder, night, Path(temporary))
            procedure = lab_files / night.procedure
        elif short:
            procedure = _shortened(procedure, night.shortened, Path(temporary))
        kill_at_point = night.short_kill_at_point if short or lab_files != folder else night.kill_at_point
        path = _run_until_killed(lab_files, procedure, out_dir, kill_at_point, night.hours if loop else None)
    print(path, flush=True)
    err.print("[bold]The controller was killed with SIGKILL.[/] Resuming from its file:")
    if loop:
        from rig.cli.loop import resume_of_loop  # noqa: PLC0415

        asked = Listening(None, "text", None, None, dry=True, strict=False)
        return resume_of_loop(path, 300.0, asked, None, as_json=as_json)
    with run_progress(simulated=True) as show:
        result = resume_run(path, signals=Signals(), on_progress=show, dry_gap_s=300.0)
    conclude(result)
    if result.outcome is not Outcome.COMPLETE:
        raise RigError("the demo's run did not complete after it was resumed; please report this")
    err.print("Tracing the residual of every sensor ...")
    table = run_table(path)
    traced = trace_table(table)
    report = path.with_suffix(".html")
    write_page(report, traced.page())
    if as_json:
        print_json(traced.to_json())
    else:
        terminal.show(in_short(traced), out)
        out.print(f"Report: {escape(str(report))}", soft_wrap=True)
    return ExitCode.DONE


def _smaller(lab: Path, night: _Night, folder: Path) -> Path:
    """Bench, world and procedure of a loop, in a folder; returns it."""
    for name in ("bench.toml", "world.toml"):
        values: dict[str, Any] = parse_toml((lab / name).read_text(encoding="utf-8"), name)
        values["sensors"] = {one: of for one, of in values["sensors"].items() if one not in night.without}
        (folder / name).write_text(toml_text(values), encoding="utf-8")
    text = (lab / night.procedure).read_text(encoding="utf-8")
    for change in night.smaller:
        text = text.replace(*change)
    (folder / night.procedure).write_text(text + _BY_A_PERSON, encoding="utf-8")
    return folder


def _shortened(procedure: Path, change: tuple[str, str], folder: Path) -> Path:
    shorter = folder / f"short-{procedure.name}"
    shorter.write_text(procedure.read_text(encoding="utf-8").replace(*change, 1), encoding="utf-8")
    return shorter


def _run_until_killed(lab: Path, procedure: Path, folder: Path, kill_at_point: int, hours: int | None) -> Path:
    """Start a dry run, or a loop of `hours`, in a separate process that kills itself; returns its file."""
    command = [sys.executable, "-m", "rig", "run" if hours is None else "loop", str(procedure), "--dry"]
    command += ["--bench", str(lab / "bench.toml"), *(["--hours", str(hours)] if hours is not None else [])]
    command += ["--world", str(lab / "world.toml"), "--out", str(folder), "--kill-at-point", str(kill_at_point)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    if err.is_terminal:
        err.show_cursor(True)  # the killed process could not remove it
        err.print()
    lines = done.stdout.splitlines()
    if done.returncode != -9 or not lines:
        raise RigError(f"the demo's first half ended with exit code {done.returncode} instead of being killed")
    return Path(lines[0])
