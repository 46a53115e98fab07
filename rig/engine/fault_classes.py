"""What can go wrong with a measurement, and the class of fault of the procedure's `[faults]` table each error is of.

A driver's errors say what an instrument did; these say what it means for the point, the axis or the whole plot.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from drivers.errors import BadReply, DriverError, InstrumentError, NoReply, NotReady, Unreachable
from rig.errors import BenchFault


class NotSettled(Exception):
    """A quantity did not arrive in time. `evidence` is what was seen."""

    def __init__(self, message: str, evidence: Mapping[str, Any]) -> None:
        super().__init__(message)
        self.evidence = evidence


class TemperaturesNotSettled(NotSettled):
    """A chamber or a thermometer did not arrive in time, or somebody else has set the chamber."""


class OverloadedError(Exception):
    """A reading was out of the instrument's range."""


class TooNoisy(Exception):
    """Readings scatter more than the procedure allows, also when they are repeated."""


class FrozenReading(Exception):
    """An output repeats its last reading to the last digit although the setting has changed."""


class TemperatureLeft(Exception):
    """A temperature that was to stand has left its band."""


class DriveFault(InstrumentError):
    """A drive complains, or is not in control any more."""


class SupplyFailure(InstrumentError):
    """A pressure controller complains of what it is supplied with."""


class NotHomed(NotReady):
    """An axis does not know where it is: it lost its zero, or did not find it."""


class InterlockHold(Exception):
    """An interlock is violated whose rule is to hold for a person."""


class LimitViolation(BenchFault):
    """A limit or an interlock of the bench is violated: safe state, whatever the procedure says."""


FAULTS = (NotSettled, OverloadedError, TooNoisy, FrozenReading, TemperatureLeft, DriverError)
"""What a procedure's policies may decide about."""

_CLASSES: tuple[tuple[type[Exception], str], ...] = (
    (TemperaturesNotSettled, "soak"),
    (TemperaturesNotSettled, "environment"),
    (NotSettled, "not_settled"),
    (OverloadedError, "overload"),
    (TooNoisy, "noisy"),
    (FrozenReading, "frozen"),
    (TemperatureLeft, "temperature_left"),
    (DriveFault, "drive_fault"),
    (SupplyFailure, "supply_failure"),
    (NotHomed, "not_homed"),
    (NoReply, "no_reply"),
    (BadReply, "bad_reply"),
    (Unreachable, "unreachable"),
    (InstrumentError, "instrument_error"),
    (NotReady, "instrument_error"),
)


def fault_class(error: Exception, known: frozenset[str]) -> str | None:
    """The first class an error is of, of those a procedure has policies for; None if it has no say."""
    return next((name for kind, name in _CLASSES if name in known and isinstance(error, kind)), None)
