"""What goes wrong in a simulated night, drawn: mishaps of controller, machine and building, faults of instruments."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from rig.sims.faults import kinds_of, kinds_on
from rig.sims.twin import TwinClass


@dataclass(frozen=True)
class Mishap:
    """Something that happens to the controller, its machine or the building; instruments' own are `[[faults]]`.

    Attributes:
        at_s: world time, seconds.
        kind: one of `MISHAPS`.
        options: what it needs besides.

    """

    at_s: float
    kind: str
    options: Mapping[str, float] = field(default_factory=dict)

    def __str__(self) -> str:
        """In words."""
        more = ", ".join(f"{name} {value:g}" for name, value in self.options.items())
        return f"{MISHAPS[self.kind]}{f' ({more})' if more else ''}"


MISHAPS: Mapping[str, str] = {
    "kill": "the controller is killed with SIGKILL",
    "reboot": "the controller's machine restarts; the instruments stay on",
    "power-cut": "the building loses power: controller and instruments",
    "terminate": "the controller gets SIGTERM",
    "hold": "somebody asks the run to hold, and releases it later",
    "stop": "somebody stops the run",
    "no-memory": "the controller runs out of memory",
    "disk-full": "the disk is full, and is cleared later",
    "failed-sync": "the disk fails to make something durable",
    "slow-disk": "the disk is slow for a while",
    "answer": "somebody says that weights were set, unasked, twice, or with a value",
    "suspend": "the controller's process is stopped, or its machine asleep, and goes on later",
}


def suspended(seed: int, drawn_by: str, lasts_s: float) -> Iterator[Mishap]:
    """In every second night one; drawn apart, so that nights known by their seed stay what they were."""
    rng = random.Random(f"suspend {drawn_by} {seed}")
    if rng.random() < 0.5:
        return
    for_s = rng.choice((5.0, 40.0, 60.0, 400.0, 900.0, 2500.0, 20_000.0))
    yield Mishap(round(rng.uniform(0.0, 1.2 * lasts_s), 3), "suspend", {"for_s": for_s})


_APART = {"suspend", "answer"}
"""Not among the mishaps that every laboratory draws; or nights known by their seed would become others."""


def drawn(rng: random.Random, at_s: float, answers: Sequence[float | None] = ()) -> Mishap:
    """A mishap at this world time; `answers` are what somebody may say where a person sets something."""
    kind = rng.choice(tuple(kind for kind in MISHAPS if kind not in _APART))
    options: dict[str, float] = {}
    if answers and rng.random() < 0.4:
        value = rng.choice(answers)
        return Mishap(round(at_s, 3), "answer", {} if value is None else {"value": value})
    if kind in ("hold", "slow-disk"):
        options = {"for_s": rng.choice((20.0, 200.0, 1000.0))}
    elif kind == "disk-full":
        options = {"room_bytes": rng.choice((0.0, 500.0, 5000.0))}
    elif kind == "failed-sync":
        options = {"nth": rng.randint(1, 4)}
    return Mishap(round(at_s, 3), kind, options)


_DULL = frozenset({"late-reply", "no-reply", "garbled", "truncated", "duplicated", "wrong-reply", "modbus-exception"})
"""Faults of single exchanges: they come in small bursts."""


def fault(rng: random.Random, twins: Mapping[str, TwinClass], at_s: float) -> dict[str, float | str]:
    """A fault of any kind that the bench can have, as values of its table in the world file."""
    kinds = kinds_on(twins.values())
    names = tuple(kinds)
    while True:
        name = rng.choice(names)
        kind = kinds[name]
        on = [n for n, twin in twins.items() if name in kinds_of(twin)]
        if kind.of_bench or on:
            break
    found: dict[str, float | str] = {"kind": name, "at_s": round(at_s, 3)}
    if on:
        whom = found["on"] = rng.choice(on)
        kind = kinds_of(twins[whom])[name]
    if kind.counts and rng.random() < 0.5:
        found["times"] = rng.choice((1, 2, 3, 8) if name in _DULL else (1, 3))
    if kind.lasts_s and not kind.of_bench:
        found["for_s"] = round(kind.lasts_s * rng.choice((0.2, 1.0, 3.0)), 1)
    for key, option in kind.options.items():
        if option.words and rng.random() < 0.5:
            found[key] = rng.choice(option.words)
    if name == "slip":
        found["encoder"] = (
            "sees"  # a table that slips on its encoder's shaft shows nowhere but in the data: `rig trace`
        )
    return found


def table(values: Mapping[str, float | str]) -> str:
    """The same as text."""
    lines = (f"{key} = {json.dumps(value)}\n" for key, value in values.items())
    return "[[faults]]\n" + "".join(lines)
