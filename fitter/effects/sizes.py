"""The size of an effect as people who work on the bench know it: arc seconds, ppm, micro-g."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import hypot

Size = Callable[[Mapping[str, float], float], str]
"""From an effect's coefficients by name of the term, in the terms' own units, and the sensor's S_V, to a text."""

_ARCSEC_PER_DEG = 3600.0


def each(per: str) -> Size:
    """Every coefficient as it is, in `per`, small numbers with an exponent."""
    return lambda values, _S_V: _list(values, lambda value: f"{_exponent(value)} {per}")


def micro(per: str) -> Size:
    """Every coefficient in millionths of its unit."""
    return lambda values, _S_V: _list(values, lambda value: f"{1e6 * value:.3g} {per}")


def relative(per: str) -> Size:
    """Every coefficient in millionths of the sensitivity: ppm, or micro-g for a term of acceleration."""
    return lambda values, S_V: _list(values, lambda value: f"{1e6 * value / S_V:.3g} {per}")


def arcsec(values: Mapping[str, float], _S_V: float) -> str:
    """Every coefficient, an angle in degrees, in seconds of arc."""
    return _list(values, lambda value: f"{_ARCSEC_PER_DEG * value:.3g} arcsec")


def amplitude(values: Mapping[str, float], _S_V: float) -> str:
    """Sine and cosine phase of an angle in degrees together, in seconds of arc."""
    return f"{_ARCSEC_PER_DEG * hypot(*values.values()):.3g} arcsec"


def between(low: str, high: str) -> str:
    """Two sizes as a range, the unit once."""
    unit = low.partition(" ")[2]
    same = unit == high.partition(" ")[2]
    return f"{low.removesuffix(unit).strip() if same else low} to {high.strip()}"


def _list(values: Mapping[str, float], text: Callable[[float], str]) -> str:
    """Texts of all terms, each with its term's name where there are several."""
    if len(values) == 1:
        return text(*values.values())
    return ", ".join(f"{text(value)} ({name})" for name, value in values.items())


def _exponent(value: float) -> str:
    mantissa, _, power = f"{value:.2e}".partition("e")
    return f"{mantissa}e{int(power)}"
