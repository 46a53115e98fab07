"""Further runs that may distinguish confounded effects: a procedure varied in one respect, from cheap to expensive.

The fitter computes their separation (`rig.fitter.confirm.separation`); a kind gives the possible variations.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rig.fitter.effects.manual_changes import Change, Done
from rig.procedures.plan.run_list import RunList
from rig.procedures.plan.settings import Varies

Limits = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Step:
    """A change that a person makes in a run.

    Attributes:
        change: the change.
        before_replication: the replication before which it is made; 1 is before the first point.
    """

    change: Change
    before_replication: int

    def done(self, replication: Sequence[int]) -> Done:
        """The change in a run whose observations belong to these replications."""
        return Done(self.change.word, np.asarray(replication) >= self.before_replication, self.change.anew)

    def table(self) -> dict[str, Any]:
        """Its `[[by_hand]]` table in a procedure file."""
        when = {"before": 1} if self.before_replication == 1 else {"before_replication": self.before_replication}
        return {**when, "say": self.change.say, "change": self.change.word}

    @property
    def words(self) -> str:
        """The instruction and its place in the run."""
        when = "the first point" if self.before_replication == 1 else f"replication {self.before_replication}"
        return f"before {when}: {self.change.say}"


@dataclass(frozen=True)
class Variation:
    """A possible run.

    Attributes:
        what: its difference from the first run, in words; variations with the same words differ in size.
        procedure: the run.
        turned: whether a person has to mount the package again first.
        warmer_degC: temperature increase of the sensors, degrees Celsius.
        by_weather: whether no instrument on the bench can set this temperature.
        steps: changes by a person in the run.
        wait_s: additional wait at every point, seconds.
        routine: whether the procedure's own steps by hand are a part of it.
        varies: what differs from the first run, as `[loop] allow` of a procedure names it.
    """

    what: str
    procedure: Any
    turned: bool = False
    warmer_degC: float = 0.0
    by_weather: bool = False
    steps: tuple[Step, ...] = ()
    wait_s: float = 0.0
    routine: bool = False
    varies: Varies = "settings"

    @cached_property
    def run_list(self) -> RunList:
        """Its points, in order."""
        expanded: RunList = self.procedure.expand()
        return expanded

    @property
    def person(self) -> int:
        """Number of times a person has to come to the bench."""
        return len(self.steps) + self.turned

    @property
    def touched(self) -> bool:
        """Whether a person comes to the bench before the first point."""
        return self.turned or any(step.before_replication == 1 for step in self.steps)

    @property
    def untouched(self) -> bool:
        """Whether a run changes nothing but points and their order."""
        return not (self.turned or self.warmer_degC or self.by_weather)


def repeated(variation: Variation, times: int) -> Variation:
    """So many replications, or so many before and after every change by a person."""
    steps = tuple(
        replace(step, before_replication=1 + times * number) for number, step in enumerate(variation.steps, start=1)
    )
    procedure = variation.procedure.model_copy(update={"replications": times * (1 + len(steps))})
    return replace(variation, procedure=procedure, steps=steps)


def with_step(variation: Variation, change: Change) -> Variation:
    """The run with twice its replications, and a change by a person between both halves.

    The first half shows the effects as they were: so what is gone or different in the second one is due to the change,
    not to the time between two runs.
    """
    before = variation.procedure.replications
    procedure = variation.procedure.model_copy(update={"replications": 2 * before})
    what = f"{variation.what}; half-way a person has to {change.say}"
    return replace(variation, what=what, procedure=procedure, steps=(Step(change, before + 1),))


def possible(every: Iterable[Variation], limits: Limits) -> Iterator[Variation]:
    """The variations within the limits of the bench, by quantity ("pitch_deg", "enclosure_degC")."""
    for variation in every:
        if next(variation.run_list.beyond(limits), None) is None:
            yield variation


def named(name: str, what: str) -> str:
    """A name within a procedure's 80 characters, with the first run's shortened if necessary."""
    room = 80 - len(what) - 2
    return f"{name[:room]}: {what}" if room > 0 else what[:80]
