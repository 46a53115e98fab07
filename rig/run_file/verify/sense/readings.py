"""Consistency of readings: mean, sd, number, columns and noise flag of an observation agree with its readings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from rig.bench.scatter_limits import MostScatter, most_scatter, noisiest, without_limit
from rig.run_file.chain import Record
from rig.run_file.events.event import Event
from rig.run_file.events.points import CONTRADICTORY, MISSING, Observed, readings_of
from rig.run_file.state.lost_digits import LostDigits
from rig.run_file.state.own_scatter import OwnScatter
from rig.run_file.state.state import RunState
from rig.run_file.verify.sense.recorded_run import RecordedRun

_GROUPS = ("outputs", "temperatures", "references")
_MEAN, _SD = 1e-12, 1e-9
"""Tolerance, relative to the largest reading: rounding of sums in another order."""
_SURE_BITS = 30.0
"""Repeated readings count as a copy if their probability by chance is below two to the power of minus this."""
_REMEMBERED = 200_000


class Readings:
    """Checks every observation that has readings.

    Args:
        case: the run.

    """

    def __init__(self, case: RecordedRun) -> None:
        conduct, bench = case.conduct, case.bench
        self._sweeps = None if conduct is None else conduct.readings
        self._again = _Again()
        self._columns: dict[str, set[str]] = {}
        self._most: Mapping[str, MostScatter] = {}
        self._own: OwnScatter | None = None
        self._lost = LostDigits(case.run_list, bench.typed if bench is not None else ())
        self._standards: set[str] = set()
        self._typed = case.typed
        if bench is not None:
            outputs = {f"{name}_{s.unit}" for name, s in bench.sensors.items()}
            if conduct is not None:
                self._most, self._own = (
                    most_scatter(conduct, bench),
                    OwnScatter(without_limit(conduct, bench), case.run_list.largest()),
                )
            self._standards = {name for name in bench.references if name in {f.name for f in case.run_list.factors}}
            self._columns = {"outputs": outputs, "temperatures": set(bench.temperatures)}

    def look(self, record: Record, event: Event, fold: RunState) -> Iterator[str]:
        """Defects of a record: ends of sentences that begin with the record's name."""
        if not isinstance(event, Observed) or event.overload is not None:
            return
        if event.accepted and bool(event.missing) != (MISSING in event.flags):
            yield "its mark and its readings differ about whether an output has none"
        yield from self._evidence(event.body(), "")
        for number, one in enumerate(event.rejected, 1):
            yield from self._evidence(one, f" of the readings rejected for noise ({number})")
        yield from self._read_by_hand(record, event, fold)
        if event.accepted:
            yield from self._noise(event)
            yield from self._contradictory(record, event)
            if outputs := {name: c for name, c in event.outputs.items() if name not in self._typed}:
                yield from self._again.look(record, outputs)

    def _evidence(self, readings: Mapping[str, Any], where: str) -> Iterator[str]:
        for group in _GROUPS:
            channels: Mapping[str, Mapping[str, Any]] = readings.get(group, {})
            without = set(readings.get("missing", ())) if group == "outputs" else set()
            if group in self._columns and channels.keys() != self._columns[group] - without:
                odd = sorted(channels.keys() ^ (self._columns[group] - without))
                yield f"its {group}{where} are not those of the bench file: {', '.join(odd)}"
            if group == "references" and (missing := sorted(self._standards - channels.keys())):
                yield f"its references{where} do not have that of {', '.join(missing)}, which the bench file has"
            for name, channel in channels.items():
                for wrong in self._channel(channel, counted=group != "references" and name not in self._typed):
                    yield f"{wrong.replace('NAME', name, 1)}{where}"

    def _channel(self, channel: Mapping[str, Any], *, counted: bool) -> Iterator[str]:
        readings: Sequence[float] = channel["readings"]
        n = len(readings)
        if counted and self._sweeps is not None and n != self._sweeps:
            yield f"NAME has {n} readings, the procedure asks for {self._sweeps}"
        if not n:
            yield "NAME has no readings"
            return
        largest = max(map(abs, readings))
        mean = math.fsum(readings) / n
        if not abs(channel["mean"] - mean) <= _MEAN * largest:
            yield f"mean of NAME is {channel['mean']!r}, that of its {n} readings is {mean!r}"
            return
        sd = math.sqrt(math.fsum((r - mean) ** 2 for r in readings) / (n - 1)) if n > 1 else 0.0
        if not abs(channel["sd"] - sd) <= _SD * largest:
            yield f"sd of NAME is {channel['sd']!r}, that of its {n} readings is {sd!r}"

    def _contradictory(self, record: Record, event: Observed) -> Iterator[str]:
        """Check that readings that are marked so contradict one another. Until 2026-11-27 none were marked."""
        if self._own is None or record.run_index is None:
            return
        own = self._own.contradiction(event.every_reading, readings_of(event.rejected))
        own = own or self._lost.contradiction(record.run_index, event.every_reading)
        if CONTRADICTORY in event.flags and own is None:
            yield "it is marked as contradictory, and its readings do not contradict one another"
        self._own.recall(record.run_index, event)
        self._lost.recall(record.run_index, event)

    def _read_by_hand(self, record: Record, event: Observed, fold: RunState) -> Iterator[str]:
        """Check that what a person read is what was typed."""
        every, typed = event.every_reading, fold.typed.get(record.run_index or 0, {})
        for name, column in self._typed.items():
            numbers = column.counting(typed.get(name, ()))
            if [*every.get(name, ())] != [column.value(number) for number in numbers]:
                said = ", ".join(f"{number!r}" for number in numbers) or "nothing"
                yield f"its readings of {name} are not what was typed ({said} {column.unit})"

    def _noise(self, event: Observed) -> Iterator[str]:
        """Check that an observation is flagged as noisy if and only if its noisiest quantity is."""
        marked = "noisy" in event.flags
        every = event.every_reading
        if apart := [name for name in self._typed if len(every.get(name, ())) > 2]:
            if not marked:
                yield f"no two of its readings of {', '.join(apart)} agree, and it is not marked as noisy"
            return
        if not self._most:
            if marked:
                yield "it is marked as noisy, and the procedure sets no limit to noise"
            return
        sds = {name: channel["sd"] for name, channel in (*event.outputs.items(), *event.references.items())}
        name = noisiest(sds, self._most)
        if name is None:
            return
        sd, most = sds[name], self._most[name].sd
        if sd > most and not marked:
            yield f"sd of {name} is {sd:g}, more than the procedure allows ({most:g}), and it is not marked as noisy"
        elif marked and not sd > most:
            yield f"it is marked as noisy, and its noisiest quantity, {name}, is not: sd {sd:g}, {most:g} allowed"


