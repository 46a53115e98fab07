"""Significance of candidates in an attitude run, by both tests: of single observations, and between replications."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Stratum
from rig.fitter.trace.aliases import DELTA, Paths, Products, Rival, rivals
from rig.fitter.trace.chance import ALPHA, Family
from rig.fitter.trace.signs import SURE, Impossible, Refused
from rig.procedures.attitude.effects.unnamed import NAMELESS
from rig.procedures.attitude.trace.estimate import coefficients, concerns, estimate
from rig.procedures.attitude.trace.levels import Level
from rig.procedures.attitude.trace.limits import limits
from rig.procedures.attitude.trace.problem import Candidate, Problem
from rig.procedures.attitude.trace.refine import refined
from rig.procedures.attitude.trace.replications import Between, Slow, between_replications, slow_of
from rig.procedures.attitude.trace.robust import second_thoughts
from rig.procedures.attitude.trace.score import Scores, beside, errors, score

BETWEEN = 5 / 7, 1 / 7
"""Shares of ALPHA for tests between replications without and with a searched constant: 2.5 % and 0.5 % of runs, in
addition to the 3 % of all others. Later tests remove more than half of each.
"""


@dataclass(frozen=True, eq=False)
class AttitudeJudge:
    """A `rig.fitter.trace.search.Judge` of pitch-roll runs.

    Attributes:
        problem: the run.
        family: distribution by chance.
        shut: effects that may not be added, initially terms without a cause. These never replace a cause.
        oversized: effects refused for an impossible size.
    """

    problem: Problem
    family: Family
    shut: frozenset[str] = NAMELESS
    oversized: tuple[Refused, ...] = ()

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All candidates, in catalogue order."""
        return self.problem.candidates

    @cached_property
    def searched(self) -> frozenset[str]:
        """Effects whose units are values of one searched constant."""
        return frozenset(c.effect.name for c in self.candidates if c.effect.searched)

    def unit(self, j: int) -> tuple[int, ...]:
        """Candidates that are judged together with `j`, including it."""
        return self.problem.units[self.problem.unit_of[j]]

    def refined(self, chosen: tuple[int, ...]) -> AttitudeJudge:
        """With refined values of the searched constants of `chosen`."""
        problem = refined(self.problem, chosen)
        if problem is self.problem:
            return self
        placed = replace(self, problem=problem)
        # placed by what is seen within replications, which must not cost what is seen between them
        lost = any(placed.p_adjusted(chosen, j) > ALPHA >= self.p_adjusted(chosen, j) for j in chosen)
        return self if lost else placed

    @cached_property
    def signs(self) -> FloatArray:
        """(J,) physical sign of each candidate's coefficient; 0 if both are possible."""
        return np.array([c.effect.sign(c.term.name) for c in self.candidates], np.float64)

    @cached_property
    def _unit_signs(self) -> FloatArray:
        """(U,) the same for units of one column; units of several have none."""
        return np.array([self.signs[unit[0]] if len(unit) == 1 else 0.0 for unit in self.problem.units])

    def possible(self, scores: Scores) -> NDArray[np.bool_]:
        """(U,) units whose coefficient has no physically impossible sign."""
        return np.asarray(scores.sign * self._unit_signs >= 0)

    def best(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """The unit that reduces the residual most beside those `chosen`, among the significant ones."""
        if not self.candidates:
            return ()
        scores = score(self.problem, chosen)
        able = self._open & self.possible(scores)
        found = np.flatnonzero((scores.p <= self.family.critical) & able)
        for u in found[np.argsort(-scores.gain[found])].tolist():
            if self._again(chosen, u, scores) <= ALPHA:
                return self.problem.units[u]
        between = np.where(self._open, self._between(chosen), 1.0)
        best = int(np.argmin(between))
        return self.problem.units[best] if between[best] <= ALPHA else ()

    def p_adjusted(self, chosen: tuple[int, ...], j: int) -> float:
        """Probability that the best of the family looks as good as `j`'s unit beside the other `chosen` by chance."""
        p = self._p_here(chosen, j)
        return p if p <= ALPHA else min(p, float(self._between(self._others(chosen, j))[self.problem.unit_of[j]]))

    def is_bound(self, p: float) -> bool:
        """Whether no simulated run had such a score."""
        return p == self.family.least

    def stratum_of(self, chosen: tuple[int, ...], j: int) -> Stratum:
        """The stratum in which `j` is significant beside the other `chosen`."""
        if self._p_here(chosen, j) > ALPHA:
            return "replication"
        return "point-by-replication" if self.problem.judged_at[j] == "points" else "between-point"

    def rivals(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """All explanations for the terms of `effect` among `chosen`, at the level of the estimates."""
        group = tuple(j for j in chosen if self.candidates[j].effect.name == effect)
        return self.explanations(group, tuple(j for j in chosen if j not in group))

    def alike(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """The same without most that are not aliases."""
        group = tuple(j for j in chosen if self.candidates[j].effect.name == effect)
        return self.explanations(group, tuple(j for j in chosen if j not in group), within=DELTA)

    def explanations(self, group: tuple[int, ...], rest: tuple[int, ...], within: float = np.inf) -> tuple[Rival, ...]:
        """All explanations of what some candidates explain beside the `rest` of the model.

        Args:
            group: candidates of one effect or of several; they come back under the name of the first.
            rest: the other candidates in the model.
            within: see `rig.fitter.trace.aliases.rivals`.

        """
        problem, chosen = self.problem, tuple(sorted((*group, *rest)))
        effect = self.candidates[group[0]].effect.name
        sigma = errors(problem, chosen)
        sensors = {problem.sensors[i] for j in group for i in np.flatnonzero(concerns(problem, j) > 0.01)}
        barred = frozenset((self.shut | NAMELESS) - {effect})
        where = {None, *sensors}
        named = [
            unit
            for unit, (name, sensor) in zip(problem.units, problem.causes, strict=True)
            if sensor in where and name not in barred and (name, sensor) not in self.closed
        ]
        products, paths = self._products(estimate(problem, chosen).level, group, rest, named, sigma)
        found = rivals(problem.candidates, products, group, rest, sensors, named, self.searched, paths, within)
        reachable = self._reachable(products, found)
        able = [r for r, can in zip(found, reachable, strict=True) if r.effect == effect or can]
        best = min(r.sigmas for r in able if not r.refused)
        return tuple(replace(r, sigmas=float(np.sqrt(max(r.sigmas**2 - best**2, 0.0)))) for r in able)

    def _products(
        self,
        level: Level,
        group: tuple[int, ...],
        rest: tuple[int, ...],
        named: Sequence[tuple[int, ...]],
        sigma: FloatArray,
    ) -> tuple[Products, Paths]:
        """Products among the terms of each effect beside the `rest`: nobody asks for the others, which are most.

        They are the same for both names of a pair, and so are paths of explanations, which come with them.
        """
        key = frozenset(group), frozenset(rest), tuple(named)
        if key in self._known_products:
            return self._known_products[key]
        blocks: dict[str | tuple[int, ...], set[int]] = {group: set(group)}
        for unit in named:
            name = self.candidates[unit[0]].effect.name
            blocks.setdefault(unit if name in self.searched else name, set()).update(unit)
        of: dict[int, list[list[int]]] = {}
        for block in blocks.values():
            of.setdefault(len(block), []).append(sorted(block))
        self._known_products.clear()
        count = len(self.candidates)
        out = Products(np.zeros((count, count)), np.zeros(count), self.signs)
        for same in of.values():
            here = np.array(same, np.int64)
            left = beside(self.problem, level, rest, here, sigma)
            length2 = np.sum((self.problem.length[:, here] / sigma[:, None, None]) ** 2, axis=0)
            some = Products(left.columns.sum(axis=0), left.outputs.sum(axis=0)).without(length2)
            out.columns[here[:, :, None], here[:, None, :]], out.outputs[here] = some.columns, some.outputs
        self._known_products[key] = out, {}
        return self._known_products[key]

    @cached_property
    def _known_products(self) -> dict[Any, tuple[Products, Paths]]:
        """The last ones."""
        return {}

    def forget(self) -> None:
        """Drop the products of the last explanations; they are computed again if they are asked for."""
        self._known_products.clear()

    def _reachable(self, products: Products, found: Sequence[Rival]) -> list[bool]:
        """Whether each explanation needs no coefficient that is impossibly large."""
        out, of = [True] * len(found), dict[int, list[int]]()
        for k, rival in enumerate(found):
            if not self._limited.isdisjoint(rival.terms):
                of.setdefault(len(rival.terms), []).append(k)
        for size, same in of.items():
            picked = np.array([found[k].terms for k in same], np.int64)
            gram, dot = products.columns[picked[:, :, None], picked[:, None, :]], products.outputs[picked]
            length = np.sqrt(np.maximum(np.einsum("kjj->kj", gram), np.finfo(float).tiny))
            spread = gram / (length[:, :, None] * length[:, None, :])
            spread = np.linalg.pinv(spread, rcond=1e-10) if size > 1 else np.rint(spread)
            value = np.einsum("kij,kj->ki", spread, dot / length) / length
            stderr = np.sqrt(np.maximum(np.einsum("kjj->kj", spread), 0.0)) / length
            can = np.all(np.abs(value) - SURE * stderr <= self._limits[picked], axis=1)
            for k, one in zip(same, can.tolist(), strict=True):
                out[k] = one
        return out

    @cached_property
    def _limits(self) -> FloatArray:
        """(J,) largest plausible coefficient of each candidate."""
        return limits(self.problem, range(len(self.candidates)))

    @cached_property
    def _limited(self) -> frozenset[int]:
        """Candidates with a largest plausible coefficient."""
        return frozenset(np.flatnonzero(np.isfinite(self._limits)).tolist())

    @cached_property
    def _open(self) -> NDArray[np.bool_]:
        """(U,) units that may be added."""
        causes, closed = self.problem.causes, self.closed
        return np.array([one[0] not in self.shut and one not in closed for one in causes], np.bool_)

    @cached_property
    def closed(self) -> frozenset[tuple[str, str | None]]:
        """Effects refused for their size, with the sensor; None for a common coefficient of all sensors."""
        scopes = {c.effect.name: c.sensor is None for c in self.candidates}
        return frozenset(
            (one.effect, sensor)
            for one in self.oversized
            for sensor in ([None] if scopes.get(one.effect) else one.sensors)
        )

    def too_large(self, found: Refused) -> AttitudeJudge:
        """A judge that may not add this effect in this sensor."""
        return replace(self, oversized=(*self.oversized, found))

    def without(self, names: frozenset[str]) -> AttitudeJudge:
        """A judge that may not add effects of these names."""
        return replace(self, shut=self.shut | names)

    def with_unnamed(self) -> AttitudeJudge:
        """A judge that may add terms without a cause."""
        return replace(self, shut=self.shut - NAMELESS)

    def _others(self, chosen: tuple[int, ...], j: int) -> tuple[int, ...]:
        return tuple(k for k in chosen if k not in self.unit(j))

    def _p_here(self, chosen: tuple[int, ...], j: int) -> float:
        others, u = self._others(chosen, j), self.problem.unit_of[j]
        if (frozenset(others), u) in self._known:
            return self._known[frozenset(others), u]
        scores = score(self.problem, others, (u,))
        if scores.sign[u] * self._unit_signs[u] < 0:
            return 1.0
        if scores.p[u] > self.family.critical:
            return float(self.family.adjust(scores.p[u]))
        return self._again(others, u, scores)

    def _again(self, chosen: tuple[int, ...], u: int, scores: Scores) -> float:
        key = frozenset(chosen), u
        if key not in self._known:
            p = second_thoughts(self.problem, chosen, u, scores, self.family.critical)
            self._known[key] = float(self.family.adjust(p))
        return self._known[key]

    @cached_property
    def _known(self) -> dict[tuple[frozenset[int], int], float]:
        return {}

    @cached_property
    def _slow(self) -> Slow:
        return slow_of(self.problem)

    def _between(self, chosen: tuple[int, ...]) -> FloatArray:
        """(U,) p between replications, multiplied by the number of tests over their share of the family.

        A unit that also varies within replications has independent information there: both are combined, weighted by
        their information about the coefficient.
        """
        gamma = coefficients(self.problem, chosen, "declared")[0]
        between = between_replications(self.problem, self._slow, chosen, gamma)
        tested = np.flatnonzero(between.p < 1.0).tolist()
        both = [u for u in tested if self.problem.judged_at[self.problem.units[u][0]] == "points"]
        scores, price = score(self.problem, chosen, both), self._price
        p, sign = between.p.copy(), between.sign.copy()
        p[both], sign[both] = _together(between, both, scores.p[both], scores.sign[both])
        near = tuple(np.flatnonzero(p * price <= ALPHA).tolist())
        again = between_replications(self.problem, self._slow, chosen, gamma, near) if near else between
        for u in near:
            p[u] = again.p[u]
            if self.problem.judged_at[self.problem.units[u][0]] == "points":
                within = second_thoughts(self.problem, chosen, u, scores, 1.0)
                p[[u]], sign[[u]] = _together(again, [u], np.array([within]), scores.sign[[u]])
        p = np.where(sign * self._unit_signs < 0, 1.0, p)
        return np.asarray(np.minimum(p * price, 1.0))

    def alone(self, chosen: tuple[int, ...]) -> tuple[Impossible, ...]:
        """Candidates that are significant beside those `chosen`, except for their required sign."""
        if not np.any(self._unit_signs):
            return ()
        problem, scores = self.problem, score(self.problem, chosen)
        wrong = np.flatnonzero((scores.p <= self.family.critical) & ~self.possible(scores) & self._open)
        out = []
        for u in wrong.tolist():
            if self._again(chosen, u, scores) <= ALPHA:
                (j,) = problem.units[u]
                left = beside(problem, problem.judged_at[j], chosen, np.array([j]), errors(problem, chosen))
                value = float(left.outputs.sum() / left.columns.sum())
                out.append(Impossible(j, value, abs(value) / float(np.sqrt(scores.f[u]))))
        return tuple(out)

    @cached_property
    def _price(self) -> FloatArray:
        """(U,) number of tests of a unit's kind over their share of the family."""
        given, sought = (count / share for count, share in zip(self.family.between, BETWEEN, strict=True))
        first = [self.candidates[unit[0]] for unit in self.problem.units]
        any_value = [c.effect.name in self.problem.any_value and c.effect.stratum != "replication" for c in first]
        return np.where(any_value, sought, given)


def _together(
    between: Between, units: list[int], within: FloatArray, sign: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(Q,) p and signs of units between and within replications combined: by weight and sign; for several columns by
    Fisher's method.

    Several columns have no sign: 0.
    """
    p = np.clip(np.stack([between.p[units], within]), np.finfo(float).tiny, 1.0)
    log_product = np.sum(np.log(p), axis=0)  # the product may be too small for a double
    alone = between.sign[units] != 0.0
    share = np.where(alone, between.share[units], 0.5)
    z = -special.ndtri(0.5 * p) * np.sqrt(np.stack([share, 1.0 - share]))
    signed = z[0] * between.sign[units] + z[1] * sign
    both = np.minimum(2.0 * special.ndtr(-signed * between.sign[units]), 1.0)
    return np.where(alone, both, np.exp(log_product) * (1.0 - log_product)), np.where(alone, np.sign(signed), 0.0)
