"""A run made ready for the search: every candidate's column for every sensor, and their products at every level.

Products are all that least squares needs, whatever is in the model: a search over hundreds of columns then never
touches the observations again, except for the few candidates that come near to standing out. Their columns are reckoned
again when they are wanted, which is quicker than it sounds and takes a third of the memory of keeping all of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fitter.arrays import FloatArray, IntArray
from fitter.calibration import AttitudeFit, fit_all
from fitter.data import AttitudeData
from fitter.effects import Effect, Scene, Term
from fitter.trace.aliases import NOTHING_LEFT
from fitter.trace.levels import LEVELS, Level, Levels, levels_of

KEPT = 0.05
"""A candidate is judged point by replication if this share of what replications leave of it varies there. In other
orders of running time and direction are functions of the point, and it is judged between points: by so small a share
an effect could only be found when it is large enough to have been given other names between points before."""
IS_THE_MODEL = 1e-4
"""A column of which no larger share than this is left beside the declared model adds nothing to it."""
REACHES = 0.05
"""A term must move the sensors by this share of what the strongest term of its effect does. Others reach them only
through small misalignments and would need absurd coefficients."""

AT_ONCE = 64
"""Columns that are reckoned at a time where only their products are wanted."""


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
        outputs: (S, n) what it leaves of the outputs.
        products: of both, by level.
        own: (n_rep, S, L, J) what each column does to the parameters of each replication's own fit, centred.
        own_outputs: (n_rep, S, L) these parameters.
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
    outputs: FloatArray
    products: Mapping[Level, Products]
    own: FloatArray
    own_outputs: FloatArray
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
        raw = raw_columns(self.scene, [self.candidates[j] for j in picked])
        for i, columns in enumerate(raw):
            own = np.flatnonzero(np.any(columns != 0.0, axis=0))
            left = self.left(i, columns[:, own], "declared")
            columns[:, own] = left if level == "declared" else self.left(i, left, level)
        return raw

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
        length, moves = self.length.copy(), self.own.copy()
        length[:, picked] = np.linalg.norm(raw, axis=1)
        products = {level: _copied(self.products[level]) for level in LEVELS}
        for i, own in enumerate(self.concerned):
            if picked[0] not in own:
                continue
            columns = self.left(i, raw[i], "declared")
            moves[:, i][..., picked] = self.levels.own(columns)
            left = np.concatenate([self.left(i, columns, level) for level in LEVELS], axis=1)
            sensor, every = self.sensors[i], [candidates[j] for j in own]
            across = np.concatenate([_columns(self.scene, some, sensor).T @ left for some in _batches(every)])
            for level, cross in zip(LEVELS, np.split(across, len(LEVELS), axis=1), strict=True):
                to = products[level]
                to.columns[i][own[:, None], picked] = cross
                to.columns[i][np.array(picked)[:, None], own] = cross.T
                to.outputs[i, picked] = self.outputs[i] @ self.left(i, columns, level)
        return replace(self, candidates=tuple(candidates), products=products, own=moves, length=length)


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
    moves = np.zeros((data.replicates.size, len(data.sensors), levels.declared.shape[1], len(every) + 1))
    outputs, owns, known = [], [], []
    for i, sensor in enumerate(data.sensors):
        own = np.array([j for j, c in enumerate(every) if c.sensor in (None, sensor)], np.int64)
        both = np.empty((len(data), own.size + 1), order="F")
        both[:, -1] = data.outputs[sensor]
        _columns(scene, [every[j] for j in own], sensor, both)
        length[i, own] = np.linalg.norm(both[:, :-1], axis=0)
        both = levels.leave_beside(both, beside[i], level="declared")
        left[i, own] = np.linalg.norm(both[:, :-1], axis=0)
        moves[:, i][..., [*own, -1]] = levels.own(both)
        outputs.append(both[:, -1].copy())
        owns.append(own)
        known.append(levels.products(both, beside[i]))
    useful = _useful(every, length, left)
    candidates = tuple(c for c, use in zip(every, useful, strict=True) if use)
    products = _products(known, owns, useful)
    length, units = length[:, useful], _units(candidates)
    return Problem(
        scene=scene,
        fits=fits,
        candidates=candidates,
        units=units,
        levels=levels,
        concerned=tuple((np.cumsum(useful) - 1)[own[useful[own]]] for own in owns),
        outputs=np.stack(outputs),
        products=products,
        own=moves[..., :-1][..., useful],
        own_outputs=moves[..., -1],
        length=length,
        judged_at=_judged_at(candidates, units, products, length),
        wander=np.zeros(len(data.sensors)),
    )


def _columns(scene: Scene, candidates: Sequence[Candidate], sensor: str, out: FloatArray | None = None) -> FloatArray:
    """(n, q) columns of one sensor, in the first q columns of `out` if it is given."""
    out = np.empty((len(scene.data), len(candidates)), order="F") if out is None else out
    for k, candidate in enumerate(candidates):
        out[:, k] = candidate.term.column(scene, sensor)
    return out


def _batches(candidates: Sequence[Candidate]) -> Iterator[Sequence[Candidate]]:
    return (candidates[k : k + AT_ONCE] for k in range(0, len(candidates), AT_ONCE))


def _products(
    known: list[dict[Level, FloatArray]], owns: Sequence[IntArray], useful: NDArray[np.bool_]
) -> dict[Level, Products]:
    """Of the useful ones of all candidates, from products of each sensor's own with its output last."""
    sensors, count, number = len(known), int(useful.sum()), np.cumsum(useful) - 1
    out = {
        level: Products(np.zeros((sensors, count, count)), np.zeros((sensors, count)), np.zeros(sensors))
        for level in LEVELS
    }
    for i, own in enumerate(owns):
        kept = np.flatnonzero(useful[own])
        at = number[own[kept]]
        for level in LEVELS:
            both = known[i].pop(level)
            out[level].columns[i][np.ix_(at, at)] = both[np.ix_(kept, kept)]
            out[level].outputs[i, at], out[level].square[i] = both[kept, -1], max(float(both[-1, -1]), 0.0)
    return out


def _units(candidates: Sequence[Candidate]) -> tuple[tuple[int, ...], ...]:
    units: dict[tuple[str, str | None, str], list[int]] = {}
    for j, candidate in enumerate(candidates):
        units.setdefault((*candidate.cause, candidate.term.group or candidate.term.name), []).append(j)
    return tuple(map(tuple, units.values()))


def _judged_at(
    candidates: Sequence[Candidate],
    units: Sequence[tuple[int, ...]],
    products: Mapping[Level, Products],
    length: FloatArray,
) -> tuple[Level, ...]:
    within, both = (np.einsum("sjj->j", products[level].columns) for level in ("points", "replications"))
    least = np.maximum(KEPT * both, NOTHING_LEFT**2 * np.sum(length**2, axis=0))
    level: list[Level] = ["replications"] * len(candidates)
    for unit in map(list, units):
        if candidates[unit[0]].effect.stratum != "between-point" and np.any(within[unit] > least[unit]):
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
