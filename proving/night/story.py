"""A night told in order of time: what happened to the bench, and what the controller wrote down about it."""

from __future__ import annotations

import heapq
from collections.abc import Iterator

from proving.night.play import Played
from rig.errors import RunFileError
from rig.run_file.events.sessions import SessionBegan
from rig.run_file.read.reader import RunReader


def timeline(played: Played) -> Iterator[str]:
    """Lines of "world time, who, what"."""
    happened = [(t, "bench", what) for t, what in played.happened]
    sessions = [(s.began_s, "controller", f"started, session {n}") for n, s in enumerate(played.sessions, start=1)]
    endings = [(s.ended_s, "controller", f"{s.how}{f': {s.message}' if s.message else ''}") for s in played.sessions]
    for t, who, what in heapq.merge(*map(sorted, (happened, sessions, endings, _recorded(played)))):
        yield f"{t:12.3f} s  {who:11s} {what}"


def _recorded(played: Played) -> Iterator[tuple[float, str, str]]:
    if played.path is None:
        return
    try:
        with RunReader.open(played.path) as reader:
            origin = 0.0
            for record in reader.records():
                if isinstance(record.event, SessionBegan):
                    origin = record.event.origin
                yield record.elapsed_s + origin, "run file", record.sentence()
    except RunFileError as error:
        yield played.bench.world.now(), "run file", str(error)
