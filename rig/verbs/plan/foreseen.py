"""Facts that the register of equipment tells of a plan: due dates, gaps, conditions of certificates."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from rig.errors import ConfigurationError
from rig.register import (
    DOCUMENT,
    absent,
    check_validity,
    entries,
    holds_of,
    needed,
    parse_register,
    stated_of,
    stopping,
    unrecorded,
)

if TYPE_CHECKING:
    from rig.fitter.arrays import FloatArray
    from rig.register.surroundings import Holds
    from rig.runs.plans import Plan


def settled(plan: Plan) -> dict[str, FloatArray]:
    """Thermometers of the enclosure and of the package, at the temperature that the plan keeps there."""
    wanted = plan.procedure.conduct.environment
    inside = [name for name, one in plan.bench.temperatures.items() if one.place in ("enclosure", "package")]
    return {} if wanted is None else {name: np.array([wanted.setpoint_degC]) for name in inside}


def not_stated(plan: Plan) -> list[str]:
    """Sentences of a certificate on facts that the register does not state, or that the bench does not record."""
    if DOCUMENT not in plan.documents:
        return []
    register = parse_register(plan.documents[DOCUMENT], DOCUMENT)
    told = [*absent(register, plan.bench), *unrecorded(plan.bench)]
    return [*told, *(one.not_recorded() for one, by in _surroundings(plan) if not by)]


def stops(plan: Plan, on: date) -> list[str]:
    """Facts of register and settings for which `rig certificate` would refuse a certificate, one sentence each.

    Raises:
        ConfigurationError: the register cannot be used for the bench.
    """
    if DOCUMENT not in plan.documents:
        return ["the bench has no register of equipment (docs/how_to/register.md)"]
    register = parse_register(plan.documents[DOCUMENT], DOCUMENT)
    read = {one.of: name for name, one in plan.bench.references.items() if one.of}
    factors = [read.get(factor.name, factor.name) for factor in plan.run_list.factors]
    outputs = [f"{name}_{sensor.unit}" for name, sensor in plan.bench.sensors.items()]
    stated = stated_of(register, plan.bench, on)
    unstated = stated.unstated([*outputs, *factors])
    found = ["the register has example values"] if register.example and not plan.dry else []
    found += [*needed(register, plan.bench.sensors, DOCUMENT), *plan.unsettled]
    found += stopping(unstated, outputs, (), stated.lacking)
    more = stopping(unstated, (), factors, stated.lacking)
    return [*found, *(f"if a result depends on it: {one}" for one in more)]


def surroundings(plan: Plan) -> list[str]:
    """Conditions under which certificates of the equipment hold, and what tells of each, one sentence each."""
    return [f"certificate of {one.asset} holds at {one.words}: {by}" for one, by in _surroundings(plan) if by]


def _surroundings(plan: Plan) -> Iterator[tuple[Holds, str]]:
    """Conditions of certificates, and what will tell of each; "" for nothing."""
    if DOCUMENT not in plan.documents:
        return
    asked = {step.value for step in plan.run_list.steps}
    known = {factor.name for factor in plan.run_list.factors} | settled(plan).keys()
    for one in holds_of(parse_register(plan.documents[DOCUMENT], DOCUMENT), plan.bench):
        names = one.columns(plan.bench)
        told = [f"{name}, which the plan sets within it" for name in names if name in known]
        told += [f"{name} will tell, after the run" for name in names if name not in known]
        told += [f"a person states {one.quantity} in the run"] if one.by_hand & asked else []
        yield one, "; ".join(told)


def beside(plan: Plan) -> list[str]:
    """Equipment of the register that nothing on the bench names."""
    if DOCUMENT not in plan.documents:
        return []
    register = parse_register(plan.documents[DOCUMENT], DOCUMENT)
    named = {one.asset for _, one in entries(plan.bench)}
    return [asset for asset in register.equipment if asset not in named]


def registered(plan: Plan) -> set[str]:
    """Asset numbers of the register."""
    return set(parse_register(plan.documents[DOCUMENT], DOCUMENT).equipment) if DOCUMENT in plan.documents else set()


def has_due_date(plan: Plan) -> bool:
    """Whether the bench file or the register states when a calibration of equipment on the bench is due."""
    register = parse_register(plan.documents[DOCUMENT], DOCUMENT).equipment if DOCUMENT in plan.documents else {}
    every = [one for _, one in entries(plan.bench)]
    own = (known.certificate for one in every if (known := register.get(one.asset)) is not None)
    return any(getattr(one, "due", None) is not None for one in (*every, *own))


def expired(plan: Plan, first: date, on: date) -> list[str]:
    """Certificates that will not be valid from the first to the last date, a sentence each: no budget is then made.

    Those whose date is in the bench file, too, are left to it.
    """
    if DOCUMENT not in plan.documents:
        return []
    register = parse_register(plan.documents[DOCUMENT], DOCUMENT)
    told = {one.asset for _, one in entries(plan.bench) if getattr(one, "due", None) is not None}
    other = {asset: one for asset, one in register.equipment.items() if asset not in told}
    try:
        check_validity(register.model_copy(update={"equipment": other}), plan.bench, DOCUMENT, first, on)
    except ConfigurationError as error:
        lines = str(error).replace("the run ended on", "this run would end on").splitlines()
        return [line.replace("the run began on", "this run would begin on") for line in lines]
    return []
