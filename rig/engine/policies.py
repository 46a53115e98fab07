"""Which errors at a point a procedure may decide about, and what it decides."""

from __future__ import annotations

from drivers.errors import BadReply, InstrumentError, NoReply, NotReady, Unreachable
from procedures.settings import FaultSettings
from rig.engine.actions import NotSettled


class OverloadedError(Exception):
    """A reading was out of the instrument's range."""


def policy_for(error: Exception, faults: FaultSettings) -> str | None:
    """What follows when the retries are used up: "skip", "hold" or "abort"; None if the procedure has no say."""
    policies: tuple[tuple[tuple[type[Exception], ...], str], ...] = (
        ((NotSettled,), faults.not_settled),
        ((OverloadedError,), faults.overload),
        ((NoReply, BadReply, Unreachable), faults.no_reply),
        ((InstrumentError, NotReady), faults.instrument_error),
    )
    return next((policy for kinds, policy in policies if isinstance(error, kinds)), None)
