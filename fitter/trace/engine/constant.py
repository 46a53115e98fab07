"""Whether the coefficients of the names found in sensors are constants."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.constant import Coefficients, Instead, products
from rig.fitter.trace.engine.unmodelled import InSensor
from rig.fitter.trace.flexible import Block
from rig.fitter.trace.limits import limit


class Constant(Coefficients):
    """Names found, and what they add to each sensor; of names that are judged at levels, those within groups.

    Args:
        sensors: of the run, each with its findings.
        variables: (n, m) smooth functions of what was recorded, by what a coefficient would change with, in words.
        of_groups: those with which the coefficient of each group changes: that looks like one that is drawn anew.

    """

    def __init__(
        self,
        sensors: Sequence[InSensor],
        variables: Mapping[str, FloatArray],
        of_groups: Iterable[str] = (),
    ) -> None:
        self.sensors, self.variables, self.of_groups = sensors, variables, frozenset(of_groups)
        self.level = sensors[0].levels[-1]
        self.again = limit("asked again", sensors[0].kind)

    @cached_property
    def names(self) -> Sequence[str]:
        """See `Coefficients`."""
        every = (name for one in self.sensors if one.able for name in one.names_at(self.level))
        return tuple(dict.fromkeys(every))

    def together(self) -> Iterable[int]:
        """See `Coefficients`: each sensor."""
        return range(len(self.sensors))

    def blocks(self, name: str) -> Iterable[tuple[int, Block]]:
        """See `Coefficients`."""
        return ((i, block) for i in self.together() for block in self.products(name, i))

    def products(self, name: str, i: int | None) -> list[Block]:
        """See `Coefficients`."""
        added = self._added[i or 0].get(name)
        return [] if added is None or not np.any(added) else products(added, self.variables)

    def shared(self, name: str, other: str, i: int | None) -> bool:
        """See `Coefficients`."""
        return name in self._added[i or 0] and other in self._added[i or 0]

    def is_other(self, name: str, other: str, block: Block) -> bool:
        """See `Coefficients`: the columns of one are those of the other and the variable."""
        one = self.sensors[0]
        mine, others = ({c for j in one.of(n) for c in one.candidates[j].effect.columns} for n in (name, other))
        return (mine < others or others < mine) and block.place in {f"with {column}" for column in mine ^ others}

    def p(self, name: str, i: int | None, block: Block) -> float | None:
        """See `Coefficients`; asked again beside the slowest error that is plausible."""
        one = self.sensors[i or 0]
        found = one.seen_at(self.level).remainder(block)
        if found is None or found.p * len(self.variables) * len(self.names) >= self.again:
            return None if found is None else found.p
        if self.level:
            return max(found.p, one.among_slopes(found.basis) if block.place in self.of_groups else 0.0)
        at, slow = one.at
        return found.p if at == slow else max(found.p, one.p_of(block, slow) or 0.0)

    def instead(self, other: str, i: int | None) -> Instead:
        """See `Coefficients`."""
        one = self.sensors[i or 0]
        y, project = one.beside(tuple(j for j in one.chosen if j not in one.of(other)), self.level)
        return Instead(y, project(one.columns_of(other, self.level)), project, 1.0)

    @cached_property
    def _added(self) -> list[dict[str, FloatArray]]:
        """(n,) what each name adds to each sensor."""
        return [self._added_to(one) for one in self.sensors]

    def _added_to(self, one: InSensor) -> dict[str, FloatArray]:
        problem, at = one.judge.problem, one.at[0]
        model = one.white(problem.model(one.chosen), at)
        gamma = np.linalg.lstsq(model, one.judge.white(at, one.chosen), rcond=1e-10)[0]
        first, out = problem.declared.shape[1], dict[str, FloatArray]()
        for j in one.chosen:
            columns, name = one.candidates[j].term.columns, one.candidates[j].effect.name
            own = columns @ gamma[first : first + columns.shape[1]]
            first += columns.shape[1]
            if one.level_of(j) == self.level and name in self.names:
                out[name] = out.get(name, 0.0) + own
        return out
