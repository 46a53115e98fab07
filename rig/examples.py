"""Place of the examples: inside the installed package, or beside it in a source tree."""

from __future__ import annotations

from pathlib import Path

from rig.errors import UsageError

_PACKAGE = Path(__file__).parent
_PLACES = (_PACKAGE / "examples", _PACKAGE.parent / "examples")
_LAB = "-lab"


def laboratories() -> tuple[str, ...]:
    """Names of all example laboratories, without the end of their folders' names, in alphabetical order."""
    found = (folder.name for place in _PLACES if place.is_dir() for folder in place.iterdir() if folder.is_dir())
    return tuple(sorted({name.removesuffix(_LAB) for name in found if name.endswith(_LAB)}))


def example(name: str) -> Path:
    """Folder of an example, by its name. Raises `UsageError` if it does not exist."""
    for folder in _PLACES:
        if (folder / name).is_dir():
            return folder / name
    raise UsageError(f"the example {name} is not installed; it is in examples/{name} of the source tree")
