"""Readings in CAN frames that a DBC file describes: their positions, and the frames that count."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from cantools.database import load_string
from cantools.database.can import Database, Message, Signal
from cantools.database.errors import Error

from rig.drivers.roles import OVERLOAD

Values = Mapping[str, float]
"""Values of a frame's signals."""

Place = tuple[Message, Signal]
"""Place of a number: message and signal."""


@lru_cache(maxsize=16)  # a bench is checked and opened with the same text, and parsing takes 20 ms
def read_dbc(text: str) -> Database:
    """The messages of a DBC file. Raises `ValueError` if it cannot be read."""
    try:
        database = load_string(text, "dbc")
    except (Error, ValueError) as error:
        raise ValueError(f"the DBC cannot be read: {error}") from error
    if not isinstance(database, Database) or not database.messages:
        raise ValueError("the DBC describes no messages")
    return database


def find_signal(database: Database, label: str, path: str) -> Place:
    """The signal at MESSAGE.SIGNAL. Raises `ValueError` with the existing ones."""
    name, *_ = path.partition(".")
    places = {f"{m.name}.{s.name}": (m, s) for m in database.messages for s in m.signals}
    if path not in places:
        inside = [known for known in places if known.startswith(f"{name}.")]
        raise ValueError(f"{label} = {path!r} is not in the DBC; it has {', '.join(inside or places)}")
    return places[path]


def frame_name(message: Message) -> str:
    """Identifier and name of a message, as on a bus monitor."""
    return f"{message.frame_id:03X}h ({message.name})"


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
