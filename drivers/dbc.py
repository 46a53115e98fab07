"""Readings in CAN frames that a DBC file describes: where they are, and which of the frames that come count."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from cantools.database import load_string
from cantools.database.can import Database, Message, Signal
from cantools.database.errors import Error

from drivers.roles import OVERLOAD

Values = Mapping[str, float]
"""A frame's signals."""

Place = tuple[Message, Signal]
"""Where a number is found."""


@lru_cache(maxsize=16)  # a bench is checked and opened with the same text, and parsing takes 20 ms
def read_dbc(text: str) -> Database:
    """The messages that a DBC file describes; raises `ValueError` if it cannot be read."""
    try:
        database = load_string(text, "dbc")
    except (Error, ValueError) as error:
        raise ValueError(f"the DBC cannot be read: {error}") from error
    if not isinstance(database, Database) or not database.messages:
        raise ValueError("the DBC describes no messages")
    return database


def find_signal(database: Database, label: str, path: str) -> Place:
    """The signal at MESSAGE.SIGNAL; raises `ValueError` listing what there is."""
    name, *_ = path.partition(".")
    places = {f"{m.name}.{s.name}": (m, s) for m in database.messages for s in m.signals}
    if path not in places:
        inside = [known for known in places if known.startswith(f"{name}.")]
        raise ValueError(f"{label} = {path!r} is not in the DBC; it has {', '.join(inside or places)}")
    return places[path]


def frame_name(message: Message) -> str:
    """A message as people look for it on a bus: identifier and name."""
    return f"{message.frame_id:03X}h ({message.name})"


class Series:
    """A measurement under way: what has come of it.

    Args:
        count: readings wanted of each channel.
        channels: message and signal by channel.
        faults: likewise, what is wrong with its sensor.

    Attributes:
        due: when the last reading is expected, bench seconds.
        readings: by channel.
        heard: names of the messages that came.
        repeated: frames with the counter of the one before.

    """

    def __init__(self, count: int, channels: Mapping[str, Place], faults: Mapping[str, Place]) -> None:
        self.count = count
        self.due = 0.0
        self.readings: dict[str, list[float]] = {label: [] for label in channels}
        self.heard: set[str] = set()
        self.repeated = 0
        self._channels = channels
        self._faults = faults
        self._wrong: dict[str, tuple[bool, float | None]] = {}
        self._counters: dict[tuple[str, frozenset[str]], float] = {}

    @property
    def missing(self) -> int:
        """Readings that have not come yet, of the channel that has the fewest."""
        return self.count - min(len(readings) for readings in self.readings.values())

    def forget_counters(self) -> None:
        """The unit begins to count again."""
        self._counters.clear()
        self._wrong.clear()

    def take(self, message: Message, values: Values, counter: str, *, in_step: bool) -> None:
        """Take what a frame says.

        Args:
            message: which it is.
            values: its signals.
            counter: signal by which it is counted, if it has it.
            in_step: a reading counts only if the fault signals of the same sweep have come before it.

        """
        self.heard.add(message.name)
        at = values.get(counter)
        kind = (message.name, frozenset(values))  # the groups of a multiplexed message are counted each by itself
        if at is not None:
            if self._counters.get(kind) == at:
                self.repeated += 1
                return
            self._counters[kind] = at
        for label, (source, signal) in self._faults.items():
            if source.name == message.name and signal.name in values:
                self._wrong[label] = (values[signal.name] != 0, at)
        for label, (source, signal) in self._channels.items():
            if source.name != message.name or signal.name not in values or len(self.readings[label]) == self.count:
                continue
            wrong, since = self._wrong.get(label, (False, None))
            if label in self._faults and (label not in self._wrong or (in_step and since != at)):
                continue
            self.readings[label].append(OVERLOAD if wrong else values[signal.name])
