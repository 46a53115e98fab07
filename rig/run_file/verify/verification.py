"""Verification of a run file: against itself, against `RUN.head`, and against a head hash noted elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rig.bench.config import parse_procedure
from rig.errors import RigError, RunFileError, UsageError
from rig.files.regular import real_path
from rig.procedures.plan.run_list import RunList
from rig.run_file import wal
from rig.run_file.damage.audit import Finding, findings
from rig.run_file.last_word import read_last_word
from rig.run_file.live import controller_alive
from rig.run_file.read.beside import ForeignFileError, check_journal
from rig.run_file.read.reader import RunReader
from rig.run_file.read.safe_opening import check_header
from rig.run_file.saved import saved_in
from rig.run_file.state.elsewhere import goes_on_in
from rig.run_file.state.state import RunState, read_state
from rig.run_file.verify.restored import Restored, restore
from rig.run_file.verify.sense import Judged, judged

MOST = 1000
"""Maximum number of reported findings."""

LOOP = "loop.toml"
"""Document that only the program file of a loop has: its records are decisions, and no observations."""
LOOP_SUFFIX = ".loop.sqlite"
QUEUE = "queue.toml"
"""Document that only the file of a queue has."""
LOG = "log.toml"
"""Document that only the log of a laboratory has."""
_SURE = 16
"""Minimum number of digits of a head hash; with fewer, a matching forgery can be found by trial."""

CUT_SHORT = ("head", "log")
"""Places of findings about missing records: the existing records are sound, and a resume continues from them."""


@dataclass(frozen=True)
class Verification:
    """The result of a verification.

    Attributes:
        path: the file.
        records: number of its records, 0 if it cannot be opened.
        head: hash of the last record.
        simulated: whether no real instrument was involved, None if unknown.
        findings: defects; empty if the file is sound.
        notes: remarks that are not defects.

    """

    path: Path
    records: int
    head: str
    simulated: bool | None
    findings: tuple[Finding, ...]
    notes: tuple[str, ...]

    @property
    def whole(self) -> bool:
        """Whether there are no findings."""
        return not self.findings


def verify_file(path: Path, expected_head: str | None = None) -> Verification:
    """Check everything about a run file. Nothing is changed.

    Args:
        path: the run file.
        expected_head: the head hash from a report or an earlier verification, hexadecimal, lower case.

    Raises:
        UsageError: this is no run file.
        ForeignFileError: a file beside it belongs to another file.

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
            # What changed records say need not agree: their consistency would be told as further defects.
            sense = Judged((), ()) if found or {LOOP, QUEUE, LOG} & run.documents().keys() else judged(run, MOST)
            found += [*sense.findings, *_cut_off(run, path, log)]
            heads, notes = _held_against(run, expected_head)
            notes += state.corrected
            notes += sense.doubts
            notes += _elsewhere(run, state) if all(f.where in (*CUT_SHORT, "sense") for f in found) else []
            count, head = run.head()
            simulated = _simulated(run)
    except ForeignFileError:
        raise  # its advice comes before anything else
    except RunFileError as error:
        return Verification(path, 0, "", None, (Finding("file", str(error).split(". ", 1)[0]),), saved_in(path))
    if found:
        notes += [note for note in saved_in(path) if note not in notes]
    if working:
        notes.append("a controller is at work on it: this is how it stood a moment ago")
    return Verification(path, count, head.hex(), simulated, (*found, *heads), tuple(notes))


def glance(path: Path, most: int) -> tuple[RunReader, RunState, Finding | None, bool]:
    """Open a run file, read its state, and verify it in the same pass.

    Args:
        path: the run file.
        most: a file with more records is not verified, because that would take seconds.

    Returns:
        the reader, which the caller closes; the state; the first defect, None if none is known; whether the file
        was verified.

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
    """Restore a damaged run file into a new one; see `rig.run_file.verify.restored.restore`."""
    path = real_path(path)
    if controller_alive(path):
        raise UsageError(f"a controller is at work on {path}: nothing to restore while it writes")
    return restore(path, to, _expanded, head)


def _expanded(documents: Mapping[str, str]) -> RunList | None:
    """The run list generated from the stored procedure; None if this version of rig cannot generate it."""
    try:
        return parse_procedure(documents["procedure.toml"], "procedure.toml", strict=False).expand()
    except (RigError, KeyError):  # the digest of a stored procedure shows whether it was changed, even if it is invalid
        return None


def _simulated(run: RunReader) -> bool | None:
    try:
        return run.about().simulated
    except RunFileError:
        return None


def _cut_off(run: RunReader, path: Path, log: wal.WalState) -> list[Finding]:
    """Findings about missing records."""
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
