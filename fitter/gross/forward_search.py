"""The search for gross errors: a robust start, then rows added one by one, each judged by the rows before it.

Several gross errors can mask one another: together they move the fit and increase the standard deviation. So the search
does not begin with the fit of all rows.

1. The start is the subset that fits best when up to a third of the rows is left out (least trimmed squares; Rousseeuw
and Van Driessen, Data Min. Knowl. Disc. 12 (2006) 29), found from several starts by concentration steps.
2. The rows left out are taken back one by one, the nearest to the fit of those inside first (forward search; Atkinson
and Riani, Robust Diagnostic Regression Analysis, 2000). Each is judged by its deletion residual.
3. Of the sets of rows outside the one counts that chance explains least, by an F test of the whole set. Its rows are
named that are too far from the fit of those inside by themselves: they are not hidden by another that is just too near.

The limit holds for all rows and all responses of a table together: a clean table has a gross error with a probability
of about `LEVEL` (measured: docs/explanation/fits.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.gross.judged import LONE, Found, judged, without
from rig.fitter.gross.rows import Rows
from rig.fitter.own_span import NO_GROUP
from rig.fitter.resolution import least_sd, robust_sd
from rig.fitter.trace.growing_noise import Growth, growth_of

LEVEL = 0.005
"""Probability that a clean table has a row named, for known relative standard deviations of its rows."""
SHARE, MOST = 0.35, 100
"""Maximum share of rows that can be gross errors, and their maximum number: more mean another model."""
OF_GROUP = 0.5
"""Maximum share of a group's rows: if most of a group deviates, its level does."""
FEWEST_DF = 8
"""Minimum degrees of freedom for error without the left-out rows."""
CLEAR = 0.85
"""Share of the limit: if no row of a design is so far from a robust fit, no subset is searched."""
SUBSETS, STEPS, FINAL = 100, 2, 30
"""Random starts, concentration steps of each, and number of the best that are continued."""
BEST = 5
AFFORDABLE = 4_000_000
"""Maximum number of values for all random starts together."""
ALONE, AS_GOOD, AGAIN = 0.05, 2.0, 5
"""Share of a row's share in its residual below which it has become alone; ratio of standard deviations up to which
another start is as good; number of such starts."""
SEED = 20260115
ROUNDING = 1e3
"""Minimum standard deviation as a multiple of the response's rounding errors."""


@dataclass(frozen=True, eq=False)
class GrossErrors:
    """Rows that deviate from the model, and by how much.

    Attributes:
        rows: (m,) indices, the farthest first.
        distance_sd: (m,) difference between the reading and the prediction of a fit without these rows, over the
            standard deviation of that difference.
        off: (m,) the difference itself, in units of the response.
        p: probability that a clean table has a row with such a deviation; 1 if none is named.
        sd: (n,) standard deviation of a reading by the fit without these rows, in units of the response.
        alone: indices of rows that cannot be checked.
        not_looked: reason for no search; empty if there was one.
        doubtful: number of further rows that may be wrong: their deviations together are no chance of normal errors.
        together: (q,) rows that deviate together, all of a setting or along a smooth curve: no gross errors, but
            something that the model lacks.
    """

    rows: IntArray
    distance_sd: FloatArray
    off: FloatArray
    p: float
    sd: FloatArray
    alone: IntArray
    not_looked: str = ""
    doubtful: int = 0
    together: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))


def gross_errors(
    y: FloatArray,
    columns: FloatArray,
    *,
    group: IntArray | None = None,
    step: float = 0.0,
    responses: int = 1,
    drivers: Mapping[str, FloatArray] | None = None,
    designed: bool = False,
    level: float = LEVEL,
    rows: Rows | None = None,
    first: IntArray | None = None,
) -> GrossErrors:
    """Rows that deviate from a linear model.

    Args:
        y: (n,) response.
        columns: (n, k) of the model; they may be collinear.
        group: (n,) from 0: rows of a group share a level of their own, such as a whole plot's error; -1 for a row that
            shares none.
        step: that the response was rounded to.
        responses: of the table; the limit holds for all together.
        drivers: (n,) what the standard deviation may grow with, by name; where the rows that are not off show that it
            does, they are weighted by the likeliest and the search is made again.
        designed: whether no row lies far from the others in `columns`, so that random starts need not be tried.
        level: probability that a clean table has any row named.
        rows: these columns and groups, if several responses share them.
        first: (m,) rows that are outside every start, also where they are most of a group.

    """
    no_group = np.full(len(y), NO_GROUP, np.int64)
    every = rows or Rows(columns, y, np.ones(len(y)), no_group if group is None else group)
    every = every if every.y is y else every.of(y)
    asked = _Asked(every, step, responses, designed, level, np.zeros(0, np.int64) if first is None else first)
    found = _search(asked, None)
    if drivers and not found.not_looked:
        grown = _growth(every, np.setdiff1d(np.arange(len(y)), found.rows), drivers)
        if grown is not None:
            found = _search(asked, grown)
    return found


