"""The catalogue of effects, for `rig explain effects`."""

from __future__ import annotations

import numpy as np

from rig.procedures.present.catalogue_table import catalogue_table
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE


def catalogue() -> str:
    """Effects with the names of their columns in six days of twelve whole plots, with an interruption."""
    row, at = np.arange(288), np.arange(288.0)
    data = WholePlotData(
        whole_plot=row // 24,
        order=row,
        elapsed_s=1800.0 * at,
        pressure_psia=0.1 + 0.7 * (at % 8),
        sensor_temperature_degC=-130.0 + 40.0 * (at // 24 % 3),
        sse_temperature_degC=-40.0 + 40.0 * (at // 72),
        outputs={"bridge_mV": 0.2 + 1.4 * (at % 8)},
        block=row // 144,
    )
    rows = ((effect, [term.name for term in effect.terms(data)]) for effect in PRESSURE_CATALOGUE)
    return f"## Whole plots (pressure transducers)\n\n{catalogue_table(rows)}"
