"""Dry runs through the whole bench, for campaigns that make one with every seed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rig.bench.config import parse_toml
from rig.engine.session import Signals
from rig.examples import example
from rig.files.toml_text import toml_text
from rig.runs.controller import start_run
from rig.runs.plans import Plan, plan_of

Truth = dict[str, Any]
"""A part of a world file."""


def dry(plan: Plan, folder: Path, start_s: float = 0.0) -> Path:
    """The run file of a dry run, in a world of this age."""
    paths: list[Path] = []
    start_run(plan, folder, signals=Signals(), announce=paths.append, on_progress=lambda _: None, world_start_s=start_s)
    return paths[0]


def plan_from(documents: Mapping[str, Truth]) -> Plan:
    """A plan from what its files say, by name."""
    return plan_of({name: toml_text(values) for name, values in documents.items()}, dry=True)


def read(lab: str, *names: str) -> list[Truth]:
    """TOML files of an example laboratory, by name."""
    return [parse_toml((example(lab) / f"{name}.toml").read_text(), name) for name in names]


def one_sensor(effects: Truth, world: Truth, seed: int, folder: Path, design: Truth) -> Path:
    """Six replications of a design in the attitude laboratory, with its x sensor alone."""
    bench, procedure = read("attitude-lab", "bench", "night")
    bench["sensors"] = {"x": bench["sensors"]["x"]}
    procedure["design"] = design
    procedure["environment"]["tolerance_degC"] = 5.0
    truth = {"seed": seed, "effects": effects, **world}
    return dry(plan_from({"bench.toml": bench, "procedure.toml": procedure, "world.toml": truth}), folder)
