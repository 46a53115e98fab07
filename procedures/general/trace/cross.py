"""The error of rows left out of search and fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.steps import steps
from rig.fitter.trace.engine.components import Components
from rig.fitter.trace.engine.family import TableFamily
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.noise import Wandering
from rig.fitter.trace.engine.problem import Candidate, Problem
from rig.fitter.trace.engine.refine import refined
from rig.fitter.trace.engine.rivalry import Rivalry
from rig.fitter.trace.engine.shared import Shared
from rig.fitter.trace.search import search_and_name
from rig.procedures.general.effects.time_columns import of_start
from rig.procedures.general.trace.estimate import estimate

SMALL, FOLDS, BLOCKS, SEED = 12, 5, 20, 5
LONG, OF_LONG = 1000, 3
"""Rows from which on there are so many folds: what is kept then has far more rows than a model has terms. Names are
those of the whole table then, and sizes and constants alone are estimated anew: what a name gains by being looked for
is less than a hundredth of the error.
"""
SHARING = "groups with an error in common"
"""Groups left out in turn: whole plots, or replications."""
FEWEST_SPARE = 3
_SEARCH = 0.4
"""About the part of the time that the search takes before them."""
FAR = 3.0
"""Ratio to the largest in kept rows, above which they do not determine what a session remembers of its start."""


def left_out(
    problem: Problem, judge: TableJudge, chosen: tuple[int, ...], apart: IntArray
) -> tuple[tuple[float, float], str, int] | None:
    """Rms error before and after of rows left out of search and fit, the groups of left-out rows, and rows not counted.

    Rows whose memory of what stood before a session no other row determines are not predicted, and not counted.

    Args:
        problem: the table before the refinement of searched constants.
        judge: the judge at the end of the search; its noise, weights and simulated families are used again.
        chosen: its findings.
        apart: (m,) gross errors with a column of their own: they are never left out, nor counted.

    Returns:
        None if too few rows would remain.
    """
    at = judge.beside(chosen).best
    fold, words = _folds(problem, at)
    fold[apart] = -1
    held = problem.given(sd=judge.problem.sd, noise=judge.problem.noise.only(at))
    families = dict[tuple[int, Rivalry], TableFamily]()
    if searched := len(chosen) > 0 and problem.n < LONG:
        slow = judge.problem.noise.slow
        families[0, "any"] = judge.family(at, "fast" if np.any(slow) and not slow[at] else "any")
    else:
        problem, held = problem.only(chosen), held.only(chosen)
    errors, counted = np.zeros((2, problem.n)), fold >= 0
    counts = judge.held(chosen)  # an isolated row counts as three sd here, too
    folds = int(fold.max()) + 1
    for one in steps(range(folds), lambda one: f"rows left out, {one + 1} of {folds}", after=_SEARCH):
        kept, out = np.flatnonzero(fold != one), np.flatnonzero(fold == one)
        if len(kept) - orthonormal(problem.declared[kept]).shape[1] < FEWEST_SPARE:
            return None
        own = TableJudge(held.rows(kept), families)
        found = search_and_name(own, lead=own.lead)[1] if searched else tuple(range(len(chosen)))
        fitted = refined(own, found).only(found)
        whole = tuple(_whole(problem.candidates[j], c) for j, c in zip(found, fitted.candidates, strict=True))
        moved, last = replace(problem, candidates=whole), TableJudge(fitted)
        for i, terms in enumerate(((), tuple(range(len(found))))):
            errors[i, out] = counts[out] - moved.model(terms)[out] @ estimate(last, terms).coefficients
        counted[out] = ~_undetermined(moved, kept)[out]
    if not np.any(counted):
        return None
    before, after = np.sqrt(np.mean(errors[:, counted] ** 2, axis=1)).tolist()
    return (before, after), words, int(np.sum(~counted[fold >= 0]))


def _undetermined(problem: Problem, kept: IntArray) -> NDArray[np.bool_]:
    """(n,) rows in which what a later session remembered of its start is far more than in any kept row."""
    far = np.zeros(problem.n, np.bool_)
    for term in (candidate.term for candidate in problem.candidates):
        for label, column in zip(term.labels, term.columns.T, strict=True):
            if of_start(label):
                far |= np.abs(column) > FAR * np.abs(column[kept]).max()
    return far


def _whole(candidate: Candidate, part: Candidate) -> Candidate:
    """A candidate for all rows, with the constant estimated from a part of them."""
    own, fitted = candidate.term.profile, part.term.profile
    return candidate if own is None or fitted is None else replace(candidate, term=own.at(fitted.value))


def _folds(problem: Problem, at: int) -> tuple[IntArray, str]:
    """(n,) groups of rows left out together, and their name."""
    n, rng = problem.n, np.random.default_rng(SEED)
    if isinstance(problem.noise, Shared | Components):
        group = problem.noise.group
        count = int(group.max()) + 1
        dealt = rng.permutation(np.arange(count) % min(count, 2 * FOLDS))
        return dealt[group].astype(np.int64), SHARING
    if n <= SMALL:
        return np.arange(n), "single rows"
    folds = OF_LONG if n >= LONG else FOLDS if n > 60 else 2 * FOLDS
    if isinstance(problem.noise, Wandering) and at > 0:
        block = np.arange(n) * BLOCKS // n
        return (block % min(folds, FOLDS)).astype(np.int64), "stretches of time"
    return rng.permutation(np.arange(n) % folds).astype(np.int64), "random rows"
