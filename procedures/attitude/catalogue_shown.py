"""The catalogue of effects, for `rig explain effects`."""

from __future__ import annotations

import numpy as np

from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects.catalogue import CATALOGUE
from rig.procedures.present.catalogue_table import catalogue_table


def catalogue() -> str:
    """Effects with the names of their columns in a run with two replications and an interruption."""
    row, at = np.arange(288), np.arange(288.0)
    data = AttitudeData(
        replicate=1 + row // 144,
        order=row,
        elapsed_s=60.0 * at,
        pitch_deg=-180.0 + 30.0 * (at % 12),
        roll_deg=-180.0 + 30.0 * (at // 12 % 12),
        sensor_temperature_degC=23.0 + 0.01 * at,
        outputs={"x_V": np.sin(np.radians(30.0 * (at % 12)))},
        block=row // 144,
    )
    rows = ((effect, [term.name for term in effect.terms(data)]) for effect in CATALOGUE)
    return f"## Attitude sensors\n\n{catalogue_table(rows)}"
