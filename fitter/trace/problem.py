"""A run made ready for the search: every candidate's column for every sensor, at every level."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
    """One term of one effect, on one sensor or (None) on the whole package."""

    effect: Effect
    term: Term
    sensor: str | None

    @property
    def cause(self) -> tuple[str, str | None]:
        """What candidates of one physical cause have in common."""
        return self.effect.name, self.sensor


@dataclass(frozen=True, eq=False)
class Problem:
    """Arrays over S sensors, n observations and J candidates.

    Attributes:
        scene: the observations and their references.
        fits: the declared model of each sensor.
        candidates: J of them, in catalogue order.
        levels: projections.
        raw: (S, n, J) columns as they are, V per unit coefficient.
        columns: (S, n, J) what is left of them, by level.
        outputs: (S, n) what is left of the outputs, by level.
        judged_at: for each candidate, the level it is tested at.
        wander: (S,) mean square step, a row, of the random walk in each sensor's offset, over its error's variance;
            zero where the residual shows none.

    """

    scene: Scene
    fits: Mapping[str, AttitudeFit]
    candidates: tuple[Candidate, ...]
    levels: Levels
    raw: FloatArray
    columns: Mapping[Level, FloatArray]
    outputs: Mapping[Level, FloatArray]
    judged_at: tuple[Level, ...]
    wander: FloatArray

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the outputs, in the order of the first axis."""
        return self.scene.data.sensors

    @cached_property
    def length(self) -> FloatArray:
        """(S, J) length of each raw column."""
        return np.asarray(np.linalg.norm(self.raw, axis=1))

    def at(self, level: Level) -> IntArray:
        """Indices of the candidates judged at a level."""
        return np.array([j for j, judged in enumerate(self.judged_at) if judged == level], np.int64)


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
    candidates = _candidates(data, catalogue)
    raw = raw_columns(scene, candidates)

    def left(blocks: FloatArray) -> dict[Level, FloatArray]:
        return {
            level: np.stack([levels.leave_beside(*pair, level=level) for pair in zip(blocks, beside, strict=True)])
            for level in LEVELS
        }

    columns = left(raw)
    outputs = left(np.stack([data.outputs[s] for s in data.sensors])[:, :, None])
    length, kept = _length(raw), _length(columns["points"]) ** 2 > KEPT * _length(raw) ** 2
    useful = np.flatnonzero((_length(columns["declared"]) > IS_THE_MODEL * length) & _direct(candidates, length))
    candidates = tuple(candidates[j] for j in useful)
    return Problem(
        scene=scene,
        fits=fits,
        candidates=candidates,
        levels=levels,
        raw=raw[:, :, useful],
        columns={level: block[:, :, useful] for level, block in columns.items()},
        outputs={level: block[:, :, 0] for level, block in outputs.items()},
        judged_at=tuple(
            "points" if kept[j] and c.effect.stratum != "between-point" else "replications"
            for j, c in zip(useful, candidates, strict=True)
        ),
        wander=np.zeros(len(data.sensors)),
    )


def scene_of(data: AttitudeData, fits: Mapping[str, AttitudeFit]) -> Scene:
    """References of a run: mean temperature, middle of the time, each sensor's axis as the declared model has it."""
    axes, temperature = {s: fit.sensitive_axis for s, fit in fits.items()}, data.sensor_temperature_degC
    return Scene(
        data=data,
        axes=axes,
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


def _length(columns: FloatArray) -> FloatArray:
    """(J,) length of each column over all sensors."""
    return np.asarray(np.sqrt(np.sum(columns**2, axis=(0, 1))))


def _direct(candidates: Sequence[Candidate], length: FloatArray) -> NDArray[np.bool_]:
    strongest: dict[tuple[str, str | None], float] = {}
    for candidate, own in zip(candidates, length, strict=True):
        strongest[candidate.cause] = max(float(own), strongest.get(candidate.cause, 0.0))
    return np.array([own > REACHES * strongest[c.cause] for c, own in zip(candidates, length, strict=True)])


def _candidates(data: AttitudeData, catalogue: Sequence[Effect]) -> tuple[Candidate, ...]:
    found = []
    for effect in catalogue:
        if effect.applies_to(data):
            where = (None,) if effect.scope == "package" else data.sensors
            found += [Candidate(effect, term, sensor) for sensor in where for term in effect.terms(data)]
    return tuple(found)
