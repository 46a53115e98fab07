"""Disk space for a run's file: checked before anything moves."""

from __future__ import annotations

import os
import resource
import shutil
from pathlib import Path

from rig.errors import StorageError, UsageError

BYTES_PER_POINT = 6000
"""Size of an observation in the run file, with its share of indexes and log, bytes; measured, rounded up."""

_BESIDES = 10_000_000


def needed_bytes(points: int) -> int:
    """Size of this many points, with log, bytes."""
    return points * BYTES_PER_POINT + _BESIDES


def largest_file_bytes() -> int | None:
    """Maximum size of a file of this process (`ulimit -f`), bytes; None if unlimited."""
    soft, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
    return None if soft == resource.RLIM_INFINITY else soft


def check_room(place: Path, points: int) -> None:
    """Raise `StorageError` if the disk, or this process, has no room for this many more points.

    Args:
        place: the folder of a new run file, which need not exist yet; or a run file to be resumed.
        points: remaining points.
    """
    goes_on = place.is_file()
    folder = place.parent if goes_on else place
    existing = next((p for p in (folder, *folder.absolute().parents) if p.exists()), Path("/"))
    free, needed = shutil.disk_usage(existing).free, needed_bytes(points)
    if free < needed:
        other = f"copy {place} to another disk, with its -wal, and resume it there"
        raise StorageError(
            f"{existing} has {free / 1e6:.0f} MB free but the run may need {needed / 1e6:.0f} MB: "
            f"free some, or {other if goes_on else 'choose another folder with --out'}"
        )
    largest, will_be = largest_file_bytes(), needed + (place.stat().st_size if goes_on else 0)
    if largest is not None and largest < will_be:
        raise StorageError(
            f"this process may create files of at most {largest / 1e6:.1f} MB, but the run may need "
            f"{will_be / 1e6:.0f} MB: raise the limit (ulimit -f unlimited, or LimitFSIZE= of the service)"
        )


def check_may_write(run: Path) -> None:
    """Raise `UsageError` if a run cannot continue because its file or folder is read-only."""
    log = run.with_name(run.name + "-wal")
    closed = next((p for p in (run, log if log.exists() else run.parent) if not os.access(p, os.W_OK)), None)
    if closed is not None:
        raise UsageError(
            f"{closed} cannot be written to (permissions, or a read-only disk): correct that, or copy {run} "
            f"elsewhere, with its -wal if it has one, and resume it there. Nothing was touched"
        )
