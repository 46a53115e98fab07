"""An attitude run posed for the engine: the strata of its errors, and every unit of candidates by its products in them.

Strata of each sensor are readings within points, means of points, and changes of replications' own parameters of the
declared model.

Scatter of readings gives all of them one variance. Means of points may have more of it, lack of fit; offsets and
sensitivities of replications too, if they differ by chance or walk from one replication to the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.engine.in_strata import InStrata, OfStrata, Stratum
from rig.fitter.trace.engine.noise import BoolArray
from rig.fitter.trace.engine.problem import Candidate
from rig.fitter.trace.engine.strata import LIKE, StrataJudge
from rig.fitter.trace.engine.term import Profile, TableTerm
from rig.procedures.attitude.trace.levels import Level
from rig.procedures.attitude.trace.problem import Problem
from rig.procedures.attitude.trace.score import errors, rounding

LACK_OF_FIT = tuple(np.geomspace(0.3, 1e4, 19).tolist())
"""Variance of the mean of a point beyond that by scatter, over that by scatter; larger ones where a run shows them."""
APART = tuple(np.geomspace(0.3, 1e4, 19).tolist())
"""The same of replications' own parameters that differ by chance."""
WALKS = tuple(np.geomspace(0.1, 2e3, 18).tolist())
"""The same of the steps, if they walk from one replication to the next."""
ROOM = 3.0
"""Largest variance that is tried, over the one that a run shows beside the declared model."""
NEAR, COARSE = 2, 3
"""Options next to that of the middle that are tried, and of all others one in so many."""
ALONE = 6.0
"""Price, in the logarithm of the likelihood, of one sensor's parameters that differ between replications otherwise than
those of the others.
"""
UNLIKE = 2.0
"""Logarithm of the likelihood from which sensors scatter each by itself. Few readings tell each sensor's own scatter
badly: in two replications of twelve points a cause is named half as often as with one scatter for all.
"""
ROUNDS = 6
"""Maximum number of moves of the middle of the covariances."""
PARAMETER = "parameter"
"""Components of replications' own parameters: sensors have them alike, but for that price."""

Middle = tuple[int, ...]
"""For each component, which of its options; the first is none."""


@dataclass(frozen=True)
class Component:
    """A possible variance beyond scatter.

    Attributes:
        kind: which others are alike in other sensors.
        strata: (l,) that it is in.
        options: (o, l) factors of their weights; the first ones are one.
    """

    kind: str
    strata: IntArray
    options: FloatArray

    @cached_property
    def mean(self) -> FloatArray:
        """(o,) logarithm of the options' factors, mean over the strata."""
        return np.asarray(np.log(self.options).mean(axis=1))


@dataclass(frozen=True, eq=False)
class InRun:
    """A run for the engine.

    Attributes:
        problem: the units, whose strata have no weights yet.
        of: (L,) sensor of each stratum.
        between: (L,) whether it is between replications.
        components: of the variance.
        unit: (S,) volts that are one in each sensor's strata: its scatter beside the declared model.
        length: (S, D) lengths of the columns in these units.
        column: (J,) of each candidate among the units' columns.
    """

    problem: InStrata
    of: IntArray
    between: BoolArray
    components: tuple[Component, ...]
    unit: FloatArray
    length: FloatArray
    column: IntArray

    @property
    def none(self) -> Middle:
        """No component."""
        return (0,) * len(self.components)

    @cached_property
    def _grids(self) -> dict[Middle, Covariances]:
        return {}

    def grid(self, middle: Middle) -> Covariances:
        """Covariances about a middle one; a search comes back to the same ones."""
        if middle not in self._grids:
            self._grids[middle] = _about(self, middle)
        return self._grids[middle]


class Covariances(NamedTuple):
    """Covariances of a run.

    Attributes:
        every: G of them.
        factor: (G, L) of the weights of strata.
        shape: (G, C) see `OfStrata`.
        price: (G,) see `OfStrata`.
    """

    every: list[Middle]
    factor: FloatArray
    shape: FloatArray
    price: FloatArray


def posed(problem: Problem) -> InRun:
    """The run for the engine, a candidate of which is a unit; it is posed once."""
    if None not in problem.engines:
        problem.engines[None] = _posed(problem)
    found: InRun = problem.engines[None]
    return found


def engine_of(problem: Problem, chosen: Sequence[int]) -> StrataJudge:
    """The engine's judge of a run, with covariances about the likeliest beside the `chosen` candidates."""
    key = frozenset(chosen)
    if key not in problem.engines:
        run, units, pooled = posed(problem), units_of(problem, chosen), scatters_alike(problem)
        sigma = errors(problem, chosen)
        if pooled:
            sigma = np.full_like(sigma, np.sqrt(np.mean(sigma**2)))
        middle = run.none
        for _ in range(ROUNDS):
            strata, grid = around(run, sigma, middle, pooled=pooled)
            problem.engines[key] = engine = StrataJudge(strata, simulated=problem.simulated)
            best = grid[engine.beside(units).best]
            if best == middle:
                break
            middle = best
    found: StrataJudge = problem.engines[key]
    return found