class _Again:
    """Finds readings that were copied from another observation, if chance does not explain them."""

    def __init__(self) -> None:
        self._resolution: dict[str, float] = {}
        self._seen: dict[int, int | None] = {}

    def look(self, record: Record, outputs: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
        """Observations that repeat the readings of another one; see `Rule.look`."""
        for name, channel in outputs.items():
            self._learn(name, channel["readings"])
        key = hash(tuple((name, *channel["readings"]) for name, channel in outputs.items()))
        if key in self._seen:
            pairs = math.log2(len(self._seen)) * 2.0
            if sum(self._bits(name, channel) for name, channel in outputs.items()) > _SURE_BITS + pairs:
                yield f"its outputs are those of the observation of point {self._seen[key]}, to the last digit"
        elif len(self._seen) < _REMEMBERED:
            self._seen[key] = record.run_index

    def _learn(self, name: str, readings: Sequence[float]) -> None:
        """Resolution of a column: the smallest step between two readings, one digit of its instrument or a few."""
        smallest, least = self._resolution.get(name, math.inf), _MEAN * abs(readings[0])
        for one, next_one in pairwise(sorted(readings)):
            if least < next_one - one < smallest:
                smallest = self._resolution[name] = next_one - one

    def _bits(self, name: str, channel: Mapping[str, Any]) -> float:
        """Bits of randomness in the readings of a column, from the scatter of each in digits."""
        digits = channel["sd"] / self._resolution.get(name, math.inf)
        return len(channel["readings"]) * math.log2(max(1.0, digits))
