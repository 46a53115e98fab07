"""Faults of readings: what an instrument says instead of what is at its input."""

from __future__ import annotations

from collections.abc import Callable
from math import copysign, inf

from sims.faults.fault import Fault
from sims.inputs import Inputs, Tamper
from sims.noise import event_at, normal


def tamper_with(
    inputs: Inputs, fault: Fault, until: float, note: Callable[[str], None], seed: int
) -> Callable[[], None]:
    """Have readings go wrong from now on.

    Args:
        inputs: of the instrument.
        fault: one of overload, frozen-reading, spike, open-circuit.
        until: world time at which it is over; infinite of one that is counted.
        note: told of every reading that is not what it should be.
        seed: key of noise.

    Returns:
        What ends it.

    """
    left = inf if fault.for_s or fault.kind in ("frozen-reading", "open-circuit") else float(fault.times)
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
