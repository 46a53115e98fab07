"""Consistency of the facts of a run and its sessions with the run's documents, above all SIMULATED."""

from __future__ import annotations

from collections.abc import Iterator

from rig.run_file.approval import DOCUMENT as APPROVAL
from rig.run_file.approval import defect, digests_of
from rig.run_file.chain import Record
from rig.run_file.events.event import Event
from rig.run_file.events.sessions import RunCreated, SessionBegan
from rig.run_file.state.state import RunState
from rig.run_file.verify.sense.recorded_run import RecordedRun

_SIMULATED = "sim://"
"""First characters of the address of a simulated instrument."""
_DOCUMENTS = ("bench.toml", "procedure.toml")
"""Documents that every run has."""
_VIRTUAL = "virtual"
"""Boot identifier of a dry run, whose time is virtual."""


class Facts:
    """Checks the first record and the records of sessions.

    Args:
        case: the run.

    """

    def __init__(self, case: RecordedRun) -> None:
        self._case = case
        self._stated_by: object = None

    def look(self, record: Record, event: Event, _fold: RunState) -> Iterator[str]:
        """Defects of a record: ends of sentences that begin with the record's name."""
        match event:
            case RunCreated():
                yield from self._run(event)
            case SessionBegan():
                yield from self._session(event)

    def _run(self, run: RunCreated) -> Iterator[str]:
        case, bench = self._case, self._case.bench
        for name in _DOCUMENTS:
            if name not in case.documents and run.dry is not None:  # present in every controller's first record
                yield f"it holds no {name}, with which every run begins"
        if run.points != len(case.run_list):
            yield f"it has {run.points} points, its run list {len(case.run_list)}"
        if case.procedure is not None and run.procedure not in (None, case.procedure.name):
            yield f"its procedure is {run.procedure}, its document says {case.procedure.name}"
        if bench is not None and run.bench not in (None, bench.name):
            yield f"its bench is {run.bench}, its document says {bench.name}"
        if bench is not None and bench.approval and not run.runs_dry:
            why = defect(case.documents.get(APPROVAL), digests_of(case.documents), run.run_list, run.run_id)
            if why:
                yield f"it {why}"
        for why in self._simulated(run):
            if not run.simulated:
                yield f"it does not say SIMULATED, and {why}"
                return
        if run.simulated and run.dry is False and bench is not None and not bench.simulated:
            yield "it says SIMULATED, and it is no dry run, nor is its bench simulated"

    def _simulated(self, run: RunCreated) -> Iterator[str]:
        """Why a run is a simulated one."""
        bench = self._case.bench
        if run.dry:
            yield "it is a dry run"
        if "world.toml" in self._case.documents:
            yield "it holds a world.toml, as only dry runs do"
        if bench is None:
            return
        if bench.simulated or bench.live is not None:
            yield "its bench is a simulated one"
        if any(instrument.address.startswith(_SIMULATED) for instrument in bench.instruments.values()):
            yield "an instrument's address is that of a simulated one"

    def _session(self, session: SessionBegan) -> Iterator[str]:
        simulated = self._case.about.simulated
        if session.simulated is not None:
            self._stated_by = session.software
            if session.simulated is not simulated:
                said, other = (_word(session.simulated), _word(simulated))
                yield f"it says that its bench is {said}, the first record that it is {other}"
        elif self._stated_by is not None and session.software == self._stated_by:
            yield "it does not say whether its bench is simulated, as the session before does"
        if session.boot == _VIRTUAL and not simulated:
            yield "its time is virtual, as in dry runs, and the run does not say SIMULATED"


def _word(simulated: object) -> str:
    return "simulated" if simulated else "real"
