"""Effects that a trace of the run finds, in its budgets by the declared model: as on a certificate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.by_kind import trace_table
from rig.errors import UsageError
from rig.fitter.errors import FitError
from rig.procedures.errors import DataError
from rig.procedures.present.shell import shell_word
from rig.tables import run_table
from rig.verbs.budget.evaluation import OfRun, RunBudget, budget_of
from rig.verbs.budget.undeclared import with_undeclared

if TYPE_CHECKING:
    from rig.fitter.trace.outcome import Outcome

FOUND = (
    "the run was traced: the declared model lacks {effects}. Each result that they move has a line for them, and is of "
    "the declared model; --traced states results of the model with them, and rig confirm {run} tests their causes"
)
NOTHING = "the run was traced, and no effect was found beside the declared model"
NAMELESS = "the trace left more than error in {sensors} and found no cause: that is in no budget; see rig trace {run}"
NOT_TRACED = "the run was not traced, so effects that the declared model lacks are in no budget: {why}"
SIMULATED = "a simulation is of the declared model alone; without --monte-carlo effects are looked for and counted"


def with_found(of: OfRun, declared: RunBudget, asked: Mapping[str, Any], *, simulated: bool) -> RunBudget:
    """Budgets with a line for effects that a trace finds, in each result that they move, and a sentence about them.

    Args:
        of: the run.
        declared: its budgets by the declared model.
        asked: arguments of `budget_of`.
        simulated: whether the budgets are checked by a simulation, which knows the declared model alone.
    """
    if simulated:
        return _noted(declared, NOT_TRACED.format(why=SIMULATED))
    given, run = asked["options"], shell_word(of.table.source)
    fields = of.kind.trace_options.model_fields
    options = {name: value for name, value in given.items() if name in fields}
    options |= {"quick": True} if "quick" in fields else {}
    try:
        outcomes = trace_table(run_table(Path(of.table.source)), **options).outcomes
        by_sensor = effects_by_sensor(outcomes)
        found = "; ".join(
            f"{of.table.outputs.get(s, s)}: {', '.join(names)}" for s, names in by_sensor.items() if names
        )
        made = _noted(declared, FOUND.format(effects=found, run=run) if found else NOTHING)
        if found:
            traced = budget_of(of, **{**asked, "options": {**given, "traced": True}})
            made = with_undeclared(made, traced, by_sensor, asked["shapes"])
    except (DataError, FitError, UsageError) as error:
        return _noted(declared, NOT_TRACED.format(why=error))
    nameless = [of.table.outputs.get(one.sensor, one.sensor) for one in outcomes if one.unnamed]
    return _noted(made, NAMELESS.format(sensors=", ".join(nameless), run=run)) if nameless else made


def effects_by_sensor(outcomes: Sequence[Outcome]) -> Mapping[str, tuple[str, ...]]:
    """Names of the effects that a trace found, by sensor."""
    return {one.sensor: tuple(f.effect for f in one.named if f.kind == "effect") for one in outcomes}


def _noted(made: RunBudget, note: str) -> RunBudget:
    return replace(made, notes=(note, *made.notes))
