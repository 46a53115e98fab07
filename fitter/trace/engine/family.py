"""Distribution of the best score of all candidates without effects.

The family contains every effect with every value of a searched constant. Tables of normal errors are simulated with the
noise fitted without effects, and scored like the table itself, with the noise fitted again with every candidate: a
parametric bootstrap of the likelihood ratio (Davison and Hinkley, Bootstrap Methods, 1997, ch. 4). The best score of
each effect is calibrated separately with these draws, so that neither many values of a constant nor effects imitated by
noise mask the others; then the smallest of all p is calibrated (Westfall and Young, Resampling-Based Multiple Testing,
1993). It is run at `rig.fitter.trace.chance.ALPHA`, so that the rate over steps is 5 %. Of several sensors of one run
each has a family of its own; p is then that of the best of all of them (Sidak, JASA 62 (1967) 626: exact if their noise
is independent, cautious if it is not).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, cast

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.engine.lengths import Part, Simulated, Single
from rig.fitter.trace.engine.likelihood import deviances
from rig.fitter.trace.engine.noise import BoolArray
from rig.fitter.trace.engine.problem import SPARED, Problem
from rig.fitter.trace.engine.row_sums import outside
from rig.fitter.trace.engine.score import FEWEST_FOR_SCATTER, Blocks, View

WORK = 1.2e9
"""Maximum number of multiplications of a simulation."""
FEWEST, MOST = 400, 2000
TWICE = 2
"""Number of draws beyond the critical score, at least, however many sensors a run has."""
TRIED = 60
"""Number of draws to find covariances that are never near the best."""
BEHIND = 12.0
"""Difference of twice the log-likelihood: a covariance further behind in all of `TRIED` draws is left out."""
FIRST, FAR = 4, 10.0 * BEHIND
"""Number of draws after which those are left out that are this far behind in all of them."""
TAIL = 40
"""Number of draws beyond which the tail of an effect's score is continued as an exponential."""
KEPT, FEWEST_AT_ONCE = 300_000, 32
"""Scores that stay in the cache while they are used, and the fewest draws that are scored at once."""
AT_ONCE = 256
"""Columns whose contributions of single rows are worked out at once."""
CERTAIN = 40.0
"""Score that no draw comes near: its p is the least that a simulation can tell. (A normal one has p = 4e-18, of
thousands of candidates; the tails simulated for sixty tables ended at 27.)
"""
NO_MORE = 1e-3
"""Share of p that effects that wait may add at most, if they are not simulated."""
HELD = 300_000_000
"""Bytes of the sets of draws that are held at once. Two are held whatever their size: an effect is judged against noise
of short memory and against slow walks.
"""
ALL_BUT = 0.9
"""Share of candidates' columns that count beside the declared ones under every covariance."""
_TINY = np.finfo(np.float32).tiny
_LEAST = 1e-290
_MOST = 80.0


