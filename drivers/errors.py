"""Errors of instruments, named by the operator's situation.

Every message says what happened, at which instrument and address, and what to do next.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence


class DriverError(Exception):
    """Base of all errors a driver raises on purpose."""


class Unreachable(DriverError):
    """The address cannot be opened: cable, power, permissions or a wrong address."""


class WrongAddress(Unreachable):
    """The address in the bench file must not be opened: it is refused before anything is opened."""


class NoReply(DriverError):
    """A query was sent, and no complete answer came in time."""


class BadReply(DriverError):
    """Received data is not an answer to the question."""


class WrongInstrument(DriverError):
    """An instrument answers, but it is not the one the bench file declares."""


class InstrumentError(DriverError):
    """The instrument itself reports an error.

    Attributes:
        code: the instrument's error number, 0 if it has none.
        text: the instrument's own text.
    """

    def __init__(self, instrument: str, code: int, text: str) -> None:
        super().__init__(f"{instrument} reports error {code}: {text}" if code else f"{instrument.rstrip(',')}: {text}")
        self.code = code
        self.text = text


class ChannelsFailed(InstrumentError):
    """Some channels of a reader have no reading, and others have.

    Attributes:
        failed: why, by channel.
        readings: readings of the others, by channel.
    """

    def __init__(self, instrument: str, failed: Mapping[str, str], readings: Mapping[str, Sequence[float]]) -> None:
        super().__init__(
            instrument, 0, "; ".join(f"channel {name} has no reading: {why}" for name, why in failed.items())
        )
        self.failed, self.readings = failed, readings


class LimitError(DriverError):
    """A command outside the limits was refused before anything was sent."""


class NotReady(DriverError):
    """The instrument cannot do this now: not homed, drive off, in local control."""
