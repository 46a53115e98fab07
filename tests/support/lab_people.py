"""A small laboratory with people, whose passwords take no time."""

from __future__ import annotations

import atexit
import io
import shutil
import sys
import tempfile
from pathlib import Path
from unittest.mock import patch

from command import Done, rig

from rig.examples import example
from rig.lab import people

QUICK = {"time_cost": 1, "memory_cost": 8, "parallelism": 1}
WORD = {"anna": "correct horse", "ben": "battery staple", "vera": "only looking", "olga": "keeps the list"}


def typed(*arguments: object, lines: str = "", cwd: Path | None = None) -> Done:
    """`rig` with these lines on standard input."""
    with patch.object(sys, "stdin", io.StringIO(lines)), patch.object(people, "COST", QUICK):
        return rig(*arguments, cwd=cwd)


def laboratory(folder: Path, lab: str = "load-cell-lab") -> Path:
    """A copy of an example, with anna (operator), ben (operator, approver), vera (viewer), olga (administrator)."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in example(lab).glob("*.toml"):
        shutil.copy(path, folder / path.name)
    return with_people(folder)


_MADE: dict[tuple[tuple[str, bytes], ...], Path] = {}
"""Laboratories that were made before, by their files without people: four commands take as long as most tests."""


def with_people(folder: Path) -> Path:
    """A folder with these people, and no other file that was not there."""
    folder.mkdir(parents=True, exist_ok=True)
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    before = tuple((str(path.relative_to(folder)), path.read_bytes()) for path in files)
    if before in _MADE:
        shutil.copytree(_MADE[before], folder, dirs_exist_ok=True)
        return folder
    roles = {"anna": "operator", "ben": "operator,approver", "vera": "viewer", "olga": "administrator"}
    for login, role in roles.items():
        add = ("person", "add", login, "--name", login.title(), "--roles", role)
        assert typed(*add, lines=f"{WORD[login]}\n", cwd=folder).returncode == 0
    kept = Path(tempfile.mkdtemp(prefix="rig-people-"))
    atexit.register(shutil.rmtree, kept, ignore_errors=True)
    _MADE[before] = Path(shutil.copytree(folder, kept / "lab"))
    return folder
