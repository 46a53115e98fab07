"""Whether the coefficients of the names found are constants."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property, partial
from itertools import permutations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.constant import ENDS, Coefficients, Instead, products
from rig.fitter.trace.doubts import two_sizes
from rig.fitter.trace.flexible import Block, turns, waves
from rig.fitter.trace.limits import limit
from rig.fitter.trace.search import names_of
from rig.procedures.attitude.effects import Scene
from rig.procedures.attitude.trace.estimate import estimate
from rig.procedures.attitude.trace.problem import raw_columns
from rig.procedures.attitude.trace.unmodelled import UnmodelledSmooth

WALKED = limit("asked again", "pitch-roll")
ALIKE = 0.999
"""Correlation of two columns beside the declared model from which one sensor does not tell them apart."""


def doubts_of(unmodelled: UnmodelledSmooth) -> dict[str, str]:
    """Reasons for doubt about the names found: of shapes without a name first, then of coefficients."""
    return {**new_doubts(unmodelled), **unmodelled.doubts}


def new_doubts(unmodelled: UnmodelledSmooth) -> dict[str, str]:
    """Of names that are one whose coefficient changes, and of coefficients that are no constants."""
    return {**_of_two_sizes(unmodelled), **Constant(unmodelled).doubts} if unmodelled.able else {}


def _of_two_sizes(unmodelled: UnmodelledSmooth) -> dict[str, str]:
    """Of names of one size for all sensors, each with one that has the same shape in one sensor alone."""
    problem, out = unmodelled.problem, dict[str, str]()
    for j, k in permutations(unmodelled.chosen, 2):
        wide, own = problem.candidates[j], problem.candidates[k]
        if wide.sensor is None and own.sensor is not None:
            found = problem.products[unmodelled.level_of(wide.effect.name)]
            both, one, other = found.of([j, j, k], [k, j, k])[problem.sensors.index(own.sensor)]
            if both**2 > ALIKE**2 * one * other > 0.0:
                names = (wide.effect.name, own.effect.name)
                out |= dict.fromkeys(names, two_sizes(names, own.sensor))
    return out


class Constant(Coefficients):
    """Names found in a run."""

    def __init__(self, unmodelled: UnmodelledSmooth) -> None:
        self.unmodelled = unmodelled

    @property
    def names(self) -> Sequence[str]:
        """See `Coefficients`."""
        return tuple(self._added)

    @cached_property
    def _added(self) -> dict[str, FloatArray]:
        """(S, n) what each name found adds to the sensors, V."""
        problem, chosen = self.unmodelled.problem, self.unmodelled.chosen
        gamma, out = estimate(problem, chosen).gamma, dict[str, FloatArray]()
        for name in names_of(problem.candidates, chosen):
            mine = [k for k, j in enumerate(chosen) if problem.candidates[j].effect.name == name]
            out[name] = raw_columns(problem.scene, [problem.candidates[chosen[k]] for k in mine]) @ gamma[mine]
        return out

    def blocks(self, name: str) -> Iterable[tuple[int | None, Block]]:
        """See `Coefficients`; of a cause of all sensors with one coefficient for all."""
        common = any(self.unmodelled.candidates[j].sensor is None for j in self.unmodelled.of(name))
        return ((None, block) for block in self.products(name, None)) if common else self._each(name)

    def _each(self, name: str) -> Iterable[tuple[int, Block]]:
        scene = self.unmodelled.problem.scene
        for i, own in enumerate(self._added[name]):
            if np.any(own):
                yield from ((i, block) for block in products(own, _variables(scene, scene.data.sensors[i])))

    def products(self, name: str, i: int | None) -> Iterable[Block]:
        """See `Coefficients`: (S n, m)."""
        by: dict[str, FloatArray] = {}
        for sensor, block in self._each(name):
            whole = by.setdefault(block.place, np.zeros((self._added[name].size, block.columns.shape[1])))
            width = min(whole.shape[1], block.columns.shape[1])
            whole[self.unmodelled.rows(sensor), :width] = block.columns[:, :width]
        return [Block(over, own, (own.shape[1],), np.ones(own.shape[1])) for over, own in by.items()]

    def shared(self, name: str, other: str, i: int | None) -> bool:
        """See `Coefficients`: in a sensor that both concern."""
        return bool(np.any(np.any(self._added[name], axis=1) & np.any(self._added[other], axis=1)))

    def instead(self, other: str, i: int | None) -> Instead:
        """See `Coefficients`."""
        view, mine = self.unmodelled.without_in_view((other,), self.unmodelled.level_of(other))
        return Instead(view.outputs.reshape(-1), view.of(mine), partial(view.project, sensor=None), 1.0)

    def p(self, name: str, i: int | None, block: Block) -> float | None:
        """See `Coefficients`."""
        run, level = self.unmodelled, self.unmodelled.level_of(name)
        left = run.seen_at(level, i).remainder(block)
        if left is None or left.p >= WALKED:
            return None if left is None else left.p
        return max(left.p, run.against_a_walk(level, i, left.basis))


def _variables(scene: Scene, sensor: str) -> dict[str, FloatArray]:
    data, index = scene.data, scene.data.replicate_index
    found = {
        "with the pitch angle": waves(data.pitch_deg, ENDS),
        "with gravity along the sensor": waves(scene.along(sensor), ENDS),
        "along the run": waves(data.elapsed_s, ENDS),
        "from one replication to the next": (index[:, None] == np.arange(1, index.max() + 1)).astype(np.float64),
    }
    sides = [("pitch", data.pitch_side)]
    if scene.roll:
        found["with the roll angle"] = turns(data.roll_deg, 1)
        sides.append(("roll", data.roll_side))
    if data.sensor_temperature_degC is not None:
        found["with the temperature"] = waves(data.sensor_temperature_degC, ENDS)
    for axis, side in sides:
        if np.ptp(side) > 0:
            found[f"with the side from which {axis} was approached"] = side.astype(np.float64)[:, None]
    return found
