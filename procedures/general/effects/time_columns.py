"""Columns of effects in time in tables: cycles, settling curves, steps, lags."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.engine.term import Profile, TableTerm
from rig.procedures.general.effects.columns import (
    FEWEST_FOR_KNOT,
    Terms,
    evenly,
    less,
    middle,
    origin,
    power_text,
    rounded,
    searched,
    wave,
    whole,
)
from rig.procedures.general.effects.scene import CYCLES, Stood, TableScene

STEPS, LAGS, SETTLINGS = 60, 10, 12
TIME_CONSTANT = "time constant"
FEWEST_BESIDE_STEP = 5
BLOCK, MOST_INTERRUPTIONS = "block", 3
"""Column of the session of a run."""
CYCLES_TIMES = 40
"""A third of what is looked for by itself: every period costs two columns for each setting."""


def cycle(which: str) -> Callable[[TableScene, str], Terms]:
    """Annual or daily harmonic, if the time covers one and a half periods."""

    def terms(scene: TableScene, name: str) -> Terms:
        time = scene.time
        if time is None or time.unit_s is None or np.ptp(time.values) * time.unit_s < 1.5 * CYCLES[which]:
            return ()
        period = CYCLES[which] / time.unit_s
        if np.median(np.diff(np.unique(time.values))) > period / 3.0:
            return ()
        phase = 2.0 * np.pi * time.values / period
        text = f"2 pi {whole(name)} / {period:.15g}"
        return (TableTerm((f"sin({text})", f"cos({text})"), np.column_stack([np.sin(phase), np.cos(phase)])),)

    return terms


def warm_up(scene: TableScene, name: str) -> Terms:
    """exp(-t/tau) from the first row on, for several tau."""

    def column(since: FloatArray, tau: float) -> FloatArray:
        return np.exp(-since / tau)

    return _settling(scene, name, "exp(-({since})/{tau:.15g})", column, 0.5)


def ageing(scene: TableScene, name: str) -> Terms:
    """log(1 + t/tau) from the first row on, for several tau."""

    def column(since: FloatArray, tau: float) -> FloatArray:
        return np.log1p(since / tau)

    return _settling(scene, name, "log(1 + ({since})/{tau:.15g})", column, 1.0)


def _settling(
    scene: TableScene, name: str, text: str, column: Callable[[FloatArray, float], FloatArray], longest: float
) -> Terms:
    """A curve from the first row on, for constants from a few rows to a part of the span."""
    v = scene.of(name)
    if len(np.unique(v)) < FEWEST_FOR_KNOT:
        return ()
    span = float(np.ptp(v))
    start = rounded(float(v.min()), span)
    if start > v.min():  # never before the start: log(1 + t/tau)
        start = rounded(start - 10.0 ** (np.floor(np.log10(span)) - 5), span)
    since = v - start
    shortest = min(2.0 * span / len(v), 0.1 * span)
    formula = less(name, start)

    def at(tau: float) -> TableTerm:
        tau = rounded(tau, tau)
        return TableTerm((text.format(since=formula, tau=tau),), column(since, tau)[:, None])

    return searched(np.geomspace(shortest, longest * span, SETTLINGS), at, log=True, what=TIME_CONSTANT)


def step(scene: TableScene, name: str) -> Terms:
    """One from a searched time on, with at least five rows on either side."""
    v = scene.of(name)
    positions = np.flatnonzero(np.diff(v) > 0) + 1
    positions = positions[(positions >= FEWEST_BESIDE_STEP) & (positions <= len(v) - FEWEST_BESIDE_STEP)]
    positions = evenly(positions, STEPS)
    dates = 0.5 * (v[positions - 1] + v[positions])

    def at(date: float) -> TableTerm:
        date = rounded(date, float(np.ptp(v)), 6)
        return TableTerm((f"({name} > {date:.15g})",), np.asarray(v > date, np.float64)[:, None])

    return searched(dates, at)


def step_times(scene: TableScene, name: str, variable: str) -> Terms:
    """A setting from a searched time on."""
    return _times(scene, step(scene, name), variable)


def wave_times(scene: TableScene, name: str, variable: str) -> Terms:
    """A setting times sine and cosine of a searched period in time, of which the table has `CYCLES_TIMES` at most."""
    kept = [term for term in wave(scene, name) if term.profile is not None and term.profile.value <= CYCLES_TIMES]
    return _times(scene, kept, variable)


def _times(scene: TableScene, terms: Terms, variable: str) -> Terms:
    """Terms of a searched constant, each times a setting from its origin."""
    v = scene.of(variable)
    if np.ptp(v) == 0.0:
        return ()
    text, factor = power_text(variable, origin(v), 1), (v - origin(v))[:, None]

    def times(term: TableTerm) -> TableTerm:
        profile = term.profile
        own = profile and Profile(profile.value, profile.low, profile.high, lambda value: times(profile.at(value)))
        return TableTerm(tuple(f"{label} * {text}" for label in term.labels), term.columns * factor, own)

    return [times(term) for term in terms]


def lag(scene: TableScene, name: str) -> Terms:
    """The variable through a first-order lag, for time constants from half a reading to a third of the time.

    Of a setting that the declared model has in curves only, what it is away from its rest: a straight line at rest
    would be another effect.
    """
    v, time = scene.of(name), scene.time
    if time is None or len(v) < 20 or np.ptp(v) == 0.0:
        return ()
    t = time.values
    gap = np.diff(t)
    if not np.any(gap > 0):
        return ()
    constants = np.geomspace(0.5 * float(np.median(gap[gap > 0])), float(np.ptp(t)) / 3.0, LAGS)
    session = _session(scene)
    breaks = interruptions(session, MOST_INTERRUPTIONS)
    stood, at_rest = scene.stood(name), middle(v)
    unread = stood is not None and stood.start is not None and bool(np.isnan(stood.start[0]))

    moved, away = less(name, at_rest), name in scene.curved

    def at(tau: float) -> TableTerm:
        tau = rounded(tau, tau)
        labels = [f"lag({moved}, {tau:.15g}){f' - ({moved})' if away else ''}"]
        columns = [lagging(v - at_rest, gap, tau, stood and stood.on(at_rest)) - (v - at_rest if away else 0.0)]
        if unread:  # the first row remembers a setting that nobody read
            labels.append(f"{_BEGIN}{less(time.name, rounded(float(t[0]), float(np.ptp(t)), 6))})/{tau:.15g})")
            columns.append(np.exp(-(t - rounded(float(t[0]), float(np.ptp(t)), 6)) / tau))
        for first in breaks:
            start = rounded(float(t[first]), float(np.ptp(t)), 6)
            labels.append(f"({BLOCK} == {session[first]:g}) * exp(-({less(time.name, start)})/{tau:.15g})")
            columns.append(np.where(session == session[first], np.exp(-(t - start) / tau), 0.0))
        return TableTerm(tuple(labels), np.column_stack(columns))

    return searched(constants, at, log=True, what=TIME_CONSTANT)


_BEGIN = "1 * exp(-("
"""Begin of the label of what the first row remembers."""


def of_start(label: str) -> bool:
    """Whether a column of `lag` is what was remembered at the start of a session: no part of the effect."""
    return label.startswith((f"({BLOCK} == ", _BEGIN))


def _session(scene: TableScene) -> FloatArray:
    """(n,) number of the session of each row, whether it is a number or a grouping; zero if it is unknown."""
    group = scene.groups.get(BLOCK)
    if group is not None and all(level.isdecimal() for level in group.levels):
        return np.array([float(level) for level in group.levels])[group.index]
    return scene.covariates.get(BLOCK, np.zeros(scene.n))


def interruptions(block: FloatArray | None, most: int) -> Sequence[int]:
    """First row of each later session of a run; none if the sessions are unknown, or more than `most`.

    What was set before it, and for how long, is in no row; each costs a column.
    """
    if block is None or np.any(np.diff(block) < 0):
        return ()
    first: list[int] = (np.flatnonzero(np.diff(block) > 0) + 1).tolist()
    return first if len(first) <= most else ()


def previous(scene: TableScene, name: str) -> Terms:
    """The setting before less this one, if the order of measurement is known."""
    v = scene.of(name)
    if scene.time is None:
        return ()
    stood = scene.stood(name)
    before = before_each(v, None if stood is None else stood.start)
    return (TableTerm((f"previous({name}) - {whole(name)}",), (before - v)[:, None]),)


def before_each(v: FloatArray, start: FloatArray | None) -> FloatArray:
    """(n,) the value before each row's; before the first row what it came from, such as no load, where that is known.

    Args:
        v: (n,) values.
        start: (n,) what each came from; not finite, or None, where it is not known.
    """
    first = v[:1] if start is None else np.where(np.isfinite(start[:1]), start[:1], v[:1])
    return np.concatenate([first, v[:-1]])


def lagging(v: FloatArray, gap: FloatArray, tau: float, stood: Stood | None = None) -> FloatArray:
    """(n,) v through a first-order lag, in equilibrium before its first move; at the first row if no move is known.

    Args:
        v: (n,) the variable.
        gap: (n - 1,) time from each row to the next.
        tau: time constant.
        stood: how each value came to be, if known: by a step; without it, v is linear between rows. A value before a
            step that is not known (NaN) is that of the row before.
    """
    since, start = stood or (None, None)
    if start is not None:
        start = np.where(np.isnan(start), np.concatenate([v[:1], v[:-1]]), start)
    r, first = gap / tau, float(v[0])
    decay, before = np.exp(-r), v[:-1] if start is None else start[1:]
    if since is None:
        after = np.divide(1.0 - decay, r, out=np.ones_like(r), where=r > 1e-9)
    else:
        after = np.exp(-np.minimum(np.maximum(since[1:], 0.0), gap) / tau)
        if start is not None:
            first += float((start[0] - v[0]) * np.exp(-max(since[0], 0.0) / tau))
    state, out = first, [first]
    for kept, more in zip(decay.tolist(), ((after - decay) * before + (1.0 - after) * v[1:]).tolist(), strict=True):
        state = kept * state + more
        out.append(state)
    return np.array(out)
