"""`rig doctor`: checks of bench, disk, clock, machine and notifications before an unattended run.

It asks every instrument for its identity and changes nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rig.bench.bench_file import check_options
from rig.bench.config import BenchConfig, parse_toml, read_text
from rig.bench.contract_files import read_bench
from rig.drivers.clock import RealClock
from rig.errors import RigError, UsageError
from rig.procedures.present.durations import duration
from rig.register import DOCUMENT, Register, parse_register, register_beside
from rig.run_file.live import controller_alive
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import RunState, read_state
from rig.runs.plans import Plan, load_plan, plan_of
from rig.unattended.doctor.disk import check_disk
from rig.unattended.doctor.findings import Finding, Level, ok, problem
from rig.unattended.doctor.instruments import check_due, check_guards, check_instruments, check_stated, check_twins
from rig.unattended.doctor.machine import check_power, check_software
from rig.unattended.doctor.people import check_people
from rig.unattended.doctor.time_of_day import check_clock
from rig.unattended.happenings import RunFacts
from rig.unattended.notify.message import when

__all__ = ["Finding", "Level", "Visit", "examine"]


@dataclass(frozen=True)
class Visit:
    """Inputs of the checks.

    Attributes:
        bench: a bench file.
        procedure: a procedure file.
        run: a run file to be resumed.
        out: the folder for a new run file.
        dry: use twins in place of the instruments.
        world: the world file for the twins.
        notify: send a test message.
        notify_file: a notify.toml in place of the default one.

    """

    bench: Path | None = None
    procedure: Path | None = None
    run: Path | None = None
    out: Path = Path("runs")
    dry: bool = False
    world: Path | None = None
    notify: bool = False
    notify_file: Path | None = None


@dataclass
class _Patient:
    """Results so far, for later checks."""

    config: BenchConfig | None = None
    plan: Plan | None = None
    state: RunState | None = None
    truth: Mapping[str, Any] = field(default_factory=dict)
    dry: bool = False
    left: int | None = None
    end_s: float | None = None


def examine(visit: Visit) -> Iterator[Finding]:
    """Yield every finding as it is made. Raises `UsageError` for options that exclude one another."""
    _check_question(visit)
    now_s = RealClock().utc()
    patient = _Patient(dry=visit.dry)
    for read in (_read_run, _read_files):
        yield from _caught(read(visit, patient), "files")
    if patient.plan is not None:
        yield from _caught(_forecast(patient, now_s), "forecast")
    busy = visit.run is not None and controller_alive(visit.run)
    if patient.config is not None and not busy:
        yield from _caught(_instruments(visit, patient), "bench")
    if patient.config is not None:
        yield from check_guards(patient.config)
        yield from _caught(_calibrations(visit, patient, patient.config, now_s), "register of equipment")
    yield from check_disk(visit.out if visit.run is None else visit.run.parent, patient.left)
    newest = None if patient.state is None or patient.state.simulated else patient.state.utc_s
    yield from check_clock(now_s, patient.end_s, newest)
    yield from check_power()
    yield from check_software()
    yield from check_people(visit.notify_file, _facts(visit, patient), now_s, send=visit.notify)


def _check_question(visit: Visit) -> None:
    if visit.run is not None and visit.procedure is not None:
        raise UsageError("--run has its own procedure: leave --procedure out")
    if visit.procedure is not None and visit.bench is None:
        raise UsageError("--procedure needs the --bench it is to run on")
    if visit.world is not None and not visit.dry:
        raise UsageError("--world describes a simulated bench; it goes with --dry")


def _caught(findings: Iterator[Finding], check: str) -> Iterator[Finding]:
    """The findings of a check; an error ends this check and is its last finding. Other checks continue."""
    try:
        yield from findings
    except RigError as error:
        yield problem(check, str(error), "mend it; rig would end here", int(error.exit_code))


def _read_run(visit: Visit, patient: _Patient) -> Iterator[Finding]:
    if visit.run is None:
        return
    with RunReader.open(visit.run) as reader:
        reader.verify()
        state = patient.state = read_state(reader)
        documents = reader.documents()
        patient.dry = patient.dry or reader.about().runs_dry
    text = f"{visit.run}: chain unbroken, {len(state.accepted)} of {state.points} points, {state.ended or state.rested}"
    if controller_alive(visit.run):
        advice = "rig status shows it; nothing was sent to its instruments"
        yield problem("run file", f"{text}; a controller is running on it", advice)
    elif state.ended is not None:
        yield problem("run file", f"{text}: nothing to resume", "start another run")
    else:
        yield ok("run file", text)
    patient.plan = plan_of(documents, dry=patient.dry, stored=True)
    patient.config, patient.truth, patient.left = patient.plan.bench, patient.plan.truth, state.remaining


def _read_files(visit: Visit, patient: _Patient) -> Iterator[Finding]:
    if visit.bench is None:
        return
    config, _ = read_bench(visit.bench)
    check_options(config, str(visit.bench))
    patient.config = config
    if visit.world is not None:
        patient.truth = parse_toml(read_text(visit.world, "world"), str(visit.world))
    yield ok("bench file", f"{visit.bench}: {config.name}, {len(config.instruments)} instruments")
    if visit.procedure is not None:
        patient.plan = load_plan(visit.procedure, visit.bench, dry=visit.dry, world=visit.world)
        patient.left = len(patient.plan.run_list)
        yield ok("procedure file", f"{visit.procedure}: {patient.plan.procedure.name}, {patient.left} points")


def _forecast(patient: _Patient, now_s: float) -> Iterator[Finding]:
    """Expected duration, by a rehearsal on twins; completed points are subtracted in proportion."""
    from rig.runs.forecast import rehearse  # noqa: PLC0415

    assert patient.plan is not None
    forecast = rehearse(patient.plan, lambda _: None, points=_REHEARSED)
    share = (patient.left or 0) / max(1, len(patient.plan.run_list))
    seconds = forecast.latest_s * share
    speed = patient.plan.bench.live.speed if patient.plan.bench.live else 1.0
    patient.end_s = now_s + seconds / speed
    text = f"{patient.left} points, about {duration(seconds)} with the usual mishaps"
    yield ok("forecast", text if patient.dry else f"{text}: until {when(patient.end_s)}")


_REHEARSED = 60
"""Maximum number of rehearsed points: enough to know the day of the end."""


def _instruments(visit: Visit, patient: _Patient) -> Iterator[Finding]:
    assert patient.config is not None
    known = {} if patient.state is None else patient.state.identities
    if patient.dry:
        world = visit.world if patient.plan is None else patient.plan.world
        yield from check_twins(patient.config, patient.truth, str(world), known)
    else:
        register = None
        with suppress(RigError):  # what is wrong with it is a finding of its own
            register = _register(visit, patient, patient.config)
        yield from check_instruments(patient.config, known, visit.run, register)


def _calibrations(visit: Visit, patient: _Patient, config: BenchConfig, now_s: float) -> Iterator[Finding]:
    """Due dates of calibrations; of the register of a bench file also errors that it lacks, and statements of nothing.

    Without a register that can be read, dates are those of the bench file.
    """
    register = None
    try:
        register = _register(visit, patient, config)
    finally:
        yield from check_due(config, now_s, patient.end_s, register)
    if register is not None and visit.bench is not None:
        yield from check_stated(config, register, now_s)


def _register(visit: Visit, patient: _Patient, config: BenchConfig) -> Register | None:
    """The register of the bench file, or of the run; None if there is none."""
    if visit.bench is not None:
        found = register_beside(config, visit.bench)
        return None if found is None else parse_register(found[1], str(found[0]))
    text = {} if patient.plan is None else patient.plan.documents
    return parse_register(text[DOCUMENT], DOCUMENT) if DOCUMENT in text else None


def _facts(visit: Visit, patient: _Patient) -> RunFacts:
    bench = "" if patient.config is None else patient.config.name
    procedure = "" if patient.plan is None else patient.plan.procedure.name
    simulated = patient.dry or (patient.config is not None and patient.config.simulated)
    return RunFacts(visit.run, "" if patient.state is None else patient.state.run_id, bench, procedure, simulated)
