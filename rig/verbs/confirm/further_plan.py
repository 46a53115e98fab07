"""A further run as an executable plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rig.bench.config import parse_toml
from rig.files.toml_text import toml_text
from rig.procedures.kind import Procedure
from rig.procedures.plan.further_runs import Step, Variation
from rig.runs.plans import Plan, plan_of
from rig.verbs.confirm.first import First, told_to_trace


def procedure_text(procedure: Procedure, steps: Sequence[Step] = (), *, routine: bool = False) -> str:
    """A procedure as the text of its file, with changes by a person, and with its own steps by hand if `routine`."""
    values = procedure.model_dump(mode="json", exclude_none=True)
    design = procedure.design.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    values |= {"design": design}  # a type of design refuses keys of another type
    own = values.pop("by_hand", None) or []
    by_hand = [*(own if routine else []), *(step.table() for step in steps)]
    if by_hand:
        values |= {"by_hand": by_hand}
    return toml_text(values)


def plan_for(
    first: First, variation: Variation, *, dry: bool, bench: str | None = None, world: str | None = None
) -> Plan:
    """The plan of a further run on the first run's bench, or on another file of the same bench; texts of files."""
    documents = dict(first.documents) | {"procedure.toml": _text_of(variation)} | told_to_trace(first)
    documents |= {name: text for name, text in (("bench.toml", bench), ("world.toml", world)) if text is not None}
    if not dry:
        documents.pop("world.toml", None)
    if dry and variation.by_weather:
        truth = parse_toml(documents.get("world.toml", ""), "world.toml")
        documents["world.toml"] = toml_text(_warmer(truth, variation.warmer_degC))
    return plan_of(documents, dry=dry)


def _text_of(variation: Variation) -> str:
    return procedure_text(variation.procedure, variation.steps, routine=variation.routine)


def _warmer(truth: Mapping[str, Any], by: float) -> dict[str, Any]:
    """The world with warmer temperatures, in the laboratory and around the package."""
    lab, enclosure = dict(truth.get("lab", {})), dict(truth.get("enclosure", {}))
    lab["mean_degC"] = lab.get("mean_degC", 21.5) + by
    enclosure["start_setpoint_degC"] = enclosure.get("start_setpoint_degC", 23.0) + by
    return {**truth, "lab": lab, "enclosure": enclosure}
