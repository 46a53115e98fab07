"""Starting and resuming runs: checks files, opens and locks the bench, starts the sequencer.

`rig run` is create + resume: a new run and an interrupted one differ only in the contents of the run file.
"""

from __future__ import annotations

import contextlib
import os
import platform
import re
import secrets
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.bench.bench_file import check_options
from rig.drivers.clock import Clock, RealClock, ScaledClock, boot_id
from rig.drivers.errors import DriverError
from rig.engine.axes_of_bench import own_limits
from rig.engine.gap import Gap, gap_since
from rig.engine.guard import Guard
from rig.engine.holes import WatchedClock
from rig.engine.sequencer import Sequencer
from rig.engine.session import Nobody, Observer, Outcome, Progress, Session, Signals
from rig.engine.states import State
from rig.errors import BenchFault, UsageError
from rig.files.disk_space import check_may_write, check_room
from rig.files.regular import real_path
from rig.instruments.locks import locked_addresses
from rig.instruments.opening import Bench, identities, open_bench
from rig.instruments.person_at_bench import ServedBench
from rig.procedures.present.shell import shell_word
from rig.register import DOCUMENT
from rig.run_file.approval import DOCUMENT as APPROVAL
from rig.run_file.approval import defect, digests_of
from rig.run_file.bodies import COUNT
from rig.run_file.live import controller_alive, live_path, read_json
from rig.run_file.read.reader import RunReader
from rig.run_file.state.elsewhere import goes_on_in
from rig.run_file.state.state import RunState, fold
from rig.run_file.write.creation import Genesis, create
from rig.run_file.write.writer import RunWriter
from rig.runs.plans import PREVIOUS, Plan, stored_plan
from rig.version import versions
from rig.who import Operator, operator

if TYPE_CHECKING:
    from rig.procedures.kind import Procedure

"""Key in the first record of a dry run: age of its world at the begin of the run, if it was not new."""

VIRTUAL = "virtual"
"""Replaces the boot id under virtual time: its clock is continuous across sessions."""


@dataclass(frozen=True)
class Result:
    """Result of a session.

    Attributes:
        path: the run file.
        outcome: how it ended.
        message: the reason, "" if none is needed.
        state: state of the run.
        procedure: the procedure, None if the run was complete before.
        head: hash of the run file's last record, hexadecimal.
        parked: whether the bench was parked at the end.
    """

    path: Path
    outcome: Outcome
    message: str
    state: RunState
    procedure: Procedure | None
    head: str = ""
    parked: bool = False


def _world(plan: Plan) -> Mapping[str, Any]:
    """The world of a dry run, on a day that the register covers, with the package mounted as the procedure requires."""
    from rig.simulated.calendar import dated  # noqa: PLC0415 - a real run never loads the simulation

    truth = dated(plan.truth, plan.bench, plan.documents.get(DOCUMENT))
    mounting = plan.procedure.conduct.mounting
    if not any(mounting.values()):
        return truth
    return {**truth, "mounting": {**truth.get("mounting", {}), **mounting}}


def bench_clock(plan: Plan) -> tuple[Clock, str]:
    """The clock of a bench that is no dry one, and the identifier of this boot."""
    live = plan.bench.live
    clock = WatchedClock(ScaledClock(live.speed, live.epoch_utc, live.started_utc) if live else RealClock())
    return clock, f"{boot_id()}*{live.speed:g}" if live else boot_id()


@contextlib.contextmanager
def opened(plan: Plan, *, start: float = 0.0, held: bool = False) -> Iterator[tuple[Bench, Clock, str]]:
    """The bench of a plan, opened and locked (unless this process has locked it: `held`), with its clock and the
    identifier of this boot.

    Raises:
        BenchFault: an instrument cannot be reached.
        BusyError: another controller has one of the addresses.
    """
    if plan.dry:
        from rig.simulated.dry_run import DryBench  # noqa: PLC0415 - a real run never loads the simulation

        dry = DryBench(plan.bench, _world(plan), start=start, where=plan.world)
        bench = open_bench(dry.config, check_options(dry.config, "bench"), dry.clock, dry.wires)
        bench.person = dry.person
        try:
            with dry.checked():
                yield bench, dry.clock, VIRTUAL
        finally:
            bench.close()
            dry.close()
        return
    from rig.drivers.wires import Wires  # noqa: PLC0415

    live = plan.bench.live
    clock, boot = bench_clock(plan)
    with contextlib.nullcontext() if held else locked_addresses(plan.bench.instruments):
        bench = open_bench(plan.bench, check_options(plan.bench, "bench"), clock, Wires(clock))
        if live is not None and live.by_hand:
            bench.person = ServedBench(live.by_hand)
        try:
            yield bench, clock, boot
        finally:
            bench.close()


