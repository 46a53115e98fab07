"""What the best of all candidates scores when there is nothing to find.

The family is every candidate with every value of a constant that is searched. Its smallest p is simulated with normal
errors, whitened rows, under the covariance at hand; run at `fitter.trace.family.ALPHA`, so that 5 % hold over steps.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from fitter.arrays import FloatArray
from fitter.trace.family import Family
from fitter.trace.tables.problem import SPARED
from fitter.trace.tables.score import Blocks, View

WORK = 3e8
"""Multiplications a simulation may take."""
FEWEST, MOST = 600, 4000


def family_of(view: View, seed: int) -> Family:
    """Smallest p of all candidates beside the declared columns in runs with nothing but noise."""
    found = view.blocks(())
    n, df = len(view.y), len(view.y) - view.basis.shape[1]
    judged = (found.rank > 0) & (df - found.rank >= SPARED)
    if not np.any(judged):
        return Family(np.ones(1))
    draws = int(np.clip(WORK / max(found.units.size, 1), FEWEST, MOST))
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((n, draws), dtype=np.float32)
    basis = view.basis.astype(np.float32)
    noise -= basis @ (basis.T @ noise)
    rss = np.sum(noise**2, axis=0)
    gains = Blocks(found.units.astype(np.float32), found.start).gains(noise)
    smallest = np.ones(draws)
    for rank in np.unique(found.rank[judged]):
        best = np.minimum(gains[judged & (found.rank == rank)].max(axis=0), rss)
        smallest = np.minimum(smallest, _p(best, rss, int(rank), df))
    return Family(np.sort(smallest))


def _p(gain: FloatArray, rss: FloatArray, rank: int, df: int) -> FloatArray:
    after = np.maximum(rss - gain, np.finfo(float).tiny)
    return np.asarray(special.fdtrc(rank, df - rank, gain / rank / (after / (df - rank))))
