"""Rescued copies beside a run file (`rig.run_file.write.rescue`)."""

from __future__ import annotations

import contextlib
from pathlib import Path

from rig.procedures.present.shell import shell_word


def saved_in(path: Path) -> tuple[str, ...]:
    """A sentence without its full stop that names the rescued copy of a damaged file; "" if there is none."""
    return tuple(
        f"what its controller saved of it is in {copy}: rig resume {shell_word(copy)}" for copy in _copies(path)[:1]
    )


def saved_words(path: Path) -> str:
    """Where it is saved, as a complete sentence with a space after it; "" if there is none."""
    return "".join(f"{words[0].upper()}{words[1:]}. " for words in saved_in(path))


def _copies(path: Path) -> list[Path]:
    """Rescued copies, the latest first."""
    with contextlib.suppress(OSError):
        named = (one for one in path.absolute().parent.iterdir() if one.name.startswith(f"{path.stem}-rescued-"))
        copies = [one for one in named if one.suffix == ".sqlite" and one.is_file() and one != path.absolute()]
        return sorted(copies, key=lambda one: one.stat().st_mtime, reverse=True)
    return []