def scatters_alike(problem: Problem) -> bool:
    """Whether the data say nothing against one scatter of all sensors, in volts (Bartlett)."""
    own, df = errors(problem, ()) ** 2, problem.levels.df(problem.levels.of_error)
    return len(own) > 1 and bool(0.5 * df * np.sum(np.log(np.mean(own) / own)) < UNLIKE)


def units_of(problem: Problem, chosen: Sequence[int]) -> tuple[int, ...]:
    """Units of some candidates, each once."""
    return tuple(dict.fromkeys(problem.unit_of[j] for j in chosen))


def _posed(problem: Problem) -> InRun:
    columns = np.array([j for unit in problem.units for j in unit], np.int64)
    units = errors(problem, ())
    strata, of, between, components = list[Stratum](), list[int](), list[bool](), list[Component]()
    alike, scatter, of_error = list[int](), list[int](), list[bool]()
    every = problem.levels.of_error == "replications"  # the scatter of readings is the mean square of both strata
    for i in range(len(problem.sensors)):
        first = len(strata)
        own = np.flatnonzero(np.isin(columns, problem.concerned[i]))
        for apart, same in (
            (False, _between_points(problem, i, units, columns, own)),
            (True, _between_replications(problem, i, units, columns, own)),
        ):
            for kind, options, some in same:
                if len(options) > 1:
                    components.append(Component(kind, len(strata) + np.arange(len(some)), options))
                strata += some
                alike += [1 + max(alike, default=-1)] * len(some)
                of += [i] * len(some)
                scatter += [first] * len(some)
                between += [apart] * len(some)
                of_error += [not apart and (every or kind == SCATTER)] * len(some)
    none = np.empty(0)
    found = InStrata(
        y=none,
        declared=np.empty((0, 0)),
        candidates=_candidates(problem),
        noise=OfStrata(0, weight=np.ones((1, len(strata))), df=np.array([one.df for one in strata])),
        sd=none,
        ordered=False,
        strata=tuple(strata),
        part=np.array(alike, np.int64),
        scatter=np.array(scatter, np.int64),
        of_error=np.array(of_error, np.bool_),
        length=np.empty(len(columns)),
    )
    length, column = problem.length[:, columns] / units[:, None], np.argsort(columns)
    return InRun(found, np.array(of), np.array(between, np.bool_), tuple(components), units, length, column)


def around(run: InRun, sigma: FloatArray, middle: Middle, *, pooled: bool) -> tuple[InStrata, list[Middle]]:
    """The run with covariances that differ from a middle one in one component, or in all of one kind, and these.

    The first one has none.

    Args:
        run: the run.
        sigma: (S,) standard deviation of a reading.
        middle: the middle one.
        pooled: whether it is one of all sensors.
    """
    grid = run.grid(middle)
    # a gross error in one sensor gives common candidates other weights, until it is left out
    shares = np.append(np.log(sigma**2) - np.mean(np.log(sigma**2)), 2.0 * np.log(LIKE) * pooled)
    sigma, noise = sigma / run.unit, run.problem.noise
    assert isinstance(noise, OfStrata)
    shape = np.column_stack([grid.shape, np.tile(shares, (len(grid.every), 1))])
    held = np.zeros(shape.shape[1], np.bool_)
    held[: len(run.components)] = [one.kind.startswith(PARAMETER) for one in run.components]
    noise = replace(noise, weight=grid.factor * sigma[run.of] ** -2.0, price=grid.price, shape=shape, held=held)
    length = np.sqrt(np.sum((run.length / sigma[:, None]) ** 2, axis=0))
    return run.problem.under(noise, length, pooled=pooled), grid.every


def _about(run: InRun, middle: Middle) -> Covariances:
    options = tuple(len(one.options) for one in run.components)
    each, price = _tried(tuple(one.kind for one in run.components), options, middle)
    factor, shape = np.ones((len(each), len(run.of))), np.zeros(each.shape)
    for k, one in enumerate(run.components):
        factor[:, one.strata] *= one.options[each[:, k]]
        shape[:, k] = one.mean[each[:, k]]
    return Covariances([tuple(one) for one in each.tolist()], factor, shape, price)


@lru_cache(maxsize=512)  # parts of a run have the same components
def _tried(kinds: tuple[str, ...], options: tuple[int, ...], middle: Middle) -> tuple[IntArray, FloatArray]:
    """(G, C) options that are tried about a middle, and (G,) their price, in nats: of what sensors have not alike."""
    at, changes = np.array(middle, np.int64), list[tuple[IntArray, int]]()
    for kind in dict.fromkeys(kinds):
        alike = np.array([k for k, other in enumerate(kinds) if other == kind])
        for option in range(options[alike[0]]):
            tried = alike[np.abs(option - at[alike]) <= NEAR] if option % COARSE else alike
            if len(tried) and np.any(at[alike] != option):
                changes.append((alike, option))
            if len(alike) > 1:
                changes += [(np.array([k]), option) for k in tried[at[tried] != option].tolist()]
    each = np.tile(at, (2 + len(changes), 1))
    each[0] = 0
    for row, (changed, option) in zip(each[2:], changes, strict=True):
        row[changed] = option
    if not any(middle):
        each = each[1:]
    price = np.zeros(len(each))
    for kind in {kind for kind in kinds if kind.startswith(PARAMETER)}:
        own = each[:, [other == kind for other in kinds]]
        alike = np.sum(own[:, :, None] == own[:, None], axis=2).max(axis=1)
        price += ALONE * (own.shape[1] - alike)
    return each, price


