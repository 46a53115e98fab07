"""The size of an effect in the terms of people at the bench: arc seconds, ppm, micro-g."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import hypot

Size = Callable[[Mapping[str, float], float], str]
"""A function from an effect's coefficients by term, in the terms' units, and the sensor's S_V, to a text."""

_ARCSEC_PER_DEG = 3600.0


def each(per: str) -> Size:
    """Every coefficient unchanged, in `per`, small numbers with an exponent."""
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
    """Two sizes as a range, with the unit once."""
    unit = low.partition(" ")[2]
    same = unit == high.partition(" ")[2]
    return f"{low.removesuffix(unit).strip() if same else low} to {high.strip()}"


def size_95(size: Size, values: Mapping[str, float], halves: Mapping[str, float], sensitivity: float) -> str:
    """95 % interval of an effect's size, as a text in the form of the catalogue: "1.49e-3 to 1.51e-3 deg/g".

    Args:
        size: the catalogue's function for its text.
        values: coefficients by name of the term, in the terms' own units.
        halves: half-widths of their 95 % intervals.
        sensitivity: of the sensor, for `size`.

    An effect with several sizes has one interval each, in the order of `size`.
    """
    if size is amplitude and len(values) > 1:  # sine and cosine together, whose errors are nearly uncorrelated
        total = hypot(*values.values())
        part = hypot(*(value * halves[name] for name, value in values.items())) / total**2
        scaled = ({name: value * max(scale, 0.0) for name, value in values.items()} for scale in (1 - part, 1 + part))
        return between(*(size(end, sensitivity) for end in scaled))
    texts = []
    for name, value in values.items():
        ends = value - halves[name], value + halves[name]
        texts.append(between(*(size({name: end}, sensitivity) for end in ends)))
    return ", ".join(texts)


def _list(values: Mapping[str, float], text: Callable[[float], str]) -> str:
    """Texts of all terms, with the term's name if there are several."""
    if len(values) == 1:
        return text(*values.values())
    return ", ".join(f"{text(value)} ({name})" for name, value in values.items())


def _exponent(value: float) -> str:
    mantissa, _, power = f"{value:.2e}".partition("e")
    return f"{mantissa}e{int(power)}"
