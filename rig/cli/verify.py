"""`rig verify`: whether a run file is intact, and otherwise what was changed."""

from __future__ import annotations

import contextlib
import dataclasses
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import JsonOption, RunArgument
from rig.cli.show import mark, out, print_json
from rig.errors import ExitCode, RunFileError, UsageError
from rig.lab import laboratory_of
from rig.procedures.present.shell import shell_word
from rig.run_file.approval import DOCUMENT as APPROVAL
from rig.run_file.approval import Approval
from rig.run_file.damage.audit import Finding
from rig.run_file.damage.proven import Other
from rig.run_file.read.reader import RunReader
from rig.run_file.state.elsewhere import goes_on_in
from rig.run_file.state.state import RunState, read_state
from rig.run_file.verify.verification import LOOP_SUFFIX, Verification, restored, verify_file

if TYPE_CHECKING:
    from rig.verbs.certificate.seals import Checked


@app.command()
def verify(
    run_file: RunArgument,
    head: Annotated[
        str | None,
        typer.Option(
            help="a head hash noted elsewhere (end of a run, its log or message, a report): exit 1 if the file has "
            "changed since, also by removed records or recomputed hashes; "
            "with --restore: only a chain that has it is restored"
        ),
    ] = None,
    restore: Annotated[
        Path | None,
        typer.Option(
            help="write the still provable records of a damaged file, from the first on, to this new run file",
            show_default=False,
        ),
    ] = None,
    sealed_by: Annotated[
        list[Path] | None,
        typer.Option(
            help="public key, PEM, of the expected sealer; exit 1 if it made no seal; repeatable",
            show_default=False,
        ),
    ] = None,
    authority: Annotated[
        Path | None,
        typer.Option(help="certificates, PEM, of the authorities whose time stamps are trusted", show_default=False),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Check that a run file is intact and its contents are consistent; report changes and their places.

    If all hashes were recomputed consistently, only a head hash noted elsewhere shows the change: use --head; or a seal
    (`rig seal`), with the public key of the sealer: --sealed-by. Exit code 0: intact, a given head is the hash of one
    of its records, and every seal holds; 1: broken, inconsistent, another head, or a seal that does not hold.

    Examples:

    - `rig verify runs/20260115T180000-night-1a2b.sqlite`
    - `rig verify RUN --head 3f7a9c0d51e2b846`
    - `rig verify DAMAGED.sqlite --restore NEW.sqlite`
    """
    if head is not None and not re.fullmatch("[0-9a-f]{8,64}", head := head.strip().lower()):
        raise UsageError(
            f"--head {head}: a head hash is 8 to 64 hexadecimal digits, as `rig verify` and reports print it"
        )
    if restore is not None:
        return _restore(run_file, restore, head, as_json)
    found = verify_file(run_file, head)
    if found.whole and run_file.name.endswith(LOOP_SUFFIX):
        from rig.loop import findings_of_runs, open_program  # noqa: PLC0415 - few files are loops

        of_runs = tuple(findings_of_runs(open_program(run_file)))
        found = dataclasses.replace(found, findings=of_runs)
    if found.whole:
        found = _with_approval(run_file, found)
    seals = _seals(run_file, authority, sealed_by or [])
    if as_json:
        _print_json(found, seals)
    else:
        _print_text(found, seals)
    if found.whole:
        return _sealed(run_file, seals, asked=bool(sealed_by))
    raise RunFileError(_way_forward(run_file, found))


def _with_approval(run_file: Path, found: Verification) -> Verification:
    """A verification, with what the laboratory's log says of the run's approval."""
    with RunReader.open(run_file) as reader:
        text = reader.documents().get(APPROVAL)
    if text is None:
        return found
    from rig.lab.proposals import findings_of_approval  # noqa: PLC0415 - few runs are approved

    approval, laboratory = Approval.of(text), laboratory_of(run_file)
    said = f"proposed by {approval.proposed_by}, approved by {approval.approved_by} (proposal {approval.proposal})"
    if laboratory is None:
        note = f"{said}; the laboratory's log is not here, and was not compared"
        return dataclasses.replace(found, notes=(*found.notes, note))
    wrong = tuple(Finding("approval", one) for one in findings_of_approval(laboratory, approval))
    notes = found.notes if wrong else (*found.notes, f"{said}, as {laboratory.log_file} says")
    return dataclasses.replace(found, findings=wrong, notes=notes)


def _seals(run_file: Path, authority: Path | None, keys: list[Path]) -> tuple[Checked, ...]:
    """The seals beside a run file, checked."""
    from rig.verbs.certificate.seals import checked, stored  # noqa: PLC0415 - few files have any

    if not stored(run_file):
        return ()
    with contextlib.ExitStack() as stack:
        try:
            reader = stack.enter_context(RunReader.open(run_file))
        except RunFileError:  # told by the verification
            return ()
        return checked(run_file, reader.holds, authority, keys)


def _sealed(run_file: Path, seals: tuple[Checked, ...], *, asked: bool) -> int:
    """Exit code of a whole file by its seals. Raises `RunFileError` if one does not hold, or none has an asked key."""
    wrong = next((one for one in seals if not one.holds), None)
    if wrong is not None:
        raise RunFileError(f"a seal of {run_file} does not prove it: {wrong.words}")
    if asked and not any(one.key for one in seals):
        raise RunFileError(f"{run_file} has no seal by the given key")
    return ExitCode.DONE


def _restore(damaged: Path, new: Path, head: str | None, as_json: bool) -> int:
    found = restored(damaged, new, head or "")
    whole = verify_file(new, head)
    # its contents had the same inconsistency before
    broken = [finding for finding in whole.findings if finding.where != "sense"]
    if broken:
        raise RunFileError(f"{new} was written and is not whole: {broken[0]}. Do not use it")
    with RunReader.open(new) as reader:
        state = read_state(reader)
        other = goes_on_in(reader, state, damaged) or (Path(state.rescued) if state.rescued else None)
    if as_json:
        others = [dataclasses.asdict(one) for one in found.others]
        said = {"file": str(new), "records": found.records, "known": found.known, "points": len(state.accepted)}
        print_json({**said, "head": whole.head, "goes_on_in": str(other) if other else None, "others": others})
        return ExitCode.DONE
    out.print(
        f"{mark(state.simulated)}{escape(str(new))}: {found.records} records, each proven by its hash, of "
        f"{found.known} known; {len(state.accepted)} of {state.points} points",
        soft_wrap=True,
    )
    for note in (
        *map(str, whole.findings),
        *whole.notes,
        *(_not_restored(damaged, one) for one in found.others),
        _next(new, state, other),
    ):
        if note:
            out.print(f"  {escape(note)}", soft_wrap=True)
    return ExitCode.DONE


def _next(new: Path, state: RunState, other: Path | None) -> str:
    """Next step for a restored file."""
    if state.ended is not None:
        return ""
    if other is None:
        return f"measure again what is missing: rig resume {shell_word(new)}"
    if other.is_file():
        return (
            f"the run goes on in {other}, which has the missing records: rig resume "
            f"{shell_word(other)}; never resume both"
        )
    return f"the run goes on in {other}, which does not exist: look for it before you resume {new}; never resume both"


def _not_restored(damaged: Path, one: Other) -> str:
    ended = ", to its end" if one.ended else ""
    what = (
        f"this run with a different continuation after record {one.same_until}"
        if one.same_until
        else f"another run, {one.run or 'without a name'}"
    )
    way = f"rig verify {shell_word(damaged)} --restore OTHER.sqlite --head {one.head[:16]}"
    return f"not restored: {what}, {one.records} records{ended}: {way}"


def _way_forward(path: Path, found: Verification) -> str:
    more = f" ({len(found.findings)} findings in all)" if len(found.findings) > 1 else ""
    if all(finding.where == "sense" for finding in found.findings):
        return (
            f"every hash of {path} is correct, but no controller writes such contents: {found.findings[0]}{more}. "
            f"It was changed and its hashes were recomputed, or rig has a defect: do not use its results. Keep it "
            f"as it is, and compare it with a copy from before, or with a head that was noted elsewhere (`--head`)"
        )
    return (
        f"{path} was edited or damaged: {found.findings[0]}{more}. Keep it as it is. "
        f"A copy from before the damage can be fitted and resumed; "
        f"`rig verify {shell_word(path)} --restore NEW.sqlite` saves the provable beginning, which "
        f"can be fitted and resumed; "
        f"`rig export {shell_word(path)} --salvage --out DATA.csv` saves the observations that can still be read, "
        f"which are not verified"
    )


def _print_json(found: Verification, seals: tuple[Checked, ...]) -> None:
    print_json(
        {
            "file": str(found.path),
            "whole": found.whole,
            "simulated": found.simulated,
            "records": found.records,
            "head": found.head,
            "findings": [dataclasses.asdict(finding) for finding in found.findings],
            "notes": list(found.notes),
            "seals": [dataclasses.asdict(one) for one in seals],
        }
    )


def _print_text(found: Verification, seals: tuple[Checked, ...]) -> None:
    start = f"{mark(bool(found.simulated))}{escape(str(found.path))}: {found.records} records"
    if found.whole:
        out.print(f"{start}, chain unbroken, head {found.head}", soft_wrap=True)
    else:
        out.print(f"{start}, [bold red]NOT WHOLE[/], head {found.head or 'unknown'}", soft_wrap=True)
    for finding in found.findings:
        out.print(f"  {escape(str(finding))}", soft_wrap=True)
    for note in (*found.notes, *(one.words for one in seals)):
        out.print(f"  {escape(note)}", soft_wrap=True)
