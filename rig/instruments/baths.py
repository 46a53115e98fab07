"""A source of temperature as a chamber: a stirred bath or a block, for soaks of whole plots."""

from __future__ import annotations

from rig.drivers.roles import ChamberState, Identity, Source


class Bath:
    """A source in degrees Celsius with the commands and the state of a chamber (`rig.drivers.roles.Chamber`).

    Args:
        source: the instrument.
    """

    def __init__(self, source: Source) -> None:
        self._source = source

    def identify(self) -> Identity:
        """See `Instrument`."""
        return self._source.identify()

    def prepare(self) -> None:
        """See `Instrument`."""
        self._source.prepare()

    def make_safe(self) -> None:
        """See `Instrument`."""
        self._source.make_safe()

    def close(self) -> None:
        """See `Instrument`."""
        self._source.close()

    def limits(self) -> tuple[float, float]:
        """See `Chamber.limits`."""
        return self._source.limits()

    def set_temperature(self, degC: float) -> None:
        """See `Chamber.set_temperature`."""
        self._source.set(degC)

    def read(self) -> ChamberState:
        """See `Chamber.read`. A source does not report its power, which is 0; its faults are alarms."""
        state = self._source.read()
        return ChamberState(state.setpoint, state.value, 0.0, state.output, state.faults)

    def stop(self) -> None:
        """See `Chamber.stop`."""
        self._source.stop()
