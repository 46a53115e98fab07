"""Drift since a calibration, by the history of what was calibrated: rows [days, error], as control charts have them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import special

from rig.errors import ConfigurationError, UsageError
from rig.register.equipment_file import Drift, Register
from rig.units.differences import factor

_K = float(special.ndtri(0.975))


def drifted(rows: Drift, days: float, key: str) -> float:
    """Standard uncertainty of the drift after so many days, in the rows' unit.

    Args:
        rows: with their errors that are not exceeded with 95 %.
        days: since the calibration.
        key: place in the register's file, for messages.

    Raises:
        ConfigurationError: the rows end before.
    """
    if days > rows[-1][0]:
        raise ConfigurationError(
            f"{key}: its rows end {rows[-1][0]:g} days after the calibration, and {days:g} are asked for: no drift is "
            f"known of so long a time; have it calibrated, or give an allowance"
        )
    age, errors = zip(*rows, strict=True)
    return float(np.interp(max(days, 0.0), age, errors)) / _K


def drift_of_sensor(register: Register, names: Sequence[str], days: float, unit: str) -> float:
    """Standard uncertainty of a sensor's drift, in `unit`.

    Args:
        register: with its history.
        names: of the sensor in the register; the first that is there counts.
        days: since its calibration.
        unit: of the errors in its control chart.

    Raises:
        UsageError: the register has none.
        ConfigurationError: its rows end before, or their unit does not convert.
    """
    known = [name for name in names if name in register.sensors]
    item = register.sensors[known[0]] if known else None
    key = f"sensors.{(known or names)[0]}.drift"
    if item is None or item.drift is None:
        raise UsageError(
            f"--after-days: the register has no {key}: chart three or more calibrations of the sensor, with rig chart "
            f"--as-drift, and copy the lines that it prints"
        )
    per = factor(item.drift_unit, unit)
    if per is None:
        raise ConfigurationError(f"{key}_unit = {item.drift_unit!r} does not convert to {unit!r}, the chart's unit")
    return per * drifted(item.drift, days, key)
