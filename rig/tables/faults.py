"""Faults of a run and the decisions about them, as a table: the second file of `rig export --all`."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from rig.errors import UsageError
from rig.files.atomic import write_whole
from rig.files.regular import open_regular
from rig.run_file.chain import Record
from rig.run_file.events.event import Event
from rig.run_file.read.reader import RunReader

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


def faults(run: Path) -> list[list[object]]:
    """Faults, decisions, skips and holds of a run with their results, one row of `COLUMNS` each. Raises
    `RunFileError`.
    """
    with RunReader.open(run) as reader:
        return [_row(record) for record in reader.records() if not record.accepted and record.event.exported]


def check_replaceable(path: Path) -> None:
    """Refuse to overwrite a file that `write_faults` did not write. Raises `UsageError`."""
    try:
        with open_regular(path) as file:
            theirs = file.readline(1000).decode("utf-8", "replace").rstrip() != ",".join(COLUMNS)
    except FileNotFoundError:
        return
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}; choose another name for --out") from error
    if theirs:
        raise UsageError(
            f"{path}, the file of faults and decisions with --all, is not such a table and is not overwritten; "
            "choose another name for --out"
        )


def write_faults(rows: Sequence[Sequence[object]], path: Path) -> None:
    """Write rows of `faults` as CSV, completely or not at all. Raises `UsageError`."""

    def write(file: IO[str]) -> None:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows)

    write_whole(path, write)


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
