"""What happens in a simulated night: the laboratory, the procedure, and everything that goes wrong, drawn from a seed.

A night is its scenario and nothing else: the same seed plays the same night, byte for byte, on every machine.
"""

from __future__ import annotations

import json
import random
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

from rig.examples import example
from rig.simulated.dry_run import twin_class
from sims.faults import kinds_of, kinds_on
from sims.twin import TwinClass

Lab = Literal["attitude", "pressure", "load-cell"]
Size = Literal["brief", "short", "full"]
LABS: tuple[Lab, ...] = ("attitude", "pressure")
EVERY_LAB: tuple[Lab, ...] = (*LABS, "load-cell")

_ATTITUDE = """\
kind = "pitch-roll"
name = "night"
seed = {seed}
replications = {replications}
[design]
type = "D"
pitch_deg = {pitch}
roll_deg = {roll}
[order]
type = "{order}"
[settle]
dwell_s = 2
[measure]
readings = {readings}
max_sd_V = 0.0005
[environment]
setpoint_degC = 23
dwell_s = 60
[recovery]
max_gap_s = 900
hold_max_s = 1800
"""

_PRESSURE = """\
kind = "whole-plot"
name = "night"
seed = {seed}
[design]
type = "list"
temperatures_degC = {temperatures}
pressures_psia = {pressures}
repeated_psia = {repeated}
[model]
formula = "1 + P"
[soak]
dwell_s = 60
drift_degC_per_h = 20
poll_s = 58
[settle]
dwell_s = 4
poll_s = 4
[measure]
readings = {readings}
max_sd_mV = 0.01
[recovery]
continue_gap_s = 600
hold_max_s = 1800
whole_plot_repeats = 10
"""

_LOAD_CELL = """\
kind = "general"
name = "night"
seed = {seed}
replications = {replications}
[factors.force_kN]
levels = {levels}
order = "{order}"
[settle]
dwell_s = 3
[measure]
readings = {readings}
max_sd_V = 0.0005
[faults]
noisy = ["retry 10", "skip"]
[model]
formula = "1 + force_kN"
[recovery]
max_gap_s = 900
hold_max_s = 1800
"""

_LOAD_CELL_WORLD = """\
seed = {seed}
[sensors.cell]
formula = "0.012 + 0.5*force_kN"
noise = 2e-5
[person]
sets_s = {sets_s}
"""
LOAD_CELL_V, LOAD_CELL_V_PER_KN = 0.012, 0.5
"""Offset and sensitivity of the load cell of these nights."""

_ATTITUDE_WORLD = """\
seed = {seed}
[lab]
daily_amplitude_degC = 0.5
[enclosure]
leak = 0.05
"""

_PRESSURE_WORLD = """\
seed = {seed}
[lab]
daily_amplitude_degC = 0.5
[sensors]
"""

_STRAIGHT = (
    "{name} = {{ offset_mV = {offset:g}, sensitivity_mV_per_psi = {sensitivity:g}, nonlinearity_uV_per_psi2 = 0, "
    "offset_uV_per_degC = 0, offset_nV_per_degC2 = 0, sensitivity_ppm_per_degC = 0, sse_offset_uV_per_degC = 0, "
    "sse_offset_nV_per_degC2 = 0, sse_gain_ppm_per_degC = 0, cross_offset_nV_per_degC2 = 0 }}\n"
)
"""A transducer that a straight line describes: what a night does to the data shows in it, and nothing else does."""


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


@dataclass(frozen=True)
class Scenario:
    """A night to be.

    Attributes:
        seed: what all was drawn from.
        lab: which laboratory.
        documents: bench, procedure and world file.
        mishaps: what happens besides the world file's faults, in order of time.
        gaps_s: how long the bench is left alone after each of the first sessions.
        fold_pages: pages after which the run file's log is folded into it; short nights would never come to it.

    """

    seed: int
    lab: Lab
    documents: Mapping[str, str]
    mishaps: tuple[Mishap, ...]
    gaps_s: tuple[float, ...]
    fold_pages: int


