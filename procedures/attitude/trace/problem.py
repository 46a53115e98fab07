"""A run prepared for the search: every candidate's column for every sensor, and their products at every level.

Least squares needs only products, for any model. So a search over hundreds of columns does not use the observations
again, except for the few candidates near significance. Their columns are computed again when needed, which is fast and
takes a third of the memory of storing all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.engine.family import TableFamily
from rig.fitter.trace.not_kept import NotKept
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects import Effect, Scene, Term
from rig.procedures.attitude.fit import AttitudeFit
from rig.procedures.attitude.trace.levels import LEVELS, Level, Levels

AT_ONCE = 64
"""Number of columns computed together if only their products are needed."""


@dataclass(frozen=True)
class Candidate:
    """One term of one effect, on one sensor or (None) on all of them."""

    effect: Effect
    term: Term
    sensor: str | None

    @property
    def cause(self) -> tuple[str, str | None]:
        """Properties of the candidates of one physical cause."""
        return self.effect.name, self.sensor


@dataclass(frozen=True, eq=False)
class Products:
    """Products of the remainders of J columns and the output of each of S sensors at a level.

    Attributes:
        own: for each sensor, those of its own columns, with a last row and column of zeros for all others.
        place: (S, J) row of each candidate in them.
        outputs: (S, J).
        square: (S,) outputs with themselves.
    """

    own: tuple[FloatArray, ...]
    place: IntArray
    outputs: FloatArray
    square: FloatArray

    def of(self, these: Sequence[int] | IntArray, those: Sequence[int] | IntArray) -> FloatArray:
        """(S, ...) products of columns with columns, by candidates; both are indices of one shape, or broadcast."""
        rows, across = np.asarray(these, np.int64), np.asarray(those, np.int64)
        return np.stack([own[at[rows], at[across]] for own, at in zip(self.own, self.place, strict=True)])

    @property
    def squares(self) -> FloatArray:
        """(S, J) products of columns with themselves."""
        return self.of(np.arange(self.place.shape[1]), np.arange(self.place.shape[1]))


@dataclass(frozen=True, eq=False)
class Problem:
    """Arrays over S sensors, n observations and J candidates.

    Attributes:
        scene: the observations and their references.
        fits: the declared model of each sensor.
        candidates: J of them, in catalogue order.
        units: candidates that are judged together, by index; every candidate is in one.
        levels: projections.
        concerned: for each sensor, indices of its candidates.
        outputs: (S, n) residual outputs of the declared model.
        products: of both, by level.
        own: (n_rep, S, L, J) influence of each column on the parameters of each replication's own fit, centred.
        own_outputs: (n_rep, S, L) these parameters.
        length: (S, J) length of each original column.
        judged_at: for each candidate, the level it is tested at.
        wander: (S,) mean square step per row of the random walk in each sensor's offset, over its error's variance;
            zero without a detected walk.
        left_out: candidates that cannot be used in computation.
        simulated: distributions of scores by chance, of this run and of parts of it, with what they are for.
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
    left_out: tuple[NotKept, ...] = ()
    simulated: list[tuple[FloatArray, TableFamily]] = field(default_factory=list)

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the outputs, in the order of the first axis."""
        return self.scene.data.sensors

    @cached_property
    def unit_of(self) -> tuple[int, ...]:
        """(J,) index of each candidate's unit."""
        where = {j: u for u, unit in enumerate(self.units) for j in unit}
        return tuple(where[j] for j in range(len(self.candidates)))

    @cached_property
    def causes(self) -> tuple[tuple[str, str | None], ...]:
        """(U,) cause of each unit's candidates."""
        return tuple(self.candidates[unit[0]].cause for unit in self.units)

    @cached_property
    def most(self) -> FloatArray:
        """(J,) largest plausible coefficient of each candidate, in the unit of its term; infinite without a bound."""
        each = ((c.effect.largest, self.fits[c.sensor or self.sensors[0]].parameters.S_V) for c in self.candidates)
        return np.array([np.inf if one is None else one.of(slope) for one, slope in each], np.float64)

    @cached_property
    def estimates(self) -> dict[tuple[int, ...], Any]:
        """Cache of fits, by the candidates in them: `estimate`."""
        return {}

    @cached_property
    def engines(self) -> dict[frozenset[int] | None, Any]:
        """Cache of the engine's judges, by the candidates in the model: `posed`."""
        return {}

    def columns_at(self, level: Level, picked: Sequence[int]) -> FloatArray:
        """(S, n, q) remainders of some candidates' columns at a level, V per unit coefficient."""
        raw = raw_columns(self.scene, [self.candidates[j] for j in picked])
        for i, columns in enumerate(raw):
            own = np.flatnonzero(np.any(columns != 0.0, axis=0))
            left = self.left(i, columns[:, own], "declared")
            columns[:, own] = left if level == "declared" else self.left(i, left, level)
        return raw

    def outputs_at(self, level: Level) -> FloatArray:
        """(S, n) remainders of the outputs at a level, V."""
        return self._outputs[level]

    @cached_property
    def _outputs(self) -> dict[Level, FloatArray]:
        return {
            level: np.stack([self.left(i, y[:, None], level)[:, 0] for i, y in enumerate(self.outputs)])
            for level in LEVELS
        }

    def left(self, i: int, columns: FloatArray, level: Level) -> FloatArray:
        """(n, q) remainder of columns (n, q) of sensor `i`, or of their remainder after the declared model,
        at a level.
        """
        return self.levels.leave_beside(columns, self.fits[self.sensors[i]].beside(self.scene.data), level=level)

    def with_terms(self, unit: int, terms: Sequence[Term]) -> Problem:
        """The problem with other terms, for other values of a searched constant, in place of a unit's."""
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
            across = np.concatenate([columns_of(self.scene, some, sensor).T @ left for some in _batches(every)])
            for level, cross in zip(LEVELS, np.split(across, len(LEVELS), axis=1), strict=True):
                to, at = products[level], self.products[level].place[i]
                to.own[i][at[own][:, None], at[picked]] = cross
                to.own[i][at[picked][:, None], at[own]] = cross.T
                to.outputs[i, picked] = self.outputs[i] @ self.left(i, columns, level)
        return replace(self, candidates=tuple(candidates), products=products, own=moves, length=length)


