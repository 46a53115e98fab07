"""A laboratory's own effects of pressure transducers (`rig.fitter.effects.own`).

Strata: "whole-plot" or "subplot". Scopes: "sensor", whose columns are mV for a coefficient of one, or "line", psi in
all transducers.

    stratum = "subplot"
    unit = "mV"
    columns = ["sin(6.2832*P)"]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.own import Grammar
from rig.fitter.effects.own_formula import OwnFormula
from rig.procedures.pressure.effects.scene import PressureEffect, PressureScene, PressureTerm

NAMES: Mapping[str, Callable[[PressureScene], FloatArray]] = {
    "P": lambda scene: scene.p,
    "T_sensor": lambda scene: scene.sensor,
    "T_SSE": lambda scene: scene.sse,
    "hours": lambda scene: scene.hours,
    "since": lambda scene: scene.since_h,
    "step": lambda scene: scene.change_psia,
    "side": lambda scene: scene.data.pressure_side.astype(np.float64),
}
"""Variables of a column: psia, degC from the run's mean, hours from its middle and from the first reading of a whole
plot, the last step of pressure and its sign.
"""


def _effect(fields: Mapping[str, Any], formulas: Sequence[OwnFormula]) -> PressureEffect:
    columns = tuple(PressureTerm(formula.text, _column(formula)) for formula in formulas)
    return PressureEffect(
        **fields,
        source="line" if fields["scope"] == "line" else "sensor",
        against="pressure_psia" if fields["stratum"] == "subplot" else "elapsed_s",
        terms=lambda _data: columns,
    )


def _column(formula: OwnFormula) -> Callable[[PressureScene], FloatArray]:
    return lambda scene: formula.column(lambda name: NAMES[name](scene), len(scene.data))


GRAMMAR = Grammar(("whole-plot", "subplot"), ("sensor", "line"), NAMES, _effect)
