"""The event of a correction: a typed entry is given another value, and both are kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rig.run_file.bodies import Count, Number, Text, Values, Words
from rig.run_file.events.event import EMPTY, Event, Importance

if TYPE_CHECKING:
    from rig.run_file.columns import Columns


@dataclass(frozen=True, kw_only=True)
class Corrected(Event, kind="correction", matters=Importance("decision", "warning"), exported=True):
    """A person corrected a reading that was typed. It may follow the end of the run; nothing that was recorded changes.

    Attributes:
        column: its name, with its unit.
        number: ordinal of the entry among the readings of the observation, from 1.
        unit: in which it was typed.
        old: the entry before, in that unit.
        new: the entry from now on.
        readings: all readings of the column at the point from now on, in the column's unit.
        why: the reason, a person's words.
        who: name of the person, "" if unknown; not verified.
        after: numbers of certificates that had been issued of the run before.

    """

    column: Text
    number: Count
    unit: Text
    old: Number
    new: Number
    readings: Values
    why: Text
    who: Text = ""
    after: Words = EMPTY

    def sentence(self, record: Columns) -> str:
        """Both values, the reason and the author."""
        by = f" by {self.who}" if self.who else ""
        after = f", after certificate {', '.join(self.after)}" if self.after else ""
        values = f"{self.old!r} {self.unit} became {self.new!r}"
        return f"{self.column} at point {record.run_index} was corrected{by}{after}: {values}, because {self.why}"
