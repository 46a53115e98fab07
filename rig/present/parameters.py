"""Parameters and coefficients as text: each to the decimal place that its standard error allows."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
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
"""What the parameters of `procedures.attitude.fit.parameter_table` are called where people read them."""
SCALE, UNIT = 1e4, "1e-4 deg"
"""Errors of angles are shown in the unit of Table 2."""
NO_DIRECTION = "the sensitive axis leans too little to say where to: Omega and A have no intervals, its components m do"


def shown(table: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Which parameters to show: the sensitive axis only where Omega and A are no estimates with errors around them."""
    known = "Omega_deg" not in table or table["Omega_deg"]["interval95"] is not None
    return [name for name in table if not (known and name.startswith("m"))]


def with_error(estimate: float | None, error: float | None) -> tuple[str, str]:
    """Estimate and standard error as text: the error to two digits, the estimate to the same decimal place."""
    if estimate is None or not isfinite(estimate):
        return "-", "-"
    if error is None or not (isfinite(error) and error > 0):
        return f"{estimate:.8g}", "-"
    places = _places(error)
    return f"{estimate:.{places}f}", f"{error:.{places}f}"


def with_interval(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """A row of `parameter_table` as text: estimate, standard error, and the 95 % interval to the same decimal place."""
    told = with_error(row["estimate"], row["stderr"])
    if row["interval95"] is None or None in row["interval95"]:
        return *told, "-"
    low, high = row["interval95"]
    places = _places(row["stderr"]) if row["stderr"] else 8
    return *told, f"{low:.{places}f} to {high:.{places}f}"


def _places(error: float) -> int:
    return max(0, 1 - int(f"{error:.1e}".partition("e")[2]))  # the exponent of the error as it will be rounded
