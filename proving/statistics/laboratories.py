"""The three example laboratories of the general kind, dry: is what the declared model lacks named, and else nothing?

Each seed is another world (noise) and another random order. A clean run has the same world without `hidden`. The parts
`causes` and `no-causes` ask the same of tables with what instruments do (proving/truth/instruments.py).
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.statistics.dry_runs import dry, plan_from, read
from proving.truth.instruments import CAUSES
from rig.procedures.column_names import stem_of
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.of_runs import RunModels, models_of, roles_of_run
from rig.procedures.general.trace import search_table
from rig.procedures.tables.table import Table
from rig.run_file.events.bench import Warned
from rig.run_file.read.reader import RunReader
from rig.tables.table_of_run import run_table

HIDDEN: Mapping[str, str] = {
    "load-cell-lab": "creep:force_kN",
    "bath-lab": "self-heating:current_A",
    "voltmeter-lab": "range-step:input_V",
}
"""What the declared model of each laboratory lacks, by the name that it is to be given."""


def names(lab: str, seed: int, *, hidden: bool) -> dict[str, list[str]]:
    """Names of the effects found in a dry run of a laboratory, by output.

    Args:
        lab: folder of the example.
        seed: of the world and of the order.
        hidden: whether the world has what the declared model lacks.
    """
    with tempfile.TemporaryDirectory() as folder:
        table = run_table(_run(lab, seed, Path(folder), hidden=hidden))
    return {column: _found(table, roles) for column, roles in roles_of_run(RunModels(table, models_of(table))).items()}


def _run(lab: str, seed: int, folder: Path, *, hidden: bool) -> Path:
    """The run file of such a dry run."""
    bench, procedure, world = read(lab, "bench", "procedure", "world")
    procedure["seed"] = world["seed"] = seed
    if not hidden:
        for sensor in world["sensors"].values():
            sensor.pop("hidden", None)
    return dry(plan_from({"bench.toml": bench, "procedure.toml": procedure, "world.toml": world}), folder)


def _found(table: Table, roles: Roles) -> list[str]:
    result = search_table(roles_of(table, roles)[0])
    return list(dict.fromkeys(result.judge.candidates[j].effect.name for j in result.chosen))


def affected(lab: str) -> frozenset[str]:
    """Sensors of a laboratory whose declared model lacks something."""
    (world,) = read(lab, "world")
    return frozenset(name for name, sensor in world["sensors"].items() if "hidden" in sensor)


def hidden() -> Study:
    """How often the hidden effect of each laboratory is named in all sensors that have it, and anything besides."""
    return Study({lab: partial(_hidden, lab=lab) for lab in HIDDEN}, _named)


def _hidden(seed: int, lab: str) -> Result:
    found, has = names(lab, seed, hidden=True), affected(lab)
    right = {column: [HIDDEN[lab]] if stem_of(column) in has else [] for column in found}
    named = all(set(right[column]) <= set(what) for column, what in found.items())
    return {"named": named, "besides": any(set(what) - set(right[column]) for column, what in found.items())}


def _named(results: Results) -> Figures:
    return {**{name: sum(one[name] for one in results) for name in results[0]}, "of": len(results)}


def clean() -> Study:
    """How often anything is reported of a sensor whose declared model lacks nothing."""
    return Study({lab: partial(_clean, lab=lab) for lab in HIDDEN}, _reported, _all)


def _clean(seed: int, lab: str) -> Result:
    found = names(lab, seed, hidden=False)
    return {"sensors": len(found), "reported": [name for what in found.values() for name in what[:1]]}


def _reported(results: Results) -> Figures:
    said = [name for one in results for name in one["reported"]]
    return {"sensors reported": len(said), "of": sum(one["sensors"] for one in results), "effects": sorted(said)}


def _all(found: Mapping[str, Results]) -> Mapping[str, Figures]:
    return {"all": _reported([one for results in found.values() for one in results])}


def warnings() -> Study:
    """How many clean dry runs have an early warning, and how many points all runs have."""
    return Study({lab: partial(_warnings, lab=lab) for lab in HIDDEN}, _warned)


def _warnings(seed: int, lab: str) -> Result:
    with (
        tempfile.TemporaryDirectory() as folder,
        RunReader.open(_run(lab, seed, Path(folder), hidden=False)) as reader,
    ):
        said = [r.event.message for r in reader.records(Warned.kind) if isinstance(r.event, Warned)]
        return {"warnings": said, "points": len(reader.run_list())}


def _warned(results: Results) -> Figures:
    said = [one["warnings"] for one in results if one["warnings"]]
    return {"with a warning": len(said), "of": len(results), "points": sum(one["points"] for one in results)}


def causes() -> Study:
    """How often each cause in tables is named at one sd rms, and anything besides."""
    return Study({name: partial(_cause, name=name) for name in CAUSES}, _named)


def _cause(seed: int, name: str) -> Result:
    found = named(name, seed, rms=1.0)
    return {"named": CAUSES[name].named in found, "besides": bool(set(found) - {CAUSES[name].named})}


def no_causes() -> Study:
    """How often anything is reported in the same tables without the cause."""
    return Study({name: partial(_no_cause, name=name) for name in CAUSES}, _reported, _all)


def _no_cause(seed: int, name: str) -> Result:
    return {"sensors": 1, "reported": named(name, seed, rms=0.0)[:1]}


def named(name: str, seed: int, rms: float) -> list[str]:
    """Names of the effects found in a table with a cause of so many sd."""
    cause = CAUSES[name]
    columns = cause.table(seed, rms)
    text = {key: v for key, v in columns.items() if v.dtype.kind == "U"}
    numbers = {key: v for key, v in columns.items() if key not in text}
    return _found(Table("simulated", numbers, simulated=True, provenance={}, text=text), Roles(**cause.options()))


PARTS = {
    "hidden": Part(hidden),
    "clean": Part(clean),
    "warnings": Part(warnings),
    "causes": Part(causes),
    "no-causes": Part(no_causes),
}
