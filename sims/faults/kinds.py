"""The kinds of faults a world file may ask for: whom each may hit, what it takes, what it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Literal

Counts = Literal["", "exchanges", "frames", "readings"]
"""What `times` counts; "" if the kind happens once or lasts."""

HEADS = ("newport-esp301", "cia402-pair")
METERS = ("keysight-34401a", "keysight-34970a")
READERS = (*METERS, "can-daq")
PRESSURE = ("druck-pace",)
CHAMBERS = ("watlow-f4t",)
_ANY_WIRE = ("serial", "modbus", "can")


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

    Attributes:
        sentence: what happens.
        wires: kinds of wire it happens on; () if it is no fault of a wire.
        drivers: instruments it may hit, by driver; () if the wires say, or for the bench as a whole.
        counts: what `times` counts.
        lasts_s: default of `for_s`; 0 if it is over at once.
        options: its own keys.

    """

    sentence: str
    wires: tuple[str, ...] = ()
    drivers: tuple[str, ...] = ()
    counts: Counts = ""
    lasts_s: float = 0.0
    options: Mapping[str, Option] = field(default_factory=dict)

    @property
    def of_bench(self) -> bool:
        """Whether it happens to the bench as a whole."""
        return not (self.wires or self.drivers)

    def hits(self, driver: str, wire: str) -> bool:
        """Whether an instrument with this driver, on this kind of wire, may have it."""
        return wire in self.wires or driver in self.drivers or "any" in self.drivers

    def whom(self) -> str:
        """Whom it may hit, in words."""
        if self.of_bench:
            return "the bench"
        return ", ".join([f"any on {wire}" for wire in self.wires] + list(self.drivers))


_AXIS = Option("pitch", "", "which axis", ("pitch", "roll"))
_CHANNEL = Option("", "", "which input; all of them if not given")
_DELAY = Option(3.0, "s", "how late; what the instrument sends meanwhile waits behind it", low=0.0)

