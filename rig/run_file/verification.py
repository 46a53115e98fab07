"""A run file held against itself, against what was last said of it, and against a head hash written down elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from procedures.run_list import RunList
from rig.config import parse_procedure
from rig.errors import RigError, RunFileError, UsageError
from rig.regular import real_path
from rig.run_file import wal
from rig.run_file.audit import Finding, findings
from rig.run_file.beside import ForeignFileError, check_journal
from rig.run_file.elsewhere import goes_on_in
from rig.run_file.last_word import read_last_word
from rig.run_file.live import controller_alive
from rig.run_file.opening import check_header
from rig.run_file.reader import RunReader
from rig.run_file.restored import Restored, restore
from rig.run_file.saved import saved_in
from rig.run_file.sense import Judged, judged
from rig.run_file.state import RunState, read_state

MOST = 1000
"""So many findings are told at most."""

_SURE = 16
"""Digits of a head hash below which another file with the same ones can be found by trying."""

CUT_SHORT = ("head", "log")
"""Findings about records that are not there any more: what is there holds, and a resume goes on from it."""


@dataclass(frozen=True)
class Verification:
    """What a run file is found to be.

    Attributes:
        path: the file.
        records: how many it holds, 0 if it cannot be opened.
        head: hash of the last record.
        simulated: whether no real instrument was involved, None if that cannot be known.
        findings: what is wrong; empty if the file is whole.
        notes: what is worth knowing and not wrong.

    """

    path: Path
    records: int
    head: str
    simulated: bool | None
    findings: tuple[Finding, ...]
    notes: tuple[str, ...]

    @property
    def whole(self) -> bool:
        """Whether nothing is wrong."""
        return not self.findings


def verify_file(path: Path, expected_head: str | None = None) -> Verification:
    """Look at everything that can be known of a run file; changes nothing.

    Args:
        path: the run file.
        expected_head: the head hash as printed in a report or by an earlier look, hexadecimal, lower case.

    Raises:
        UsageError: this is no run file.
        ForeignFileError: what lies beside it is not its own.

    """
    path = real_path(path)
    check_header(path)
    check_journal(path)
    working = controller_alive(path)
    log = wal.WalState(0, 0, 0, "") if working else wal.inspect(path)
    try:
        with RunReader.open(path) as run:
            found, state = [], RunState()
            for finding in findings(run, thorough=True, expand=_expanded, each=state.add):
                found.append(finding)
                if len(found) == MOST:
                    found.append(Finding("file", f"there is more; the first {MOST} findings are told"))
                    break
            if found:
                run.must_be_its_log()
            sense = Judged((), ()) if found else judged(run, MOST)  # of what was changed otherwise no sense is asked
            found += [*sense.findings, *_cut_off(run, path, log)]
            heads, notes = _held_against(run, expected_head)
            notes += sense.doubts
            notes += _elsewhere(run, state) if all(f.where in (*CUT_SHORT, "sense") for f in found) else []
            count, head = run.head()
            simulated = _simulated(run)
    except ForeignFileError:
        raise  # what it says to do comes before anything else
    except RunFileError as error:
        return Verification(path, 0, "", None, (Finding("file", str(error).split(". ", 1)[0]),), saved_in(path))
    if found:
        notes += [note for note in saved_in(path) if note not in notes]
    if working:
        notes.append("a controller is at work on it: this is how it stood a moment ago")
    return Verification(path, count, head.hex(), simulated, (*found, *heads), tuple(notes))


def glance(path: Path, most: int) -> tuple[RunReader, RunState, Finding | None, bool]:
    """Open a run file to tell what it has come to, and look whether it is whole while its records are read anyway.

    Args:
        path: the run file.
        most: a file of more records is not looked at more closely, which would take seconds.

    Returns:
        the reader, which the caller closes; the state; what is wrong first, None if nothing is known to be; whether
        it was looked for.

    Raises:
        RunFileError: it cannot be read at all.
        UsageError: this is no run file.

    """
    path = real_path(path)
    check_header(path)
    check_journal(path)
    log = wal.WalState(0, 0, 0, "") if controller_alive(path) else wal.inspect(path)
    run = RunReader.open(path)
    try:
        if run.head()[0] > most:
            return run, read_state(run), next(iter(_cut_off(run, path, log)), None), False
        state = RunState()
        wrong = next(findings(run, thorough=False, each=state.add), None)
        if wrong is not None:
            run.must_be_its_log()
            return run, read_state(run), wrong, True
        return run, state, next(iter(_cut_off(run, path, log)), None), True
    except BaseException:
        run.close()
        raise


def _elsewhere(run: RunReader, state: RunState) -> list[str]:
    other = goes_on_in(run, state) or state.rescued
    return [f"it was moved or replaced while it was written; the run goes on in {other}"] if other else []


def restored(path: Path, to: Path, head: str = "") -> Restored:
    """What a damaged run file still proves, in a new one; see `rig.run_file.restored.restore`."""
    path = real_path(path)
    if controller_alive(path):
        raise UsageError(f"a controller is at work on {path}: nothing to restore while it writes")
    return restore(path, to, _expanded, head)


def _expanded(documents: Mapping[str, str]) -> RunList | None:
    """The run list that the stored procedure makes; None if this version of rig makes none of it."""
    try:
        return parse_procedure(documents["procedure.toml"], "procedure.toml", strict=False).expand()
    except (RigError, KeyError):  # whatever is wrong with a stored procedure, its digest tells whether it was changed
        return None


def _simulated(run: RunReader) -> bool | None:
    try:
        return run.about().simulated
    except RunFileError:
        return None


def _cut_off(run: RunReader, path: Path, log: wal.WalState) -> list[Finding]:
    """What had been written and is not there any more."""
    last = read_last_word(path)
    if last is not None:
        if run.holds(*last):
            return []
        count, _ = run.head()
        missing = (
            f"its last {last[0] - count} record(s) are missing" if last[0] > count else f"record {last[0]} differs"
        )
        return [Finding("head", f"{missing}: {path.stem}.head beside it says that it had {last[0]} records")]
    if log.lost_commits:
        return [Finding("log", f"{log.damage}: {log.lost_commits} transaction(s) in {path.name}-wal cannot be read")]
    return []


def _held_against(run: RunReader, expected: str | None) -> tuple[list[Finding], list[str]]:
    if expected is None:
        return [], []
    for seq, _, _, own in run.chained():
        if own.hex().startswith(expected):
            count, _ = run.head()
            more, notes = count - seq, []
            if more:
                notes.append(
                    f"the head given is that of record {seq}; {more} record(s) follow it, of which it says nothing"
                )
            else:
                notes.append("the head given is that of the last record: it is unchanged since that was noted")
            if len(expected) < _SURE:
                notes.append(
                    f"{len(expected)} of 64 digits were compared: by trying, another file with the same ones can be "
                    f"made; give {_SURE} or more"
                )
            return [], notes
    what = f"no record has the hash {expected}: records were cut off at the end, or the chain was written again"
    return [Finding("head", what)], []
