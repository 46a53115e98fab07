"""The goal of a procedure in a loop: replications of the first run are added until its intervals are narrow enough."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig.by_kind import fit_table
from rig.errors import UsageError
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

_NORMAL = 1.959964
"""Standard uncertainties of a 95 % interval: the goal `sigma` is one of them."""


@dataclass(frozen=True)
class Look:
    """A look at the goal: one more replication (its number), or none, and why."""

    more: int | None
    why: str


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


def looked(goal: GoalSettings, segments: Sequence[Path], first: int, hours: float, left_h: float) -> Look:
    """Whether one more replication is made.

    Args:
        goal: of the procedure.
        segments: files of all replications so far.
        first: number of replications of the first of them.
        hours: bench time of one more.
        left_h: time left, hours.

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
    if hours * (1.0 + ALLOWANCE) + PARKING_H > left_h:
        return Look(None, f"no time is left for the goal: {said}; one more takes {duration(3600.0 * hours)}")
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
