"""Where benchmarks put their run files: on the disk that holds the project, not in a memory file system."""

from __future__ import annotations

from pathlib import Path

RUNS = Path(__file__).parent.parent / "runs"
RUNS.mkdir(exist_ok=True)
