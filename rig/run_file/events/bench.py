"""What the bench was made ready for, how it was found and left, and what went wrong with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rig.run_file.bodies import Count, Counts, Seconds, Table, Text, Words
from rig.run_file.events.event import DETAIL, EMPTY, ROUTINE, Event, Importance, Status, at

if TYPE_CHECKING:
    from rig.run_file.chain import Record


_ABORT = "abort"
_PAGE_FAULT = Importance("fault", "warning", "fault")
_GIVEN_UP = Importance("fault", "error")
"""The session's end, which follows, tells people."""


@dataclass(frozen=True, kw_only=True)
class AsFound(Event, status="as-found", matters=ROUTINE):
    """The bench as it was read before anything was commanded: axes, chambers, and who had restarted."""

    axes: Table = EMPTY
    chambers: Table = EMPTY
    restarted: Words = ()

    def sentence(self, record: Record) -> str:
        """Who had restarted."""
        return f"the bench was read as found{_restarted(self.restarted)}"


@dataclass(frozen=True, kw_only=True)
class ReadBack(Event, status="read-back", matters=ROUTINE, exported=True):
    """The bench as it was read after a failure, before going on."""

    axes: Table = EMPTY
    chambers: Table = EMPTY
    restarted: Words = ()

    def sentence(self, record: Record) -> str:
        """Who had restarted."""
        return f"the bench was read back{_restarted(self.restarted)}"


def _restarted(names: Words) -> str:
    return f"; {' and '.join(names)} had restarted" if names else ""


@dataclass(frozen=True, kw_only=True)
class Preparing(Event, status="preparing", matters=DETAIL, says="preparing"):
    """Set-up, homing and environment begin; logs tell it as a change of state."""


@dataclass(frozen=True, kw_only=True)
class Prepared(Event, status="prepared", matters=ROUTINE, says="prepared"):
    """Set-up, homing and environment are complete."""


@dataclass(frozen=True, kw_only=True)
class Homed(Event, status="homed", exported=True, says="homed"):
    """Axes have found their zeros."""


@dataclass(frozen=True, kw_only=True)
class EnvironmentSettled(Event, status="environment-settled", says="environment settled"):
    """The environment stands as asked for: how each chamber settled. They are the whole body."""

    chambers: Mapping[str, Mapping[str, Any]] = EMPTY

    def body(self) -> dict[str, Any]:
        """See `Event.body`."""
        return dict(self.chambers)

    @classmethod
    def of_body(cls, body: Mapping[str, Any], status: str | None) -> Event:
        """See `Event.of_body`."""
        return cls(chambers=body)


@dataclass(frozen=True, kw_only=True)
class Remark(Event, status="remark", says="{instrument}: {message}"):
    """Something an instrument said that is worth knowing."""

    instrument: Text = ""
    message: Text = ""


@dataclass(frozen=True, kw_only=True)
class MadeSafe(Event, status="safe", exported=True):
    """What became of bringing the bench to its safe state.

    Attributes:
        seconds: bench seconds it took.
        within_s: how long it was to take at most; None where that was not stated.
        unsafe: what could not be shown to be safe, one sentence an instrument.
        silent: instruments that can do no harm and did not answer.
        found: what was read back, by instrument.

    """

    seconds: Seconds = 0.0
    within_s: Seconds | None = None
    unsafe: Words = ()
    silent: Words = ()
    found: Table = EMPTY

    @property
    def importance(self) -> Importance:
        """An unsafe bench matters most; the session's end tells people."""
        return _GIVEN_UP if self.unsafe else self.matters

    @property
    def words(self) -> str:
        """For a message: "safe after 4.2 s"."""
        if self.unsafe:
            return f"NOT everything could be brought to its safe state: {'; '.join(self.unsafe)}"
        late = (
            ""
            if self.within_s is None or self.seconds <= self.within_s
            else f", later than the {self.within_s:g} s stated"
        )
        return f"safe after {self.seconds:.1f} s{late}"

    def sentence(self, record: Record) -> str:
        """After how long, or what is not safe."""
        return self.words if self.unsafe else f"bench {self.words}"


@dataclass(frozen=True, kw_only=True)
class Fault(Event, kind="fault", exported=True):
    """Something failed, and what was decided about it.

    Attributes:
        decision: "retry", "skip", "abort"...
        message: what failed.
        evidence: what the error brought with it.
        error: name of the error's class.
        fault: class of the fault, as policies name it; None where the procedure had no say.
        where: in which state.
        failure: how often it has failed there.
        number: how often it has failed in the session.
        pause_s: before the next try.
        state: in which the session was given up.

    """

    decision: Status
    message: Text
    evidence: Table | None = None
    error: Text | None = None
    fault: Text | None = None
    where: Text | None = None
    failure: Count | None = None
    number: Count | None = None
    pause_s: Seconds | None = None
    state: Text | None = None

    @property
    def gives_up(self) -> bool:
        """Whether it ends its session."""
        return self.decision == _ABORT

    @property
    def importance(self) -> Importance:
        """One that ends the session matters most."""
        return _GIVEN_UP if self.gives_up else _PAGE_FAULT

    @property
    def ending(self) -> str:
        """See `Event.ending`."""
        return "fault" if self.gives_up else ""

    @property
    def decided(self) -> str:
        """What was decided about which class: "no_reply: retry"."""
        return f"{self.fault or 'fault'}: {self.decision}"

    def sentence(self, record: Record) -> str:
        """What failed, where, how often, and the decision."""
        name = (self.fault or "fault").replace("_", " ")
        where = at(record) or (f" while {self.where}" if self.where else "")
        again = f", failure {self.failure}" if self.failure and self.failure > 1 else ""
        waits = f" after {self.pause_s:g} s" if self.pause_s else ""
        return f"{name}{where}{again}: {self.message} ({self.decision}{waits})"


@dataclass(frozen=True, kw_only=True)
class Recovered(Event, status="recovered", exported=True):
    """A place went well in the end, after so many failures of each class."""

    place: Text = ""
    failures: Counts = EMPTY

    def sentence(self, record: Record) -> str:
        """After what."""
        what = ", ".join(f"{fault.replace('_', ' ')} {n}x" for fault, n in self.failures.items())
        return f"{self.place}: went well in the end, after {what}"


@dataclass(frozen=True)
class Warned(
    Event, status="warning", matters=Importance("warning", "warning", "warning"), says="early warning: {message}"
):
    """An early warning.

    Attributes:
        cause: "noise", "drift", "calibration", "response" or "thermometer"; "itself" where warnings have ended.
        output: of which sensor or thermometer.
        message: in plain words, with figures.

    """

    cause: Text = ""
    output: Text = ""
    message: Text = ""