Kind = tuple[str, FloatArray, list[Stratum]]
"""Name of a component, its options, and its strata."""
SCATTER = "scatter"


def _up_to(options: tuple[float, ...], shown: float) -> FloatArray:
    """Options as they are, and larger ones in the same steps as far as a run shows such a variance."""
    step = options[-1] / options[-2]
    more = max(int(np.ceil(np.log(max(shown, options[-1]) / options[-1]) / np.log(step))), 0)
    return np.array([*options, *(options[-1] * step ** np.arange(1.0, more + 1.0))])


def _between_points(problem: Problem, i: int, units: FloatArray, columns: IntArray, own: IntArray) -> Iterator[Kind]:
    both, within = (_stratum(problem, level, i, units[i], columns, own) for level in ("replications", "points"))
    if within.df <= 0 or both.df <= within.df:
        yield SCATTER, np.ones((1, 1)), [both]
        return
    assert both.columns is not None
    assert within.columns is not None
    rest = Stratum(
        own,
        both.response - within.response,
        max(both.square - within.square, 0.0),
        both.df - within.df,
        both.columns - within.columns,
        whole=both.whole,
    )
    yield SCATTER, np.ones((1, 1)), [within]
    squares = (problem.products["replications"].square - problem.products["points"].square) / units**2
    options = _up_to(LACK_OF_FIT, ROOM * float(np.max(squares)) / rest.df)
    yield "lack of fit", 1.0 / (1.0 + np.append(0.0, options)[:, None]), [rest]


def _stratum(problem: Problem, level: Level, i: int, unit: float, columns: IntArray, own: IntArray) -> Stratum:
    """Products of one sensor at a level; rounding is error, too."""
    known, df = problem.products[level], float(problem.levels.df(level))
    place = np.append(known.place[i][columns[own]], -1)  # where they have zeros
    gram = np.asarray(known.own[i][place[:, None], place])
    gram /= unit**2
    square = (float(known.square[i]) + max(df, 0.0) * float(rounding(problem)[i]) ** 2) / unit**2
    response, whole = known.outputs[i, columns[own]] / unit**2, problem.length[i, columns[own]] / unit
    return Stratum(own, response, square, df, gram, whole=whole)


def _between_replications(
    problem: Problem, i: int, units: FloatArray, columns: IntArray, own: IntArray
) -> Iterator[Kind]:
    """Changes of each parameter in contrasts that a walk leaves independent."""
    count = len(problem.own)
    if count < 2:
        return
    contrasts = np.linalg.qr(np.column_stack([np.ones(count), np.eye(count)[:, 1:]]))[0][:, 1:].T
    ahead = np.arange(1.0, count + 1)
    variance, vectors = np.linalg.eigh(contrasts @ np.minimum.outer(ahead, ahead) @ contrasts.T)
    turned = vectors.T @ contrasts
    x = np.tensordot(turned, problem.own[:, i][..., columns[own]] / units[i], 1)
    y = np.tensordot(turned, problem.own_outputs / units[:, None], 1)
    # an offset that walks within replications walks from one to the next, too; their scatter is that of as many rows
    known = problem.wander[i] * (len(problem.scene.data) / count) ** 2 * variance
    for k in range(x.shape[1]):
        apart, walks = (
            _up_to(options, ROOM * float(np.max(np.mean(y[:, :, k] ** 2 / by, axis=0))))
            for options, by in ((APART, np.ones((count - 1, 1))), (WALKS, variance[:, None]))
        )
        more = np.concatenate([[0.0 * variance], np.tile(apart, (count - 1, 1)).T, np.outer(walks, variance)])
        rows = (Stratum.of_rows(own, x[c, k : k + 1], y[c, i, k : k + 1]) for c in range(count - 1))
        strata = [replace(one, square=one.square + (float(rounding(problem)[i]) / units[i]) ** 2) for one in rows]
        yield f"{PARAMETER} {k}", 1.0 / (1.0 + more + (known if k == 0 else 0.0)), strata


def _candidates(problem: Problem) -> tuple[Candidate, ...]:
    most, out = problem.most, list[Candidate]()
    for u, unit in enumerate(problem.units):
        one, single = problem.candidates[unit[0]], len(unit) == 1
        labels = tuple(problem.candidates[j].term.name for j in unit)
        term = TableTerm(labels, np.empty((0, len(unit))))
        if one.effect.searched:  # its values are those of the catalogue: none is between two of them
            profile = Profile(float(u), float(u), float(u), lambda _, alone=term: alone)  # type: ignore[misc]
            term = replace(term, profile=profile)
        sign, size = (one.effect.sign(one.term.name), float(most[unit[0]])) if single else (0, np.inf)
        out.append(Candidate(one.effect, term, one.sensor, sign, size))
    return tuple(out)
