"""Figures that a plan expects: times, precision, what is overdue by its end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import TYPE_CHECKING

from rig.bench.config import due_dates
from rig.procedures.plan.advice import Advice
from rig.procedures.plan.hand_steps import HandStep
from rig.runs.forecast import Forecast
from rig.runs.plans import Plan as Checked
from rig.verbs.plan.foreseen import expired, registered
from rig.verbs.plan.promised import Promised

if TYPE_CHECKING:
    from rig.procedures.plan.precision import Precision


@dataclass(frozen=True, eq=False, repr=False)
class Expected:
    """Attributes as of `rig.Plan`."""

    checked: Checked
    precision: Precision
    advice: Sequence[Advice]
    forecast: Forecast
    now: datetime
    disk: tuple[int, int]
    promised: Promised

    @property
    def finish(self) -> datetime:
        """Expected end, without incidents."""
        return self.now + timedelta(seconds=self.forecast.total_s)

    @property
    def finish_latest(self) -> datetime:
        """Latest expected end."""
        return self.now + timedelta(seconds=self.forecast.latest_s)

    @property
    def overdue(self) -> Sequence[str]:
        """Instruments whose own calibration is due before the end, or has no known date, one sentence each."""
        on = self.finish_latest.date()
        return [*_due(self.checked, on), *expired(self.checked, self.now.date(), on)]


def time_of(planned: Expected, step: HandStep) -> datetime:
    """About when a step by a person comes."""
    return planned.now + timedelta(seconds=planned.forecast.when_s(step, planned.checked.run_list))


def _due(checked: Checked, on: date) -> Iterator[str]:
    """Dates of the bench file that are over or missing; a person has none, and a register has that of its equipment."""
    known = registered(checked)
    asked = {
        name: one
        for name, one in checked.bench.instruments.items()
        if one.address and (one.due is not None or one.asset not in known)
    }
    for kind, names, due in due_dates(checked.bench.model_copy(update={"instruments": asked})):
        what = f"reference standard of {names}" if kind == "reference" else names
        if due is None and kind == "instrument":
            yield f"{names}: the bench file has no due date of its calibration"
        elif due is not None and due < on:
            yield f"{what}: its calibration is due {due}, before this run would end"
