"""The smallest night there is, for tests of what goes on around a run."""

from __future__ import annotations

from pathlib import Path

SMALL = """
kind = "pitch-roll"
name = "small"
replications = 2
[design]
type = "T6"
[settle]
dwell_s = 2
[measure]
readings = 4
"""


def write_small(folder: Path) -> Path:
    path = folder / "small.toml"
    path.write_text(SMALL)
    return path
