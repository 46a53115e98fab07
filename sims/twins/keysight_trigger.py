"""Trigger system of the simulated 34401A and 34970A: triggers, measurements, and output of readings."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar, NamedTuple

from rig.sims.faults import Kind
from rig.sims.faults.reading_faults import OF_READINGS
from rig.sims.inputs import Inputs
from rig.sims.twin import Accuracy, Role
from rig.sims.twins.keysight_meter import OVERLOAD, Plant, parameter, text
from rig.sims.twins.scpi import DEVICE_ERROR, ScpiTwin, Wait
from rig.sims.twins.scpi_syntax import Command, ScpiError
from rig.sims.world import Timer, World

TRIGGERING = (
    Command("INITiate[:IMMediate]", set="initiate"),
    Command("FETCh", query="fetch"),
    Command("READ", query="read"),
    Command("*TRG", set="trigger"),
    Command("TRIGger:SOURce", set="set_source", query="ask_source"),
    Command("TRIGger:COUNt", set="set_trigger_count", query="ask_trigger_count"),
    Command("DATA:POINts", query="ask_points"),
)
_MOST_TRIGGERS = 50_000
_SAME_S = 1e-9
_ADDS_OF_RANGE = 8e-7  # to a voltage
_ADDS_DEGC = 4e-3
_LOOK_AGAIN_S = 1.0
_NAMES = {"IMMEDIATE": "IMM", "EXTERNAL": "EXT", "TIMER": "TIM"}


class Reading(NamedTuple):
    """A reading in memory.

    Attributes:
        value: in the channel's unit.
        position: its position in the sweep.
        seconds: begin of its sweep, seconds from the begin of the measurement.
    """

    value: float
    position: int
    seconds: float


class TriggeredTwin(ScpiTwin):
    """A meter with a trigger system: idle, waiting for a trigger, measuring.

    A measurement is `sweeps` equal sweeps from the time of the trigger. Its readings are computed at its end, or when
    they are requested.

    Attributes:
        inputs: path of its readings to its answers.
    """

    roles: ClassVar[frozenset[Role]] = frozenset({"reader"})
    faults: ClassVar[tuple[Kind, ...]] = (*OF_READINGS, *ScpiTwin.faults)
    sources: tuple[str, ...] = ("IMM", "BUS", "EXT")
    memory: int

    def __init__(
        self, name: str, options: Mapping[str, object], world: World, plant: Plant, baud: int, frame: str
    ) -> None:
        self.plant = plant
        self.inputs = Inputs(OVERLOAD)
        self._gpib = options.get("interface") == "gpib"
        self.line_hz = float(str(options.get("line_Hz", 50)))
        self._full_V = float(str(options.get("range_V", 10)))
        self._timer: Timer | None = None
        self._ends = 0.0
        super().__init__(name, world, int(str(options.get("baud", baud))), str(options.get("frame", frame)))

    def accuracy(self, channel: str, unit: str) -> Accuracy:
        """Accuracy on the ranges of these benches."""
        return Accuracy(_ADDS_DEGC if unit == "degC" else _ADDS_OF_RANGE * self._full_V)

    @abstractmethod
    def sweeps(self) -> float:
        """Number of sweeps in a measurement; infinity if it runs until it is stopped."""

    @abstractmethod
    def sweep_s(self) -> float:
        """Period of sweeps, seconds."""

    @abstractmethod
    def readings_per_sweep(self) -> int:
        """Number of readings per sweep."""

    @abstractmethod
    def take(self, began: float) -> list[float]:
        """The readings of the sweep that began at `began`."""

    @abstractmethod
    def overload_bit(self, position: int) -> int:
        """The questionable-data bit for an overload of the reading at this position of a sweep."""

    def reset(self) -> None:
        """Trigger settings of *RST."""
        self.stop_measuring()
        self.source = "IMM"
        self.trigger_count: float = 1

    def switch_on(self) -> None:
        """Over GPIB the controller always has remote control."""
        super().switch_on()
        self.remote = self._gpib

    def go_remote(self) -> None:
        """SYSTem:REMote and SYSTem:RWLock exist only on the serial interface."""
        if self._gpib:
            raise ScpiError(514)
        super().go_remote()

    def go_local(self) -> None:
        """SYSTem:LOCal likewise."""
        if self._gpib:
            raise ScpiError(514)
        super().go_local()

    def stop_measuring(self) -> None:
        """Give up the measurement and discard its readings."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer = None
        self._armed = False
        self._streaming = False
        self._began: float | None = None
        self._readings: list[Reading] | None = None

    def device_clear(self) -> None:
        """Also gives up the measurement."""
        super().device_clear()
        self.stop_measuring()

    def changed(self) -> None:
        """A change of a setting gives up the measurement and discards its readings."""
        self.stop_measuring()

    @property
    def measuring(self) -> bool:
        """Whether a measurement is under way."""
        return self._began is not None

    def busy_for(self) -> float:
        """Seconds until the running measurement is complete; 0 if there is none."""
        if not self.measuring:
            return 0.0
        return max(0.0, self._ends - self.world.now()) if math.isfinite(self._ends) else _LOOK_AGAIN_S

    def initiate(self) -> None:
        """INITiate: readings go to memory."""
        self.check_memory()
        self._arm()
        if self.source in ("IMM", "TIM"):
            self._begin()

    def check_memory(self) -> None:
        """Refuse a measurement that does not fit the memory; otherwise remove the oldest readings for it."""

    def _arm(self) -> None:
        if self.measuring or self._armed:
            raise ScpiError(-213)
        self._armed = True
        self._readings = None

    def _begin(self) -> None:
        began = self.world.now()
        seconds = self.sweeps() * self.sweep_s()
        self._armed = False
        self._began, self._swept, self._readings = began, 0, []
        self._ends = began + seconds
        if math.isfinite(seconds):
            self._timer = self.world.timer_in(seconds, self._finish)

    def _finish(self) -> None:
        self._timer = None
        try:
            self.taken()
        finally:  # a world without a value here ends the measurement, too: nobody waits for it for ever
            self._began = None

    def taken(self) -> list[Reading]:
        """The memory: readings completed by now."""
        if self._readings is None:
            return []
        if self._began is not None:
            period = self.sweep_s()
            now = self.world.now() + _SAME_S
            while self._swept < self.sweeps() and self._began + (self._swept + 1) * period <= now:
                self._sweep(self._began + self._swept * period)
                self._swept += 1
            del self._readings[: -self.memory]
        return self._readings

    def _sweep(self, began: float) -> None:
        assert self._readings is not None
        assert self._began is not None
        for position, value in enumerate(self.take(began)):
            self._readings.append(Reading(value, position, began - self._began))
            if abs(value) == OVERLOAD:
                self.events |= DEVICE_ERROR
                self.questionable |= self.overload_bit(position)

    def printed(self, reading: Reading) -> str:
        """A reading in the output format."""
        return text(reading.value)

    def trigger(self) -> None:
        """*TRG."""
        if not self._armed or self.source != "BUS":
            raise ScpiError(-211)
        self._begin()

    def fetch(self) -> str:
        """FETCh?: waits for the measurement to end."""
        if self.measuring:
            raise Wait(self.busy_for())
        if self._armed:
            raise ScpiError(-214)
        if self._readings is None:
            raise ScpiError(-230)
        return ",".join(map(self.printed, self._readings))

    def read(self) -> str:
        """READ?: measures and answers without using the memory."""
        if not self._streaming:
            if self.source == "BUS":
                raise ScpiError(-214)
            self._arm()
            self._begin()
            self._streaming = True
        answer = self.fetch()
        self._streaming = False
        self._readings = None
        return answer

    def set_source(self, name: str) -> None:
        """TRIGger:SOURce."""
        source = _NAMES.get(name.upper(), name.upper())
        if source not in self.sources:
            raise ScpiError(-224)
        self.changed()
        self.source = source

    def ask_source(self) -> str:
        """TRIGger:SOURce?."""
        return self.source

    def set_trigger_count(self, count: str) -> None:
        """TRIGger:COUNt."""
        endless = count.upper() in ("INF", "INFINITY")
        value = math.inf if endless else parameter(count, 1, _MOST_TRIGGERS, 1)
        if not (endless or 1 <= value <= _MOST_TRIGGERS):
            raise ScpiError(-222)
        self.changed()
        self.trigger_count = value if endless else round(value)

    def ask_trigger_count(self) -> str:
        """TRIGger:COUNt?."""
        return text(min(self.trigger_count, OVERLOAD))

    def ask_points(self) -> str:
        """DATA:POINts?: readings in memory."""
        return f"{len(self.taken()):+d}"
