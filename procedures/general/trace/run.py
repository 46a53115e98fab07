"""The whole trace of any table, from the residual to the effect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.aliases import DELTA
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.doubts import CHANCE
from rig.fitter.trace.engine.both import Both
from rig.fitter.trace.engine.components import Components
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.left import left_of
from rig.fitter.trace.engine.likelihood import Grid
from rig.fitter.trace.engine.noise import Independent, Noise, Wandering
from rig.fitter.trace.engine.problem import Problem, Quantities
from rig.fitter.trace.engine.refine import refined
from rig.fitter.trace.engine.shared import Shared, scale_of
from rig.fitter.trace.growing_noise import Growth, OfLevels, growth_of
from rig.fitter.trace.keep import kept, never_above
from rig.fitter.trace.not_kept import NotKept
from rig.fitter.trace.search import names_of, prune, search_and_name
from rig.procedures.general.effects.scene import TableScene
from rig.procedures.general.gross import of_table
from rig.procedures.general.trace.candidates import candidates_of
from rig.procedures.general.trace.estimate import error_of, stated

ROUNDS = 3
ORDERS = ("first-order", "second-order", "third-order", "fourth-order", "fifth-order")
"""Kinds that lead their alias class as its simplest even if they are just not significant by themselves."""
LEVEL = 0.05
"""Largest such probability, for the whole run; another member of the class is below `ALPHA`."""
FEWEST_FOR_WANDER = 6
FEWEST_TO_A_GROUP = 3
"""Rows in a whole plot or replication, on average, from which on neighbours in it are asked whether they are alike."""
FITTED, SIZE_OF_FITTED = "fitted", "size of fitted"
"""Drivers of noise: the fitted response and its absolute value."""
MOST_OF_SLOPES = 60
"""Groups with an error in common up to which they are asked for slopes: beyond, each covariance is a large matrix."""
NEAR = 6.0
"""Restricted log-likelihood by which covariances of slopes may be behind the best."""
ALIKE = 1.35
"""Restricted log-likelihood by which they are to be likelier alike than not: one table in ten of rows that are not."""


@dataclass(frozen=True, eq=False)
class TableData:
    """A table for a trace.

    Attributes:
        response: name of the explained column.
        y: (n,) its values, in the order of measurement if known.
        formula: the declared model.
        names: of its k columns.
        columns: (n, k).
        tails: (n, k) rounding errors of the doubles in `columns`.
        scene: roles of the other columns.
        shared: (n,) whole plot or replication with an error in the declared model; None without.
        shares: what these are called, "whole plots" or "replications".
        points: (n,) groups of rows that repeat one setting; None without settings.
        order_unknown: whether rows are sorted by a setting and their order of measurement is unknown: neighbours may be
            correlated, but effects of time cannot be tested.
        numbers: (n,) row number in the file; None for 1, 2, 3.
        sensors: of the run, each of which is searched.
        moving: what had not settled when it was read, by column, with a sentence; of the response, and what was set.
    """

    response: str
    y: FloatArray
    formula: str
    names: tuple[str, ...]
    columns: FloatArray
    tails: FloatArray
    scene: TableScene
    shared: IntArray | None = None
    points: IntArray | None = None
    order_unknown: bool = False
    numbers: IntArray | None = None
    sensors: int = 1
    shares: str = "whole plots"
    moving: Mapping[str, str] = field(default_factory=dict)

    @property
    def rows(self) -> list[int]:
        """Number of each row in the file."""
        numbers = np.arange(len(self.y)) + 1 if self.numbers is None else self.numbers
        return [int(number) for number in numbers]


@dataclass(frozen=True, eq=False)
class Found:
    """Result of a search, with significant effects that were not kept.

    Attributes:
        judge: with the noise beside what was found.
        chosen: candidates in the model.
        growth: of the noise.
        not_kept: significant effects that were not kept.
    """

    judge: TableJudge
    chosen: tuple[int, ...]
    growth: Growth | OfLevels | None
    not_kept: tuple[NotKept, ...]


def problem_of(data: TableData) -> Problem:
    """The table prepared for the search."""
    candidates, large = candidates_of(data.scene, data.response, orthonormal(data.columns))
    time = data.scene.time
    return Problem(
        y=data.y,
        declared=data.columns,
        candidates=candidates,
        noise=_noise(data),
        sd=np.ones(len(data.y)),
        ordered=time is not None or data.order_unknown,
        presumed=time is not None and time.presumed,
        left_out=large,
        sensors=data.sensors,
        quantities=Quantities(np.column_stack(list(known.values()))) if (known := data.scene.quantities) else None,
    )


def search_table(data: TableData, problem: Problem | None = None) -> Found:
    """All that the declared model of a table lacks; `problem` is that of the table, if it is known."""
    problem = problem_of(data) if problem is None else problem
    found = look(TableJudge(problem), data)
    noise = _alike(data, found)
    return found if noise is None else look(TableJudge(problem.given(noise=noise)), data)


def look(judge: TableJudge, data: TableData, rows: IntArray | None = None) -> Found:
    """Search, refine searched constants, weight rows by the noise with the effects, and repeat until there is no
    change.

    For rows sorted by a setting, with unknown order of measurement: after a nonlinearity is significant against
    correlated errors, the remaining correlation is much more likely a part of it than a random walk. Where nothing is,
    what a walk along the rows may be is told as an alias of the wander (`if_independent`).
    """
    growth: Growth | OfLevels | None = None
    _, chosen = search_and_name(judge, lead=judge.lead)
    judge, chosen = _corners_first(judge, chosen)
    if data.order_unknown and any(judge.candidates[j].effect.source == "setting" for j in chosen):
        judge = TableJudge(judge.problem.given(noise=Independent(judge.problem.n)))
        chosen = search_and_name(judge, prune(judge, chosen), judge.lead)[1]
    for _ in range(ROUNDS):
        problem = refined(judge, chosen)
        judge = TableJudge(problem, judge.families) if problem is not judge.problem else judge
        new = _growth(judge, chosen, data, rows)
        settled = problem is judge.problem and (new is None) == (growth is None)
        if new is not None:
            sd = _sd(new, judge, chosen, data, rows)
            sd /= np.exp(np.mean(np.log(sd)))
            weighted = problem.given(sd=sd, noise=problem.noise.over(sd))
            same = growth is not None and growth.driver == new.driver
            judge = TableJudge(weighted, judge.families) if same else TableJudge(weighted)
        growth = new
        _, again = search_and_name(judge, prune(judge, chosen), judge.lead)
        if set(again) == set(chosen) and settled:
            break
        chosen = again
    judge, chosen = _with_fewer_constants(judge, chosen)
    chosen, not_kept = stays(judge, chosen)
    shared = data.shared if data.shared is None or rows is None else data.shared[rows]
    chosen = _simplest_orders(judge, chosen)
    chosen, above = never_above(judge, chosen, partial(stated, judge, shared=shared, beside=chosen), (None,))
    return Found(judge, chosen, growth, (*not_kept, *above))


def if_independent(problem: Problem, data: TableData) -> tuple[str, ...]:
    """Names that are found if errors of neighbouring rows are independent, one hardly by chance.

    Gross errors in neighbouring rows are a level of their own, which curves follow.
    """
    judge = TableJudge(problem.given(noise=Independent(problem.n)))
    judge, chosen = _corners_first(judge, search_and_name(judge, lead=judge.lead)[1])
    if not chosen or min(judge.p_adjusted(chosen, j) for j in chosen) > CHANCE:
        return ()
    return () if of_table(data.y, data.columns, data.shared).rows.size else tuple(names_of(judge.candidates, chosen))


def _corners_first(judge: TableJudge, chosen: tuple[int, ...]) -> tuple[TableJudge, tuple[int, ...]]:
    """The search repeated beside effects of several searched constants, refined, if it found others besides.

    Between the values of a coarse grid a corner is off by so much that its remainder looks like another effect.
    """
    coarse = tuple(j for j in chosen if (own := judge.candidates[j].term.profile) is not None and own.constants > 1)
    if not coarse or coarse == chosen:
        return judge, chosen
    for _ in range(ROUNDS):
        judge = TableJudge(refined(judge, coarse), judge.families)
    return judge, search_and_name(judge, coarse, judge.lead)[1]


def _with_fewer_constants(judge: TableJudge, chosen: tuple[int, ...]) -> tuple[TableJudge, tuple[int, ...]]:
    """One constant of an effect in place of two on the grid around it, where it does as well once it is refined."""
    for name in names_of(judge.candidates, chosen):
        mine = [j for j in chosen if judge.candidates[j].effect.name == name]
        if len(mine) < 2 or any(judge.candidates[j].term.profile is None for j in mine):
            continue
        at = judge.beside(chosen).best
        rss, df = _rss(judge, at, chosen)
        for left_out in mine:
            trial = tuple(j for j in chosen if j != left_out)
            problem = refined(judge, trial)
            other = judge if problem is judge.problem else TableJudge(problem, judge.families)
            if _rss(other, at, trial)[0] - rss <= DELTA * rss / max(df, 1):
                judge, chosen = other, trial
                break
    return judge, chosen


def _rss(judge: TableJudge, at: int, chosen: tuple[int, ...]) -> tuple[float, int]:
    """Residual sum of squares under a covariance, and its degrees of freedom."""
    white, taken = judge.white(at, chosen), judge.taken(at, chosen)
    left = white - taken @ (taken.T @ white)
    return float(left @ left), len(white) - taken.shape[1]


def stays(judge: TableJudge, chosen: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[NotKept, ...]]:
    """The kept ones of the `chosen` candidates."""

    def helps(chosen: tuple[int, ...], own: tuple[int, ...]) -> bool:
        rest = tuple(j for j in chosen if j not in own)
        return error_of(judge, chosen, chosen) < error_of(judge, rest, chosen)

    stay, idle = kept(judge, chosen, helps, "the standard error of a row, with equal weights of all rows,")
    return stay, (*judge.problem.left_out, *idle)


def _simplest_orders(judge: TableJudge, chosen: tuple[int, ...]) -> tuple[int, ...]:
    """`chosen` with the lead of each alias class that is a power of a setting and just not significant by itself."""
    for name in names_of(judge.candidates, chosen):
        mine = [j for j in chosen if judge.candidates[j].effect.name == name]
        first = judge.lead(judge.rivals(chosen, name))
        kind = judge.candidates[first.terms[0]].effect.kind.name
        if first.effect == name or kind not in ORDERS or judge.candidates[mine[0]].effect.source != "setting":
            continue
        trial = tuple(j for j in chosen if j not in mine) + first.terms
        limit = [LEVEL if j in first.terms else ALPHA for j in trial]
        stands_out = all(judge.p_up_to(trial, j, most) <= most for j, most in zip(trial, limit, strict=True))
        rest = tuple(j for j in chosen if j not in mine)
        if stands_out and error_of(judge, trial, trial) < error_of(judge, rest, trial):
            chosen = trial
    return chosen


def _growth(
    judge: TableJudge, chosen: tuple[int, ...], data: TableData, rows: IntArray | None
) -> Growth | OfLevels | None:
    left, kept, fitted = left_of(judge, chosen)
    return growth_of(left, kept, _drivers(data, fitted, rows), _groups(data, rows), data.sensors)


def _sd(
    growth: Growth | OfLevels, judge: TableJudge, chosen: tuple[int, ...], data: TableData, rows: IntArray | None
) -> FloatArray:
    """(n,) standard deviation of each row."""
    if isinstance(growth, OfLevels):
        return growth.sd(_groups(data, rows)[growth.driver])
    return growth.sd(_drivers(data, left_of(judge, chosen)[2], rows)[growth.driver])


def _drivers(data: TableData, fitted: FloatArray, rows: IntArray | None) -> dict[str, FloatArray]:
    """(n,) variables on which the noise may depend."""
    scene = data.scene
    time = {} if scene.time is None else {scene.time.name: scene.time.values}
    every = {**scene.settings, **scene.covariates, **time}
    both_signs = {FITTED: fitted} if fitted.min() < 0.0 < fitted.max() else {}
    size = {SIZE_OF_FITTED: np.abs(fitted)}
    return {**both_signs, **size, **(every if rows is None else {name: v[rows] for name, v in every.items()})}


def _groups(data: TableData, rows: IntArray | None) -> dict[str, IntArray]:
    """(n,) level of each row in groups whose levels may differ in their noise."""
    scene = data.scene
    every = {name: g.index for name, g in {**scene.labels, **scene.groups}.items()}
    if data.shared is not None:
        every[data.shares] = data.shared
    return every if rows is None else {name: level[rows] for name, level in every.items()}


def _noise(data: TableData) -> Noise:
    if data.shared is not None:
        return _of_slopes(data) or Shared(data.shared, scale=scale_of(data.shared, data.y, data.columns))
    when = times_of(data)
    return Independent(len(data.y)) if when is None else Wandering(when)


def _of_slopes(data: TableData) -> Components | None:
    """Noise with slopes of groups over a setting besides their offsets, where these differ; None elsewhere.

    Asked beside the declared model alone: a search with it estimates slopes anew beside every effect.
    """
    group, n = data.shared, len(data.y)
    if group is None or not 1 < int(group.max()) + 1 <= min(MOST_OF_SLOPES, n // FEWEST_TO_A_GROUP):
        return None
    scale, best, ahead = scale_of(group, data.y, data.columns), None, ALIKE
    for values in data.scene.settings.values():
        noise = Components.of(group, np.arange(n), values, scale)
        reml = Grid.of(noise, data.y, data.columns).beside().reml
        none = noise.grid[:, 1] == 0.0
        lead = -np.inf if np.all(none) else float(reml.max() - reml[none].max())
        if lead > ahead:
            best, ahead = noise.among((reml > reml.max() - NEAR) | (np.arange(len(reml)) == 0)), lead
    return best


def times_of(data: TableData) -> FloatArray | None:
    """(n,) times of the rows in units of the usual gap; None where neighbours cannot be told."""
    n, time = len(data.y), data.scene.time
    if n < FEWEST_FOR_WANDER or (time is None and not data.order_unknown):
        return None
    if time is None:
        return np.arange(n, dtype=np.float64)
    gaps = np.diff(time.values)
    usual = float(np.median(gaps[gaps > 0])) if np.any(gaps > 0) else 0.0
    if usual == 0.0 or np.mean(gaps > 0) < 0.5:
        return np.arange(n, dtype=np.float64)
    return np.concatenate([[0.0], np.cumsum(np.clip(gaps / usual, 0.1, 50.0))])


def _alike(data: TableData, found: Found) -> Both | None:
    """Noise with a wander besides what groups share, where neighbours are alike within groups; None elsewhere.

    Asked beside what was found but for effects in time: those may be what a wander looks like.
    """
    judge, when = found.judge, times_of(data)
    if isinstance(judge.problem.noise, Components):
        return None  # it has a memory of its own
    if data.shared is None or when is None or int(data.shared.max()) + 1 >= len(data.y) // FEWEST_TO_A_GROUP:
        return None
    beside = tuple(j for j in found.chosen if judge.candidates[j].effect.source != "time")
    scale = scale_of(data.shared, data.y, data.columns)
    noise, sd = Both(data.shared, when=when, scale=scale), judge.problem.sd
    model = judge.problem.model(beside) / sd[:, None]
    reml = Grid.of(noise.over(sd), judge.held(beside) / sd, model).beside().reml
    return noise if reml.max() - reml[noise.alone].max() > ALIKE else None
