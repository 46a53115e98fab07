"""Criteria of model discrimination from the literature, for the points of a further run: peers of T-optimality.

Both judge a point by the difference of the rivals' predictions there (MIDDoE, Groves et al., has these two):

- Hunter and Reiner (Technometrics 7, 1965), HR: its square.
- Buzzi-Ferraris and Forzatti (Chem. Eng. Sci. 38, 1983), BFF: over the variance of that difference, with the models'
  own uncertainties after the points already chosen.

To their advantage the predictions are those of rivals refitted to all candidates, so that parameters of the further run
alone do not count as differences.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.confirm.points import Choice, Points


@dataclass(frozen=True, eq=False)
class _Ranked(Points, ABC):
    """Points taken one after the other by a criterion."""

    @abstractmethod
    def order(self, most: int) -> list[int]:
        """The first `most` units, the best first."""

    def choose(self, counts: Sequence[int], least: float) -> list[Choice]:
        """See `Points`: the same numbers of points, and the same rule for those that are too few."""
        if not self._seen.any():
            return []
        order = self.order(max((count for count in counts if count < self.count), default=0))
        found = []
        for count in counts:
            if count < self.count:
                chosen = np.zeros(self.count, np.bool_)
                chosen[order[:count]] = True
                found.append(Choice(self, chosen))
        return [choice for choice in found if choice.sigmas >= least]

    def exchanged(self, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """The same: the peers do not exchange points."""
        return chosen

    def differences(self) -> list[FloatArray]:
        """For each rival (T, U, m) what is left of the true predictions that it does not reproduce."""
        every, at, out = np.ones(self.count, np.bool_), 0, []
        for rival in self.rivals:
            left = rival.left(rival.refitted(every)[1], np.arange(self.count))
            out.append(left[self._seen[at : at + len(left)]])
            at += len(left)
        return out


class HunterReiner(_Ranked):
    """The largest sums of squared differences."""

    def order(self, most: int) -> list[int]:
        """See `_Ranked`."""
        worth = np.sum([np.sum(left**2, axis=(0, 2)) for left in self.differences()], axis=0)
        return list(np.argsort(-worth)[:most])


class BuzziFerrarisForzatti(_Ranked):
    """The largest sums of squared differences over their variance, the variance known after every point."""

    def order(self, most: int) -> list[int]:
        """See `_Ranked`."""
        chosen, taken, differences = np.zeros(self.count, np.bool_), [], self.differences()
        for _ in range(most):
            worth = np.zeros(self.count)
            for rival, left in zip(self.rivals, differences, strict=True):
                inverse = rival.refitted(chosen)[0]
                variance = np.einsum("ump,pq,umq->um", rival.later, inverse, rival.later, optimize=True)
                worth += np.sum((left**2 + 2.0) / (2.0 + 2.0 * variance), axis=(0, 2))
            worth[chosen] = -np.inf
            taken.append(int(np.argmax(worth)))
            chosen[taken[-1]] = True
        return taken
