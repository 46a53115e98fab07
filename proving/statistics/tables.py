"""The trace of tables of any kind; the laboratory is proving/truth/table.py."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from proving.frame import Figures, Part, Results, Study, pooled
from proving.ledger import Result
from proving.truth.table import MISSING, Lab, options, simulate
from rig.errors import UsageError
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.evaluate import trace_general_table
from rig.procedures.general.trace import search_table
from rig.procedures.tables.table import Table
from rig.tables import FileSource

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


def found_or_alike(columns: dict[str, Any], told: dict[str, Any]) -> dict[str, list[str]]:
    """Names of the effects that are reported, findings about the noise left out, with the aliases of each."""
    data, _ = roles_of(Table("simulated", columns, True, {}), Roles(**told))
    result = search_table(data)
    names = dict.fromkeys(result.judge.candidates[j].effect.name for j in result.chosen)
    return {name: [r.effect for r in result.judge.rivals(result.chosen, name) if r.alias] for name in names}


def _found(columns: dict[str, Any], told: dict[str, Any]) -> list[str]:
    data, _ = roles_of(Table("simulated", columns, True, {}), Roles(**told))
    result = search_table(data)
    return list(dict.fromkeys(result.judge.candidates[j].effect.name for j in result.chosen))


def noise() -> Study:
    """How often anything is reported where nothing is missing, by noise, and by number of rows, order and clock."""
    return Study({name: partial(_clean, noise=name) for name in NOISE}, _reported, _by_shape, block=4)


def _clean(seed: int, noise: str) -> Result:
    lab = replace(shape(seed), **NOISE[noise])
    parts = [f"{lab.n} rows", lab.design, "clock" if lab.clock else "no clock"]
    return {"names": _found(simulate(lab, seed), options(lab)), "parts": parts}


def _reported(results: Results) -> Figures:
    which = Counter(name.split(":")[0] for one in results for name in one["names"])
    return {"reported": sum(bool(one["names"]) for one in results), "of": len(results), "effects": dict(which)}


def _by_shape(found: Mapping[str, Results]) -> Mapping[str, Figures]:
    every = [one for results in found.values() for one in results]
    parts = sorted({part for one in every for part in one["parts"]})
    return {"all": _reported(every), **{p: _reported([one for one in every if p in one["parts"]]) for p in parts}}


def effects(rows: int = 0) -> Study:
    """How often every effect is found by its name or as an alias of what was named, and anything besides.

    In tables of so many rows; 0 for those of each effect.
    """
    which = [(name, rms) for name in MISSING for rms in (0.25, 0.5, 1.0)]
    cases = {f"{name} at {rms:g} sd": partial(_effect, name=name, rms=rms, rows=rows) for name, rms in which}
    return Study(cases, _sums, pooled(_sums))


def _effect(seed: int, name: str, rms: float, rows: int) -> Result:
    missing = MISSING[name]
    missing = replace(missing, lab=replace(missing.lab, n=rows or missing.lab.n))
    names = found_or_alike(simulate(missing.lab, seed, missing.at(rms)), options(missing.lab))
    right = [n for n in names if n.startswith(missing.named)]
    alike = [n for n, a in names.items() if n not in right and any(b.startswith(missing.named) for b in a)]
    besides = len(names) > len(right) + len(alike)
    return {"named": bool(right), "as an alias": bool(alike) and not right, "besides": besides}


def _sums(results: Results) -> Figures:
    return {**{name: sum(one[name] for one in results) for name in results[0]}, "of": len(results)}


def pairs() -> Study:
    """Two effects at once, each at one sd rms: both found, and anything besides."""
    chosen = ("curvature", "temperature", "drift", "step", "direction", "carry-over", "wave")
    which = combinations(chosen, 2)
    return Study({f"{first} and {second}": partial(_pair, names=(first, second)) for first, second in which}, _sums)


def _pair(seed: int, names: tuple[str, str]) -> Result:
    lab = Lab(160, 2, groups=4, clock=True, sides=True)
    adds = [MISSING[name].at(1.0) for name in names]
    found = _found(simulate(lab, seed, lambda c, r: sum(add(c, r) for add in adds)), options(lab))
    expected = [MISSING[name].named for name in names]
    every = tuple(name for one in expected for name in one)
    both = all(any(n.startswith(e) for n in found) for e in expected)
    return {"both": both, "besides": any(not n.startswith(every) for n in found)}


def measured(folder: str = "") -> Study:
    """Measured tables: verdict, error before and after, effects; against the error that is to be reached.

    FOLDER/commands.toml has a table for each: `file`, the options of `rig trace` (response, formula, group, ...) and
    `sigma`, the standard error that the effects known of it lead to. Nothing is drawn: a seed is a repetition.
    """
    if not folder:
        raise UsageError("measured tables need the --folder that they are in")
    entries = tomllib.loads((Path(folder) / "commands.toml").read_text())
    return Study({name: partial(_measured, folder=folder, entry=entry) for name, entry in entries.items()}, _first)


def _measured(_seed: int, folder: str, entry: dict[str, Any]) -> Result:
    told: dict[str, Any] = {
        key: tuple(v) if isinstance(v, list) else v for key, v in entry.items() if key not in ("file", "sigma")
    }
    trace = trace_general_table(FileSource(Path(folder) / entry["file"]).read, Roles(**told)).trace
    before, after = trace.before, trace.after
    return {
        "verdict": str(trace.verdict),
        "sigma": [before.fit.sigma_E, after.fit.sigma_E],
        "over what is to be reached": after.fit.sigma_E / entry["sigma"],
        "left out": [before.cv_rms or 0.0, after.cv_rms or 0.0],
        "effects": [
            f"{e.effect} ({e.share:.1%}, p {e.p_adjusted:.2g}) {', '.join(e.aliases[:3])}" for e in trace.effects
        ],
        "unnamed": [str(rest.cause) for rest in trace.unnamed],
    }


def _first(results: Results) -> Figures:
    return results[0]


PARTS = {"noise": Part(noise), "effects": Part(effects), "pairs": Part(pairs), "measured": Part(measured, 1)}
