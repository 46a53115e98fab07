"""The disk for run files: free space, rights, kind of file system, locks, and durable writes."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import statistics
import tempfile
from collections.abc import Iterator
from pathlib import Path

from rig.drivers.clock import RealClock
from rig.files.disk_space import largest_file_bytes, needed_bytes
from rig.unattended.doctor.findings import Finding, ok, problem, warning

_NETWORK = {
    "nfs",
    "nfs4",
    "cifs",
    "smb3",
    "smbfs",
    "9p",
    "afs",
    "ceph",
    "glusterfs",
    "fuse.sshfs",
    "davfs",
    "fuse.rclone",
}
_MEMORY = {"tmpfs", "ramfs"}
_SYNCS = 20
_SLOW_S = 0.1
_TOO_QUICK_S = 5e-6


def check_disk(folder: Path, points: int | None) -> Iterator[Finding]:
    """Findings about the folder for run files.

    Args:
        folder: folder of the run file; it need not exist yet.
        points: number of remaining points, None if unknown.

    """
    existing = next((p for p in (folder, *folder.absolute().parents) if p.is_dir()), Path("/"))
    yield _room(existing, points)
    yield from _kind(existing)
    if not os.access(existing, os.W_OK | os.X_OK):
        yield problem("disk: rights", f"{existing} may not be written to", "choose another folder with --out")
        return
    try:
        with tempfile.TemporaryDirectory(prefix=".rig-doctor-", dir=existing) as inside:
            yield _locks(Path(inside) / "lock")
            yield _sync(Path(inside) / "sync")
    except OSError as error:
        yield problem("disk: writing", f"{existing}: {error.strerror}", "repair the disk, or choose another folder")


def _room(folder: Path, points: int | None) -> Finding:
    free = shutil.disk_usage(folder).free
    has = f"{folder} has {free / 1e9:.1f} GB free"
    if points is None:
        if free < 1e9:
            return warning("disk: room", has, "give the procedure, so that its need is known; or free some space")
        return ok("disk: room", has)
    needed, largest = needed_bytes(points), largest_file_bytes()
    text = f"{has}; {points} points need {needed / 1e6:.0f} MB"
    names = os.statvfs(folder).f_favail
    if free < needed:
        return problem("disk: room", text, "free some, or choose another folder with --out")
    if largest is not None and largest < needed:
        limited = f"{text}, and the size of files is limited to {largest / 1e6:.1f} MB here"
        return problem("disk: room", limited, "ulimit -f unlimited; LimitFSIZE= of a service")
    if os.statvfs(folder).f_files and names < 100:
        return problem("disk: room", f"{folder} has room for only {names} more files", "remove files there")
    if free < 5 * needed + 1e9:
        return warning("disk: room", text, "make sure that nothing else fills it in the night")
    return ok("disk: room", text)


def _kind(folder: Path) -> Iterator[Finding]:
    kind, options = mounted(folder)
    check = "disk: file system"
    if not kind:
        yield warning(check, "its kind is unknown", "make sure that it is a local disk")
    elif kind in _MEMORY:
        yield warning(check, f"{kind}: it is in memory", "a power cut loses the run; choose a folder on a disk")
    elif kind in _NETWORK:
        advice = "locks and syncs over a network cannot be relied on: choose a folder on a local disk and copy later"
        yield warning(check, f"{kind}: a network file system", advice)
    elif "ro" in options:
        yield problem(check, f"{kind}, mounted read-only", "mount it for writing, or choose another folder")
    elif "nobarrier" in options or "barrier=0" in options:
        yield warning(check, f"{kind}, mounted without barriers", "a power cut can lose synced data: mount without")
    else:
        yield ok(check, kind)
    if "eatmydata" in os.environ.get("LD_PRELOAD", ""):
        yield problem("disk: syncing", "libeatmydata is loaded: nothing is ever synced", "start rig without it")


def mounted(folder: Path) -> tuple[str, set[str]]:
    """Kind and options of a folder's file system; "" if unknown."""
    try:
        device = os.stat(folder).st_dev
        text = Path("/proc/self/mountinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return "", set()
    number = f"{os.major(device)}:{os.minor(device)}"
    best: tuple[int, str, set[str]] = (-1, "", set())
    inside = os.path.realpath(folder)
    for line in text.splitlines():
        before, _, after = line.partition(" - ")
        fields, more = before.split(), after.split()
        if len(fields) < 6 or len(more) < 3:
            continue
        place = fields[4].encode().decode("unicode_escape", "replace")
        under = inside == place or inside.startswith(place.rstrip("/") + "/")
        if under and (fields[2] == number or more[0].startswith(("btrfs", "overlay"))) and len(place) >= best[0]:
            best = (len(place), more[0], {*fields[5].split(","), *more[2].split(",")})
    return best[1], best[2]


def _locks(path: Path) -> Finding:
    first = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC)
    second = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    try:
        fcntl.flock(first, fcntl.LOCK_EX | fcntl.LOCK_NB)
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(second, fcntl.LOCK_EX | fcntl.LOCK_NB)
            advice = "choose a folder on a local disk: two controllers would not see each other"
            return problem("disk: locks", "locks do not exclude each other here", advice)
        return ok("disk: locks", "a second controller would be refused")
    except OSError as error:
        return problem("disk: locks", f"files cannot be locked: {error.strerror}", "choose a folder on a local disk")
    finally:
        os.close(first)
        os.close(second)


def _sync(path: Path) -> Finding:
    check = "disk: syncing"
    seconds = sync_s(path)
    text = f"one record is on the disk within {1e3 * seconds:.3g} ms (median of {_SYNCS})"
    if seconds < _TOO_QUICK_S:
        return warning(check, f"{text}: no disk is that fast", "a power cut would lose records; choose another folder")
    if seconds > _SLOW_S:
        return warning(check, text, "every point waits for it: find out what else uses the disk, or choose another")
    return ok(check, text)


def sync_s(path: Path) -> float:
    """Median real seconds until 4 kB appended to a file are on the disk."""
    clock = RealClock()
    times = []
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC)
    try:
        for _ in range(_SYNCS):
            began = clock.stopwatch()
            os.write(descriptor, bytes(4096))
            os.fdatasync(descriptor)
            times.append(clock.stopwatch() - began)
    finally:
        os.close(descriptor)
    return statistics.median(times)
