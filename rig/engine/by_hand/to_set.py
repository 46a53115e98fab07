"""Factors that a person sets: which setting has to be made next, and what stands.

Nothing is assumed: at the start of a session nothing stands, since a person may have taken it away. Then the setting
before is asked for first, so that the point is approached from its planned side.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

from rig.engine.measuring import Channel
from rig.instruments.opening import Bench
from rig.procedures.plan.conduct import Conduct
from rig.procedures.plan.run_list import Factor, Point, RunList
from rig.run_file.events.by_hand import SetByHand as SetEvent


@dataclass(frozen=True)
class ToSet:
    """One setting that a person is asked for.

    Attributes:
        factor: its name.
        setpoint: in its unit.
        instruction: what to do, without a full stop.
        tolerance: largest difference of a stated value from the setpoint.
        limits: (low, high) of the bench for the factor.
        whole_plot: number of the planned whole plot for which a hard factor is set; None for others.
    """

    factor: Factor
    setpoint: float
    instruction: str
    tolerance: float
    limits: tuple[float, float]
    whole_plot: int | None = None

    def refuses(self, value: str | None) -> str:
        """Why an answer is refused, as a sentence; "" if it is accepted.

        Args:
            value: the stated number as text; None if none was stated.
        """
        if value is None:
            return ""
        name = self.factor.name
        try:
            number = float(value.replace("_", " _"))  # Python's own digits_groups are no numbers of a person
        except ValueError:
            return f"--value {value!r:.60} is not a number; it is {name}, or left out if that is {self.setpoint:g}"
        if not isfinite(number):
            return f"--value {value:.60} is not a finite number; {name} is asked for"
        low, high = self.limits
        if not low <= number <= high:
            return f"--value {value:.60} is outside the limits of {name}, {low:g} to {high:g}"
        if abs(number - self.setpoint) > self.tolerance:
            return (
                f"--value {value:.60} is not {self.setpoint:g} within {self.tolerance:g}: set {name} to "
                f"{self.setpoint:g}, or correct the value"
            )
        return ""


@dataclass(frozen=True)
class SettingMade:
    """A setting that a person said was made.

    Attributes:
        setpoint: what was asked for.
        side: from which it was approached: 1 upwards, -1 downwards, 0 if it is not known.
        start: the setting before; the same if there is none.
        stated: the stated value; None if none was stated.
    """

    setpoint: float
    side: int
    start: float
    stated: float | None


class SetByHand:
    """Settings by hand in this session.

    Args:
        bench: opened instruments.
        run_list: every point.
        conduct: has the tolerances.
    """

    def __init__(self, bench: Bench, run_list: RunList, conduct: Conduct) -> None:
        self._run_list, self._limits, self._tolerances = run_list, bench.config.limits, conduct.tolerances
        people = {f.name: bench.by_hand(f.name) for f in run_list.factors}
        self._people = {name: person for name, person in people.items() if person is not None}
        self._factors = [f for f in run_list.factors if f.name in self._people]
        self._stands: dict[str, SettingMade] = {}
        self._set_for: dict[str, int | None] = {}

    def recall(self, last: Mapping[str, SetEvent], whole_plot: int) -> None:
        """In a new session: what was set last by hand, by factor, stands for the open whole plot."""
        for factor in self._factors:
            event = last.get(factor.name)
            if factor.hard and event is not None:
                self._stands[factor.name] = SettingMade(event.setpoint, 0, event.setpoint, event.number)
                self._set_for[factor.name] = whole_plot

    def forget(self) -> None:
        """The open whole plot was lost: hard factors are set again."""
        self._set_for.clear()

    def missing(self, point: Point) -> ToSet | None:
        """The next setting that a person has to make for a point; None if all stand.

        A hard factor is set anew for every whole plot, also where the value stays.
        """
        if not self._factors:
            return None
        setting = self._run_list.setting(point)
        sides = dict(zip((f.name for f in self._run_list.factors), point.sides, strict=True))
        for factor in self._factors:
            if factor.hard and self._set_for.get(factor.name) != point.whole_plot:
                return self._to_set(factor, setting[factor.name], point.whole_plot)
        for factor in self._factors:
            wanted = None if factor.hard else self._next(factor, setting[factor.name], sides[factor.name])
            if wanted is not None:
                return self._to_set(factor, wanted)
        return None

    def _next(self, factor: Factor, target: float, side: int) -> float | None:
        """The value to ask for: the target, a value on the planned side of it before, or None if it stands."""
        stands = self._stands.get(factor.name)
        if stands is not None and stands.setpoint == target and side in (0, stands.side):
            return None
        if not side or (stands is not None and side * (target - stands.setpoint) > 0):
            return target
        before = [level for level in self._run_list.levels(factor) if side * (target - level) > 0]
        return min(before, key=lambda level: abs(target - level), default=target - side * factor.overtravel)

    def _to_set(self, factor: Factor, value: float, whole_plot: int | None = None) -> ToSet:
        limits = self._limits.get(factor.name, (float("-inf"), float("inf")))
        say = self._people[factor.name].instruction(factor.name, value)
        stands = self._stands.get(factor.name)
        if whole_plot is not None and stands is not None and stands.setpoint == value:
            say = f"undo it, and then anew: {say}"
        return ToSet(factor, value, say, self._tolerances.get(factor.name, float("inf")), limits, whole_plot)

    def made(self, asked: ToSet, stated: float | None) -> None:
        """A person said that a setting was made."""
        before = self._stands.get(asked.factor.name)
        start = asked.setpoint if before is None else before.setpoint
        side = (asked.setpoint > start) - (asked.setpoint < start)
        if before is not None and not side:
            side = before.side
        self._stands[asked.factor.name] = SettingMade(asked.setpoint, side, start, stated)
        if asked.whole_plot is not None:
            self._set_for[asked.factor.name] = asked.whole_plot

    @property
    def approach(self) -> dict[str, tuple[int, float]]:
        """Side and start of every standing setting that was approached from a known side, by axis."""
        stands = ((f, self._stands.get(f.name)) for f in self._factors if not f.hard)
        return {f.axis: (s.side, s.start) for f, s in stands if s is not None and s.side}

    @property
    def readback(self) -> dict[str, float]:
        """Stated value of every standing setting of an easy factor, or the setpoint, by factor."""
        easy = ((f.name, self._stands.get(f.name)) for f in self._factors if not f.hard)
        return {name: s.setpoint if s.stated is None else s.stated for name, s in easy if s is not None}

    def stated(self) -> Mapping[str, Channel]:
        """Values that were stated, by factor."""
        return {name: Channel((s.stated,)) for name, s in self._stands.items() if s.stated is not None}
