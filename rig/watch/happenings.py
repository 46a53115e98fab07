"""What happened, for the page: lines in plain words with how much they matter, sessions, whole plots."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

from rig.report import story
from rig.run_file.chain import Record

LINES = 300
"""Lines kept; of earlier ones the page says how many there are."""
_SESSIONS, _WHOLE_PLOTS = 50, 200

_MATTERS = {
    "fault": "fault",
    "skip": "decision",
    "hold": "decision",
    "release": "decision",
    "stop": "decision",
    "session": "session",
    "end": "session",
}
_EVENT_MATTERS = {"warning": "warning", "whole-plot-lost": "fault", "interrupted": "session", "hole": "fault"}
_QUIET_GAP_S = 5.0


class Happenings:
    """Everything but observations, bounded."""

    def __init__(self) -> None:
        self.lines: deque[dict[str, Any]] = deque(maxlen=LINES)
        self.told = 0
        self.warnings: deque[dict[str, Any]] = deque(maxlen=50)
        self.sessions: deque[dict[str, Any]] = deque(maxlen=_SESSIONS)
        self.whole_plots: deque[dict[str, Any]] = deque(maxlen=_WHOLE_PLOTS)
        self.faults = 0

    def add(self, seq: int, record: Record) -> None:
        """Take one more record, in order. Raises KeyError and the like where a record makes no sense."""
        self._count(record)
        if record.kind == "observation" and record.status != "accepted":
            lost = " in a whole plot that was lost" if record.whole_plot is not None else ""
            words, kind = f"readings at point {record.run_index}{lost} were not accepted", "decision"
        else:
            words, kind = story.words(record), _matters(record)
        if not words:
            return
        line = {"seq": seq, "elapsed_s": record.elapsed_s, "utc_s": record.utc_s, "kind": kind, "words": words}
        self.told += 1
        self.lines.append(line)
        if kind == "warning":
            self.warnings.append({**line, "words": str(record.data["message"])})

    def after(self, seq: int) -> list[dict[str, Any]]:
        """The lines of records after `seq`."""
        return [line for line in self.lines if line["seq"] > seq]

    def _count(self, record: Record) -> None:
        match record.kind, record.status:
            case "session", _:
                self.sessions.append(_session(record))
            case "fault", _:
                self.faults += 1
                self._ended("fault" if record.status == "abort" else None)
            case "stop", _:
                self._ended("stopped on request")
            case "event", "interrupted":
                self._ended(f"interrupted ({record.data.get('signal', 'signal')})")
            case "end", _:
                self._ended(str(record.status))
            case "event", "whole-plot":
                self.whole_plots.append(_whole_plot(record))
            case "event", "whole-plot-lost":
                for plot in self.whole_plots:
                    if plot["number"] == record.whole_plot:
                        plot["lost"] = str(record.data["reason"])
            case "observation", "accepted" if record.whole_plot is not None and self.whole_plots:
                for plot in reversed(self.whole_plots):
                    if plot["number"] == record.whole_plot:
                        plot["points"] += 1
                        break
            case _:
                pass
        if self.sessions:
            self.sessions[-1]["last_utc_s"] = record.utc_s

    def _ended(self, how: str | None) -> None:
        if how is not None and self.sessions:
            self.sessions[-1]["ended"] = how


def _matters(record: Record) -> str:
    if record.kind == "event":
        return _EVENT_MATTERS.get(str(record.status), "step")
    return _MATTERS.get(record.kind, "step")


def _session(record: Record) -> dict[str, Any]:
    data: Mapping[str, Any] = record.data
    return {
        "number": record.session,
        "began_utc_s": record.utc_s,
        "last_utc_s": record.utc_s,
        "gap_s": float(data["gap_s"]) if data["gap_s"] > _QUIET_GAP_S or record.session > 1 else None,
        "gap_certain": bool(data["gap_certain"]),
        "host": str(data.get("host", "")),
        "pid": data.get("pid"),
        "ended": None,
    }


def _whole_plot(record: Record) -> dict[str, Any]:
    return {
        "number": record.whole_plot,
        "planned": int(record.data["planned"]),
        "elapsed_s": record.elapsed_s,
        "setpoints_degC": {str(n): float(v) for n, v in record.data["setpoints_degC"].items()},
        "points": 0,
        "lost": "",
    }
