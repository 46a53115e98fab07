"""Whether the coefficients of the names found in a table are constants."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.constant import ENDS, Coefficients, Instead, products
from rig.fitter.trace.flexible import Block, waves
from rig.fitter.trace.limits import limit
from rig.fitter.trace.search import names_of
from rig.procedures.general.trace.run import TableData
from rig.procedures.general.trace.unmodelled import UnmodelledSmooth

ASKED_AGAIN = limit("asked again", "general")
TO_A_LEVEL = 6
"""Rows in a level of a group, on average, from which on a coefficient is asked to be the same in all levels."""


class Constant(Coefficients):
    """Names found in a table."""

    def __init__(self, unmodelled: UnmodelledSmooth) -> None:
        self.unmodelled = unmodelled
        self.judge, self.chosen = unmodelled.judge, unmodelled.chosen

    @property
    def names(self) -> Sequence[str]:
        """See `Coefficients`."""
        return names_of(self.judge.candidates, self.chosen) if self.unmodelled.able else ()

    @cached_property
    def _variables(self) -> dict[str, FloatArray]:
        return _variables(self.unmodelled.data)

    def blocks(self, name: str) -> Iterable[tuple[None, Block]]:
        """See `Coefficients`."""
        return ((None, block) for block in products(self._added[name], self._variables))

    def p(self, name: str, i: int | None, block: Block) -> float | None:
        """See `Coefficients`; asked again under the slowest covariance that is plausible."""
        at, slow = self.unmodelled.at
        p = self.unmodelled.p_of(block, at)
        if p is not None and p * len(self._variables) * len(self.names) < ASKED_AGAIN and slow != at:
            return max(p, self.unmodelled.p_of(block, slow) or 0.0)
        return p

    def instead(self, other: str, i: int | None) -> Instead:
        """See `Coefficients`."""
        at, view = self.unmodelled.at[0], self.judge.view(self.unmodelled.at[0])
        left, theirs = self.unmodelled.left_under(at), self.unmodelled.of(other)
        variance = float(left @ left) / max(left.size - view.taken(self.chosen).shape[1], 1)
        taken = view.taken(tuple(j for j in self.chosen if j not in theirs))

        def project(columns: FloatArray) -> FloatArray:
            white = self.unmodelled.white(columns, at)
            return np.asarray(white - taken @ (taken.T @ white))

        y = self.judge.white(at, self.chosen)
        return Instead(y - taken @ (taken.T @ y), project(self.judge.problem.of(theirs)), project, variance)

    @cached_property
    def _added(self) -> dict[str, FloatArray]:
        """(n,) what each name adds to the response."""
        problem, at = self.judge.problem, self.unmodelled.at[0]
        model = self.unmodelled.white(problem.model(self.chosen), at)
        gamma = np.linalg.lstsq(model, self.judge.white(at, self.chosen), rcond=1e-10)[0]
        first, out = problem.declared.shape[1], dict[str, FloatArray]()
        for j in self.chosen:
            columns, name = self.judge.candidates[j].term.columns, self.judge.candidates[j].effect.name
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