@dataclass(frozen=True)
class Site:
    """Environment of a controller: how its bench is opened, and its file system. Fault campaigns have their own.

    Attributes:
        opened: opens the bench of a plan at `start`; see `opened`.
        vfs: the SQLite VFS of run files, "" for the machine's own.
    """

    opened: Callable[..., AbstractContextManager[tuple[Bench, Clock, str]]] = opened
    vfs: str = ""


def start_run(
    plan: Plan,
    folder: Path,
    *,
    signals: Signals,
    announce: Callable[[Path], None],
    on_progress: Callable[[Progress], None],
    world_start_s: float = 0.0,
    observer: Observer | None = None,
    create_only: bool = False,
    site: Site = Site(),
    by: Operator | None = None,
    run_id: str = "",
) -> Result:
    """Create a run in `folder` and carry it out.

    Every instrument is asked for its identity before the run file is created, so that a missing bench leaves nothing
    behind. `announce` is called with the run file's path as soon as it exists. A dry run's world may be older than the
    run: `world_start_s` is its time, in seconds, at the begin of the run. `observer` is called with every record. With
    `create_only` nothing is carried out: a later resume does that. `by` is the operator's name, by default the login
    name. `run_id` names the run; by default its name has the time of its begin.
    """
    by = by or operator()
    permission = plan.permission()
    check_room(folder, len(plan.run_list))
    with site.opened(plan, start=world_start_s) as (bench, clock, boot):
        guard = Guard(plan.bench.limits, plan.bench.factors)
        guard.check_run_list(plan.run_list, own_limits(bench, plan.run_list))
        environment = plan.procedure.conduct.environment
        if environment is not None:
            own = {name: chamber.limits() for name, chamber in bench.chambers.items()}
            guard.check_environment(environment.setpoint_degC, own)
        try:
            identities(bench)
        except DriverError as error:
            raise BenchFault(str(error)) from error
        run_id = run_id or new_id(plan.procedure.name)
        path = folder / f"{run_id}.sqlite"
        software = versions(one.driver for one in plan.bench.instruments.values())
        about = {"dry": plan.dry, "software": software, "procedure": plan.procedure.name, "bench": plan.bench.name}
        about |= by.as_json()
        if world_start_s:
            about["world_start_s"] = world_start_s
        documents = dict(plan.documents)
        if permission is not None:
            documents[APPROVAL] = permission.use(run_id, by.name)
        genesis = Genesis(run_id, documents, plan.run_list, plan.dry or plan.bench.simulated, about)
        create(path, genesis, elapsed_s=0.0, utc_s=clock.utc(), vfs=site.vfs)
        announce(path)
        if create_only:
            with RunReader.open(path) as reader:
                state, head = fold(reader.records()), reader.head()[1].hex()
                return Result(path, Outcome.INTERRUPTED, "created; nothing has moved", state, None, head)
        with RunWriter.open(path, vfs=site.vfs) as run:
            state = fold(run.records())
            return _session(run, state, plan, bench, clock, boot, frozenset(), signals, on_progress, observer, by)


def resume_run(
    path: Path,
    *,
    signals: Signals,
    on_progress: Callable[[Progress], None],
    bench: Path | None = None,
    accept: frozenset[str] = frozenset(),
    dry_gap_s: float = 120.0,
    warn: Callable[[str], None] = lambda _: None,
    observer: Observer | None = None,
    site: Site = Site(),
    by: Operator | None = None,
) -> Result:
    """Resume a run from its last state.

    Args:
        path: the run file.
        signals: checked at every wait of the sequencer.
        on_progress: called with the progress at every change of state, and about once a second of bench time.
        bench: another bench file, for instruments that have moved to other addresses.
        accept: names of instruments that may have been exchanged.
        dry_gap_s: for a dry run, the gap since the last session, bench seconds.
        warn: called with a sentence for every loss of durable records.
        observer: called with every record.
        site: environment of the controller.
        by: the operator's name, by default the login name.
    """
    by, path = by or operator(), real_path(path)
    with RunReader.open(path) as reader:  # a finished run is opened read-only
        head, state = reader.head(), RunState()
        reader.verify(state.add)
        if state.ended is not None:
            plan = stored_plan(reader, path, None)
            if not controller_alive(path):  # which was killed after the end of the run, and before its last step
                with contextlib.suppress(OSError):
                    live_path(path).unlink(missing_ok=True)
            said = f"{path} is complete: nothing to resume"
            return Result(path, Outcome.COMPLETE, said, state, plan.procedure, head[1].hex())
        other = goes_on_in(reader, state)
        if other is not None:
            raise UsageError(
                f"{path} was moved or replaced during the run, which continues: rig resume {shell_word(other)}"
            )
        if state.rescued:
            warn(f"{path} continues in {state.rescued}, which does not exist: it continues here now; never resume both")
    check_may_write(path)
    done = (read_json(live_path(path)) or {}).get("done")
    told = done if isinstance(done, int) and COUNT.holds(done) else 0  # a file like any other, and not trusted
    with RunWriter.open(path, vfs=site.vfs, verified=head) as run:
        if run.head() != head:
            state = fold(run.records())
        for warning in _losses(run, state, told):
            warn(warning)
        plan = stored_plan(run, path, bench)
        unknown = sorted(accept - set(plan.bench.instruments))
        if unknown:
            known = ", ".join(sorted(plan.bench.instruments))
            raise UsageError(f"--accept {unknown[0]}: this bench has no such instrument (known: {known})")
        if plan.needs_approval:
            _check_approved(run)
        check_room(path, state.remaining)
        hint, before = "" if bench else _moved(plan, path), len(state.accepted)
        try:
            began_s = run.about().world_start_s or 0.0
            with site.opened(plan, start=began_s + state.elapsed_s + dry_gap_s) as (found, clock, boot):
                result = _session(
                    run, state, plan, found, clock, boot, accept, signals, on_progress, observer, by, warn
                )
        except BenchFault as error:
            raise BenchFault(f"{error}{hint}") from error
        served_anew = plan.bench.live is not None and len(state.accepted) == before
        if served_anew and result.outcome in (Outcome.FAULT, Outcome.UNSAFE):
            return replace(result, message=f"{result.message}{hint}")
        return result


