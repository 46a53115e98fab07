"""Events of the bench: preparation, states found and left, faults, warnings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rig.run_file.bodies import Chambers, Count, Counts, Seconds, Table, Text, Words
from rig.run_file.events.event import DETAIL, EMPTY, ROUTINE, STEP, Event, Importance, Status, at

if TYPE_CHECKING:
    from rig.run_file.columns import Columns


_ABORT = "abort"
_PAGE_FAULT = Importance("fault", "warning", "fault")
_GIVEN_UP = Importance("fault", "error")
"""Not sent: people are told by the session's end, which follows."""


@dataclass(frozen=True, kw_only=True)
class AsFound(Event, status="as-found", matters=ROUTINE):
    """The bench as found before it is prepared: axes, chambers, outputs that were on, instruments that had restarted.

    Motion had been stopped: `on` says of what kept changing that it holds its value.
    """

    axes: Table = EMPTY
    chambers: Table = EMPTY
    on: Words = EMPTY
    restarted: Words = ()

    @property
    def importance(self) -> Importance:
        """A step if something was on."""
        return STEP if self.outputs else ROUTINE

    @property
    def outputs(self) -> Sequence[str]:
        """Outputs that were on, with their values, and what became of them, in words."""
        chambers = [
            f"{name} was found on at {one['temperature_degC']:g} degC, with a setpoint of {one['setpoint_degC']:g}; "
            f"it was left so"
            for name, one in self.chambers.items()
            if one.get("running")
        ]
        return [*self.on, *chambers]

    def sentence(self, record: Columns) -> str:
        """Outputs that were on, and who had restarted."""
        on = "".join(f"; {words}" for words in self.outputs)
        return f"the bench was read as found{on}{_restarted(self.restarted)}"


@dataclass(frozen=True, kw_only=True)
class ReadBack(Event, status="read-back", matters=ROUTINE, exported=True):
    """The bench as read after a failure, before the run continues."""

    axes: Table = EMPTY
    chambers: Table = EMPTY
    restarted: Words = ()

    def sentence(self, record: Columns) -> str:
        """Who had restarted."""
        return f"the bench was read back{_restarted(self.restarted)}"


def _restarted(names: Words) -> str:
    return f"; {' and '.join(names)} had restarted" if names else ""


@dataclass(frozen=True, kw_only=True)
class Preparing(Event, status="preparing", matters=DETAIL, says="preparing"):
    """Set-up, homing and environment begin; logs show it as a change of state."""


@dataclass(frozen=True, kw_only=True)
class Prepared(Event, status="prepared", matters=ROUTINE, says="prepared"):
    """Set-up, homing and environment are complete."""


@dataclass(frozen=True, kw_only=True)
class Homed(Event, status="homed", exported=True, says="homed"):
    """Axes have been homed."""


@dataclass(frozen=True, kw_only=True)
class EnvironmentSettled(Event, status="environment-settled", says="environment settled"):
    """The environment has settled as requested. The body is the settling evidence by chamber."""

    chambers: Mapping[str, Mapping[str, Any]] = EMPTY

    def body(self) -> dict[str, Any]:
        """Fields of the record besides its own columns."""
        return dict(self.chambers)

    @classmethod
    def of_body(cls, body: Mapping[str, Any], status: str | None) -> Event:
        """The event for a checked body."""
        return cls(chambers=body)


@dataclass(frozen=True, kw_only=True)
class EnvironmentStands(Event, status="environment-stands", says="the environment stands as the run before left it"):
    """In a loop, the environment has settled in the run before, and was watched since. Chambers as they are read."""

    chambers: Chambers = EMPTY


@dataclass(frozen=True, kw_only=True)
class Remark(Event, status="remark", says="{instrument}: {message}"):
    """A remark of an instrument for people."""

    instrument: Text = ""
    message: Text = ""


