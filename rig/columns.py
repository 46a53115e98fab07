"""Quantities that have a column of their own in tables, and the unit they are in."""

from __future__ import annotations

UNITS = {
    "elapsed": "s",
    "pitch": "deg",
    "roll": "deg",
    "sensor_temperature": "degC",
    "sse_temperature": "degC",
    "pressure": "psia",
}
