"""A run made ready for the search: every candidate's column for every sensor, and their products at every level.

Products are all that least squares needs, whatever is in the model: a search over hundreds of columns then never
touches the observations again, except for the few candidates that come near to standing out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fitter.arrays import FloatArray, IntArray
from fitter.calibration import AttitudeFit, fit_all
from fitter.data import AttitudeData
from fitter.effects import Effect, Scene, Term
from fitter.trace.levels import LEVELS, Level, Levels, levels_of

KEPT = 1e-3
"""A candidate is judged point by replication if this share of it varies there; in other orders of running time and
direction are functions of the point, and it is judged between points."""
IS_THE_MODEL = 1e-4
"""A column of which no larger share than this is left beside the declared model adds nothing to it."""
REACHES = 0.05
"""A term must move the sensors by this share of what the strongest term of its effect does. Others reach them only
through small misalignments and would need absurd coefficients."""


@dataclass(frozen=True)
class Candidate:
    """One term of one effect, on one sensor or (None) on all of them."""

    effect: Effect
    term: Term
    sensor: str | None

    @property
    def cause(self) -> tuple[str, str | None]:
        """What candidates of one physical cause have in common."""
        return self.effect.name, self.sensor


@dataclass(frozen=True, eq=False)
class Products:
    """Of what a level leaves of J columns and the output of each of S sensors.

    Attributes:
        columns: (S, J, J).
        outputs: (S, J).
        square: (S,) outputs with themselves.

    """

    columns: FloatArray
    outputs: FloatArray
    square: FloatArray


@dataclass(frozen=True, eq=False)
class Problem:
    """Arrays over S sensors, n observations and J candidates.

    Attributes:
        scene: the observations and their references.
        fits: the declared model of each sensor.
        candidates: J of them, in catalogue order.
        units: candidates that are judged together, by index; every candidate is in one.
        levels: projections.
        concerned: for each sensor, indices of the candidates that concern it.
        blocks: for each sensor, (n, J_s) what the declared model leaves of their columns.
        outputs: (S, n) what it leaves of the outputs.
        products: of both, by level.
        length: (S, J) length of each column as it is.
        judged_at: for each candidate, the level it is tested at.
        wander: (S,) mean square step, a row, of the random walk in each sensor's offset, over its error's variance;
            zero where the residual shows none.

    """

    scene: Scene
    fits: Mapping[str, AttitudeFit]
    candidates: tuple[Candidate, ...]
    units: tuple[tuple[int, ...], ...]
    levels: Levels
    concerned: tuple[IntArray, ...]
    blocks: tuple[FloatArray, ...]
    outputs: FloatArray
    products: Mapping[Level, Products]
    length: FloatArray
    judged_at: tuple[Level, ...]
    wander: FloatArray

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the outputs, in the order of the first axis."""
        return self.scene.data.sensors

    @cached_property
    def unit_of(self) -> tuple[int, ...]:
        """(J,) index of the unit each candidate is in."""
        where = {j: u for u, unit in enumerate(self.units) for j in unit}
        return tuple(where[j] for j in range(len(self.candidates)))

    def columns_at(self, level: Level, picked: Sequence[int]) -> FloatArray:
        """(S, n, q) what a level leaves of some candidates' columns, V per unit coefficient."""
        out = np.zeros((len(self.sensors), len(self.scene.data), len(picked)))
        for i, own in enumerate(self.concerned):
            at = [
                (k, p) for k, j in enumerate(picked) if (p := int(np.searchsorted(own, j))) < own.size and own[p] == j
            ]
            if at:
                k, p = np.array(at).T
                own_columns = self.blocks[i][:, p]
                out[i][:, k] = own_columns if level == "declared" else self.left(i, own_columns, level)
        return out

    def outputs_at(self, level: Level) -> FloatArray:
        """(S, n) what a level leaves of the outputs, V."""
        return self._outputs[level]

    @cached_property
    def _outputs(self) -> dict[Level, FloatArray]:
        return {
            level: np.stack([self.left(i, y[:, None], level)[:, 0] for i, y in enumerate(self.outputs)])
            for level in LEVELS
        }

    def left(self, i: int, columns: FloatArray, level: Level) -> FloatArray:
        """(n, q) what a level leaves of columns (n, q) of sensor `i`, or of what the declared model leaves of them."""
        return self.levels.leave_beside(columns, self.fits[self.sensors[i]].beside(self.scene.data), level=level)

    def with_terms(self, unit: int, terms: Sequence[Term]) -> Problem:
        """The problem with other terms, other values of a constant that is searched, in the place of a unit's."""
        picked = list(self.units[unit])
        candidates = list(self.candidates)
        for j, term in zip(picked, terms, strict=True):
            candidates[j] = replace(candidates[j], term=term)
        raw = raw_columns(self.scene, [candidates[j] for j in picked])
        blocks, length = list(self.blocks), self.length.copy()
        length[:, picked] = np.linalg.norm(raw, axis=1)
        products = {level: _copied(self.products[level]) for level in LEVELS}
        for i, own in enumerate(self.concerned):
            here = np.searchsorted(own, picked)
            if here[0] < own.size and own[here[0]] == picked[0]:
                columns = self.left(i, raw[i], "declared")
                blocks[i] = blocks[i].copy()
                blocks[i][:, here] = columns
                for level in LEVELS:
                    left, to = self.left(i, columns, level), products[level]
                    cross = blocks[i].T @ left
                    to.columns[i][own[:, None], picked] = cross
                    to.columns[i][np.array(picked)[:, None], own] = cross.T
                    to.outputs[i, picked] = self.outputs[i] @ left
        return replace(self, candidates=tuple(candidates), blocks=tuple(blocks), products=products, length=length)


