"""Whether there is room for a run's file: asked before anything moves, not found out at 3 o'clock."""

from __future__ import annotations

import os
import resource
import shutil
from pathlib import Path

from rig.errors import StorageError, UsageError

BYTES_PER_POINT = 6000
"""What an observation takes in the run file, with its share of indexes and log; measured, rounded up."""

_BESIDES = 10_000_000


def needed_bytes(points: int) -> int:
    """What so many points take, log included."""
    return points * BYTES_PER_POINT + _BESIDES


def largest_file_bytes() -> int | None:
    """How large a file this process may make (`ulimit -f`), None if any."""
    soft, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
    return None if soft == resource.RLIM_INFINITY else soft


def check_room(place: Path, points: int) -> None:
    """Raise `StorageError` if the disk, or this process, has no room for so many more points.

    Args:
        place: the folder of a new run file, which need not exist yet; or a run file that is to go on.
        points: still to come.

    """
    goes_on = place.is_file()
    folder = place.parent if goes_on else place
    existing = next((p for p in (folder, *folder.absolute().parents) if p.exists()), Path("/"))
    free, needed = shutil.disk_usage(existing).free, needed_bytes(points)
    if free < needed:
        other = f"copy {place} to another disk, with its -wal, and resume it there"
        raise StorageError(
            f"{existing} has {free / 1e6:.0f} MB free and the run may need {needed / 1e6:.0f} MB: "
            f"free some, or {other if goes_on else 'choose another folder with --out'}"
        )
    largest, will_be = largest_file_bytes(), needed + (place.stat().st_size if goes_on else 0)
    if largest is not None and largest < will_be:
        raise StorageError(
            f"this process may make files of {largest / 1e6:.1f} MB at most and the run may need "
            f"{will_be / 1e6:.0f} MB: raise the limit (ulimit -f unlimited, or LimitFSIZE= of the service)"
        )


def check_may_write(run: Path) -> None:
    """Raise `UsageError` if a run cannot go on in its file because file or folder may only be read."""
    log = run.with_name(run.name + "-wal")
    closed = next((p for p in (run, log if log.exists() else run.parent) if not os.access(p, os.W_OK)), None)
    if closed is not None:
        raise UsageError(
            f"{closed} may not be written to (rights, or a disk that can only be read): mend that, or copy {run} "
            f"elsewhere, with its -wal if it has one, and resume it there. Nothing was touched"
        )
