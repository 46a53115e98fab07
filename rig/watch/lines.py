"""Events for the page: lines in plain words with their level, sessions, whole plots."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from typing import Any

from rig.procedures.column_names import spelled, stem_of, unit_of
from rig.run_file.chain import Record
from rig.run_file.events.bench import Fault, Warned
from rig.run_file.events.event import Event
from rig.run_file.events.points import WholePlotBegan, WholePlotLost
from rig.run_file.events.sessions import SessionBegan

LINES = 300
"""Maximum number of kept lines; the page gives only the number of earlier ones."""
_SESSIONS, _WHOLE_PLOTS = 50, 200

_QUIET_GAP_S = 5.0


class Lines:
    """All records except observations, bounded."""

    def __init__(self) -> None:
        self.lines: deque[dict[str, Any]] = deque(maxlen=LINES)
        self.told = 0
        self.warnings: deque[dict[str, Any]] = deque(maxlen=50)
        self.sessions: deque[dict[str, Any]] = deque(maxlen=_SESSIONS)
        self.whole_plots: deque[dict[str, Any]] = deque(maxlen=_WHOLE_PLOTS)
        self.faults = 0

    def add(self, seq: int, record: Record) -> None:
        """Take one more record, in order. Raises `ContentsError` for a record that makes no sense."""
        if record.accepted:
            self._observed(record)
        else:
            self._count(record, record.event)
            self._tell(seq, record, record.event)
        if self.sessions:
            self.sessions[-1]["last_utc_s"] = record.utc_s

    def _tell(self, seq: int, record: Record, event: Event) -> None:
        kind = event.importance.page
        if not kind:
            return
        line = {"seq": seq, "elapsed_s": record.elapsed_s, "utc_s": record.utc_s, "kind": kind}
        line["words"] = record.sentence()
        self.told += 1
        self.lines.append(line)
        if isinstance(event, Warned):
            self.warnings.append({**line, "words": event.message})

    def after(self, seq: int) -> list[dict[str, Any]]:
        """The lines of records after `seq`."""
        return [line for line in self.lines if line["seq"] > seq]

    def _count(self, record: Record, event: Event) -> None:
        match event:
            case SessionBegan():
                self.sessions.append(_session(record, event))
            case Fault():
                self.faults += 1
            case WholePlotBegan():
                self.whole_plots.append(_whole_plot(record, event))
            case WholePlotLost():
                for plot in self.whole_plots:
                    if plot["number"] == record.whole_plot:
                        plot["lost"] = event.reason
            case _:
                pass
        if event.ending and self.sessions:
            self.sessions[-1]["ended"] = event.ending

    def _observed(self, record: Record) -> None:
        for plot in reversed(self.whole_plots):
            if plot["number"] == record.whole_plot:
                plot["points"] += 1
                break


def _session(record: Record, began: SessionBegan) -> dict[str, Any]:
    return {
        "number": record.session,
        "began_utc_s": record.utc_s,
        "last_utc_s": record.utc_s,
        "gap_s": began.gap_s if began.gap_s > _QUIET_GAP_S or record.session > 1 else None,
        "gap_certain": began.gap_certain,
        "host": began.host or "",
        "pid": began.pid,
        "ended": None,
    }


def _whole_plot(record: Record, began: WholePlotBegan) -> dict[str, Any]:
    return {
        "number": record.whole_plot,
        "planned": began.planned,
        "elapsed_s": record.elapsed_s,
        "settings": [*_temperatures(began.setpoints_degC), *_others(began.settings)],
        "points": 0,
        "lost": "",
    }


def _temperatures(setpoints_degC: Mapping[str, float]) -> Iterator[tuple[str, float, str]]:
    """Name, value and unit of the temperature of each chamber."""
    for name, value in setpoints_degC.items():
        yield name.removesuffix("_chamber").replace("_", " "), value, spelled("degC")


def _others(settings: Mapping[str, float]) -> Iterator[tuple[str, float, str]]:
    """Lines of the other quantities, which are no temperatures."""
    for name, value in settings.items():
        yield stem_of(name).replace("_", " "), value, spelled(unit_of(name))
