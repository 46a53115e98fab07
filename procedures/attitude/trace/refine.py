"""Refinement of constants searched on a coarse grid, such as the time of a step, to the resolution of the data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rig.fitter import ties
from rig.procedures.attitude.trace.problem import Candidate, Problem, columns_of
from rig.procedures.attitude.trace.score import errors, inverse
from rig.procedures.attitude.trace.view import View

FORBIDS = 2.0
"""Units of log likelihood by which the best value of a constant forbids one that is likelier beforehand."""


def refined(problem: Problem, chosen: tuple[int, ...]) -> Problem:
    """The problem with the most explanatory value of the searched constant of every unit among `chosen`."""
    for u in dict.fromkeys(problem.unit_of[j] for j in chosen):
        first = problem.candidates[problem.units[u][0]]
        if first.term.finer is not None:
            problem = _placed(problem, tuple(j for j in chosen if j not in problem.units[u]), u)
    return problem


def _placed(problem: Problem, others: tuple[int, ...], u: int) -> Problem:
    """Refine one unit's constant, with the `others` in the model."""
    unit = problem.units[u]
    first, level = problem.candidates[unit[0]], problem.judged_at[unit[0]]
    assert first.term.finer is not None
    # a unit may lack a part that these sensors do not show: an x sensor does not turn about its own axis
    parts = {problem.candidates[j].term.part for j in unit}
    tries = [[term for term in terms if term.part in parts] for terms in first.term.finer(problem.scene.data)]
    sigma = errors(problem, (*others, *unit))
    left = View(problem, level, others, sigma).outputs
    taken = problem.columns_at(level, others) / sigma[:, None, None]
    q = len(unit)
    gram, dot, length2 = np.zeros((len(tries), q, q)), np.zeros((len(tries), q)), np.zeros((len(tries), q))
    every = [Candidate(first.effect, term, first.sensor) for terms in tries for term in terms]
    for i, sensor in enumerate(problem.sensors):
        if first.sensor not in (None, sensor):
            continue
        raw = columns_of(problem.scene, every, sensor) / sigma[i]
        columns = problem.left(i, raw, level)
        if others:
            basis = np.linalg.qr(taken[i][:, np.any(taken[i] != 0, axis=0)])[0]
            columns = columns - basis @ (basis.T @ columns)
        each = columns.reshape(len(columns), len(tries), q)
        gram += np.einsum("ntj,ntk->tjk", each, each, optimize=True)
        dot += (left[i] @ columns).reshape(len(tries), q)
        length2 += np.sum(raw**2, axis=0).reshape(len(tries), q)
    gain = np.einsum("tj,tjk,tk->t", dot, inverse(gram, length2), dot)
    if not np.any(gain):
        return problem
    best = ties.highest(gain)
    likelier = [t for t, terms in enumerate(tries) if terms[0].likelier and gain[t] >= gain[best] - 2.0 * FORBIDS]
    if not likelier:
        return problem.with_terms(u, tries[best])
    # every replication has parameters of its own: what begins with one is not seen within it
    levels = tuple("replications" if j in unit else level for j, level in enumerate(problem.judged_at))
    return replace(problem.with_terms(u, tries[likelier[ties.highest(gain[likelier])]]), judged_at=levels)