def _copied(products: Products) -> Products:
    return Products(products.columns.copy(), products.outputs.copy(), products.square)


def pose(data: AttitudeData, catalogue: Sequence[Effect], *, temperature: bool = False) -> Problem:
    """Prepare a run for the search.

    Args:
        data: the run.
        catalogue: effects to look for.
        temperature: whether offset and sensitivity follow the sensor's temperature in the declared model.

    Raises:
        fitter.linear.RankError: the points visited do not determine the declared model.
        ValueError: the declared model has temperature, and none was recorded or it never changed.

    """
    fits = fit_all(data, temperature=temperature)
    scene = scene_of(data, fits)
    beside = [fits[s].beside(data) for s in data.sensors]
    levels = levels_of(data, beside[0].shape[1])
    every = _candidates(data, catalogue)
    length = np.zeros((len(data.sensors), len(every)))
    left = np.zeros_like(length)
    blocks, owns = [], []
    for i, sensor in enumerate(data.sensors):
        own = np.array([j for j, c in enumerate(every) if c.sensor in (None, sensor)], np.int64)
        block = np.empty((len(data), own.size), order="F")
        for k, j in enumerate(own):
            block[:, k] = every[j].term.column(scene, sensor)
        length[i, own] = np.linalg.norm(block, axis=0)
        block = levels.leave_beside(block, beside[i], level="declared")
        left[i, own] = np.linalg.norm(block, axis=0)
        blocks.append(block)
        owns.append(own)
    useful = _useful(every, length, left)
    number = np.cumsum(useful) - 1
    candidates = tuple(c for c, use in zip(every, useful, strict=True) if use)
    blocks = [block[:, useful[own]] for block, own in zip(blocks, owns, strict=True)]
    concerned = tuple(number[own[useful[own]]] for own in owns)
    outputs = np.stack(
        [
            levels.leave_beside(data.outputs[s][:, None], b, level="declared")[:, 0]
            for s, b in zip(data.sensors, beside, strict=True)
        ]
    )
    products = _products(levels, blocks, concerned, outputs, beside, len(candidates))
    length, units = length[:, useful], _units(candidates)
    return Problem(
        scene=scene,
        fits=fits,
        candidates=candidates,
        units=units,
        levels=levels,
        concerned=concerned,
        blocks=tuple(blocks),
        outputs=outputs,
        products=products,
        length=length,
        judged_at=_judged_at(candidates, units, products["points"], length),
        wander=np.zeros(len(data.sensors)),
    )


