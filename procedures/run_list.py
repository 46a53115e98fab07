"""The run list: every point of a run, in order, frozen before anything moves."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Factor:
    """A setting of the bench that the procedure varies.

    Attributes:
        name: with its unit, as in tables ("pitch_deg").
        axis: what the instrument calls it ("pitch").
        overtravel: how far beyond the planned side of approach the axis goes when it cannot arrive from that
            side directly; in the factor's unit, more than backlash and hysteresis together.
        hard: hard to change: it stays while a whole plot lasts, and changing it again is a new draw of the
            whole-plot error.
        stays: an axis that is at a point's setpoint already is not moved; where the error belongs to the setting,
            as with a pressure, it is set anew.

    """

    name: str
    axis: str
    overtravel: float = 0.0
    hard: bool = False
    stays: bool = True

    @property
    def set_name(self) -> str:
        """What its setpoint is called where a measured value stands beside it ("pressure_set_psia")."""
        stem, _, unit = self.name.rpartition("_")
        return f"{stem}_set_{unit}"


@dataclass(frozen=True, slots=True)
class Settle:
    """When a quantity counts as having arrived; in its own unit, drift per second."""

    band: float
    dwell_s: float
    drift_per_s: float
    timeout_s: float


@dataclass(frozen=True, slots=True)
class Point:
    """One setting of all factors at which the sensors are read once.

    Attributes:
        index: position in the run list, from 0.
        replication: which pass over the design, from 1.
        whole_plot: which group of points shares the hard-to-change factors; None where nothing is hard to change.
        setpoints: one value per factor, in the factors' units.
        sides: per factor +1 if it is to be reached moving upwards, -1 downwards, 0 if that does not matter.

    """

    index: int
    replication: int
    whole_plot: int | None
    setpoints: tuple[float, ...]
    sides: tuple[int, ...]


@dataclass(frozen=True)
class RunList:
    """Points in order, with what is needed to make the same list again.

    Attributes:
        factors: what `Point.setpoints` mean, in that order.
        points: the points, in the order they will be run.
        seed: of every random choice in the order.

    """

    factors: tuple[Factor, ...]
    points: tuple[Point, ...]
    seed: int

    def __post_init__(self) -> None:
        width = len(self.factors)
        for position, point in enumerate(self.points):
            if point.index != position:
                raise ValueError(f"point {position} of the run list is numbered {point.index}")
            if len(point.setpoints) != width or len(point.sides) != width:
                raise ValueError(f"point {position} does not have one setpoint and one side for each factor")

    def __len__(self) -> int:
        return len(self.points)

    @property
    def easy(self) -> tuple[Factor, ...]:
        """The factors that change from point to point."""
        return tuple(f for f in self.factors if not f.hard)

    @property
    def hard(self) -> tuple[Factor, ...]:
        """The factors that a whole plot shares."""
        return tuple(f for f in self.factors if f.hard)

    @property
    def whole_plots(self) -> int:
        """How many whole plots are planned; 0 where nothing is hard to change."""
        return len({p.whole_plot for p in self.points} - {None})

    def factor(self, name: str) -> Factor:
        """The factor of that name. Raises `KeyError`."""
        return {f.name: f for f in self.factors}[name]

    def setting(self, point: Point) -> dict[str, float]:
        """Setpoints of a point by factor name."""
        return {f.name: value for f, value in zip(self.factors, point.setpoints, strict=True)}

    def sha256(self) -> str:
        """Hash of everything that decides what the bench will do; two equal lists have equal hashes."""
        digest = hashlib.sha256()
        head = {"factors": [[f.name, f.axis, f.overtravel, f.hard, f.stays] for f in self.factors], "seed": self.seed}
        digest.update(json.dumps(head, sort_keys=True).encode())
        for p in self.points:
            row = [p.index, p.replication, p.whole_plot, p.setpoints, p.sides]
            digest.update(json.dumps(row).encode())
        return digest.hexdigest()

    def extremes(self) -> Mapping[str, tuple[float, float]]:
        """Lowest and highest value each factor can be commanded to, overtravel included, by factor name."""
        found = {}
        for column, factor in enumerate(self.factors):
            reach = [
                value
                for p in self.points
                for value in (p.setpoints[column], p.setpoints[column] - p.sides[column] * factor.overtravel)
            ]
            found[factor.name] = (min(reach), max(reach))
        return found

    def beyond(self, limits: Mapping[str, tuple[float, float]]) -> Iterator[str]:
        """Sentences for every factor that the list would drive outside `limits` (low, high), by factor name."""
        for column, factor in enumerate(self.factors):
            if factor.name not in limits:
                continue
            low, high = limits[factor.name]
            for p in self.points:
                value = p.setpoints[column]
                start = value - p.sides[column] * factor.overtravel
                if not low <= value <= high:
                    yield f"point {p.index} asks for {factor.name} = {value:g}, outside {low:g} to {high:g}"
                    break
                if not low <= start <= high:
                    yield (
                        f"point {p.index} ({factor.name} = {value:g}) is approached from {start:g} "
                        f"(overtravel {factor.overtravel:g}), outside {low:g} to {high:g}"
                    )
                    break
