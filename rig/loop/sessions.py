"""Begin a loop, resume it, continue a closed one: checks, locks, and the session of a conductor."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from rig.engine.session import Observer, Outcome, Progress, Signals
from rig.errors import ConfigurationError, UsageError
from rig.files.disk_space import check_may_write, check_room
from rig.files.regular import real_path
from rig.files.toml_text import toml_text
from rig.instruments.locks import locked_addresses
from rig.loop.conductor import Conductor
from rig.loop.decide import PARKING_H, PERSON
from rig.loop.ends import Ending, Told
from rig.loop.goal_of_results import check_goal
from rig.loop.program import SETTINGS, SUFFIX, check_unchanged, file_of, read_program
from rig.loop.replications import procedure_with
from rig.loop.timeline import Timeline, seconds_until
from rig.procedures.plan.settings import GoalSettings, LoopSettings
from rig.procedures.present.durations import duration
from rig.run_file.events.loops import LoopContinued
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import RunState
from rig.run_file.write.creation import Genesis, create
from rig.run_file.write.writer import RunWriter
from rig.runs.controller import Site, new_id, opened
from rig.runs.forecast import rehearse
from rig.runs.plans import Plan, load_plan, plan_of
from rig.verbs.confirm.further_plan import procedure_text
from rig.version import versions
from rig.who import Operator, operator

HERE = Site()
_LONGEST_H = 30 * 24.0


def bounds_of(plan: Plan, until: str | None, hours: float | None) -> LoopSettings:
    """Bounds of a loop: those of its procedure, with the given end. Raises `UsageError` without an end, or with two."""
    if until is not None and hours is not None:
        raise UsageError("--until and --hours both say when the loop ends; leave one out")
    bounds: LoopSettings = getattr(plan.procedure, "loop", LoopSettings())
    if until is not None or hours is not None:
        bounds = bounds.model_copy(update={"until": until, "hours": hours})
    if bounds.until is None and bounds.hours is None:
        raise UsageError("a loop ends at a time: give --until 07:00 or --hours 12, or [loop] in the procedure")
    return bounds


def _end_s(until: str | None, hours: float | None, timeline: Timeline) -> float:
    """Seconds from the begin of the loop to its end."""
    if hours is not None:
        if hours > _LONGEST_H:
            raise UsageError(f"--hours {hours:g}: a loop lasts at most {_LONGEST_H:g} h")
        return timeline.elapsed_s + 3600.0 * hours
    assert until is not None
    return timeline.elapsed_s + seconds_until(until, timeline.utc_s)


@contextlib.contextmanager
def _held(plan: Plan, site: Site) -> Iterator[Site]:
    """The bench, locked for the whole loop, also between its runs. Raises `BusyError` if another controller has it."""
    if plan.dry:
        yield site
        return
    with locked_addresses(plan.bench.instruments):
        yield replace(site, opened=partial(opened, held=True)) if site.opened is opened else site


def start_loop(
    procedure: Path,
    bench: Path,
    folder: Path,
    *,
    until: str | None = None,
    hours: float | None = None,
    dry: bool = False,
    world: Path | None = None,
    announce: Callable[[Path, Plan], None],
    signals: Signals,
    on_progress: Callable[[Progress], None],
    told: Told,
    observer: Observer | None = None,
    site: Site = HERE,
    by: Operator | None = None,
    **how: Any,
) -> Ending:
    """Begin a loop and conduct it.

    Args:
        procedure: the procedure file of the first run.
        bench: the bench file.
        folder: of the program file and all others.
        until: time of day of its end, local time.
        hours: the same as a duration; without either the procedure's `[loop]` counts.
        dry: on simulated instruments.
        world: the world file, with `dry`.
        announce: called with the program file and the plan as soon as the file exists.
        signals: checked wherever a run waits, and between steps.
        on_progress: called with the progress of its runs.
        told: receives what happens.
        observer: receives the records of its runs.
        site: how benches are opened.
        by: operator.
        how: further attributes of a `Conductor`.

    Raises:
        ConfigurationError: a file is wrong.
        UsageError: there is no end, or the first run does not fit before it.
        BusyError: another controller has the bench.
    """
    plan, by = _begun_with_least(load_plan(procedure, bench, dry=dry, world=world)), by or operator()
    if plan.needs_approval:
        raise UsageError(
            f"{bench} says approval = true, and the further runs of a loop are approved by nobody: rig run makes the "
            f"first one, once it is approved (rig propose)"
        )
    bounds = bounds_of(plan, until, hours)
    check_room(folder, len(plan.run_list))
    with _held(plan, site) as held:
        timeline = Timeline(plan, RunState())
        ends_s = _end_s(bounds.until, bounds.hours, timeline)
        first_h = _first_run_h(plan, ends_s)
        name = new_id(plan.procedure.name)
        path = folder / f"{name}{SUFFIX}"
        settings = {
            "ends_s": round(ends_s - timeline.elapsed_s, 3),
            "first_h": round(first_h, 3),
            "bounds": bounds.model_dump(mode="json", exclude_none=True),
            "files": {"procedure": file_of(procedure), "bench": file_of(bench)},
        }
        goal = goal_of(plan)
        if goal is not None and goal.deadline is not None:
            settings["goal_s"] = round(seconds_until(goal.deadline, timeline.utc_s), 3)
        about: dict[str, Any] = {"dry": dry, "procedure": plan.procedure.name, "bench": plan.bench.name}
        about |= {"software": versions(one.driver for one in plan.bench.instruments.values()), **by.as_json()}
        documents = {**plan.documents, SETTINGS: toml_text(settings)}
        genesis = Genesis(name, documents, plan.run_list, dry or plan.bench.simulated, about)
        create(path, genesis, elapsed_s=0.0, utc_s=timeline.utc_s, vfs=site.vfs)
        announce(path, plan)
        with RunWriter.open(path, vfs=site.vfs) as writer:
            conductor = Conductor(writer, read_program(writer), plan, signals, told, on_progress, by, site=held, **how)
            if observer is not None:
                conductor.observer = observer
            return conductor.conduct()


def goal_of(plan: Plan) -> GoalSettings | None:
    """`[goal]` of its procedure; None without one."""
    return getattr(plan.procedure, "goal", None)


def _begun_with_least(plan: Plan) -> Plan:
    """The plan with as many replications as its goal wants before the first look."""
    goal = goal_of(plan)
    if goal is None:
        return plan
    check_goal(goal, plan.documents)
    least = goal.least_replications or plan.procedure.replications
    if least >= goal.most_replications:
        raise ConfigurationError(
            f"goal.most_replications = {goal.most_replications} is not more than the {least} of the first run"
        )
    if least == plan.procedure.replications:
        return plan
    text = procedure_text(procedure_with(plan.procedure, replications=least), routine=True)
    return plan_of({**plan.documents, "procedure.toml": text}, dry=plan.dry)


def _first_run_h(plan: Plan, ends_s: float) -> float:
    """Expected bench time of the first run, hours. Raises `UsageError` if it does not fit."""
    forecast = rehearse(plan, lambda _: None)
    if forecast.latest_s + 3600.0 * PARKING_H > ends_s:
        raise UsageError(
            f"the first run alone takes {duration(forecast.total_s)}, at the latest {duration(forecast.latest_s)}, and "
            f"the loop would have {duration(ends_s)}: give it more time, or the procedure fewer points. Nothing moved"
        )
    return forecast.total_s / 3600.0


def resume_loop(
    path: Path,
    *,
    signals: Signals,
    on_progress: Callable[[Progress], None],
    told: Told,
    announce: Callable[[Path, Plan], None] = lambda _path, _plan: None,
    observer: Observer | None = None,
    site: Site = HERE,
    by: Operator | None = None,
    before: Callable[[Conductor], None] | None = None,
    **how: Any,
) -> Ending:
    """Go on with a loop from its last record; arguments as those of `start_loop`.

    Args:
        path: the program file.
        before: called before it goes on.

    Raises:
        ConfigurationError: the bench or procedure file was changed after the loop began.
        BusyError: another controller has the bench, or the program file.
    """
    path, by = real_path(path), by or operator()
    if before is None:
        with RunReader.open(path) as reader:  # a closed loop is opened read-only
            program = read_program(reader)
            if program.closed is not None:
                said = f"{path} is closed: nothing to resume"
                return Ending(program, Outcome.COMPLETE, said, reader.head()[1].hex())
    check_may_write(path)
    with RunWriter.open(path, vfs=site.vfs) as writer:
        program = read_program(writer)
        check_unchanged(program)
        plan = plan_of(program.documents, dry=writer.about().runs_dry, stored=True)
        with _held(plan, site) as held:
            announce(path, plan)
            conductor = Conductor(writer, program, plan, signals, told, on_progress, by, site=held, **how)
            if observer is not None:
                conductor.observer = observer
            if before is not None:
                before(conductor)
            return conductor.conduct()


def continue_loop(
    path: Path, *, until: str | None = None, hours: float | None = None, person: bool = True, **how: Any
) -> Ending:
    """Go on with a closed loop: with more time, and, with a `person` there, with runs in which somebody acts.

    Raises:
        UsageError: there is no end, or the loop is not closed yet.
    """
    if until is None and hours is None:
        raise UsageError("say how long it may go on: --hours 3, or --until 12:00")

    def goes_on(conductor: Conductor) -> None:
        program = conductor.program
        if program.closed is None:
            raise UsageError(f"{path} is not closed yet: rig resume goes on with it; --continue is for a closed loop")
        allow = dict.fromkeys((*program.allow, *([PERSON] if person else [])))
        end_s = _end_s(until, hours, conductor.timeline)
        conductor.continues(LoopContinued(ends_s=round(end_s, 3), allow=list(allow), why="by a person"))

    return resume_loop(path, before=goes_on, **how)
