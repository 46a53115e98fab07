"""Faults of readings: a reported value that differs from the input's value. For twins that have `inputs`."""

from __future__ import annotations

from math import copysign, inf

from rig.sims.fault import Kind, Option, Over, Striking
from rig.sims.inputs import Inputs, Tamper
from rig.sims.noise import event_at, normal


def tamper_with(striking: Striking) -> Over:
    """Alter readings of the twin's `inputs` from now on, with a note for each. Returns a function that ends it."""
    fault, seed, note = striking.fault, striking.plant.truth.seed, striking.note
    inputs: Inputs = striking.twin.inputs
    lasting = bool(fault.lasts_s)
    until = striking.until if lasting else inf
    left = inf if lasting else float(fault.times)
    concerned = fault.options["channel"]
    frozen = dict(inputs.latest)

    def wrong(channel: str, unit: str, t: float, value: float) -> float:
        match fault.kind:
            case "overload":
                return copysign(inputs.overload, value)
            case "frozen-reading":
                return frozen.setdefault(channel, value)
            case "spike":
                return value + fault.number(f"amount_{unit}")
        if unit == "V" and not inputs.told_open:
            return fault.number("wander_V") * normal(seed, f"{fault.on}/{channel}/open", event_at(t))
        return inf if inputs.told_open else inputs.overload

    def tamper(channel: str, unit: str, t: float, value: float) -> float:
        nonlocal left
        if left <= 0 or not t < until or concerned not in ("", channel):
            return value
        left -= 1
        if left <= 0:
            end()
        said = wrong(channel, unit, t, value)
        note(f"{channel} reads {said:.9g} {unit} instead of {value:.9g}")
        return said

    def end() -> None:
        if tamper in inputs.tampers:
            inputs.tampers.remove(tamper)

    made: Tamper = tamper
    inputs.tampers.append(made)
    return end


_CHANNEL = Option("", "", "which input; all of them if not given")

OVERLOAD = Kind(
    "overload", "Readings are outside the range.", tamper_with, counts="readings", options={"channel": _CHANNEL}
)
FROZEN = Kind(
    "frozen-reading", "Readings repeat the last one.", tamper_with, lasts_s=60.0, options={"channel": _CHANNEL}
)
SPIKE = Kind(
    "spike",
    "A reading is off.",
    tamper_with,
    counts="readings",
    options={
        "channel": _CHANNEL,
        "amount_V": Option(0.01, "V", "by how much, of a voltage"),
        "amount_degC": Option(1.0, "degC", "by how much, of a temperature"),
        "amount_psi": Option(0.05, "psi", "by how much, of a pressure"),
    },
)
OPEN_CIRCUIT = Kind(
    "open-circuit",
    "A sensor's wire is broken: a thermometer reads as open, a voltage wanders; "
    "a temperature controller has no process value.",
    tamper_with,
    lasts_s=60.0,
    options={"channel": _CHANNEL, "wander_V": Option(0.05, "V", "standard deviation of an open input", low=0.0)},
)

OF_READINGS = (OVERLOAD, FROZEN, SPIKE, OPEN_CIRCUIT)
"""Faults of a meter or data-acquisition unit."""
