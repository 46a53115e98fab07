"""Preparation of the search of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.aliases import NOTHING_LEFT
from rig.fitter.trace.limits import limit
from rig.fitter.trace.not_kept import LARGEST, NotKept
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects import Effect
from rig.procedures.attitude.fit import fit_all
from rig.procedures.attitude.trace.levels import AT_ONCE, LEVELS, Level, levels_of
from rig.procedures.attitude.trace.problem import Candidate, Problem, Products, columns_of, scene_of

KEPT = 0.05
"""Minimum share of variation point by replication, of a candidate's remainder at `replications`, for a judgement there.
In other orders of running, time and direction are functions of the point, and it is judged between points: with a
smaller share an effect would be found only if it is so large that it got other names between points before.
"""
IS_THE_MODEL = limit("declared", "pitch-roll")
"""Minimum remaining share of a column beside the declared model."""
REACHES = 0.05
"""Minimum influence of a term on the sensors, relative to the strongest term of its effect. Other terms reach them only
through small misalignments and would need absurd coefficients.
"""


def make_problem(data: AttitudeData, catalogue: Sequence[Effect], *, temperature: bool = False) -> Problem:
    """Prepare a run for the search.

    Args:
        data: the run.
        catalogue: effects to search.
        temperature: whether offset and sensitivity depend on the sensor's temperature in the declared model.

    Raises:
        rig.fitter.linear.RankError: the points do not determine the declared model.
        FitError: the declared model has temperature, and none was recorded or it never changed.
    """
    fits = fit_all(data, temperature=temperature)
    scene = scene_of(data, fits)
    beside = [fits[s].beside(data) for s in data.sensors]
    levels = levels_of(data, beside[0].shape[1])
    every = _candidates(data, catalogue)
    length = np.zeros((len(data.sensors), len(every)))
    left = np.zeros_like(length)
    moves = np.zeros((data.replicates.size, len(data.sensors), levels.declared.shape[1], len(every) + 1))
    outputs, owns, known, overflowing = [], [], list[dict[Level, FloatArray]](), set[int]()
    for i, sensor in enumerate(data.sensors):
        own = np.array([j for j, c in enumerate(every) if c.sensor in (None, sensor)], np.int64)
        both = np.empty((len(data), own.size + 1), order="F")
        both[:, -1] = data.outputs[sensor]
        with np.errstate(over="ignore", invalid="ignore"):
            columns_of(scene, [every[j] for j in own], sensor, both)
            if sensor == data.sensors[-1]:
                scene.forget()  # what the sensors shared is not needed beside the products
            for k in range(0, own.size, AT_ONCE):
                some = own[k : k + AT_ONCE]
                length[i, some] = np.linalg.norm(both[:, k : k + some.size], axis=0)
        large = np.flatnonzero(~(length[i, own] <= LARGEST))
        both[:, large], length[i, own[large]] = 0.0, 0.0
        overflowing |= set(own[large].tolist())
        both = levels.leave_beside(both, beside[i], level="declared", overwrite=True)
        moves[:, i][..., [*own, -1]] = levels.own(both)
        outputs.append(both[:, -1].copy())
        owns.append(own)
        known.append(levels.products(both, beside[i]))
        left[i, own] = np.sqrt(np.maximum(np.diag(known[-1]["declared"])[:-2], 0.0))
        del both  # otherwise those of the next sensor would be made beside them
    useful = _useful(every, length, left)
    useful[list(overflowing)] = False
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
        left_out=tuple(dict.fromkeys(NotKept(*every[j].cause, "overflow") for j in sorted(overflowing))),
    )


def _products(
    known: Sequence[Mapping[Level, FloatArray]], owns: Sequence[IntArray], useful: NDArray[np.bool_]
) -> dict[Level, Products]:
    """Indices of the useful candidates, from products of each sensor's own with its output and a row of zeros last."""
    place = np.zeros((len(known), useful.size), np.int64) - 1
    for at, own in zip(place, owns, strict=True):
        at[own] = np.arange(own.size)
    place = place[:, useful]
    out = {}
    for level in LEVELS:
        every = tuple(each[level] for each in known)
        outputs = np.stack([own[at, -2] for own, at in zip(every, place, strict=True)])
        out[level] = Products(every, place, outputs, np.array([max(float(own[-2, -2]), 0.0) for own in every]))
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
    within, both = (products[level].squares.sum(axis=0) for level in ("points", "replications"))
    least = np.maximum(KEPT * both, NOTHING_LEFT**2 * np.sum(length**2, axis=0))
    over = within > least
    level: list[Level] = ["replications"] * len(candidates)
    for unit in units:
        if candidates[unit[0]].effect.stratum != "between-point" and any(over[j] for j in unit):
            for j in unit:
                level[j] = "points"
    return tuple(level)


def _useful(candidates: Sequence[Candidate], length: FloatArray, left: FloatArray) -> NDArray[np.bool_]:
    """(J,) whether a candidate adds something to the declared model, and acts directly on the sensors."""
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
            terms = effect.terms(data)
            found += [Candidate(effect, term, sensor) for sensor in where for term in terms]
    return tuple(found)
