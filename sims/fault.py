"""Faults: kind, target, time, and effect."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Any, Literal, Protocol

if TYPE_CHECKING:
    from rig.sims.physics import Plant
    from rig.sims.world import World

Counts = Literal["", "exchanges", "frames", "readings"]
"""Unit counted by `times`; "" if the kind happens once or lasts."""

WHEN = ("at_s", "exchange", "probability")
"""Keys for the time of a fault; exactly one is given."""


@dataclass(frozen=True)
class Option:
    """A key of one kind.

    Attributes:
        default: its value if not given.
        unit: "" for words and plain numbers.
        meaning: one line.
        words: permitted words; () for a number, or for any word.
        low, high: range of a number.
    """

    default: float | str
    unit: str
    meaning: str
    words: tuple[str, ...] = ()
    low: float = -inf
    high: float = inf


@dataclass(frozen=True)
class Kind:
    """A kind of fault.

    A fault of an instrument is declared by its twin (`rig.sims.twin.TwinClass.faults`). It is one of
    `rig.sims.faults.instrument_faults` or the twin's own.

    Attributes:
        name: name in a world file.
        sentence: description of the effect.
        act: makes it happen; None for faults of wires, which `rig.sims.faults.faulty_wire` executes.
        wires: kinds of wire on which it happens; () if it is not a fault of a wire.
        of_bench: whether it happens to the whole bench.
        counts: unit counted by `times`.
        lasts_s: default of `for_s`; 0 if it has no duration.
        options: its own keys.
    """

    name: str
    sentence: str
    act: Act | None = None
    wires: tuple[str, ...] = ()
    of_bench: bool = False
    counts: Counts = ""
    lasts_s: float = 0.0
    options: Mapping[str, Option] = field(default_factory=dict)


@dataclass(frozen=True)
class Fault:
    """One planned fault. Exactly one of `at_s`, `exchange` and `probability` gives its time.

    Attributes:
        what: its kind.
        on: the instrument's name on the bench; "" for the whole bench.
        at_s: world time, seconds.
        exchange: number of a message from host to instrument in this session, from 1.
        probability: probability per exchange.
        times: number of affected exchanges, frames or readings.
        for_s: duration, seconds; 0 for the kind's default; for counted kinds, everything within this time, if not 0.
        options: the kind's own options; missing ones get their defaults when a world is made.
    """

    what: Kind
    on: str
    at_s: float | None = None
    exchange: int | None = None
    probability: float = 0.0
    times: int = 1
    for_s: float = 0.0
    options: Mapping[str, float | str] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """Name of its kind."""
        return self.what.name

    @property
    def lasts_s(self) -> float:
        """Its duration, seconds; 0 if it has none."""
        return self.for_s or self.what.lasts_s

    def table(self) -> dict[str, Any]:
        """The entry as in a world file, without defaults."""
        given = {"kind": self.kind, "on": self.on, "at_s": self.at_s, "exchange": self.exchange}
        found = {key: value for key, value in given.items() if value not in ("", None)}
        if self.probability:
            found["probability"] = self.probability
        if self.times != 1:
            found["times"] = self.times
        if self.for_s not in (0.0, self.what.lasts_s):
            found["for_s"] = self.for_s
        return found | {key: v for key, v in self.options.items() if v != self.what.options[key].default}

    def number(self, key: str) -> float:
        """A numeric option."""
        return float(self.options[key])

    def word(self, key: str) -> str:
        """An option that is a word."""
        return str(self.options[key])

    def __str__(self) -> str:
        """The entry in one line, for timelines."""
        when = (
            f"at {self.at_s:g} s"
            if self.at_s is not None
            else f"at exchange {self.exchange}"
            if self.exchange is not None
            else f"with probability {self.probability:g}"
        )
        rest = ", ".join(f"{k} {v}" for k, v in self.table().items() if k not in ("kind", "on", *WHEN))
        return f"{self.kind}{f' on {self.on}' if self.on else ''} {when}{f' ({rest})' if rest else ''}"


class CanBeDeaf(Protocol):
    """An instrument's wire."""

    def deafen(self, until: float) -> None:
        """Lose every message until a world time."""


@dataclass(frozen=True)
class Striking:
    """A fault at the time it happens, and its targets.

    Attributes:
        fault: the fault.
        until: world time of its end; infinite if it has no duration or never ends.
        note: called with a sentence about the event.
        world: virtual time.
        plant: the physical state.
        twin: the instrument's twin; None for a fault of the whole bench.
        wire: the instrument's wire; likewise.
    """

    fault: Fault
    until: float
    note: Callable[[str], None]
    world: World
    plant: Plant
    twin: Any
    wire: CanBeDeaf | None


Over = Callable[[], None]
Act = Callable[[Striking], Over | None]
"""Makes a fault happen; its return value is called at the end of the fault."""
