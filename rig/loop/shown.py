"""A loop for people and programs: lines of `rig loop` and `rig status`, and their JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.markup import escape

from rig.engine.early_warning import warnings_in
from rig.loop.products import errors_before_after
from rig.loop.program import ONE_WITH_FIRST, LoopRun, Program
from rig.loop.timeline import clock_time
from rig.procedures.present.blocks import Block, Grid, Line, simulated_mark
from rig.procedures.present.durations import duration
from rig.procedures.present.shell import shell_word
from rig.run_file.live import controller_alive


def blocks(program: Program) -> Iterator[Block]:
    """State, runs, results, and what remains for a person."""
    mark = simulated_mark(program.run.simulated)
    yield Line(f"{mark}[bold]{escape(program.path.name)}[/]: {escape(state_of(program))}", wrapped=True)
    table = Grid(("run", "what", "outcome", "bench time", "file"), frame="plain", apart=2)
    for run in program.runs:
        took = "" if run.ended is None else duration(run.ended.took_s)
        table.add_row(
            str(run.planned.number), escape(run.planned.what), _outcome(run), took, escape(program.file_of(run).name)
        )
    yield table
    alive = controller_alive(program.path)
    for words in program.on_between_runs:
        yield Line(f"  [bold yellow]{'stays on until the next run' if alive else 'left on'}:[/] {escape(words)}")
    if program.unsafe:
        yield Line(f"  [bold red]NOT in its safe state:[/] {escape('; '.join(program.unsafe))}")
    for run in program.runs:
        for words in warnings_in(program.file_of(run)):
            yield Line(f"  [bold yellow]warning, run {run.planned.number}:[/] {escape(words)}", wrapped=True)
    for after in sorted(program.found):
        yield Line(f"  after run {after}: {escape(program.found[after].words)}", wrapped=True)
    pairs = errors_before_after(program)
    if pairs:
        unit = program.found[program.complete].unit
        columns = ("error on the further runs", f"declared model / {unit}", f"with the effects / {unit}")
        errors = Grid(columns, frame="plain", apart=2)
        for name, (before, after_) in pairs.items():
            errors.add_row(escape(name), f"{before:.3g}", f"{after_:.3g}")
        yield errors
    for number, one in enumerate(program.for_person, start=1):
        do = one.do or "give it more time"
        yield Line(
            f"  [yellow]for a person, {number}: {escape(do)}; {escape(one.what)}, {duration(3600.0 * one.hours)}, "
            f"would decide {escape(one.decides)}[/]",
            wrapped=True,
        )
    if program.for_person and program.closed is not None:
        yield Line(f"  then: rig loop --continue {escape(shell_word(program.path))} --hours HOURS")
    for what in program.wrote.values():
        yield Line(f"  {what.status}: {escape(what.why or ', '.join(what.files))}", wrapped=True)


def _outcome(run: LoopRun) -> str:
    return "open" if run.ended is None else f"{escape(run.ended.how)}{ONE_WITH_FIRST if run.joined else ''}"


def state_of(program: Program) -> str:
    """The state in words."""
    if program.closed is not None:
        return f"closed: {program.closed.why}"
    at_work = "at work" if controller_alive(program.path) else "open; rig resume goes on with it"
    end = clock_time(program.run.utc_s - program.run.elapsed_s + program.ends_s)
    return f"{at_work}; {len(program.runs)} runs so far; ends at {end}"


def to_json(program: Program) -> dict[str, Any]:
    """Values for `--json`."""
    closed = program.closed
    return {
        "program": str(program.path),
        "simulated": program.run.simulated,
        "closed": closed is not None,
        "settled": closed.settled if closed is not None else None,
        "fault": any(run.ended is not None and not run.complete for run in program.runs),
        "why": closed.why if closed is not None else "",
        "left_on": list(program.on_between_runs),
        "unsafe": list(program.unsafe),
        "bench_h": round(sum(run.ended.took_s for run in program.runs if run.ended is not None) / 3600.0, 3),
        "runs": [
            {
                **run.planned.body(),
                "file": str(program.file_of(run)),
                "outcome": run.ended.how if run.ended is not None else None,
                "joined": run.joined,
                "head": run.ended.head if run.ended is not None else None,
                "took_s": run.ended.took_s if run.ended is not None else None,
                "warnings": warnings_in(program.file_of(run)),
            }
            for run in program.runs
        ],
        "found": [program.found[after].body() for after in sorted(program.found)],
        "for_person": [one.body() for one in program.for_person],
        "files": {name: {"files": list(one.files), "why": one.why} for name, one in program.wrote.items()},
        "story": [{"utc_s": record.utc_s, "sentence": record.sentence()} for record in program.story],
    }
