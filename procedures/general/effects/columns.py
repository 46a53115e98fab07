"""Columns of effects in tables: powers, kinks, harmonics, directions.

Each function returns the terms of one kind of effect; a searched constant has a term for each of its values. Constants
are rounded as in their label, so that the label computed literally gives the column.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.engine.term import Profile, TableTerm
from rig.procedures.general.effects.scene import TableScene, at_levels, is_angle

KNOTS, DECAYS = 24, 5
CYCLES_MOST, OVERSAMPLED, PER_CYCLE = 120, 2, 2.5
"""Maximum number of periods over the span, in steps of 1/OVERSAMPLED of a period, with at least PER_CYCLE values of the
variable in each.
"""
HARMONICS = 12
MOVES_WITH = 0.9
"""Limit of the correlation with the given velocity above which a setting's rate is the same."""
RESOLVED = 1000
"""Parts of a range: settings that were read back scatter by less than one."""
FEWEST_FOR_KNOT, FEWEST_FOR_WAVE, FEWEST_FOR_CLIP = 10, 24, 7
CORNERS = 6
"""Tried corners of a clip at each end."""
NO_SIDE, NO_SIZE = " == 0)", 1e-9
"""Condition of a row without a side, and the size below which a factor of it is rounding."""
_ONE_WORD = re.compile(r"[\w.]+(\([^()]*\))?")

Terms = Sequence[TableTerm]
Number = TypeVar("Number", bound=np.generic)


def power(order: int) -> Callable[[TableScene, str], Terms]:
    """(v - c)^order, with c the middle of the range, or zero if the values come near it; both for a cube and higher."""

    def terms(scene: TableScene, name: str) -> Terms:
        v = scene.of(name)
        if len(np.unique(v)) <= order:
            return ()
        centres = dict.fromkeys((origin(v), middle(v)) if order > 2 else (origin(v),))
        return [TableTerm((power_text(name, c, order),), ((v - c) ** order)[:, None]) for c in centres]

    return terms


def constant(scene: TableScene, name: str) -> Terms:
    """One for all rows, for a declared model without an intercept."""
    return (TableTerm((name,), np.ones((scene.n, 1))),)


def linear(scene: TableScene, name: str) -> Terms:
    """The variable itself, relative to the middle of its range."""
    v = scene.of(name)
    if np.ptp(v) == 0.0:
        return ()
    return (TableTerm((less(name, middle(v)),), (v - middle(v))[:, None]),)


def first_order(scene: TableScene, name: str) -> Terms:
    """A setting itself, relative to its middle; to its zero beside a declared model without a constant.

    There a centre would be a constant.
    """
    v = scene.of(name)
    if scene.constant or np.ptp(v) == 0.0:
        return linear(scene, name)
    return (TableTerm((whole(name),), v[:, None]),)


def drift(scene: TableScene, name: str) -> Terms:
    """The time relative to the middle; beside a declared model without a constant also from its zero, or its start.

    Where there is a constant both are the same.
    """
    terms, v = linear(scene, name), scene.of(name)
    if scene.constant or not terms:
        return terms
    begin = 0.0 if v.min() >= 0.0 and origin(v) == 0.0 else rounded(float(v.min()), float(np.ptp(v)))
    return (*terms, TableTerm((less(name, begin) if begin else whole(name),), (v - begin)[:, None]))


def product(scene: TableScene, first: str, second: str) -> Terms:
    """The product of two variables, each relative to its origin."""
    a, b = scene.of(first), scene.of(second)
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        return ()
    text = f"{power_text(first, origin(a), 1)} * {power_text(second, origin(b), 1)}"
    return (TableTerm((text,), ((a - origin(a)) * (b - origin(b)))[:, None]),)


def logarithm(scene: TableScene, name: str) -> Terms:
    """log v, if all values are positive and span a factor of three."""
    v = scene.of(name)
    return (TableTerm((f"log({name})",), np.log(v)[:, None]),) if _spans(v) else ()


