"""Uncertainty budgets of a run: its register of equipment, its scatter, and the whole evaluation of its kind."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rig.bench.config import BenchConfig
from rig.bench.contract_files import bench_of_run
from rig.errors import ConfigurationError, RigError, UsageError
from rig.fitter.arrays import FloatArray
from rig.fitter.budget import NEAR_95, Budgeted, Check, Influence, Shapes, TypeA, budgets, monte_carlo
from rig.fitter.errors import FitError
from rig.procedures.errors import DataError
from rig.procedures.evaluate.budgeting import Evaluation, Results, Shift, Shifts
from rig.procedures.evaluate.influences import corrected, explain, influences, with_more
from rig.procedures.evaluate.readings import as_in_run
from rig.procedures.evaluate.reversibility import EITHER_SIDE
from rig.procedures.evaluate.simulated_budget import whole
from rig.procedures.evaluate.stated import Statements
from rig.procedures.kind import Kind
from rig.procedures.kinds import kind_of_table
from rig.procedures.tables.table import Table
from rig.register import (
    DOCUMENT,
    KnownConditions,
    Register,
    check_covered,
    check_register,
    check_surroundings,
    check_validity,
    register_of,
    stated_of,
)
from rig.register.drift import drift_of_sensor
from rig.register.surroundings import stated_by_hand
from rig.run_file.events.sessions import Identified
from rig.run_file.read.reader import RunReader
from rig.tables import is_run
from rig.tables.segments import joined
from rig.verbs.budget.held import held, outside_of
from rig.verbs.budget.identities import contradicted, not_told
from rig.verbs.budget.lacking import Holding, left_out

BY_SHAPE = (
    "coverage factors are by the shapes of the distributions: smaller than Student's t where limits of error dominate, "
    "and right only if these errors are rectangular, as stated"
)
DOMINATED = (
    "one or two rectangular limits of error, as the register states them, dominate these results (half of the variance "
    "or more); their coverage factor is by the shape of the distribution and smaller than Student's t (EA-4/02, S9 and "
    "S10)"
)
IN_USE = (
    "inferred values are for a use {days:g} days after the run, with the drift of the sensors by their history; "
    "coefficients and outputs are those of the run"
)
SIMULATED = (
    "simulation (JCGM 101): {trials} trials, seed {seed}; the budget's interval agrees for {agree} of {count} results "
    "within half a unit of the second digit of the standard uncertainty"
)
SAME_METER, OTHER_METER = (
    "readings in use are taken to be by the meter of the run, with the same errors, which are taken once",
    "errors of the meter that reads the sensors in use are not in these uncertainties; those of the run's meter are",
)


Evaluated = Callable[[Sequence[Mapping[str, float]], Mapping[str, float]], Evaluation]
"""The evaluation of a run at points, by constants of the place."""


@dataclass(frozen=True)
class OfRun:
    """A run with its register.

    Attributes:
        table: its observations, with the corrections of the certificates.
        kind: of calibration.
        config: its bench.
        register: its register.
        stated: what the register states about its columns.
        corrected: names of the corrections that are not zero.
        told: what is known of the surroundings of the equipment beside the thermometers.
    """

    table: Table
    kind: Kind
    config: BenchConfig
    register: Register
    stated: Statements
    corrected: tuple[str, ...]
    told: KnownConditions


@dataclass(frozen=True)
class RunBudget:
    """Budgets of the results of a run.

    Attributes:
        of: the run.
        evaluation: its evaluation.
        budgets: one of each result.
        sensors: sensor of each result; "" for those of several.
        type_a: covariances of the results.
        influences: on the results.
        notes: sentences for readers.
        checks: of each result by simulation; empty if none was asked for.
        unstated: columns whose errors the register does not state.
        outside: points beyond the settings of the run, as sentences.
        undeclared: results whose budgets have a line for effects that the declared model lacks.
        absorbed: coefficients that have taken up a part of these effects, each with what is said of it.
        lacks: effects that were found and that the model of the results lacks, by output.
        lacking: the same with the states for which the results hold, and how far the run was away, by output.
    """

    of: OfRun
    evaluation: Evaluation
    budgets: tuple[Budgeted, ...]
    sensors: tuple[str, ...]
    type_a: tuple[TypeA, ...]
    influences: tuple[Influence, ...]
    notes: tuple[str, ...]
    checks: tuple[Check, ...] = ()
    unstated: tuple[str, ...] = ()
    outside: tuple[str, ...] = ()
    undeclared: tuple[str, ...] = ()
    absorbed: Mapping[str, str] = field(default_factory=dict)
    lacks: Mapping[str, Sequence[str]] = field(default_factory=dict)
    lacking: Mapping[str, Holding] = field(default_factory=dict)


@dataclass(frozen=True)
class Checked:
    """A run with its register, also where no budget is made of it.

    Attributes:
        of: the run; with an empty register, where it has none.
        reasons: why no budget is made of it, all of them; empty if one is.
        register: whether it has a register.
        stated: whether that states errors, so that a budget could be made if it were not for the reasons.
        untold: instruments that did not say which they are, as sentences.
    """

    of: OfRun
    reasons: tuple[str, ...]
    register: bool
    stated: bool
    untold: tuple[str, ...] = ()


def run_with_register(path: Path, equipment: Path | None = None, more: Sequence[Path] = ()) -> OfRun:
    """A run, corrected by the certificates of its equipment.

    Args:
        path: the run file.
        equipment: another register than the one kept with the run.
        more: files of replications that were added to it.

    Raises:
        UsageError: it is no run file, or has no register.
        ConfigurationError: the register contradicts the bench, is not valid for the run, or does not cover it.
        DataError: its kind is not installed.
    """
    checked = checked_run(path, equipment, more)
    if not checked.reasons:
        return checked.of
    raise (ConfigurationError if checked.register else UsageError)("\n".join(checked.reasons))


def checked_run(path: Path, equipment: Path | None = None, more: Sequence[Path] = ()) -> Checked:
    """A run for a budget, with all reasons against one.

    Args:
        path: the run file.
        equipment: another register than the one kept with the run.
        more: files of replications that were added to it; the first run has bench and register.

    Raises:
        RigError: its register cannot be read, or it is no run file.
    """
    if not is_run(path):
        raise UsageError(f"{path} is no run file: a budget needs the bench of a run and its register of equipment")
    table = joined((path, *more))
    with RunReader.open(path) as reader:
        documents = reader.documents()
    identities = [one for part in (path, *more) for one in _identities_in(part)]
    reasons: list[str] = []
    register = None
    with _noted(reasons, UsageError):
        register = register_of(documents, equipment, run=str(path))
    where = str(equipment) if equipment is not None else f"{path} ({DOCUMENT})"
    if "bench.toml" not in documents:
        raise UsageError(f"{path} has no bench file, which says what reads what: no budget can be made of it")
    config = bench_of_run(documents, str(path))
    return checked_with(table, config, register, identities, where, reasons)


def _identities_in(path: Path) -> list[Identified]:
    with RunReader.open(path) as reader:
        return [one.event for one in reader.records(Identified.kind) if isinstance(one.event, Identified)]


def checked_with(
    table: Table,
    config: BenchConfig,
    register: Register | None,
    identities: Sequence[Identified],
    where: str,
    reasons: list[str],
) -> Checked:
    """Observations with their bench and register, and all reasons against a budget at once.

    Args:
        table: the observations, with days in its provenance.
        config: the bench.
        register: of the equipment; None if there is none, for reasons that are given.
        identities: of the instruments of the run.
        where: name of the register, for messages.
        reasons: those known so far; further ones are added.

    Raises:
        DataError: the kind of calibration is not known.
    """
    kind = kind_of_table(table)
    if kind is None:
        raise DataError(f"{table.source}: its kind of calibration is not known")
    stated, known = None, register is not None
    if register is None:
        register = Register()
    else:
        with _noted(reasons):
            check_register(register, config, where, "bench.toml")
        reasons += contradicted(register, config, identities, where, simulated=table.simulated)
        first, last = (date.fromisoformat(table.provenance[key][:10]) for key in ("began_utc", "last_observation_utc"))
        with _noted(reasons):
            check_validity(register, config, where, first, last, simulated=table.simulated)
        with _noted(reasons):
            stated = stated_of(register, config, last)
            check_covered(stated, table.columns, where)
    told = KnownConditions(stated_by_hand(table.by_hand))
    of = _corrected(table, kind, config, register, stated or Statements(), told)
    with _noted(reasons):
        check_surroundings(register, config, of.table.columns, told, where)
    untold = () if table.simulated else tuple(not_told(register, config, identities))
    return Checked(of, tuple(reasons), known, stated is not None, untold)


@contextmanager
def _noted(reasons: list[str], refusal: type[RigError] = ConfigurationError) -> Iterator[None]:
    """Lines of a refusal become reasons."""
    try:
        yield
    except refusal as error:
        reasons += str(error).splitlines()


def _corrected(
    table: Table, kind: Kind, config: BenchConfig, register: Register, stated: Statements, told: KnownConditions
) -> OfRun:
    columns = kind.placed(corrected(table.columns, stated.errors), stated.constants)
    same = {name for name, v in columns.items() if np.array_equal(v, table.columns[name], equal_nan=True)}
    changed = tuple(name for name in columns if name not in same)
    table = replace(table, columns=columns) if changed else table
    return OfRun(table, kind, config, register, stated, changed, told)


def shapes_at(probability: float) -> Shapes:
    """Results whose coverage factor is by the shapes of the distributions: where limits dominate, near 95 %."""
    return "where limits dominate" if NEAR_95[0] <= probability <= NEAR_95[1] else False


def budget_of(
    of: OfRun,
    *,
    at: Sequence[Mapping[str, float]] = (),
    same_meter: bool = False,
    probability: float = 0.95,
    options: Mapping[str, Any] | None = None,
    trials: int | None = None,
    seed: int = 1,
    each: Callable[[], None] | None = None,
    shapes: Shapes = False,
    after_days: float | None = None,
    evaluated: Evaluated | None = None,
) -> RunBudget:
    """Budget of a run that was read.

    Args:
        of: the run.
        at: points at which outputs and inferred quantities are given, by quantity; empty for those of the kind.
        same_meter: whether the meter of the run reads the sensors in use.
        probability: coverage probability of expanded uncertainties.
        options: of `rig budget` for its kind.
        trials: of a simulation that checks the budgets; None for no check.
        seed: of the simulation.
        each: called after each trial.
        shapes: whether coverage factors follow the shapes of the distributions; as in `budgets`.
        after_days: inferred values are for a use so many days after the run, with the sensors' drift by their history.
        evaluated: its evaluation by another model; None for that of the options.

    Raises:
        UsageError: its kind does not have an option.
        DataError: it cannot be evaluated, or a point cannot be used.
    """
    if evaluated is None:
        evaluated = partial(of.kind.evaluation, of.table, of.kind.budget_options(**dict(options or {})))
    evaluation = evaluated(at, of.stated.constants)
    try:
        explain(evaluation, of.stated)
        results = evaluation.results
        found = influences(evaluation, of.stated, same_meter=same_meter)
        if after_days is not None:
            found = with_more(found, evaluation, of_drift(of, evaluation, after_days))
        type_a = (results.type_a, *found.grouped)
        asked: dict[str, Any] = {"probability": probability, "shapes": shapes}
        made = budgets(results.names, results.units, results.values, type_a, found.influences, **asked)
    except FitError as error:
        raise DataError(f"{of.table.source}: {error}") from error
    unstated = of.stated.unstated(evaluation.columns)
    meter = SAME_METER if same_meter else OTHER_METER
    notes = [*of.stated.what_is_lacking(unstated), meter, *found.notes, *of.stated.unused]
    notes += as_in_run(_inferred_from(evaluation, results), of.table.within)
    outside = tuple(outside_of(of.table, at))
    notes += [*outside, *held(of.table, of.config.temperatures, evaluation, at)]
    if of.corrected:
        notes.insert(0, f"corrected by the certificates: {', '.join(of.corrected)}")
    if of.stated.example:
        notes.insert(0, f"the register {of.register.name!r} has example values: these uncertainties are examples, too")
    if after_days is not None:
        notes.append(IN_USE.format(days=after_days))
    if any(one.deviation is not None for one in type_a):
        notes.append(EITHER_SIDE)
    if shapes is True:
        notes.append(BY_SHAPE)
    elif by_shape := [one.name for one in made if one.by_shape]:
        notes.append(f"{DOMINATED}: {', '.join(by_shape)}")
    checks: tuple[Check, ...] = ()
    if trials is not None:
        evaluate = whole(evaluation, found.shifts, each)
        try:
            checks = monte_carlo(made, type_a, found.influences, seed=seed, evaluate=evaluate, count=trials)
        except FitError as error:
            raise DataError(f"simulation of the budgets: {error}") from error
        notes += simulated_notes(made, checks, seed)
    told = (tuple(notes), checks, unstated, outside)
    held_at = left_out(of.table, evaluation, made)
    return RunBudget(of, evaluation, made, results.sensors, type_a, found.influences, *told, lacking=held_at)


def _inferred_from(evaluation: Evaluation, results: Results) -> list[str]:
    """Outputs of the sensors from which results are inferred; those of all, for a result of several."""
    sensors = {
        s for name, s in zip(results.names, results.sensors, strict=True) if " inferred " in f" {name} " or not s
    }
    every = dict.fromkeys(one for one in results.sensors if one)
    return [name for name in every if name in sensors or "" in sensors]


def of_drift(of: OfRun, evaluation: Evaluation, days: float) -> Iterator[tuple[str, str, Shifts]]:
    """Name, source and change of readings of every sensor's drift in so many days after the run.

    Raises:
        UsageError: the register has no history of a sensor.
        ConfigurationError: it ends before, or is in another unit.
        DataError: this kind does not say what drift does to readings.
    """
    for column, name in of.table.outputs.items():
        unit, per = evaluation.charted(column)
        sensor = of.config.sensors.get(name)
        names = [key for key in (name, sensor.asset if sensor else "") if key]
        moved = drift_of_sensor(of.register, names, days, unit) * per

        def shifts(times: float, column: str = column, moved: FloatArray = moved) -> Shift:
            return Shift(in_use=lambda read, values: times * moved if read == column else np.zeros_like(values))

        yield f"{name} drift in {days:g} days, by its history", f"sensors.{name}.drift, control chart", shifts


def simulated_notes(made: Sequence[Budgeted], checks: Sequence[Check], seed: int) -> list[str]:
    """Sentences about budgets beside their simulation: how many agree, which do not, and what could not be decided."""
    agree = sum(check.agrees is True for check in checks)
    trials = checks[0].simulated.trials if checks else 0
    notes = [SIMULATED.format(trials=trials, seed=seed, agree=agree, count=len(checks))]
    for one, check in zip(made, checks, strict=True):
        if check.agrees is False:
            drawn = check.simulated.symmetric
            ratio = 2.0 * one.expanded_uncertainty / (drawn.upper - drawn.lower)
            notes.append(
                f"{one.name}: the simulated interval is from {drawn.lower:.6g} to {drawn.upper:.6g} {one.unit}; the "
                f"budget's is {ratio:.2f} times as wide"
            )
    undecided = sum(check.agrees is None for check in checks)
    if undecided:
        notes.append(f"for {undecided} of {len(checks)} results this needs more trials to be decided")
    return notes
