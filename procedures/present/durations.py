"""Durations as text."""

from __future__ import annotations


def duration(seconds: float) -> str:
    """Seconds as text for people: 45 s, 12 min, 27 h 58 min."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    if minutes < 90:
        return f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60:02d} min"
