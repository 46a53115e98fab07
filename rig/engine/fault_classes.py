"""Errors of a measurement, and the class of each in the procedure's `[faults]` table.

A driver's errors describe the instrument. These errors describe the effect on the point, the axis or the whole plot.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from rig.drivers.errors import BadReply, DriverError, InstrumentError, NoReply, NotReady, Unreachable
from rig.errors import BenchFault


class NotSettled(Exception):
    """A quantity did not settle in time. `evidence` holds its samples, `too_late` names what a limit of time ended."""

    def __init__(self, message: str, evidence: Mapping[str, Any], too_late: Collection[str] = ()) -> None:
        super().__init__(message)
        self.evidence, self.too_late = evidence, too_late


class TemperaturesNotSettled(NotSettled):
    """A chamber or a thermometer did not settle in time, or the chamber's setpoint was changed by somebody else."""


class OverloadedError(Exception):
    """A reading was out of the instrument's range."""


class DoubtfulReadings(Exception):
    """Readings that the policies may still accept. `evidence` holds them."""

    evidence: Mapping[str, Any] = {}


class TooNoisy(DoubtfulReadings):
    """Readings scatter more than the procedure allows, even after repeats."""


class FrozenReading(DoubtfulReadings):
    """An output repeats its last reading to the last digit although the setting has changed."""


class ReferenceDisagrees(DoubtfulReadings):
    """A reference standard's reading is not near the setpoint."""


class TemperatureLeft(DoubtfulReadings):
    """A temperature that should be constant has left its band. `advice` is added where the run does not go on."""

    def __init__(self, message: str, advice: str = "") -> None:
        super().__init__(message)
        self.advice = advice


class NotAsDeclared(InstrumentError):
    """An instrument is set otherwise than the bench file says, or says itself that it is not well.

    `evidence` holds the readings since it was last asked; it is empty before readings.
    """

    evidence: Mapping[str, Any] = {}


class ChannelFailed(InstrumentError):
    """A channel of a reader has no reading, while others have. `evidence` holds those of the others."""

    evidence: Mapping[str, Any] = {}


class DriveFault(InstrumentError):
    """A drive reports a fault, or has lost control."""


class SupplyFailure(InstrumentError):
    """A pressure controller reports a fault of its supply, or a source a fault."""


class NotHomed(NotReady):
    """An axis has lost its zero, or did not find it."""


class InterlockHold(Exception):
    """An interlock is violated and its rule says to hold for a person."""


class LimitViolation(BenchFault):
    """A limit or an interlock of the bench is violated: safe state, regardless of the procedure."""


class ChamberAlarm(LimitViolation):
    """A chamber reports an alarm."""


TOLD_LATER = (NotAsDeclared, SupplyFailure, ChamberAlarm)
"""Defects that an instrument may have had for a while when it tells of them."""

FAULTS = (NotSettled, OverloadedError, TooNoisy, FrozenReading, ReferenceDisagrees, TemperatureLeft, DriverError)
"""Classes of faults for the policies of procedures."""

_CLASSES: tuple[tuple[type[Exception], str], ...] = (
    (TemperaturesNotSettled, "soak"),
    (TemperaturesNotSettled, "environment"),
    (NotSettled, "not_settled"),
    (OverloadedError, "overload"),
    (TooNoisy, "noisy"),
    (FrozenReading, "frozen"),
    (ReferenceDisagrees, "reference"),
    (TemperatureLeft, "temperature_left"),
    (ChannelFailed, "channel"),
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
    """The first class of the error that the procedure has a policy for; None if there is none."""
    return next((name for kind, name in _CLASSES if name in known and isinstance(error, kind)), None)
