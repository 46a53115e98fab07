"""Policies for faults in a procedure: the `[faults]` table.

Each class of fault has a policy: a sequence of steps, taken in order when the same fault occurs again at the same
place, e.g. `["retry 3", "re-home", "skip"]`. A text alone is the last step, after `retries` retries if the class has
any: `"skip"` is `["retry 2", "skip"]`.

Failures are counted in `rig/engine/failure_counts.py`; steps are taken in `rig/engine/deciding.py`. Repeats of noisy
readings are `measure.repeats`, those of lost whole plots `recovery.whole_plot_repeats` (`procedures/plan/settings.py`,
`procedures/plan/conduct.py`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, ClassVar, Self

from pydantic import BeforeValidator, Field, model_validator

from rig.procedures.plan.settings import Positive, Strict

RETRY, RE_HOME, RE_SOAK = "retry", "re-home", "re-soak"
SKIP, HOLD, ABORT, ACCEPT = "skip", "hold", "abort", "accept"
_REPEATED = (RETRY, RE_HOME, RE_SOAK)
_LAST = (SKIP, HOLD, ABORT, ACCEPT)
_MOST = 100

_Steps = str | list[str]


def _steps_only(value: object) -> object:
    """A policy; one message in place of one for each of its two forms."""
    if isinstance(value, str) or (isinstance(value, list) and all(isinstance(step, str) for step in value)):
        return value
    raise ValueError('should be a step or a list of steps, each in quotes, as "skip" or ["retry 3", "skip"]')


Policy = Annotated[_Steps, BeforeValidator(_steps_only)]

Times = Annotated[int, Field(ge=0, le=20)]


@dataclass(frozen=True)
class Step:
    """One step of a policy: an action, and its number of repeats before the next step."""

    action: str
    times: int


def steps(policy: Policy, retries: int, repeats: Mapping[str, int] = MappingProxyType({})) -> tuple[Step, ...]:
    """A policy as steps; "abort" is added if no step ends it.

    Args:
        policy: from the procedure file.
        retries: default number of retries, also before a policy that is a text alone.
        repeats: default number of other actions; once if not given.

    Raises:
        ValueError: with the invalid step.
    """
    words = [policy] if isinstance(policy, str) else policy
    found = [Step(RETRY, retries)] if isinstance(policy, str) and policy in _LAST else []
    for i, word in enumerate(words):
        action, _, number = word.strip().partition(" ")
        if action not in (*_REPEATED, *_LAST):
            raise ValueError(f"{word!r} is no step of a policy; known: {', '.join((*_REPEATED, *_LAST))}")
        if action in _LAST:
            if number or i < len(words) - 1:
                raise ValueError(f"{word!r} ends a policy: it stands last, without a number")
            found.append(Step(action, 0))
            continue
        times = repeats.get(action, retries if action == RETRY else 1)
        if number:
            if not number.strip().isdecimal() or not 1 <= int(number) <= _MOST:
                raise ValueError(f"{word!r}: how often is a whole number from 1 to {_MOST}")
            times = int(number)
        found.append(Step(action, times))
    if not found or found[-1].action not in _LAST:
        found.append(Step(ABORT, 0))
    return tuple(found)


def step_at(plan: tuple[Step, ...], failure: int) -> tuple[str, int]:
    """The action after the `failure`-th failure (from 1), and its ordinal among steps of that kind."""
    for step in plan[:-1]:
        if failure <= step.times:
            return step.action, failure
        failure -= step.times
    return plan[-1].action, 1


class FaultSettings(Strict):
    """Policies for faults: steps for each class of fault; see docs/how_to/policies.md."""

    retries: Times = Field(2, description='how often "retry" without a number, and before a policy of one word')
    pause_s: float = Field(2.0, ge=0, le=3600, description="before an instrument that failed is tried again")
    pause_growth: float = Field(2.0, ge=1, le=10, description="factor from one pause to the next")
    pause_max_s: Positive = Field(
        300.0, le=86400, description="but no longer than this; failures older than it are no longer counted"
    )
    skips_in_a_row: int = Field(
        10,
        ge=1,
        le=1_000_000,
        description="maximum number of points put off in succession; more mean a different problem: abort",
    )
    not_settled: Policy = Field("skip", description="an axis or pressure does not settle, or left its band")
    overload: Policy = Field("skip", description="a reading is out of the instrument's range")
    noisy: Policy = Field(["accept"], description="still noisier than allowed after `measure.repeats`; accept flags it")
    frozen: Policy = Field(
        ["retry 5", SKIP],
        description="an output or a reference standard hangs: it repeats itself to the last digit; accept flags it",
    )
    no_reply: Policy = Field(["retry 8", ABORT], description="an instrument does not answer")
    bad_reply: Policy = Field(["retry 5", ABORT], description="an answer makes no sense")
    unreachable: Policy = Field(["retry 8", ABORT], description="a port or connection is gone: unplugged, no power")
    instrument_error: Policy = Field(["retry 3", ABORT], description="an instrument reports an error or is not ready")

    actions: ClassVar[tuple[str, ...]] = (RETRY, SKIP, HOLD, ABORT)
    """Default policy of most classes."""

    special: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        dict.fromkeys(("noisy", "frozen"), (RETRY, ACCEPT, SKIP, HOLD, ABORT))
    )
    """Default policies of other classes; a single word has no retries before it."""

    follows: ClassVar[Mapping[str, str]] = MappingProxyType({"bad_reply": "no_reply", "unreachable": "no_reply"})
    """Default policy of the first class from the second, if the file has only that."""

    @classmethod
    def classes(cls) -> Iterator[str]:
        """Names of all classes of faults."""
        return (name for name, field in cls.model_fields.items() if field.annotation == _Steps)

    @model_validator(mode="after")
    def _policies_make_sense(self) -> Self:
        for name in self.classes():
            known = self.special.get(name, self.actions)
            try:
                plan = self.plan(name)
            except ValueError as error:
                raise ValueError(f"{name}: {error}") from None
            for step in plan:
                if step.action not in known:
                    raise ValueError(f"{name}: {step.action} makes no sense here; known: {', '.join(known)}")
        return self

    def plan(self, name: str, repeats: Mapping[str, int] = MappingProxyType({})) -> tuple[Step, ...]:
        """Steps of a class of fault; `repeats` as in `steps`."""
        other = self.follows.get(name)
        if other is not None and name not in self.model_fields_set and other in self.model_fields_set:
            return self.plan(other, repeats)
        policy: Policy = getattr(self, name)
        alone = isinstance(policy, str) and name in self.special
        return steps([policy] if isinstance(policy, str) and alone else policy, self.retries, repeats)

    def pause(self, failure: int) -> float:
        """Seconds to wait after the `failure`-th failure (from 1)."""
        growth: float = self.pause_growth ** (failure - 1)
        return min(self.pause_s * growth, self.pause_max_s)


class HeadFaults(FaultSettings):
    """Policies for faults: steps for each class of fault; see docs/how_to/policies.md."""

    drive_fault: Policy = Field(
        [RE_HOME, ABORT], description="a drive complains or went off; clearing it is part of every step"
    )
    not_homed: Policy = Field(["re-home 2", ABORT], description="an axis lost its zero, or did not find it")
    environment: Policy = Field(ABORT, description="the environment does not settle before the first point")
    temperature_left: Policy = Field(
        [ACCEPT], description="the environment left its tolerance at a point; accept flags the reading"
    )

    actions: ClassVar[tuple[str, ...]] = (RETRY, RE_HOME, SKIP, HOLD, ABORT)
    special: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {
            **FaultSettings.special,
            "environment": (RETRY, HOLD, ABORT),
            "temperature_left": (RETRY, ACCEPT, SKIP, HOLD, ABORT),
        }
    )
    follows: ClassVar[Mapping[str, str]] = MappingProxyType(
        {**FaultSettings.follows, "drive_fault": "instrument_error"}
    )
