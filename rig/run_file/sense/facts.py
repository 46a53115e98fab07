"""Whether the facts that a run and its sessions state are those of its own documents: SIMULATED above all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rig.run_file.chain import Record
from rig.run_file.sense.case import Case
from rig.run_file.state import RunState

_SIMULATED = "sim://"
"""How the address of a simulated instrument begins."""
_DOCUMENTS = ("bench.toml", "procedure.toml")
"""What every run begins with."""
_VIRTUAL = "virtual"
"""The boot of a dry run, whose time is virtual."""


class Facts:
    """Looks at the first record and at those of the sessions.

    Args:
        case: the run.

    """

    def __init__(self, case: Case) -> None:
        self._case = case
        self._stated_by: object = None

    def look(self, record: Record, data: Mapping[str, Any], _fold: RunState) -> Iterator[str]:
        """See `Rule.look`."""
        if record.kind == "run":
            yield from self._run(data)
        elif record.kind == "session":
            yield from self._session(data)

    def _run(self, data: Mapping[str, Any]) -> Iterator[str]:
        case, bench = self._case, self._case.bench
        for name in _DOCUMENTS:
            if name not in case.documents and "dry" in data:  # as every controller's first record has it
                yield f"it holds no {name}, with which every run begins"
        if data["points"] != len(case.run_list):
            yield f"it has {data['points']} points, its run list {len(case.run_list)}"
        if case.procedure is not None and data.get("procedure", case.procedure.name) != case.procedure.name:
            yield f"its procedure is {data['procedure']}, its document says {case.procedure.name}"
        if bench is not None and data.get("bench", bench.name) != bench.name:
            yield f"its bench is {data['bench']}, its document says {bench.name}"
        for why in self._simulated(data):
            if not data["simulated"]:
                yield f"it does not say SIMULATED, and {why}"
                return
        if data["simulated"] and not data.get("dry", True) and bench is not None and not bench.simulated:
            yield "it says SIMULATED, and it is no dry run, nor is its bench simulated"

    def _simulated(self, data: Mapping[str, Any]) -> Iterator[str]:
        """Why a run is a simulated one."""
        bench = self._case.bench
        if data.get("dry"):
            yield "it is a dry run"
        if "world.toml" in self._case.documents:
            yield "it holds a world.toml, as only dry runs do"
        if bench is None:
            return
        if bench.simulated or bench.live is not None:
            yield "its bench is a simulated one"
        if any(instrument.address.startswith(_SIMULATED) for instrument in bench.instruments.values()):
            yield "an instrument's address is that of a simulated one"

    def _session(self, data: Mapping[str, Any]) -> Iterator[str]:
        simulated = bool(self._case.about["simulated"])
        if "simulated" in data:
            self._stated_by = data["software"]
            if data["simulated"] is not simulated:
                said, other = (_word(data["simulated"]), _word(simulated))
                yield f"it says that its bench is {said}, the first record that it is {other}"
        elif self._stated_by is not None and data["software"] == self._stated_by:
            yield "it does not say whether its bench is simulated, as the session before does"
        if data.get("boot") == _VIRTUAL and not simulated:
            yield "its time is virtual, as in dry runs, and the run does not say SIMULATED"


def _word(simulated: object) -> str:
    return "simulated" if simulated else "real"
