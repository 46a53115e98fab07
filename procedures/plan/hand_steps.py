"""Steps by hand in a run list, and what a person made of them. `rig.procedures.plan.by_hand` reads them from a file."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

ALLOWANCE_H = 0.25
"""Time of a person for one step, hours, in forecasts."""


@dataclass(frozen=True, slots=True)
class HandStep:
    """A step in a run list.

    Attributes:
        before: index of the point before which it is done, from 0.
        say: what the person has to do, one sentence.
        change: a short word for the change, recorded in the run file.
        value: name with unit of the number that the person has to state; "" for none.
        timeout_h: hours after which the run is parked; None for the longest hold of the procedure.
        low: smallest number that is accepted, in its unit; None for any.
        high: the largest; None for any.
        again: whether it is done again where its whole plot is measured again.
    """

    before: int
    say: str
    change: str
    value: str = ""
    timeout_h: float | None = None
    low: float | None = None
    high: float | None = None
    again: bool = False

    @property
    def instruction(self) -> str:
        """The task, without a full stop at its end."""
        return self.say.rstrip(". ")

    def refuses(self, value: str | None) -> str:
        """Why an answer is refused, as a sentence; "" if it is accepted.

        Args:
            value: the stated number as text; None if none was stated.
        """
        if value is None:
            return f"this step asks for {self.value}: say it with --value" if self.value else ""
        if not self.value:
            return "this step asks for no value: leave out --value"
        try:
            number = float(value.replace("_", " _"))  # Python's own digits_groups are no numbers of a person
        except ValueError:
            point = "; write the decimal sign as a point" if "," in value else ""
            return f"--value {value!r:.60} is not a number; {self.value} is asked for{point}"
        if not isfinite(number):
            return f"--value {value:.60} is not a finite number; {self.value} is asked for"
        low, high = self.low, self.high
        if low is not None and high is not None and not low <= number <= high:
            return f"--value {value:.60} is outside the range of {self.value}, {low:g} to {high:g}; look at it again"
        return ""

    def as_json(self) -> dict[str, Any]:
        """Its values for the run file; those without meaning are left out."""
        values: dict[str, Any] = {"before": self.before, "say": self.say, "change": self.change, "value": self.value}
        values |= {"timeout_h": self.timeout_h, "low": self.low, "high": self.high, "again": self.again or None}
        return {k: v for k, v in values.items() if v is not None and v != ""}


@dataclass(frozen=True, slots=True)
class Made:
    """A change that a person made in a run.

    Attributes:
        change: the short word for it.
        say: what the person had to do.
        elapsed_s: when it was done; later observations are those of a changed bench.
        value: name with unit of the stated number; "" for none.
        number: the stated number; None for none.
        who: name of the person, "" if unknown.
    """

    change: str
    say: str
    elapsed_s: float
    value: str = ""
    number: float | None = None
    who: str = ""

    def as_json(self) -> dict[str, Any]:
        """Its values for reports and calibration files."""
        stated = {} if self.number is None else {self.value: self.number}
        who = {"who": self.who} if self.who else {}
        return {"change": self.change, "say": self.say, "elapsed_s": self.elapsed_s, **stated, **who}


def next_step(steps: Sequence[HandStep], done: Collection[int]) -> int | None:
    """Ordinal of the first step that is not done, from 1; None if there is none."""
    return next((number for number in range(1, len(steps) + 1) if number not in done), None)


def undone(steps: Sequence[HandStep], lost: range) -> list[int]:
    """Ordinals of the steps that are done again, from 1, if these points of a lost whole plot are measured again."""
    return [number for number, step in enumerate(steps, 1) if step.again and step.before in lost]
