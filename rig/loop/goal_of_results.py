"""Goals of results: expanded uncertainty with the register of equipment, and of predictions by the scatter alone.

A budget has parts that further replications make smaller, and parts that they do not: errors of instruments, one
reading in use, differences between rising and falling series. The second ones are the least uncertainty of any number
of replications; where that is above the goal, no further one is made.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rig.bench.config import BenchConfig
from rig.bench.contract_files import bench_of_run
from rig.by_kind import fit_table
from rig.errors import ConfigurationError, RigError, UsageError
from rig.fitter.budget import Budgeted, TypeA, budgets
from rig.fitter.errors import FitError
from rig.fitter.sequential import widening
from rig.procedures.errors import DataError
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

    @property
    def over(self) -> float:
        """Its variance by scatter, over what the goal allows."""
        allowed = self.goal**2 - self.least**2
        return (self.half**2 - self.least**2) / allowed if allowed > 0.0 else math.inf


@dataclass(frozen=True)
class Estimate:
    """A coefficient or parameter of one sensor."""

    sensor: str
    name: str
    value: float
    stderr: float
    df: float
    goal: float

    @property
    def of(self) -> str:
        """The sensor, behind the name."""
        return f" of {self.sensor}" if self.sensor else ""


def estimates(goal: GoalSettings, fitted: Mapping[str, Any]) -> Iterator[Estimate]:
    """The named coefficients and parameters of every sensor that has them, of a fit as JSON.

    Raises:
        UsageError: no sensor has one of them.
    """
    sensors: Mapping[str, Any] = fitted.get("sensors") or {str(fitted.get("response", "")): fitted}
    for name, sigma in goal.sigma.items():
        found = [
            Estimate(sensor, name, float(one["estimate"]), float(one["stderr"]), float(one["df"]), sigma)
            for sensor, of in sensors.items()
            for group in ("parameters", "coefficients")
            if isinstance(one := (of.get(group) or {}).get(name), Mapping) and one.get("stderr") is not None
        ]
        if not found:
            known = sorted(
                {key for of in sensors.values() for g in ("parameters", "coefficients") for key in of.get(g) or {}}
            )
            raise UsageError(f"goal.sigma.{name}: no sensor has such a value; known: {', '.join(known)}")
        yield from found


@dataclass(frozen=True)
class Made:
    """Replications that were made, and points that were added.

    Attributes:
        goal: of the procedure.
        segments: files of the first run, of its further replications, and of runs that are one with it.
        first: number of replications of the first of them.
        replications: number of all replications.
        points: number of points added beside them.
        of_replication: number of points of a replication.
        part: part of a replication that is added at once.
    """

    goal: GoalSettings
    segments: Sequence[Path]
    first: int
    replications: int
    points: int = 0
    of_replication: float = 1.0
    part: float = 1.0

    @property
    def count(self) -> float:
        """Number of replications that have as many points."""
        return self.replications + self.points / self.of_replication

    @property
    def said(self) -> str:
        """How many there are, in words."""
        return f"{self.replications} replications{f' and {self.points} points' if self.points else ''}"

    def wider(self, df: float) -> float:
        """Factor of an interval that holds in spite of looking; `df` at the first look."""
        looks = round((self.goal.most_replications - self.first) / self.part) + 1
        more = round(max(df / self.first, 1.0) * self.part, 1)
        return widening(round(df, 1), more, looks, self.first / self.part)

    def values(self, table: Table) -> dict[str, float]:
        """By name, the values of a table that tell of the aimed ones: the coefficients, and outputs at the points."""
        found: dict[str, float] = {}
        if self.goal.sigma:
            found |= {f"{one.name}{one.of}": one.value for one in estimates(self.goal, fit_table(table).to_json())}
        if self.goal.prediction or self.goal.U:
            with contextlib.suppress(RigError, DataError, FitError):
                results = _budgeted(_alone(table, _bench(self.segments[0])), self.goal, None).evaluation.results
                outputs = (
                    (name, float(value)) for name, value in zip(results.names, results.values, strict=True)
                    if " output" in name
                )  # fmt: skip
                found |= dict(outputs)
        return found

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


def of_results(made: Made, model: ConfirmedFit | None = None) -> Iterator[Aim]:
    """Goals of expanded uncertainties and of predictions.

    Args:
        made: the replications so far.
        model: the calibration with the causes that further runs settled; None for the declared model.

    Raises:
        UsageError: no result has a given name.
        ConfigurationError: the register of equipment cannot be used.
        DataError: there are no budgets of this kind, or a point cannot be used.
    """
    evaluated, goal = None if model is None else model.evaluation, made.goal
    if goal.U:
        now = _with_register(made.segments)
        before = now if len(made.segments) == 1 else _with_register(made.segments[:1])
        sort = _Sort("U", goal.U, "with the register")
        yield from _aims(sort, made, (before, now), evaluated)
    if goal.prediction:
        bench = _bench(made.segments[0])
        now, before = _alone(made.table, bench), _alone(made.start, bench)
        names = {f"{sensor} output": half for sensor, half in goal.prediction.items()}
        sort = _Sort("prediction", names, "by the scatter of the run alone")
        yield from _aims(sort, made, (before, now), evaluated)


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


def _aims(sort: _Sort, made: Made, runs: tuple[OfRun, OfRun], evaluated: Evaluated | None) -> Iterator[Aim]:
    """Aims of one sort; the runs are those at the first look and now."""
    of, goal = runs[1], made.goal
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
        factors[j] = made.wider(float(fewer[j]))
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
