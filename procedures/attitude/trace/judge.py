"""Significance of candidates in an attitude run: every unit beside the errors estimated with it, within and between
replications at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Stratum
from rig.fitter.trace.aliases import DELTA, Paths, Products, Rival, rivals
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.engine.family import evidence
from rig.fitter.trace.engine.strata import StrataJudge
from rig.fitter.trace.signs import SURE, Impossible, Refused
from rig.procedures.attitude.effects.unnamed import NAMELESS
from rig.procedures.attitude.trace.estimate import concerns
from rig.procedures.attitude.trace.posed import engine_of, posed, units_of
from rig.procedures.attitude.trace.problem import Candidate, Problem
from rig.procedures.attitude.trace.refine import refined
from rig.procedures.attitude.trace.robust import in_part


@dataclass(frozen=True, eq=False)
class AttitudeJudge:
    """A `rig.fitter.trace.search.Judge` of pitch-roll runs.

    Attributes:
        problem: the run.
        shut: effects that may not be added, initially terms without a cause. These never replace a cause.
        oversized: effects refused for an impossible size.
    """

    problem: Problem
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

    def best(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """The most evident unit beside those `chosen`, among the significant ones."""
        if not self.candidates:
            return ()
        promising = self._engine(chosen).promising(units_of(self.problem, chosen))
        return next((self.problem.units[u] for u in promising if self._p(chosen, u) <= ALPHA), ())

    def starts(self) -> list[tuple[int, ...]]:
        """For each effect significant by itself, the best unit in every such sensor; the most evident first."""
        engine, found = self._engine(()), dict[str, dict[str | None, tuple[int, float]]]()
        at = engine.beside(()).best
        scores, family = engine.everything(at, ())[0], engine.family(at)
        for u in ties.descending(scores.evidence).tolist():
            name, sensor = self.problem.causes[u]
            if self._open[u] and scores.rank[u] and sensor not in found.get(name, {}) and not engine.refused((), u):
                own = float(evidence(scores.ratio[[u]], int(scores.rank[u]), int(scores.df[u]))[0])
                if family.adjust(name, own, ALPHA) <= ALPHA:
                    found.setdefault(name, {})[sensor] = u, float(scores.evidence[u])
        every = list(found.values())
        strength = np.array([sum(gained for _, gained in of.values()) for of in every])
        ahead = ties.descending(strength).tolist()
        return [tuple(j for u, _ in every[k].values() for j in self.problem.units[u]) for k in ahead]

    def price(self, chosen: tuple[int, ...]) -> float:
        """Twice what is missing in the log-likelihood of a model, but for a constant."""
        return -2.0 * float(self._engine(chosen).beside(units_of(self.problem, chosen)).ml.max())

    def p_adjusted(self, chosen: tuple[int, ...], j: int) -> float:
        """Probability that the best of the family looks as good as `j`'s unit beside the other `chosen` by chance."""
        return self._p(self._others(chosen, j), self.problem.unit_of[j])

    def is_bound(self, p: float) -> bool:
        """Whether no simulated run had such a score."""
        return any(p == family.least for _, family in self.problem.simulated)

    def stratum_of(self, chosen: tuple[int, ...], j: int) -> Stratum:
        """The stratum in which `j` is significant beside the other `chosen`."""
        others, u = self._others(chosen, j), self.problem.unit_of[j]
        engine, units = self._engine(others), units_of(self.problem, others)
        _, rank, df = engine.scored(units, u)
        within = in_part(self.problem, others, u)[0] / max(rank, 1)
        if engine.judge(units, u, within, rank, df) > ALPHA:
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
        problem, effect = self.problem, self.candidates[group[0]].effect.name
        sensors = {problem.sensors[i] for j in group for i in np.flatnonzero(concerns(problem, j) > 0.01)}
        barred = frozenset((self.shut | NAMELESS) - {effect})
        where = {None, *sensors}
        named = [
            unit
            for unit, (name, sensor) in zip(problem.units, problem.causes, strict=True)
            if sensor in where and name not in barred and (name, sensor) not in self.closed
        ]
        products, paths = self._products(group, rest, named)
        found = rivals(problem.candidates, products, group, rest, sensors, named, self.searched, paths, within)
        reachable = self._reachable(products, found)
        able = [r for r, can in zip(found, reachable, strict=True) if r.effect == effect or can]
        best = min(r.sigmas for r in able if not r.refused)
        return tuple(replace(r, sigmas=float(np.sqrt(max(r.sigmas**2 - best**2, 0.0)))) for r in able)

    def _products(
        self, group: tuple[int, ...], rest: tuple[int, ...], named: Sequence[tuple[int, ...]]
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
        count, chosen = len(self.candidates), (*group, *rest)
        engine, column = self._engine(chosen), posed(self.problem).column
        at = engine.beside(units_of(self.problem, chosen)).best
        out = Products(np.zeros((count, count)), np.zeros(count), self.signs)
        for same in of.values():
            here = np.array(same, np.int64)
            left = engine.problem.beside(at, column[list(rest)], column[here])
            some = Products(*left).without(engine.problem.length[column[here]] ** 2)
            out.columns[here[:, :, None], here[:, None, :]], out.outputs[here] = some.columns, some.outputs
        self._known_products[key] = out, {}
        return self._known_products[key]

    @cached_property
    def _known_products(self) -> dict[Any, tuple[Products, Paths]]:
        """The last ones."""
        return {}

    def forget(self) -> None:
        """Drop the products of the last explanations, and the engines; they are made again if they are asked for."""
        self._known_products.clear()
        self.problem.engines.clear()

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
            can = np.all(np.abs(value) - SURE * stderr <= self.problem.most[picked], axis=1)
            for k, one in zip(same, can.tolist(), strict=True):
                out[k] = one
        return out

    @cached_property
    def _limited(self) -> frozenset[int]:
        """Candidates with a largest plausible coefficient."""
        return frozenset(np.flatnonzero(np.isfinite(self.problem.most)).tolist())

    @cached_property
    def _open(self) -> NDArray[np.bool_]:
        """(U,) units that may be added; none where nothing tells the scatter of readings."""
        causes, closed, levels = self.problem.causes, self.closed, self.problem.levels
        if levels.df(levels.of_error) <= 0:
            return np.zeros(len(causes), np.bool_)
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

    def forbidden(self, chosen: tuple[int, ...]) -> tuple[Impossible, ...]:
        """Candidates that are significant beside those `chosen`, except for their required sign: the clearest of each
        effect and sensor.
        """
        signs = self._engine(chosen).problem.signs
        return self._impossible(chosen, lambda value, t: (signs * value < 0.0) & (t > SURE)) if np.any(signs) else ()

    def outsized(self, chosen: tuple[int, ...]) -> tuple[Impossible, ...]:
        """Those that are, except for an impossible size."""
        most = self._engine(chosen).problem.most
        return self._impossible(chosen, lambda value, t: np.abs(value) * (1.0 - SURE / np.maximum(t, SURE)) > most)

    def _impossible(
        self, chosen: tuple[int, ...], wrong: Callable[[FloatArray, FloatArray], NDArray[np.bool_]]
    ) -> tuple[Impossible, ...]:
        engine, units = self._engine(chosen), units_of(self.problem, chosen)
        scores, value = engine.everything(engine.beside(units).best, tuple(sorted(units)))
        t = np.sqrt(np.maximum(scores.ratio, 0.0))
        clearest: dict[tuple[str, str | None], int] = {}
        for u in np.flatnonzero(wrong(value, t) & self._open).tolist():
            cause = self.problem.causes[u]
            if cause not in clearest or t[u] > t[clearest[cause]]:
                clearest[cause] = u
        sure = (u for u in clearest.values() if self._unsigned(chosen, u) <= ALPHA)
        return tuple(Impossible(self.problem.units[u][0], float(value[u]), float(abs(value[u]) / t[u])) for u in sure)

    def _p(self, chosen: tuple[int, ...], u: int) -> float:
        """P of a unit beside the `chosen` candidates."""
        key = frozenset(chosen), u
        if key not in self._known:
            refused = self._engine(chosen).refused(units_of(self.problem, chosen), u)
            self._known[key] = 1.0 if refused else self._unsigned(chosen, u)
        return self._known[key]

    def _unsigned(self, chosen: tuple[int, ...], u: int) -> float:
        """The same, whatever the sign of its coefficient."""
        engine, units = self._engine(chosen), units_of(self.problem, chosen)
        p = engine.adjusted(units, u)
        if p > ALPHA:
            return p
        f, rank, df = engine.scored(units, u)
        return max(p, engine.judge(units, u, f * self._robust(chosen, u), rank, df))

    def _robust(self, chosen: tuple[int, ...], u: int) -> float:
        """Share of the evidence for a unit that unequal, shared or slow errors within replications leave.

        They are asked beside scatter alone. What the engine has against lack of fit counts where that is less.
        """
        engine, units, between = self._engine(chosen), units_of(self.problem, chosen), posed(self.problem).between
        plain, share, against_walks = in_part(self.problem, chosen, u)
        whole = min(plain, engine.explained(units, u, np.where(between, 0.0, 1.0)))
        left = min(plain * share, against_walks) / whole if whole > 0.0 else 1.0
        return engine.damped(units, u, np.where(between, 1.0, min(left, 1.0)))

    def _engine(self, chosen: tuple[int, ...]) -> StrataJudge:
        """The engine's judge, which adds open units only."""
        return replace(engine_of(self.problem, chosen), open=self._open)

    @cached_property
    def _known(self) -> dict[tuple[frozenset[int], int], float]:
        return {}