def _check_approved(run: RunReader) -> None:
    """Refuse to go on with a run that was not approved. Raises `UsageError`."""
    about, documents = run.about(), run.documents()
    why = defect(documents.get(APPROVAL), digests_of(documents), about.run_list, about.run_id)
    if why:
        raise UsageError(f"{run.path} {why}: begin a run that is approved (rig propose)")


def _moved(plan: Plan, path: Path) -> str:
    """Advice if the instruments answer at other addresses than those in the run file."""
    if plan.dry:
        return ""
    if plan.bench.live is not None:
        return (
            f"\nThe run began on a bench of `rig sim`; if that was started again: rig resume "
            f"{shell_word(path)} --bench LIVE.toml"
        )
    return (
        f"\nIf it has another address now, correct it in the bench file; then: rig resume "
        f"{shell_word(path)} --bench BENCH"
    )


def _losses(run: RunWriter, state: RunState, told: int) -> Iterator[str]:
    """Records lost since the last session: by the checksums of the log, and by the last reported state."""
    log = run.dropped
    if log.lost_commits:
        yield (
            f"the log of {run.path} is damaged ({log.damage}): {log.lost_commits} record(s) that had been written "
            f"are lost; points without an observation are measured again"
        )
    missing = told - len(state.accepted) - len(state.skipped)
    if missing > 0:
        yield (
            f"the last session had {told} points done, {run.path} holds {told - missing}: {missing} are lost "
            f"(was its -wal file removed?) and are measured again"
        )


def _session(
    run: RunWriter,
    state: RunState,
    plan: Plan,
    bench: Bench,
    clock: Clock,
    boot: str,
    accept: frozenset[str],
    signals: Signals,
    on_progress: Callable[[Progress], None],
    observer: Observer | None,
    by: Operator,
    warn: Callable[[str], None] = lambda _: None,
) -> Result:
    previous = None
    if PREVIOUS in plan.documents:
        from rig.runs.previous import parse_previous  # noqa: PLC0415

        previous = parse_previous(plan.documents[PREVIOUS], str(run.path))
    gap = Gap(run.about().world_start_s or 0.0) if boot == VIRTUAL else gap_since(state, clock, boot)
    if gap.warning:
        warn(gap.warning)
    session = Session(
        elapsed_origin=gap.origin,
        number=state.sessions + 1,
        gap_certain=gap.certain,
        gap_known=gap.known,
        accept=accept,
        about={
            **by.as_json(),
            "simulated": plan.dry or plan.bench.simulated,
            "pid": os.getpid(),
            "host": platform.node(),
            "boot": boot,
            "software": versions(one.driver for one in plan.bench.instruments.values()),
        },
        observer=observer or Nobody(),
    )
    sequencer = Sequencer(
        bench=bench,
        run=run,
        state=state,
        run_list=plan.run_list,
        conduct=plan.procedure.conduct,
        clock=clock,
        session=session,
        signals=signals,
        on_progress=on_progress,
        previous=previous,
    )
    outcome = sequencer.run()
    parked = sequencer.state is State.DONE
    return Result(run.path, outcome, sequencer.message, state, plan.procedure, run.written[1].hex(), parked)


def new_id(name: str) -> str:
    """A name for a new run of this procedure: time of its begin, procedure, and four random digits."""
    slug = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:40] or "run"
    moment = datetime.fromtimestamp(RealClock().utc(), UTC)
    return f"{moment:%Y%m%dT%H%M%S}-{slug}-{secrets.token_hex(2)}"
