"""What went wrong during a run and what was decided about it, as a table: the other half of `rig export --all`."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from rig.atomic import write_whole
from rig.run_file.chain import Record
from rig.run_file.reader import RunReader

COLUMNS = (
    "elapsed_s",
    "session",
    "whole_plot",
    "run_index",
    "attempt",
    "kind",
    "fault",
    "decision",
    "where",
    "failure",
    "pause_s",
    "message",
)
_EVENTS = ("recovered", "read-back", "safe", "whole-plot-lost", "interrupted", "homed", "hole", "clock-set")


def write_happenings(run: Path, path: Path) -> int:
    """Write faults, decisions, skips, holds and how they ended as CSV; returns how many. Raises `UsageError`."""
    with RunReader.open(run) as reader:
        rows = [_row(record) for record in reader.records() if _is_one(record)]

    def write(file: IO[str]) -> None:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows)

    write_whole(path, write)
    return len(rows)


def _is_one(record: Record) -> bool:
    return record.kind in ("fault", "skip", "hold", "release", "stop") or (
        record.kind == "event" and record.status in _EVENTS
    )


def _row(record: Record) -> list[object]:
    data = record.data
    message = " ".join(str(data.get("message", data.get("reason", data.get("why", ", ".join(_told(record)))))).split())
    event = record.kind == "event"
    return [
        round(record.elapsed_s, 3),
        record.session,
        record.whole_plot,
        record.run_index,
        record.attempt,
        record.status if event else record.kind,
        data.get("fault", ""),
        "" if event else record.status,
        data.get("where", data.get("place", "")),
        data.get("failure", ""),
        data.get("pause_s", ""),
        message,
    ]


def _told(record: Record) -> Iterator[str]:
    data = record.data
    match record.status:
        case "recovered":
            yield from (f"{fault} {n}x" for fault, n in data["failures"].items())
        case "safe":
            yield f"safe after {data['seconds']:g} s" if not data["unsafe"] else "; ".join(data["unsafe"])
        case "read-back":
            yield from (f"{name} restarted" for name in data["restarted"])
        case _:
            return