KINDS: Mapping[str, Kind] = {
    # wires
    "no-reply": Kind(
        "The instrument does not answer, or never hears the question.",
        _ANY_WIRE,
        counts="exchanges",
        options={"lost": Option("reply", "", "what is lost: a lost request is not carried out", ("reply", "request"))},
    ),
    "late-reply": Kind(
        "The answer comes after the driver has given up waiting, before all later ones.",
        _ANY_WIRE,
        counts="exchanges",
        options={"delay_s": _DELAY},
    ),
    "garbled": Kind(
        "Bytes arrive changed, as characters that nobody sends; on Modbus in the frame's head.",
        ("serial", "modbus"),
        counts="exchanges",
    ),
    "truncated": Kind(
        "Part of the answer is missing.",
        ("serial", "modbus"),
        counts="exchanges",
        options={"lost": Option("tail", "", "which part", ("tail", "head", "middle"))},
    ),
    "duplicated": Kind(
        "Bytes of the answer come twice.",
        ("serial", "modbus"),
        counts="exchanges",
        options={"what": Option("reply", "", "the whole reply, or one byte in its middle", ("reply", "byte"))},
    ),
    "wrong-reply": Kind(
        "A valid answer, but to the instrument's previous question, or another instrument's.",
        _ANY_WIRE,
        counts="exchanges",
        options={"of": Option("previous", "", "whose answer it is", ("previous", "another"))},
    ),
    "unplugged": Kind(
        "The adapter or network cable is pulled and put back; who had it open must open it again.",
        _ANY_WIRE,
        lasts_s=20.0,
    ),
    "modbus-exception": Kind(
        "The device refuses with a Modbus exception and does nothing.",
        ("modbus",),
        counts="exchanges",
        options={"code": Option(4.0, "", "exception code; 6 is busy", low=1, high=255)},
    ),
    "wrong-unit": Kind(
        "The answer carries another unit's number.",
        ("modbus",),
        counts="exchanges",
        options={"unit": Option(77.0, "", "the number it carries", low=0, high=255)},
    ),
    "bus-off": Kind(
        "The CAN controller has gone bus-off: nothing can be sent and nothing is heard.",
        ("can",),
        lasts_s=1.0,
    ),
    "lost-frame": Kind(
        "A frame from the instrument never arrives.",
        ("can",),
        counts="frames",
        options={"skip": Option(0.0, "", "frames that arrive before it", low=0)},
    ),
    "repeated-frame": Kind(
        "A frame from the instrument arrives twice.",
        ("can",),
        counts="frames",
        options={"skip": Option(0.0, "", "frames that arrive before it", low=0)},
    ),
    # instruments
    "drive-fault": Kind(
        "An axis's amplifier fails: it stops, power goes off.",
        drivers=HEADS,
        options={"axis": _AXIS},
    ),
    "following-error": Kind(
        "An axis falls behind its set-point: its drive gives up.",
        drivers=HEADS,
        options={"axis": _AXIS},
    ),
    "stall": Kind(
        "An axis stops where it is, and no move gets it going until this is over; its controller says nothing.",
        drivers=HEADS,
        lasts_s=60.0,
        options={"axis": _AXIS},
    ),
    "slip": Kind(
        "The table jumps against its encoder, or both jump together.",
        drivers=HEADS,
        options={
            "axis": _AXIS,
            "amount_deg": Option(0.05, "deg", "how far", low=-180.0, high=180.0),
            "encoder": Option("blind", "", "whether the encoder moves with the table", ("blind", "sees")),
        },
    ),
    "overload": Kind(
        "Readings are outside the range.",
        drivers=READERS,
        counts="readings",
        options={"channel": _CHANNEL},
    ),
    "frozen-reading": Kind(
        "Readings repeat the last one.",
        drivers=(*READERS, *PRESSURE, *CHAMBERS),
        lasts_s=60.0,
        options={"channel": _CHANNEL},
    ),
    "spike": Kind(
        "A reading is off.",
        drivers=(*READERS, *PRESSURE, *CHAMBERS),
        counts="readings",
        options={
            "channel": _CHANNEL,
            "amount_V": Option(0.01, "V", "by how much, of a voltage"),
            "amount_degC": Option(1.0, "degC", "by how much, of a temperature"),
            "amount_psi": Option(0.05, "psi", "by how much, of a pressure"),
        },
    ),
    "open-circuit": Kind(
        "A sensor's wire is broken: a thermometer reads as open, a voltage wanders; "
        "a temperature controller has no process value.",
        drivers=(*READERS, *CHAMBERS),
        lasts_s=60.0,
        options={"channel": _CHANNEL, "wander_V": Option(0.05, "V", "standard deviation of an open input", low=0.0)},
    ),
    "error-queue-overflow": Kind(
        "The instrument's error queue runs over with errors nobody caused.",
        drivers=(*METERS, *PRESSURE, "newport-esp301"),
    ),
    "power-cycle": Kind(
        "The instrument goes off and comes on again: it forgets its settings; a head loses its reference.",
        drivers=("any",),
        lasts_s=2.0,
    ),
    "supply-failure": Kind(
        "A pressure source fails: the supply falls, or the vacuum pump lets go to the atmosphere.",
        drivers=PRESSURE,
        lasts_s=1800.0,
        options={
            "source": Option("supply", "", "which", ("supply", "vacuum")),
            "supply_psia": Option(0.0, "psia", "what the supply falls to", low=0.0),
        },
    ),
    "chamber-alarm": Kind(
        "The temperature controller raises an alarm; it goes on controlling.",
        drivers=CHAMBERS,
        lasts_s=600.0,
        options={
            "number": Option(1.0, "", "which alarm", low=1, high=14),
            "state": Option("high", "", "which way", ("high", "low", "error")),
            "limit_degC": Option(60.0, "degC", "the limit that it says was passed"),
        },
    ),
    "door-open": Kind(
        "The chamber's door stands open: it does not control, and its air goes to the laboratory's.",
        drivers=CHAMBERS,
        lasts_s=300.0,
        options={"time_constant_s": Option(120.0, "s", "how fast the air goes there", low=1.0)},
    ),
    # the clock
    "clock-step": Kind(
        "UTC is stepped, and set right again when this is over; durations are not touched.",
        lasts_s=inf,
        options={"amount_s": Option(3600.0, "s", "how far forward, negative back")},
    ),
    "dst": Kind(
        "Local time changes as it does in spring or autumn; UTC does not move.",
        lasts_s=inf,
        options={"amount_s": Option(3600.0, "s", "how far forward, negative back")},
    ),
}
"""Kind by the name a world file uses."""
