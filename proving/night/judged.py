"""A night as its checks take it: the run file as anybody could read it, and the tape of what truly happened."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf

from proving.night.play import Played
from rig.procedures.plan.run_list import Point, RunList
from rig.run_file.chain import Record
from rig.run_file.events.bench import Warned
from rig.run_file.events.points import WholePlotLost
from rig.run_file.events.sessions import SessionBegan
from rig.sims.tape import Reading, Tape


@dataclass(frozen=True)
class Violation:
    """Something that must not happen.

    Attributes:
        invariant: name of the check.
        what: what was found, and where.
        unknowable: why nothing that came over the wires could tell it from what is right; "" if something could.

    """

    invariant: str
    what: str
    unknowable: str = ""


class Night:
    """A night that was played, and what is known of it.

    Args:
        played: the night.
        run_list: of its run file.
        records: of its run file, all of them in order.

    Attributes:
        tape: what truly happened.

    """

    def __init__(self, played: Played, run_list: RunList, records: list[Record]) -> None:
        self.played, self.run_list, self.records = played, run_list, records
        self.tape: Tape = played.tape
        self._origins = {r.session: r.event.origin for r in self.records if isinstance(r.event, SessionBegan)}
        self._inputs: dict[tuple[str, str], list[Reading]] = {}
        for reading in self.tape.readings:
            self._inputs.setdefault((reading.instrument, reading.channel), []).append(reading)
        self._begins = {wire: [reading.t_s for reading in readings] for wire, readings in self._inputs.items()}

    def accepted(self) -> Iterator[Record]:
        """Accepted observations, but for those that the run itself came to doubt."""
        since = {
            r.whole_plot: r.event.doubted_s
            for r in self.records
            if isinstance(r.event, WholePlotLost) and r.event.doubted_s is not None
        }
        told = {r.event.doubted: r.elapsed_s for r in self.records if isinstance(r.event, Warned)}
        read = (r for r in self.records if r.accepted and r.elapsed_s < since.get(r.whole_plot, inf))
        return (r for r in read if r.elapsed_s > told.get(r.run_index, -inf))

    def point(self, record: Record) -> Point:
        """Where an observation was to be made."""
        assert record.run_index is not None
        return self.run_list.points[record.run_index]

    def world_s(self, session: int, elapsed_s: float) -> float:
        """World time of an elapsed time, by the clock reading that the session began with."""
        return elapsed_s + self._origins[session]

    def measured_s(self, record: Record) -> tuple[float, float]:
        """World times between which an observation says that it was measured."""
        began, ended = record.data["measured_s"]
        return self.world_s(record.session, began), self.world_s(record.session, ended)

    def of_input(self, wire: tuple[str, str]) -> list[Reading]:
        """All readings that an instrument made of an input, (instrument, channel), in order of time."""
        return self._inputs.get(wire, [])

    def alone(self, wire: tuple[str, str]) -> bool:
        """Whether an instrument reads this input only."""
        return all(channel == wire[1] for instrument, channel in self._inputs if instrument == wire[0])

    def meanwhile(self, record: Record, wire: tuple[str, str]) -> range:
        """Which of `of_input` were made, from begin to end, while an observation says that it was measured."""
        began, ended = self.measured_s(record)
        readings, begins = self.of_input(wire), self._begins.get(wire, [])
        first = last = bisect_left(begins, began - _ROUNDED_S)
        while last < len(readings) and readings[last].end_s <= ended + _ROUNDED_S:
            last += 1
        return range(first, last)


_ROUNDED_S = 2e-6
"""Elapsed times are differences of clock readings, and a reading that takes no time has a microsecond."""
