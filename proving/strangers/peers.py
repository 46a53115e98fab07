"""Methods that people use instead of a trace, on the same columns, each with one knob that sets its false alarms.

Stepwise selection by BIC, the lasso at one standard error, sequentially thresholded least squares, and a Gaussian
process that only says over which variable something lives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from proving.strangers.columns import Products, lasso_path, stepwise, thresholded
from proving.strangers.judge import Judged
from proving.strangers.rows import Rows
from proving.strangers.smooth import likelier

PENALTIES = np.geomspace(1.0, 0.05, 14)
"""Of the lasso, over the least one that keeps nothing."""


@dataclass(frozen=True)
class Peer:
    """A method.

    Attributes:
        limit: the knob from which on it keeps nothing of a table.
        kept: what it keeps at a knob below the limit: the names of each thing, any of which counts.
        usual: the knob as books have it.
        lives: whether it names variables and not effects.

    """

    limit: Callable[[Rows], float]
    kept: Callable[[Rows, float], list[frozenset[str]]]
    usual: float = 1.0
    lives: bool = False


def says(peer: Peer, rows: Rows, knob: float, hidden: Sequence[Judged]) -> str:
    """What a method is: "right" where all that it keeps is right, "wrong" where anything is not, else "silent"."""
    kept = peer.kept(rows, knob) if peer.limit(rows) > knob else []
    if not kept:
        return "silent"

    def right(names: frozenset[str]) -> bool:
        return any((one.lives(name) if peer.lives else one.names(name)) for one in hidden for name in names)

    return "right" if all(map(right, kept)) else "wrong"


def knobs(limits: Mapping[str, Sequence[float]], alarms: int) -> dict[str, float]:
    """Knob of each method at which it reports something in as many of some nulls as the trace did."""
    return {name: sorted(each, reverse=True)[min(alarms, len(each) - 1)] for name, each in limits.items()}


def _bic_limit(rows: Rows) -> float:
    """Penalty of a column, in units of ln n, from which on none comes in."""
    best = float(np.max((rows.columns.T @ rows.y) ** 2, initial=0.0)) / len(rows.y)
    square = float(rows.y @ rows.y)
    return len(rows.y) * float(np.log(square / max(square - best, 1e-12 * square))) / float(np.log(len(rows.y)))


def _bic_kept(rows: Rows, knob: float) -> list[frozenset[str]]:
    return [rows.names[j] for j in stepwise(Products.of(rows.columns, rows.y), price=knob)]


@lru_cache(maxsize=2)
def _folds(rows: Rows) -> list[tuple[Products, IntArray]]:
    """Products of what is left in, and the rows left out, for every fold."""
    whole = Products.of(rows.columns, rows.y)
    out = [np.flatnonzero(rows.fold == f) for f in np.unique(rows.fold)]
    return [(whole.without(rows.columns[aside], rows.y[aside]), aside) for aside in out]


def _one_se(rows: Rows, path: Callable[[Products], FloatArray]) -> int:
    """Index of the strictest setting whose error on folds left out is within one standard error of the least."""
    errors = []
    for inside, aside in _folds(rows):
        predicted = rows.columns[aside] @ path(inside).T
        errors.append(np.mean((rows.y[aside, None] - predicted) ** 2, axis=0))
    table = np.array(errors)
    mean, se = table.mean(axis=0), table.std(axis=0, ddof=1) / np.sqrt(len(table))
    least = int(np.argmin(mean))
    return int(np.flatnonzero(mean <= mean[least] + se[least]).min())


def _lasso_penalties(rows: Rows) -> FloatArray:
    return np.asarray(np.max(np.abs(rows.columns.T @ rows.y)) * PENALTIES)


@lru_cache(maxsize=2)
def _lasso_chosen(rows: Rows) -> float:
    penalties = _lasso_penalties(rows)
    share = penalties / len(rows.y)
    return float(penalties[_one_se(rows, lambda p: lasso_path(p, share * p.n))])


def _lasso_limit(rows: Rows) -> float:
    return float(_lasso_penalties(rows)[0] / _lasso_chosen(rows))


def _lasso_kept(rows: Rows, knob: float) -> list[frozenset[str]]:
    penalty = knob * _lasso_chosen(rows)
    every = _lasso_penalties(rows)
    path = lasso_path(Products.of(rows.columns, rows.y), np.array([*every[every > penalty], penalty]))
    return [rows.names[j] for j in np.flatnonzero(path[-1])]


def _stlsq_limit(rows: Rows) -> float:
    """Times the root of n, since columns and response are of unit rms; by bisection."""
    products = Products.of(rows.columns, rows.y)
    low, high = 0.0, 1.0
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.any(thresholded(products, middle)) else (low, middle)
    return high * float(np.sqrt(len(rows.y)))


def _stlsq_kept(rows: Rows, knob: float) -> list[frozenset[str]]:
    left = thresholded(Products.of(rows.columns, rows.y), knob / float(np.sqrt(len(rows.y))))
    return [rows.names[j] for j in np.flatnonzero(left)]


@lru_cache(maxsize=2)
def _smooth(rows: Rows) -> tuple[float, str]:
    """Nats by which the best smooth curve over one variable is likelier than none, and the variable."""
    each = [
        (likelier(values, rows.y[part]), name) for part, variables in rows.parts for name, values in variables.items()
    ]
    return max(each)


PEERS: dict[str, Peer] = {
    "stepwise, BIC": Peer(_bic_limit, _bic_kept),
    "lasso, one standard error": Peer(_lasso_limit, _lasso_kept),
    "STLSQ": Peer(_stlsq_limit, _stlsq_kept, usual=3.0),
    "Gaussian process, where": Peer(
        lambda rows: _smooth(rows)[0], lambda rows, _: [frozenset([_smooth(rows)[1]])], usual=3.0, lives=True
    ),
}
