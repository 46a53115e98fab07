"""Whether the coefficients of the names found within whole plots are constants."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property, partial

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.constant import ENDS, Coefficients, Instead, products
from rig.fitter.trace.flexible import Block, remainders, waves
from rig.fitter.trace.limits import limit
from rig.procedures.pressure.effects.scene import PressureScene
from rig.procedures.pressure.trace.unmodelled import UnmodelledSmooth

LOOKED_AT = limit("asked again", "whole-plot")
OF_PLOTS = ("with the transducer's temperature", "with the electronics' temperature", "along the run")
"""Variables of whole plots: a coefficient that changes with them looks like a sensitivity that each plot draws anew."""


class Constant(Coefficients):
    """Names found within whole plots, and what they add to each transducer.

    Args:
        unmodelled: the run with its findings.

    """

    def __init__(self, unmodelled: UnmodelledSmooth) -> None:
        self.unmodelled = unmodelled
        problem = unmodelled.problem
        every = (j for j in unmodelled.chosen if problem.judged_at[j] == "subplot")
        self.inside = [j for j in every if not problem.candidates[j].effect.of_noise] if unmodelled.able else []

    @property
    def names(self) -> Sequence[str]:
        """See `Coefficients`."""
        return tuple(dict.fromkeys(self.unmodelled.candidates[j].effect.name for j in self.inside))

    def together(self) -> range:
        """See `Coefficients`: each transducer."""
        return range(len(self.unmodelled.problem.sensors))

    def blocks(self, name: str) -> Iterable[tuple[int, Block]]:
        """See `Coefficients`."""
        return ((i, block) for i in self.together() for block in self.products(name, i))

    def products(self, name: str, i: int | None) -> list[Block]:
        """See `Coefficients`."""
        mine = self._mine(name, i or 0)
        added = self.unmodelled.problem.raw[i or 0][:, mine] @ np.array([self._values[j] for j in mine])
        return products(added, self._variables) if np.any(added) else []

    def shared(self, name: str, other: str, i: int | None) -> bool:
        """See `Coefficients`."""
        return bool(self._mine(name, i or 0) and self._mine(other, i or 0))

    def instead(self, other: str, i: int | None) -> Instead:
        """See `Coefficients`."""
        run, theirs, at = self.unmodelled, self._mine(other, i or 0), i or 0
        rest = tuple(j for j in run.chosen if j not in theirs)
        view = run.white.view("subplot", rest, run.view("subplot").sigma)
        return Instead(view.outputs[at], view.of(theirs, [at]), partial(view.project, i=at), 1.0)

    def p(self, name: str, i: int | None, block: Block) -> float | None:
        """See `Coefficients`."""
        view, at = self.unmodelled.view("subplot"), i or 0
        left = remainders(view.outputs[at], int(view.df[at]), [block], partial(view.project, i=at))
        if not left:
            return None
        asked = left[0].p < LOOKED_AT and block.place in OF_PLOTS
        return max(left[0].p, self.unmodelled.among_slopes(at, left[0].basis)) if asked else left[0].p

    def _mine(self, name: str, i: int) -> list[int]:
        problem = self.unmodelled.problem
        own = ((j, problem.candidates[j]) for j in self.inside)
        return [j for j, c in own if c.effect.name == name and c.sensor in (None, problem.sensors[i])]

    @cached_property
    def _values(self) -> dict[int, float]:
        found = self.unmodelled.white.coefficients(self.unmodelled.chosen)
        return {j: one.value for j, one in found.items()}

    @cached_property
    def _variables(self) -> dict[str, FloatArray]:
        return _variables(self.unmodelled.scene)


def _variables(scene: PressureScene) -> dict[str, FloatArray]:
    data = scene.data
    side = data.pressure_side.astype(np.float64)[:, None]
    return {
        "with the pressure": waves(data.pressure_psia, ENDS),
        OF_PLOTS[0]: waves(np.round(data.sensor_temperature_degC), ENDS),
        OF_PLOTS[1]: waves(np.round(data.sse_temperature_degC), ENDS),
        OF_PLOTS[2]: waves(scene.hours, ENDS),
        "along each whole plot": waves(scene.since_h, ENDS),
        "with the side from which a pressure was reached": side if np.ptp(side) > 0 else side[:, :0],
    }
