"""Readings in CAN frames that a DBC file describes: their positions, and the frames that count."""

from __future__ import annotations

from collections.abc import Mapping

from cantools.database.can import Message

from rig.contracts.declared.dbc import Place
from rig.drivers.roles import OVERLOAD

Values = Mapping[str, float]
"""Values of a frame's signals."""


class Series:
    """The frames of a running measurement.

    Args:
        count: wanted readings of each channel.
        channels: message and signal by channel.
        faults: message and fault signal by channel.

    Attributes:
        due: expected time of the last reading, bench seconds.
        readings: by channel.
        heard: names of the received messages.
        repeated: number of frames with the counter of the previous one.
    """

    def __init__(self, count: int, channels: Mapping[str, Place], faults: Mapping[str, Place]) -> None:
        self.count = count
        self.due = 0.0
        self.readings: dict[str, list[float]] = {label: [] for label in channels}
        self.heard: set[str] = set()
        self.repeated = 0
        self._channels, self._faults = _by_message(channels), _by_message(faults)
        self._watched = frozenset(faults)
        self._wrong: dict[str, tuple[bool, float | None]] = {}
        self._counters: dict[tuple[str, frozenset[str]], float] = {}

    @property
    def missing(self) -> int:
        """Number of missing readings of the channel with the fewest."""
        return self.count - min(map(len, self.readings.values()))

    def forget_counters(self) -> None:
        """Expect a new count: the unit starts its counter again."""
        self._counters.clear()
        self._wrong.clear()

    def take(self, message: Message, values: Values, counter: str, *, in_step: bool) -> None:
        """Take the signals of a frame.

        Args:
            message: its message.
            values: its signals.
            counter: name of the counter signal, if any.
            in_step: whether a reading counts only after the fault signals of the same sweep.
        """
        self.heard.add(message.name)
        at = values.get(counter)
        kind = (message.name, frozenset(values))  # each group of a multiplexed message has its own counter
        if at is not None:
            if self._counters.get(kind) == at:
                self.repeated += 1  # a unit that hangs sends its last frame again and again
                return
            self._counters[kind] = at
        for label, signal in self._faults.get(message.name, ()):
            if signal in values:
                self._wrong[label] = (values[signal] != 0, at)
        for label, signal in self._channels.get(message.name, ()):
            if signal not in values or len(self.readings[label]) == self.count:
                continue
            wrong, since = self._wrong.get(label, (False, None))
            if label in self._watched and (label not in self._wrong or (in_step and since != at)):
                continue
            self.readings[label].append(OVERLOAD if wrong else values[signal])


def _by_message(places: Mapping[str, Place]) -> Mapping[str, list[tuple[str, str]]]:
    """Channels and names of their signals, by message."""
    found: dict[str, list[tuple[str, str]]] = {}
    for label, (message, signal) in places.items():
        found.setdefault(message.name, []).append((label, signal.name))
    return found
