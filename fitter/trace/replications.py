"""The stratum of replications: effects that are nearly constant within one and vary from one to the next.

Each replication's own parameters are one observation here, and there are only n of them. What a candidate would do
to them is a direction in the space of parameters and a size for each replication; the parameters along that direction
are regressed on that size twice, as if replications wandered independently and as if they took a random walk. The less
favourable answer counts: a trend in six offsets that a random walk explains is no trend. What the same parameters of
all sensors do beside their own slopes is the error: six replications of one sensor are too few to know it by.

A package that slips turns all sensors alike. What their axes do beside that, 9 numbers a replication for three sensors,
is error enough to judge it by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitter.arrays import FloatArray
from fitter.attitude import attitude_columns
from fitter.linear import orthonormal
from fitter.quantiles import f_tail, t_tail
from fitter.trace.problem import Problem
from fitter.trace.score import errors

FEWEST = 4
"""Replications without which nothing can be said at this level."""


@dataclass(frozen=True, eq=False)
class _Slow:
    """What one column does to a sensor's own parameters of each replication, and what they did.

    Attributes:
        x: (n_rep,) size of the move, along the direction in which the column moves the parameters, centred.
        v: (n_rep,) the parameters along it, over the scatter that readings give them, centred.

    """

    x: FloatArray
    v: FloatArray

    def steps(self) -> _Slow:
        """The same of changes from one replication to the next."""
        return _Slow(np.diff(self.x), np.diff(self.v))

    @property
    def left(self) -> float:
        """Sum of squares beside its own slope."""
        return float(self.v @ self.v - (self.x @ self.v) ** 2 / (self.x @ self.x))


def p_between_replications(problem: Problem, chosen: tuple[int, ...], gamma: FloatArray) -> FloatArray:
    """(U,) probability of so good a relation between replications by chance; one where there is none to test.

    Tested are units without a searched constant, of searched ones those of temperature, and those of stratum
    "replication".

    Args:
        problem: the run.
        chosen: candidates already in the model.
        gamma: their coefficients.

    """
    p = np.ones(len(problem.units))
    data = problem.scene.data
    tested = [u for u, unit in enumerate(problem.units) if _tested(problem, unit) and not set(unit) & set(chosen)]
    if data.replicates.size < FEWEST or not tested:
        return p
    e = problem.outputs - problem.columns_at("declared", chosen) @ gamma
    pure = errors(problem, chosen)
    picked = [j for u in tested for j in problem.units[u]]
    moved = (e[:, :, None], problem.columns_at("declared", picked))
    own = np.concatenate([_own(problem, columns, pure) for columns in moved], axis=2)
    own -= own.mean(axis=0)
    length2 = np.sum((problem.length[:, picked] / pure[:, None]) ** 2, axis=0)
    at = {j: k for k, j in enumerate(picked)}
    slow = {j: _slow(own[:, :, 0], own[:, :, 1 + k], len(problem.sensors), 1e-4 * length2[k]) for j, k in at.items()}
    alike: dict[tuple[str, str], list[_Slow]] = {}
    for j, parts in slow.items():
        candidate = problem.candidates[j]
        if candidate.sensor is not None:
            alike.setdefault((candidate.effect.name, candidate.term.name), []).extend(parts)
    for u in tested:
        unit = problem.units[u]
        if problem.candidates[unit[0]].effect.stratum == "replication":
            moves = own[:, :, [1 + at[j] for j in unit]]
            if np.sum(moves**2) > 1e-4 * np.max(length2[[at[j] for j in unit]]):
                p[u] = _p_turn(moves, own[:, :, 0])
            continue
        for j in unit:
            candidate = problem.candidates[j]
            others = alike[candidate.effect.name, candidate.term.name] if candidate.sensor is not None else slow[j]
            if slow[j]:
                p[u] = min(p[u], len(unit) * _p_slope(slow[j], others))
    return p


def _slow(y: FloatArray, moves: FloatArray, sensors: int, least: float) -> list[_Slow]:
    """One column's part in every sensor it moves; none if it hardly moves the parameters, `least` being their squares.

    Args:
        y: (n_rep, S L) every sensor's own parameters, centred.
        moves: (n_rep, S L) what the column does to them, centred.
        sensors: S.
        least: sum of squares.

    """
    if np.sum(moves**2) < least:
        return []
    parts = []
    for own, move in zip(np.split(y, sensors, axis=1), np.split(moves, sensors, axis=1), strict=True):
        if np.sum(move**2) > 0.05 * np.sum(moves**2):
            direction = np.linalg.svd(move)[2][0]
            parts.append(_Slow(move @ direction, own @ direction))
    return parts


def _p_slope(parts: list[_Slow], alike: list[_Slow]) -> float:
    """P of one slope that all `parts` have in common, as if replications differed independently and as if they walked.

    The error is what is left beside their slopes of the same parameters of all sensors, or of these `parts` alone, or
    what readings scatter, whichever is most.
    """
    worst = 0.0
    for of, others in ((parts, alike), ([part.steps() for part in parts], [part.steps() for part in alike])):
        lost = 2 if of is parts else 1
        xx = sum(float(part.x @ part.x) for part in of)
        if xx <= 0 or any(float(other.x @ other.x) <= 0 for other in others):
            return 1.0
        slope = sum(float(part.x @ part.v) for part in of) / xx
        own = sum(float(np.sum((part.v - slope * part.x) ** 2)) for part in of)
        own_df = sum(part.x.size - lost + 1 for part in of) - 1
        pooled_df = sum(other.x.size - lost for other in others)
        error = max(1.0, own / own_df, sum(other.left for other in others) / pooled_df)
        worst = max(worst, t_tail(slope * float(np.sqrt(xx / error)), max(pooled_df, own_df)))
    return worst


def _tested(problem: Problem, unit: tuple[int, ...]) -> bool:
    effect = problem.candidates[unit[0]].effect
    if effect.stratum == "replication":
        return problem.judged_at[unit[0]] == "replications"
    slow = not effect.searched or effect.source == "temperature"
    return effect.stratum != "between-point" and slow


def _p_turn(moves: FloatArray, y: FloatArray) -> float:
    """P of a unit that moves several parameters of all sensors in a common proportion from one replication on.

    What else those parameters do is the error, if it is more than the scatter of readings explains. Tested on the
    parameters themselves, as if replications differed independently, and on their changes, as if they took a random
    walk; the worse counts.

    Args:
        moves: (n_rep, m, q) what each of the unit's columns does to the m parameters, centred.
        y: (n_rep, m) the parameters, over the scatter that readings give them, centred.

    """
    moved = np.linalg.norm(moves, axis=(0, 2))
    concerned = moved > 0.05 * moved.max()
    worst, each = 0.0, len(y) - 1
    for columns, values in ((moves, y), (np.diff(moves, axis=0) / np.sqrt(2), np.diff(y, axis=0) / np.sqrt(2))):
        basis, v = orthonormal(columns[:, concerned].reshape(-1, columns.shape[2])), values[:, concerned].reshape(-1)
        explained, df = float(np.sum((basis.T @ v) ** 2)), each * int(concerned.sum()) - basis.shape[1]
        if df <= 0 or not basis.shape[1]:
            return 1.0
        error = max((float(v @ v) - explained) / df, 1.0)
        worst = max(worst, f_tail(explained / basis.shape[1] / error, basis.shape[1], df))
    return worst


def _own(problem: Problem, columns: FloatArray, pure: FloatArray) -> FloatArray:
    """(n_rep, S L, q) parameters of each replication's own fit to `columns` (S, n, q) over errors (S,)."""
    data = problem.scene.data
    h = attitude_columns(data.pitch_deg, data.roll_deg, roll=problem.scene.roll)
    metric = np.linalg.qr(h, mode="r") / np.sqrt(data.replicates.size)
    rows: list[NDArray[np.bool_]] = [data.replicate_index == r for r in range(data.replicates.size)]
    own = [metric @ np.linalg.pinv(h[picked]) @ columns[:, picked] / pure[:, None, None] for picked in rows]
    return np.stack([block.reshape(-1, columns.shape[2]) for block in own])
