"""Calibration points of a sensor, and its range of use."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.checked import finite
from rig.fitter.errors import FitError
from rig.procedures.attitude.model import attitude_columns


@dataclass(frozen=True, eq=False)
class DesignPoints:
    """The attitudes of one replication, and the number of replications.

    Attributes:
        name: its name in tables and plots.
        pitch_deg: (K,) pitch of every visit; a point visited twice occurs twice.
        roll_deg: (K,) roll of every visit.
        roll: whether the sensor is calibrated with roll (eqs. 2, 4, 5) or without (eq. 1).
        replications: n, number of replications.

    Raises:
        FitError: no points, angles that are not numbers, or fewer than one replication.
    """

    name: str
    pitch_deg: FloatArray
    roll_deg: FloatArray
    roll: bool = True
    replications: int = 1

    def __post_init__(self) -> None:
        count = np.size(self.pitch_deg)
        if not count:
            raise FitError(f"{self.name}: a design needs at least one point")
        if self.replications < 1:
            raise FitError(f"{self.name}: a design is run at least once, not {self.replications} times")
        object.__setattr__(self, "pitch_deg", finite("pitch_deg", self.pitch_deg, count))
        object.__setattr__(self, "roll_deg", finite("roll_deg", self.roll_deg, count))

    @property
    def points(self) -> int:
        """K, number of visits in one replication."""
        return int(self.pitch_deg.size)

    @property
    def observations(self) -> int:
        """n K, number of observations."""
        return self.points * self.replications

    @property
    def parameters(self) -> int:
        """L, number of coefficients of the model: 4 with roll, 3 without."""
        return 4 if self.roll else 3

    def covers(self, usage: Usage) -> bool:
        """Whether pitch of use is within the calibrated range: between its ends, or anywhere for a full turn."""
        pitch = np.unique(self.pitch_deg)
        low, high = float(pitch[0]), float(pitch[-1])
        steps = np.diff(pitch)
        if len(steps) and low + 360.0 - high <= 1.5 * float(np.max(steps)):
            return True
        return low - 1e-9 <= usage.pitch_deg[0] and usage.pitch_deg[1] <= high + 1e-9

    def columns(self) -> FloatArray:
        """(K, L) rows h of one replication."""
        return attitude_columns(self.pitch_deg, self.roll_deg, roll=self.roll)


@dataclass(frozen=True)
class Usage:
    """The test area: attitudes of use of the calibrated sensor, uniform in pitch and in roll (eq. 53).

    Attributes:
        pitch_deg: lowest and highest pitch.
        roll_deg: lowest and highest roll; not used for a sensor calibrated without roll.

    Raises:
        FitError: a limit that is not a number, limits in the wrong order, or more than a turn apart.
    """

    pitch_deg: tuple[float, float]
    roll_deg: tuple[float, float] = field(default=(-180.0, 180.0))

    def __post_init__(self) -> None:
        for what, (low, high) in (("pitch", self.pitch_deg), ("roll", self.roll_deg)):
            if not (np.isfinite(low) and np.isfinite(high) and 0.0 <= high - low <= 360.0):
                raise FitError(f"a usage range of {what} from {low:g} to {high:g} deg is none")

    @classmethod
    def within(cls, pitch_deg: float) -> Self:
        """Pitch from minus to plus `pitch_deg`, at every roll."""
        return cls((-pitch_deg, pitch_deg))

    @property
    def pitch_half_deg(self) -> float:
        """Half the width of the pitch range."""
        return (self.pitch_deg[1] - self.pitch_deg[0]) / 2.0

    def __str__(self) -> str:
        low, high = self.pitch_deg
        return f"+-{high:g} deg" if low == -high else f"{low:g} to {high:g} deg"
