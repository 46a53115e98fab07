"""The goal of a procedure in a loop: replications of the first run are added until its intervals are narrow enough."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rig.by_kind import fit_table
from rig.errors import UsageError
from rig.fitter.sequential import t_of, widening
from rig.loop.decide import PARKING_H
from rig.procedures.kind import Procedure
from rig.procedures.plan.settings import GoalSettings
from rig.procedures.present.durations import duration
from rig.procedures.tables.table import Table
from rig.run_file.read.reader import RunReader
from rig.runs.forecast import ALLOWANCE
from rig.tables import run_table

_NORMAL = 1.959964
"""Standard uncertainties of a 95 % interval: the goal is one of them."""
_COUNTED = ("replicate", "whole_plot", "order", "run_index", "block")


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


def table_of(segments: Sequence[Path], path: Path) -> Table:
    """The table of a run file; of the first segment, that of all segments one after the other."""
    if path.resolve() != segments[0].resolve():
        return run_table(path)
    tables = [run_table(one) for one in segments]
    first, columns = tables[0], {name: [values] for name, values in tables[0].columns.items()}
    began = [_began_s(one) for one in segments]
    for table, begins_s in zip(tables[1:], began[1:], strict=True):
        if table.columns.keys() != first.columns.keys():
            raise UsageError(f"{table.source} has other columns than {first.source}: they are no segments of one run")
        for name, values in table.columns.items():
            before = columns[name][-1]
            after = values
            if name in _COUNTED:
                after = values + np.nanmax(before) + (name == "block")
            elif name == "elapsed_s":
                after = values + begins_s - began[0]
            columns[name].append(after)
    joined = {name: np.concatenate(values) for name, values in columns.items()}
    points = {key: sum(one.provenance[key] for one in tables) for key in ("points_planned", "points_observed")}
    segments_told = {"segments": ", ".join(f"{Path(one.source).name} {one.provenance['head']}" for one in tables)}
    return replace(first, columns=joined, within={}, provenance={**first.provenance, **points, **segments_told})


def _began_s(path: Path) -> float:
    with RunReader.open(path) as reader:
        return reader.genesis().utc_s


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
        UsageError: no sensor has the named coefficient or parameter.
    """
    count, looks = first + len(segments) - 1, goal.most_replications - first + 1
    start = {(one.sensor, one.name): one.df for one in _values(goal, run_table(segments[0]))}
    values = list(_values(goal, table_of(segments, segments[0])))
    widths = [_half_width(one, start[one.sensor, one.name], first, looks) for one in values]
    worst = max(range(len(values)), key=lambda k: widths[k] / values[k].goal)
    one, half = values[worst], widths[worst]
    said = f"{one.name} of {one.sensor} is known to +-{half:.2g} (95 %, in spite of looking)"
    said = f"{said if one.sensor else said.replace(' of  is', ' is')}, the goal is +-{_NORMAL * one.goal:.2g}"
    if half <= _NORMAL * one.goal:
        return Look(None, f"the goal is met with {count} replications: {said}")
    needed = math.ceil(count * (half / (_NORMAL * one.goal)) ** 2)
    said += f"; about {needed} replications meet it, {count} are made"
    if count >= goal.most_replications or needed > 2 * goal.most_replications:
        return Look(None, f"the goal cannot be met: {said}, and most_replications = {goal.most_replications}")
    if hours * (1.0 + ALLOWANCE) + PARKING_H > left_h:
        return Look(None, f"no time is left for the goal: {said}; one more takes {duration(3600.0 * hours)}")
    return Look(count + 1, f"{said}; one more takes {duration(3600.0 * hours)} of {duration(3600.0 * left_h)}")


def _half_width(one: _Value, df: float, first: int, looks: int) -> float:
    """Half-width of the interval of a value that holds in spite of looking; its df were fewer at the first look."""
    more = max(df / first, 1.0)
    return widening(round(df, 1), round(more, 1), looks, first) * t_of(one.df) * one.stderr


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
