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
        """Ask for the identity. Raises `WrongInstrument` for another model, `NoReply` without an answer."""
        return self._source.identify()

    def prepare(self) -> None:
        """Set remote control, units, ranges and speeds as the bench declares them."""
        self._source.prepare()

    def make_safe(self) -> None:
        """Bring this instrument to its safe state; idempotent, and called also after errors."""
        self._source.make_safe()

    def close(self) -> None:
        """Release the wire; idempotent."""
        self._source.close()

    def limits(self) -> tuple[float, float]:
        """Lowest and highest accepted setpoint, degrees Celsius."""
        return self._source.limits()

    def set_temperature(self, degC: float) -> None:
        """Command a setpoint with closed-loop control on. Raises `LimitError` before sending."""
        self._source.set(degC)

    def read(self) -> ChamberState:
        """Read its state. A source does not report its power, which is 0; its faults are alarms."""
        state = self._source.read()
        return ChamberState(state.setpoint, state.value, 0.0, state.output, state.faults)

    def stop(self) -> None:
        """Hold the present temperature: it becomes the setpoint."""
        self._source.stop()
