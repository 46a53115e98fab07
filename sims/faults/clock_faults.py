"""Faults of the whole bench: those of the clock."""

from __future__ import annotations

from rig.sims.fault import Kind, Option, Over, Striking


def _step(striking: Striking) -> Over:
    amount, world = striking.fault.number("amount_s"), striking.world
    world.step_utc(amount)
    striking.note(f"UTC stepped by {amount:+g} s")
    return lambda: world.step_utc(-amount)


def _change_local_time(striking: Striking) -> Over:
    amount, world = striking.fault.number("amount_s"), striking.world
    world.local_offset_s += amount
    striking.note(f"local time moved by {amount:+g} s; UTC did not")

    def back() -> None:
        world.local_offset_s -= amount

    return back


_FOR_EVER = float("inf")
_AMOUNT = Option(3600.0, "s", "size of the step; negative is backwards")

OF_THE_BENCH = (
    Kind(
        "clock-step",
        "UTC is stepped, and set right again when this is over; durations are not touched.",
        _step,
        of_bench=True,
        lasts_s=_FOR_EVER,
        options={"amount_s": _AMOUNT},
    ),
    Kind(
        "dst",
        "Local time changes as it does in spring or autumn; UTC does not move.",
        _change_local_time,
        of_bench=True,
        lasts_s=_FOR_EVER,
        options={"amount_s": _AMOUNT},
    ),
)
