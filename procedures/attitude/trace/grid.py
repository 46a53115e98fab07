"""Errors of the head that the angles of a design show as those of another number of periods a turn.

On N equal steps a turn, k periods and N - k are the same at every setting, whatever the sensors: an ellipse of the
scale looks like a gear of N - 2 teeth. The slower one is far likelier and keeps its name; the other is said.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.data import settings as settings_of
from rig.procedures.attitude.effects.gears import FEWEST_TEETH

_PERIODS = {
    "head-once-per-turn": ("pitch", 1),
    "head-twice-per-turn": ("pitch", 2),
    "roll-head-once-per-turn": ("roll", 1),
    "roll-head-twice-per-turn": ("roll", 2),
}
_FEWEST_SETTINGS = 5
_SAME_DEG = 0.02
"""Settings are on a grid up to that."""


@dataclass(frozen=True)
class SameOnGrid:
    """An error of a gear that looks like another of the head.

    Attributes:
        effect: its name in the catalogue.
        axis: "pitch" or "roll".
        periods: of the gear, in a turn.
        step_deg: of the design.

    """

    effect: str
    axis: str
    periods: int
    step_deg: float

    @property
    def separate_by(self) -> str:
        """The measurement that tells them apart."""
        return (
            f"visit {self.axis}s half a step ({self.step_deg / 2:g} deg) between those of the design: on this grid it "
            f"cannot be told from a gear error of {self.periods} a turn"
        )


def same_on_grid(effect: str, data: AttitudeData) -> SameOnGrid | None:
    """Periods that the steps of the design cannot distinguish from an effect of the head; None without such steps."""
    if effect not in _PERIODS:
        return None
    axis, k = _PERIODS[effect]
    steps = _steps(data.pitch_deg if axis == "pitch" else data.roll_deg)
    if steps is None or steps - k < max(FEWEST_TEETH, k + 1):
        return None
    return SameOnGrid(f"gear-{axis}", axis, steps - k, 360.0 / steps)


def _steps(angle_deg: FloatArray) -> int | None:
    """Number of equal steps a turn on which all angles lie; None where they lie on none."""
    setting = settings_of(angle_deg)
    at = np.bincount(setting, angle_deg) / np.bincount(setting)
    if at.size < _FEWEST_SETTINGS:
        return None
    steps = round(360.0 / float(np.median(np.diff(at))))
    off = (at - at[0]) * steps / 360.0
    return steps if float(np.max(np.abs(off - np.round(off)))) * 360.0 / steps <= _SAME_DEG else None