def _copied(products: Products) -> Products:
    return replace(products, own=tuple(own.copy() for own in products.own), outputs=products.outputs.copy())


def columns_of(scene: Scene, candidates: Sequence[Candidate], sensor: str, out: FloatArray | None = None) -> FloatArray:
    """(n, q) columns of one sensor, written to the first q columns of `out` if given."""
    out = np.empty((len(scene.data), len(candidates)), order="F") if out is None else out
    for k, candidate in enumerate(candidates):
        out[:, k] = candidate.term.column(scene, sensor)
    return out


def _batches(candidates: Sequence[Candidate]) -> Iterator[Sequence[Candidate]]:
    return (candidates[k : k + AT_ONCE] for k in range(0, len(candidates), AT_ONCE))


def scene_of(data: AttitudeData, fits: Mapping[str, AttitudeFit]) -> Scene:
    """References of a run: mean temperature, middle of the time, each sensor's axis by the declared model."""
    turn = data.mounting if data.has_roll else data.turned
    turned = np.eye(3) if turn is None else turn[0]
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
    """(S, n, J) columns of `candidates`: zero for sensors that a candidate does not concern."""
    sensors = scene.data.sensors
    out = np.zeros((len(sensors), len(scene.data), len(candidates)))
    for j, candidate in enumerate(candidates):
        for i, sensor in enumerate(sensors):
            if candidate.sensor in (None, sensor):
                out[i, :, j] = candidate.term.column(scene, sensor)
    return out
