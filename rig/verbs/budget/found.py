"""Budgets of a run with what its trace and further runs found: the same for `rig budget` and certificates.

An effect that further runs settled is in the model of the results; so are all of them if that is asked for. Of any
other one, each result that it moves has a line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.by_kind import trace_table
from rig.errors import UsageError
from rig.fitter.errors import FitError
from rig.procedures.errors import DataError
from rig.procedures.evaluate.confirming import SETTLED
from rig.procedures.present.shell import shell_word
from rig.tables.table_of_run import run_table
from rig.verbs.budget.evaluation import OfRun, RunBudget, budget_of, run_with_register
from rig.verbs.budget.lacking import by_sensor
from rig.verbs.budget.undeclared import with_undeclared

if TYPE_CHECKING:
    from rig.fitter.trace.outcome import Outcome
    from rig.procedures.tables.table import Table
    from rig.verbs.confirm import Confirmed

FOUND = (
    "the run was traced, and each result that these effects move has a line for them; --traced states results of the "
    "model with them, and rig confirm {run} tests their causes"
)
NOTHING = "the run was traced, and no effect was found beside the declared model"
NAMELESS = "the trace left more than error in {sensors} and found no cause: that is in no budget; see rig trace {run}"
IGNORED = "the trace did not look at {columns}"
ABSORBED = "{names} have absorbed a part of the effects, and are no properties of the item; a certificate says how much"
MOST_ABSORBED = 3
"""Coefficients that a budget tells one by one, with what they have absorbed."""
NOT_TRACED = "the run was not traced, so effects that the declared model lacks are in no budget: {why}"
SIMULATED = "a simulation is of the declared model alone; without --monte-carlo effects are looked for and counted"


@dataclass(frozen=True, eq=False)
class Found:
    """The effects in a run, as far as they are known.

    Attributes:
        outcomes: of its trace.
        confirmed: results of further runs; None if there are none.
        ignored: columns that the trace did not look at.
    """

    outcomes: Sequence[Outcome]
    confirmed: Confirmed | None = None
    ignored: tuple[str, ...] = ()

    @property
    def effects(self) -> Mapping[str, tuple[str, ...]]:
        """Names of the effects that the trace found, by output."""
        return effects_by_sensor(self.outcomes)

    @property
    def verdicts(self) -> Mapping[str, str]:
        """Verdicts of further runs by effect."""
        return {} if self.confirmed is None else {one.effect: one.verdict for one in self.confirmed.answers}


def found_in(of: OfRun, path: Path, later: Sequence[Path] = (), equipment: Path | None = None, **options: Any) -> Found:
    """The trace of a run, and what further runs say of its effects together.

    The findings and doubts are those of a whole trace; where a quick one has them too, errors that nobody asks for here
    are not computed.

    Args:
        of: the run, with the corrections of its certificates.
        path: its file.
        later: the files of the further runs.
        equipment: another register than those kept with the runs.
        options: of `rig trace` for its kind.
    """
    fields = of.kind.trace_options.model_fields
    if options.get("ignore") and "ignore" not in fields:
        raise UsageError(f"--ignore: the trace of {of.kind.title} ignores no columns")
    given = {name: value for name, value in options.items() if name in fields}
    given |= {"quick": not of.kind.trace_options.doubts_by_left_out} if "quick" in fields else {}
    if not later:
        return Found(trace_table(of.table, **given).outcomes, ignored=tuple(options.get("ignore") or ()))
    from rig.verbs.confirm import judge, open_traced  # noqa: PLC0415 - few runs have further ones

    def read(one: Path) -> Table:
        if one == path:
            return of.table
        return run_with_register(one, equipment).table if of.corrected else run_table(one)

    first = open_traced(path, read, later, **given)
    return Found(first.traced.outcomes, judge(first, *later), first.ignore)


def budget_with(of: OfRun, found: Found, asked: Mapping[str, Any], *, traced: bool = False) -> RunBudget:
    """Budgets by the model with the effects that further runs settled, and with a line for all others.

    Args:
        of: the run.
        found: in it.
        asked: arguments of `budget_of`.
        traced: whether all effects are in the model, settled or not.
    """
    effects, told = found.effects, found.verdicts
    every = {name for names in effects.values() for name in names}
    told_to_trace = {"ignore": list(found.ignored)} if found.ignored else {}
    with_all = {**asked, "options": {**(asked.get("options") or {}), **told_to_trace, "traced": True}}
    if not every:
        return budget_of(of, **asked)
    if traced or all(told.get(name) == "confirmed" for name in every):
        return budget_of(of, **with_all)
    evaluated, without = None, every
    if found.confirmed is not None and any(told.get(name) in SETTLED for name in every):
        from rig.verbs.confirm import with_confirmed  # noqa: PLC0415

        fitted = with_confirmed(found.confirmed.first, found.confirmed, of.kind.fit_options())
        evaluated, without = fitted.evaluation, set(fitted.without)
    lacks = {output: [name for name in names if name in without] for output, names in effects.items()}
    made = budget_of(of, **asked, evaluated=evaluated)
    if not any(lacks.values()):
        return made
    return with_undeclared(made, budget_of(of, **with_all), lacks, asked["shapes"])


def with_notes(of: OfRun, found: Found, made: RunBudget) -> RunBudget:
    """Budgets with sentences about the effects that were found."""
    run, names = shell_word(of.table.source), of.table.outputs
    nameless = [names.get(one.sensor, one.sensor) for one in found.outcomes if one.unnamed]
    # beside "left more than error", "no effect was found" would contradict it
    notes = [] if any(found.effects.values()) or nameless else [NOTHING]
    notes += [IGNORED.format(columns=", ".join(found.ignored))] if found.ignored else []
    notes += by_sensor(made.lacking, names)
    absorbed = [f"{name} {said}" for name, said in made.absorbed.items()]
    few = len(absorbed) <= MOST_ABSORBED
    notes += absorbed if few else [ABSORBED.format(names=", ".join(made.absorbed))]
    notes += [FOUND.format(run=run)] if any(made.lacks.values()) else []
    notes += [NAMELESS.format(sensors=", ".join(nameless), run=run)] if nameless else []
    return replace(made, notes=(*notes, *made.notes))


def traced_budget(
    of: OfRun, asked: Mapping[str, Any], later: Sequence[Path] = (), equipment: Path | None = None
) -> RunBudget:
    """Budgets with what a trace of the run and further runs found, and sentences about it; see `budget_with`."""
    path = Path(of.table.source)
    try:
        found = found_in(of, path, later, equipment, **(asked["options"] or {}))
        return with_notes(of, found, budget_with(of, found, asked))
    except (DataError, FitError, UsageError) as error:
        if later:
            raise
        made = budget_of(of, **asked)
        return replace(made, notes=(NOT_TRACED.format(why=error), *made.notes))


def effects_by_sensor(outcomes: Sequence[Outcome]) -> Mapping[str, tuple[str, ...]]:
    """Names of the effects that a trace found, by sensor."""
    return {one.sensor: tuple(f.effect for f in one.named if f.kind == "effect") for one in outcomes}
