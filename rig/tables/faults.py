"""What went wrong during a run and what was decided about it, as a table: the other half of `rig export --all`."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import IO

from rig.atomic import write_whole
from rig.run_file.chain import Record
from rig.run_file.events.event import Event
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


def write_faults(run: Path, path: Path) -> int:
    """Write faults, decisions, skips, holds and how they ended as CSV; returns how many. Raises `UsageError`."""
    with RunReader.open(run) as reader:
        rows = [_row(record) for record in reader.records() if not record.accepted and record.event.exported]

    def write(file: IO[str]) -> None:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows)

    write_whole(path, write)
    return len(rows)


def _row(record: Record) -> list[object]:
    data, sort_is_status = record.data, record.kind == Event.kind
    return [
        round(record.elapsed_s, 3),
        record.session,
        record.whole_plot,
        record.run_index,
        record.attempt,
        record.status if sort_is_status else record.kind,
        data.get("fault", ""),
        "" if sort_is_status else record.status,
        data.get("where", data.get("place", "")),
        data.get("failure", ""),
        data.get("pause_s", ""),
        " ".join(record.sentence().split()),
    ]
