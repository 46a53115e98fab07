"""Writing files completely or not at all."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import re
import stat
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO

from rig.errors import UsageError
from rig.files.regular import open_regular
from rig.files.temporary import open_temporary, sweep, temporary_in


def write_whole(path: Path, write: Callable[[IO[str]], object]) -> None:
    """Write a text file under another name and rename it when it is complete.

    Args:
        path: the file to make or replace.
        write: called with the open file.

    Raises:
        UsageError: the disk or the folder refuses, or the path is something that must not be replaced; nothing is left
            behind and an older file is unchanged.
    """

    def text(file: IO[bytes]) -> None:
        wrapped = io.TextIOWrapper(file, "utf-8", errors="backslashreplace", newline="", write_through=True)
        write(wrapped)
        wrapped.detach()  # closing flushes

    write_whole_bytes(path, text)


def write_whole_bytes(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Replace a binary file whole: readers see the old or the new one, never a part."""
    target = check_writable(path)
    mode = stat.S_IMODE(target.stat().st_mode) if target.exists() else None
    sweep(target.parent)
    temporary = temporary_in(target.parent)
    try:
        with open_temporary(temporary, 0o666 if mode is None else mode) as file:
            if mode is not None:
                os.fchmod(file.fileno(), mode)
            write(file)
            file.flush()
            os.fsync(file.fileno())  # otherwise a power cut after the rename could leave an empty file under the name
            os.replace(temporary, target)
    except BaseException as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError):
            raise UsageError(f"{path} cannot be written: {error.strerror}; no partial file remains") from error
        raise


def check_files(written: Sequence[Path | None], read: Sequence[Path | None]) -> None:
    """Check the files of a command before its work: no output may be an input or another output.

    Args:
        written: output files; None for options that were not given.
        read: input files.

    Raises:
        UsageError: measured data or another result would be overwritten, or a file cannot be written.
    """
    inputs, seen = [path for path in read if path is not None], dict[Path, Path]()
    for path in (one for one in written if one is not None):
        if any(_same(path, other) for other in inputs):
            raise UsageError(f"{path} is an input and is not overwritten; choose another name")
        target = check_writable(path)
        for other in seen:
            if target == other or _same(target, other):
                raise UsageError(f"{seen[other]} and {path} are the same file; name two files")
        seen[target] = path


def check_ending(path: Path, ending: str, *others: str) -> None:
    """Refuse a name that says another format than `ending`, which is written by default. Raises `UsageError`."""
    if path.suffix.lower() not in (ending, *others, ".txt", ""):
        also = "".join(f", or {path.with_suffix(other)}" for other in others)
        raise UsageError(
            f"{path} would have {ending[1:].upper()} under a name that says {path.suffix}: only this is "
            f"written; name it {path.with_suffix(ending)}{also}"
        )


_FORMATS = re.compile(r"\.(csv|tsv|json|html?|pdf|xml|toml|sqlite|xlsx?|ods|docx?|parquet|feather|h5|hdf5|png|zip)")
"""Endings that say in which format a file is."""


def check_format(path: Path | None, *own: str) -> Path | None:
    """The path; a name with the ending of a known format other than the `own` ones is refused.

    Other names, such as `cell.2026`, say nothing of the format. Raises `UsageError`.
    """
    if path is None or (ending := path.suffix.lower()) in own or not _FORMATS.fullmatch(ending):
        return path
    raise UsageError(
        f"{path} would have {own[0][1:].upper()} under a name that says {ending}: only this is written; name it "
        f"{path.with_suffix(own[0])}"
    )


def check_added_to(path: Path | None, apart_from: Sequence[Path | None]) -> None:
    """Refuse to append to a run file, or to another file of the same command. Raises `UsageError`."""
    if path is None:
        return
    if _of_run(path):
        raise UsageError(f"{path} is a run file or belongs to one, and must not be appended to; choose another name")
    for other in (one for one in apart_from if one is not None):
        if _same(path, other) or os.path.realpath(path) == os.path.realpath(other):
            raise UsageError(f"{path} is another file of the same command and must not be appended to; choose another")


def check_writable(path: Path) -> Path:
    """Refuse an output path that cannot be written, before the work.

    Returns:
        The file to be replaced: the path itself, or the target of a link.

    Raises:
        UsageError: a folder, a device, a run file or a file beside one, a write-protected file; or a folder that does
            not exist or cannot be written to.
    """
    try:
        target = _led_to(path)
        mode = target.stat().st_mode if target.exists() else None
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}; choose another name") from error
    if _of_run(target):
        raise UsageError(f"{path} is a run file or belongs to one, and is not overwritten; choose another name")
    if mode is not None and stat.S_ISDIR(mode):
        raise UsageError(f"{path} is a folder; name a file in it")
    if _in_system(target) or not (mode is None or stat.S_ISREG(mode)):
        raise UsageError(f"{path} is not a regular file; choose another name")
    if not target.parent.is_dir():
        raise UsageError(f"{path} cannot be written: folder {target.parent} does not exist")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise UsageError(f"{path} cannot be written: files cannot be created in {target.parent}; choose another folder")
    if mode is not None and not (mode & 0o222 and os.access(target, os.W_OK)):
        raise UsageError(f"{path} is write-protected; choose another name, or make it writable (chmod u+w)")
    return target


_LINKS = 40


def _in_system(path: Path) -> bool:
    """Whether it is in /dev, /proc or /sys, where paths are not ordinary files; /dev/shm is a disk in memory."""
    top = path.parts[1:3]
    return top[:1] in (("dev",), ("proc",), ("sys",)) and top != ("dev", "shm")


def _led_to(path: Path) -> Path:
    """The target of a path, existing or not; if links lead through /proc, the path there."""
    for _ in range(_LINKS):
        path = Path(os.path.realpath(path.parent)) / path.name
        if _in_system(path) or not path.is_symlink():
            return path
        path = path.parent / os.readlink(path)
    raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))


def _same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except OSError:
        return False


def _of_run(path: Path) -> bool:
    """Whether it is a run file, or a file of SQLite or the controller beside one."""
    beside = [Path(str(path).removesuffix(end)) for end in ("-wal", "-shm", "-journal") if path.name.endswith(end)]
    if path.suffix in (".head", ".live", ".request"):
        beside.append(path.with_suffix(".sqlite"))
    for one in (path, *beside):
        try:
            with open_regular(one) as file:
                if file.read(15) == b"SQLite format 3":
                    return True
        except OSError:
            continue
    return False
