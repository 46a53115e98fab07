"""A quantity that a source sets in another unit, as an axis: a valve in V, with levels of the flow that is read.

The first setting of a level comes from a table of approach, somewhat short of it, or from what was corrected before on
the same way. The standard reads, and the setting is corrected until it reads the level (`rig.engine.steering`). The
axis is where the table says, moved so that it is at its level at the last setting for it: whether that is so, only the
standard says.
"""

from __future__ import annotations

from collections.abc import Mapping

from rig.bench.approach import Approach
from rig.engine.axes import AxisReading, Mover
from rig.procedures.plan.run_list import Factor

_SHORT = 0.75
"""Part of what is allowed by which a first setting stays short of its level: no correction is to come from beyond."""


class Steered:
    """An axis in the unit of the standard; the source's own axis is read beside it.

    Args:
        source: moves the source's axis.
        own: the source's axis, as a factor.
        factor: the quantity.
        approach: the table of approach.
        near: how near its level the reading is brought.

    Attributes:
        factor: the quantity.
        own: the source's axis, as a factor.
        off: by how much the standard read more than the table says, at the last setting.
    """

    def __init__(self, source: Mover, own: Factor, factor: Factor, approach: Approach, near: float) -> None:
        self._source, self._table, self._short = source, approach, _SHORT * near
        self.own, self.factor, self.off = own, factor, 0.0
        self._found: dict[tuple[float, int], float] = {}
        self._level: float | None = None
        self._way = 0
        self._moved_by = 0.0

    def setting(self, level: float) -> float:
        """The setting for a level on the present way: the corrected one, or that of the table and its known error."""
        if (level, self._way) in self._found:
            return self._found[level, self._way]
        low, high = self._source.span()[self.own.axis]
        return min(max(self._table.setting(level - self.off - self._way * self._short), low), high)

    def correct(self, level: float, setting: float) -> None:
        """Set a level so from now on, on the same way."""
        self._found[level, self._way] = setting

    def learn(self, setting: float, reading: float) -> None:
        """Take what the standard reads at a setting."""
        self.off = reading - self._table.reading(setting)

    def slope(self, setting: float) -> float:
        """Change of the reading with the setting, by the table."""
        step = 1e-3 * (self._table.settings[-1] - self._table.settings[0])
        return (self._table.reading(setting + step) - self._table.reading(setting - step)) / (2.0 * step)

    def limits(self) -> tuple[float, float]:
        """The source's own (low, high)."""
        return self._source.span()[self.own.axis]

    def span(self) -> Mapping[str, tuple[float, float]]:
        """The instrument's own (low, high) by axis: by the table, at the source's own limits."""
        low, high = sorted(map(self._table.reading, self._source.span()[self.own.axis]))
        return {self.factor.axis: (low, high)}

    def read(self) -> Mapping[str, AxisReading]:
        """Read every axis."""
        (reading,) = self._source.read().values()
        value = self._table.reading(reading.value) + self._moved_by
        margin = abs(self.slope(reading.value)) * reading.margin
        seen = reading._replace(quantity=self.factor.name, value=value, margin=margin)
        return {self.factor.axis: seen, self.own.axis: reading}

    def go(self, targets: Mapping[str, float]) -> None:
        """Start moving the named axes, together."""
        level = targets[self.factor.axis]
        if self._level not in (None, level):
            self._way = 1 if level > self._level else -1
        self._level = level
        setting = self.setting(level)
        self._source.go({self.own.axis: setting})
        self._moved_by = level - self._table.reading(setting)

    def stop(self) -> str:
        """Stop at the present position; see `Mover.stop`."""
        return self._source.stop()

    def home(self, *, again: bool = False) -> None:
        """Start homing axes of unknown zero; all axes if `again`."""
        self._source.home(again=again)

    def parking(self) -> Mapping[str, float]:
        """None: what is left at the end belongs to the safe state."""
        return {}
