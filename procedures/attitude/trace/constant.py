"""Whether the coefficients of the names found are constants."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import permutations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.constancy import ENDS, Change, change, changing, products
from rig.fitter.trace.doubts import two_sizes
from rig.fitter.trace.exchange import exchanges, stands_in
from rig.fitter.trace.flexible import Block, remainders, turns, waves
from rig.fitter.trace.search import names_of
from rig.procedures.attitude.effects import Scene
from rig.procedures.attitude.trace.estimate import estimate
from rig.procedures.attitude.trace.problem import raw_columns
from rig.procedures.attitude.trace.unmodelled import WALKED, UnmodelledSmooth

ALIKE = 0.999
"""Correlation of two columns beside the declared model from which one sensor does not tell them apart."""


def doubts_of(unmodelled: UnmodelledSmooth) -> dict[str, str]:
    """Reasons for doubt about the names found: of shapes without a name first, then of coefficients."""
    return {**new_doubts(unmodelled), **unmodelled.doubts}


def new_doubts(unmodelled: UnmodelledSmooth) -> dict[str, str]:
    """Of names that are one whose coefficient changes, and of coefficients that are no constants."""
    if not unmodelled.able or not unmodelled.chosen:
        return {}
    added = _added(unmodelled)
    found = changes(unmodelled, added)
    return {**_of_two_sizes(unmodelled), **_exchanged(unmodelled, added), **changing(found)}


def _of_two_sizes(unmodelled: UnmodelledSmooth) -> dict[str, str]:
    """Of names of one size for all sensors, each with one that has the same shape in one sensor alone."""
    problem, out = unmodelled.problem, dict[str, str]()
    for j, k in permutations(unmodelled.chosen, 2):
        wide, own = problem.candidates[j], problem.candidates[k]
        if wide.sensor is None and own.sensor is not None:
            products = problem.products[unmodelled.level_of(wide.effect.name)]
            both, one, other = products.of([j, j, k], [k, j, k])[problem.sensors.index(own.sensor)]
            if both**2 > ALIKE**2 * one * other > 0.0:
                names = (wide.effect.name, own.effect.name)
                out |= dict.fromkeys(names, two_sizes(names, own.sensor))
    return out


def _added(unmodelled: UnmodelledSmooth) -> dict[str, FloatArray]:
    """(S, n) what each name found adds to the sensors, V."""
    problem, chosen = unmodelled.problem, unmodelled.chosen
    gamma, out = estimate(problem, chosen).gamma, dict[str, FloatArray]()
    for name in names_of(problem.candidates, chosen):
        mine = [k for k, j in enumerate(chosen) if problem.candidates[j].effect.name == name]
        out[name] = raw_columns(problem.scene, [problem.candidates[chosen[k]] for k in mine]) @ gamma[mine]
    return out


def changes(unmodelled: UnmodelledSmooth, added: Mapping[str, FloatArray]) -> dict[str, Change]:
    """The clearest change of the coefficient of each name found, over all sensors that have it.

    Args:
        unmodelled: the run with its findings.
        added: (S, n) what each name adds, V.

    """
    problem, out = unmodelled.problem, dict[str, Change]()
    for name, own in added.items():
        common = any(
            problem.candidates[j].sensor is None for j in unmodelled.chosen if problem.candidates[j].effect.name == name
        )
        found: dict[str, list[float]] = {}
        for sensor, block in _common(problem.scene, own) if common else _each(problem.scene, own):
            p = _p(unmodelled, name, sensor, block)
            if p is not None:
                found.setdefault(block.place, []).append(p)
        clearest = change(found)
        if clearest is not None:
            out[name] = clearest
    return out


def _exchanged(unmodelled: UnmodelledSmooth, added: Mapping[str, FloatArray]) -> dict[str, str]:
    """Names of which one with a coefficient that changes does the work of both, in sensors that both concern."""
    scene = unmodelled.problem.scene

    def over(name: str, other: str) -> str | None:
        if not np.any(np.any(added[name], axis=1) & np.any(added[other], axis=1)):
            return None
        view, mine = unmodelled.without_in_view((other,), unmodelled.level_of(other))
        blocks = [block for _, block in _common(scene, added[name])]
        return stands_in(view.outputs.reshape(-1), view.of(mine), blocks, partial(view.project, sensor=None), 1.0)

    return exchanges(added, over)


def _p(unmodelled: UnmodelledSmooth, name: str, sensor: int | None, block: Block) -> float | None:
    """P by chance of products (n, m) of one sensor, or (S n, m) of all; None if nothing is left of them."""
    problem, n = unmodelled.problem, len(unmodelled.problem.scene.data)
    level = unmodelled.level_of(name)
    view, rho = unmodelled.view(level), unmodelled.memory
    y = view.outputs.reshape(-1)[slice(None) if sensor is None else slice(sensor * n, (sensor + 1) * n)]
    df = y.size // n * problem.levels.df(level) - len(unmodelled.chosen)
    project = partial(view.whitened, sensor=sensor, rho=rho)
    left = remainders(view.white(y, sensor, rho), df, [block], project)
    if not left:
        return None
    walks = left[0].p < WALKED
    return max(left[0].p, unmodelled.against_a_walk(level, y, left[0].basis)) if walks else left[0].p


def _each(scene: Scene, added: FloatArray) -> list[tuple[int, Block]]:
    """The contribution of a name to each sensor (S, n), times the variables."""
    return [
        (i, block)
        for i, own in enumerate(added)
        if np.any(own)
        for block in products(own, _variables(scene, scene.data.sensors[i]))
    ]


def _common(scene: Scene, added: FloatArray) -> list[tuple[None, Block]]:
    """The same with one coefficient for all sensors: (S n, m)."""
    n = added.shape[1]
    by: dict[str, FloatArray] = {}
    for i, block in _each(scene, added):
        whole = by.setdefault(block.place, np.zeros((added.size, block.columns.shape[1])))
        width = min(whole.shape[1], block.columns.shape[1])
        whole[i * n : (i + 1) * n, :width] = block.columns[:, :width]
    return [(None, Block(over, own, (own.shape[1],), np.ones(own.shape[1]))) for over, own in by.items()]


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
