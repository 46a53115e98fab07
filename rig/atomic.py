"""Files that are either whole or not there."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO

from rig.errors import UsageError
from rig.regular import open_regular


def write_whole(path: Path, write: Callable[[IO[str]], object]) -> None:
    """Write a text file under another name and rename it when it is complete.

    Args:
        path: the file to make or replace.
        write: called with the open file.

    Raises:
        UsageError: the disk or the folder refuses, or there is something there that is no file of ours to replace;
            nothing is left behind and an older file stays as it was.

    """

    def text(file: IO[bytes]) -> None:
        with io.TextIOWrapper(file, "utf-8", errors="backslashreplace", newline="", write_through=True) as wrapped:
            write(wrapped)

    write_whole_bytes(path, text)


def write_whole_bytes(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """The same of a file that is not text."""
    check_writable(path)
    temporary = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            write(file)
        os.replace(temporary, path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise UsageError(f"{path} cannot be written: {error.strerror}; nothing is left behind") from error


def check_writable(path: Path) -> None:
    """Refuse what cannot become a file, before the work that is to go into it. Raises `UsageError`."""
    if _is_run_file(path):
        raise UsageError(f"{path} is a run file and is not overwritten; choose another name")
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name a file in it")
    if path.exists() and not path.is_file():
        raise UsageError(f"{path} is no ordinary file; choose another name")
    if not path.parent.is_dir():
        raise UsageError(f"{path} cannot be written: there is no folder {path.parent}")


def check_not_input(written: Sequence[Path | None], read: Sequence[Path | None]) -> None:
    """Refuse to write over what the same command reads: measured data would be gone. Raises `UsageError`.

    Args:
        written: files that a command is to write; None where an option was not given.
        read: files that it reads.

    """
    inputs = [path for path in read if path is not None and path.exists()]
    for path in (p for p in written if p is not None and p.exists()):
        if any(path.samefile(other) for other in inputs):
            raise UsageError(f"{path} is what is read and is not overwritten; choose another name")


def _is_run_file(path: Path) -> bool:
    try:
        with open_regular(path) as file:
            return file.read(15) == b"SQLite format 3"
    except OSError:
        return False
