"""The sequencer's states and triggers: one flat table, the only definition of permitted transitions.

`rig explain states` shows it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache

from transitions import Machine


class State(StrEnum):
    """States of the sequencer."""

    READY = "ready"
    CHECKING = "checking"
    PREPARING = "preparing"
    RECOVERING = "recovering"
    MOVING = "moving"
    SETTLING = "settling"
    MEASURING = "measuring"
    RECORDING = "recording"
    HOLDING = "holding"
    PARKING = "parking"
    DONE = "done"
    FAULTED = "faulted"


MEANING = {
    State.READY: "created or reopened; nothing has been sent to any instrument",
    State.CHECKING: "motion stopped, identities compared, states read; nothing commanded but stop",
    State.PREPARING: "instruments set up, axes homed, the environment or the next whole plot settled at temperature",
    State.RECOVERING: "the way back to the next point is planned beyond and through the previous point",
    State.MOVING: "axes under way, all of a leg together",
    State.SETTLING: "every axis inside its band, for the dwell, without drift",
    State.MEASURING: "sweeps over all channels",
    State.RECORDING: "the observation is made durable; the next point is chosen",
    State.HOLDING: "motion stopped, or at a point that a person reads; waits for release, done, stop, or a resume",
    State.PARKING: "axes go to the parking position",
    State.DONE: "the sequence is over; the run file says whether it is complete, was stopped, or held for too long",
    State.FAULTED: "every instrument has been brought to its safe state; the run can be resumed",
}

FINAL = frozenset({State.DONE, State.FAULTED})
AT_POINT = (State.RECOVERING, State.MOVING, State.SETTLING, State.MEASURING, State.RECORDING)
WORKING = (State.PREPARING, *AT_POINT)


@dataclass(frozen=True)
class Transition:
    """One permitted change of state."""

    trigger: str
    sources: tuple[State, ...]
    target: State
    when: str


TRANSITIONS = (
    Transition("check", (State.READY,), State.CHECKING, "at every start"),
    Transition(
        "repeat-check",
        (State.CHECKING, State.HOLDING, *WORKING),
        State.CHECKING,
        "an instrument failed, another attempt; or a hole in time: the controller had no turn for a while",
    ),
    Transition(
        "prepare",
        (State.CHECKING, State.HOLDING, *AT_POINT),
        State.PREPARING,
        "never completed, an axis not homed, the environment not as asked, idle for too long; the next point belongs "
        "to another whole plot, or the open one was lost; or a fault policy: re-home, re-soak",
    ),
    Transition(
        "recover", (State.CHECKING, State.PREPARING, State.HOLDING), State.RECOVERING, "the last move is unknown"
    ),
    Transition("repeat-preparation", (State.PREPARING,), State.PREPARING, "an instrument failed; another attempt"),
    Transition("retry", AT_POINT, State.RECOVERING, "a fault policy: another attempt at the point"),
    Transition("skip", AT_POINT, State.RECOVERING, "a fault policy: given up here for now"),
    Transition("move", (State.RECOVERING, State.RECORDING), State.MOVING, "there is a point to go to"),
    Transition("settle", (State.MOVING,), State.SETTLING, "no axis moves any more"),
    Transition(
        "measure", (State.SETTLING, State.HOLDING), State.MEASURING, "all axes settled; or a person has typed a reading"
    ),
    Transition("repeat", (State.MEASURING,), State.MEASURING, "too noisy; read again"),
    Transition("record", (State.MEASURING,), State.RECORDING, "readings complete"),
    Transition(
        "hold",
        (State.CHECKING, *WORKING, State.HOLDING),
        State.HOLDING,
        "asked for by `rig hold`, a fault policy, or an interlock; or a person has to do, set or read something",
    ),
    Transition(
        "park",
        (*WORKING, State.CHECKING, State.HOLDING),
        State.PARKING,
        "all points done, `rig stop`, or a hold nobody released",
    ),
    Transition("finish", (State.PARKING,), State.DONE, "parked"),
    Transition(
        "fault",
        (State.READY, State.CHECKING, *WORKING, State.HOLDING, State.PARKING),
        State.FAULTED,
        "an error no policy covers, a violated limit, or the disk refuses",
    ),
)


class Moves:
    """The present state, moved by triggers.

    `transitions` knows what is permitted; it is asked once for all moves. A trigger of `transitions` itself takes as
    long as all checks of a reading. One that is not permitted is given to it, and it raises.
    """

    def __init__(self) -> None:
        self._permitted = _permitted()
        self.state = State.READY

    def trigger(self, name: str) -> None:
        """Move on. Raises `transitions.MachineError` if the table does not permit this."""
        target = self._permitted.get((self.state, name))
        if target is None:
            refusing = machine()
            refusing.set_state(str(self.state))
            refusing.trigger(name)  # raises
            raise AssertionError(f"{name} from {self.state} is in no table")
        self.state = target


@cache
def _permitted() -> Mapping[tuple[State, str], State]:
    """The state after each trigger, by the state before and the trigger."""
    return {
        (State(source), name): State(t.dest)
        for name, event in machine().events.items()
        for source, found in event.transitions.items()
        for t in found
        if t.dest is not None
    }


def machine() -> Machine:
    """A machine with the transitions of the table, in state "ready"."""
    transitions = [
        {"trigger": t.trigger, "source": [str(s) for s in t.sources], "dest": str(t.target)} for t in TRANSITIONS
    ]
    states = [str(s) for s in State]
    return Machine(states=states, initial=str(State.READY), transitions=transitions, auto_transitions=False)
