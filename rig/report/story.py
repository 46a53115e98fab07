"""Events of a run in plain words: sessions, gaps, homings, faults, holds, skips, the end."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from rig.run_file.reader import RunReader


class Line(NamedTuple):
    """One event: its time, in hours and minutes of bench time, and a sentence."""

    when: str
    what: str


def story(path: Path) -> list[Line]:
    """The events of a run file, in order, without the ordinary steps of points."""
    with RunReader.open(path) as reader:
        reader.about()  # a file that does not begin with the record of its run
        told = (r for r in reader.records() if not r.accepted and r.event.importance.page)
        return [Line(_clock(record.elapsed_s), record.sentence()) for record in told]


def _clock(seconds: float) -> str:
    minutes = int(seconds // 60)
    return f"{minutes // 60}:{minutes % 60:02d}"
