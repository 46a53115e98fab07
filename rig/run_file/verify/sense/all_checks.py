"""All consistency checks over all records."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from rig.run_file.bodies import ContentsError
from rig.run_file.chain import Record
from rig.run_file.damage.audit import Finding
from rig.run_file.events.corrections import Corrected
from rig.run_file.read.reader import RunReader
from rig.run_file.state.corrected import Entries
from rig.run_file.state.state import RunState
from rig.run_file.verify.sense.accounts import Accounts
from rig.run_file.verify.sense.durations import Durations
from rig.run_file.verify.sense.evidence import Evidence
from rig.run_file.verify.sense.facts import Facts
from rig.run_file.verify.sense.instruments_of_run import Instruments
from rig.run_file.verify.sense.marks import Marks
from rig.run_file.verify.sense.places import Places
from rig.run_file.verify.sense.readings import Readings
from rig.run_file.verify.sense.recorded_run import RecordedRun, Rule
from rig.run_file.verify.sense.times import Times
from rig.run_file.verify.sense.written import Written, other_version

_NOT_OURS = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, AssertionError)
_DOUBTS = 10


@dataclass(frozen=True)
class Judged:
    """The results of the checks.

    Attributes:
        findings: defects that no controller can have written.
        doubts: remarks that are possible in an honest run too, and checks that were not possible; sentences.

    """

    findings: tuple[Finding, ...]
    doubts: tuple[str, ...]


def judged(run: RunReader, most: int) -> Judged:
    """Compare the records of a file with correct hashes with one another and with the file's documents.

    Args:
        run: the opened file; it is read once more.
        most: maximum number of findings.

    """
    case = RecordedRun.of(run)
    times = Times(case)
    evidence, written = Evidence(case), Written(case)
    rules: tuple[Rule, ...] = (
        Facts(case),
        written,
        times,
        Durations(case),
        Accounts(case),
        Marks(case),
        Readings(case),
        Instruments(case),
        Places(case),
        evidence,
        Entries(case.typed),
    )
    found = tuple(itertools.islice(_findings(run, rules), most))
    told = times.doubts[:_DOUBTS]
    if len(times.doubts) > _DOUBTS:
        told.append(f"and {len(times.doubts) - _DOUBTS} more such dates")
    return Judged(found, (*case.unread(), *other_version(case), *written.doubts, *told, *evidence.doubts))


def _findings(run: RunReader, rules: tuple[Rule, ...]) -> Iterator[Finding]:
    fold = RunState()
    for seq, record, _, _ in run.chained():
        # a correction is made by no controller: it has no place among what a session records
        for rule in rules if record.kind != Corrected.kind else rules[-1:]:
            try:
                for what in rule.look(record, record.event, fold):
                    yield _finding(seq, record, what)
            except ContentsError as error:
                yield _finding(seq, record, str(error).partition(": ")[2])
                break
            except _NOT_OURS as error:
                words = f"its body is not what a controller writes ({type(error).__name__}: {str(error)[:100]})"
                yield _finding(seq, record, words)
        try:
            fold.add(record)
        except _NOT_OURS as error:
            yield _finding(seq, record, f"it does not go with the records before it ({str(error)[:100]})")
            return


def _finding(seq: int, record: Record, what: str) -> Finding:
    return Finding("sense", what, seq, record.kind, record.run_index)
