"""Events of what a person does by hand: steps, settings and readings; asked for, and done."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rig.run_file.bodies import Count, MaybeNumber, Number, Seconds, Text, Truth
from rig.run_file.events.event import DECISION, DETAIL, Event, Importance

if TYPE_CHECKING:
    from rig.run_file.columns import Columns


@dataclass(frozen=True, kw_only=True)
class AskedByHand(
    Event, kind="by-hand", status="asked", matters=Importance("decision", "warning", "hold"), exported=True
):
    """The run holds before a point, for a step that a person has to do.

    Attributes:
        step: ordinal of the step, from 1.
        before: index of the point before which it is done.
        say: what the person has to do.
        change: a short word for the change.
        value: name with unit of the number that the person has to state; "" for none.
        timeout_s: time after which the run is parked.

    """

    step: Count
    before: Count
    say: Text
    change: Text
    value: Text = ""
    timeout_s: Seconds

    def sentence(self, record: Columns) -> str:
        """The task."""
        asked = f"; {self.value} is asked for" if self.value else ""
        return f"a person is asked for step {self.step}, before point {self.before}: {self.say.rstrip('. ')}{asked}"


@dataclass(frozen=True, kw_only=True)
class DoneByHand(Event, kind="by-hand", status="done", matters=DECISION, exported=True):
    """A person said that a step was done.

    Attributes:
        step: ordinal of the step, from 1.
        before: index of the point before which it was done.
        say: what the person had to do.
        change: a short word for the change.
        value: name with unit of the stated number; "" for none.
        number: the stated number, in that unit; None for none.
        who: name of the person, "" if unknown; not verified.
        waited_s: time between asking and answer.

    """

    step: Count
    before: Count
    say: Text
    change: Text
    value: Text = ""
    number: MaybeNumber = None
    who: Text = ""
    waited_s: Seconds = 0.0

    def sentence(self, record: Columns) -> str:
        """The step, its author, and the stated value."""
        by = f" by {self.who}" if self.who else ""
        stated = "" if self.number is None else f", {self.value} = {self.number!r}"
        return f"step {self.step} was done by hand{by} after {self.waited_s:.0f} s: {self.say.rstrip('. ')}{stated}"


@dataclass(frozen=True, kw_only=True)
class AskedToSet(
    Event, kind="by-hand", status="asked-to-set", matters=Importance("decision", "warning", "hold"), exported=True
):
    """The run holds before a point, for a factor that a person has to set.

    Attributes:
        before: index of the point for which it is set.
        factor: its name, with its unit.
        setpoint: the value, in that unit.
        say: what the person has to do.
        timeout_s: time after which the run is parked.

    """

    before: Count
    factor: Text
    setpoint: Number
    say: Text
    timeout_s: Seconds

    def sentence(self, record: Columns) -> str:
        """The task."""
        return f"a person is asked, for point {self.before}: {self.say}"


@dataclass(frozen=True, kw_only=True)
class SetByHand(Event, kind="by-hand", status="set", matters=DECISION, exported=True):
    """A person said that a factor was set.

    Attributes:
        before: index of the point for which it was set.
        factor: its name, with its unit.
        setpoint: the value that was asked for, in that unit.
        number: the stated value; None if none was stated.
        who: name of the person, "" if unknown; not verified.
        waited_s: time between asking and answer.

    """

    before: Count
    factor: Text
    setpoint: Number
    number: MaybeNumber = None
    who: Text = ""
    waited_s: Seconds = 0.0

    def sentence(self, record: Columns) -> str:
        """The setting, its author, and the stated value."""
        by = f" by {self.who}" if self.who else ""
        stated = "" if self.number is None else f", stated as {self.number!r}"
        return f"{self.factor} was set to {self.setpoint:g}{by} after {self.waited_s:.0f} s{stated}"


@dataclass(frozen=True, kw_only=True)
class AskedToRead(
    Event, kind="by-hand", status="asked-to-read", matters=Importance("decision", "warning", "hold"), exported=True
):
    """The run holds at a point, for a reading that a person has to take and type.

    Attributes:
        column: its name, with its unit.
        number: ordinal of the reading of this column at this point, from 1.
        unit: in which it is typed.
        say: what the person has to do.
        timeout_s: time after which the run is parked.

    """

    column: Text
    number: Count
    unit: Text
    say: Text
    timeout_s: Seconds

    @property
    def importance(self) -> Importance:
        """Only the first reading calls a person, who is there for the next ones."""
        return self.matters if self.number == 1 else Importance("decision", "info")

    def sentence(self, record: Columns) -> str:
        """The task."""
        return f"a person is asked, at point {record.run_index}: {self.say}"


@dataclass(frozen=True, kw_only=True)
class ReadByHand(Event, kind="by-hand", status="read", matters=DETAIL, exported=True):
    """A person has typed a reading.

    Attributes:
        column: its name, with its unit.
        number: ordinal of the reading of this column at this point, from 1; 1 begins anew.
        unit: in which it was typed.
        typed: the number, in that unit.
        confirmed: whether it was far from the others at its setting, and typed again.
        who: name of the person, "" if unknown; not verified.
        waited_s: time between asking and answer.

    """

    column: Text
    number: Count
    unit: Text
    typed: Number
    confirmed: Truth = False
    who: Text = ""
    waited_s: Seconds = 0.0

    def sentence(self, record: Columns) -> str:
        """The reading and its author."""
        by = f" by {self.who}" if self.who else ""
        sure = ", far from the others there and confirmed" if self.confirmed else ""
        return f"{self.column} was read{by} at point {record.run_index}: {self.typed!r} {self.unit}{sure}"
