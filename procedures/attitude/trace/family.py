"""Distribution of the best score of all candidates without effects.

The family contains every unit of candidates on every sensor at every level and step of one run, with every value of a
searched constant. Three percent of runs are for the largest score of all, simulated under the fitted null. Tests
between replications have few degrees of freedom and are counted as an equivalent number of independent ones: three
percent are for them (`judge.py`), and another half for findings about noise. p are scaled so that all are significant
below `ALPHA`. Together that is 5 % and not 6.5, because later tests remove some; 1 % of clean runs was measured.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import sparse, special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.aliases import NOTHING_LEFT
from rig.fitter.trace.chance import DRAWS, Family
from rig.procedures.attitude.trace.problem import Problem
from rig.procedures.attitude.trace.replications import slow_of
from rig.procedures.attitude.trace.score import Scores, errors

AT_ONCE = 1_000
COUNTED_DRAWS = 10_000
STANDS_OUT = 3.3
"""Standard deviations at which correlated tests are counted."""


def family_of(problem: Problem, scores: Scores, seed: int) -> Family:
    """Simulate the family's smallest p under the null.

    Scores of one run have the correlations of their columns. They are drawn as normal, by sensor, with each level's own
    estimate of the error.
    """
    units, combined = _orthonormal_units(problem)
    if not units:
        return Family(np.ones(1))
    rng = np.random.default_rng(seed)
    roots = [_root(combined @ (combined @ one).T) for one in _products(problem)]
    groups = _alike(problem, units, scores)
    smallest = []
    for first in range(0, DRAWS, AT_ONCE):
        count = min(AT_ONCE, DRAWS - first)
        # selection of whole rows is much faster than of columns
        drawn = np.zeros((combined.shape[0], count), np.float32)
        for own, root in roots:
            drawn[own] += (rng.standard_normal((count, root.shape[0]), dtype=np.float32) @ root).T
        np.square(drawn, out=drawn)
        best = np.ones(count)
        estimated = {df: rng.chisquare(df, count) / df for df in {df for df, _ in groups}}
        for (df, rank), starts in groups.items():
            square = drawn[starts]
            for k in range(1, rank):
                square += drawn[starts + k]
            f = np.max(square, axis=0) / rank / estimated[df]
            best = np.minimum(best, special.fdtrc(rank, df, f))
        smallest.append(best)
    slow = slow_of(problem)
    given, sought = (_independent(problem, slow.columns[slow.searched == searched], rng) for searched in (False, True))
    return Family(np.sort(np.concatenate(smallest)), (max(given + len(slow.slips), 1.0), max(sought, 1.0)))


def _independent(problem: Problem, columns: IntArray, rng: np.random.Generator) -> float:
    """Number of independent tests with the same probability of a false positive as those of some columns.

    A coefficient is judged by its column between replications and within them, and correlations are those of both
    together.
    """
    if not columns.size:
        return 0.0
    weight, own = errors(problem, ()) ** -2.0, problem.own[..., columns]
    together = np.einsum("s,sjk->jk", weight, problem.products["points"].of(columns[:, None], columns))
    together += np.einsum("s,nslj,nslk->jk", weight, own, own, optimize=True)
    length = np.sqrt(np.diag(together))
    picked, root = _root(together / np.outer(length, length))
    out = 0
    for _ in range(COUNTED_DRAWS // AT_ONCE):
        drawn = rng.standard_normal((AT_ONCE, root.shape[0]), dtype=np.float32) @ root
        out += int(np.sum(np.max(np.abs(drawn, out=drawn), axis=1) > STANDS_OUT))
    alone = 2.0 * special.ndtr(-STANDS_OUT)
    return float(np.clip(out / COUNTED_DRAWS / alone, 1.0, picked.size))


def _alike(problem: Problem, units: list[tuple[int, int, int]], scores: Scores) -> dict[tuple[float, int], np.ndarray]:
    """First columns of units with the same degrees of freedom and number of columns, by both."""
    groups: dict[tuple[float, int], list[int]] = {}
    most = {
        level: max(float(scores.df[u]) for u, _, _ in units if problem.judged_at[problem.units[u][0]] == level)
        for level in {problem.judged_at[problem.units[u][0]] for u, _, _ in units}
    }
    for u, start, rank in units:
        groups.setdefault((most[problem.judged_at[problem.units[u][0]]], rank), []).append(start)
    return {key: np.array(starts) for key, starts in groups.items()}


def _products(problem: Problem) -> Iterator[FloatArray]:
    """(J, J) products of all columns in each sensor in turn, of each at its own level, over the error's variance."""
    weight = errors(problem, ()) ** -2.0
    points = np.array([level == "points" for level in problem.judged_at], np.bool_)
    for i, one in enumerate(weight):
        products = problem.products["replications"].of_all(i)
        np.copyto(products, problem.products["points"].of_all(i), where=points[:, None] | points)
        products *= one
        yield products


def _orthonormal_units(problem: Problem) -> tuple[list[tuple[int, int, int]], sparse.csr_array]:
    """Units that can be judged, as (unit, first column, columns), and how their columns are combined.

    Unit by unit, they are combined to ones that are orthonormal over all sensors together.

    Returns:
        The units, and (m, J) from the candidates to their m columns.
    """
    if not problem.units:
        return [], sparse.csr_array((0, 0))
    weight, pooled = errors(problem, ()) ** -2.0, np.zeros((len(problem.candidates),) * 2)
    for one in _products(problem):
        pooled += one
    length2 = np.sum(problem.length**2 * weight[:, None], axis=0)
    scale = 1.0 / np.sqrt(np.maximum(length2, np.finfo(float).tiny))
    pooled *= scale[:, None] * scale
    sizes, rank = np.array([len(unit) for unit in problem.units], np.int64), np.zeros(len(problem.units), np.int64)
    mixes = []
    for size in set(sizes.tolist()):
        same = np.flatnonzero(sizes == size)
        here = np.array([problem.units[u] for u in same], np.int64)
        values, vectors = np.linalg.eigh(pooled[here[:, :, None], here[:, None, :]])
        kept = values > NOTHING_LEFT**2
        rank[same] = kept.sum(axis=1)
        mixes.append(
            (same, here, scale[here][:, :, None] * vectors / np.sqrt(np.where(kept, values, 1.0))[:, None], kept)
        )
    first = np.cumsum(rank) - rank
    rows, across, shares = list[IntArray](), list[IntArray](), list[FloatArray]()
    for same, here, mix, kept in mixes:
        u, k = np.nonzero(kept)
        shares.append(mix[u, :, k].reshape(-1))
        rows.append(here[u].reshape(-1))
        across.append(np.repeat((first[same][:, None] + np.cumsum(kept, axis=1) - 1)[u, k], here.shape[1]))
    able = np.flatnonzero(rank)
    at = np.concatenate(across), np.concatenate(rows)
    combined = sparse.csr_array((np.concatenate(shares), at), shape=(int(rank.sum()), len(pooled)))
    return [(int(u), int(first[u]), int(rank[u])) for u in able], combined


def _root(products: FloatArray) -> tuple[np.ndarray, np.ndarray]:
    """Columns with a share of a sensor, and (r, q) root of their products, in single precision."""
    own = np.flatnonzero(np.diag(products) > 1e-9)
    values, vectors = np.linalg.eigh(products[np.ix_(own, own)])
    kept = values > 1e-6
    return own, (vectors[:, kept] * np.sqrt(values[kept])).T.astype(np.float32)
