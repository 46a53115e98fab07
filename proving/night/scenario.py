"""What happens in a simulated night: the laboratory, the procedure, and everything that goes wrong, drawn from a seed.

A night is its scenario and nothing else: the same seed plays the same night, byte for byte, on every machine.
"""

from __future__ import annotations

import random
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from proving.night import any_bench
from proving.night.any_laboratory import AnyLaboratory
from proving.night.mishaps import Mishap, drawn, fault, suspended, table
from rig.examples import example, laboratories
from rig.simulated.dry_run import twin_class

Size = Literal["brief", "short", "full"]
LABS = ("attitude", "pressure")
"""Laboratories with kinds of their own; all others are of the general kind."""
EVERY_LAB = (*LABS, *(name for name in laboratories() if name not in LABS))
"""Every example laboratory: whoever adds one has its nights."""

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
    lab: str
    documents: Mapping[str, str]
    mishaps: tuple[Mishap, ...]
    gaps_s: tuple[float, ...]
    fold_pages: int


_LASTS_S: Mapping[str, Mapping[Size, float]] = {
    "attitude": {"brief": 150.0, "short": 730.0, "full": 28 * 3600.0},
    "pressure": {"brief": 1500.0, "short": 5500.0, "full": 37 * 3600.0},
}
"""How long a night without trouble takes."""


_HAPPENING: Mapping[Size, tuple[int, int]] = {"brief": (1, 2), "short": (2, 5), "full": (6, 20)}
"""How many mishaps, and how many faults of instruments and wires, a night has."""

_DRAWN_BY: Mapping[Size, str] = {"brief": "brief", "short": "False", "full": "True"}
"""Part of what a night is drawn from; as it is, or nights known by their seed would become others."""


def draw(
    seed: int, lab: str, *, size: Size = "short", calm: bool = False, bench: Mapping[str, str] | None = None
) -> Scenario:
    """The night of a seed.

    Args:
        seed: any whole number.
        lab: which example laboratory, by its folder `examples/LAB-lab`; or `any-bench`, drawn from the seed.
        size: "full" is the example's whole procedure.
        calm: the same night with nothing going wrong.
        bench: another bench for the laboratory's procedures, "bench.toml" and the contract files that it names; None
            for the example's own.
    """
    full = size == "full"
    drawn_by = f"{lab} {_DRAWN_BY[size]}"
    rng = random.Random(f"{drawn_by} {seed}")
    random_lab = None
    if lab == any_bench.LAB:
        random_lab, bench = any_bench.drawn(random.Random(f"bench {seed}"))
    folder = example(f"{'bath' if random_lab else lab}-lab")
    if bench is None:
        text = (folder / "bench.toml").read_text(encoding="utf-8")
        bench = {"bench.toml": text if full else _fewer(text)}
    tables = tomllib.loads(bench["bench.toml"])
    any_lab = random_lab or (None if lab in LABS else AnyLaboratory.of(folder, tables))
    lasts = _LASTS_S[lab][size] if any_lab is None else any_lab.lasts_s(brief=size == "brief", full=full)
    mishaps, faults = _HAPPENING[size]
    answers = () if any_lab is None else any_lab.answers(rng)
    happening = sorted(
        (drawn(rng, rng.uniform(0.0, 1.2 * lasts), answers) for _ in range(mishaps)), key=lambda mishap: mishap.at_s
    )
    gaps = tuple(rng.choice((2.0, 30.0, 120.0, 700.0, 2000.0)) for _ in range(20))
    world_seed = rng.randrange(2**31)
    world = _world(world_seed, lab, tables["sensors"]) if any_lab is None else any_lab.world(world_seed, rng)
    # an instrument's file stands beside the bench file, by the driver's name there
    texts = {name: f"{text}\n" for name, text in bench.items() if name != "bench.toml"}
    drivers = {name: str(one["driver"]) for name, one in tables["instruments"].items()}
    twins = {name: twin_class(texts.get(driver, driver)) for name, driver in drivers.items()}
    entries = [fault(rng, twins, rng.uniform(0.0, lasts)) for _ in range(faults)]
    if random_lab:
        entries = [one for one in entries if any_bench.shows(one, drivers)]
    if full:
        procedure = (folder / "procedure.toml").read_text(encoding="utf-8")
    else:
        brief = size == "brief"
        procedure = _procedure(rng, lab, brief=brief) if any_lab is None else any_lab.procedure(rng, brief=brief)
    documents = {
        **bench,
        "procedure.toml": procedure,
        "world.toml": world + "".join(map(table, () if calm else entries)),
    }
    happening = sorted([*happening, *suspended(seed, drawn_by, lasts)], key=lambda mishap: mishap.at_s)
    fold_pages = _SQLITES_OWN if full else rng.choice((3, 10, 40, _SQLITES_OWN))
    return Scenario(seed, lab, documents, () if calm else tuple(happening), gaps, fold_pages)


_SQLITES_OWN = 1000


def _world(seed: int, lab: str, sensors: Iterable[str]) -> str:
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


def _procedure(rng: random.Random, lab: str, *, brief: bool) -> str:
    """A short procedure: 2 x 12 points, or 4 whole plots of 3 pressures; a brief one: 4 points, or 2 plots of 2."""
    if lab == "attitude":
        return _ATTITUDE.format(
            seed=rng.randrange(1000),
            replications=1 if brief else 2,
            pitch=[-60, 60] if brief else [-60, 0, 60],
            roll=[0, 90] if brief else [-120, 0, 90, 120],
            order=rng.choice(("serpentine", "random")),
            readings=rng.choice((3, 4)),
        )
    return _PRESSURE.format(
        seed=rng.randrange(1000),
        temperatures=[[20, 26], [26, 20], [20, 20], [26, 26]][: 2 if brief else 4],
        pressures=[0.12, 2.5] if brief else [0.12, 1.0, 2.5],
        repeated=[],
        readings=rng.choice((2, 3)),
    )
