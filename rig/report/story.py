"""What happened during a run, in a person's words: sessions, gaps, homings, faults, holds, skips, the end."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from rig.run_file.reader import RunReader


class Line(NamedTuple):
    """One happening: when, in hours and minutes of bench time, and what."""

    when: str
    what: str


def story(path: Path) -> list[Line]:
    """The happenings of a run file, in order; what belongs to the ordinary course of a point is left out."""
    with RunReader.open(path) as reader:
        reader.about()  # a file that does not begin with its run is none
        told = (r for r in reader.records() if not r.accepted and r.event.importance.page)
        return [Line(_clock(record.elapsed_s), record.sentence()) for record in told]


def _clock(seconds: float) -> str:
    minutes = int(seconds // 60)
    return f"{minutes // 60}:{minutes % 60:02d}"
