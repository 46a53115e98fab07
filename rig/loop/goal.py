"""The goal of a procedure in a loop: replications of the first run are added until its intervals are narrow enough."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from rig.by_kind import fit_table
from rig.errors import UsageError
from rig.fitter.sequential import t_of, widening
from rig.loop.decide import PARKING_H
from rig.loop.goal_of_results import Aim, Made, of_results
from rig.procedures.evaluate.confirming import ConfirmedFit
from rig.procedures.plan.settings import GoalSettings
from rig.procedures.present.durations import duration
from rig.runs.forecast import ALLOWANCE

_NORMAL = 1.959964
"""Standard uncertainties of a 95 % interval: the goal `sigma` is one of them."""


@dataclass(frozen=True)
class Look:
    """A look at the goal.

    Attributes:
        more: number of the next replication; None if none is made.
        why: reason, with numbers.
        needed: further replications that meet the goal, by forecast.
    """

    more: int | None
    why: str
    needed: int = 0


@dataclass(frozen=True)
class _Value:
    """A coefficient or parameter of one sensor."""

    sensor: str
    name: str
    value: float
    stderr: float
    df: float
    goal: float


def looked(goal: GoalSettings, made: Made, hours: float, left_h: float, model: ConfirmedFit | None = None) -> Look:
    """Whether one more replication is made.

    Args:
        goal: of the procedure.
        made: the replications so far.
        hours: bench time of one more.
        left_h: time left for the goal, hours.
        model: the calibration with the causes that further runs settled; None for the declared model.

    Raises:
        UsageError: no sensor has the named coefficient, parameter or result.
        ConfigurationError: the register of equipment cannot be used.
    """
    count, aims = made.count, aims_by(goal, made, model)
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
    said += f"; one more takes {duration(3600.0 * hours)} of {duration(3600.0 * left_h)}"
    return Look(count + 1, said, min(needed, goal.most_replications) - count)


def aims_by(goal: GoalSettings, made: Made, model: ConfirmedFit | None) -> list[Aim]:
    """The aimed values by a calibration; arguments and errors as for `looked`."""
    looks = goal.most_replications - made.first + 1
    return [*_of_estimates(goal, made, looks, model), *of_results(goal, made, looks, model)]


def _of_estimates(goal: GoalSettings, made: Made, looks: int, model: ConfirmedFit | None) -> Iterator[Aim]:
    """Coefficients and parameters; their degrees of freedom were fewer at the first look."""
    if not goal.sigma:
        return
    fewer = {(one.sensor, one.name): one.df for one in _values(goal, fit_table(made.start).to_json())}
    for one in _values(goal, (model or fit_table(made.table)).to_json()):
        df = fewer[one.sensor, one.name]
        wider = widening(round(df, 1), round(max(df / made.first, 1.0), 1), looks, made.first)
        half = wider * t_of(one.df) * one.stderr
        of = f" of {one.sensor}" if one.sensor else ""
        known = f"{one.name}{of} is known to +-{half:.2g} (95 %, in spite of looking)"
        yield Aim(f"{one.name}{of}", one.value, known, half, _NORMAL * one.goal)


def _values(goal: GoalSettings, fitted: Mapping[str, Any]) -> Iterator[_Value]:
    """The named coefficients and parameters of every sensor that has them, of a fit as JSON."""
    sensors: Mapping[str, Any] = fitted.get("sensors") or {str(fitted.get("response", "")): fitted}
    for name, sigma in goal.sigma.items():
        found = [
            _Value(sensor, name, float(one["estimate"]), float(one["stderr"]), float(one["df"]), sigma)
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
