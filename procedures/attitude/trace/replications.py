"""The stratum of replications: effects that are nearly constant within a replication and vary between replications.

Each replication's own parameters are one observation here, so there are only n of them. The influence of a candidate is
a direction in the space of parameters and a size for each replication; the parameters along that direction are
regressed on that size. In addition to the known scatter from readings, replications may differ independently and may
have a random walk (`offsets.py`): a trend in six offsets that a random walk explains is not a trend.

A package that slips turns all sensors together. The other movements of their axes, 9 numbers per replication for three
sensors, give the error for its test.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.quantiles import f_tail
from rig.procedures.attitude.trace.offsets import VARIANCES, slopes, wandering
from rig.procedures.attitude.trace.problem import Problem
from rig.procedures.attitude.trace.score import errors, whiten
from rig.procedures.attitude.trace.walks import STEPS

FEWEST = 4
"""Minimum number of replications for tests at this level."""
SHOWS = 0.25
"""Minimum ratio of a column's influence between replications, in squared errors there, to that within them; below it a
test gains nothing.
"""
REACHES = 0.05
"""Minimum share of a column's influence on a sensor for that sensor to be included."""
IS_OFFSET = 0.5
"""Minimum share of the offset in a direction for it to walk as the offset does within replications."""
SLOWEST = 20.0
"""Ratio of the smallest tried step of a walk within replications to one that cannot be seen there."""
MOVES = 1e-4
"""Minimum share of a column's square that is a change of replications' own parameters."""


@dataclass(frozen=True, eq=False)
class Slow:
    """Influence of candidates on the own parameters of n replications of S sensors: Q visible columns, and slips.

    Attributes:
        columns: (Q,) the candidates.
        searched: (Q,) whether they have a searched constant of any value; few boundaries are counted as known moments.
        x: (S, n, Q) size of the change along the direction of a column's largest influence on a sensor's parameters,
            centred; for sensors that a column does not concern, that of the same term on them, or zero.
        direction: (S, L, Q) these directions, or zero.
        tested: (S, Q) sensors that the column concerns.
        others: (S, Q) sensors of the same term that this column does not concern.
        share: (Q,) share of the information about a column's coefficient from between replications.
        slips: units of stratum "replication".
    """

    columns: IntArray
    searched: NDArray[np.bool_]
    x: FloatArray
    direction: FloatArray
    tested: NDArray[np.bool_]
    others: NDArray[np.bool_]
    share: FloatArray
    slips: tuple[int, ...]

    def of(self, picked: Sequence[int]) -> Slow:
        """The same for some of the columns."""
        at = np.array(picked, np.int64)
        return Slow(
            self.columns[at],
            self.searched[at],
            self.x[..., at],
            self.direction[..., at],
            self.tested[:, at],
            self.others[:, at],
            self.share[at],
            self.slips,
        )


@dataclass(frozen=True, eq=False)
class Between:
    """Tests between replications for each unit, (U,); p is one if there is no test.

    Attributes:
        p: probability of such a relation by chance.
        sign: of the coefficient; zero for units of several columns.
        share: see `Slow`.
    """

    p: FloatArray
    sign: FloatArray
    share: FloatArray


def slow_of(problem: Problem) -> Slow:
    """Candidates tested between replications: those that are not between points, and visible enough there."""
    n, sensors, size = problem.own.shape[:3]
    picked = [j for j, c in enumerate(problem.candidates) if c.effect.stratum not in ("between-point", "replication")]
    if n < FEWEST:
        picked = []
    sigma = errors(problem, ())
    own = problem.own[..., picked] / sigma[:, None, None]
    moved = np.sum(own**2, axis=(0, 2))
    within = np.einsum("sj,s->j", problem.products["points"].of(picked, picked), sigma**-2.0)
    length2 = np.einsum("sj,s->j", problem.length[:, picked] ** 2, sigma**-2.0)
    between = moved.sum(axis=0)
    tested = moved > REACHES * between
    kept = np.flatnonzero((between > MOVES * length2) & (between > SHOWS * within))
    x, direction = np.zeros((sensors, n, len(picked))), np.zeros((sensors, size, len(picked)))
    at = np.nonzero(tested)
    each = own[:, at[0], :, at[1]]
    largest = np.linalg.svd(each, full_matrices=False)[2][:, 0]
    direction[at[0], :, at[1]], x[at[0], :, at[1]] = largest, np.einsum("knl,kl->kn", each, largest)
    others = np.zeros_like(tested)
    named = [(problem.candidates[j].effect.name, problem.candidates[j].term.name) for j in picked]
    alike: dict[tuple[str, str], list[int]] = {}
    for q, name in enumerate(named):
        alike.setdefault(name, []).append(q)
    alone = tested.sum(axis=0) == 1
    pairs = [(q, other) for q in kept[alone[kept]].tolist() for other in alike[named[q]] if other != q]
    if pairs:
        mine, of = np.array(pairs, np.int64).T
        there, k = np.nonzero(tested[:, of] & ~tested[:, mine])
        others[there, mine[k]] = True
        x[there, :, mine[k]], direction[there, :, mine[k]] = x[there, :, of[k]], direction[there, :, of[k]]
    slips = tuple(
        u
        for u, unit in enumerate(problem.units)
        if n >= FEWEST
        and problem.candidates[unit[0]].effect.stratum == "replication"
        and problem.judged_at[unit[0]] == "replications"
        and np.sum((problem.own[..., unit] / sigma[:, None, None]) ** 2)
        > MOVES * np.max(problem.length[:, unit] ** 2 / sigma[:, None] ** 2)
    )
    columns = np.array(picked, np.int64)[kept]
    return Slow(
        columns=columns,
        searched=np.array([problem.candidates[j].effect.name in problem.any_value for j in columns], np.bool_),
        x=x[..., kept],
        direction=direction[..., kept],
        tested=tested[:, kept],
        others=others[:, kept],
        share=between[kept] / (between + within)[kept],
        slips=slips,
    )


