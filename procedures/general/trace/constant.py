"""Whether the coefficients of the names found in a table are constants."""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.constancy import ENDS, Change, change, products
from rig.fitter.trace.exchange import exchanges, stands_in
from rig.fitter.trace.flexible import waves
from rig.fitter.trace.search import names_of
from rig.procedures.general.trace.run import TableData
from rig.procedures.general.trace.unmodelled import ASKED_AGAIN, UnmodelledSmooth

TO_A_LEVEL = 6
"""Rows in a level of a group, on average, from which on a coefficient is asked to be the same in all levels."""


def changes(unmodelled: UnmodelledSmooth) -> dict[str, Change]:
    """The clearest change of the coefficient of each name found."""
    judge, chosen = unmodelled.judge, unmodelled.chosen
    if not unmodelled.able or not chosen:
        return {}
    beside = judge.beside(chosen)
    at, slow = beside.best, beside.slowest_of(np.ones(len(beside.reml), np.bool_))
    variables, added = _variables(unmodelled.data), _added(unmodelled, at)
    tested = len(names_of(judge.candidates, chosen))
    out = {}
    for name, own in added.items():
        found: dict[str, list[float]] = {}
        for block in products(own, variables):
            p = unmodelled.p_of(block, at)
            if p is not None and p * len(variables) * tested < ASKED_AGAIN and slow != at:
                p = max(p, unmodelled.p_of(block, slow) or 0.0)
            if p is not None:
                found[block.place] = [p]
        clearest = change(found)
        if clearest is not None:
            out[name] = clearest
    return out


def exchanged(unmodelled: UnmodelledSmooth) -> dict[str, str]:
    """A sentence for each of two names of which one with a coefficient that changes does the work of both."""
    judge, chosen = unmodelled.judge, unmodelled.chosen
    names = names_of(judge.candidates, chosen)
    if not unmodelled.able or len(names) < 2:
        return {}
    at = judge.beside(chosen).best
    view, left = judge.view(at), unmodelled.left_under(at)
    variance = float(left @ left) / max(left.size - view.taken(chosen).shape[1], 1)
    variables, added = _variables(unmodelled.data), _added(unmodelled, at)

    def over(name: str, other: str) -> str | None:
        theirs = [j for j in chosen if judge.candidates[j].effect.name == other]
        taken = view.taken(tuple(j for j in chosen if j not in theirs))

        def project(columns: FloatArray) -> FloatArray:
            white = unmodelled.white(columns, at)
            return np.asarray(white - taken @ (taken.T @ white))

        y = judge.white(at, chosen)
        own = project(judge.problem.of(theirs))
        return stands_in(y - taken @ (taken.T @ y), own, products(added[name], variables), project, variance)

    return exchanges(names, over)


def _added(unmodelled: UnmodelledSmooth, at: int) -> dict[str, FloatArray]:
    """(n,) what each name adds to the response."""
    judge, chosen = unmodelled.judge, unmodelled.chosen
    problem = judge.problem
    model = unmodelled.white(problem.model(chosen), at)
    gamma = np.linalg.lstsq(model, judge.white(at, chosen), rcond=1e-10)[0]
    first, out = problem.declared.shape[1], dict[str, FloatArray]()
    for j in chosen:
        columns, name = judge.candidates[j].term.columns, judge.candidates[j].effect.name
        own = columns @ gamma[first : first + columns.shape[1]]
        out[name], first = out.get(name, 0.0) + own, first + columns.shape[1]
    return out


def _variables(data: TableData) -> dict[str, FloatArray]:
    scene, n = data.scene, len(data.y)
    found = {f"with {name}": waves(v, ENDS) for name, v in scene.variables.items()}
    if scene.time is not None:
        found[f"with {scene.time.name}"] = waves(scene.time.values, ENDS)
    if scene.direction is not None:
        found[f"with {scene.direction[0]}"] = np.asarray(scene.direction[1], np.float64)[:, None]
    for name, group in {**scene.groups, **scene.labels}.items():
        if 1 < len(group.levels) <= n // TO_A_LEVEL:
            found[f"with {name}"] = group.indicators[:, 1:]
    if data.shared is not None and 0 < (most := int(data.shared.max())) < n // TO_A_LEVEL:
        found["from one group of rows with a common error to the next"] = (
            data.shared[:, None] == np.arange(1, most + 1)
        ).astype(np.float64)
    return found
