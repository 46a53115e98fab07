"""The goal of a procedure in a loop: replications of the first run are added until its intervals are narrow enough."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from rig.by_kind import fit_table
from rig.fitter.sequential import t_of
from rig.loop.decide import PARKING_H
from rig.loop.goal_of_results import Aim, Made, estimates, of_results
from rig.procedures.evaluate.confirming import ConfirmedFit
from rig.procedures.plan.further_runs import Variation
from rig.procedures.plan.settings import GoalSettings
from rig.procedures.present.durations import duration
from rig.runs.forecast import ALLOWANCE

_NORMAL = 1.959964
"""Standard uncertainties of a 95 % interval: the goal `sigma` is one of them."""


_ROUNDING = 1e-9
_UNSEEN = " (by the model; an effect that these data are too few to show is not in this interval)"


@dataclass(frozen=True)
class Next:
    """What would be added next.

    Attributes:
        what: in words, "one more", or "6 more points".
        hours: its bench time.
        worth: number of these steps to which the observations so far are equal.
        part: its points, as a part of those of a replication.
        run: with its points; None for a whole replication.
    """

    what: str
    hours: float
    worth: float
    part: float = 1.0
    run: Variation | None = None

    @property
    def takes(self) -> str:
        """The begin of a sentence about its time."""
        return f"{self.what} take{'s' if self.run is None else ''}"


@dataclass(frozen=True)
class Look:
    """A look at the goal.

    Attributes:
        more: the next addition; None for none.
        why: reason, with numbers.
        needed: how often that is added until the goal is met, by forecast.
    """

    more: Next | None
    why: str
    needed: int = 0


def looked(
    goal: GoalSettings,
    made: Made,
    added: Callable[[Sequence[Aim]], Next],
    left_h: float,
    model: ConfirmedFit | None = None,
) -> Look:
    """Whether one more replication is made, or more points.

    Args:
        goal: of the procedure.
        made: the replications so far.
        added: what would be added next, by the aimed values.
        left_h: time left for the goal, hours.
        model: the calibration with the causes that further runs settled; None for the declared model.

    Raises:
        UsageError: no sensor has the named coefficient, parameter or result.
        ConfigurationError: the register of equipment cannot be used.
    """
    aims = aims_by(made, model)
    hopeless = [one for one in aims if one.least > one.goal]
    worst = max(hopeless or aims, key=lambda one: one.half / one.goal)
    said = f"{worst.known}, the goal is +-{worst.goal:.2g}"
    if worst.half <= worst.goal:
        return Look(None, f"the goal is met with {made.said}: {said}{_UNSEEN}")
    if hopeless:
        return Look(
            None,
            f"the goal cannot be met by replications: {said}; with any number of them it would be at least "
            f"+-{worst.least:.2g}, by {worst.by}",
        )
    step = added(aims)
    needed = math.ceil(step.worth * (worst.over - 1.0) - _ROUNDING)
    total = made.count + needed * step.part
    if step.run is None:
        said += f"; about {total:.0f} replications meet it, {made.count:.0f} are made"
    else:
        said += f"; about {needed * len(step.run.run_list)} points at the best settings meet it, beside {made.said}"
    if made.count >= goal.most_replications or total > 2 * goal.most_replications:
        return Look(None, f"the goal cannot be met: {said}, and most_replications = {goal.most_replications}")
    if step.hours * (1.0 + ALLOWANCE) + PARKING_H > left_h:
        return Look(None, f"no time is left for the goal: {said}; {step.takes} {duration(3600.0 * step.hours)}")
    said += f"; {step.takes} {duration(3600.0 * step.hours)} of {duration(3600.0 * left_h)}"
    most = math.ceil((goal.most_replications - made.count) / step.part)
    return Look(step, said, min(needed, most))


def aims_by(made: Made, model: ConfirmedFit | None) -> list[Aim]:
    """The aimed values by a calibration; arguments and errors as for `looked`."""
    return [*_of_estimates(made, model), *of_results(made, model)]


def _of_estimates(made: Made, model: ConfirmedFit | None) -> Iterator[Aim]:
    """Coefficients and parameters; their degrees of freedom were fewer at the first look."""
    if not made.goal.sigma:
        return
    fewer = {(one.sensor, one.name): one.df for one in estimates(made.goal, fit_table(made.start).to_json())}
    for one in estimates(made.goal, (model or fit_table(made.table)).to_json()):
        half = made.wider(fewer[one.sensor, one.name]) * t_of(one.df) * one.stderr
        known = f"{one.name}{one.of} is known to +-{half:.2g} (95 %, in spite of looking)"
        yield Aim(f"{one.name}{one.of}", one.value, known, half, _NORMAL * one.goal)
