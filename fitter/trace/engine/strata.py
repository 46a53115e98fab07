"""Candidates known by their products in strata of independent errors: a search that needs no rows.

A long run of several sensors has thousands of rows and hundreds of candidates, but few strata: of each sensor the means
of points, and what differs from them. The errors of a stratum are independent and of one variance. So under every
covariance products are sums of those of strata over their variances, and the best scores by chance can be drawn from
products too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.engine.drawn_strata import Drawn, draw, summed
from rig.fitter.trace.engine.family import CERTAIN, FEWEST, TableFamily, Tail, evidence
from rig.fitter.trace.engine.in_strata import InStrata, OfStrata, rooted
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.likelihood import Likelihoods, ratio
from rig.fitter.trace.engine.models import Key
from rig.fitter.trace.engine.noise import BoolArray
from rig.fitter.trace.engine.problem import SPARED
from rig.fitter.trace.engine.rivalry import Rivalry, Trial
from rig.fitter.trace.engine.score import Scores
from rig.fitter.trace.signs import SURE

WORK = 1e7
"""Numbers that a simulation works out, at most: columns of all draws, under every covariance near the best."""
BEHIND = 12.0
"""Difference of twice the log-likelihood behind the best, in all draws, from which a covariance is left out."""
MOST = 1000
SURE_DRAWS = 4000
"""Number of draws behind a p that is near a limit: of 400 draws, a p of 0.035 is 0.018 as often as 0.053."""
NEAR_A_LIMIT = 2.0 * ALPHA
"""The largest p that is drawn again so often; where no draw has such a score it is an upper bound as it is."""
MOST_NEAR = 48
"""Covariances that are near the best, at most: those that are so on average."""
LIKE = 4.0
"""Ratio of a stratum's variances up to which two covariances give scores about the same distribution by chance."""
LARGE = 50.0
"""Variance over scatter beyond which a larger one makes no difference."""
SAME = 1e-9
"""Difference of logarithms that is rounding."""
TRIED = 60
_TINY = np.finfo(float).tiny
Single = NDArray[np.float32]


EVERY = slice(None)


