"""Copies beside a run file into which its controllers have saved what was in it (`rig.run_file.rescue`)."""

from __future__ import annotations

import contextlib
from pathlib import Path


def saved_in(path: Path) -> tuple[str, ...]:
    """Where its controller has saved what was in a file that is not whole: a sentence without its end, or none."""
    return tuple(f"what its controller saved of it is in {copy}: rig resume {copy}" for copy in _copies(path)[:1])


def saved_words(path: Path) -> str:
    """The same as a sentence before others, or nothing."""
    return "".join(f"{words[0].upper()}{words[1:]}. " for words in saved_in(path))


def _copies(path: Path) -> list[Path]:
    """The last one first."""
    with contextlib.suppress(OSError):
        named = (one for one in path.absolute().parent.iterdir() if one.name.startswith(f"{path.stem}-rescued-"))
        copies = [one for one in named if one.suffix == ".sqlite" and one.is_file() and one != path.absolute()]
        return sorted(copies, key=lambda one: one.stat().st_mtime, reverse=True)
    return []
