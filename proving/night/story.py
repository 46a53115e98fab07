"""A night told in order of time: what happened to the bench, and what the controller wrote down about it."""

from __future__ import annotations

import heapq
from collections.abc import Iterator

from proving.night.play import Played
from rig.errors import RunFileError
from rig.run_file.chain import Record
from rig.run_file.reader import RunReader


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
                if record.kind == "session":
                    origin = record.data["clock_s"] - record.data["elapsed_s"]
                yield record.elapsed_s + origin, "run file", _words(record)
    except RunFileError as error:
        yield played.bench.world.now(), "run file", str(error)


def _words(record: Record) -> str:
    where = "" if record.run_index is None else f" of point {record.run_index}"
    plot = "" if record.whole_plot is None else f", whole plot {record.whole_plot}"
    why = next((str(record.data[k]) for k in ("message", "reason", "why", "signal") if k in record.data), "")
    return f"{record.kind}{where}{plot}{f', {record.status}' if record.status else ''}{f': {why}' if why else ''}"
