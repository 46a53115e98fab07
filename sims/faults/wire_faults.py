"""Faults of wires: possible errors of messages on any serial line, Modbus or CAN, with any instrument."""

from __future__ import annotations

from rig.sims.fault import Kind, Option

ANY_WIRE = ("serial", "modbus", "can")
_DELAY = Option(3.0, "s", "how late; what the instrument sends meanwhile waits behind it", low=0.0)

OF_WIRES = (
    Kind(
        "no-reply",
        "The instrument does not answer, or never hears the question.",
        wires=ANY_WIRE,
        counts="exchanges",
        options={"lost": Option("reply", "", "what is lost: a lost request is not carried out", ("reply", "request"))},
    ),
    Kind(
        "late-reply",
        "The answer comes after the driver has given up waiting, before all later ones.",
        wires=ANY_WIRE,
        counts="exchanges",
        options={"delay_s": _DELAY},
    ),
    Kind(
        "garbled",
        "Bytes arrive changed, as characters that nobody sends; on Modbus in the frame's head.",
        wires=("serial", "modbus"),
        counts="exchanges",
    ),
    Kind(
        "truncated",
        "Part of the answer is missing.",
        wires=("serial", "modbus"),
        counts="exchanges",
        options={"lost": Option("tail", "", "which part", ("tail", "head", "middle"))},
    ),
    Kind(
        "duplicated",
        "Bytes of the answer come twice.",
        wires=("serial", "modbus"),
        counts="exchanges",
        options={"what": Option("reply", "", "the whole reply, or one byte in its middle", ("reply", "byte"))},
    ),
    Kind(
        "wrong-reply",
        "A valid answer, but to the instrument's previous question, or another instrument's.",
        wires=ANY_WIRE,
        counts="exchanges",
        options={"of": Option("previous", "", "whose answer it is", ("previous", "another"))},
    ),
    Kind(
        "unplugged",
        "The adapter or network cable is pulled and put back; who had it open must open it again.",
        wires=ANY_WIRE,
        lasts_s=20.0,
    ),
    Kind(
        "modbus-exception",
        "The device refuses with a Modbus exception and does nothing.",
        wires=("modbus",),
        counts="exchanges",
        options={"code": Option(4.0, "", "exception code; 6 is busy", low=1, high=255)},
    ),
    Kind(
        "wrong-unit",
        "The answer carries another unit's number.",
        wires=("modbus",),
        counts="exchanges",
        options={"unit": Option(77.0, "", "the number it carries", low=0, high=255)},
    ),
    Kind(
        "bus-off",
        "The CAN controller has gone bus-off: nothing can be sent and nothing is heard.",
        wires=("can",),
        lasts_s=1.0,
    ),
    Kind(
        "lost-frame",
        "A frame from the instrument never arrives.",
        wires=("can",),
        counts="frames",
        options={"skip": Option(0.0, "", "frames that arrive before it", low=0)},
    ),
    Kind(
        "repeated-frame",
        "A frame from the instrument arrives twice.",
        wires=("can",),
        counts="frames",
        options={"skip": Option(0.0, "", "frames that arrive before it", low=0)},
    ),
)