def square_root(scene: TableScene, name: str) -> Terms:
    """sqrt v, if no value is negative and they span a factor of three."""
    v = scene.of(name)
    spans = v.min() >= 0.0 and v.max() >= 3.0 * v.min() and len(np.unique(v)) > 2
    return (TableTerm((f"sqrt({name})",), np.sqrt(v)[:, None]),) if spans else ()


def reciprocal(scene: TableScene, name: str) -> Terms:
    """1/v, if all values are positive and span a factor of three."""
    v = scene.of(name)
    return (TableTerm((f"1/{whole(name)}",), (1.0 / v)[:, None]),) if _spans(v) else ()


def saturation(scene: TableScene, name: str) -> Terms:
    """exp(-(v - lowest)/s) and exp(-(highest - v)/s) for several s."""
    v = scene.of(name)
    if len(np.unique(v)) < FEWEST_FOR_KNOT:
        return ()
    span = float(np.ptp(v))
    low, high = rounded(float(v.min()), span), rounded(float(v.max()), span)
    scales = np.geomspace(0.06, 0.6, DECAYS) * span

    def rising(s: float) -> TableTerm:
        s = rounded(s, s)
        return TableTerm((f"exp(-({less(name, low)})/{s:.15g})",), np.exp(-(v - low) / s)[:, None])

    def falling(s: float) -> TableTerm:
        s = rounded(s, s)
        return TableTerm((f"exp(-({high:.15g} - {whole(name)})/{s:.15g})",), np.exp(-(high - v) / s)[:, None])

    return [*searched(scales, rising, log=True), *searched(scales, falling, log=True)]


def kink(scene: TableScene, name: str) -> Terms:
    """max(v - k, 0) with at least three rows on either side of the knot k."""
    v = scene.of(name)
    distinct = np.unique(v)
    if len(distinct) < 8 or len(v) < FEWEST_FOR_KNOT:
        return ()
    inner = distinct[2:-2]
    wanted = np.linspace(0, len(inner) - 1, min(KNOTS, len(inner)))
    knots = np.array([k for k in np.unique(np.interp(wanted, np.arange(len(inner)), inner)) if _both_sides(v, k)])

    def at(k: float) -> TableTerm:
        k = rounded(k, float(np.ptp(v)))
        return TableTerm((f"max({less(name, k)}, 0)",), np.maximum(v - k, 0.0)[:, None])

    return searched(knots, at)


def dead_zone(scene: TableScene, name: str) -> Terms:
    """v/w held between -1 and 1, for a few half-widths w, with at least three rows on either side of zero and beyond w.

    Beside a slope that is what is missing where the response stays behind by w.
    """
    v = scene.of(name)
    sizes = np.unique(np.abs(v[v != 0.0]))
    if len(sizes) < 3 or len(v) < FEWEST_FOR_KNOT or not _both_sides(v, 0.0):
        return ()
    beyond = min(float(np.sort(v)[-3]), float(-np.sort(v)[2]))
    widths = np.geomspace(0.5 * sizes[0], 0.3 * sizes[-1], DECAYS) if 0.5 * sizes[0] < 0.3 * sizes[-1] else np.zeros(0)

    def at(w: float) -> TableTerm:
        w = rounded(w, w)
        return TableTerm((f"min(max({whole(name)}/{w:.15g}, -1), 1)",), np.clip(v / w, -1.0, 1.0)[:, None])

    return searched(widths[widths < beyond], at, log=True)


