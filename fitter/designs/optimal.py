"""D- and I-optimal designs of a declared model, with hard-to-change factors as whole plots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.designs.best_design import Problem, Starts, improved, moves, random_starts, shaken
from rig.fitter.designs.evaluate import Evaluation, evaluated
from rig.fitter.designs.factors import Factor
from rig.fitter.designs.plots import checked_eta, numbered, sizes, whitened
from rig.fitter.designs.polish import Polish
from rig.fitter.designs.region import Allowed, Columns, Region
from rig.fitter.errors import FitError

Criterion = Literal["D", "I"]

MOST_STARTS = 500
FEWEST_STARTS = 20
ROUNDS = 5
PARENTS = 10
"""Different good designs that are shaken in a round."""
WORK = 2e9
"""Size of a search in products, a few seconds, that limits the number of starts of large problems."""
TOGETHER = 4_000_000
"""Numbers in memory that designs improved side by side may need."""
POLISHED = 3
SAME = 1e-7
"""Relative difference of D- or I-criteria below which two designs count as equally good."""


@dataclass(frozen=True, eq=False)
class Design:
    """An optimal design: existing points first, then the new ones, whole plot by whole plot.

    The order is for reading; the order of execution is drawn elsewhere.

    Attributes:
        points: (n, k) settings.
        whole_plot: (n,) from 0; None for independent points.
        existing: number of points that were there before.
        criterion: "D" or "I".
        starts: number of random starts.
        reached: number of random starts that ended as good as the best design, before refinement. Good designs are
            also shaken and improved again; if that alone found the best, the number is 0. With 0 to 3 a longer search
            may find a better one.
        evaluation: precision and efficiencies.
    """

    points: FloatArray
    whole_plot: IntArray | None
    existing: int
    criterion: Criterion
    starts: int
    reached: int
    evaluation: Evaluation


def optimal(
    factors: Sequence[Factor | ArrayLike],
    columns: Columns,
    n: int,
    *,
    names: Sequence[str] | None = None,
    hard: Sequence[int] = (),
    whole_plots: int | Sequence[int] | None = None,
    eta: float = 1.0,
    criterion: Criterion = "D",
    existing: ArrayLike | None = None,
    existing_plot: ArrayLike | None = None,
    allowed: Allowed | None = None,
    starts: int | None = None,
    seed: int = 0,
) -> Design:
    """The best of many locally optimal designs; the same for the same seed.

    Args:
        factors: k factors; a sequence of numbers means levels (`Factor.at`).
        columns: model matrix (m, p) of (m, k) points, for any m.
        n: number of new points.
        names: of the p terms.
        hard: indices of hard-to-change factors, constant within a whole plot.
        whole_plots: number of new whole plots, or the size of each; needed with hard factors. Without hard factors
            they are random blocks.
        eta: variance between whole plots over that within.
        criterion: "D" makes the coefficients precise (largest |X'V^-1 X|), "I" predictions (least mean variance over
            the region).
        existing: (n0, k) points that were measured already and count.
        existing_plot: (n0,) their whole plots; no new point is added to these.
        allowed: which of (m, k) points may be set.
        starts: number of random starts; by default up to 500, less for large problems.
        seed: of the random starts.

    Raises:
        FitError: too few points, whole plots or levels for the model, or arguments that do not fit together.
    """
    region = Region.of(factors, columns, names, allowed)
    plots = _plots(n, hard, whole_plots, len(region.factors))
    eta = checked_eta(eta) if plots is not None else 0.0
    if criterion not in ("D", "I"):
        raise FitError(f"the criterion is D or I, not {criterion}")
    before, before_plot = _existing(region, existing, existing_plot, plots is not None)
    known_rows = whitened(region.rows(before), before_plot, eta)
    known = np.asarray(known_rows.T @ known_rows)
    target = region.moments if criterion == "I" else None
    _enough(region, n + len(before), plots, tuple(hard), before)
    table = _Table.of(region, tuple(hard))
    problem = table.problem(np.ones(n, np.int64) if plots is None else plots, eta, known, target)
    count = _starts(problem, starts)
    found, values = _search(problem, count, seed)
    if not np.isfinite(values).any():
        raise FitError(
            f"none of {count} random starts determines all {len(region.names)} terms: "
            "more points, more whole plots or more levels are needed"
        )
    best, scale = values.max(), len(region.names) if criterion == "D" else abs(values.max())
    order = np.argsort(
        -np.round((values - best) / scale / SAME), kind="stable"
    )  # the first of equals: no rounding chooses
    polished = POLISHED if any(f.free for f in region.factors) else 1
    designs = []
    for start in order[:polished]:
        if np.isfinite(values[start]):
            points = table.points(found, int(start), problem.plot_of)
            new = Polish(region, points, problem.plot_of, tuple(hard), eta, known, target).run()
            designs.append(_design(region, before, before_plot, new, problem, plots is not None, eta))
    chosen = max(designs, key=lambda e: round(_value(e, criterion) / scale / SAME))
    reached = int(np.sum(values[:count] >= best - SAME * scale))
    return Design(chosen.points, chosen.whole_plot, len(before), criterion, count, reached, chosen)


def _value(e: Evaluation, criterion: Criterion) -> float:
    return e.log_determinant if criterion == "D" else -e.mean_variance


@dataclass(frozen=True, eq=False)
class _Table:
    """All combinations of levels, hard ones by easy ones."""

    region: Region
    hard: tuple[int, ...]
    easy: tuple[int, ...]
    settings: FloatArray
    """(H, E, k)"""

    @classmethod
    def of(cls, region: Region, hard: tuple[int, ...]) -> _Table:
        easy = tuple(i for i in range(len(region.factors)) if i not in hard)
        counts = [len(f.levels) for f in region.factors]
        order = (*hard, *easy)
        mesh = np.meshgrid(*[np.array(region.factors[i].levels) for i in order], indexing="ij")
        settings = np.empty((mesh[0].size, len(order)))
        for position, i in enumerate(order):
            settings[:, i] = mesh[position].reshape(-1)
        h = int(np.prod([counts[i] for i in hard], dtype=np.int64))
        return cls(region, hard, easy, settings.reshape(h, -1, len(order)))

    def problem(self, plots: IntArray, eta: float, known: FloatArray, target: FloatArray | None) -> Problem:
        flat = self.settings.reshape(-1, self.settings.shape[2])
        allowed = self.region.may(flat)
        rows = np.zeros((len(flat), len(self.region.names)))
        rows[allowed] = self.region.rows(flat[allowed])
        shape = self.settings.shape[:2]
        levels = [len(f.levels) for f in self.region.factors]
        return Problem(
            rows=rows.reshape(*shape, -1),
            allowed=allowed.reshape(shape),
            hard_shape=tuple(levels[i] for i in self.hard) or (1,),
            easy_shape=tuple(levels[i] for i in self.easy) or (1,),
            sizes=plots,
            eta=eta,
            known=known,
            target=target,
        )

    def points(self, starts: Starts, which: int, plot_of: IntArray) -> FloatArray:
        """(n, k) points of one design."""
        return np.asarray(self.settings[starts.hard[which, plot_of], starts.easy[which]])


def _plots(n: int, hard: Sequence[int], whole_plots: int | Sequence[int] | None, factors: int) -> IntArray | None:
    """(W,) sizes of the new whole plots; None for independent points."""
    if n < 1:
        raise FitError(f"a design needs a point, not {n}")
    if any(not 0 <= i < factors for i in hard) or len(set(hard)) != len(hard):
        raise FitError(f"hard factors are different numbers from 0 to {factors - 1}, not {tuple(hard)}")
    if whole_plots is None:
        if hard:
            raise FitError("with hard-to-change factors say how many whole plots there are")
        return None
    if isinstance(whole_plots, int | np.integer):
        if not 1 <= whole_plots <= n:
            raise FitError(f"{n} points cannot be divided into {whole_plots} whole plots")
        return sizes(n, int(whole_plots))
    given = np.asarray(whole_plots, np.int64)
    if given.size == 0 or given.min() < 1 or given.sum() != n:
        raise FitError(f"whole plots of {given.tolist()} points do not make {n} points")
    return given


def _existing(
    region: Region, existing: ArrayLike | None, plot: ArrayLike | None, in_plots: bool
) -> tuple[FloatArray, IntArray | None]:
    """(n0, k) points that are there, and their whole plots from 0."""
    if existing is None:
        return np.empty((0, len(region.factors))), np.empty(0, np.int64) if in_plots else None
    points = np.asarray(existing, np.float64)
    region.raw(points)
    if in_plots and plot is None:
        raise FitError("say which whole plot each existing point belongs to")
    return points, numbered(plot, len(points)) if in_plots else None


def _enough(region: Region, n: int, plots: IntArray | None, hard: tuple[int, ...], before: FloatArray) -> None:
    """Refuse a number of points or of new whole plots that cannot determine the terms."""
    p = len(region.names)
    if n < p:
        raise FitError(f"{n} points cannot determine {p} terms; at least {p} are needed")
    if plots is None or len(before):
        return
    only = _hard_terms(region, hard)
    if plots.size < only:
        raise FitError(
            f"{plots.size} whole plots cannot determine the {only} terms of hard-to-change factors; at least {only} "
            f"are needed, and {only + 1} to estimate the error between whole plots"
        )


def _hard_terms(region: Region, hard: tuple[int, ...]) -> int:
    """Number of terms, combinations included, that are constant within every whole plot."""
    rows, points = region.rows(region.candidates), region.candidates
    group = np.unique(points[:, list(hard)], axis=0, return_inverse=True)[1].reshape(-1)
    size = np.bincount(group)
    means = np.stack([np.bincount(group, column) / size for column in rows.T], axis=1)
    within = np.linalg.svd(rows - means[group], compute_uv=False)
    least = 1e-8 * np.sqrt(len(rows))
    return len(region.names) - int(np.count_nonzero(within > least))


def _design(
    region: Region,
    before: FloatArray,
    before_plot: IntArray | None,
    new: FloatArray,
    problem: Problem,
    in_plots: bool,
    eta: float,
) -> Evaluation:
    plot_of = problem.plot_of if in_plots else np.zeros(len(new), np.int64)
    order, plot = _readable(np.round(new, 12), plot_of)
    points = np.vstack([before, new[order]])
    if before_plot is None:
        return evaluated(region, points, None, eta)
    offset = int(before_plot.max(initial=-1)) + 1
    return evaluated(region, points, np.concatenate([before_plot, plot + offset]), eta)


def _readable(points: FloatArray, plot_of: IntArray) -> tuple[IntArray, IntArray]:
    """Order of points, ascending in each whole plot and whole plots by their points; and the new plot numbers."""
    members = [np.flatnonzero(plot_of == plot) for plot in range(int(plot_of.max()) + 1)]
    members = [m[np.lexsort(points[m].T[::-1])] for m in members]
    members.sort(key=lambda m: (-len(m), points[m].tolist()))
    return np.concatenate(members), np.repeat(np.arange(len(members)), [len(m) for m in members])


def _starts(problem: Problem, asked: int | None) -> int:
    """Number of starts, from the work that each takes."""
    if asked is not None:
        if asked < 1:
            raise FitError(f"a search needs a start, not {asked}")
        return asked
    p, criterion = problem.rows.shape[2], 1.0 if problem.target is None else 2.0
    of_points = float(problem.sizes.sum()) * _settings(problem.easy_shape) * p**2
    of_plots = float(problem.sizes.size) * (_settings(problem.hard_shape) - 1) * p**3
    each = 16.0 * criterion * (of_points + of_plots)
    return int(np.clip(WORK / each, FEWEST_STARTS, MOST_STARTS))


def _search(problem: Problem, count: int, seed: int) -> tuple[Starts, FloatArray]:
    """Improved designs and their criteria: first `count` from random starts, then as many from shaken good ones."""
    random = np.random.default_rng(seed)
    found, values = _improved(problem, random_starts(problem, count, random))
    for _ in range(ROUNDS):
        best = np.unique(np.round(values / SAME), return_index=True)[1][::-1][:PARENTS]
        best = best[np.isfinite(values[best])]
        if not best.size:
            break
        parents = found[best[np.arange(-(-count // ROUNDS)) % best.size]]
        children, worth = _improved(problem, shaken(problem, parents, random))
        found = Starts(np.vstack([found.hard, children.hard]), np.vstack([found.easy, children.easy]))
        values = np.concatenate([values, worth])
    return found, values


def _improved(problem: Problem, starts: Starts) -> tuple[Starts, FloatArray]:
    """`improved`, in groups that memory is for."""
    p, largest = problem.rows.shape[2], int(problem.sizes.max())
    each = max(_settings(problem.easy_shape), _settings(problem.hard_shape) * (largest + p)) * p
    group, count = int(np.clip(TOGETHER / each, 1, 200)), len(starts.hard)
    parts = [improved(problem, starts[np.arange(first, min(first + group, count))]) for first in range(0, count, group)]
    together = Starts(np.vstack([s.hard for s, _ in parts]), np.vstack([s.easy for s, _ in parts]))
    return together, np.concatenate([values for _, values in parts])


def _settings(shape: tuple[int, ...]) -> int:
    """Settings that one exchange compares."""
    return sum(int(np.prod([shape[axis] for axis in axes])) for axes in moves(shape))
