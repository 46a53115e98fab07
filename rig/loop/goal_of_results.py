"""Goals of results: expanded uncertainty with the register of equipment, and of predictions by the scatter alone.

A budget has parts that further replications make smaller, and parts that they do not: errors of instruments, one
reading in use, differences between rising and falling series. The second ones are the least uncertainty of any number
of replications; where that is above the goal, no further one is made.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rig.bench.config import BenchConfig
from rig.bench.contract_files import bench_of_run
from rig.errors import ConfigurationError, UsageError
from rig.fitter.budget import Budgeted, TypeA, budgets
from rig.fitter.sequential import widening
from rig.procedures.evaluate.confirming import ConfirmedFit
from rig.procedures.evaluate.stated import Statements
from rig.procedures.kinds import kind_of_table
from rig.procedures.plan.settings import GoalSettings
from rig.procedures.present.numbers import number
from rig.procedures.tables.table import Table
from rig.register import DOCUMENT, KnownConditions, Register
from rig.run_file.read.reader import RunReader
from rig.tables.segments import table_of
from rig.tables.table_of_run import run_table
from rig.verbs.budget.evaluation import Evaluated, OfRun, RunBudget, budget_of, checked_run, shapes_at

_PROBABILITY = 0.95


@dataclass(frozen=True)
class Aim:
    """A value with a goal.

    Attributes:
        name: its name.
        value: the value.
        known: how well it is known, as the begin of a sentence.
        half: half-width of its 95 % interval, which holds in spite of looking.
        goal: largest half-width.
        least: half-width that no number of replications goes below.
        by: the largest influences that remain there, with their shares.
    """

    name: str
    value: float
    known: str
    half: float
    goal: float
    least: float = 0.0
    by: str = ""


@dataclass(frozen=True)
class Made:
    """Replications that were made.

    Attributes:
        segments: files of the first run, of its further replications, and of runs that are one with it.
        first: number of replications of the first of them.
        count: number of all replications.
    """

    segments: Sequence[Path]
    first: int
    count: int

    @cached_property
    def start(self) -> Table:
        """Table of the first file."""
        return run_table(self.segments[0])

    @cached_property
    def table(self) -> Table:
        """Table of all together."""
        return table_of(self.segments, self.segments[0])


@dataclass(frozen=True)
class _Sort:
    """One sort of goals: `U` with the register, or `prediction` without.

    Attributes:
        key: its name in the procedure.
        goals: largest expanded uncertainty by name.
        words: what the expanded uncertainty is of.
    """

    key: str
    goals: Mapping[str, float]
    words: str

    def goal_of(self, result: str) -> float | None:
        """The goal of a result: of its own name, or of its name without the point. None if it has none."""
        for name, goal in self.goals.items():
            if result == name or result.startswith(f"{name} at "):
                return goal
        return None


def of_results(goal: GoalSettings, made: Made, looks: int, model: ConfirmedFit | None = None) -> Iterator[Aim]:
    """Goals of expanded uncertainties and of predictions.

    Args:
        goal: of the procedure.
        made: the replications so far.
        looks: maximum number of looks.
        model: the calibration with the causes that further runs settled; None for the declared model.

    Raises:
        UsageError: no result has a given name.
        ConfigurationError: the register of equipment cannot be used.
        DataError: there are no budgets of this kind, or a point cannot be used.
    """
    evaluated, first = None if model is None else model.evaluation, made.first
    if goal.U:
        now = _with_register(made.segments)
        before = now if len(made.segments) == 1 else _with_register(made.segments[:1])
        sort = _Sort("U", goal.U, "with the register")
        yield from _aims(sort, goal, (before, now), first, looks, evaluated)
    if goal.prediction:
        bench = _bench(made.segments[0])
        now, before = _alone(made.table, bench), _alone(made.start, bench)
        names = {f"{sensor} output": half for sensor, half in goal.prediction.items()}
        sort = _Sort("prediction", names, "by the scatter of the run alone")
        yield from _aims(sort, goal, (before, now), first, looks, evaluated)


def check_goal(goal: GoalSettings, documents: Mapping[str, str]) -> None:
    """Refuse a goal of expanded uncertainty on a bench without a register. Raises `ConfigurationError`."""
    if goal.U and DOCUMENT not in documents:
        raise ConfigurationError(
            "goal.U is an expanded uncertainty, and the bench has no register of equipment (docs/how_to/register.md); "
            "goal.prediction and goal.sigma need none"
        )


def _with_register(segments: Sequence[Path]) -> OfRun:
    checked = checked_run(segments[0], more=segments[1:])
    if checked.reasons:
        raise ConfigurationError("; ".join(checked.reasons))
    return checked.of


def _bench(path: Path) -> BenchConfig:
    with RunReader.open(path) as reader:
        return bench_of_run(reader.documents(), str(path))


def _alone(table: Table, bench: BenchConfig) -> OfRun:
    """A run without its register."""
    kind = kind_of_table(table)
    if kind is None:
        raise UsageError(f"{table.source}: its kind of calibration is not known")
    return OfRun(table, kind, bench, Register(), Statements(), (), KnownConditions())


def _aims(
    sort: _Sort,
    goal: GoalSettings,
    runs: tuple[OfRun, OfRun],
    first: int,
    looks: int,
    evaluated: Evaluated | None,
) -> Iterator[Aim]:
    """Aims of one sort; the runs are those at the first look and now."""
    of = runs[1]
    now = _budgeted(of, goal, evaluated)
    fewer = _df(now if runs[0] is of else _budgeted(runs[0], goal, None))
    names = now.evaluation.results.names
    aimed = {j: half for j, name in enumerate(names) if (half := sort.goal_of(name)) is not None}
    lacking = [name for name in sort.goals if not any(_Sort("", {name: 1.0}, "").goal_of(one) for one in names)]
    if lacking:
        every = dict.fromkeys(name.partition(" at ")[0] for name in names)
        raise UsageError(f"goal.{sort.key}: no result is named {', '.join(lacking)}; known: {', '.join(every)}")
    factors = np.ones(len(names))
    for j in aimed:
        df = float(fewer[j])
        factors[j] = widening(round(df, 1), round(max(df / first, 1.0), 1), looks, first)
    replicated = {one.name for one in of.stated.errors if one.behaves == "replication"}
    wide = _again(now, [_scaled(now.type_a[0], factors**2), *now.type_a[1:]])
    least = _again(now, [_left(now), *(_without_fit(one) for one in now.type_a[1:] if one.name not in replicated)])
    for j, half in aimed.items():
        U, value = wide[j].expanded_uncertainty, float(now.evaluation.results.values[j])
        known = f"U of {names[j]} is {number(U)} {wide[j].unit} ({sort.words}, 95 %, in spite of looking)"
        yield Aim(names[j], value, known, U, half, least[j].expanded_uncertainty, _by(least[j]))


def _budgeted(of: OfRun, goal: GoalSettings, evaluated: Evaluated | None) -> RunBudget:
    asked: dict[str, Any] = {"at": goal.at, "same_meter": goal.same_meter, "shapes": shapes_at(_PROBABILITY)}
    return budget_of(of, evaluated=evaluated, **asked)


def _df(made: RunBudget) -> Any:
    """(m,) degrees of freedom of the scatter of each result."""
    one = made.evaluation.results.type_a
    return np.broadcast_to(np.asarray(one.df, np.float64), (len(one.covariance),))


def _scaled(one: TypeA, by: Any) -> TypeA:
    return replace(one, covariance=np.diag(np.diag(one.covariance) * by))


def _left(made: RunBudget) -> TypeA:
    """The scatter that no further replication makes smaller: that of one reading in use."""
    results = made.evaluation.results
    left = np.maximum(np.diag(results.type_a.covariance) - results.of_fit, 0.0)
    return replace(results.type_a, covariance=np.diag(left), df=np.inf)


def _without_fit(one: TypeA) -> TypeA:
    """A difference between sides without the scatter that it was estimated with."""
    return one if one.deviation is None else replace(one, covariance=np.outer(one.deviation, one.deviation))


def _again(made: RunBudget, type_a: Sequence[TypeA]) -> tuple[Budgeted, ...]:
    """The budgets with other covariances by statistics."""
    results = made.evaluation.results
    told = (results.names, results.units, results.values)
    return budgets(*told, type_a, made.influences, shapes=shapes_at(_PROBABILITY), forecast=True)


def _by(one: Budgeted) -> str:
    """The largest influences of a result, until they have two thirds of its variance, at most three."""
    said, share = [], 0.0
    for line in sorted(one.contributions, key=lambda line: -line.share)[:3]:
        if share < 2.0 / 3.0 and line.share > 0.0:
            said.append(f"{line.name} ({line.share:.0%} of the variance, type {line.kind})")
            share += line.share
    return " and ".join(said)