_LASTS_S: Mapping[Lab, Mapping[Size, float]] = {
    "attitude": {"brief": 150.0, "short": 730.0, "full": 28 * 3600.0},
    "pressure": {"brief": 1500.0, "short": 5500.0, "full": 37 * 3600.0},
    "load-cell": {"brief": 200.0, "short": 900.0, "full": 5000.0},
}
"""How long a night without trouble takes."""


_HAPPENING: Mapping[Size, tuple[int, int]] = {"brief": (1, 2), "short": (2, 5), "full": (6, 20)}
"""How many mishaps, and how many faults of instruments and wires, a night has."""

_DRAWN_BY: Mapping[Size, str] = {"brief": "brief", "short": "False", "full": "True"}
"""Part of what a night is drawn from; as it is, or nights known by their seed would become others."""


def draw(
    seed: int, lab: Lab, *, size: Size = "short", calm: bool = False, bench: Mapping[str, str] | None = None
) -> Scenario:
    """The night of a seed.

    Args:
        seed: any whole number.
        lab: which laboratory.
        size: "full" is the example's whole procedure.
        calm: the same night with nothing going wrong.
        bench: another bench for the laboratory's procedures, "bench.toml" and the contract files that it names; None
            for the example's own.
    """
    full = size == "full"
    rng = random.Random(f"{lab} {_DRAWN_BY[size]} {seed}")
    lasts = _LASTS_S[lab][size]
    mishaps, faults = _HAPPENING[size]
    folder = example(f"{lab}-lab")
    if bench is None:
        text = (folder / "bench.toml").read_text(encoding="utf-8")
        bench = {"bench.toml": text if full else _fewer(text)}
    tables = tomllib.loads(bench["bench.toml"])
    happening = sorted(
        (_mishap(rng, rng.uniform(0.0, 1.2 * lasts), lab) for _ in range(mishaps)), key=lambda mishap: mishap.at_s
    )
    gaps = tuple(rng.choice((2.0, 30.0, 120.0, 700.0, 2000.0)) for _ in range(20))
    world = _world(rng.randrange(2**31), lab, tables["sensors"], rng)
    twins = {name: twin_class(str(table["driver"])) for name, table in tables["instruments"].items()}
    entries = [_fault(rng, twins, rng.uniform(0.0, lasts)) for _ in range(faults)]
    documents = {
        **bench,
        "procedure.toml": (folder / "procedure.toml").read_text(encoding="utf-8")
        if full
        else _procedure(rng, lab, size),
        "world.toml": world + "".join(map(_table, () if calm else entries)),
    }
    happening = sorted([*happening, *_suspended(seed, lab, size, lasts)], key=lambda mishap: mishap.at_s)
    fold_pages = _SQLITES_OWN if full else rng.choice((3, 10, 40, _SQLITES_OWN))
    return Scenario(seed, lab, documents, () if calm else tuple(happening), gaps, fold_pages)


_SQLITES_OWN = 1000


def _world(seed: int, lab: Lab, sensors: Iterable[str], rng: random.Random) -> str:
    if lab == "load-cell":
        return _LOAD_CELL_WORLD.format(seed=seed, sets_s=rng.choice((5, 30, 90, 700)))
    if lab == "attitude":
        return _ATTITUDE_WORLD.format(seed=seed)
    transducers = (
        _STRAIGHT.format(name=name, offset=0.1 * n, sensitivity=1.9 + 0.03 * n) for n, name in enumerate(sensors, 1)
    )
    return _PRESSURE_WORLD.format(seed=seed) + "".join(transducers)


def _fewer(bench: str) -> str:
    """A bench of which the third transducer and those after it are left out: short nights are to be many."""
    tables = re.split(r"(?m)^(?=\[)", bench)
    kept = [table for table in tables if not re.match(r"\[sensors\.bridge_[3-9]\]", table)]
    return re.sub(r'"10[3-7]" = "volts", (?=.*"108")', "", "".join(kept))


