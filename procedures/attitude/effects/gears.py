"""Errors of gears and scales of the head, with so many periods a turn: the number is searched."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.sizes import amplitude
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.data import settings as settings_of
from rig.procedures.attitude.effects.effect import Effect, Term
from rig.procedures.attitude.effects.head import ONE_DEGREE, pitch_error, roll_error, waves

FEWEST_TEETH = 3
"""Periods a turn of a gear or a scale, at least: fewer are an eccentric or an elliptic one, which have their names."""
MOST_TEETH = 180.0
"""Periods a turn that are searched, at most: those of a grid of 1 deg. Angles that were never visited twice would tell
thousands, and a search of so many takes hours."""
UNEVEN = 0.05
"""Part of the median step: angles with a step that is no multiple of it within this are no grid."""
NEARLY = 0.05
"""Part of half a turn that may lack where it counts as visited."""


def periods(angle_deg: FloatArray) -> tuple[float, ...]:
    """Periods a turn that a search over the angles visited tries: whole numbers from three to `MOST_TEETH`.

    Up to where half a period is one step of the design; errors of more periods look like one of fewer, of halves too
    where a turn is no whole number of steps. Uneven steps have no such aliases; there half a period is the mean step.
    Where less than a turn is visited, no closer than half a period over what is.
    """
    setting = settings_of(angle_deg)
    at = np.bincount(setting, angle_deg) / np.bincount(setting)
    if at.size < 5:
        return ()
    steps, turn = np.diff(at), float(at[-1] - at[0])
    step = float(np.median(steps))
    even = bool(np.all(np.abs(steps / step - np.rint(steps / step)) < UNEVEN))
    step = step if even else turn / steps.size
    spacing = max(0.5 if even and (360.0 / step) % 1.0 >= 1e-6 else 1.0, np.ceil(2 * 180.0 / turn - NEARLY) / 2)
    tried = np.arange(spacing, min(180.0 / step, MOST_TEETH) + 1e-6, spacing)
    return tuple(tried[tried >= FEWEST_TEETH].tolist())


def _gear_terms(of: Callable[..., Term], angle: str) -> Callable[[AttitudeData], tuple[Term, ...]]:
    def terms(data: AttitudeData) -> tuple[Term, ...]:
        visited = data.pitch_deg if angle == "pitch" else data.roll_deg
        return tuple(term for k in periods(visited) for term in waves(of, angle, k))

    return terms


GEAR_PITCH = Effect(
    name="gear-pitch",
    cause="teeth of the gear or lines of the scale of the pitch axis: an error with so many periods a turn",
    source="pitch axis",
    scope="package",
    stratum="between-point",
    unit="deg",
    size=amplitude,
    against="pitch_deg",
    terms=_gear_terms(pitch_error, "pitch"),
    largest=ONE_DEGREE,
    separate_by="visit pitches between those of the design: the period of the teeth shows",
    usual_size="seconds of arc, 3e-4 deg",
    searched=True,
)

GEAR_ROLL = Effect(
    name="gear-roll",
    cause="teeth of the gear or lines of the scale of the roll axis: an error with so many periods a turn",
    source="roll axis",
    scope="package",
    stratum="between-point",
    unit="deg",
    size=amplitude,
    against="roll_deg",
    terms=_gear_terms(roll_error, "roll"),
    largest=ONE_DEGREE,
    separate_by="visit rolls between those of the design: the period of the teeth shows",
    usual_size="seconds of arc, 3e-4 deg",
    needs=("roll",),
    searched=True,
)
