"""Significance of candidates in an attitude run by the engine of all kinds: every unit beside the errors estimated
with it, within and between replications at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Stratum as Named
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.engine.family import TableFamily
from rig.fitter.trace.engine.strata import StrataJudge
from rig.procedures.attitude.trace.judge import AttitudeJudge
from rig.procedures.attitude.trace.robust import in_part
from rig.procedures.attitude.trace.score import errors
from rig.procedures.attitude.trace.strata_of_run import InRun, around, in_run

ROUNDS = 6
"""Maximum number of moves of the middle of the covariances."""


@dataclass(frozen=True, eq=False)
class PosedJudge(AttitudeJudge):
    """The same judge with the search of the engine.

    Attributes:
        simulated: families of the engine, also for parts of the run.
    """

    simulated: list[tuple[FloatArray, TableFamily]] = field(default_factory=list)

    def best(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """The most evident unit beside those `chosen`, among the significant ones."""
        if not self.candidates:
            return ()
        promising = self._engine(chosen).promising(self._units_of(chosen))
        return next((self.problem.units[u] for u in promising if self._p(chosen, u) <= ALPHA), ())

    def p_adjusted(self, chosen: tuple[int, ...], j: int) -> float:
        """Probability that the best of the family looks as good as `j`'s unit beside the other `chosen` by chance."""
        return self._p(self._others(chosen, j), self.problem.unit_of[j])

    def is_bound(self, p: float) -> bool:
        """Whether no simulated run had such a score."""
        return any(p == family.least for _, family in self.simulated)

    def stratum_of(self, chosen: tuple[int, ...], j: int) -> Named:
        """The stratum that tells most about `j` beside the other `chosen`."""
        others, u = self._others(chosen, j), self.problem.unit_of[j]
        engine = self._engine(others)
        weight = engine.problem.weight[engine.beside((*self._units_of(others), u)).best]
        columns = engine.problem.picked((u,))
        told = weight * np.array([float(np.sum(one.of(columns, columns))) for one in engine.problem.strata])
        if told[self._run.between].sum() > 0.5 * told.sum():
            return "replication"
        return "point-by-replication" if self.problem.judged_at[j] == "points" else "between-point"

    def _p(self, chosen: tuple[int, ...], u: int) -> float:
        """P of a unit beside the `chosen` candidates."""
        key = frozenset(chosen), u
        if key not in self._known:
            engine, units = self._engine(chosen), self._units_of(chosen)
            p = 1.0 if engine.refused(units, u) else engine.adjusted(units, u)
            if p <= ALPHA:
                f, rank, df = engine.scored(units, u)
                p = max(p, engine.judge(units, u, f * self._robust(chosen, u), rank, df))
            self._known[key] = p
        return self._known[key]

    def _robust(self, chosen: tuple[int, ...], u: int) -> float:
        """Share of the evidence for a unit that unequal, shared or slow errors within replications leave."""
        plain, share, against_walks = in_part(self.problem, chosen, u)
        left = min(share, against_walks / plain) if plain > 0.0 else 1.0
        return self._engine(chosen).damped(self._units_of(chosen), u, np.where(self._run.between, 1.0, left))

    def _units_of(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(dict.fromkeys(self.problem.unit_of[j] for j in chosen))

    def _engine(self, chosen: tuple[int, ...]) -> StrataJudge:
        """The engine's judge, with covariances about the likeliest beside those `chosen`."""
        key = frozenset(chosen)
        if key not in self._engines:
            sigma, units, middle = errors(self.problem, chosen), self._units_of(chosen), self._run.none
            for _ in range(ROUNDS):
                problem, grid = around(self._run, sigma, middle)
                self._engines[key] = StrataJudge(problem, simulated=self.simulated, open=self._open)
                best = grid[self._engines[key].beside(units).best]
                if best == middle:
                    break
                middle = best
        return self._engines[key]

    @cached_property
    def _engines(self) -> dict[frozenset[int], StrataJudge]:
        return {}

    @cached_property
    def _run(self) -> InRun:
        return in_run(self.problem, self.signs)
