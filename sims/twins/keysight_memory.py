"""The memory of the simulated 34970A: format, number, reading and removal of readings.

Commands are from the 34970A/34972A Command Reference, version 2.00: FORMat:READing and DATA.
"""

from __future__ import annotations

from abc import abstractmethod
from functools import partialmethod

from rig.sims.twins.keysight_meter import text
from rig.sims.twins.keysight_trigger import Reading, TriggeredTwin
from rig.sims.twins.scpi_syntax import Command, ScpiError, boolean, number

MEMORY = (
    Command("FORMat:READing:UNIT", set="set_units", query="ask_units"),
    Command("FORMat:READing:TIME", set="set_times", query="ask_times"),
    Command("FORMat:READing:CHANnel", set="set_channels", query="ask_channels"),
    Command("FORMat:READing:ALARm", set="set_alarms", query="ask_alarms"),
    Command("DATA:LAST", query="ask_last"),
    Command("DATA:REMove", query="remove"),
    Command("R", query="remove_some"),
)
_ADDITIONS = ("unit", "time", "channel", "alarm")


class RememberingTwin(TriggeredTwin):
    """A scanner whose readings can carry unit, time, channel and alarm."""

    @abstractmethod
    def channel_of(self, position: int) -> str:
        """The channel at this position of a sweep."""

    @abstractmethod
    def unit_of(self, channel: str) -> str:
        """The unit of a channel's readings."""

    @abstractmethod
    def late_s(self, position: int) -> float:
        """Seconds from the begin of a sweep to the reading at this position."""

    def reset(self) -> None:
        """*RST: readings only."""
        super().reset()
        self._with = dict.fromkeys(_ADDITIONS, False)
        self._additions = False

    def printed(self, reading: Reading) -> str:
        """A reading with its requested additions."""
        if not self._additions:
            return text(reading.value)
        channel = self.channel_of(reading.position)
        words = [text(reading.value) + (f" {self.unit_of(channel)}" if self._with["unit"] else "")]
        if self._with["time"]:
            words.append(f"{reading.seconds + self.late_s(reading.position):012.3f}")
        words += [channel] if self._with["channel"] else []
        words += ["0"] if self._with["alarm"] else []
        return ",".join(words)

    def _set(self, addition: str, state: str) -> None:
        self._with[addition] = boolean(state)
        self._additions = True in self._with.values()

    def _ask(self, addition: str) -> str:
        return "1" if self._with[addition] else "0"

    set_units, ask_units = partialmethod(_set, "unit"), partialmethod(_ask, "unit")
    set_times, ask_times = partialmethod(_set, "time"), partialmethod(_ask, "time")
    set_channels, ask_channels = partialmethod(_set, "channel"), partialmethod(_ask, "channel")
    set_alarms, ask_alarms = partialmethod(_set, "alarm"), partialmethod(_ask, "alarm")

    def ask_last(self, count: str = "1") -> str:
        """DATA:LAST?: the newest readings; they stay in memory."""
        kept = self.taken()
        wanted = round(number(count))
        if not 1 <= wanted <= len(kept):
            raise ScpiError(-230 if not kept else -222)
        return ",".join(map(self.printed, kept[-wanted:]))

    def remove(self, count: str) -> str:
        """DATA:REMove?: the oldest readings, removed from the memory; also during a scan."""
        kept = self.taken()
        wanted = round(number(count))
        if not 1 <= wanted <= len(kept):
            raise ScpiError(-222)
        removed, kept[:] = kept[:wanted], kept[wanted:]
        return ",".join(map(self.printed, removed))

    def remove_some(self, most: str = "50000") -> str:
        """R?: at most this many readings, as a block of definite length."""
        count = min(round(number(most)), len(self.taken()))
        block = self.remove(str(count)) if count > 0 else ""
        return f"#{len(str(len(block)))}{len(block)}{block}"
