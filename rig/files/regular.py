"""Opening files named by a person, and files beside them: only regular ones, of limited size.

Opening a pipe may block for ever, and a device may deliver bytes without end.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

MOST_BYTES = 64 << 20
"""Maximum size of a text file."""

_KINDS = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
    stat.S_IFDIR: "a folder",
    stat.S_IFLNK: "a symbolic link",
}


def open_regular(path: Path) -> BinaryIO:
    """A regular file, opened to read without blocking.

    Raises:
        OSError: there is none, or it is something else; `strerror` gives the reason.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except ValueError:
        raise OSError(errno.EINVAL, "a path has no NUL in it", str(path)) from None
    try:
        check_regular(os.fstat(descriptor).st_mode, path)
    except BaseException:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


def real_path(path: Path) -> Path:
    """Target of a symbolic link, because files beside it are beside the target; the path itself if it is not a link."""
    try:
        real = Path(os.path.realpath(path)) if path.is_symlink() else path
        return path if real.is_dir() else real  # a folder has no files of this kind beside it
    except (OSError, ValueError):  # a loop of links, a NUL: opening it reports the error
        return path


def check_regular(mode: int, path: Path) -> None:
    """Raise `OSError` if a file's mode is not that of a regular file."""
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "it is a folder", str(path))
    if not stat.S_ISREG(mode):
        kind = _KINDS.get(stat.S_IFMT(mode), "no file")
        raise OSError(errno.EINVAL, f"it is {kind}, not a regular file", str(path))


def read_regular(path: Path, most: int = MOST_BYTES) -> bytes:
    """The contents of a regular file.

    Raises:
        OSError: as `open_regular`, or it has more than `most` bytes.
    """
    with open_regular(path) as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise OSError(errno.EFBIG, f"it is larger than {most:,} bytes, the maximum", str(path))
    return content


def read_regular_text(path: Path, most: int = MOST_BYTES) -> str:
    """The text of a regular file, UTF-8 with or without byte order mark.

    Raises:
        OSError: as `read_regular`.
        UnicodeDecodeError: it is not UTF-8.
    """
    return read_regular(path, most).decode("utf-8-sig")