def clip(scene: TableScene, name: str) -> Terms:
    """v held between two corners, one in the lowest and one in the highest third of its range, with a row beyond each.

    Beside a slope that is what is missing where the response does not follow at either end: a dead zone below, a limit
    above. The corners are refined in turn.
    """
    v = scene.of(name)
    distinct = np.unique(v)
    if len(distinct) < FEWEST_FOR_CLIP:
        return ()
    third, span = float(np.ptp(v)) / 3.0, float(np.ptp(v))
    below = distinct[distinct <= distinct[0] + third]
    above = distinct[distinct >= distinct[-1] - third]
    lows, highs = (_between(some, CORNERS) for some in (below, above))
    ends = {False: (float(below[0]), float(below[-1])), True: (float(above[0]), float(above[-1]))}

    def at(low: float, high: float, upper: bool) -> TableTerm:
        """The profile of a term is that of one corner; of what this gives, that of the other."""
        low, high = rounded(low, span), rounded(high, span)
        text = f"min(max({name}, {low:.15g}), {high:.15g})"
        other = Profile(
            high if upper else low,
            *ends[upper],
            (lambda value: at(low, value, False)) if upper else (lambda value: at(value, high, True)),
            constants=2,
        )
        return TableTerm((text,), np.clip(v, low, high)[:, None], other)

    return [at(float(low), float(high), True) for low in lows for high in highs]


def _between(values: FloatArray, most: int) -> FloatArray:
    """Middles between neighbours among ascending values (n,), at most so many."""
    middles = 0.5 * (values[1:] + values[:-1])
    return (
        middles[np.unique(np.linspace(0, len(middles) - 1, min(most, len(middles))).astype(int))]
        if len(middles)
        else middles
    )


def evenly(values: NDArray[Number], most: int) -> NDArray[Number]:
    """Values (n,), or of more than `most` so many of them, evenly by their number."""
    if len(values) <= most:
        return values
    return np.asarray(values[np.unique(np.linspace(0, len(values) - 1, most).round().astype(int))])


def _different(v: FloatArray) -> int:
    """Number of values that differ by more than settings that were read back scatter."""
    span = float(np.ptp(v))
    return len(np.unique(np.round((v - v.min()) / (span / RESOLVED)))) if span > 0.0 else 1


def wave(scene: TableScene, name: str) -> Terms:
    """Sine and cosine of a searched period; not for an angle, which has `harmonic`."""
    v = scene.of(name)
    distinct = _different(at_levels(v) if name in scene.settings else v)
    if len(v) < FEWEST_FOR_WAVE or distinct < 16 or is_angle(name, v):
        return ()
    span, most = float(np.ptp(v)), min(CYCLES_MOST, int(distinct / PER_CYCLE))
    cycles = np.arange(OVERSAMPLED, most * OVERSAMPLED + 1) / OVERSAMPLED

    start = rounded(float(v.min()), span)

    def at(c: float) -> TableTerm:
        period = rounded(span / c, span / c)
        phase = 2.0 * np.pi * (v - start) / period
        text = f"2 pi {power_text(name, start, 1)} / {period:.15g}"
        return TableTerm((f"sin({text})", f"cos({text})"), np.column_stack([np.sin(phase), np.cos(phase)]))

    return searched(cycles, at)


