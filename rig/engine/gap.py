"""The gap between two sessions of a run: by one clock that kept running, or by UTC across a restart."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime

from rig.drivers.clock import Clock
from rig.run_file.state.state import RunState

LONGEST_S = 366 * 86400.0
"""A longer gap by UTC means a wrong clock; a bench left alone for longer starts from the beginning anyway."""
_STEP_S = 120.0
"""A clock may be set back by this much, seconds, and the gap is still known well enough by UTC."""
_ROUNDING_S = 0.001
"""Rounding errors of sums of clock readings are smaller than this, seconds."""


@dataclass(frozen=True)
class Gap:
    """The time since the last record.

    Attributes:
        origin: clock reading at which the run's elapsed time was zero.
        certain: measured by one clock.
        known: False if UTC cannot be right, or the one clock went back. The gap then counts as zero, and no
            environment is assumed to have held.
        warning: message for a person, "" if none.

    """

    origin: float
    certain: bool = True
    known: bool = True
    warning: str = ""


def gap_since(state: RunState, clock: Clock, boot: str) -> Gap:
    """The gap between the last record and now; zero before the first session.

    Args:
        state: the state of the run by its records.
        clock: bench time.
        boot: the name of this boot of the bench's clock, "" if that has none.

    """
    last = clock.now() - state.elapsed_s
    if state.session is None:
        return Gap(last)
    if boot and state.session.boot == boot:
        origin = state.session.origin
        behind_s = origin - last
        if behind_s <= _ROUNDING_S:
            return Gap(origin)
        return Gap(
            last,
            certain=False,
            known=False,
            warning=f"the bench's clock is {behind_s:.0f} s behind the last record's without a restart between them "
            f"(was a snapshot of the machine restored?); the gap is not known",
        )
    utc_s = clock.utc()
    gap_s = utc_s - state.utc_s
    if -_STEP_S <= gap_s <= LONGEST_S:
        return Gap(last - max(0.0, gap_s), certain=False)
    # The last session may have had a wrong clock. An earlier one with a right clock says when elapsed time was zero.
    by_earlier_s = utc_s - state.latest_zero_s - state.elapsed_s
    if 0.0 <= by_earlier_s <= LONGEST_S:
        return Gap(last - by_earlier_s, certain=False, warning=_words(state, utc_s, "an earlier session's is taken"))
    return Gap(last, certain=False, known=False, warning=_words(state, utc_s, "the gap is not known; set the clock"))


def _words(state: RunState, utc_s: float, then: str) -> str:
    return (
        f"the machine's clock was wrong or is: it says {_date(utc_s)}, the last record {_date(state.utc_s)} UTC, "
        f"with a restart between them; {then}"
    )


def _date(utc_s: float) -> str:
    try:
        return f"{datetime.fromtimestamp(utc_s, UTC):%Y-%m-%d %H:%M}"
    except (OverflowError, ValueError, OSError):
        return f"{utc_s:.0f} s after 1970"
