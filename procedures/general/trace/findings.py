"""Findings about noise: correlated rows, unequal scatter, isolated outliers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.effects.noise_names import AUTOCORRELATION, NOISE_GROWS, OUTLIERS, QUANTISATION, SLOPES_DIFFER
from rig.fitter.gross import LEVEL
from rig.fitter.resolution import least_sd, resolution
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.coarse import lattice
from rig.fitter.trace.engine.both import Both
from rig.fitter.trace.engine.components import Components, about_means, spread_within
from rig.fitter.trace.engine.differing import CLEAR as SLOPES_CLEAR
from rig.fitter.trace.engine.differing import SLOPES, component
from rig.fitter.trace.engine.family import of_all
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.noise import Wandering
from rig.fitter.trace.engine.robust import scale
from rig.fitter.trace.growing_noise import Growth, OfLevels
from rig.procedures.general.trace.estimate import error_of
from rig.procedures.general.trace.few_rows import Searched
from rig.procedures.general.trace.intervals import in_words, moved, understated
from rig.procedures.general.trace.result import FoundTableEffect
from rig.procedures.general.trace.run import FITTED, SIZE_OF_FITTED, TableData, if_independent

LIKE = 3
"""Maximum number of effects in the sentence about what errors with memory may be; the others are among its aliases."""
SHOWN = 8
"""Maximum number of named outliers."""
CLEAR = 0.01
ON_LATTICE = 0.5
"""Share of the rows of a level that are on a lattice, from which on they are said to be rounded to it."""
COARSE = 0.5
"""Share of the standard error of a row from which the error of rounding alone, step / sqrt(12), is reported."""

RECORD = "record what may wander (temperature, humidity, supply), or take rows in random order with longer pauses"


def noise_findings(
    judge: TableJudge,
    chosen: tuple[int, ...],
    growth: Growth | OfLevels | None,
    looked: Searched,
    *,
    shape: bool,
    sure: bool,
) -> tuple[FoundTableEffect, ...]:
    """Findings about noise with the `chosen` effects, and its influence on intervals.

    Args:
        judge: that ended the search.
        chosen: candidates in the model.
        growth: of the noise, as used for weights.
        looked: the table, and its gross errors beside the declared model.
        shape: whether the residual follows one: rows that are far from the model are a part of it.
        sure: whether a name rests on more than a few rows: such rows may be a part of what it explains.
    """
    data, wander = looked.data, _wander(judge, chosen, looked)
    hidden = sure or shape or (wander is not None and looked.p > LEVEL)
    every = (
        wander,
        _differing(judge, chosen, data),
        _growing(judge, chosen, growth, data),
        _found_by_fit(judge, looked)
        if looked.dropped
        else _alone(judge, chosen, data) or (None if hidden else _found_by_fit(judge, looked)),
        _rounded(judge, chosen, data),
        _by_hand(judge, chosen, data),
    )
    return tuple(finding for finding in every if finding is not None)


def _wander(judge: TableJudge, chosen: tuple[int, ...], looked: Searched) -> FoundTableEffect | None:
    data, (correlation, p) = looked.data, memory(judge, chosen, looked.data.sensors)
    if p > CLEAR:
        return None
    walk = correlation == 1.0
    size = "a random walk" if walk else f"neighbours correlate by {correlation:.2f}"
    factor = understated(judge, chosen, at=judge.beside(chosen).best, weighted=False)
    cause = f"errors of neighbouring rows of {data.response} are alike: something wanders slowly that was not recorded"
    if data.order_unknown:
        cause += ", or the response is not smooth enough over the setting the rows are sorted by"
    others = if_independent(looked.problem, data) if data.order_unknown and not chosen else ()
    alike = tuple(dict.fromkeys((*judge.like_memory(chosen, _correlations(judge) == 0), *others)))
    if alike:
        cause += f"; these data cannot tell it from {' or '.join(alike[:LIKE])}"
    return _finding(
        judge,
        data,
        AUTOCORRELATION,
        cause,
        {"correlation of neighbours": correlation},
        "1",
        size,
        p,
        "; ".join(["go on for as long again: a wander goes elsewhere"] * bool(alike) + [RECORD]),
        factor,
        alike,
    )


def memory(judge: TableJudge, chosen: tuple[int, ...], sensors: int) -> tuple[float, float]:
    """The likeliest correlation of neighbouring rows beside some effects, and p by chance over so many sensors."""
    beside, correlation = judge.beside(chosen), _correlations(judge)
    if correlation[beside.best] == 0:
        return 0.0, 1.0
    gain = float(beside.reml.max() - beside.reml[correlation == 0].max())
    return float(correlation[beside.best]), of_all(float(special.chdtrc(2, 2.0 * max(gain, 0.0))), sensors)


def _correlations(judge: TableJudge) -> FloatArray:
    """(G,) of neighbouring rows, of the covariances that are tried."""
    noise = judge.problem.noise
    return noise.correlation if isinstance(noise, Wandering | Both) else np.zeros(len(noise.memory))


def _differing(judge: TableJudge, chosen: tuple[int, ...], data: TableData) -> FoundTableEffect | None:
    """Slopes of whole plots or replications that scatter by more than rows explain."""
    noise = judge.problem.noise
    if not isinstance(noise, Components) or not np.any(noise.grid[:, 1]):
        return None
    sd, p = component(judge, chosen, SLOPES)
    if p > SLOPES_CLEAR:
        return None
    spread = {name: spread_within(noise.group, v) for name, v in data.scene.settings.items()}
    over = ties.least(spread, key=lambda name: _apart(noise, data.scene.settings[name], spread[name]))
    per_unit = sd / spread[over]
    return _finding(
        judge,
        data,
        SLOPES_DIFFER,
        f"the slope of {data.response} over {over} differs from one of the {data.shares} to another by more than rows "
        "explain: something that was not recorded acts on it",
        {f"standard deviation of the slopes of {data.shares}": per_unit},
        f"{data.response} per {over}",
        f"slopes scatter by {per_unit:.2g}; effects were judged beside that",
        p,
        f"repeat some of the {data.shares} after others, and record what may act on the slope",
        understated(judge, chosen, at=judge.beside(chosen).best, weighted=False),
    )


def _apart(noise: Components, v: FloatArray, spread: float) -> float:
    """How far a setting is from the variable of the slopes."""
    if not spread:
        return np.inf
    return float(np.max(np.abs(about_means(noise.group, v) / spread - noise.variable)))


def _growing(
    judge: TableJudge, chosen: tuple[int, ...], growth: Growth | OfLevels | None, data: TableData
) -> FoundTableEffect | None:
    if growth is None:
        return None
    where = _where(growth.driver, data)
    terms, size = _of_levels(growth, data) if isinstance(growth, OfLevels) else growth.told(where)
    return _finding(
        judge,
        data,
        NOISE_GROWS,
        f"the scatter of {data.response} changes with {where}",
        terms,
        data.response,
        size,
        growth.p,
        f"repeat readings at both ends of {where}"
        if isinstance(growth, Growth)
        else f"repeat readings of each of {where}",
        understated(judge, chosen, at=0, weighted=True),
    )


def _where(driver: str, data: TableData) -> str:
    return {FITTED: f"fitted {data.response}", SIZE_OF_FITTED: f"fitted {data.response}"}.get(driver, driver)


def _of_levels(growth: OfLevels, data: TableData) -> tuple[dict[str, float], str]:
    """Standard deviations of the levels of a group."""
    known = {**data.scene.labels, **data.scene.groups}
    of_level = growth.of_level.tolist()
    named = known[growth.driver].levels if growth.driver in known else [str(k + 1) for k in range(len(of_level))]
    terms = {f"sd of {level}": sd for level, sd in zip(named, of_level, strict=True)}
    least, most = min(terms, key=terms.__getitem__), max(terms, key=terms.__getitem__)
    return terms, f"{growth.driver}: {least}, {terms[least]:.3g}, to {most}, {terms[most]:.3g}"


def _alone(judge: TableJudge, chosen: tuple[int, ...], data: TableData) -> FoundTableEffect | None:
    problem, rows = judge.problem, data.rows
    off = problem.y - judge.held(chosen)
    alone = np.flatnonzero(off)
    if not alone.size:
        return None
    view = judge.view(0)
    taken = view.taken(chosen)
    left = view.y - taken @ (taken.T @ view.y)
    alone = alone[ties.descending(np.abs(left[alone]), 0.0)]
    z = np.abs(left[alone]) / scale(left, problem.step)
    p = float(min(2.0 * special.ndtr(-z.max()) * problem.n * data.sensors, 1.0))
    if p > ALPHA:
        return None
    shown = alone[:SHOWN]
    more = f" and {len(alone) - SHOWN} more" if len(alone) > SHOWN else ""
    listed = ", ".join(str(rows[i]) for i in shown)
    if len(alone) == 1:
        apart = f"1 of {problem.n} rows stands alone, by {z[0]:.1f} sd"
        size = f"row {listed} of the file; it stays in the table and counts as three sd"
    else:
        apart = f"{len(alone)} of {problem.n} rows stand alone, by {z.min():.1f} to {z.max():.1f} sd"
        size = f"rows {listed}{more} of the file; they stay in the table and count as three sd"
    moves = moved(judge, chosen)
    if moves is not None:
        worst = ties.highest(np.abs(moves[0]))
        size += (
            f"; least squares that counts all in full is moved by up to {abs(moves[0][worst]):.1f} standard errors "
            f"({data.names[worst]}), and its intervals are {moves[1]:.2f} times as wide"
        )
    return _finding(
        judge,
        data,
        OUTLIERS,
        apart,
        {f"row {rows[i]}": float(left[i] * problem.sd[i]) for i in shown},
        data.response,
        size,
        p,
        "look in the log at these rows, and measure them again",
        None,
    )


def _found_by_fit(judge: TableJudge, looked: Searched) -> FoundTableEffect | None:
    """Gross errors beside the declared model, as `rig fit` finds them."""
    if not looked.apart.size:
        return None
    rows, z = [looked.data.rows[i] for i in looked.apart[:SHOWN]], np.abs(looked.distance_sd)
    more = f" and {len(z) - SHOWN} more" if len(z) > SHOWN else ""
    which = f"row{'s' if len(z) > 1 else ''} {', '.join(map(str, rows))}{more} of the file"
    apart = f"{len(z)} of {judge.problem.n} rows {'stands' if len(z) == 1 else 'stand'} alone, by {z.max():.1f} sd"
    size = f"{which}, {'found by `rig fit`, too' if looked.p <= LEVEL else 'perhaps: `rig fit` asks for less chance'}"
    if looked.dropped:
        size += f". Left out here, since nothing else shows {' and '.join(looked.dropped)}, which is not named"
    return _finding(
        judge,
        looked.data,
        OUTLIERS,
        apart,
        {f"row {row}": float(off) for row, off in zip(rows, looked.off, strict=False)},
        looked.data.response,
        size,
        looked.p,
        "look in the log at these rows, and measure them again",
        None,
    )


def _rounded(judge: TableJudge, chosen: tuple[int, ...], data: TableData) -> FoundTableEffect | None:
    """Rounding as a large part of the scatter: read off the digits, so that nothing about it is by chance."""
    step, error = resolution(data.y), error_of(judge, chosen, chosen)
    if not least_sd(step) > COARSE * error:
        return None
    return _finding(
        judge,
        data,
        QUANTISATION,
        f"{data.response} is rounded to a coarse step: errors are not normal, and repeats may look too good",
        {"step": step},
        data.response,
        f"a step of {step:.3g}, whose rounding error of {least_sd(step):.3g} (sd) compares with {error:.3g} of a row",
        0.0,
        "read with more digits, or in a lower range; or average readings with noise of more than half a step",
        None,
    )


def _by_hand(judge: TableJudge, chosen: tuple[int, ...], data: TableData) -> FoundTableEffect | None:
    """Coarse rounding of the rows of one level of a group: of one person, range or instrument."""
    printed, error = resolution(data.y), error_of(judge, chosen, chosen)
    parts = [
        (name, level, g.index == k)
        for name, g in {**data.scene.groups, **data.scene.labels}.items()
        for k, level in enumerate(g.levels)
    ]
    found = [(name, level, int(rows.sum()), lattice(data.y[rows], printed, error)) for name, level, rows in parts]
    seen = [(one.p, name, level, count, one) for name, level, count, one in found if one is not None]
    if not seen:
        return None
    p, name, level, count, one = ties.least(seen, key=lambda each: each[0])
    p = min(of_all(p, data.sensors) * len(parts), 1.0)
    if p > CLEAR or one.rows < ON_LATTICE * count or not least_sd(one.step) > COARSE * error:
        return None
    return _finding(
        judge,
        data,
        QUANTISATION,
        f"{data.response} is rounded to a coarse step where {name} is {level}: its values there are whole multiples",
        {"step": one.step},
        data.response,
        f"a step of {one.step:.3g} in {one.rows} of {count} rows, whose rounding error of {least_sd(one.step):.3g} "
        f"(sd) compares with {error:.3g} of a row",
        p,
        f"have readings where {name} is {level} taken again, to the digits of the others",
        None,
    )


def _finding(
    judge: TableJudge,
    data: TableData,
    name: str,
    cause: str,
    terms: Mapping[str, float],
    unit: str,
    size: str,
    p: float,
    separate_by: str,
    factor: FloatArray | None,
    aliases: tuple[str, ...] = (),
) -> FoundTableEffect:
    factor = None if factor is None else factor[: len(data.names)]  # behind them are rows that stand apart
    words = in_words(data.names, factor)
    return FoundTableEffect.of_noise(
        effect=name,
        cause=cause,
        terms=tuple(terms),
        coefficients=tuple(terms.values()),
        unit=unit,
        size=f"{size}; {words}" if words else size,
        p=p,
        aliases=aliases,
        separate_by=separate_by,
        against="",
        family="noise",
        columns=(),
        contribution=np.zeros(judge.problem.n),
        intervals={} if factor is None else dict(zip(data.names, factor.tolist(), strict=True)),
    )
