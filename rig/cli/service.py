"""`rig service`: the systemd unit that continues a run."""

from __future__ import annotations

import getpass
import os
import pwd
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from rig.bench.config import parse_bench, read_text
from rig.bench.contract_files import bench_of_run
from rig.cli.commands import app
from rig.cli.options import RunArgument
from rig.cli.show import err
from rig.cli.unattended import facts_of
from rig.errors import ExitCode, RigError, UsageError
from rig.files.atomic import write_whole
from rig.procedures.present.shell import shell_word
from rig.run_file.live import controller_alive
from rig.run_file.read.reader import RunReader
from rig.run_file.state.elsewhere import goes_on_in
from rig.run_file.state.state import RunState
from rig.run_file.verify.verification import LOOP_SUFFIX
from rig.unattended import RunFacts
from rig.unattended.systemd_unit import WATCHDOG_S, ServiceUnit, patience_s


@app.command()
def service(
    run_file: RunArgument,
    install: Annotated[bool, typer.Option("--install", help="write the unit to systemd's folder")] = False,
    remove: Annotated[bool, typer.Option("--remove", help="remove the unit")] = False,
    system: Annotated[
        bool | None,
        typer.Option(
            "--system/--user", help="unit of the machine (default for root) or of the user", show_default=False
        ),
    ] = None,
    run_as: Annotated[str, typer.Option(help="user of a unit of the machine", show_default="you")] = "",
    bench: Annotated[
        Path | None, typer.Option(help="a bench file with new addresses, as for rig resume", show_default=False)
    ] = None,
    watchdog: Annotated[
        float | None,
        typer.Option(
            min=60, max=86400, help="seconds without a sign of life before a restart", show_default="by the bench"
        ),
    ] = None,
    writes_to: Annotated[
        list[Path] | None,
        typer.Option(help="another folder that a unit of the machine may write to (a log); repeatable"),
    ] = None,
) -> int:
    """Print, install or remove the systemd unit that continues a run after a crash, a hang or a power cut.

    The run file comes from `rig run ... --create-only`, or from an interrupted run. There is no unit for a run that is
    complete (exit 2), broken (1) or stopped by a person (4).

    Examples:

    - `rig service runs/ID.sqlite`
    - `rig service runs/ID.sqlite --install`
    - `rig service runs/ID.sqlite --remove`
    """
    if run_as:
        _check_user(run_as)
    if install and remove:
        raise UsageError("--install or --remove, not both")
    if not remove and (refused := _refused(run_file)) is not None:
        return refused
    facts = _facts(run_file, remove=remove)
    as_root = os.geteuid() == 0
    unit = ServiceUnit(
        run=run_file.resolve(),
        run_id=facts.run_id,
        about=f"{facts.procedure} on {facts.bench}",
        system=as_root if system is None else system,
        user=run_as or os.environ.get("SUDO_USER") or getpass.getuser(),
        watchdog_s=WATCHDOG_S if remove else watchdog or _patience_s(run_file),
        bench=None if bench is None else bench.resolve(),
        also_write=tuple(path.resolve() for path in writes_to or ()),
        addresses=() if remove else _addresses(run_file, bench),
    )
    if not remove:
        unit.check_paths()
    if unit.system and unit.user == "root" and not remove:
        raise UsageError(
            "a controller does not need root: name its user with --run-as USER, who can use the "
            "instruments' ports (on most machines a member of the group dialout) and write to the run's folder"
        )
    if remove:
        _remove(unit)
    elif install:
        _install(unit)
    else:
        print(unit.text(), end="")
    return ExitCode.DONE


def _check_user(name: str) -> None:
    """Raise `UsageError` for a user unknown to this machine, because systemd could not start the unit."""
    try:
        pwd.getpwuid(int(name)) if name.isdecimal() else pwd.getpwnam(name)
    except (KeyError, ValueError, OverflowError) as error:
        raise UsageError(f"--run-as {name}: there is no such user on this machine; getent passwd lists them") from error


def _refused(run_file: Path) -> ExitCode | None:
    """Exit code if a service could not continue the run, after a message; None if it can.

    Raises:
        RunFileError: the file is broken and cannot be resumed.
        UsageError: the run is complete.
    """
    if run_file.name.endswith(LOOP_SUFFIX):
        from rig.loop import open_program  # noqa: PLC0415 - few files are loops

        if open_program(run_file).closed is not None:
            raise UsageError(f"{run_file} is closed: there is nothing to continue")
    state = RunState()
    with RunReader.open(run_file) as reader:
        reader.verify(state.add)
        other = goes_on_in(reader, state)
    name, stands = escape(str(run_file)), f"{len(state.accepted)} of {state.points} points"
    if state.ended is not None:
        raise UsageError(f"{run_file} is {state.ended} ({stands}): there is nothing to continue")
    if other is not None:
        raise UsageError(
            f"{run_file} was moved or replaced during the run, which continues: rig service {shell_word(other)}"
        )
    if controller_alive(run_file):
        what = f"a controller is running on it ({stands}); the service can begin when that has ended"
        err.print(f"{name}: {what}", soft_wrap=True)
    elif state.rested == "stopped":
        why = "a service does not resume it"
        err.print(
            f"{name} was stopped by a person ({stands}): {why}; rig resume {escape(shell_word(run_file))} continues it",
            soft_wrap=True,
        )
        return ExitCode.STOPPED
    else:
        why = f": {state.last_fault}" if state.rested == "faulted" else ""
        err.print(f"{name}: {state.rested}, {stands}{escape(why)}", soft_wrap=True)
    return None


def _facts(run_file: Path, *, remove: bool) -> RunFacts:
    """Facts about the run; a unit can be removed even if its run file is broken or missing."""
    try:
        return facts_of(run_file)
    except RigError:
        if not remove:
            raise
        return RunFacts(run_file, run_file.stem, "", "", simulated=False)


def _patience_s(run_file: Path) -> float:
    with RunReader.open(run_file) as reader:
        documents = reader.documents()
    return WATCHDOG_S if "bench.toml" not in documents else patience_s(bench_of_run(documents, str(run_file)))


def _addresses(run_file: Path, bench: Path | None) -> tuple[str, ...]:
    """Addresses of the bench of the service; none for a dry run."""
    with RunReader.open(run_file) as reader:
        text, dry = reader.documents().get("bench.toml"), reader.about().runs_dry
    if bench is not None:
        config = parse_bench(read_text(bench, "bench"), str(bench))
    elif text is None or dry:
        return ()
    else:
        config = parse_bench(text, f"{run_file} (bench.toml)", strict=False)
    return tuple(instrument.address for instrument in config.instruments.values())


def _install(unit: ServiceUnit) -> None:
    try:
        unit.path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(unit.path, lambda file: file.write(unit.text()))
    except OSError as error:
        raise UsageError(
            f"{unit.path} cannot be written: {error.strerror}; with --user it needs no rights, or use sudo"
        ) from error
    print(unit.path)
    err.print("installed; now:")
    for step in unit.next_steps():
        err.print(f"  {escape(step)}", soft_wrap=True)


def _remove(unit: ServiceUnit) -> None:
    control = "systemctl" if unit.system else "systemctl --user"
    try:
        unit.path.unlink()
    except FileNotFoundError:
        raise UsageError(f"{unit.path} does not exist") from None
    except OSError as error:
        raise UsageError(f"{unit.path} cannot be removed: {error.strerror}") from error
    err.print(f"removed {escape(str(unit.path))}; now: {control} daemon-reload", soft_wrap=True)
    err.print(f"a running controller continues; {control} stop {escape(unit.name)} ends it", soft_wrap=True)
