"""Whether the coefficients of the names found are constants: a right name predicts one part of the data from another.

The contribution of a name is multiplied by smooth functions of everything that was recorded, and of its own size.
Beside the model the residual follows such a product where the coefficient is larger at one end than at the other. With
a law that is right it does not. With one that only looks like the true law over the whole run it does, even where the
error of the law is too small to be seen as a shape of its own: these are few columns, at the place of the name.

A cause whose strength depends on something (a line that freezes in the cold, friction that grows with the load) may be
found as two: the nearest law with a constant coefficient, and another one that takes up how it changes. If the first
law times a smooth function of what was recorded does the work of the second, both names are doubtful.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from typing import NamedTuple

import numpy as np
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.aliases import DELTA, PER_COLUMN
from rig.fitter.trace.doubts import CHANGES, not_constant, one_that_changes
from rig.fitter.trace.flexible import NOTHING_LEFT, Block, waves

ENDS = 2
"""Number of half waves over a variable: larger at one end, larger in the middle."""
OWN_SIZE = "from where the effect is small to where it is large"


@dataclass(frozen=True)
class Change:
    """A variable with which a coefficient changes.

    Attributes:
        over: in words: "with the temperature".
        p: probability by chance, over all variables that were tried.

    """

    over: str
    p: float


class Instead(NamedTuple):
    """A residual without a name.

    Attributes:
        y: (m,) it.
        own: (m, q) columns of the name, beside the rest of the model.
        project: removes that from columns.
        variance: of the error beside all names.

    """

    y: FloatArray
    own: FloatArray
    project: Callable[[FloatArray], FloatArray]
    variance: float


class Coefficients(ABC):
    """Names found, and what each adds to the sensors."""

    @property
    @abstractmethod
    def names(self) -> Sequence[str]:
        """Names that are asked; () where there is no error to compare with."""

    @abstractmethod
    def blocks(self, name: str) -> Iterable[tuple[int | None, Block]]:
        """Contribution of a name to a sensor, or to all, times smooth functions of what was recorded."""

    @abstractmethod
    def p(self, name: str, i: int | None, block: Block) -> float | None:
        """P by chance of such products; None if nothing is left of them."""

    def together(self) -> Iterable[int | None]:
        """Sensors in which one name may stand for two; None for all at once."""
        return (None,)

    def products(self, name: str, i: int | None) -> Iterable[Block]:
        """The blocks of a name in one of these."""
        return (block for _, block in self.blocks(name))

    def shared(self, name: str, other: str, i: int | None) -> bool:
        """Whether both names are there."""
        return True

    def is_other(self, name: str, other: str, block: Block) -> bool:
        """Whether a name that changes so is another one by definition, as a group's offset over x is its gain."""
        return False

    @abstractmethod
    def instead(self, other: str, i: int | None) -> Instead:
        """The residual without a name there."""

    @cached_property
    def changes(self) -> dict[str, Change]:
        """The clearest change of the coefficient of each name, over all sensors that have it."""
        out = {}
        for name in self.names:
            found: dict[str, list[float]] = {}
            for i, block in self.blocks(name):
                if (p := self.p(name, i, block)) is not None:
                    found.setdefault(block.place, []).append(p)
            if (clearest := change(found)) is not None:
                out[name] = clearest
        return out

    @cached_property
    def exchanged(self) -> dict[str, str]:
        """Sentences about names of which one with a coefficient that changes does the work of both."""
        out = dict[str, str]()
        for i in self.together():

            def over(name: str, other: str, i: int | None = i) -> str | None:
                if not self.shared(name, other, i):
                    return None
                without = self.instead(other, i)
                blocks = (block for block in self.products(name, i) if not self.is_other(name, other, block))
                return stands_in(without.y, without.own, blocks, without.project, without.variance)

            out = exchanges([name for name in self.names if self.shared(name, name, i)], over) | out
        return out

    @property
    def doubts(self) -> dict[str, str]:
        """Reasons for doubt by name."""
        return {**self.exchanged, **changing(self.changes)}


def products(contribution: FloatArray, variables: Mapping[str, FloatArray]) -> list[Block]:
    """The contribution (n,) of a name times smooth columns (n, m) of each variable, by its words, and of its size."""
    every = {**variables, OWN_SIZE: waves(contribution, ENDS)}
    made = ((over, contribution[:, None] * smooth) for over, smooth in every.items() if smooth.shape[1])
    return [Block(over, own, (own.shape[1],), np.ones(own.shape[1])) for over, own in made]


def change(found: Mapping[str, Sequence[float]]) -> Change | None:
    """The clearest change, from the probabilities by chance of each variable in one sensor or in several.

    Those of several sensors are combined by Fisher's method: a cause that changes does so in all that show it.
    """
    if not found:
        return None
    every = {over: float(special.chdtrc(2 * len(ps), -2.0 * sum(map(_log, ps)))) for over, ps in found.items()}
    over = ties.least(every, key=lambda name: every[name])
    return Change(over, min(every[over] * len(every), 1.0))


def changing(found: Mapping[str, Change]) -> dict[str, str]:
    """Reasons for doubt about names whose coefficients are no constants, from the clearest change of each."""
    return {name: not_constant(one.over, one.p) for name, one in found.items() if one.p < CHANGES}


def _log(p: float) -> float:
    return float(np.log(max(p, np.finfo(float).tiny)))


def exchanges(names: Iterable[str], over: Callable[[str, str], str | None]) -> dict[str, str]:
    """Reasons for doubt about names of which one with a coefficient that changes does the work of both.

    Args:
        names: found in one place.
        over: the variable with which the coefficient of the first name would change instead of the second name.

    """
    out: dict[str, str] = {}
    for name, other in permutations(names, 2):
        variable = over(name, other)
        if variable is not None:
            out |= {one: one_that_changes(name, other, variable) for one in (name, other) if one not in out}
    return out


def stands_in(
    y: FloatArray,
    other: FloatArray,
    blocks: Iterable[Block],
    project: Callable[[FloatArray], FloatArray],
    variance: float,
) -> str | None:
    """The variable with which a coefficient would change, if that explains as much as another name; else None.

    Args:
        y: (n,) residual without the other name.
        other: (n, q) columns of the other name, beside the rest of the model.
        blocks: what the first name adds, times smooth functions of each variable.
        project: removes the rest of the model from columns (n, m).
        variance: of the error beside both names.

    """
    basis = orthonormal(other)
    least = float(np.sum((basis.T @ y) ** 2)) / variance - PER_COLUMN * basis.shape[1] - DELTA
    best, over = max(least, DELTA), None  # a weak name is as good as many by chance
    for block in blocks:
        for columns in (block.columns[:, :1], block.columns):
            own = orthonormal(project(columns), np.linalg.norm(columns, axis=0), NOTHING_LEFT)
            gain = float(np.sum((own.T @ y) ** 2)) / variance - PER_COLUMN * own.shape[1]
            if gain >= best:
                best, over = gain, block.place
    return over
