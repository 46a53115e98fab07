"""Refinement of constants searched on a coarse grid, such as the time of a step, to the resolution of the data."""

from __future__ import annotations

import numpy as np

from fitter.trace.aliases import NOTHING_LEFT
from procedures.attitude.trace.problem import Candidate, Problem, raw_columns
from procedures.attitude.trace.score import errors, whiten


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
    tries = first.term.finer(problem.scene.data)
    sigma = errors(problem, (*others, *unit))
    left = whiten(problem, level, others, sigma).outputs
    taken = whiten(problem, level, (), sigma, others).columns
    gain = np.zeros(len(tries))
    for i, sensor in enumerate(problem.sensors):
        if first.sensor not in (None, sensor):
            continue
        raw = raw_columns(problem.scene, [Candidate(first.effect, terms[0], first.sensor) for terms in tries])[i]
        columns = problem.left(i, raw, level)
        if others:
            basis = np.linalg.qr(taken[i][:, np.any(taken[i] != 0, axis=0)])[0]
            columns = columns - basis @ (basis.T @ columns)
        norm2 = np.sum(columns**2, axis=0)
        enough = norm2 > NOTHING_LEFT * np.sum(raw**2, axis=0)
        gain += np.where(enough, (left[i] @ columns) ** 2 / np.where(enough, norm2, 1.0), 0.0)
    if not np.any(gain):
        return problem
    return problem.with_terms(u, tries[int(np.argmax(gain))])
