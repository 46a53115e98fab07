"""Whether the coefficients of the names found within whole plots are constants."""

from __future__ import annotations

from functools import cached_property, partial

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.constancy import ENDS, Change, change, changing, products
from rig.fitter.trace.exchange import exchanges, stands_in
from rig.fitter.trace.flexible import Block, remainders, waves
from rig.procedures.pressure.effects.scene import PressureScene
from rig.procedures.pressure.trace.unmodelled import LOOKED_AT, UnmodelledSmooth

OF_PLOTS = ("with the transducer's temperature", "with the electronics' temperature", "along the run")
"""Variables of whole plots: a coefficient that changes with them looks like a sensitivity that each plot draws anew."""


class Constant:
    """Names found within whole plots, and what they add to each transducer.

    Args:
        unmodelled: the run with its findings.

    """

    def __init__(self, unmodelled: UnmodelledSmooth) -> None:
        self.unmodelled = unmodelled
        problem = unmodelled.problem
        every = (j for j in unmodelled.chosen if problem.judged_at[j] == "subplot")
        self.inside = [j for j in every if not problem.candidates[j].effect.of_noise] if unmodelled.able else []

    @cached_property
    def doubts(self) -> dict[str, str]:
        """Reasons for doubt by name."""
        return {**self._exchanged(), **changing(self.changes)}

    @cached_property
    def changes(self) -> dict[str, Change]:
        """The clearest change of the coefficient of each name, over all transducers that have it."""
        problem, view = self.unmodelled.problem, self.unmodelled.view("subplot")
        out = {}
        for name in self._names(range(len(problem.sensors))):
            found: dict[str, list[float]] = {}
            for i in range(len(problem.sensors)):
                for block in self._blocks(name, i):
                    for one in remainders(view.outputs[i], int(view.df[i]), [block], partial(view.project, i=i)):
                        p = one.p
                        if p < LOOKED_AT and block.place in OF_PLOTS:
                            p = max(p, self.unmodelled.among_slopes(i, one.basis))
                        found.setdefault(block.place, []).append(p)
            clearest = change(found)
            if clearest is not None:
                out[name] = clearest
        return out

    def _exchanged(self) -> dict[str, str]:
        """Names of which one with a coefficient that changes does the work of both."""
        problem, out = self.unmodelled.problem, dict[str, str]()
        sigma = self.unmodelled.view("subplot").sigma
        for i in range(len(problem.sensors)):

            def over(name: str, other: str, i: int = i) -> str | None:
                theirs = self._mine(other, i)
                rest = tuple(j for j in self.unmodelled.chosen if j not in theirs)
                view = self.unmodelled.white.view("subplot", rest, sigma)
                own, blocks = view.of(theirs, [i]), self._blocks(name, i)
                return stands_in(view.outputs[i], own, blocks, partial(view.project, i=i), 1.0)

            out = exchanges(self._names([i]), over) | out
        return out

    def _names(self, sensors: range | list[int]) -> list[str]:
        """Names found in some transducers."""
        found = dict.fromkeys(self.unmodelled.problem.candidates[j].effect.name for j in self.inside)
        return [name for name in found if any(self._mine(name, i) for i in sensors)]

    def _mine(self, name: str, i: int) -> list[int]:
        problem = self.unmodelled.problem
        own = ((j, problem.candidates[j]) for j in self.inside)
        return [j for j, c in own if c.effect.name == name and c.sensor in (None, problem.sensors[i])]

    def _blocks(self, name: str, i: int) -> list[Block]:
        """The contribution of a name to a transducer, times each variable."""
        mine = self._mine(name, i)
        added = self.unmodelled.problem.raw[i][:, mine] @ np.array([self._values[j] for j in mine])
        return products(added, self._variables) if np.any(added) else []

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
