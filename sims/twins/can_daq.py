"""Simulated data-acquisition unit on CAN: four inputs, measured on command.

The DBC in the options gives the positions of numbers in the frames. The unit sends nothing by itself, so a simulated
week without readings costs no time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import ClassVar

from rig.sims.faults import Kind
from rig.sims.faults.reading_faults import OF_READINGS
from rig.sims.inputs import Inputs
from rig.sims.noise import event_at, normal
from rig.sims.physics import WorldError
from rig.sims.twin import Accuracy, Medium, Role
from rig.sims.twins.keysight_meter import Plant
from rig.sims.wires.dbc import DbcSignal, read_dbc
from rig.sims.world import Timer, World

REPLY_S = 0.001
"""Seconds from a command to its answer."""

NONE, OPEN, SHORT, RANGE = range(4)
"""Possible faults of an input."""

_INPUTS = {
    "sensor_temperature": "Readings.SensorTemperature",
    "sse_temperature": "Readings.SseTemperature",
    "spare_temperature": "Readings.SpareTemperature",
    "spare_voltage": "Readings.SpareVoltage",
}
_NOISE = {"degC": 0.002, "V": 5e-6}  # noise of a reading that integrates for 0.1 s
_ACCURACY = {"degC": Accuracy(1.3e-2, digit=6e-5), "V": Accuracy(8e-6, digit=6e-7)}
_OUT_OF_RANGE = 1e6  # beyond the range of a signal, in any unit
_PRODUCT, _FIRMWARE = 4, (1, 2)
_STOP, _ACQUIRE, _IDENTIFY = range(3)

Transmit = Callable[[int, bytes], None]


class CanDaqTwin:
    """The unit.

    Args:
        name: the bench's name for it.
        options: its options in the bench file; uses `dbc` (text) and `channels`.
        world: virtual time.
        plant: values at its inputs.
        serial: serial number; the unit reports its digits.

    Attributes:
        wrong: faults of inputs, by signal, in place of the plant's values.
        inputs: path of its readings to its answers.

    Raises:
        WorldError: the DBC belongs to a unit that does not measure on command.
    """

    wire: ClassVar[Medium] = "can"
    roles: ClassVar[frozenset[Role]] = frozenset({"reader"})
    faults: ClassVar[tuple[Kind, ...]] = (*OF_READINGS,)

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Plant, serial: str) -> None:
        self.name = name
        self._world = world
        self._plant = plant
        try:
            messages = read_dbc(str(options["dbc"]))
            self._command, self._identity = messages["Command"], messages["Identity"]
            self._status, self._readings = messages["Status"], messages["Readings"]
        except ValueError as error:
            raise WorldError(f"{name}: {error}") from None
        except KeyError as error:
            raise WorldError(
                f"{name}: only a unit that measures on command can be simulated; its DBC has no message {error}"
            ) from None
        given = options.get("channels")
        inputs = given if isinstance(given, Mapping) else _INPUTS
        labels = {str(path).partition(".")[2]: str(label) for label, path in inputs.items()}
        self._inputs: list[tuple[str, str, DbcSignal]] = []  # name and channel of each, and its place in a frame
        self._groups: dict[int | None, list[str]] = {}
        for signal, layout in self._readings.signals.items():
            if layout.unit in _NOISE:
                self._inputs.append((signal, labels.get(signal, signal), layout))
                self._groups.setdefault(layout.group, []).append(signal)
        self._serial = int("".join(c for c in serial if c.isdigit()) or 0) % 2**32
        self.wrong: dict[str, int] = {}
        self.inputs = Inputs(_OUT_OF_RANGE, told_open=True)
        self._session = 0
        self._under_way: Timer | None = None

    def accuracy(self, channel: str, unit: str) -> Accuracy:
        """Accuracy of a reading that integrates for 0.1 s; temperatures are quantised."""
        return _ACCURACY[unit]

    def on_frame(self, can_id: int, data: bytes, tx: Transmit) -> None:
        """Take a frame from the bus; answers and readings go to `tx` later."""
        if can_id != self._command.can_id or len(data) < self._command.length:
            return
        command = self._command.unpack(data)
        action = command["Action"]
        if action == _IDENTIFY:
            self._world.call_in(REPLY_S, partial(tx, self._identity.can_id, self._who()))
        elif action in (_STOP, _ACQUIRE):
            self._stop()
            self._session = int(command["Session"])
            if action == _STOP:
                self._world.call_in(REPLY_S, partial(self._tell_status, self._world.now(), 0, tx))
            elif command["Sweeps"]:
                self._next(self._world.now(), 1, int(command["Sweeps"]), command["Period"] / 1000.0, tx)

    def power_cycle(self) -> None:
        """Power off and on: no measurement, no session."""
        self._stop()
        self._session = 0

    def _stop(self) -> None:
        if self._under_way:
            self._under_way.cancel()
            self._under_way = None

    def _who(self) -> bytes:
        major, minor = _FIRMWARE
        return self._identity.pack(
            {"Product": _PRODUCT, "SerialNumber": self._serial, "FirmwareMajor": major, "FirmwareMinor": minor}
        )

    def _next(self, begin: float, sweep: int, sweeps: int, period_s: float, tx: Transmit) -> None:
        """Measure a sweep from `begin` to one period later, and then the following ones."""

        def measured() -> None:
            self._under_way = None
            if sweep < sweeps:
                self._next(begin + period_s, sweep + 1, sweeps, period_s, tx)
            self._send(begin, period_s, sweep % 256, tx)

        self._under_way = self._world.timer_in(begin + period_s - self._world.now(), measured)

    def _send(self, begin: float, seconds: float, sweep: int, tx: Transmit) -> None:
        """Send a sweep: fault signals, then every group of readings."""
        values, wrong = self._measure(begin, seconds)
        self._tell_status(begin, sweep, tx, wrong)
        for signals in self._groups.values():
            head = {"Session": self._session, "Sweep": sweep} | self._readings.group_of(signals[0])
            tx(self._readings.can_id, self._readings.pack(head | {signal: values[signal] for signal in signals}))

    def _tell_status(self, begin: float, sweep: int, tx: Transmit, wrong: Mapping[str, int] | None = None) -> None:
        if wrong is None:
            wrong = self._measure(begin, REPLY_S, sent=False)[1]
        flags = {f"{signal}Fault": fault for signal, fault in wrong.items()}
        tx(self._status.can_id, self._status.pack({"Session": self._session, "Sweep": sweep} | flags))

    def _measure(self, begin: float, seconds: float, *, sent: bool = True) -> tuple[dict[str, float], dict[str, int]]:
        """Values of all inputs over a window, and their faults; `sent` if they are sent as readings."""
        values, wrong = {}, {}
        for signal, label, layout in self._inputs:
            entry = layout.unit
            if entry == "V":
                value = self._plant.channel_V(self.name, label, begin, begin + seconds)
            else:
                value = self._plant.channel_degC(self.name, label, begin + seconds / 2.0)
            if layout.low <= value <= layout.high:
                sd = _NOISE[entry] * (0.1 / seconds) ** 0.5
                value += sd * normal(self._plant.truth.seed, f"{self.name} {label}", event_at(begin))
            if sent:
                value = self.inputs.given(label, entry, begin, begin + seconds, value)
            fault = NONE if layout.low <= value <= layout.high else OPEN if abs(value) > 1e30 else RANGE
            wrong[signal] = self.wrong.get(signal, fault)
            values[signal] = value if wrong[signal] == NONE else layout.high
        return values, wrong
