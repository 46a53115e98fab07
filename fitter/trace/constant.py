"""Whether the coefficients of the names found are constants, in a run of any kind."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import NamedTuple

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.constancy import Change, change, changing
from rig.fitter.trace.exchange import exchanges, stands_in
from rig.fitter.trace.flexible import Block


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
                return stands_in(without.y, without.own, self.products(name, i), without.project, without.variance)

            out = exchanges([name for name in self.names if self.shared(name, name, i)], over) | out
        return out

    @property
    def doubts(self) -> dict[str, str]:
        """Reasons for doubt by name."""
        return {**self.exchanged, **changing(self.changes)}
