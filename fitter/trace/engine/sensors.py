"""Candidates of several sensors of one run: each sensor's own are judged in it, common ones in all of them together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Self

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.engine.components import Components
from rig.fitter.trace.engine.family import TableFamily, family_of
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.lengths import Simulated
from rig.fitter.trace.engine.noise import BoolArray, Noise
from rig.fitter.trace.engine.rivalry import Rivalry, possible_of
from rig.fitter.trace.engine.score import View
from rig.fitter.trace.engine.white import White, of_sensors


@dataclass(frozen=True, eq=False)
class Stacked:
    """Errors of several sensors, one after the other: independent, with grids that have the same covariances.

    Attributes:
        parts: of each sensor.
        rows_of: number of rows of each.
    """

    parts: tuple[Noise, ...]
    rows_of: tuple[int, ...]

    @cached_property
    def _spans(self) -> list[slice]:
        ends = np.cumsum([0, *self.rows_of]).tolist()
        return [slice(one, other) for one, other in pairwise(ends)]

    @cached_property
    def of_group(self) -> IntArray | None:
        """(n,) group of each row of each sensor; None where the parts have none."""
        each = [one.group for one in self.parts if isinstance(one, Components)]
        if len(each) < len(self.parts):
            return None
        first = np.cumsum([0, *(int(one.max()) + 1 for one in each[:-1])])
        return np.concatenate([one + more for one, more in zip(each, first, strict=True)])

    @property
    def prior(self) -> FloatArray:
        """See `Noise`."""
        return self.parts[0].prior

    @cached_property
    def log_det(self) -> FloatArray:
        """See `Noise`."""
        return np.asarray(np.sum([one.log_det for one in self.parts], axis=0))

    @property
    def slow(self) -> BoolArray:
        """See `Noise`."""
        return self.parts[0].slow

    @property
    def drifting(self) -> BoolArray:
        """See `Noise`."""
        return self.parts[0].drifting

    @property
    def memory(self) -> FloatArray:
        """See `Noise`."""
        return self.parts[0].memory

    def whiten(self, which: IntArray, columns: FloatArray) -> FloatArray:
        """See `Noise`. Most columns are of one sensor, and zero elsewhere."""
        out = np.zeros((len(which), *columns.shape))
        for part, rows in zip(self.parts, self._spans, strict=True):
            own = np.flatnonzero(np.any(columns[rows] != 0.0, axis=0))
            out[:, rows, own] = part.whiten(which, columns[rows][:, own])
        return out

    def white(self, which: IntArray, columns: FloatArray) -> White:
        """See `Noise`."""
        each = []
        for part, rows in zip(self.parts, self._spans, strict=True):
            own = np.flatnonzero(np.any(columns[rows] != 0.0, axis=0))
            each.append((part.white(which, columns[rows][:, own]), own))
        return of_sensors(each, columns.shape[1], len(which))

    def back(self, at: int, white: FloatArray) -> FloatArray:
        """See `Noise`."""
        return np.vstack([p.back(at, white[rows]) for p, rows in zip(self.parts, self._spans, strict=True)])

    def colour(self, at: int, white: FloatArray) -> FloatArray:
        """See `Noise`."""
        return np.vstack([p.colour(at, white[rows]) for p, rows in zip(self.parts, self._spans, strict=True)])

    def root(self, at: int, columns: FloatArray) -> FloatArray:
        """See `Noise`."""
        return np.vstack([p.root(at, columns[rows]) for p, rows in zip(self.parts, self._spans, strict=True)])

    def variances(self, at: int) -> FloatArray:
        """See `Noise`."""
        return np.concatenate([p.variances(at) for p in self.parts])

    def rows(self, kept: IntArray) -> Stacked:
        """See `Noise`."""
        own = [kept[(kept >= rows.start) & (kept < rows.stop)] - rows.start for rows in self._spans]
        parts = tuple(part.rows(some) for part, some in zip(self.parts, own, strict=True))
        return Stacked(parts, tuple(map(len, own)))

    def only(self, at: int) -> Stacked:
        """See `Noise`."""
        return replace(self, parts=tuple(part.only(at) for part in self.parts))

    def over(self, sd: FloatArray) -> Stacked:
        """See `Noise`."""
        parts = tuple(part.over(sd[rows]) for part, rows in zip(self.parts, self._spans, strict=True))
        return replace(self, parts=parts)


def _like(noise: Noise, at: int, rival: Rivalry, families: Iterable[tuple[int, Rivalry]]) -> int:
    """The covariance whose simulation tells what chance does under covariance `at`: one that is known, if any is."""
    first = noise.parts[0] if isinstance(noise, Stacked) else noise
    known = [one for one, of in families if of == rival]
    return first.like(at, known) if isinstance(first, Components) else at


@dataclass(frozen=True, eq=False)
class OfSensor(TableJudge):
    """One sensor of several: what is simulated for one is used for all, and for all covariances that are nearly it."""

    def family(self, at: int, rival: Rivalry = "any") -> TableFamily:
        """See `TableJudge`."""
        return super().family(_like(self.problem.noise, at, rival, self.families), rival)


@dataclass(frozen=True, eq=False)
class Together(TableJudge):
    """All sensors one after the other, with the candidates of all.

    Attributes:
        alone: each sensor by itself, which knows the distribution of the scores of its own candidates.
    """

    alone: tuple[TableJudge, ...] = ()

    @cached_property
    def common(self) -> IntArray:
        """Candidates of no sensor."""
        return np.flatnonzero([c.sensor is None for c in self.candidates])

    def best(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """See `TableJudge`; as long as only common candidates are judged, the others are not whitened."""
        terms = (*self.common.tolist(), *chosen)
        if self.judged(chosen) is None or len(terms) == len(self.candidates):
            return super().best(chosen)
        some = Together(self.problem.only(terms), self.families, alone=self.alone)
        return tuple(terms[k] for k in some.best(tuple(range(len(self.common), len(terms)))))

    def judged(self, chosen: tuple[int, ...]) -> BoolArray | None:
        """Common candidates; all of them beside a common one."""
        if np.any(np.isin(chosen, self.common)):
            return None
        return np.isin(np.arange(len(self.candidates)), self.common)

    def family(self, at: int, rival: Rivalry = "any") -> TableFamily:
        """See `TableJudge`: that of the common candidates."""
        at = _like(self.problem.noise, at, rival, self.families)
        if (at, rival) not in self.families:
            without, beside = possible_of(self.problem, rival)
            self.families[at, rival] = family_of(
                self._of_common.problem,
                at,
                np.ones(len(self.common)),
                seed=1 + at,
                without=without,
                beside=beside,
                scatter=None if rival == "slow" else View.of(self._of_common.problem, at).only,
                simulated=self._of_common,
            )
        return self.families[at, rival]

    @cached_property
    def _of_common(self) -> Simulated:
        return Simulated(self.problem.only(self.common.tolist()))

    def family_for(self, j: int, at: int, rival: Rivalry) -> TableFamily:
        """That of its sensor for a candidate of one."""
        sensor = self.candidates[j].sensor
        own = next((one for one in self.alone if one.candidates and one.candidates[0].sensor == sensor), self)
        return self.family(at, rival) if own is self else own.family(at, rival)

    @property
    def _many(self) -> bool:
        return False


@dataclass(frozen=True, eq=False)
class RunJudge:
    """Candidates of all sensors, by their number in the run.

    Attributes:
        candidates: of the run.
        alone: each sensor by itself, with its own candidates; of a single sensor with all.
        own: run's number of each candidate of these.
        together: all sensors; None for a single one, or without common candidates.
        covariances: those of the whole grid that the judges have.
    """

    candidates: tuple[Any, ...]
    alone: tuple[TableJudge, ...]
    own: tuple[IntArray, ...]
    together: Together | None
    covariances: BoolArray

    @cached_property
    def _at(self) -> dict[int, tuple[int, int]]:
        """Sensor and number in it of each candidate."""
        return {int(j): (i, k) for i, own in enumerate(self.own) for k, j in enumerate(own)}

    def mine(self, i: int, chosen: Iterable[int]) -> tuple[int, ...]:
        """Those of some candidates that sensor `i` has, by their number there."""
        return tuple(self._at[j][1] for j in chosen if j in self._at and self._at[j][0] == i)

    def likeliest(self, chosen: Sequence[int]) -> FloatArray:
        """(S, 3) the likeliest components of each sensor's error beside those `chosen`."""
        if self.together is not None and self._common(chosen):
            noise = self.together.problem.noise.only(self.together.beside(tuple(chosen)).best)
            parts = noise.parts if isinstance(noise, Stacked) else (noise,)
        else:
            each = ((judge, judge.beside(self.mine(i, chosen)).best) for i, judge in enumerate(self.alone))
            parts = tuple(judge.problem.noise.only(at) for judge, at in each)
        return np.array([one.grid[0] for one in parts if isinstance(one, Components)])

    def rows(self, kept: IntArray, chosen: Iterable[int]) -> Self:
        """The same for some of the rows of each sensor, under the likeliest covariance beside those `chosen`."""
        chosen = tuple(chosen)
        at = [judge.beside(self.mine(i, chosen)).best for i, judge in enumerate(self.alone)]
        alone = tuple(_some(judge, kept, one) for judge, one in zip(self.alone, at, strict=True))
        if self.together is None:
            return replace(self, alone=alone)
        n, whole = self.alone[0].problem.n, self.together
        every = np.concatenate([kept + n * i for i in range(len(alone))])
        likeliest = whole.beside(chosen).best
        some = _some(whole, every, likeliest)
        return replace(self, alone=alone, together=Together(some.problem, some.families, alone=alone))

    def _common(self, chosen: Iterable[int]) -> bool:
        return self.together is not None and any(self.candidates[j].sensor is None for j in chosen)

    def best(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """The most evident candidate beside those `chosen`, among the significant ones of all sensors."""
        if self.together is not None and self._common(chosen):
            return self.together.best(chosen)
        found: list[tuple[float, tuple[int, ...]]] = []
        for i, judge in enumerate(self.alone):
            mine = self.mine(i, chosen)
            if unit := judge.best(mine):
                found.append((judge.worth(mine, unit), tuple(int(self.own[i][k]) for k in unit)))
        if self.together is not None and (unit := self.together.best(chosen)):
            found.append((self.together.worth(chosen, unit), unit))
        return max(found, default=(0.0, ()))[1]

    def p_adjusted(self, chosen: Sequence[int], j: int) -> float:
        """Probability that the best of the family looks as good as `j` beside the other `chosen` by chance."""
        return self.p_up_to(chosen, j, np.inf)

    def p_up_to(self, chosen: Sequence[int], j: int, most: float) -> float:
        """The same; one above `most` need only be known to be above it."""
        if self.together is not None and (self._common(chosen) or j not in self._at):
            return self.together.p_up_to(tuple(chosen), j, most)
        i, k = self._at[j]
        return self.alone[i].p_up_to(self.mine(i, chosen), k, most)

    def p_unsigned(self, chosen: Sequence[int], j: int) -> float:
        """The same, whatever the sign and the size of the coefficient of `j`."""
        others = tuple(k for k in chosen if k != j)
        if self.together is not None and (self._common(chosen) or j not in self._at):
            return self.together.adjusted(others, j)
        i, k = self._at[j]
        return self.alone[i].adjusted(self.mine(i, others), k)

    def is_bound(self, p: float) -> bool:
        """Whether no simulated run had such a score."""
        every = (*self.alone, *((self.together,) if self.together is not None else ()))
        return any(judge.is_bound(p) for judge in every)


def _some(judge: TableJudge, kept: IntArray, at: int) -> TableJudge:
    """Some of the rows under one covariance, with what is simulated for it."""
    held = judge.problem.given(noise=judge.problem.noise.only(at))
    return OfSensor(held.rows(kept), {(0, "any"): judge.family(at)})
