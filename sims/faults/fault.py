"""What a fault is: its kind, whom it happens to, when, and how it is made to happen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from sims.faults.faulty_wire import FaultyWire
    from sims.physics import Plant
    from sims.world import World

Counts = Literal["", "exchanges", "frames", "readings"]
"""What `times` counts; "" if the kind happens once or lasts."""

WHEN = ("at_s", "exchange", "probability")
"""Keys of which exactly one says when."""


@dataclass(frozen=True)
class Option:
    """A key of one kind.

    Attributes:
        default: its value if not given.
        unit: "" for words and plain numbers.
        meaning: one line.
        words: what a word may be; () for a number, or for any word.
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
    """What may go wrong.

    A fault of an instrument is declared by its twin (`sims.twin.TwinClass.faults`), be it one of
    `sims.faults.instrument_faults` or the twin's own.

    Attributes:
        name: as a world file has it.
        sentence: what happens.
        act: makes it happen; None for faults of wires, which `sims.faults.faulty_wire` makes happen.
        wires: kinds of wire it happens on; () if it is no fault of a wire.
        of_bench: it happens to the bench as a whole.
        counts: what `times` counts.
        lasts_s: default of `for_s`; 0 if it is over at once.
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
    """What goes wrong, where and when. Exactly one of `at_s`, `exchange` and `probability` says when.

    Attributes:
        what: its kind.
        on: the instrument's name on the bench; "" for the bench as a whole.
        at_s: world time.
        exchange: the nth message from host to instrument in this session, from 1.
        probability: of every exchange.
        times: how many exchanges, frames or readings are affected from then on.
        for_s: how long, 0 for the kind's own; of what is counted, everything within this time, if not 0.
        options: the kind's own; those not given have their defaults when a world is made of it.

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
        """How long it lasts, seconds; 0 if it is over at once."""
        return self.for_s or self.what.lasts_s

    def table(self) -> dict[str, Any]:
        """The entry as a world file has it, without what is the default."""
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


@dataclass(frozen=True)
class Striking:
    """A fault that happens now, and what it happens to.

    Attributes:
        fault: which.
        until: world time at which it is over; infinite if it is over at once or never.
        note: told what happens, in words.
        world: virtual time.
        plant: what is physically there.
        twin: the instrument's; None of a fault of the bench as a whole.
        wire: the instrument's; likewise.

    """

    fault: Fault
    until: float
    note: Callable[[str], None]
    world: World
    plant: Plant
    twin: Any
    wire: FaultyWire | None


Over = Callable[[], None]
Act = Callable[[Striking], Over | None]
"""Makes a fault happen; what it returns is called when the fault is over."""
