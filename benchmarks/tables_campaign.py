"""Figures of the trace on tables of any kind, over many seeds; each by one command from the project's root.

    python -m benchmarks.tables_campaign noise --seeds 200     anything reported where nothing is, any noise and shape
    python -m benchmarks.tables_campaign effects --seeds 20    every effect, at 0.25, 0.5 and 1 sd rms
    python -m benchmarks.tables_campaign pairs --seeds 20      two effects at once, each at 1 sd rms
    python -m benchmarks.tables_campaign real FOLDER           measured tables, as FOLDER/commands.toml says
    python -m benchmarks.tables_campaign speed                 1,000 rows of six columns

The laboratory is proving/truth/table.py, which shares no code with the fitter.
"""

from __future__ import annotations

import argparse
import os
import sys
import tomllib
from collections import Counter
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from time import process_time
from typing import Any

from rig.tables import FileSource

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np

from procedures.general.column_roles import Roles, roles_of
from procedures.general.evaluate import trace_general_table
from procedures.general.trace import search_table, trace_general
from procedures.table import Table
from proving.truth.table import MISSING, Lab, options, simulate

NOISE: dict[str, dict[str, Any]] = {
    "white": {},
    "outliers 3 %": {"outliers": 0.03},
    "AR 0.3": {"ar": 0.3},
    "AR 0.6": {"ar": 0.6},
    "AR 0.9": {"ar": 0.9},
    "walk to 3 sd": {"walk": 3.0},
    "walk to 10 sd": {"walk": 10.0},
    "1/f of 2 sd": {"flicker": 2.0},
    "sd grows five times": {"growing": 5.0},
    "5 replications": {"repeats": 5},
    "6 whole plots": {"plots": 6},
}
SIZES = {8: 0.08, 12: 0.14, 16: 0.14, 24: 0.14, 40: 0.14, 80: 0.14, 160: 0.1, 300: 0.08, 1000: 0.04}
"""Rows of tables, and how often each is drawn."""


def shape(seed: int) -> Lab:
    """A table of any shape, no two alike: rows, columns, order of the settings, with and without a clock."""
    rng = np.random.default_rng([11, seed])
    return Lab(
        n=int(rng.choice(list(SIZES), p=list(SIZES.values()))),
        covariates=int(rng.integers(7)),
        groups=int(rng.choice([0, 4])),
        clock=bool(rng.random() < 0.6),
        sides=bool(rng.random() < 0.2),
        design=str(rng.choice(["random", "sweeps", "rising"])),
    )


def found(columns: dict[str, Any], told: dict[str, Any]) -> list[str]:
    """Names of the effects that are reported, findings about the noise left out."""
    data, _ = roles_of(Table("simulated", columns, True, {}), Roles(**told))
    result = search_table(data)
    return list(dict.fromkeys(result.judge.candidates[j].effect.name for j in result.chosen))


def found_or_alike(columns: dict[str, Any], told: dict[str, Any]) -> dict[str, list[str]]:
    """The same with the aliases of each."""
    data, _ = roles_of(Table("simulated", columns, True, {}), Roles(**told))
    result = search_table(data)
    names = dict.fromkeys(result.judge.candidates[j].effect.name for j in result.chosen)
    return {name: [r.effect for r in result.judge.rivals(result.chosen, name) if r.alias] for name in names}


def noise(seeds: range, only: str) -> None:
    """How often anything is reported where nothing is missing, by noise, and by number of rows, order and clock."""
    by: dict[str, list[bool]] = {}
    for name, more in NOISE.items():
        if only not in name:
            continue
        began, which, hits = process_time(), Counter[str](), 0
        for seed in seeds:
            lab = replace(shape(seed), **more)
            names = found(simulate(lab, seed), options(lab))
            which.update(one.split(":")[0] for one in names)
            hits += bool(names)
            for part in (f"{lab.n} rows", lab.design, "clock" if lab.clock else "no clock"):
                by.setdefault(part, []).append(bool(names))
        took = (process_time() - began) / len(seeds)
        print(f"{name:20s} {hits:4d} of {len(seeds)}  {took:5.2f} s  {dict(which.most_common(6))}", flush=True)
    every = [hit for part in ("clock", "no clock") for hit in by.get(part, [])]
    for part, hit in (("all", every), *sorted(by.items())):
        print(f"    {part:12s} {sum(hit):4d} of {len(hit)}", flush=True)


