"""Models of a table: the declared columns and some candidates, whitened by every covariance, each made from another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.engine.likelihood import Grid, Likelihoods
from rig.fitter.trace.engine.problem import Problem

KEPT = 6
"""Models that are kept."""

Key = tuple[int, ...]
"""Candidates of a model, ascending."""


@dataclass(frozen=True, eq=False)
class Models:
    """Models of one problem.

    Attributes:
        problem: the table.
        known: products of each model with a response (n,), the order of its candidates in them, and that response.
    """

    problem: Problem
    known: dict[Key, tuple[Grid, Key, FloatArray]] = field(default_factory=dict)

    def grid(self, key: Key, y: FloatArray) -> Grid:
        """Products of a model with a response (n,).

        Made from the largest part of the model that is known. The latest ones are kept, and the declared columns alone.
        """
        sd = self.problem.sd
        if not self.known:
            declared = self.problem.declared / sd[:, None]
            self.known[()] = Grid.of(self.problem.noise, y / sd, declared), (), y
        if key not in self.known:
            part = max((known for known in self.known if set(known) < set(key)), key=len)
            (grid, order, of), new = self.known[part], tuple(j for j in key if j not in part)
            grid = grid.with_columns(self.problem.of(new) / sd[:, None])
            self.known[key] = self._of_response(grid, of, y), (*order, *new), y
            if len(self.known) > KEPT:
                del self.known[next(known for known in self.known if known)]
        grid, _, of = self.known[key]
        return self._of_response(grid, of, y)

    def with_one(self, key: Key, j: int, y: FloatArray, usual: FloatArray) -> tuple[Likelihoods, Likelihoods]:
        """Likelihoods of a model, and of that with one candidate more, of a response (n,).

        If the model is not known yet, it is kept with its `usual` response (n,).
        """
        whole = tuple(sorted((*key, j)))
        without = self.without(whole, (j,), y) if whole in self.known else None
        if without is not None:
            return without, self.grid(whole, y).beside()
        self.grid(key, usual)
        grid = self.grid(key, y)
        return grid.beside(), grid.beside(self.problem.of((j,)) / self.problem.sd[:, None])

    def without(self, key: Key, taken: Sequence[int], y: FloatArray) -> Likelihoods | None:
        """Likelihoods of a known model without some of its candidates; None if its columns depend on each other."""
        order, width = self.known[key][1], np.diff(self.problem.start)
        ends = self.problem.declared.shape[1] + np.cumsum([0, *(width[k] for k in order)])
        some = [np.arange(*ends[i : i + 2]) for i, k in enumerate(order) if k in taken]
        return self.grid(key, y).without(np.concatenate(some))

    def _of_response(self, grid: Grid, of: FloatArray, y: FloatArray) -> Grid:
        return grid if np.array_equal(y, of) else grid.of_response(y / self.problem.sd)
