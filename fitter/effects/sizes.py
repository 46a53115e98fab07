"""The size of an effect in the terms of people at the bench: arc seconds, ppm, micro-g."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import hypot, isfinite

from rig.fitter.rounding import with_error

_ARCSEC_PER_DEG = 3600.0


@dataclass(frozen=True)
class Size:
    """Text of an effect's size, from its coefficients by term, in the terms' units.

    Attributes:
        of_term: factor and unit of a coefficient, by name of its term.
        relative: whether a coefficient is divided by the sensor's sensitivity.
        named: whether several sizes have the names of their terms.
        phases: whether the terms are sine and cosine phase of one size.
    """

    of_term: Callable[[str], tuple[float, str]]
    relative: bool = False
    named: bool = True
    phases: bool = False

    def __call__(
        self,
        values: Mapping[str, float],
        sensitivity: float,
        errors: Mapping[str, float] | None = None,
        *,
        both: bool = False,
    ) -> str:
        """The size of every term, or of both phases together.

        Args:
            values: coefficients by name of the term.
            sensitivity: of the sensor, S_V.
            errors: their standard errors, which determine the digits; three digits where there is none.
            both: whether the errors are told, too.
        """
        errors = errors or {}
        if self.phases:
            total = hypot(*values.values())
            known = [(value, errors[name]) for name, value in values.items() if name in errors]
            error = max((e for _, e in known), default=None)
            if total and known:
                error = hypot(*(value * e for value, e in known)) / total
            return self._one(next(iter(values)), total, error, sensitivity, both)
        texts = {name: self._one(name, value, errors.get(name), sensitivity, both) for name, value in values.items()}
        if len(texts) == 1 or not self.named:
            return ", ".join(texts.values())
        return ", ".join(f"{text} ({name})" for name, text in texts.items())

    def _one(self, name: str, value: float, error: float | None, sensitivity: float, both: bool) -> str:
        factor, unit = self.of_term(name)
        scale = factor / sensitivity if self.relative else factor
        if error is None or not isfinite(error) or not error > 0.0:
            return f"{scale * value:.3g} {unit}".rstrip()
        shown = with_error(scale * value, abs(scale) * error)
        return f"{' +- '.join(shown) if both else shown[0]} {unit}".rstrip()


def each(per: str) -> Size:
    """Every coefficient unchanged, in `per`."""
    return Size(lambda _term: (1.0, per))


def micro(per: str) -> Size:
    """Every coefficient in millionths of its unit."""
    return Size(lambda _term: (1e6, per))


def relative(per: str) -> Size:
    """Every coefficient in millionths of the sensitivity: ppm, or micro-g for a term of acceleration."""
    return Size(lambda _term: (1e6, per), relative=True)


def by_term(of: Callable[[str], Size]) -> Size:
    """Every coefficient as another size tells it, by name of its term."""
    return Size(lambda term: of(term).of_term(term), named=False)


arcsec = Size(lambda _term: (_ARCSEC_PER_DEG, "arcsec"))
"""Every coefficient, an angle in degrees, in seconds of arc."""
amplitude = Size(arcsec.of_term, phases=True)
"""Sine and cosine phase of an angle in degrees together, in seconds of arc."""


def between(low: str, high: str) -> str:
    """Two sizes as a range, with the unit once."""
    unit = low.partition(" ")[2]
    same = unit == high.partition(" ")[2]
    return f"{low.removesuffix(unit).strip() if same else low} to {high.strip()}"


def size_with_95(
    size: Size, values: Mapping[str, float], ends: Mapping[str, tuple[float, float]], sensitivity: float
) -> str:
    """An effect's size with its 95 % interval: "20.1 Hz (18.4 Hz to 22.0 Hz)"; without one that is not known.

    Args:
        size: the catalogue's text.
        values: coefficients by name of the term, in the terms' own units.
        ends: of their 95 % intervals, which determine the digits; infinite where the data set no end.
        sensitivity: of the sensor, for `size`.
    """
    finite = {name: [end for end in pair if isfinite(end)] for name, pair in ends.items()}
    halves = {name: max(abs(end - values[name]) for end in own) for name, own in finite.items() if own}
    text = size(values, sensitivity, halves)
    if len(halves) < len(values):
        return text
    if size.phases and len(values) > 1:
        return f"{text} ({size_95(size, values, halves, sensitivity)})"
    told = []
    for name, own in finite.items():
        one, *other = (size({name: end}, sensitivity, {name: halves[name]}) for end in own)
        least = "at least" if isfinite(ends[name][0]) else "at most"
        told.append(between(one, *other) if other else f"{least} {one}")
    interval, unit = ", ".join(told), text.partition(" ")[2]
    return f"{text} ({interval.removesuffix(unit).rstrip() if ' ' in unit and len(values) == 1 else interval})"


def size_95(size: Size, values: Mapping[str, float], halves: Mapping[str, float], sensitivity: float) -> str:
    """95 % interval of an effect's size, as a text in the form of the catalogue: "0.001490 to 0.001510 deg/g".

    Args:
        size: the catalogue's text.
        values: coefficients by name of the term, in the terms' own units.
        halves: half-widths of their 95 % intervals, which determine the digits.
        sensitivity: of the sensor, for `size`.

    An effect with several sizes has one interval each, in the order of `size`.
    """
    if size.phases and len(values) > 1:  # sine and cosine together, whose errors are nearly uncorrelated
        total = hypot(*values.values())
        part = hypot(*(value * halves[name] for name, value in values.items())) / total**2
        scales = max(1 - part, 0.0), 1 + part
        name = next(iter(values))
        return between(*(size({name: total * scale}, sensitivity, {name: total * part}) for scale in scales))
    texts = []
    for name, value in values.items():
        ends = value - halves[name], value + halves[name]
        texts.append(between(*(size({name: end}, sensitivity, {name: halves[name]}) for end in ends)))
    return ", ".join(texts)
