"""Changes that a person makes to a bench, and their influence on effects.

An effect declares in its catalogue entry what a change does to it (`Entry.manual_changes`). Two effects
that no setting of the bench separates are separated by a change that has different influences on them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Influence = Literal["removes", "resizes"]
"""It removes the effect, or gives it another size, which is unknown."""


@dataclass(frozen=True)
class Change:
    """A change that a person can make.

    Attributes:
        word: a short word for it, as recorded in runs.
        say: what the person has to do, one sentence without its full stop.
        anew: whether the declared model has parameters of its own after it.
    """

    word: str
    say: str
    anew: bool = True


@dataclass(frozen=True)
class ByHand:
    """Influence of a change on an effect; an effect without an entry for the change stays as it is.

    Attributes:
        change: the change.
        influence: on the effect.
    """

    change: Change
    influence: Influence


def removed_by(change: Change) -> ByHand:
    """The effect is absent after the change."""
    return ByHand(change, "removes")


def resized_by(change: Change) -> ByHand:
    """The effect has another size after the change, or is absent."""
    return ByHand(change, "resizes")


@dataclass(frozen=True, eq=False)
class Done:
    """A change that was made, or is planned, in a run of n observations.

    Attributes:
        word: of the change.
        after: (n,) whether an observation was made after it.
        anew: see `Change`.
    """

    word: str
    after: NDArray[np.bool_]
    anew: bool = True

    def at(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> Done:
        """This change among some of the observations."""
        return replace(self, after=self.after[rows])

    def among(self, start: int, count: int) -> Done:
        """This change among `count` observations of several runs, those of its own run from `start` on."""
        return replace(self, after=np.pad(self.after, (start, count - start - self.after.size)))
