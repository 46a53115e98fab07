"""How a scale, of the supply, of the reference or of a transducer, goes along a run: steadily, settling, by the day."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.sizes import Size, by_term, micro
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects.scene import PressureScene, PressureTerm

DAY_H = 24.0
SETTLES = (0.08, 0.3)
"""Searched shares of the run: what was switched on or changed, and settles sooner or later."""
STEADY = "*time"
"""Ends the name of the term that goes on steadily."""


def daily(data: WholePlotData) -> bool:
    """Whether a run is as long as a day: over a part of one, its waves are a drift."""
    return float(np.ptp(data.elapsed_s)) >= 3600.0 * DAY_H


def slowly(
    text: str, of: Callable[[PressureScene], FloatArray], data: WholePlotData, unit: str
) -> tuple[PressureTerm, ...]:
    """Terms of a scale that changes along the run.

    Args:
        text: what it scales.
        of: (n,) that, of a scene.
        data: the run.
        unit: of a part of it; the steady one has the effect's unit.
    """

    def settling(share: float) -> PressureTerm:
        return PressureTerm(
            f"{text}*exp(-part of the run/{share:g})", lambda s: of(s) * np.exp(-s.since_begun / share), unit=unit
        )

    def wave(name: str, of_angle: Callable[[FloatArray], FloatArray]) -> PressureTerm:
        return PressureTerm(
            f"{text}*{name}(time of day)", lambda s: of(s) * of_angle(2.0 * np.pi * s.hours / DAY_H), unit=unit
        )

    waves = (wave("cos", np.cos), wave("sin", np.sin)) if daily(data) else ()
    steady = PressureTerm(f"{text}{STEADY}", lambda s: of(s) * s.hours)
    return (steady, *map(settling, SETTLES), *waves)


def size(steady: str, changed: str) -> Size:
    """Millionths, of the steady term in one unit and of all others in another."""
    return by_term(lambda name: micro(steady if name.endswith(STEADY) else changed))
