"""Refinement of constants searched on a grid, between their neighbours on it."""

from __future__ import annotations

import numpy as np

from rig.fitter.least import least
from rig.fitter.linear import orthonormal
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.problem import Problem
from rig.fitter.trace.engine.term import Profile

SWEEPS = 2


def refined(judge: TableJudge, chosen: tuple[int, ...]) -> Problem:
    """The problem with the best searched constants of the `chosen` candidates, each with the others fixed."""
    problem, at = judge.problem, judge.beside(chosen).best
    y, terms = judge.white(at, chosen), {j: problem.candidates[j].term for j in chosen}
    for _ in range(SWEEPS):
        moved = False
        for j in chosen:
            profile = terms[j].profile
            if profile is None or profile.low >= profile.high:
                continue
            others = np.hstack([problem.declared, *(terms[k].columns for k in chosen if k != j)])
            basis = orthonormal(_white(problem, at, others))
            left = y - basis @ (basis.T @ y)

            def rss(value: float, profile: Profile = profile) -> float:
                own = _white(problem, at, profile.at(value).columns)
                units = orthonormal(own - basis @ (basis.T @ own), np.linalg.norm(own, axis=0), 1e-5)  # noqa: B023
                return -float(np.sum((units.T @ left) ** 2))  # noqa: B023

            best = least(rss, profile.low, profile.high, 1e-4 * (profile.high - profile.low))
            if best.value < rss(profile.value) - 1e-9 * float(left @ left):
                terms[j] = profile.at(best.x)
                moved = True
        if not moved:
            break
    changed = {j: term for j, term in terms.items() if term is not problem.candidates[j].term}
    return problem.with_terms(changed) if changed else problem


def _white(problem: Problem, at: int, columns):  # type: ignore[no-untyped-def]
    return problem.noise.whiten(np.array([at]), columns / problem.sd[:, None])[0]
