"""Names of the parameters of attitude sensors for people, and selection for display."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

LABELS = {
    "b_V": "b / V",
    "S_V": "S / (V/g)",
    "phi_deg": "phi / deg",
    "Omega_deg": "Omega / deg",
    "A_deg": "A / deg",
    "dbdT_uV_per_degC": "db/dT / (uV/degC)",
    "dSdT_ppm_per_degC": "dS/dT / (ppm/degC)",
    "mx_V": "m_x / (V/g)",
    "my_V": "m_y / (V/g)",
    "mz_V": "m_z / (V/g)",
}
"""Names of the parameters of `rig.procedures.attitude.fit.parameter_table` for people."""


SCALE, UNIT = 1e4, "1e-4 deg"
"""Errors of angles are displayed in the unit of Table 2."""


NO_DIRECTION = "the sensitive axis leans too little to say where to: Omega and A have no intervals, its components m do"


def shown(table: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Parameters to display: the sensitive axis only if Omega and A have no valid errors."""
    known = "Omega_deg" not in table or table["Omega_deg"]["interval95"] is not None
    return [name for name in table if not (known and name.startswith("m"))]