def _suspended(seed: int, lab: Lab, size: Size, lasts_s: float) -> Iterator[Mishap]:
    """In every second night one; drawn apart, so that nights known by their seed stay what they were."""
    rng = random.Random(f"suspend {lab} {_DRAWN_BY[size]} {seed}")
    if rng.random() < 0.5:
        return
    for_s = rng.choice((5.0, 40.0, 60.0, 400.0, 900.0, 2500.0, 20_000.0))
    yield Mishap(round(rng.uniform(0.0, 1.2 * lasts_s), 3), "suspend", {"for_s": for_s})


_APART = {"suspend", "answer"}
"""Not among the mishaps that every laboratory draws; or nights known by their seed would become others."""


def _mishap(rng: random.Random, at_s: float, lab: Lab) -> Mishap:
    kind = rng.choice(tuple(kind for kind in MISHAPS if kind not in _APART))
    options: dict[str, float] = {}
    if lab == "load-cell" and rng.random() < 0.4:
        value = rng.choice((None, None, -3.0, 2.05, 1e9, float("nan")))
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


def _fault(rng: random.Random, twins: Mapping[str, TwinClass], at_s: float) -> dict[str, float | str]:
    """A fault of any kind that the bench can have, as its table in the world file."""
    kinds = kinds_on(twins.values())
    names = tuple(kinds)
    while True:
        name = rng.choice(names)
        kind = kinds[name]
        on = [n for n, twin in twins.items() if name in kinds_of(twin)]
        if kind.of_bench or on:
            break
    table: dict[str, float | str] = {"kind": name, "at_s": round(at_s, 3)}
    if on:
        whom = table["on"] = rng.choice(on)
        kind = kinds_of(twins[whom])[name]
    if kind.counts and rng.random() < 0.5:
        table["times"] = rng.choice((1, 2, 3, 8) if name in _DULL else (1, 3))
    if kind.lasts_s and not kind.of_bench:
        table["for_s"] = round(kind.lasts_s * rng.choice((0.2, 1.0, 3.0)), 1)
    for key, option in kind.options.items():
        if option.words and rng.random() < 0.5:
            table[key] = rng.choice(option.words)
    if name == "slip":
        table["encoder"] = (
            "sees"  # a table that slips on its encoder's shaft shows nowhere but in the data: `rig trace`
        )
    return table


def _table(values: Mapping[str, float | str]) -> str:
    lines = (f"{key} = {json.dumps(value)}\n" for key, value in values.items())
    return "[[faults]]\n" + "".join(lines)


def _procedure(rng: random.Random, lab: Lab, size: Size) -> str:
    """A short procedure: 2 x 12 points, or 4 whole plots of 3 pressures; a brief one: 4 points, or 2 plots of 2."""
    brief = size == "brief"
    if lab == "attitude":
        return _ATTITUDE.format(
            seed=rng.randrange(1000),
            replications=1 if brief else 2,
            pitch=[-60, 60] if brief else [-60, 0, 60],
            roll=[0, 90] if brief else [-120, 0, 90, 120],
            order=rng.choice(("serpentine", "random")),
            readings=rng.choice((3, 4)),
        )
    if lab == "load-cell":
        return _LOAD_CELL.format(
            seed=rng.randrange(1000),
            replications=1 if brief else 2,
            levels=[0, 2, 5] if brief else [0, 1, 2, 5],
            order=rng.choice(("up-down", "random")),
            readings=rng.choice((4, 5)),  # more than a spike lasts: the same error in all readings shows nowhere
        )
    return _PRESSURE.format(
        seed=rng.randrange(1000),
        temperatures=[[20, 26], [26, 20], [20, 20], [26, 26]][: 2 if brief else 4],
        pressures=[0.12, 2.5] if brief else [0.12, 1.0, 2.5],
        repeated=[],
        readings=rng.choice((2, 3)),
    )
