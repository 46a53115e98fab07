"""Events of points and whole plots: observed, skipped, begun and lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rig.run_file.bodies import (
    Arrivals,
    Chambers,
    Channels,
    Count,
    Moves,
    Numbers,
    Seconds,
    Span,
    Spans,
    Table,
    Text,
    Texts,
    Words,
)
from rig.run_file.events.event import DECISION, DETAIL, EMPTY, LOSS, ROUTINE, Event, Importance, Status

if TYPE_CHECKING:
    from rig.run_file.columns import Columns


ACCEPTED, REJECTED = "accepted", "rejected"
CONTRADICTORY = "contradictory"
"""Flag of an observation with readings that contradict one another, see `rig.run_file.state.own_scatter`."""
MISSING = "missing"
"""Flag of an observation of which an output has no reading: see `Observed.missing`."""
OVERSHOT = "overshot"
"""Flag of an observation before which a setting had gone beyond a level that a standard reads; see `steered`."""
DOUBTED = "doubted"
"""Flag of an observation before which an instrument was well, and after which it told of a defect; see `Warned`."""
_LATER, _FINAL = "later", "final"


def _readings_of(*groups: Mapping[str, Mapping[str, Any]]) -> dict[str, Sequence[float]]:
    return {name: channel["readings"] for group in groups for name, channel in group.items()}


def readings_of(rejected: Sequence[Mapping[str, Any]]) -> list[dict[str, Sequence[float]]]:
    """Readings by column of each of several sets that were not accepted, see `Observed.rejected`."""
    return [_readings_of(*(one.get(g, EMPTY) for g in ("outputs", "temperatures", "references"))) for one in rejected]


@dataclass(frozen=True, kw_only=True)
class Observed(Event, kind="observation", matters=DETAIL):
    """An observation at a point.

    Attributes:
        verdict: `ACCEPTED` or `REJECTED`.
        approach: side and start, by axis.
        readback: readbacks of the axes, by quantity.
        settling: evidence that the axes settled, by name.
        moved: when each axis left its last setting, in elapsed time, and that setting. A gradual move counts as a step
            at the time at which the mean of what it passed is that of the step, and an overtravel is no setting.
        steered: of levels that a standard reads, by factor: the factor that sets it, the settings that were tried and
            what the standard read at each, and whether one went beyond the level.
        measured_s: elapsed time when the readings began and ended.
        taken_s: by column, when its own readings began and ended, seconds after the readings of the point began. What
            was read while others were, such as a readback, has no entry.
        environment: state of the chambers, by name.
        overload: columns that were out of range; `readings` is used only then, with null for overloads.
        readings: readings by column.
        outputs: mean, sd and readings, by column.
        temperatures: likewise.
        references: likewise, for the reference of the calibration.
        flags: remarks for readers of the data.
        missing: outputs without a reading, since their channel failed, and why.
        rejected: readings of the same attempt that were too noisy, or contradicted one another.
        hole_s: length of the hole in time for which it was rejected, seconds.
        lost: reason for the loss of its whole plot, if it was rejected for that.

    """

    verdict: Status
    approach: Arrivals = EMPTY
    readback: Numbers = EMPTY
    settling: Table = EMPTY
    moved: Moves = EMPTY
    steered: Table = EMPTY
    measured_s: Span | None = None
    environment: Chambers = EMPTY
    overload: Words | None = None
    readings: Table = EMPTY
    outputs: Channels = EMPTY
    temperatures: Channels = EMPTY
    references: Channels = EMPTY
    taken_s: Spans = EMPTY
    flags: Words = EMPTY
    missing: Texts = EMPTY
    rejected: Sequence[Mapping[str, Any]] = EMPTY
    hole_s: Seconds | None = None
    lost: Text | None = None

    @property
    def every_reading(self) -> dict[str, Sequence[float]]:
        """Readings of outputs, temperatures and references, by column; {} with an overload."""
        return _readings_of(self.outputs, self.temperatures, self.references)

    @property
    def accepted(self) -> bool:
        """Whether it counts."""
        return self.verdict == ACCEPTED

    @property
    def importance(self) -> Importance:
        """A rejected observation is reported."""
        return self.matters if self.accepted else DECISION

    def sentence(self, record: Columns) -> str:
        """Whether the observation was accepted."""
        if self.accepted:
            return f"point {record.run_index} observed"
        lost = "" if self.lost is None else " in a whole plot that was lost"
        return f"readings at point {record.run_index}{lost} were not accepted"


@dataclass(frozen=True, kw_only=True)
class Skipped(Event, kind="skip", exported=True):
    """A point was postponed or skipped.

    Attributes:
        when: "later" or "final".
        reason: reason for the decision.

    """

    when: Status
    reason: Text

    @classmethod
    def until_later(cls, reason: str) -> Skipped:
        """A postponed point."""
        return cls(when=_LATER, reason=reason)

    @classmethod
    def for_good(cls, reason: str) -> Skipped:
        """A skipped point."""
        return cls(when=_FINAL, reason=reason)

    @property
    def final(self) -> bool:
        """Whether the point was skipped for good."""
        return self.when == _FINAL

    @property
    def importance(self) -> Importance:
        """Skipped points are reported to people."""
        return Importance("decision", "warning", "warning" if self.final else "event")

    def sentence(self, record: Columns) -> str:
        """Which, and why."""
        return f"point {record.run_index} {'skipped' if self.final else 'put off'}: {self.reason}"


@dataclass(frozen=True, kw_only=True)
class Renewing(Event, status="renewing", matters=ROUTINE):
    """Chambers leave temperatures they already have, before a whole plot is soaked: their setpoints on the way."""

    setpoints_degC: Numbers = EMPTY

    def sentence(self, record: Columns) -> str:
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
    """The end of a soak: what follows belongs to a new whole plot, whose identity is in the record.

    Attributes:
        planned: number of the planned whole plot.
        setpoints_degC: setpoint by chamber.
        settling: evidence of settling, by name.
        settings: settings that are no temperatures, by factor.
        approach: side and start of what an instrument set of these, by axis.

    """

    planned: Count
    setpoints_degC: Numbers = EMPTY
    settling: Table = EMPTY
    settings: Numbers = EMPTY
    approach: Arrivals = EMPTY

    def sentence(self, record: Columns) -> str:
        """Which, and where."""
        others = [f"{name} {value:g}" for name, value in self.settings.items()]
        where = ", ".join([*([_settings(self.setpoints_degC)] if self.setpoints_degC else []), *others])
        done = "soaked" if self.setpoints_degC else "set"
        return f"whole plot {record.whole_plot} {done} (number {self.planned} of the design): {where}"


@dataclass(frozen=True, kw_only=True)
class WholePlotLost(Event, status="whole-plot-lost", matters=LOSS, exported=True):
    """A whole plot was given up; it is measured again under a new identity.

    Attributes:
        reason: reason for its loss.
        planned: number of the planned whole plot.
        first: its first point in the run list.
        count: number of its points.
        kept: number of its readings that are kept.
        doubted_s: elapsed time from which its readings are in doubt; their number is `doubted`.

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

    def sentence(self, record: Columns) -> str:
        """Reason and consequence."""
        kept = "" if self.kept is None else f"readings kept: {self.kept}, "
        return f"whole plot {record.whole_plot} lost: {self.reason}; {kept}it is measured again under a new identity"


def _settings(degC_by_chamber: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {degC:g} degC" for name, degC in degC_by_chamber.items())
