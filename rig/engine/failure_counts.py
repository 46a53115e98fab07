"""The step of a fault's policy that is due, by counts of failures.

`rig.procedures.plan.fault_policies` declares policies and their defaults; `rig.engine.deciding` carries them out.

Failures are counted by class of fault and by place (a point, or a state without a point), so that a fault at one point
does not use up the retries of another. The count restarts after success at the place. It also restarts, a few times,
after the instrument has worked for as long as the longest pause: a soak of hours may lose many replies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rig.drivers.errors import DriverError
from rig.engine.fault_classes import fault_class
from rig.procedures.plan.conduct import Conduct
from rig.procedures.plan.fault_policies import ABORT, ACCEPT, HOLD, RE_HOME, RE_SOAK, RETRY, SKIP, step_at

__all__ = ["ABORT", "HOLD", "RETRY", "RE_HOME", "RE_SOAK", "SKIP", "Decision", "Policies"]

_OF_THE_RUN = "temperature_left"
"""Classes counted over the whole session: all points and whole plots share the same chambers."""

_FORGIVEN = 20
"""How often the failures at one place may be forgotten."""


@dataclass(frozen=True)
class Decision:
    """The decision about an error.

    Attributes:
        fault: its class.
        action: "retry", "re-home", "re-soak", "skip", "hold" or "abort".
        failure: number of failures of this class here, including this one.
        number: number of times this action was taken for it, including this one.
        pause_s: pause before the action, seconds.

    """

    fault: str
    action: str
    failure: int
    number: int
    pause_s: float


class Policies:
    """The procedure's `[faults]`, with the failures of this session.

    Args:
        conduct: its policies.
        now: bench time.

    """

    def __init__(self, conduct: Conduct, now: Callable[[], float]) -> None:
        self._now = now
        self._over: dict[tuple[str, str], float] = {}
        self._forgiven: dict[tuple[str, str], int] = {}
        self._faults = conduct.faults
        repeats = {} if conduct.whole_plots is None else {RE_SOAK: conduct.whole_plots.repeats}
        self._known = frozenset(self._faults.classes())
        self._plans = {name: self._faults.plan(name, repeats if name == _OF_THE_RUN else {}) for name in self._known}
        self._failures: dict[str, dict[str, int]] = {}
        self._put_off = 0

    def decide(self, error: Exception, place: str, *, at_point: bool) -> Decision | None:
        """Count a failure and return the decision; None if no policy covers the error.

        Args:
            error: the error.
            place: name of the place, for counting.
            at_point: whether there is a current point; without one nothing can be skipped, and a soak is not repeated.

        """
        fault = fault_class(error, self._known)
        if fault is None:
            return None
        counts = self._failures.setdefault("run" if fault == _OF_THE_RUN else place, {})
        if isinstance(error, DriverError) and self._has_worked_since(place, fault):
            counts[fault] = 0
        counts[fault] = failure = counts.get(fault, 0) + 1
        action, number = step_at(self._plans[fault], failure)
        if action == RE_SOAK and not at_point and fault != _OF_THE_RUN:
            action = RETRY
        if action == SKIP and not at_point:
            action = ABORT
        if action == SKIP:
            self._put_off += 1
            if self._put_off >= self._faults.skips_in_a_row:
                action = ABORT
        waits = isinstance(error, DriverError) and action not in (HOLD, ABORT)
        pause_s = self._faults.pause(failure) if waits else 0.0
        self._over[place, fault] = self._now() + pause_s
        return Decision(fault, action, failure, number, pause_s)

    def _has_worked_since(self, place: str, fault: str) -> bool:
        """Whether the last failure here is long enough ago to be forgotten; bounded, or a run might never end."""
        key = (place, fault)
        well = self._now() - self._over.get(key, self._now()) >= self._faults.pause_max_s
        times = self._forgiven.get(key, 0)
        self._forgiven[key] = times + well
        return well and times < _FORGIVEN

    def accepts(self, fault: str, place: str) -> bool:
        """Whether the next failure of this class here is accepted with a flag."""
        if fault not in self._plans:
            return False
        counts = self._failures.get("run" if fault == _OF_THE_RUN else place, {})
        return step_at(self._plans[fault], counts.get(fault, 0) + 1)[0] == ACCEPT

    def done(self, place: str) -> dict[str, int]:
        """End a place's counts; returns the number of failures there by class."""
        for memory in (self._over, self._forgiven):
            for key in [key for key in memory if key[0] == place]:
                del memory[key]
        return self._failures.pop(place, {})

    def observed(self) -> None:
        """A point was accepted: earlier postponed points were exceptions."""
        self._put_off = 0
