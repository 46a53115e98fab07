"""What the best of all candidates scores on a whole-plot run when there is nothing to find.

The two strata are a family each. Between whole plots there are few numbers to decide by, within them plenty: the former
have two thirds of the level. Values of a constant that is searched share what another effect's term has for itself: the
search for one cause need not cost all others their power.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import special

from fitter.arrays import FloatArray
from fitter.linear import orthonormal
from fitter.trace.family import DRAWS, Family
from fitter.trace.whole_plots.problem import Problem
from fitter.trace.whole_plots.score import NOTHING_LEFT, beside
from fitter.trace.whole_plots.strata import LEVELS, Level

OF_THE_LEVEL: Mapping[Level, float] = {"whole-plot": 2 / 3, "subplot": 1 / 3}


@dataclass(frozen=True, eq=False)
class Families:
    """The families of a run, one a stratum.

    Attributes:
        of: the smallest of all p over their shares, in runs in which nothing is missing.
        level: (J,) the stratum of each candidate.
        share: (J,) of a candidate in its family's level, one where no constant is searched.

    """

    of: Mapping[Level, Family]
    level: tuple[Level, ...]
    share: FloatArray

    def adjust(self, p: FloatArray) -> FloatArray:
        """(J,) probability that the best of all candidates looks at least as good as each, by chance.

        Args:
            p: (J,) of each candidate taken alone.

        """
        out, level = np.ones(p.size), np.array(self.level)
        for name, family in self.of.items():
            here = level == name
            out[here] = np.minimum(family.adjust(p[here] / self.share[here]) / self._part(name), 1.0)
        return out

    def adjusted(self, p: float, j: int) -> float:
        """The same of candidate `j`."""
        family = self.of.get(self.level[j])
        return min(float(family.adjust(p / self.share[j])) / self._part(self.level[j]), 1.0) if family else 1.0

    def _part(self, level: Level) -> float:
        """Of the level, a stratum's part; all of it where the other has nothing to judge."""
        return OF_THE_LEVEL[level] if len(self.of) > 1 else 1.0

    def least(self, j: int) -> float:
        """What `adjusted` gives where no simulated run had the like: a bound."""
        return self.adjusted(0.0, j)


def family_of(problem: Problem, seed: int) -> Families:
    """Simulate the smallest p of both strata under the null, all transducers together.

    What noise does to the candidates' columns and the noise beside them are drawn together, so that few degrees of
    freedom for whole plots' errors are allowed for exactly. Transducers are drawn as independent: if they share errors
    there are fewer chances, and the family holds less than its level.
    """
    rng, share = np.random.default_rng(seed), shares(problem)
    drawn = {level: _smallest(problem, level, share, rng) for level in LEVELS}
    of = {level: Family(np.sort(smallest)) for level, smallest in drawn.items() if smallest is not None}
    return Families(of, problem.judged_at, share)


def shares(problem: Problem) -> FloatArray:
    """(J,) one over the values that are searched of a candidate's constant on its transducer, at its level."""
    kind = [(c.effect.name, c.sensor, level) for c, level in zip(problem.candidates, problem.judged_at, strict=True)]
    count = Counter(kind)
    return np.array(
        [1.0 / count[k] if c.effect.searched else 1.0 for c, k in zip(problem.candidates, kind, strict=True)]
    )


def _smallest(problem: Problem, level: Level, share: FloatArray, rng: np.random.Generator) -> FloatArray | None:
    """(DRAWS,) smallest p over share of one stratum; None where there is nothing to judge."""
    here, df = problem.within(level), problem.at[level].df
    stratum = beside(problem, level, (), here)
    columns, length = stratum.white.columns, problem.length_at[level][:, here] / stratum.sigma[:, None]
    norm = np.linalg.norm(columns, axis=(0, 1))
    judged = norm > NOTHING_LEFT * np.linalg.norm(length, axis=0)
    if not np.any(judged) or np.min(df) <= 1:
        return None
    unit, common = columns[:, :, judged] / norm[judged], np.array([problem.candidates[j].sensor is None for j in here])
    sums, squares = np.zeros((DRAWS, int(judged.sum()))), np.zeros((len(df), DRAWS))
    for i, own in enumerate(unit):
        basis = orthonormal(own, tolerance=1e-6)
        z = rng.standard_normal((DRAWS, basis.shape[1]), dtype=np.float32)
        sums += z @ (basis.T @ own).astype(np.float32)
        rest = max(df[i] - basis.shape[1], 0.0)
        squares[i] = np.sum(z**2, axis=1) + (rng.chisquare(rest, DRAWS) if rest > 0 else 0.0)
    smallest, share = np.ones(DRAWS), share[here][judged]
    for i in range(-1, len(df)):
        of = common[judged] if i < 0 else np.linalg.norm(unit[i], axis=0) * ~common[judged] > 0
        total, freedom = (squares.sum(axis=0), df.sum()) if i < 0 else (squares[i], df[i])
        judged_with = (float(df.min()) if i < 0 else float(freedom)) - 1.0
        for part in np.unique(share[of]):
            largest = np.max(np.abs(sums[:, of & (share == part)]), axis=1)
            error = np.sqrt(np.maximum(total - largest**2, np.finfo(float).tiny) / (freedom - 1.0))
            smallest = np.minimum(smallest, 2.0 * special.stdtr(judged_with, -largest / error) / part)
    return smallest
