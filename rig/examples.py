"""Place of the examples: inside the installed package, or beside it in a source tree."""

from __future__ import annotations

from pathlib import Path

from rig.errors import UsageError


def example(name: str) -> Path:
    """Folder of an example, by its name. Raises `UsageError` if it does not exist."""
    package = Path(__file__).parent
    for folder in (package / "examples", package.parent / "examples"):
        if (folder / name).is_dir():
            return folder / name
    raise UsageError(f"the example {name} is not installed; it is in examples/{name} of the source tree")
