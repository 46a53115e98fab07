"""Sweeps of the readers of a bench: an observation of all channels, or a look at temperatures or a standard alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from rig.drivers.clock import Clock
from rig.drivers.errors import ChannelsFailed
from rig.drivers.roles import is_overload
from rig.engine.fault_classes import OverloadedError
from rig.engine.guard import Guard
from rig.engine.measuring import Observation, assemble, spans_of, standards
from rig.instruments.opening import Bench
from rig.procedures.plan.run_list import Factor


class Sweeps:
    """Readings on one bench.

    Args:
        bench: opened instruments.
        positions: reads every axis.
        guard: limits and interlocks.
        clock: bench time.
        wait: waits for this number of bench seconds; may raise to interrupt.

    """

    def __init__(
        self,
        bench: Bench,
        positions: Callable[[], Mapping[str, float]],
        guard: Guard,
        clock: Clock,
        wait: Callable[[float], None],
    ) -> None:
        self._bench, self._readers = bench, bench.readers
        self._positions, self._guard, self._clock, self._wait = positions, guard, clock, wait
        self._in_passing: dict[str, tuple[float, ...]] = {}

    def measure(self, readings: int, poll_s: float, references: Sequence[Factor] = ()) -> Observation:
        """Sweep all channels `readings` times, on every instrument at the same time.

        Args:
            readings: sweeps.
            poll_s: time between readbacks of the references.
            references: factors whose readback is the reference of the calibration; they are read during the sweeps.

        """
        asked = self._clock.now()
        started: dict[str, tuple[float, float]] = {}
        # Every reader is started before any is fetched: the quantities of a point are of one time.
        for name, reader in self._readers.items():
            due = reader.start(readings)
            started[name] = self._clock.now(), due
        seen: dict[str, list[float]] = {f.name: [] for f in references}
        end = self._clock.now() + max(due for _, due in started.values())
        while references and self._clock.now() < end:
            self._note(seen, references)
            self._wait(min(poll_s, max(end - self._clock.now(), 1e-3)))
        self._wait(max(0.0, end - self._clock.now()))
        fetched, taken = {}, {}
        bench = self._bench
        missing: dict[str, str] = {}
        for name, reader in self._readers.items():
            before = self._clock.now()
            try:
                fetched[name] = reader.fetch()
            except ChannelsFailed as error:
                fetched[name], without = error.readings, self._without(name, error)
                missing |= without
            taken[name] = spans_of(reader, *started[name], before, self._clock.now())
        self._note(seen, references)
        read = {column: source for column, source in bench.sensors.items() if column not in missing}
        found = assemble(fetched, read, bench.scales, bench.temperatures, seen)
        found.references |= standards(fetched, bench.references, bench.standards)
        found.missing = missing
        every = {**read, **bench.temperatures, **bench.references}
        spans = {column: taken[name][channel] for column, (name, channel) in every.items()}
        found.taken_s = {column: (round(a - asked, 3), round(b - asked, 3)) for column, (a, b) in spans.items()}
        self._guard.check_temperatures({name: channel.mean for name, channel in found.temperatures.items()})
        return found

    def _without(self, name: str, error: ChannelsFailed) -> dict[str, str]:
        """Outputs without a reading, since channels of a reader failed, and why. Raises the error if more lacks."""
        bench = self._bench
        needed = {*bench.temperatures.values(), *bench.references.values()}
        found = {
            column: error.failed[channel]
            for column, (reader, channel) in bench.sensors.items()
            if reader == name and channel in error.failed
        }
        if len(found) == len(bench.sensors) or needed & {(name, channel) for channel in error.failed}:
            raise error
        return found

    def _note(self, seen: Mapping[str, list[float]], references: Sequence[Factor]) -> None:
        if references:
            now = self._positions()
            for factor in references:
                seen[factor.name].append(now[factor.axis])

    def temperatures(self, columns: Sequence[str]) -> dict[str, float]:
        """One reading of each of these temperature columns, degrees Celsius; an overload stays an overload."""
        source = {column: self._bench.temperatures[column] for column in columns}
        readers = {name: self._readers[name] for name, _ in source.values()}
        if readers:
            self._wait(max(reader.start(1) for reader in readers.values()))
        fetched = {name: reader.fetch() for name, reader in readers.items()}
        self._note_passing(fetched)
        values = {column: float(fetched[name][channel][0]) for column, (name, channel) in source.items()}
        self._guard.check_temperatures(values)
        return values

    def standard(self, factor: str, readings: int) -> float:
        """Mean of so many readings of a reference standard, in the factor's unit. Raises `OverloadedError`."""
        name, channel = self._bench.references[factor]
        reader = self._readers[name]
        self._wait(reader.start(readings))
        fetched = reader.fetch()
        self._note_passing({name: fetched})
        found = standards({name: fetched}, {factor: (name, channel)}, self._bench.standards)[factor]
        if found.overload:
            raise OverloadedError(f"{factor} out of range while it was brought to its level")
        return found.mean

    def _note_passing(self, fetched: Mapping[str, Mapping[str, Sequence[float]]]) -> None:
        """Note the outputs that a sweep reads along with the temperatures: a meter that hangs later may repeat them."""
        for column, (reader, channel) in self._bench.sensors.items():
            if reader not in fetched or is_overload(volts := fetched[reader][channel][-1]):
                continue
            before, value = self._in_passing.get(column, ()), volts * self._bench.scales[column]
            if value not in before[-1:]:
                self._in_passing[column] = (*before[-1:], value)

    def take_in_passing(self) -> dict[str, tuple[float, ...]]:
        """Output readings made while only temperatures were wanted, since the last call.

        Returns:
            By column, in its unit, the last two readings that differ.

        """
        taken, self._in_passing = self._in_passing, {}
        return taken
