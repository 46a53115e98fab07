"""Sizes of effects by some runs, those with a searched constant, such as the time constant of a lag, together with it.

Columns are not linear in the constant, and with few readings in the first seconds after a step the two hang together: a
linear error about the constant of a search gives impossible values, such as a time constant below zero. Here the sum of
squares is minimised over the constant, and intervals are where it rises by no more than t^2 (profile likelihood).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.confirm.question import Hypothesis
from rig.fitter.confirm.together import Candidates, Together, left, solve
from rig.fitter.least import least

WIDE = 2.0
"""Ratio of the values beside a constant in its search from which it is searched on a logarithmic scale."""
REACH, TRIED = 30.0, 60
"""How far a constant may be from the searched one, as a ratio, and the number of values tried over that range."""
WITHIN = 25
"""Number of values in its interval at which the sizes are computed."""
CONSTANT_OF = "constant of "
"""Begin of the name of a term for a searched constant."""


@dataclass(frozen=True, eq=False)
class Profiled:
    """An effect in one sensor.

    Attributes:
        at: positions of its columns in the explanation.
        shift: position of the change with the constant, in whose place the constant stands.
        values: (q + 1,) coefficients of its columns, and the constant: infinite, or 0 for one above zero, if the best
            of those tried is the largest or smallest, since the data ask for one beyond it.
        intervals: 95 % intervals of these: over all constants in the interval of the constant. Where the readings set
            no end it is infinite, or 0 for a constant above zero.
        names: of the columns at this constant.
    """

    at: tuple[int, ...]
    shift: int
    values: tuple[float, ...]
    intervals: tuple[tuple[float, float], ...]
    names: tuple[str, ...]

    @property
    def places(self) -> tuple[int, ...]:
        """Positions of `values` in the explanation."""
        return (*self.at, self.shift)


def profiled(both: Together, terms: Candidates, rest: FloatArray, t: float) -> Iterator[Profiled]:
    """Every effect of an explanation, in every sensor, that has a searched constant.

    Args:
        both: runs.
        terms: of the explanation.
        rest: (S n, r) columns of everything else.
        t: Student's t of the intervals.
    """
    for shift, term in enumerate(terms):
        if getattr(term, "slope", ()):
            at = tuple(k for k, one in enumerate(terms) if one.block is term.block and k != shift)
            others = [one for k, one in enumerate(terms) if k not in at and k != shift]
            beside = np.column_stack([both.columns_of(others), both.resized_columns(terms), rest])
            yield _profiled(both, [terms[k] for k in at], beside, t, at, shift)


def _profiled(
    both: Together, terms: Candidates, others: FloatArray, t: float, at: tuple[int, ...], shift: int
) -> Profiled:
    """The most likely constant, and the sizes of the columns that share it."""
    profile, q = terms[0].block.profile, len(terms)
    log = profile.low > 0.0 and profile.high > WIDE * profile.low

    from scipy import optimize  # noqa: PLC0415 - 0.1 s, for effects with a constant

    def back(u: float) -> float:
        return float(np.exp(u)) if log else float(u)

    def model(u: float) -> FloatArray:
        return np.column_stack([both.columns_of([term.with_constant(back(u)) for term in terms]), others])

    def cost(u: float) -> float:
        return float(np.sum(left(model(u), both.outputs) ** 2))

    middle = np.log(profile.value) if log else profile.value
    reach = np.log(REACH) if log else profile.high - profile.low
    grid = np.linspace(middle - reach, middle + reach, TRIED)
    costs = np.array([cost(u) for u in grid])
    nearest = ties.lowest(costs)
    around = float(grid[max(nearest - 1, 0)]), float(grid[min(nearest + 1, TRIED - 1)])
    best = least(cost, *around).x
    most = cost(best) + t**2
    ends, known = [], []
    for side, inside in ((-1, grid[grid < best][::-1]), (1, grid[grid > best])):
        beyond = int(np.argmax(np.append([cost(u) for u in inside], np.inf) > most))
        path = [best, *inside]
        closed = beyond < len(inside)
        known.append(
            float(optimize.brentq(lambda u: cost(u) - most, *path[beyond : beyond + 2])) if closed else path[-1]
        )
        ends.append(back(known[-1]) if closed else np.inf if side > 0 else 0.0 if log else -np.inf)
    lows, highs = [], []
    for u in np.linspace(known[0], known[1], WITHIN).tolist():
        columns, inside_by = model(u), max(most - cost(u), 0.0)
        sizes = solve(columns, both.outputs)[:q]
        alone = np.linalg.norm(np.linalg.pinv(left(columns[:, q:], columns[:, :q]), rcond=1e-8), axis=1)
        lows.append(sizes - np.sqrt(inside_by) * alone)
        highs.append(sizes + np.sqrt(inside_by) * alone)
    low, high = np.min(lows, axis=0), np.max(highs, axis=0)
    for end, last in zip(ends, (0, WITHIN - 1), strict=True):
        if not np.isfinite(end) or end == 0.0:  # the sizes go on beyond the constants that were tried
            low = np.where(np.argmin(lows, axis=0) == last, -np.inf, low)
            high = np.where(np.argmax(highs, axis=0) == last, np.inf, high)
    sizes = solve(model(best), both.outputs)[:q]
    intervals = *zip(low.tolist(), high.tolist(), strict=True), (ends[0], ends[1])
    border = {0: 0.0 if log else -np.inf, TRIED - 1: np.inf}
    names = tuple(term.with_constant(back(best)).term.name for term in terms)
    return Profiled(at, shift, (*sizes.tolist(), border.get(nearest, back(best))), intervals, names)


@dataclass(frozen=True, eq=False)
class Sizes:
    """Sizes of a member by some runs.

    Attributes:
        values: (q,) coefficients of its terms; in place of the change with a searched constant the constant.
        intervals: 95 % intervals of them.
        names: of terms, if others than in the first run: with the constant of these runs.
        constants: texts of the constants, by position of the term.
    """

    values: FloatArray
    intervals: tuple[tuple[float, float], ...]
    names: Mapping[int, str] = field(default_factory=dict)
    constants: Mapping[int, str] = field(default_factory=dict)


def around(values: FloatArray, errors: FloatArray, t: float) -> tuple[tuple[float, float], ...]:
    """95 % intervals of coefficients; unknown ends are NaN."""
    return tuple((float(v - t * e), float(v + t * e)) for v, e in zip(values, errors, strict=True))


def with_constants(both: Together, member: Hypothesis, rest: FloatArray, sizes: Sizes, t: float) -> Sizes:
    """Sizes with those of effects that have a searched constant from the profile of the likelihood."""
    values, intervals = sizes.values.copy(), list(sizes.intervals)
    names: dict[int, str] = {}
    constants: dict[int, str] = {}
    for one in profiled(both, member.terms, rest, t):
        if not np.all(np.isfinite(values[list(one.at)])):
            continue
        for k, value, ends in zip(one.places, one.values, one.intervals, strict=True):
            values[k], intervals[k] = value, ends
        names |= {**dict(zip(one.at, one.names, strict=True)), one.shift: f"{CONSTANT_OF}{one.names[0]}"}
        constants[one.shift] = member.terms[one.shift].constant_text(one.values[-1], one.intervals[-1])
    return Sizes(values, tuple(intervals), names, constants)


def sizes_alone(later: Together, member: Hypothesis, rest: Candidates, t: float) -> Sizes:
    """Sizes of a member from the later run alone."""
    own, others = later.columns_of(member.terms), later.all_columns_of(rest)
    model = np.column_stack([own, later.resized_columns(member.terms), others])
    length = np.linalg.norm(model, axis=0)
    seen, length = length[: own.shape[1]] > 0, np.where(length > 0, length, 1.0)
    inverse = np.linalg.pinv(model / length, rcond=1e-8) / length[:, None]
    gamma, error = inverse @ later.outputs, np.linalg.norm(inverse, axis=1)
    q = own.shape[1]
    values, errors = np.where(seen, gamma[:q], np.nan), np.where(seen, error[:q], np.nan)
    return with_constants(later, member, others, Sizes(values, around(values, errors, t)), t)
