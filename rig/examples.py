"""Place of the examples: a folder of the package."""

from __future__ import annotations

from pathlib import Path

from rig.errors import UsageError

_PLACE = Path(__file__).with_name("examples")
_LAB = "-lab"


def laboratories() -> tuple[str, ...]:
    """Names of all example laboratories, without the end of their folders' names, in alphabetical order."""
    return tuple(sorted(folder.name.removesuffix(_LAB) for folder in _PLACE.glob(f"*{_LAB}") if folder.is_dir()))


def example(name: str) -> Path:
    """Folder of an example, by its name. Raises `UsageError` if it does not exist."""
    if (_PLACE / name).is_dir():
        return _PLACE / name
    raise UsageError(f"the example {name} is not installed; it is in examples/{name} of the source tree")