@dataclass(frozen=True, eq=False)
class _Asked:
    every: Rows
    step: float
    responses: int
    designed: bool
    level: float
    first: IntArray

    def rows(self, weight: FloatArray) -> Rows:
        return self.every if np.all(weight == 1.0) else self.every.weighted(weight)  # the usual case needs no copy


def _growth(every: Rows, inside: IntArray, drivers: Mapping[str, FloatArray]) -> FloatArray | None:
    """(n,) standard deviation if these rows show that it grows with a driver; otherwise None."""
    rows = every.some(inside) if inside.size < len(every.y) else every
    left, kept = rows.residual, np.maximum(rows.kept, 0.0)
    if growth_of(left, kept, {n: v[inside] for n, v in drivers.items()}) is None:
        return None
    found: list[tuple[float, FloatArray]] = []
    for name, values in drivers.items():
        growth = growth_of(left, kept, {name: values[inside]})
        if isinstance(growth, Growth):
            sd = growth.sd(values)
            likely = float(np.sum(2.0 * kept * np.log(sd[inside]) + (left / sd[inside]) ** 2))
            found.append((likely, sd))
    return ties.least(found, key=lambda one: one[0], unit=1.0)[1] if found else None


def _search(asked: _Asked, spread: FloatArray | None) -> GrossErrors:
    y, step = asked.every.y, asked.step
    weight = np.ones(len(y)) if spread is None else float(np.median(spread)) / spread
    rows = asked.rows(weight)
    none = np.zeros(0, np.int64)
    alone = np.flatnonzero(rows.kept <= LONE)
    most = int(min(SHARE * len(y), rows.df - FEWEST_DF, MOST))
    if most < 1:
        why = f"{len(y)} rows leave {max(rows.df, 0)} degrees of freedom: too few to recognise a gross error"
        return GrossErrors(none, np.zeros(0), np.zeros(0), 1.0, np.full(len(y), np.nan), alone, why)
    eps = ROUNDING * np.finfo(float).eps * float(np.sqrt(np.mean(rows.y**2)))
    floor = max(least_sd(step * weight), eps)
    first = np.isin(np.arange(len(y)), asked.first if asked.first.size <= most else none)
    found = _looked(rows, _Limits(most, _allowed(rows), first, len(y) * eps**2), floor, asked)
    out = found.out
    sd = np.broadcast_to(found.sigma, weight.shape) if spread is None else found.sigma / weight
    return GrossErrors(out, found.distance, found.off / weight[out], found.p, sd, alone, doubtful=found.doubtful)


def _looked(rows: Rows, limits: _Limits, floor: float, asked: _Asked) -> Found:
    """The deviating rows of a start, and of others if one of the rows kept may be off.

    A fit goes through a row, however far it is off, if every other row that determines one of its coefficients is
    named instead. Rows that have become alone so are left out of a new start, which counts if it names fewer rows.
    """
    found = last = judged(rows, _trimmed(rows, limits, designed=asked.designed), floor, asked.level, asked.responses)
    for _ in range(AGAIN):
        inside = np.setdiff1d(np.arange(len(rows.y)), last.out)
        alone = inside[rows.some(inside).kept < ALONE * rows.kept[inside]] if last.out.size else last.out
        first = limits.first.copy()
        first[alone] = True
        if not alone.size or np.sum(first) > limits.most:
            break
        limits = replace(limits, first=first)
        last = judged(rows, _trimmed(rows, limits, designed=asked.designed), floor, asked.level, asked.responses)
        if 0 < last.out.size < found.out.size and last.sigma <= AS_GOOD * found.sigma:
            found = last
    return found