@dataclass(frozen=True, eq=False)
class Tail:
    """Distribution of the best score of one effect, -log p, without effects.

    Attributes:
        scores: of the draws, ascending.
        weight: factor of its p before effects are compared.
    """

    scores: FloatArray
    weight: float

    @cached_property
    def _beyond(self) -> tuple[int, float, float]:
        """Number of draws, threshold of the tail, and mean excess above it."""
        count = min(TAIL, len(self.scores) // 5)
        start = float(self.scores[-count - 1])
        return count, start, max(float(np.mean(self.scores[-count:])) - start, 1e-6)

    def p(self, score: FloatArray) -> FloatArray:
        """Probability of such a high score by chance, times the weight."""
        size = len(self.scores)
        count, start, mean = self._beyond
        above = (1.0 + size - np.searchsorted(self.scores, score, side="left")) / (1.0 + size)
        beyond = count / size * np.exp(-np.maximum(score - start, 0.0) / mean)
        return self.weight * np.asarray(np.where(score > start, beyond, above))


@dataclass(eq=False)
class TableFamily:
    """Distribution of scores by chance; effects are simulated as far as they are asked for.

    Attributes:
        tails: by effect, of those simulated; one that cannot be judged has none.
        smallest_p: (m,) of these effects in every draw.
        sensors: of the run, each with such a family.
        draws: tables in which effects are scored; None if all are.
        waiting: parts of the effects that are not simulated yet, those of fewest columns first.
        sooner: whether effects that wait count with their bound where that is enough.
    """

    tails: dict[str, Tail]
    smallest_p: FloatArray
    sensors: int = 1
    draws: Draws | None = None
    waiting: list[Part] = field(default_factory=list)
    sooner: bool = False

    @property
    def least(self) -> float:
        """Result of `adjust` for p below all simulated ones: an upper bound."""
        return self._rank(0.0)

    def adjust(self, effect: str, score: float, most: float = np.inf) -> float:
        """Probability that the best of the family looks at least as good by chance as an effect with this score.

        If it is above `most`, the result may be less, but above it: every further effect can only raise it. With
        `sooner`, one that is not above it may be more, but not above it: the own p of an effect that waits is as small
        as this one with at most this probability (Bonferroni).
        """
        own = next((part for part in self.waiting if effect in part.simulated.problem.named), None)
        if own is not None:
            self._simulate(own)
        if effect not in self.tails:
            return 1.0
        alone = float(self.tails[effect].p(np.array(score)))
        while (p := self._rank(alone)) <= most and self.waiting:
            if self.sooner:
                bound = self._bound(alone)
                if bound <= most < np.inf:
                    return bound
                if bound - p <= NO_MORE * p:
                    return p
            self._simulate(self.waiting[0])
        return p

    def _bound(self, p: float) -> float:
        waiting = sum(len(part.simulated.problem.named) for part in self.waiting)
        return of_all(min(self._own(p) + waiting * p, 1.0), self.sensors)

    def _simulate(self, part: Part) -> None:
        if self.draws is not None:
            for name, (scores, weight) in self.draws.scores(part).items():
                self.tails[name] = Tail(np.sort(scores), weight)
                self.smallest_p = np.minimum(self.smallest_p, self.tails[name].p(scores))
        self.waiting.remove(part)

    def _rank(self, p: float) -> float:
        return of_all(self._own(p), self.sensors)

    def _own(self, p: float) -> float:
        rank = int(np.count_nonzero(self.smallest_p <= p))
        return min((1.0 + rank) / (1.0 + self.smallest_p.size), 1.0)


def of_all(p: float, sensors: int) -> float:
    """Probability by chance of the best of so many sensors, from that of one."""
    return p if sensors == 1 else -math.expm1(sensors * math.log1p(-min(p, 1.0 - 1e-15)))


def evidence(ratio: FloatArray, rank: int, df: int) -> FloatArray:
    """Score of an F of `rank` and `df` degrees of freedom: -log p; below zero if it is worse than its rival."""
    p = special.fdtrc(rank, df, np.maximum(ratio, 0.0))
    return np.asarray(np.minimum(ratio, 0.0) - np.log(np.maximum(p, _LEAST)))


def _fewest(problem: Problem) -> int:
    """Number of draws of a large table."""
    return max(FEWEST, math.ceil(TWICE * problem.sensors / ALPHA))


def least_of(problem: Problem) -> float | None:
    """`TableFamily.least` of every family of a large table; None where the number of draws depends on the noise."""
    return of_all(1.0 / (1.0 + _fewest(problem)), problem.sensors) if _large(problem) else None


def _large(problem: Problem, near: int = 1) -> bool:
    """Whether a table is simulated as few times as possible, whatever its noise, with at least so many covariances."""
    return ALL_BUT * problem.n * int(problem.start[-1]) * near > WORK * problem.effort / _fewest(problem)


def family_of(
    problem: Problem,
    at: int,
    weight: FloatArray,
    seed: int,
    *,
    without: BoolArray,
    beside: BoolArray,
    scatter: Callable[[IntArray], View] | None = None,
    simulated: Simulated | None = None,
    sooner: bool = False,
) -> TableFamily:
    """Scores of candidates beside the declared columns in simulated tables with only noise of covariance `at`.

    Args:
        problem: the table.
        at: covariance of the noise.
        weight: (J,) factor of the p of each candidate's effect before effects are compared.
        seed: of the draws.
        without: (G,) covariances that are fitted without a candidate.
        beside: (G,) those that are fitted beside one.
        scatter: some candidates whitened by `at`, if scores are divided by the contributions of single rows.
        simulated: of the same problem, if more than one family of it is simulated.
        sooner: as in `TableFamily`; covariances without and beside an effect are then sought in the same draws.
    """
    simulated = simulated or Simulated(problem)
    rng, count, n = np.random.default_rng(seed), _fewest(problem), problem.n
    near = _near(problem, at, without, rng)
    if sooner and np.array_equal(without, beside):  # the same ones again: a tenth of a second in large tables
        rng.standard_normal((n, TRIED))  # as if they had been sought: p of a table is the same as before
        pair = near, near
    else:
        pair = near, _near(problem, at, beside, rng)
    if not _large(problem, len(pair[1])):
        if not (width := simulated.width(at)):
            return TableFamily({}, np.ones(1), problem.sensors)
        most = WORK * problem.effort / (n * width * max(len(pair[1]), 1))
        count = int(np.clip(most, count, max(MOST * problem.effort, count)))
    rows = scatter if n >= FEWEST_FOR_SCATTER else None
    draws = Draws(problem, at, weight, rng, pair, count, rows, simulated.held)
    return TableFamily({}, np.ones(count), problem.sensors, draws, list(simulated.parts), sooner)


@dataclass(frozen=True, eq=False)
class Draws:
    """Tables with only noise of one covariance.

    Attributes:
        problem: the table.
        at: the covariance.
        weight: (J,) of each candidate, as in `family_of`.
        rng: in the state in which errors are drawn.
        near: (G0,), (G1,) covariances that are fitted without a candidate, and beside one.
        count: number m of draws.
        scatter: as in `family_of`.
        held: the draws that were asked for last, by their token, as many as `HELD` allows: with many rows they take
            much memory, and go with the last who has them.
        token: of these draws.
    """

    problem: Problem
    at: int
    weight: FloatArray
    rng: np.random.Generator
    near: tuple[IntArray, IntArray]
    count: int
    scatter: Callable[[IntArray], View] | None
    held: dict[object, Drawn]
    token: object = field(default_factory=object)

    def scores(self, part: Part) -> dict[str, tuple[FloatArray, float]]:
        """(m,) best score of each effect of a part in every draw, and the weight of its p."""
        found, mine = part.simulated.under(self.at), part.simulated.problem
        df = mine.n - found.basis.shape[1]
        judged = (found.rank > 0) & (df - found.rank >= SPARED)
        out: dict[str, tuple[FloatArray, float]] = {}
        if not np.any(judged):
            return out
        if self.token not in self.held:
            new = self._drawn()
            while len(self.held) > 1 and new.size + sum(one.size for one in self.held.values()) > HELD:
                del self.held[next(iter(self.held))]
            self.held[self.token] = new
        drawn = self.held[self.token]
        ratio = _ratios(drawn, part.simulated, found.rank, df)
        if self.scatter is not None:
            ratio /= _scatter(self.scatter(part.terms).units(), drawn.noise, df)
        for name, every in mine.named.items():
            if np.any(judged[every]):
                own = every[judged[every]]
                score = np.full(self.count, -np.inf)
                for rank in set(found.rank[own].tolist()):
                    best = ratio[own[found.rank[own] == rank]].max(axis=0).astype(np.float64)
                    score = np.maximum(score, evidence(best, rank, df - rank))
                out[name] = score, float(self.weight[part.terms[own[0]]])
        return out

    def _drawn(self) -> Drawn:
        problem, (without, beside) = self.problem, self.near
        n, log_det, declared = problem.n, problem.noise.log_det, problem.declared / problem.sd[:, None]
        # single precision is half the memory and time; `Noise` and `outside` keep the type that they are given
        errors = cast(FloatArray, deepcopy(self.rng).standard_normal((n, self.count)).astype(np.float32))
        coloured = problem.noise.colour(self.at, errors)
        alone, usual = np.full(self.count, np.inf), np.full(self.count, np.nan)
        fitted = []
        for g in np.union1d(without, beside).tolist():
            basis = orthonormal(problem.noise.whiten(np.array([g]), declared)[0])
            left = outside(problem.noise.whiten(np.array([g]), coloured)[0], basis)
            total = np.einsum("nm,nm->m", left, left, dtype=np.float64)
            deviance = n * np.log(total) + log_det[g]
            usual = np.where(np.isnan(usual), deviance, usual)
            size = np.exp(np.clip((deviance - usual) / n, -_MOST, _MOST))  # as a sum of squares; no logarithm of each
            if g in without:
                alone = np.minimum(alone, size)
            if g in beside:
                left /= np.sqrt(total).astype(left.dtype)
                fitted.append((g, size.astype(np.float32), _single(problem.noise.back(g, left)), _single(left)))
        white = orthonormal(problem.noise.whiten(np.array([self.at]), declared)[0])
        return Drawn(alone.astype(np.float32), fitted, _single(outside(errors, white)))


def _single(values: FloatArray) -> Single:
    return values.astype(np.float32, copy=False)


class Drawn(NamedTuple):
    """Simulated tables, whitened.

    Attributes:
        alone: (m,) least sum of squares without a candidate, as of equal determinants.
        fitted: for each covariance beside a candidate, its index, (m,) sum of squares, and (n, m) residuals of length
            one: whitened back, and as they are.
        noise: (n, m) the errors, with the declared columns removed.
    """

    alone: Single
    fitted: list[tuple[int, Single, Single, Single]]
    noise: Single

    @property
    def size(self) -> int:
        """Bytes of all of them."""
        return self.noise.nbytes * (1 + 2 * len(self.fitted))


def _near(problem: Problem, at: int, possible: BoolArray, rng: np.random.Generator) -> IntArray:
    """Covariances, among the possible ones, that are ever near the best in tables drawn with covariance `at`."""
    every = np.flatnonzero(possible)
    if len(every) == 1:
        return every
    drawn = problem.noise.colour(at, rng.standard_normal((problem.n, TRIED)))
    for some, behind in ((drawn[:, :FIRST], FAR), (drawn, BEHIND)):
        deviance = deviances(problem.noise, every, problem.declared / problem.sd[:, None], some)
        least = np.min(deviance - deviance.min(axis=0), axis=1)
        every = every[(least < behind) | (every == at)]
    return every


def _ratios(drawn: Drawn, simulated: Simulated, rank: IntArray, df: int) -> Single:
    """(J, m) F equivalent to the likelihood ratio of every candidate, as in `likelihood.ratio`."""
    m = len(drawn.alone)
    joined = np.full((len(rank), m), np.inf, np.float32)
    at_once = max(FEWEST_AT_ONCE, KEPT // max(simulated.columns.shape[1], 1))
    for g, size, back, left in drawn.fitted:
        found = simulated.under(g)
        for some in (slice(first, first + at_once) for first in range(0, m, at_once)):
            after = found.gains(simulated.columns.T @ back[:, some], left[:, some])
            np.subtract(1.0, after, out=after)
            np.maximum(after, np.float32(1e-6), out=after)
            after *= size[some]
            np.minimum(joined[:, some], after, out=joined[:, some])
    ratio = np.minimum(drawn.alone / joined, np.float32(np.exp(_MOST)))
    fell = ratio > 1.0
    ratio = np.log(np.maximum(ratio, _TINY), out=ratio - 1.0, where=~fell)
    ranks = np.maximum(rank, 1)[:, None].astype(np.float32)
    free = np.maximum(df - ranks, 1.0) / ranks
    return np.asarray(ratio * free, np.float32)


def _scatter(found: Blocks, noise: Single, df: int) -> Single:
    """(J, m) contributions of single rows to the variance of a candidate's sums, as in `score`; at least one."""
    rank, squared = np.maximum(found.rank, 1)[:, None].astype(np.float32), noise**2
    dots, own = (np.empty((found.units.shape[1], noise.shape[1]), np.float32) for _ in range(2))
    for first in range(0, len(own), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        units = np.ascontiguousarray(found.units[:, some])
        squares, dots[some] = units**2, units.T @ noise
        own[some] = squares.T @ squared + dots[some] ** 2 * np.sum(squares**2, axis=0)[:, None]
        own[some] -= 2.0 * dots[some] * ((squares * units).T @ noise)
    variance = np.maximum(np.sum(squared, axis=0) - found.sums(dots**2), _TINY) / np.maximum(df - rank, 1)
    return np.asarray(np.maximum(found.sums(own) / rank / variance, 1.0))
