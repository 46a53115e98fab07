"""Distribution of the best score of all candidates of a whole-plot run without effects.

Each of the two strata is a family. Between whole plots there are few numbers for a decision, within them many: the
former have two thirds of the level. Values of a searched constant share the level of one term of another effect, so
that the search of one cause does not reduce the power for all others.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.chance import DRAWS, Family
from rig.procedures.pressure.trace.problem import Problem
from rig.procedures.pressure.trace.score import NOTHING_LEFT, beside
from rig.procedures.pressure.trace.strata import LEVELS, Level

_PER_T = 100
_T = np.arange(40 * _PER_T + 1) / _PER_T
"""Scores for interpolation of p: 20,000 draws do not determine more."""
OF_THE_LEVEL: Mapping[Level, float] = {"whole-plot": 2 / 3, "subplot": 1 / 3}


@dataclass(frozen=True, eq=False)
class Families:
    """The families of a run, one per stratum.

    Attributes:
        of: the smallest of all p over their shares, in runs without missing effects.
        level: (J,) the stratum of each candidate.
        share: (J,) of a candidate in its family's level, one without a searched constant.
    """

    of: Mapping[Level, Family]
    level: tuple[Level, ...]
    share: FloatArray

    def adjust(self, p: FloatArray) -> FloatArray:
        """(J,) probability that the best of all candidates looks at least as good as each, by chance.

        Args:
            p: (J,) of each candidate alone.
        """
        out = np.ones(p.size)
        for name, family in self.of.items():
            here = self._here[name]
            out[here] = np.minimum(family.adjust(p[here] / self.share[here]) / self._part(name), 1.0)
        return out

    @cached_property
    def _here(self) -> Mapping[Level, NDArray[np.bool_]]:
        """(J,) whether each candidate is of a stratum."""
        return {level: np.array([one == level for one in self.level], np.bool_) for level in self.of}

    def adjusted(self, p: float, j: int) -> float:
        """The same of candidate `j`."""
        family = self.of.get(self.level[j])
        return min(float(family.adjust(p / self.share[j])) / self._part(self.level[j]), 1.0) if family else 1.0

    def _part(self, level: Level) -> float:
        """A stratum's share of the level; all of it if the other has no candidates."""
        return OF_THE_LEVEL[level] if len(self.of) > 1 else 1.0

    def least(self, j: int) -> float:
        """Result of `adjusted` for p below all simulated ones: an upper bound."""
        return self.adjusted(0.0, j)


def family_of(problem: Problem, seed: int) -> Families:
    """Simulate the smallest p of both strata under the null, all transducers together.

    The noise along the candidates' columns and the remaining noise are drawn together, so that few degrees of freedom
    for whole plots' errors are taken into account exactly. Transducers are drawn as independent: with common errors the
    test is conservative.
    """
    rng, share = np.random.default_rng(seed), shares(problem)
    drawn = {level: _smallest(problem, level, share, rng) for level in LEVELS}
    of = {level: Family(np.sort(smallest)) for level, smallest in drawn.items() if smallest is not None}
    return Families(of, problem.judged_at, share)


def shares(problem: Problem) -> FloatArray:
    """(J,) one over the number of searched values of a candidate's constant on its transducer, at its level."""
    kind = [(c.effect.name, c.sensor, level) for c, level in zip(problem.candidates, problem.judged_at, strict=True)]
    count = Counter(kind)
    return np.array(
        [1.0 / count[k] if c.effect.searched else 1.0 for c, k in zip(problem.candidates, kind, strict=True)]
    )


def _smallest(problem: Problem, level: Level, share: FloatArray, rng: np.random.Generator) -> FloatArray | None:
    """(DRAWS,) smallest p over share of one stratum; None without candidates."""
    here, df = problem.within(level), problem.at[level].df
    stratum = beside(problem, level, (), here)
    columns, length = stratum.white.columns, problem.length_at[level][:, here] / stratum.sigma[:, None]
    norm = np.linalg.norm(columns, axis=(0, 1))
    judged = norm > NOTHING_LEFT * np.linalg.norm(length, axis=0)
    if not np.any(judged) or np.min(df) <= 1:
        return None
    unit, share = columns[:, :, judged] / norm[judged], share[here][judged]
    common = np.array([problem.candidates[j].sensor is None for j in here])[judged]
    smallest, together, squares = np.ones(DRAWS), np.zeros((int(common.sum()), DRAWS), np.float32), np.zeros(DRAWS)
    for i, every in enumerate(unit):
        mine = np.flatnonzero(np.any(every != 0.0, axis=0))
        basis = orthonormal(every[:, mine], tolerance=1e-6)
        z = rng.standard_normal((basis.shape[1], DRAWS), dtype=np.float32)
        drawn = (every[:, mine].T @ basis).astype(np.float32) @ z
        rest = max(df[i] - basis.shape[1], 0.0)
        square = np.asarray(np.sum(z**2, axis=0, dtype=np.float64))
        if rest > 0:
            square += rng.chisquare(rest, DRAWS)
        own = ~common[mine]
        smallest = np.minimum(smallest, _least(drawn[own], share[mine[own]], square, float(df[i]), float(df[i])))
        together[np.isin(np.flatnonzero(common), mine[~own])] += drawn[~own]
        squares += square
    return np.minimum(smallest, _least(together, share[common], squares, float(df.sum()), float(df.min())))


def _least(
    drawn: NDArray[np.float32], share: FloatArray, square: FloatArray, df: float, judged_with: float
) -> FloatArray:
    """(DRAWS,) smallest p over share of columns that have the same error.

    Args:
        drawn: (q, DRAWS) products of unit columns with the noise.
        share: (q,) of each column in the family's level.
        square: (DRAWS,) of the noise.
        df: degrees of freedom of that.
        judged_with: those used for p.
    """
    p = 2.0 * special.stdtr(max(judged_with - 1.0, 1.0), -_T)
    smallest, log_p = np.zeros(len(square)), np.log(np.maximum(p, np.finfo(float).tiny))
    slope = np.append(np.diff(log_p) / np.diff(_T), 0.0)  # flat beyond the last
    for part in np.unique(share):
        of = drawn[share == part]
        largest = np.maximum(of.max(axis=0), -of.min(axis=0)).astype(np.float64)
        error = np.sqrt(np.maximum(square - largest**2, np.finfo(float).tiny) / (df - 1.0))
        score = largest / error
        at = np.minimum(score * _PER_T, _T.size - 1.0).astype(np.int64)
        smallest = np.minimum(smallest, log_p[at] + slope[at] * (score - _T[at]) - np.log(part))
    return np.asarray(np.exp(smallest))
