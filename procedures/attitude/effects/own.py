"""A laboratory's own effects of attitude sensors (`rig.fitter.effects.own`).

Strata: "between-point", or "point-by-replication" for effects of time, temperature or side. Scopes: "sensor", or
"package" with one coefficient in degrees or volts for all sensors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.own import Grammar
from rig.fitter.effects.own_formula import OwnFormula
from rig.procedures.attitude.effects.effect import Effect, Term, fixed
from rig.procedures.attitude.effects.scene import Scene

NAMES: Mapping[str, Callable[[Scene, str], FloatArray]] = {
    "pitch": lambda scene, _sensor: scene.pitch,
    "roll": lambda scene, _sensor: scene.rolled,
    "temperature": lambda scene, _sensor: scene.warmth(),
    "hours": lambda scene, _sensor: scene.hours(),
    "gravity": lambda scene, sensor: scene.along(sensor),
    "g_x": lambda scene, _sensor: scene.g[:, 0],
    "g_y": lambda scene, _sensor: scene.g[:, 1],
    "g_z": lambda scene, _sensor: scene.g[:, 2],
    "volts": lambda scene, sensor: scene.volts(sensor),
    "volts_per_deg_pitch": lambda scene, sensor: scene.per_pitch(sensor),
    "volts_per_deg_roll": lambda scene, sensor: scene.per_roll(sensor),
    "pitch_side": lambda scene, _sensor: scene.data.pitch_side.astype(np.float64),
    "roll_side": lambda scene, _sensor: scene.data.roll_side.astype(np.float64),
    "previous_pitch": lambda scene, _sensor: np.radians(scene.data.previous_pitch_deg),
    "previous_roll": lambda scene, _sensor: np.radians(scene.data.previous_roll_deg),
}
"""Variables of a column: angles in rad, degC and hours from the middle of the run, g, V."""
_NEEDS = {"temperature": "temperature", "roll": "roll", "pitch_side": "pitch sides", "roll_side": "roll sides"}


def _effect(fields: Mapping[str, Any], formulas: Sequence[OwnFormula]) -> Effect:
    return Effect(
        **fields,
        source="package" if fields["scope"] == "package" else "sensor",
        against="pitch_deg" if fields["stratum"] == "between-point" else "elapsed_s",
        terms=fixed(*(Term(formula.text, _column(formula)) for formula in formulas)),
        needs=tuple(need for word, need in _NEEDS.items() if any(word in formula.used for formula in formulas)),
    )


def _column(formula: OwnFormula) -> Callable[[Scene, str], FloatArray]:
    return lambda scene, sensor: formula.column(lambda name: NAMES[name](scene, sensor), len(scene.data))


GRAMMAR = Grammar(("between-point", "point-by-replication"), ("sensor", "package"), NAMES, _effect)