@dataclass(frozen=True, eq=False)
class StrataJudge(TableJudge):
    """The same judge of a problem that is known by its products.

    Attributes:
        open: candidates that may be added.
        simulated: families, with the logarithms of the strata's weights they are for.
    """

    problem: InStrata
    simulated: list[tuple[FloatArray, TableFamily]] = field(default_factory=list)
    open: BoolArray = field(default_factory=lambda: np.zeros(0, np.bool_))
    _known: dict[tuple[int, Key], tuple[Scores, FloatArray]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not len(self.open):
            object.__setattr__(self, "open", np.ones(len(self.problem.candidates), np.bool_))

    def judged(self, chosen: tuple[int, ...]) -> BoolArray | None:
        """See `TableJudge`."""
        return self.open

    def beside(self, chosen: tuple[int, ...], extra: FloatArray | None = None) -> Likelihoods:
        """See `TableJudge`."""
        key = tuple(sorted(chosen))
        if key not in self._besides:
            problem, picked = self.problem, self.problem.picked(key)
            rss = problem.weight @ np.array([one.square for one in problem.strata])
            root = problem.rooted(picked, problem.products(picked[:, None], picked, EVERY), EVERY)
            rss = rss - np.sum(np.matmul(root, problem.dots(picked, EVERY)[:, :, None])[:, :, 0] ** 2, axis=1)
            rank = np.sum(np.diagonal(root, axis1=1, axis2=2) > 0.0, axis=1)
            size = np.where(root > 0.0, root, 1.0)
            det_x = -2.0 * np.sum(np.log(np.diagonal(size, axis1=1, axis2=2)), axis=1)
            rss, df = np.maximum(rss, _TINY), np.maximum(problem.n - rank, 1)
            log_det = problem.noise.log_det
            reml, ml = -0.5 * (df * np.log(rss) + log_det + det_x), -0.5 * (problem.n * np.log(rss) + log_det)
            self._besides[key] = Likelihoods(problem.noise, problem.n, reml, ml, rss / df)
        return self._besides[key]

    def _trial(self, chosen: tuple[int, ...], j: int) -> Trial:
        key = tuple(sorted(chosen))
        if (key, j) not in self._trials:
            self._trials[key, j] = Trial(np.empty(0), self.beside(chosen), self.beside((*chosen, j)))
        return self._trials[key, j]

    def adjusted(self, chosen: tuple[int, ...], j: int, most: float = np.inf) -> float:
        """See `TableJudge`; there is one kind of noise."""
        return self.judge(chosen, j, *self.scored(chosen, j), most)

    def scored(self, chosen: tuple[int, ...], j: int) -> tuple[float, int, int]:
        """F of `j` beside those `chosen`, its columns, and degrees of freedom.

        The larger one of that by the likelihood ratio, and that in the errors beside it: a cause that explains all of a
        lack of fit leaves none.
        """
        trial, every = self._trial(chosen, j), np.ones(len(self.problem.weight), np.bool_)
        scores = self._scores(trial.beside.best, chosen)
        rank, df = int(scores.rank[j]), int(scores.df[j])
        if not rank:
            return 0.0, rank, df
        in_its_errors = float(self._scores(self._beside_it(chosen, j), chosen).ratio[j])
        return max(ratio(trial.without, trial.beside, (every, every), rank, df), in_its_errors), rank, df

    def _beside_it(self, chosen: tuple[int, ...], j: int) -> int:
        """The likeliest errors beside `j` that cost no more than those without it, with what is held as it is there."""
        noise = self.problem.noise
        assert isinstance(noise, OfStrata)
        without = self.beside(chosen).best
        price = np.broadcast_to(noise.price, len(self.problem.weight))
        free = price <= price[without]
        if noise.held.any():
            held = noise.shape[:, noise.held]
            free = free & np.all(np.abs(held - held[without]) < SAME, axis=1)
        return self._trial(chosen, j).beside.best_of(free)

    def explained(self, chosen: tuple[int, ...], j: int, factor: FloatArray) -> float:
        """What `j` explains beside those `chosen`, in variances, with (L,) other weights of strata in proportion."""
        problem, order, beside = self.problem, (*sorted(chosen), j), self._trial(chosen, j).beside
        weight, columns = problem.weight[beside.best] * factor / beside.sigma2[beside.best], problem.picked(order)
        products = np.tensordot(weight, problem.each(columns[:, None], columns), 1)
        own = len(columns) - len(problem.picked((j,)))
        root = rooted(products, np.sqrt(np.maximum(np.diag(products), _TINY)))
        return float(np.sum((root @ (weight @ problem.each_dots(columns)))[own:] ** 2))

    def damped(self, chosen: tuple[int, ...], j: int, factor: FloatArray) -> float:
        """Share of what `j` explains beside those `chosen` that is left with (L,) smaller weights of strata."""
        gained = self.explained(chosen, j, np.ones_like(factor))
        return min(self.explained(chosen, j, factor) / max(gained, _TINY), 1.0)

    def judge(self, chosen: tuple[int, ...], j: int, f: float, rank: int, df: int, most: float = np.inf) -> float:
        """Family-wise p of such an F of `j` beside those `chosen`, in the errors beside it."""
        if rank == 0 or f <= 0.0:
            return 1.0
        own, name = float(evidence(np.array(f), rank, df)), self.candidates[j].effect.name
        if own > CERTAIN and self.simulated:
            return self.simulated[0][1].adjust(name, own, most)
        at = self._beside_it(chosen, j)
        family = self.family(at)
        p = family.adjust(name, own, most)
        return self.family(at, draws=SURE_DRAWS).adjust(name, own, most) if family.least < p < NEAR_A_LIMIT else p

    def _scores(self, at: int, chosen: tuple[int, ...]) -> Scores:
        return self.everything(at, tuple(sorted(chosen)))[0]

    def _possible(self, at: int, chosen: tuple[int, ...], scores: Scores) -> BoolArray:
        value, t = self.everything(at, tuple(sorted(chosen)))[1], np.sqrt(np.maximum(scores.ratio, 0.0))
        small = np.abs(value) * (1.0 - SURE / np.maximum(t, SURE)) <= self.problem.most
        return np.asarray(small & ~((self.problem.signs * value < 0.0) & (t > SURE)))

    def everything(self, at: int, chosen: tuple[int, ...]) -> tuple[Scores, FloatArray]:
        """Scores of all candidates beside others under a covariance, and (J,) their coefficients; zero for several."""
        if (at, chosen) in self._known:
            return self._known[at, chosen]
        problem, under, picked = self.problem, np.array([at]), self.problem.picked(chosen)
        count = len(problem.candidates)
        root = problem.rooted(picked, problem.products(picked[:, None], picked, under)[0], at)
        along = root @ problem.dots(picked, under)[0]
        square = float(problem.weight[at] @ np.array([one.square for one in problem.strata]))
        rss, taken = square - float(along @ along), int(np.count_nonzero(np.diag(root)))
        gain, rank, value = np.zeros(count), np.zeros(count, np.int64), np.zeros(count)
        for (of, columns), blocks in zip(problem.alike, problem.blocks, strict=True):
            left, dots = problem.beside(at, picked, columns, np.tensordot(problem.weight[at], blocks, 1))
            own = problem.rooted(columns, left, at)
            gain[of] = np.sum(np.matmul(own, dots[:, :, None])[:, :, 0] ** 2, axis=1)
            rank[of] = np.sum(np.diagonal(own, axis1=1, axis2=2) > 0.0, axis=1)
            if columns.shape[1] == 1:
                value[of] = own[:, 0, 0] ** 2 * dots[:, 0]
        rank[list(chosen)] = 0
        df = problem.n - taken - rank
        can = (rank > 0) & (df >= SPARED) & (rss > 0.0)
        variance = np.maximum(rss - gain, _TINY) / np.maximum(df, 1)
        ratio = np.where(can, gain / np.maximum(rank, 1) / variance, 0.0)
        self._known[at, chosen] = Scores(ratio, np.ones(count), rank, np.where(can, df, 1)), value
        return self._known[at, chosen]

    def family(self, at: int, rival: Rivalry = "any", draws: int = 0) -> TableFamily:
        """See `TableJudge`: one that is simulated for about the same variances, of enough draws, if any is."""
        assert isinstance(self.problem.noise, OfStrata)
        shape = np.maximum(self.problem.noise.shape[at], -np.log(LARGE))
        for known, found in self.simulated:
            # a part of a run may have fewer components
            alike = known.shape == shape.shape and np.max(np.abs(known - shape), initial=0.0) <= np.log(LIKE)
            if alike and len(found.smallest_p) >= draws:
                return found
        self.simulated.append((shape, _family(self, at, seed=1 + len(self.simulated), fewest=draws)))
        return self.simulated[-1][1]

    @property
    def _many(self) -> bool:
        return False


def _family(judge: StrataJudge, at: int, seed: int, fewest: int) -> TableFamily:
    """Scores of candidates in runs drawn with the errors of covariance `at` only."""
    problem, rng = judge.problem, np.random.default_rng(seed)
    roots = [one.root() for one in problem.strata]
    near = _near(problem, np.stack([one.squares for one in draw(problem, at, rng, TRIED, roots)]), at)
    at_once = int(np.clip(WORK / max(int(problem.start[-1]) * len(near), 1), FEWEST, MOST))
    rank, scores = judge.everything(at, ())[0].rank, list[dict[str, FloatArray]]()
    for _ in range(max(math.ceil(fewest / at_once), 1)):
        scores.append(_by_chance(problem, near, rank, draw(problem, at, rng, at_once, roots)))
    tails, smallest = dict[str, Tail](), np.ones(at_once * len(scores))
    for name in scores[0]:
        score = np.concatenate([one[name] for one in scores])
        if np.all(np.isfinite(score)):
            tails[name] = Tail(np.sort(score), 1.0)
            smallest = np.minimum(smallest, tails[name].p(score))
    return TableFamily(tails, smallest, problem.sensors)


def _by_chance(problem: InStrata, near: IntArray, rank: IntArray, drawn: Sequence[Drawn]) -> dict[str, FloatArray]:
    """(m,) best score of each effect in drawn errors; `near` (g,) covariances, that of the draws first."""
    n, total = problem.n, problem.weight[near] @ np.stack([one.squares for one in drawn])
    deviance = n * np.log(np.maximum(total, _TINY)) + problem.noise.log_det[near, None]
    size = np.exp((deviance - deviance[0]) / n)
    joined = np.full((len(problem.candidates), total.shape[1]), np.inf, np.float32)
    for g, own, whole in zip(near.tolist(), size, total, strict=True):
        sums = summed(problem, drawn, problem.weight[g])
        sums /= np.sqrt(whole).astype(np.float32)
        for (of, columns), blocks in zip(problem.alike, problem.blocks, strict=True):
            products = np.tensordot(problem.weight[g], blocks, 1)
            root = problem.rooted(columns, products, g) * problem.scale[columns][:, None]
            along = np.matmul(root.astype(np.float32), sums[columns])
            after = np.maximum(1.0 - np.sum(along**2, axis=1), np.float32(1e-6)) * own.astype(np.float32)
            joined[of] = np.minimum(joined[of], after)
    ratio, out = np.maximum(size.min(axis=0).astype(np.float32) / joined, np.float32(1e-30)) - 1.0, {}
    for name, every in problem.named.items():
        score = np.full(total.shape[1], -np.inf)
        for r in set(rank[every].tolist()) - {0}:
            best = ratio[every[rank[every] == r]].max(axis=0).astype(np.float64) * (n - r) / r
            score = np.maximum(score, evidence(best, r, n - r))
        out[name] = score
    return out


def _near(problem: InStrata, squares: FloatArray, at: int) -> IntArray:
    """Covariances that are near the best in any of some draws, that of the draws first."""
    total = problem.weight @ squares
    deviance = problem.n * np.log(np.maximum(total, _TINY)) + problem.noise.log_det[:, None]
    behind = deviance - deviance.min(axis=0)
    kept = np.flatnonzero(np.min(behind, axis=1) < BEHIND)
    kept = kept[ties.descending(-np.mean(behind[kept], axis=1))[:MOST_NEAR]]
    return np.concatenate([[at], kept[kept != at]])