def _products(
    levels: Levels,
    blocks: Sequence[FloatArray],
    concerned: Sequence[IntArray],
    outputs: FloatArray,
    beside: Sequence[FloatArray],
    count: int,
) -> dict[Level, Products]:
    out = {
        level: Products(np.zeros((len(blocks), count, count)), np.zeros((len(blocks), count)), np.zeros(len(blocks)))
        for level in LEVELS
    }
    for i, (block, own, y) in enumerate(zip(blocks, concerned, outputs, strict=True)):
        for level, both in levels.products(np.column_stack([block, y]), beside[i]).items():
            out[level].columns[i][np.ix_(own, own)] = both[:-1, :-1]
            out[level].outputs[i, own], out[level].square[i] = both[:-1, -1], max(both[-1, -1], 0.0)
    return out


def _units(candidates: Sequence[Candidate]) -> tuple[tuple[int, ...], ...]:
    units: dict[tuple[str, str | None, str], list[int]] = {}
    for j, candidate in enumerate(candidates):
        units.setdefault((*candidate.cause, candidate.term.group or candidate.term.name), []).append(j)
    return tuple(map(tuple, units.values()))


def _judged_at(
    candidates: Sequence[Candidate], units: Sequence[tuple[int, ...]], points: Products, length: FloatArray
) -> tuple[Level, ...]:
    left2, length2 = np.einsum("sjj->j", points.columns), np.sum(length**2, axis=0)
    level: list[Level] = ["replications"] * len(candidates)
    for unit in map(list, units):
        if candidates[unit[0]].effect.stratum != "between-point" and np.any(left2[unit] > KEPT * length2[unit]):
            for j in unit:
                level[j] = "points"
    return tuple(level)


def scene_of(data: AttitudeData, fits: Mapping[str, AttitudeFit]) -> Scene:
    """References of a run: mean temperature, middle of the time, each sensor's axis as the declared model has it."""
    turned = np.eye(3) if data.mounting is None else data.mounting[0]
    axes, temperature = {s: turned @ fit.sensitive_axis for s, fit in fits.items()}, data.sensor_temperature_degC
    return Scene(
        data=data,
        axes=axes,
        offsets={s: fit.parameters.b_V for s, fit in fits.items()},
        nominal={s: "xyz".index(fit.model[-1]) if fit.has_roll else 0 for s, fit in fits.items()},
        roll=data.has_roll,
        temperature_degC=None if temperature is None else float(np.mean(temperature)),
        elapsed_s=float(np.mean(data.elapsed_s)),
    )


def raw_columns(scene: Scene, candidates: Sequence[Candidate]) -> FloatArray:
    """(S, n, J) columns of `candidates`: zero for the sensors a candidate does not concern."""
    sensors = scene.data.sensors
    out = np.zeros((len(sensors), len(scene.data), len(candidates)))
    for j, candidate in enumerate(candidates):
        for i, sensor in enumerate(sensors):
            if candidate.sensor in (None, sensor):
                out[i, :, j] = candidate.term.column(scene, sensor)
    return out


def _useful(candidates: Sequence[Candidate], length: FloatArray, left: FloatArray) -> NDArray[np.bool_]:
    """(J,) whether a candidate adds something to the declared model, and moves the sensors directly."""
    own = np.linalg.norm(length, axis=0)
    strongest: dict[tuple[str, str | None], float] = {}
    for candidate, size in zip(candidates, own, strict=True):
        strongest[candidate.cause] = max(float(size), strongest.get(candidate.cause, 0.0))
    least = np.array([REACHES * strongest[c.cause] if c.effect.scope == "package" else -1.0 for c in candidates])
    return np.asarray((np.linalg.norm(left, axis=0) > IS_THE_MODEL * own) & (own > least))


def _candidates(data: AttitudeData, catalogue: Sequence[Effect]) -> tuple[Candidate, ...]:
    found = []
    for effect in catalogue:
        if effect.applies_to(data):
            where = data.sensors if effect.scope == "sensor" else (None,)
            found += [Candidate(effect, term, sensor) for sensor in where for term in effect.terms(data)]
    return tuple(found)