@dataclass(frozen=True, eq=False)
class _Limits:
    """Limits of the rows outside.

    Attributes:
        most: their number.
        allowed: (n,) number of a row's group.
        first: (n,) whether a row is outside whatever its residual.
        rounding: sum of squares below which residuals are rounding errors.
    """

    most: int
    allowed: IntArray
    first: NDArray[np.bool_]
    rounding: float


def _trimmed(rows: Rows, limits: _Limits, *, designed: bool) -> IntArray:
    """Up to `most` rows without which the others fit best."""
    none = np.zeros(0, np.int64)
    best = [(np.inf, none)]
    starts = list(_starts(rows, designed=designed))
    if designed and not limits.first.any() and _clear(rows, starts[-1]):
        return none
    for start in starts:
        out, rss = _concentrated(rows, start, limits, STEPS)
        best = ties.ordered([*best, (rss, out)], key=lambda one: one[0])[:BEST]
    found = (np.inf, none)
    for rss, out in best:
        if np.isfinite(rss):
            again, less = _concentrated(rows, without(rows, out)[1], limits, FINAL)
            found = ties.least([found, (rss, out), (less, again)], key=lambda one: one[0])
    return found[1]


def _clear(rows: Rows, left: FloatArray) -> bool:
    """Whether no row is far enough from a robust fit (n,) to be named."""
    usable = rows.kept > LONE
    alone = left[usable] / np.sqrt(rows.kept[usable])
    limit = -float(special.stdtrit(rows.df, 0.5 * LEVEL / len(left)))
    return bool(np.max(np.abs(alone), initial=0.0) < CLEAR * limit * robust_sd(alone))


def _starts(rows: Rows, *, designed: bool) -> Iterator[FloatArray]:
    """(n,) residuals of several fits: of all rows, by least absolute values, of random subsets."""
    n = len(rows.y)
    yield rows.residual
    yield rows.least_absolute
    if designed:
        return
    random = np.random.default_rng(SEED)
    few, share = rows.coefficients + 1, 5 if rows.groups else 1
    for _ in range(min(SUBSETS // share, AFFORDABLE // (rows.coefficients * n) + 1)):
        kept = np.zeros(n)
        if rows.groups:
            kept[random.random(n) < 0.5] = 1.0
        else:
            kept[random.choice(n, min(few, n), replace=False)] = 1.0
        yield rows.residual_of(kept)


def _allowed(rows: Rows) -> IntArray:
    """(n,) maximum number of rows of a row's group that may be left out."""
    if rows.groups == 0:
        return np.full(len(rows.y), len(rows.y))
    inside = rows.group >= 0
    visits = np.bincount(rows.group[inside], minlength=rows.groups)
    allowed = np.full(len(rows.y), len(rows.y))
    allowed[inside] = np.floor(OF_GROUP * visits)[rows.group[inside]].astype(np.int64)
    return allowed


def _outside(rows: Rows, left: FloatArray, limits: _Limits) -> IntArray:
    """The `most` farthest rows, within the limit of each group, after those that are outside anyway."""
    size = np.where(limits.first, np.inf, np.abs(left))
    size[rows.kept <= LONE] = -1.0
    if not rows.groups:  # no order of all rows: it takes most of the time of many
        ahead = ties.top(size, limits.most)
        return np.asarray(ahead[size[ahead] >= 0])
    ahead = ties.descending(size, 0.0)
    ahead = ahead[size[ahead] >= 0]
    group = rows.group[ahead]
    place = np.zeros(ahead.size, np.int64)
    by_group = np.argsort(group, kind="stable")
    start = np.r_[0, np.flatnonzero(np.diff(group[by_group])) + 1]
    counts = np.diff(np.r_[start, ahead.size])
    place[by_group] = np.arange(ahead.size) - np.repeat(start, counts)
    return np.array(ahead[(group < 0) | (place < limits.allowed[ahead]) | limits.first[ahead]][: limits.most])


def _concentrated(rows: Rows, left: FloatArray, limits: _Limits, steps: int) -> tuple[IntArray, float]:
    """Rows outside and residual sum of squares after this many concentration steps from these residuals."""
    best: tuple[IntArray, float] = np.zeros(0, np.int64), float("inf")
    for _ in range(steps):
        out, left, rss = without(rows, _outside(rows, left, limits))
        rss = max(rss, limits.rounding)
        if not ties.below(rss, best[1], 0.0):
            break
        best = out, rss
    return best
