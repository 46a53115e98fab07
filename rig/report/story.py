"""What happened during a run, in a person's words: sessions, gaps, homings, faults, holds, skips, the end."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from rig.run_file.chain import Record
from rig.run_file.reader import RunReader
from rig.who import told


class Line(NamedTuple):
    """One happening: when, in hours and minutes of bench time, and what."""

    when: str
    what: str


def story(path: Path) -> list[Line]:
    """The happenings of a run file, in order; observations are left out."""
    with RunReader.open(path) as reader:
        return [Line(_clock(r.elapsed_s), said) for r in reader.records() if (said := _words(r))]


def words(record: Record) -> str:
    """One record in a person's words, "" for what is left out of the story."""
    return _words(record)


_UNKNOWN_GAP = "a gap of unknown length: the machine restarted, and its clock was wrong or is"


def _clock(seconds: float) -> str:
    minutes = int(seconds // 60)
    return f"{minutes // 60}:{minutes % 60:02d}"


def _words(record: Record) -> str:
    data = record.data
    at = "" if record.run_index is None else f" at point {record.run_index}"
    match record.kind:
        case "run":
            return f"run created, {data['points']} points, run list {data['run_list'][:16]}..."
        case "session":
            by = told(data)
            words = f"session {record.session} began{f', operator {by}' if by else ''}"
            if record.session > 1:
                certain = "" if data["gap_certain"] else " (by UTC, across a restart of the machine)"
                known = data.get("gap_known", True)
                words += f" after a gap of {data['gap_s']:.0f} s{certain}" if known else f" after {_UNKNOWN_GAP}"
            if data["wal_commits_lost"]:
                words += (
                    f"; {data['wal_commits_lost']} record(s) had been lost from a damaged log ({data['wal_damage']})"
                )
            return words
        case "identity":
            serial = data["serial"] if data["confirmed"] else "serial number not told"
            again = "" if data["replaces"] is None else ", accepted in place of another one"
            asset = data["asset"] or "not declared"
            return f"{record.status}: {data['maker']} {data['model']}, {serial}, asset {asset}{again}"
        case "fault":
            if "fault" not in data:
                return f"fault{at}: {data['message']} ({record.status})"
            waits = f" after {data['pause_s']:g} s" if data["pause_s"] else ""
            again = f", failure {data['failure']}" if data["failure"] > 1 else ""
            where = at or f" while {data['where']}"
            return f"{data['fault'].replace('_', ' ')}{where}{again}: {data['message']} ({record.status}{waits})"
        case "skip":
            return f"point {record.run_index} {'skipped' if record.status == 'final' else 'put off'}: {data['reason']}"
        case "hold":
            return f"held{at}: {data['why']}"
        case "release":
            return "released"
        case "stop":
            return "stopped on request"
        case "event" if record.status in ("homed", "interrupted", "parked", "environment-settled"):
            return record.status.replace("-", " ")
        case "event" if record.status == "hole":
            where = at or f" while {data['where']}"
            return (
                f"the controller had no turn for {data['hole_s']:.0f} s{where} (stopped, or the machine asleep?); "
                f"the bench is checked as after a crash"
            )
        case "event" if record.status == "rescued":
            return f"the file was moved, deleted or replaced; the run goes on in {data['to']}"
        case "event" if record.status == "clock-set":
            return str(data["message"])
        case "event" if record.status == "warning":
            return f"warning: {data['message']}"
        case "event" if record.status == "remark":
            return f"{data['instrument']}: {data['message']}"
        case "event" if record.status == "recovered":
            what = ", ".join(f"{fault.replace('_', ' ')} {n}x" for fault, n in data["failures"].items())
            return f"{data['place']}: went well in the end, after {what}"
        case "event" if record.status == "safe":
            unsafe = "; ".join(data["unsafe"])
            return f"NOT SAFE: {unsafe}" if unsafe else f"bench safe after {data['seconds']:.1f} s"
        case "event" if record.status == "whole-plot":
            where = ", ".join(f"{name} {degC:g} degC" for name, degC in data["setpoints_degC"].items())
            return f"whole plot {record.whole_plot} soaked (number {data['planned']} of the design): {where}"
        case "event" if record.status == "whole-plot-lost":
            return (
                f"whole plot {record.whole_plot} lost: {data['reason']}; {data['kept']} readings stay, "
                f"it is measured again under a new identity"
            )
        case "end":
            return f"{record.status}: {data['accepted']} points observed, {data['records']} records before this one"
        case _:
            return ""
