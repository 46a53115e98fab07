"""Time of a loop: seconds since its begin, by the bench's clock, or, of a dry loop, by the worlds of its runs."""

from __future__ import annotations

from datetime import UTC, datetime, time, timedelta

from rig.drivers.clock import Clock
from rig.engine.gap import Gap, gap_since
from rig.errors import ConfigurationError
from rig.register import DOCUMENT
from rig.run_file.state.state import RunState
from rig.runs.controller import VIRTUAL, bench_clock
from rig.runs.plans import Plan

EVALUATION_S = 120.0
"""Bench seconds that an evaluation takes in a dry loop, whose clock stands still meanwhile."""


class Timeline:
    """Elapsed time and UTC of a loop in a session.

    Args:
        plan: of its first run.
        state: state by the records of its file; a new one has none.

    Attributes:
        boot: identifier of this boot of the bench's clock.
        gap: the gap since the last record.
    """

    def __init__(self, plan: Plan, state: RunState) -> None:
        self._clock: Clock | None = None
        self.boot, self._elapsed_s = VIRTUAL, state.elapsed_s
        self.gap = Gap(0.0)
        if plan.dry:
            from rig.simulated.calendar import begins  # noqa: PLC0415 - a real loop never loads the simulation

            self._zero_utc_s = begins(plan.truth, plan.bench, plan.documents.get(DOCUMENT)).timestamp()
        else:
            self._clock, self.boot = bench_clock(plan)
            self.gap = gap_since(state, self._clock, self.boot)

    @property
    def dry(self) -> bool:
        """Whether it is the time of simulated worlds."""
        return self._clock is None

    @property
    def clock_s(self) -> float:
        """Reading of the bench's clock."""
        return self._elapsed_s if self._clock is None else self._clock.now()

    @property
    def elapsed_s(self) -> float:
        """Seconds since the begin of the loop."""
        return self._elapsed_s if self._clock is None else self._clock.now() - self.gap.origin

    @property
    def utc_s(self) -> float:
        """UTC, seconds since 1970-01-01."""
        return self._zero_utc_s + self._elapsed_s if self._clock is None else self._clock.utc()

    def passes(self, until_s: float) -> None:
        """Note the time to which the world of a run of a dry loop has come."""
        self._elapsed_s = max(self._elapsed_s, until_s)


def seconds_until(time_of_day: str, utc_s: float) -> float:
    """Seconds from a moment to the next time of day such as 07:00, by the local time of this machine.

    Raises:
        ConfigurationError: it is no time of day.
    """
    try:
        at = time.fromisoformat(time_of_day)
    except ValueError:
        raise ConfigurationError(f"--until {time_of_day}: a time of day such as 07:00") from None
    now = datetime.fromtimestamp(utc_s, UTC).astimezone()
    for days in (0, 1, 2):
        end = datetime.combine(now.date() + timedelta(days=days), at).astimezone()
        if (seconds := end.timestamp() - utc_s) > 0:
            return seconds
    raise AssertionError


def clock_time(utc_s: float) -> str:
    """Local time of day, 03:12."""
    return f"{datetime.fromtimestamp(utc_s, UTC).astimezone():%H:%M}"
