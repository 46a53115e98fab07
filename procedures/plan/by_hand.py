"""Steps that a person does by hand in a run: `[[by_hand]]` of a procedure file of any kind.

Before a point of the run list the run holds and says what to do. It goes on when the person has said that it is done
(`rig done`). A step is a part of the run list: it is fixed before any motion.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from rig.procedures.plan.hand_steps import HandStep
from rig.procedures.plan.settings import Positive, Strict

if TYPE_CHECKING:
    from rig.procedures.plan.run_list import Points, RunList

_Finite = Annotated[float, Field(allow_inf_nan=False)]

MOST_STEPS = 10_000

_PLACES = ("before", "before_replication", "before_whole_plot", "before_every")
REPLICATION, WHOLE_PLOT = "replication", "whole plot"


class HandSettings(Strict):
    """A step that a person does by hand. The run holds before it, and goes on at `rig done`."""

    before: int | None = Field(None, ge=1, description="ordinal of the point before which it is done; 1: the first")
    before_replication: int | None = Field(None, ge=1, description="instead: before the first point of a replication")
    before_whole_plot: int | None = Field(None, ge=1, description="instead: before a whole plot, and before its soak")
    before_every: Literal["replication", "whole plot"] | None = Field(
        None,
        description="instead: before every replication, or before every whole plot and its soak, then also before one "
        "that is measured again",
    )
    say: str = Field(min_length=1, max_length=300, description="what the person has to do, one sentence")
    change: str = Field(
        min_length=1,
        max_length=40,
        pattern=r"^[a-z][a-z0-9]*(-[a-z0-9]+)*$",
        description="a short word for the change, which is recorded: `pads-locked`",
    )
    value: str | None = Field(
        None,
        max_length=63,
        pattern=r"^[A-Za-z][A-Za-z0-9_]*_[A-Za-z][A-Za-z0-9_]*$",
        description="name, with its unit, of a number that the person has to state: `force_kN`",
    )
    range: tuple[_Finite, _Finite] | None = Field(
        None, description="smallest and largest number that is accepted for `value`, in its unit; left out: any"
    )
    timeout_h: Annotated[Positive | None, Field(le=1000)] = Field(
        None, description="hours after which the run is parked; left out: as a hold, `recovery.hold_max_s`"
    )

    @field_validator("say")
    @classmethod
    def _can_be_shown(cls, say: str) -> str:
        if not say.isprintable() or not say.strip(" ."):
            raise ValueError("it is shown to a person: one line of printable characters")
        return say.strip()

    @model_validator(mode="after")
    def _has_one_place(self) -> Self:
        given = [name for name in _PLACES if getattr(self, name) is not None]
        if len(given) != 1:
            said = f"not {' and '.join(given)}" if given else "and none is given"
            raise ValueError(f"a step has one place, {', '.join(_PLACES[:-1])} or {_PLACES[-1]}, {said}")
        return self

    @model_validator(mode="after")
    def _has_a_range_of_a_value(self) -> Self:
        if self.range is not None and self.value is None:
            raise ValueError("range is that of a number which the person states: give it a name, value")
        if self.range is not None and not self.range[0] < self.range[1]:
            raise ValueError(f"range = {list(self.range)}: the smaller number comes first")
        return self

    def wrong_place(self, points: int, replications: int, whole_plots: int) -> str:
        """Why a run has no such place, as a sentence; "" if it has.

        Args:
            points: length of its run list.
            replications: number of its replications.
            whole_plots: number of its whole plots.
        """
        if self.before_every == WHOLE_PLOT:
            return "" if whole_plots else 'before_every = "whole plot": the run has no whole plots'
        if self.before_every is not None:
            return ""
        there = {"before": points, "before_replication": replications, "before_whole_plot": whole_plots}
        name = next(name for name in _PLACES if getattr(self, name) is not None)
        if getattr(self, name) <= there[name]:
            return ""
        what = {"before": "point", "before_replication": "replication", "before_whole_plot": "whole plot"}[name]
        return f"{name} = {getattr(self, name)}: the run has {there[name]} {what}{'' if there[name] == 1 else 's'}"

    def indices(self, points: Points) -> list[int]:
        """Indices of the points before which it is done."""
        if self.before is not None:
            return [self.before - 1]
        by_replication = self.before_replication is not None or self.before_every == REPLICATION
        wanted = self.before_replication if by_replication else self.before_whole_plot
        first: dict[int | None, int] = {}
        for code, (replication, whole_plot) in enumerate(points.places.levels):
            at, place = points.places.first(code), replication if by_replication else whole_plot
            if wanted is None or place == wanted:
                first[place] = min(at, first.get(place, at))
        return sorted(first.values())

    def step(self, index: int) -> HandStep:
        """The step before a point of the run list."""
        low, high = self.range or (None, None)
        again = self.before_every == WHOLE_PLOT
        return HandStep(index, self.say, self.change, self.value or "", self.timeout_h, low, high, again)


Steps = Annotated[tuple[HandSettings, ...], Field(max_length=MOST_STEPS)]
"""`[[by_hand]]` of a procedure."""


def check_places(steps: Iterable[HandSettings], *, points: int, replications: int, whole_plots: int = 0) -> None:
    """Refuse steps at places that a run does not have. Raises ValueError."""
    for number, step in enumerate(steps, 1):
        wrong = step.wrong_place(points, replications, whole_plots)
        if wrong:
            raise ValueError(f"by_hand, step {number} ({step.change}): {wrong}")


def with_steps(run_list: RunList, steps: Sequence[HandSettings]) -> RunList:
    """The run list with its steps by hand, in the order in which they are done."""
    if not steps:
        return run_list
    placed = [step.step(index) for step in steps for index in step.indices(run_list.points)]
    return run_list.with_steps(sorted(placed, key=lambda step: step.before))
