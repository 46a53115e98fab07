"""The goal of a procedure in a loop: replications of the first run are added until its intervals are narrow enough."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rig.by_kind import fit_table
from rig.errors import UsageError
from rig.fitter.confirm.together import solve
from rig.fitter.sequential import t_of, widening
from rig.loop.decide import PARKING_H
from rig.loop.goal_of_results import Aim, of_results
from rig.procedures.kind import Procedure
from rig.procedures.plan.settings import GoalSettings
from rig.procedures.present.durations import duration
from rig.procedures.tables.table import Table
from rig.runs.forecast import ALLOWANCE
from rig.tables import run_table
from rig.tables.segments import table_of
from rig.verbs.confirm import First, Proposal

_NORMAL = 1.959964
"""Standard uncertainties of a 95 % interval: the goal `sigma` is one of them."""


@dataclass(frozen=True)
class Look:
    """A look at the goal: one more replication (its number), or none, and why."""

    more: int | None
    why: str


@dataclass(frozen=True)
class Kept:
    """Time that is kept for a further run, because it helps more than one more replication: hours, and why in words."""

    hours: float = 0.0
    why: str = ""


def kept_for(first: First, run: Proposal | None, replications: int, hours: float) -> Kept:
    """The time of a further run, if it takes more from the error per hour than one more replication.

    A replication narrows intervals by the root of the number of replications. A further run that confirms effects
    takes away what they add to the scatter, with its probability.

    Args:
        first: the traced run.
        run: the best further run; None without one.
        replications: number of those that were made.
        hours: bench time of one more.
    """
    if run is None:
        return Kept()
    by_run = run.least.chance * (1.0 - 1.0 / math.hypot(1.0, _beyond_scatter(first, run)))
    by_one_more = 1.0 - math.sqrt(replications / (replications + 1.0))
    if by_run / run.hours <= by_one_more / hours:
        return Kept()
    return Kept(
        run.hours * (1.0 + ALLOWANCE),
        f"{duration(3600.0 * run.hours)} are kept for a further run, {run.variation.what}, which by forecast takes "
        f"{by_run:.0%} from the error ({by_run / run.hours:.1f} per hour), and one more replication {by_one_more:.0%} "
        f"({by_one_more / hours:.1f} per hour)",
    )


def _beyond_scatter(first: First, run: Proposal) -> float:
    """Size of the effects of all open questions in the first run, rms over the scatter of a reading."""
    variation = run.variation
    ways = first.confirming.ways(variation, variation.procedure.expand(), first.questions, first.later_s)
    made = ways[0].only(~ways[0].last)
    columns = made.columns_of([term for question in first.questions for term in question.terms])
    return float(np.sqrt(np.mean((columns @ solve(columns, made.outputs)) ** 2)))


@dataclass(frozen=True)
class _Value:
    """A coefficient or parameter of one sensor."""

    sensor: str
    name: str
    stderr: float
    df: float
    goal: float


def procedure_with(procedure: Procedure, **changes: Any) -> Any:
    """A procedure with other values."""
    changed: Any = procedure
    return changed.model_copy(update=changes)


def looked(
    goal: GoalSettings,
    segments: Sequence[Path],
    first: int,
    hours: float,
    left_h: float,
    loop_h: float = math.inf,
    kept: Callable[[int], Kept] = lambda _: Kept(),
) -> Look:
    """Whether one more replication is made.

    Args:
        goal: of the procedure.
        segments: files of all replications so far.
        first: number of replications of the first of them.
        hours: bench time of one more.
        left_h: time left for the goal, hours.
        loop_h: time left for the loop, hours.
        kept: gives the time that is kept for a further run, for the number of replications; asked if time is scarce.

    Raises:
        UsageError: no sensor has the named coefficient, parameter or result.
        ConfigurationError: the register of equipment cannot be used.
    """
    count, looks = first + len(segments) - 1, goal.most_replications - first + 1
    start, table = run_table(segments[0]), table_of(segments, segments[0])
    aims = [*_of_estimates(goal, start, table, first, looks), *of_results(goal, segments, start, table, first, looks)]
    hopeless = [one for one in aims if one.least > one.goal]
    worst = max(hopeless or aims, key=lambda one: one.half / one.goal)
    said = f"{worst.known}, the goal is +-{worst.goal:.2g}"
    if worst.half <= worst.goal:
        return Look(None, f"the goal is met with {count} replications: {said}")
    if hopeless:
        return Look(
            None,
            f"the goal cannot be met by replications: {said}; with any number of them it would be at least "
            f"+-{worst.least:.2g}, by {worst.by}",
        )
    needed = math.ceil(count * (worst.half**2 - worst.least**2) / (worst.goal**2 - worst.least**2))
    said += f"; about {needed} replications meet it, {count} are made"
    if count >= goal.most_replications or needed > 2 * goal.most_replications:
        return Look(None, f"the goal cannot be met: {said}, and most_replications = {goal.most_replications}")
    one_h = hours * (1.0 + ALLOWANCE) + PARKING_H
    if one_h > left_h:
        return Look(None, f"no time is left for the goal: {said}; one more takes {duration(3600.0 * hours)}")
    every_h = (needed - count) * hours
    if every_h * (1.0 + ALLOWANCE) + PARKING_H > min(left_h, loop_h):
        said += f", and the others take {duration(3600.0 * every_h)}"
        spared = kept(count)
        if one_h + spared.hours > loop_h:
            left = f"of {duration(3600.0 * loop_h)} that are left {spared.why}"
            return Look(None, f"the goal is given up: {said}; {left}")
    return Look(count + 1, f"{said}; one more takes {duration(3600.0 * hours)} of {duration(3600.0 * left_h)}")


def _of_estimates(goal: GoalSettings, start: Table, table: Table, first: int, looks: int) -> Iterator[Aim]:
    """Coefficients and parameters; their degrees of freedom were fewer at the first look."""
    if not goal.sigma:
        return
    fewer = {(one.sensor, one.name): one.df for one in _values(goal, start)}
    for one in _values(goal, table):
        df = fewer[one.sensor, one.name]
        wider = widening(round(df, 1), round(max(df / first, 1.0), 1), looks, first)
        half = wider * t_of(one.df) * one.stderr
        of = f" of {one.sensor}" if one.sensor else ""
        yield Aim(f"{one.name}{of} is known to +-{half:.2g} (95 %, in spite of looking)", half, _NORMAL * one.goal)


def _values(goal: GoalSettings, table: Table) -> Iterator[_Value]:
    """The named coefficients and parameters of every sensor that has them."""
    fitted = fit_table(table).to_json()
    sensors: Mapping[str, Any] = fitted.get("sensors") or {str(fitted.get("response", "")): fitted}
    for name, sigma in goal.sigma.items():
        found = [
            _Value(sensor, name, float(one["stderr"]), float(one["df"]), sigma)
            for sensor, of in sensors.items()
            for group in ("parameters", "coefficients")
            if isinstance(one := (of.get(group) or {}).get(name), Mapping) and one.get("stderr") is not None
        ]
        if not found:
            known = sorted(
                {key for of in sensors.values() for g in ("parameters", "coefficients") for key in of.get(g) or {}}
            )
            raise UsageError(f"goal.sigma.{name}: no sensor has such a value; known: {', '.join(known)}")
        yield from found