def between_replications(
    problem: Problem, slow: Slow, chosen: tuple[int, ...], gamma: FloatArray, only: tuple[int, ...] | None = None
) -> Between:
    """Tests between replications of every unit beside the `chosen` candidates.

    Args:
        problem: the run.
        slow: the tested candidates.
        chosen: candidates already in the model.
        gamma: their coefficients.
        only: tested units, against the walk of the offset too that remains within replications beside each; None for
            all units, without it, which is faster and seldom less strict.
    """
    slow = slow if only is None else slow.of([q for q, j in enumerate(slow.columns) if problem.unit_of[j] in only])
    out = Between(*(np.full(len(problem.units), value) for value in (1.0, 0.0, 0.0)))
    sigma = errors(problem, chosen)
    own = (problem.own_outputs - problem.own[..., list(chosen)] @ gamma) / sigma[:, None]
    in_model = {problem.unit_of[j] for j in chosen}
    known = errors(problem, ())
    scale = (known / sigma)[:, None, None]
    share, direction = slow.direction[:, 0] ** 2, slow.direction.copy()
    # an offset that wanders, the first parameter, would show by its share in every other direction
    wanders = np.where(share < IS_OFFSET, wandering(own[:, :, 0].T)[:, None], 0.0)
    without = wanders > 0.0
    direction[:, 0][without] = 0.0
    size = np.where(without, np.sqrt(1.0 - share), 1.0)[:, None]
    values = np.einsum("nsl,slq->snq", own, direction / size)
    # only the offset walks; a row's step, in squares of a replication's own error
    walk = np.where(without, 0.0, share) * problem.wander[:, None] * (len(problem.scene.data) / len(own)) ** 2
    within = None if only is None else _walks_within(problem, chosen, slow.columns, share)
    wanders = np.max(np.where(slow.tested, wanders, 0.0), axis=0)
    p, sign = slopes(slow.x * scale * size, values, slow.tested, slow.others, walk, within, wanders)
    for q, j in enumerate(slow.columns.tolist()):
        u = problem.unit_of[j]
        columns = len(problem.units[u])
        if u not in in_model and columns * p[q] <= out.p[u]:
            out.p[u], out.share[u] = min(columns * p[q], 1.0), slow.share[q]
            out.sign[u] = sign[q] if columns == 1 else 0.0
    for u in slow.slips:
        if u not in in_model and (only is None or u in only):
            moves = problem.own[..., problem.units[u]] / sigma[:, None, None]
            out.p[u] = _p_turn(moves.reshape(len(own), -1, moves.shape[3]), own.reshape(len(own), -1))
            out.share[u] = 1.0
    return out


def _walks_within(problem: Problem, chosen: tuple[int, ...], tested: IntArray, share: FloatArray) -> FloatArray:
    """(T, S, Q) evidence for each t of a walk of the offset, within replications and beside each of Q `tested` columns.

    Only directions that are offsets, by their `share` (S, Q), have it. Evidence against a walk is not used: offsets may
    change while the run pauses between replications.
    """
    out = np.zeros((VARIANCES.size, *share.shape))
    if not tested.size or problem.levels.df(problem.levels.of_error) <= 0:
        return out
    level = problem.levels.of_error
    walks, each = problem.levels.walks(level), len(problem.scene.data) / len(problem.own)
    step = np.log(VARIANCES[1:, None] / np.maximum(share, IS_OFFSET)[:, None] / each**2)
    known = np.log([STEPS[1] / SLOWEST, *STEPS[1:]])
    white = whiten(problem, level, chosen, errors(problem, chosen), tested.tolist())
    length2 = np.maximum(np.sum(white.columns**2, axis=(0, 1)), np.finfo(float).tiny)
    fitted = np.einsum("snq,sn->q", white.columns, white.outputs) / length2
    for s, left in enumerate(white.outputs[:, :, None] - white.columns * fitted):
        mine = np.flatnonzero(share[s] >= IS_OFFSET)
        if not mine.size:
            continue
        likelihood = walks.log_likelihood(np.einsum("tqq->tq", walks.products(left[:, mine])))
        for q, own in zip(mine, (likelihood - likelihood[0]).T, strict=True):
            out[1:, s, q] = np.interp(step[s, :, q], known, own)
    return np.maximum(out, 0.0)


def _p_turn(moves: FloatArray, y: FloatArray) -> float:
    """P of a unit that changes several parameters of all sensors in a common proportion from some replication on.

    Other changes of those parameters are the error, if they exceed the scatter of readings. It is tested on the
    parameters, for independent differences between replications, and on their changes, for a random walk; the larger p
    counts.

    Args:
        moves: (n_rep, m, q) influence of each of the unit's columns on the m parameters, centred.
        y: (n_rep, m) the parameters over their scatter from readings, centred.
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