def harmonic(scene: TableScene, name: str) -> Terms:
    """Sine and cosine of one to `HARMONICS` times an angle in degrees."""
    v = scene.of(name)
    if not is_angle(name, v):
        return ()
    most = min(HARMONICS, len(np.unique(v)) // 3)
    phases = [(k, np.radians(k * v)) for k in range(1, most + 1)]
    return [
        TableTerm((f"sin({k} {name})", f"cos({k} {name})"), np.column_stack([np.sin(p), np.cos(p)])) for k, p in phases
    ]


def side(scene: TableScene, name: str) -> Terms:
    """The direction itself."""
    return _sided(scene, name, np.ones(scene.n), "")


def speed(scene: TableScene, name: str) -> Terms:
    """The velocity itself, and the rate of every setting that moves with it, from the previous row and its time.

    A delay of less than a row causes an error proportional to the rate; at rest before the first row, as in `previous`.
    """
    if scene.speed is None:
        return ()
    velocity, time = scene.speed[1], scene.time
    terms = [TableTerm((name,), velocity[:, None])]
    gap = np.zeros(0) if time is None else np.diff(time.values)
    if not len(gap) or np.any(gap <= 0):
        return terms
    for setting, v in scene.settings.items():
        rate = np.concatenate([[0.0], np.diff(v) / gap])
        if np.ptp(rate) > 0 and abs(np.corrcoef(rate, velocity)[0, 1]) > MOVES_WITH:
            terms.append(TableTerm((f"rate({setting})",), rate[:, None]))
    return terms


def side_times(scene: TableScene, name: str, variable: str) -> Terms:
    """The direction times a setting."""
    v = scene.of(variable)
    return _sided(scene, name, v - origin(v), f" * {power_text(variable, origin(v), 1)}")


def loop(scene: TableScene, name: str, variable: str) -> Terms:
    """The direction times a parabola that is zero at both ends of a setting's range: a hysteresis loop."""
    v = scene.of(variable)
    half = rounded(0.5 * float(np.ptp(v)), float(np.ptp(v)))
    u = (v - middle(v)) / half
    return _sided(scene, name, 1.0 - u**2, f" * (1 - (({less(variable, middle(v))})/{half:.15g})^2)")


def _sided(scene: TableScene, name: str, factor: FloatArray, text: str) -> Terms:
    """The direction times a factor; rows whose side is not known have a column of their own, as of an unknown side."""
    if scene.direction is None:
        return ()
    direction = scene.direction[1]
    labels, columns = [f"{name}{text}"], [direction * factor]
    unknown = np.where((direction == 0.0) & (scene.speed is None), factor, 0.0)
    if np.any(np.abs(unknown) > NO_SIZE):
        labels.append(f"({name}{NO_SIDE}{text}")
        columns.append(unknown)
    return (TableTerm(tuple(labels), np.column_stack(columns)),)


def without_side(label: str) -> bool:
    """Whether a column of an effect of direction is that of rows whose side is not known: no part of the effect."""
    return NO_SIDE in label


def searched(
    values: Sequence[float] | FloatArray, at: Callable[[float], TableTerm], *, log: bool = False, what: str = ""
) -> Terms:
    """A term for each value, valid up to the middle between its neighbours; `what` is the constant's name, if any."""
    grid = np.asarray(values, np.float64)
    if not len(grid):
        return ()

    def held(value: float, low: float, high: float) -> TableTerm:
        term = at(value)
        return TableTerm(term.labels, term.columns, Profile(value, low, high, lambda v: held(v, low, high), what=what))

    scale = np.log(grid) if log else grid
    padded = np.concatenate([scale[:1], scale, scale[-1:]])
    bounds = np.exp(padded) if log else padded
    return [held(float(g), float(bounds[i]), float(bounds[i + 2])) for i, g in enumerate(grid)]


def _both_sides(v: FloatArray, knot: float) -> bool:
    return min(int(np.sum(v > knot)), int(np.sum(v < knot))) >= 3


def middle(v: FloatArray) -> float:
    """Resolution relative to a variable's range, about a thousandth."""
    return rounded(float(0.5 * (v.min() + v.max())), float(np.ptp(v)), 3)


def rounded(value: float, span: float, places: int = 5) -> float:
    """A number rounded relative to the power of ten of a span; unchanged for a span of zero."""
    if not span > 0.0:
        return value
    return round(value, places - int(np.floor(np.log10(span))))


def whole(name: str) -> str:
    """A variable as a factor in a formula, in parentheses if it is a formula itself."""
    return name if _ONE_WORD.fullmatch(name) else f"({name})"


def less(name: str, centre: float) -> str:
    """A variable relative to a centre, as a formula."""
    if centre == 0.0:
        return name
    return f"{name} {'-' if centre > 0.0 else '+'} {abs(centre):.15g}"


def origin(v: FloatArray) -> float:
    """Zero if the values come near it, otherwise the middle of their range: powers relative to a distant origin are
    nearly equal.
    """
    return 0.0 if abs(middle(v)) <= 0.75 * float(np.ptp(v)) else middle(v)


def power_text(name: str, centre: float, order: int) -> str:
    """A power of a variable relative to a centre, as a formula."""
    base = whole(name) if centre == 0.0 else f"({less(name, centre)})"
    return base if order == 1 else f"{base}^{order}"


def _spans(v: FloatArray) -> bool:
    return bool(v.min() > 0 and v.max() >= 3.0 * v.min() and len(np.unique(v)) > 2)
