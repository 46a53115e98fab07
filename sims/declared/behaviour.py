"""Behaviour of a declared instrument, whatever its wire: settings, its output, readings of the plant."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, isfinite, nan
from typing import Any, ClassVar, NamedTuple

from rig.contracts.declared.exchanges import Ask, Check, Register, Tell
from rig.contracts.declared.instrument import Instrument
from rig.contracts.declared.roles import Channel
from rig.sims.faults import Kind
from rig.sims.inputs import Inputs
from rig.sims.noise import event_at, normal
from rig.sims.twin import Accuracy, Medium, Role
from rig.sims.world import World

OVERLOAD = 9.9e37
_INPUT = "input"
_SHORTEST_S = 1e-6
_FILTER_S = 0.1  # chosen: an indicator, a transmitter, a stream


class Refused(Exception):
    """A command that the instrument refuses."""


class Said(NamedTuple):
    """Contents of an answer.

    Attributes:
        value: its number as quantity; NaN if it has none.
        meaning: what its word or bit means; "" if it has none.
        fields: further fields.
        after_s: time until it can be given.
    """

    value: float = nan
    meaning: str = ""
    fields: Mapping[str, float | str] = {}
    after_s: float = 0.0


def places_of(one: Register) -> tuple[int, int]:
    """Its code for the decimals of its numbers, where it has one, and how many these are."""
    if one.decimals is None:
        return 0, 0
    code, places = max(one.places.items(), key=lambda known: known[1] == 1, default=("1", 1))
    return int(code), places


class Behaviour:
    """A declared instrument under virtual time.

    Args:
        name: the bench's name for it.
        options: its options in the bench file.
        world: virtual time.
        plant: a `rig.sims.physics.Plant`.
        serial: its serial number.
    """

    table: ClassVar[Instrument]
    wire: ClassVar[Medium]
    roles: ClassVar[frozenset[Role]]
    faults: ClassVar[tuple[Kind, ...]]

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Any, serial: str) -> None:
        self.name, self.world, self.plant, self.options, self.serial = name, world, plant, options, serial
        if "table" not in vars(self):
            self.table = self.table.chosen(options)  # type: ignore[misc]  # of one instance
        self.inputs = Inputs(OVERLOAD, told_open=not (self.table.reader and str(self.table.reader.unit).endswith("V")))
        self.quantity: Any = plant.source(name) if self.table.source is not None else None
        if self.quantity is not None:
            self.quantity.setpoint = self._rest()
        self.queue: list[str] = []
        self.switch_on()

    def _rest(self) -> float:
        source = self.table.source
        assert source is not None
        low, high = source.low or 0.0, source.high or 0.0
        return min(max(0.0, low), high)

    def switch_on(self) -> None:
        """State at power-on: unprepared, off."""
        self.queue.clear()
        self._came: set[int] = set()
        self._marked = self._venting = False
        self._setpoint = self._rest() if self.quantity is not None else 0.0
        self._selected = ""
        self._count, self._began, self._mark = 1, -1.0, 0.0
        self._taken: list[float] = []

    def power_cycle(self) -> None:
        """Power off and on: settings, readings and errors are lost, the output is off."""
        if self.quantity is not None:
            self.quantity.off(self.world.now())
        self.switch_on()

    def overflow_errors(self) -> None:
        """Fill its error queue."""
        self.queue[:] = ["unknown"] * 20

    def accuracy(self, channel: str, unit: str) -> Accuracy:
        """Accuracy of readings of an input; `unit` is "V" or "degC"."""
        reader = self.table.reader
        assert reader is not None
        return Accuracy(6.0 * reader.noise + 1e-9, self.table.step / 2)

    @property
    def prepared(self) -> bool:
        """Whether all commands that prepare it have come since it was switched on."""
        return len(self._came) == len(self.table.prepare)

    def does(self, place: str, command: Tell, holes: Mapping[str, float | str]) -> None:
        """Carry out a command by its place in the file. Raises `Refused`."""
        now, quantity = self.world.now(), self.quantity
        match place:
            case "prepare":
                self._came.add(next(n for n, one in enumerate(self.table.prepare) if one is command))
            case "mark.tell":
                self._marked = True
            case "source.set" if "value" in holes:
                self._set(command.quantity(float(holes["value"])))
            case "source.on":
                quantity.set(now, self._setpoint)
                self._venting = False
            case "source.off":
                quantity.off(now)
                self._venting = True
            case "source.hold":
                self._set(quantity.reads(now))
            case "reader.select":
                self._selected = str(holes.get("channel", ""))
            case "reader.number":
                self._mark = float(holes["mark"])
            case "reader.start":
                self._start(holes)
            case "reader.abort":
                self._began = -1.0

    def _set(self, value: float) -> None:
        source = self.table.source
        assert source is not None
        if source.low is None or source.high is None or not source.low - 1e-9 <= value <= source.high + 1e-9:
            raise Refused
        self._setpoint = value
        if self.quantity.on or not source.on:
            self.quantity.set(self.world.now(), value)

    def _start(self, holes: Mapping[str, float | str]) -> None:
        reader = self.table.reader
        assert reader is not None
        if "count" in holes:
            count = float(holes["count"])
            if not 1 <= count <= reader.most:
                raise Refused
            self._count = round(count)
        self._mark = float(holes.get("mark", self._mark))
        self._began = self.world.now()
        self._taken.clear()

    def answers(self, place: str, ask: Ask, holes: Mapping[str, float | str]) -> Said:
        """Contents of the answer to a question, by its place in the file."""
        now, quantity = self.world.now(), self.quantity
        if isinstance(ask, Check):
            right = self._marked if place == "mark.check" else self.prepared or place.startswith(("healthy", "ready"))
            return self._checked(ask, right=right)
        match place:
            case "wire.done":
                return Said()
            case _ if place.startswith("asked."):
                return Said(float(self.table.parameters[place[6:]]))
            case "identity":
                said = getattr(ask, "is_", None)
                value = said if isinstance(said, float) else nan
                return Said(value, said if isinstance(said, str) else "", self._identity())
            case "source.setpoint":
                return Said(self._setpoint)
            case "source.read":
                return Said(self._rounded(quantity.reads(now)))
            case "source.output":
                return Said(float(quantity.on), "on" if quantity.on else self._not_on(ask))
            case "source.settled":
                near = quantity.on and quantity.settled(now, self._within())
                return Said(float(near), "stable" if near else "unstable")
            case "reader.confirm":
                return Said(fields={**self._identity(), "channel": self._selected})
            case "reader.fetch":
                return self._fetched()
        return self._read(place, ask, holes)

    def takes_s(self, place: str) -> float:
        """Time until the answer to a question can be given: that of a reading."""
        return self.table.reader.reading_s if self.table.reader is not None and place.endswith("reading") else 0.0

    def _identity(self) -> dict[str, float | str]:
        return {
            "maker": self.table.maker or "SIMULATED",
            "model": self.table.model[0],
            "serial": self.serial,
            "firmware": "1.0",
            "text": "simulated",
        }

    def _checked(self, ask: Check, *, right: bool) -> Said:
        """The right answer of a question, or another one."""
        if ask.asks_bit and isinstance(ask.is_, str):
            return Said(nan, "on" if (ask.is_ == "on") == right else "off")
        if isinstance(ask.is_, str):
            other = next((meaning for meaning in ask.words.values() if meaning != ask.is_), "")
            said = ask.is_ if right else other
            printed = said if right else "0"
            known = said in {**self.table.words, **ask.words}.values()
            return Said(
                nan, said if known else "", {} if known else {"value": printed, "state": printed, "text": printed}
            )
        value = ask.quantity(ask.is_) if right else ask.quantity(ask.is_ + 1)
        return Said(value, fields={"values": [value]})  # type: ignore[dict-item]  # a list is printed with commas

    def _not_on(self, ask: Ask) -> str:
        known = {**self.table.words, **ask.words}.values()
        return "vent" if self._venting and "vent" in known else "off" if "off" in known or not known else "vent"

    def _within(self) -> float:
        source = self.table.source
        assert source is not None
        return source.tolerance or ((source.high or 0.0) - (source.low or 0.0)) * 1e-4

    def _rounded(self, value: float) -> float:
        reader = self.table.reader
        step = reader.resolution if reader is not None else 0.0
        return round(value / step) * step if step and isfinite(value) else value

    def _fetched(self) -> Said:
        reader = self.table.reader
        assert reader is not None
        if self._began < 0:
            raise Refused
        names = list(self._channels())
        each = reader.reading_s * (len(names) if self.table.scan or "{channel}" in str(reader.reading) else 1)
        left = self._began + self._count * each - self.world.now()
        if left <= 0 and not self._taken:
            self._taken = [self._measured(name, self._began + n * each) for n in range(self._count) for name in names]
        return Said(self._taken[0] if self._taken else nan, "stable", {"values": self._taken, "mark": self._mark}, left)  # type: ignore[dict-item]  # a list is printed with commas

    @property
    def begun(self) -> bool:
        """Whether a measurement was started, and not given up."""
        return self._began >= 0

    @property
    def most(self) -> int:
        """Largest number of readings at once."""
        return self.table.reader.most if self.table.reader is not None else 0

    def busy_for(self) -> float:
        """Seconds until all readings of a start are taken."""
        each = self.table.reader.reading_s if self.table.reader is not None else 0.0
        return max(0.0, self._began + self._count * each - self.world.now()) if self.begun else 0.0

    def _channels(self) -> Mapping[str, Channel]:
        reader = self.table.reader
        assert reader is not None
        return reader.channels or {_INPUT: Channel()}

    def _read(self, place: str, ask: Ask, holes: Mapping[str, float | str]) -> Said:
        """One reading, or one of each channel that has a field."""
        reader, channels = self.table.reader, self._channels()
        assert reader is not None
        asked = place.split(".")[2] if place.startswith("reader.channels.") else ""
        said = str(holes.get("channel", "")) or self._selected
        if not asked and said:
            asked = next((n for n, one in channels.items() if (one.is_ or n) == said), "")
            if not asked:
                raise Refused
        t0 = self.world.now() - reader.reading_s  # the reading that is now complete
        if asked or len(channels) == 1:
            name = asked or next(iter(channels))
            value = self._measured(name, t0)
            fields = {channels[name].field: value} if channels[name].field != "value" else {}
        else:
            every = {one.field: self._measured(name, t0) for name, one in channels.items()}
            value, fields = every.get("value", nan), every
        over = abs(value) >= min(reader.overload, 1e37)
        return Said(value, "overload" if over else "stable", {**fields, "mark": self._mark})

    def _measured(self, name: str, t0: float) -> float:
        reader = self.table.reader
        assert reader is not None
        t1 = t0 + max(reader.reading_s, _SHORTEST_S)
        since = t0 if reader.reading_s else t1 - _FILTER_S  # one that says no time has its own filter
        noise = reader.noise * normal(self.plant.truth.seed, f"{self.name}/{name}/converter", event_at(t0))
        degC = self.plant.channel_degC(self.name, name, t1)  # of the thermometer that it reads, if it reads one
        found = (degC if isfinite(degC) else self.plant.channel_V(self.name, name, since, t1)) + noise
        said = self._rounded(self.inputs.given(name, "V", t0, t1, found))
        return said if abs(said) < min(reader.overload, inf) and isfinite(said) else OVERLOAD * (1 if said > 0 else -1)
