"""Thermal transpiration: the pressures at the ends of a narrow line differ if the temperatures of its ends differ."""

from __future__ import annotations

from math import sqrt

_TORR_PER_PSI = 51.714932572
_ZERO_DEGC_K = 273.15
_A, _B, _C = 12.0e5, 10.0e2, 14.0
"""Takaishi and Sensui's constants of nitrogen: K^2/(Torr mm)^2, K/(Torr mm) and sqrt(K/(Torr mm))."""


def at_the_sensor_psia(pressure_psia: float, bore_mm: float, sensor_degC: float, gauge_degC: float) -> float:
    """Pressure at the sensor's end of a line whose other end is at `pressure_psia`, psia.

    Takaishi and Sensui, Trans. Faraday Soc. 59 (1963) 2503: with r the ratio of the cold to the warm pressure, (r - m)
    / (1 - m) = (A X^2 + B X + C sqrt X) / (A X^2 + B X + C sqrt X + 1), where m is the root of the ratio of the
    temperatures, the limit of r in a vacuum, and X = 2 p d / (T1 + T2). Air is taken for nitrogen.

    Args:
        pressure_psia: at the gauge's end.
        bore_mm: diameter d of the line.
        sensor_degC: temperature of the sensor's end.
        gauge_degC: temperature of the gauge's end.
    """
    if pressure_psia <= 0.0:
        return pressure_psia
    sensor, gauge = sensor_degC + _ZERO_DEGC_K, gauge_degC + _ZERO_DEGC_K
    x = 2.0 * pressure_psia * _TORR_PER_PSI * bore_mm / (sensor + gauge)
    viscous = _A * x * x + _B * x + _C * sqrt(x)
    vacuum = sqrt(max(sensor, 0.0) / gauge)
    return pressure_psia * (viscous + vacuum) / (viscous + 1.0)
