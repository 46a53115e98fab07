"""Times of the faults of a world, and a record of those that have happened."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf, isfinite
from typing import NamedTuple, Protocol

from rig.sims.fault import Fault, Striking
from rig.sims.faults.faulty_wire import FaultyWire
from rig.sims.noise import event_at, uniform
from rig.sims.physics import Plant
from rig.sims.twin import TwinClass
from rig.sims.world import World


class Happening(NamedTuple):
    """A fault that has happened.

    Attributes:
        t_s: world time, seconds.
        fault: its entry.
        what: a sentence.
    """

    t_s: float
    fault: Fault
    what: str


class Bench(Protocol):
    """Parts of a simulated bench that faults need."""

    world: World
    plant: Plant

    @property
    def twins(self) -> Mapping[str, TwinClass]:
        """By instrument."""
        ...


@dataclass(frozen=True)
class _Entry:
    """A fault and the noise channel of its probability."""

    fault: Fault
    chances: str


class Faults:
    """The faults of one session on a simulated bench.

    Args:
        bench: the affected bench.
        faults: the entries.

    Attributes:
        happened: faults so far, in order.
        wires: by instrument.
    """

    def __init__(self, bench: Bench, faults: Sequence[Fault]) -> None:
        self.happened: list[Happening] = []
        self._bench = bench
        self._world = world = bench.world
        self._seed = bench.plant.truth.seed
        media = {name: twin.wire for name, twin in bench.twins.items()}
        self._at_exchange: dict[tuple[str, int], list[Fault]] = {}
        self._by_chance: dict[str, list[_Entry]] = {}
        self.wires = {
            name: FaultyWire(world, medium, self._note, partial(self._foreign, name, media))
            for name, medium in media.items()
        }
        # A later session has other random numbers for the same exchange number: its exchanges are different ones.
        session = f"@{event_at(world.now())}" if world.now() else ""
        for n, fault in enumerate(faults):
            if fault.at_s is not None:
                self._plan(fault, fault.at_s)
            elif fault.exchange is not None:
                self._at_exchange.setdefault((fault.on, fault.exchange), []).append(fault)
            else:
                entry = _Entry(fault, f"{fault.on}/fault {n}{session}")
                self._by_chance.setdefault(fault.on, []).append(entry)
            if fault.at_s is None and fault.on in self.wires:
                self.wires[fault.on].begins = partial(self._exchange, fault.on)

    def strike(self, fault: Fault, until: float | None = None) -> None:
        """Make a fault happen now.

        Args:
            fault: the fault; its own time is ignored.
            until: world time of its end, for one with a duration; by its own `for_s` if None.
        """
        if until is None:
            until = self._world.now() + fault.lasts_s if fault.lasts_s else inf
        act, bench = fault.what.act, self._bench
        if act is None:
            self.wires[fault.on].strike(fault, until)
            return
        twin, wire = bench.twins.get(fault.on), self.wires.get(fault.on)
        over = act(Striking(fault, until, partial(self._note, fault), bench.world, bench.plant, twin, wire))
        if over is not None and isfinite(until):
            self._world.call_in(until - self._world.now(), over)

    def _plan(self, fault: Fault, at: float) -> None:
        now = self._world.now()
        if at >= now:
            self._world.call_in(at - now, partial(self.strike, fault))
            return
        until = at + fault.lasts_s
        if until > now:  # began before this session and is still active
            self.strike(fault, until)

    def _exchange(self, name: str, number: int) -> None:
        for fault in self._at_exchange.pop((name, number), ()):
            self.strike(fault)
        for entry in self._by_chance.get(name, ()):
            if uniform(self._seed, entry.chances, number) < entry.fault.probability:
                self.strike(entry.fault)

    def _note(self, fault: Fault, what: str) -> None:
        self.happened.append(Happening(self._world.now(), fault, what))

    def _foreign(self, name: str, media: Mapping[str, str]) -> bytes:
        """The latest reply of another instrument on a wire of the same kind."""
        return next(
            (w.latest for n, w in self.wires.items() if n != name and media[n] == media[name] and w.latest), b""
        )