@dataclass(frozen=True, kw_only=True)
class MadeSafe(Event, status="safe", exported=True):
    """The result of bringing the bench to its safe state.

    Attributes:
        seconds: bench seconds taken.
        within_s: stated maximum, seconds; None if none was stated.
        unsafe: instruments that could not be shown to be safe, one sentence each.
        silent: harmless instruments that did not answer.
        found: readbacks, by instrument.
        only: the instruments, if not all of the bench.
        stays_on: outputs of the others, which stay on for the next run of a loop, with their values.

    """

    seconds: Seconds = 0.0
    within_s: Seconds | None = None
    unsafe: Words = ()
    silent: Words = ()
    found: Table = EMPTY
    only: Words = EMPTY
    stays_on: Words = EMPTY

    @property
    def importance(self) -> Importance:
        """An unsafe bench has the highest importance; people are told by the session's end."""
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

    def sentence(self, record: Columns) -> str:
        """How long it took, or what is not safe."""
        if self.unsafe:
            return self.words
        on = f"; for the next run of the loop {' and '.join(self.stays_on)}" if self.stays_on else ""
        return f"{', '.join(self.only) or 'bench'} {self.words}{on}"


@dataclass(frozen=True, kw_only=True)
class Fault(Event, kind="fault", exported=True):
    """A fault and the decision about it.

    Attributes:
        decision: "retry", "skip", "abort"...
        message: description of the fault.
        evidence: data of the error.
        error: name of the error's class.
        fault: class of the fault, as policies name it; None if no policy covered it.
        where: the state in which it occurred.
        failure: number of failures at this place.
        number: number of failures in the session.
        pause_s: pause before the next attempt, seconds.
        state: the state in which the session was given up.

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
        """Whether the fault ends its session."""
        return self.decision == _ABORT

    @property
    def importance(self) -> Importance:
        """A fault that ends the session has the highest importance."""
        return _GIVEN_UP if self.gives_up else _PAGE_FAULT

    @property
    def ending(self) -> str:
        """How it ends its session, in words; "" if it does not end it."""
        return "fault" if self.gives_up else ""

    @property
    def decided(self) -> str:
        """Class of fault and decision: "no_reply: retry"."""
        return f"{self.fault or 'fault'}: {self.decision}"

    def sentence(self, record: Columns) -> str:
        """The fault, its place, its number, and the decision."""
        name = (self.fault or "fault").replace("_", " ")
        where = at(record) or (f" while {self.where}" if self.where else "")
        again = f", failure {self.failure}" if self.failure and self.failure > 1 else ""
        waits = f" after {self.pause_s:g} s" if self.pause_s else ""
        return f"{name}{where}{again}: {self.message} ({self.decision}{waits})"


@dataclass(frozen=True, kw_only=True)
class Recovered(Event, status="recovered", exported=True):
    """Success at a place after failures; the number of failures by class."""

    place: Text = ""
    failures: Counts = EMPTY

    def sentence(self, record: Columns) -> str:
        """After what."""
        what = ", ".join(f"{fault.replace('_', ' ')} {n}x" for fault, n in self.failures.items())
        return f"{self.place}: went well in the end, after {what}"


@dataclass(frozen=True)
class Warned(
    Event, status="warning", matters=Importance("warning", "warning", "warning"), says="early warning: {message}"
):
    """An early warning.

    Attributes:
        cause: "noise", "drift", "calibration", "response", "thermometer", "contradictory" or "doubted"; "itself" if the
            warnings have ended.
        output: name of the output or thermometer; of the instrument with a doubted point.
        message: a sentence with figures.
        doubted: index of a point whose accepted observation is doubted.

    """

    cause: Text = ""
    output: Text = ""
    message: Text = ""
    doubted: Count | None = None


@dataclass(frozen=True)
class Emerging(
    Warned, status="emerging", matters=Importance("warning", "warning", "warning"), says="early look: {message}"
):
    """A warning by an early look, a trace of the run so far; it is recorded at any moment.

    Attributes:
        cause: "look".
        output: of the sensor that has it most; "" if the look itself went wrong.
    """


@dataclass(frozen=True, kw_only=True)
class Learned(Event, status="learned", matters=DETAIL, says="how {instrument} prints its readings was learned"):
    """Knowledge of a reader of its instrument."""

    instrument: Text
    learned: Table