def effects(seeds: range, only: str) -> None:
    """How often every effect is found by its name + as an alias of what was named (and anything besides)."""
    for name, missing in MISSING.items():
        if only not in name:
            continue
        row = []
        for rms in (0.25, 0.5, 1.0):
            hits = stood_in = others = 0
            for seed in seeds:
                names = found_or_alike(simulate(missing.lab, seed, missing.at(rms)), options(missing.lab))
                right = [n for n in names if n.startswith(missing.named)]
                alike = [n for n, a in names.items() if n not in right and any(b.startswith(missing.named) for b in a)]
                hits += bool(right)
                stood_in += bool(alike) and not right
                others += len(names) > len(right) + len(alike)
            row.append(f"{hits:3d} + {stood_in} ({others})")
        print(
            f"{name:16s} n {missing.lab.n:4d}  0.25: {row[0]}  0.5: {row[1]}  1: {row[2]}  of {len(seeds)}", flush=True
        )


def pairs(seeds: range, only: str) -> None:
    """Two effects at once, each at one sd rms: both found, and anything besides."""
    lab = Lab(160, 2, groups=4, clock=True, sides=True)
    chosen = ("curvature", "temperature", "drift", "step", "direction", "carry-over", "wave")
    for first, second in combinations(chosen, 2):
        if only not in f"{first} {second}":
            continue
        both = others = 0
        for seed in seeds:
            adds = [MISSING[name].at(1.0) for name in (first, second)]
            names = found(simulate(lab, seed, lambda c, r, adds=adds: sum(a(c, r) for a in adds)), options(lab))
            expected = [MISSING[name].named for name in (first, second)]
            both += all(any(n.startswith(e) for n in names) for e in expected)
            others += any(not n.startswith(tuple(p for e in expected for p in e)) for n in names)
        print(f"{first} and {second}: both {both}, besides {others} of {len(seeds)}", flush=True)


def real(folder: Path, only: str) -> None:
    """Measured tables: verdict, error before and after, effects; against the error that is to be reached.

    FOLDER/commands.toml has a table for each: `file`, the options of `rig trace` (response, formula, group, ...) and
    `sigma`, the standard error that the effects known of it lead to.
    """
    for name, entry in tomllib.loads((folder / "commands.toml").read_text()).items():
        if only not in name:
            continue
        told = {key: tuple(v) if isinstance(v, list) else v for key, v in entry.items() if key not in ("file", "sigma")}
        began = process_time()
        traced = trace_general_table(FileSource(folder / entry["file"]).read, Roles(**told))
        trace, took = traced.trace, process_time() - began
        before, after = trace.before, trace.after
        print(
            f"{name}: {trace.verdict}; sigma {before.fit.sigma_E:.4g} -> {after.fit.sigma_E:.4g}, "
            f"{after.fit.sigma_E / entry['sigma']:.2f} of {entry['sigma']:.4g}; left out {before.cv_rms or 0:.4g} -> "
            f"{after.cv_rms or 0:.4g}; {took:.1f} s"
        )
        for effect in trace.effects:
            print(
                f"    {effect.effect} ({effect.share:.1%}, p {effect.p_adjusted:.2g}) {', '.join(effect.aliases[:3])}"
            )
        for rest in trace.unnamed:
            print(f"    left: {rest.where}", flush=True)


def speed() -> None:
    """Processor time of a whole trace, left-out error included: 1,000 rows of six columns."""
    lab = Lab(1000, 4, clock=True)
    for name, effect in (("nothing missing", None), ("temperature", MISSING["temperature"].at(1.0))):
        columns = simulate(lab, 1, effect)
        began = process_time()
        data, _ = roles_of(Table("simulated", columns, True, {}), Roles(**options(lab)))
        verdict = trace_general(data).verdict
        print(f"{name}: {verdict}, {process_time() - began:.1f} s", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=["noise", "effects", "pairs", "real", "speed"])
    parser.add_argument("folder", nargs="?", type=Path)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    seeds = range(given.first, given.first + given.seeds)
    if given.what == "speed":
        speed()
    elif given.what == "real":
        if given.folder is None:
            parser.error("real needs the folder of the tables")
        real(given.folder, given.only)
    else:
        {"noise": noise, "effects": effects, "pairs": pairs}[given.what](seeds, given.only)


if __name__ == "__main__":
    main()
