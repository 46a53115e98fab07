"""What went wrong during a run and what was decided about it, as a table: the other half of `rig export --all`."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

from rig.atomic import write_whole
from rig.errors import UsageError
from rig.regular import open_regular
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


def happenings(run: Path) -> list[list[object]]:
    """Faults, decisions, skips, holds of a run and how they ended, a row of `COLUMNS` each. Raises `RunFileError`."""
    with RunReader.open(run) as reader:
        return [_row(record) for record in reader.records() if _is_one(record)]


def check_replaceable(path: Path) -> None:
    """Refuse a file that is there and was not written by `write_happenings`: nobody named it. Raises `UsageError`."""
    try:
        with open_regular(path) as file:
            theirs = file.readline(1000).decode("utf-8", "replace").rstrip() != ",".join(COLUMNS)
    except FileNotFoundError:
        return
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}; choose another name for --out") from error
    if theirs:
        raise UsageError(
            f"{path}, where faults and decisions go with --all, is there and no table of them: it is not overwritten; "
            "choose another name for --out"
        )


def write_happenings(rows: Sequence[Sequence[object]], path: Path) -> None:
    """Write rows of `happenings` as CSV, whole or not at all. Raises `UsageError`."""

    def write(file: IO[str]) -> None:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows)

    write_whole(path, write)


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
