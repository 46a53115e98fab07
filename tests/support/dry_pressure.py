"""Short dry runs of the pressure laboratory, for tests: five whole plots of five pressures, one kill."""

from __future__ import annotations

from pathlib import Path

from rig.engine.session import Outcome, Progress, Signals
from rig.examples import example
from rig.runs.controller import resume_run, start_run
from rig.runs.plans import load_plan

LAB = example("pressure-lab")

SHORT = """
kind = "whole-plot"
name = "short"
seed = 2
[design]
type = "list"
temperatures_degC = [[10, 20], [20, 10], [20, 30], [30, 20], [15, 15]]
pressures_psia = [0.12, 0.5, 1.0, 2.5]
repeated_psia = [0.5]
[model]
formula = "1 + P + T_sensor + T_SSE"
[soak]
dwell_s = 120
drift_degC_per_h = 5
[settle]
dwell_s = 4
[measure]
readings = 2
"""
IN_ALL, EACH = 25, 5


class Killed(BaseException):
    """Stands for SIGKILL: nothing of ours runs after it but what an exception runs."""


def dry(
    folder: Path,
    *,
    text: str = SHORT,
    bench: Path = LAB / "bench.toml",
    world: Path = LAB / "world.toml",
    kill_at: int | None = None,
) -> Path:
    """Run a procedure dry, with a power cut after so many points if asked; the run file."""
    folder.mkdir(parents=True, exist_ok=True)
    procedure = folder / "short.toml"
    procedure.write_text(text)
    plan = load_plan(procedure, bench, dry=True, world=world)
    paths: list[Path] = []

    def on_progress(news: Progress) -> None:
        if kill_at is not None and news.done >= kill_at:
            raise Killed

    try:
        result = start_run(plan, folder, signals=Signals(), announce=paths.append, on_progress=on_progress)
    except Killed:
        result = resume_run(paths[0], signals=Signals(), on_progress=lambda _: None)
    assert result.outcome is Outcome.COMPLETE, result.message
    return paths[0]
