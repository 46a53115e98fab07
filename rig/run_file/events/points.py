"""Points and whole plots: what was observed, given up, begun and lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rig.run_file.bodies import Arrivals, Chambers, Channels, Count, Numbers, Seconds, Span, Table, Text, Words
from rig.run_file.events.event import DECISION, DETAIL, EMPTY, LOSS, ROUTINE, Event, Importance, Status

if TYPE_CHECKING:
    from rig.run_file.chain import Record


ACCEPTED, REJECTED = "accepted", "rejected"
_LATER, _FINAL = "later", "final"


@dataclass(frozen=True, kw_only=True)
class Observed(Event, kind="observation", matters=DETAIL):
    """What was captured at a point.

    Attributes:
        verdict: `ACCEPTED` or `REJECTED`.
        approach: side and start, by axis.
        readback: of the axes, by quantity.
        settling: evidence that the axes settled, by name.
        measured_s: elapsed time when the readings began and ended.
        environment: state of the chambers, by name.
        overload: what was out of range; only then the readings stand in `readings`, with null for what was.
        readings: by column.
        outputs: mean, sd and readings, by column.
        temperatures: likewise.
        references: likewise, of what the sensors are calibrated against.
        flags: what a reader of the data should know of it.
        rejected: readings of the same attempt that were too noisy.
        hole_s: a hole in time for which it was rejected.
        lost: why its whole plot was lost, for which it was rejected.

    """

    verdict: Status
    approach: Arrivals = EMPTY
    readback: Numbers = EMPTY
    settling: Table = EMPTY
    measured_s: Span | None = None
    environment: Chambers = EMPTY
    overload: Words | None = None
    readings: Table = EMPTY
    outputs: Channels = EMPTY
    temperatures: Channels = EMPTY
    references: Channels = EMPTY
    flags: Words = EMPTY
    rejected: Sequence[Mapping[str, Any]] = EMPTY
    hole_s: Seconds | None = None
    lost: Text | None = None

    @property
    def accepted(self) -> bool:
        """Whether it counts."""
        return self.verdict == ACCEPTED

    @property
    def importance(self) -> Importance:
        """One that was rejected is told."""
        return self.matters if self.accepted else DECISION

    def sentence(self, record: Record) -> str:
        """Whether it was accepted."""
        if self.accepted:
            return f"point {record.run_index} observed"
        lost = " in a whole plot that was lost" if record.whole_plot is not None else ""
        return f"readings at point {record.run_index}{lost} were not accepted"


@dataclass(frozen=True, kw_only=True)
class Skipped(Event, kind="skip", exported=True):
    """A point was put off, or given up for good.

    Attributes:
        when: "later" or "final".
        reason: why.

    """

    when: Status
    reason: Text

    @classmethod
    def until_later(cls, reason: str) -> Skipped:
        """A point that is put off."""
        return cls(when=_LATER, reason=reason)

    @classmethod
    def for_good(cls, reason: str) -> Skipped:
        """A point that is given up."""
        return cls(when=_FINAL, reason=reason)

    @property
    def final(self) -> bool:
        """Whether it was given up for good."""
        return self.when == _FINAL

    @property
    def importance(self) -> Importance:
        """People are told of points that were given up."""
        return Importance("decision", "warning", "warning" if self.final else "event")

    def sentence(self, record: Record) -> str:
        """Which, and why."""
        return f"point {record.run_index} {'skipped' if self.final else 'put off'}: {self.reason}"


@dataclass(frozen=True, kw_only=True)
class Renewing(Event, status="renewing", matters=ROUTINE):
    """Temperatures that stand already are left before a whole plot is soaked: where chambers are set meanwhile."""

    setpoints_degC: Numbers = EMPTY

    def sentence(self, record: Record) -> str:
        """Where to."""
        return f"leaving temperatures that stand, for {_settings(self.setpoints_degC)}"


@dataclass(frozen=True, kw_only=True)
class TemperaturesLeft(
    Event,
    status="temperatures-left",
    matters=ROUTINE,
    says="temperatures were left for whole plot number {planned} of the design",
):
    """Temperatures were changed for a planned whole plot."""

    planned: Count


@dataclass(frozen=True, kw_only=True)
class WholePlotBegan(Event, status="whole-plot"):
    """A soak is over: what follows belongs to a new whole plot, whose identity the record has.

    Attributes:
        planned: which planned one it is a measurement of.
        setpoints_degC: by chamber.
        settling: evidence, by name.

    """

    planned: Count
    setpoints_degC: Numbers = EMPTY
    settling: Table = EMPTY

    def sentence(self, record: Record) -> str:
        """Which, and where."""
        where = _settings(self.setpoints_degC)
        return f"whole plot {record.whole_plot} soaked (number {self.planned} of the design): {where}"


@dataclass(frozen=True, kw_only=True)
class WholePlotLost(Event, status="whole-plot-lost", matters=LOSS, exported=True):
    """A whole plot was given up, and is measured again under a new identity.

    Attributes:
        reason: why.
        planned: which planned one it was a measurement of.
        first: its first point in the run list.
        count: its points.
        kept: readings that stay.
        doubted_s: elapsed time from which on its readings are in doubt, and how many are `doubted`.

    """

    reason: Text
    planned: Count | None = None
    first: Count
    count: Count
    kept: Count | None = None
    doubted_s: Seconds | None = None
    doubted: Count | None = None

    @property
    def points(self) -> range:
        """Indexes of its points."""
        return range(self.first, self.first + self.count)

    def sentence(self, record: Record) -> str:
        """Why, and what becomes of it."""
        kept = "" if self.kept is None else f"{self.kept} readings stay, "
        return f"whole plot {record.whole_plot} lost: {self.reason}; {kept}it is measured again under a new identity"


def _settings(degC_by_chamber: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {degC:g} degC" for name, degC in degC_by_chamber.items())
