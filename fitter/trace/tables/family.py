"""What the best of all candidates scores when there is nothing to find.

The family is every candidate with every value of a constant that is searched. Its smallest p is simulated with normal
errors, whitened rows, under the covariance at hand; run at `fitter.trace.family.ALPHA`, so that 5 % hold over steps.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from fitter.arrays import FloatArray
from fitter.trace.family import Family
from fitter.trace.tables.problem import SPARED
from fitter.trace.tables.score import FEWEST_FOR_SCATTER, Blocks, View

Single = NDArray[np.float32]

WORK = 2e8
"""Multiplications a simulation may take."""
FEWEST, MOST = 500, 4000
_TINY = np.finfo(np.float32).tiny


def family_of(view: View, handicap: FloatArray, seed: int) -> Family:
    """Smallest p of all candidates beside the declared columns in runs with nothing but noise.

    Args:
        view: the table whitened.
        handicap: (J,) that each candidate's p is multiplied by before they are compared.
        seed: of the draws.

    """
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
    ratio = _ratios(Blocks(found.units.astype(np.float32), found.start), noise, df)
    smallest = np.ones(draws)
    for rank, times in {(int(r), float(h)) for r, h in zip(found.rank[judged], handicap[judged], strict=True)}:
        alike = judged & (found.rank == rank) & (handicap == times)
        best = ratio[alike].max(axis=0).astype(np.float64)
        smallest = np.minimum(smallest, times * special.fdtrc(rank, df - rank, best))
    return Family(np.sort(smallest))


def _ratios(found: Blocks, noise: Single, df: int) -> Single:
    """(J, draws) F of every candidate in every draw, over what single rows say if that is more, as `score` has it."""
    rank = np.maximum(found.rank, 1)[:, None].astype(np.float32)
    gains = found.gains(noise)
    variance = np.maximum(np.sum(noise**2, axis=0) - gains, _TINY) / np.maximum(df - rank, 1)
    ratio: Single = np.asarray(gains / rank / variance)
    if len(noise) < FEWEST_FOR_SCATTER:
        return ratio
    dots, squares = found.units.T @ noise, found.squares
    own = squares.T @ noise**2
    own -= 2.0 * dots * ((squares * found.units).T @ noise)
    own += dots**2 * np.sum(squares**2, axis=0)[:, None]
    return np.asarray(ratio / np.maximum(found.sums(own) / rank / variance, 1.0))
