"""The size of effects that the declared model lacks, as a line of the budget of each result that they move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.budget import Budgeted, Shapes, TypeA, budgets
from rig.fitter.rounding import rounded
from rig.procedures.errors import DataError
from rig.procedures.evaluate.budgeting import Evaluation, Results, Shift
from rig.procedures.evaluate.inference import within_half_turn
from rig.units.si import per_term
from rig.verbs.budget.evaluation import RunBudget
from rig.verbs.budget.lacking import in_state, lacking

LINE = "effects beside the declared model: {}"
SOURCE = "trace of the run"
SMALL = 1e-2
"""A result counts as moved where the line has this share of its standard uncertainty or more."""


def with_undeclared(
    declared: RunBudget, traced: RunBudget, effects: Mapping[str, Sequence[str]], shapes: Shapes
) -> RunBudget:
    """Budgets by the declared model, or one with some effects, with a line for those that it lacks.

    The line is how far each result is from that by the traced model. It is a known deviation that is not corrected, so
    its whole size d is taken as a standard uncertainty, together with the model errors of the traced one, with the
    scatter by which the traced result is less certain than the declared one. The difference between both sides of
    approach has a line of its own. If the traced result is right within its
    standard uncertainty u, the value is within k sqrt(d^2 + u^2) of the declared result with 95 % for k = 1.96 where
    d is zero, with 95.2 % where it is 0.6 u, and with nearly 100 % where it is large beside u. Where an effect follows
    a quantity that the declared model has not, results hold at the conditions of the run: d is its rms over these. Of
    an effect of time or memory, results hold in the state for which the traced ones do: `lacking` says in which.

    Args:
        declared: of the run, by the declared model.
        traced: of the same run and points, by the model with effects.
        effects: their names, by sensor.
        shapes: of which results coverage factors follow the shapes of the distributions.

    Raises:
        DataError: a result has no number by the traced model, so that the effects cannot be counted in it.
    """
    mine = declared.evaluation.results
    lines = undeclared_lines(declared.evaluation, traced.evaluation, effects)
    type_a = (*declared.type_a, *lines)
    made = budgets(
        mine.names,
        mine.units,
        mine.values,
        type_a,
        declared.influences,
        probability=declared.budgets[0].coverage_probability,
        shapes=shapes,
    )
    covariance = np.sum([one.covariance for one in lines], axis=0)
    told = lacking(declared.of.table, declared.evaluation, traced.evaluation, effects, made)
    told = {**declared.lacking, **{name: one.beside(declared.lacking.get(name)) for name, one in told.items()}}
    return replace(
        declared,
        budgets=tuple(made),
        type_a=type_a,
        undeclared=_moved(covariance, made),
        absorbed=_absorbed(declared, traced.evaluation, effects),
        lacks=effects,
        lacking=told,
    )


def _absorbed(declared: RunBudget, traced: Evaluation, effects: Mapping[str, Sequence[str]]) -> Mapping[str, str]:
    """Sentences on coefficients that have taken up a part of the effects, by the name of the result.

    That is a coefficient that the effects in the model change by more than its standard uncertainty, and by more than
    twice the standard error of that change: a term beside a similar one changes it by chance.
    """
    mine, theirs = declared.evaluation.results, traced.results
    place = {name: n for n, name in enumerate(theirs.names)}
    averages = np.mean([one.evaluate(Shift()) for one in traced.elsewhere(declared.evaluation.columns)], axis=0)
    found = {}
    for n, (one, sensor) in enumerate(zip(declared.budgets, mine.sensors, strict=True)):
        names = effects.get(sensor, ())
        if one.name not in place or not names or " coefficient " not in one.name:
            continue
        at = place[one.name]
        change = float(averages[at] - mine.values[n])
        by_chance = float(np.sqrt(max(theirs.of_fit[at] - mine.of_fit[n], 0.0)))
        if abs(change) <= max(one.standard_uncertainty, 2.0 * by_chance):
            continue
        before, after = (rounded(value, one.standard_uncertainty).value for value in (one.value, one.value + change))
        unit, them = f" {per_term(one.unit)}" if one.unit else "", "these" if len(names) > 1 else "it"
        found[one.name] = (
            f"has absorbed a part of {', '.join(names)}: without {them} in the model it is "
            f"{before:f}{unit}, with {them} {after:f}{unit}, a change of "
            f"{abs(change) / one.standard_uncertainty:.2g} times its standard uncertainty"
        )
    return found


def undeclared_lines(declared: Evaluation, traced: Evaluation, effects: Mapping[str, Sequence[str]]) -> list[TypeA]:
    """The lines of `with_undeclared`, one for the effects of each sensor; arguments and errors as there."""
    mine, other = declared.results, traced.results
    of = _effects_of(mine.sensors, effects, traced.holds())
    where = _partners(mine, other)
    through = _through_outputs(mine, where)
    place = np.arange(len(where))
    for inferred, output in through.items():
        where[inferred], place[inferred] = where[output], output
    for name, at, names in zip(mine.names, where, of, strict=True):
        if at is None:
            raise DataError(
                f"{name}: the size of {names} in it is not known, because the model with these effects has no such "
                f"result; use --traced"
            )
    chosen = np.array(where, np.int64)
    turns = np.array([unit == "deg" for unit in mine.units])
    every = []
    for evaluation in traced.elsewhere(declared.columns):
        moved = _same_readings(evaluation, mine, chosen)[chosen] - mine.values[place]
        times = _per_output(declared, through, moved)
        moved = times * moved
        moved[turns] = within_half_turn(moved[turns], 360.0)
        every.append(moved)
    away = np.array(every)
    if not np.isfinite(away).all():
        n = int(np.flatnonzero(~np.isfinite(away).all(axis=0))[0])
        raise DataError(f"{mine.names[n]}: the size of {of[n]} in it is not finite; use --traced")
    square = np.ix_(chosen, chosen)
    covariance = away.T @ away / len(away)
    for one in traced.model_errors():
        covariance = covariance + np.outer(times, times) * one.covariance[square]
    covariance += np.diag(np.maximum(times**2 * other.of_fit[chosen] - mine.of_fit, 0.0))
    theirs = {names: np.array([one == names for one in of], np.float64) for names in dict.fromkeys(of)}
    lines = [
        TypeA(covariance * np.outer(mask, mask), np.inf, LINE.format(names), SOURCE, "B")
        for names, mask in theirs.items()
    ]
    known = {one.name for one in declared.reversibility()}
    for one in traced.reversibility():
        if one.name not in known and one.deviation is not None:
            moved = one.covariance[square] * np.outer(times, times)
            lines.append(replace(one, covariance=moved, deviation=times * one.deviation[chosen]))
    return lines


def _same_readings(traced: Evaluation, mine: Results, chosen: IntArray) -> FloatArray:
    """(m,) results by the traced model; inferred values are of the declared model's outputs at the points.

    Each model gives its own outputs back as their points, which hides what an effect does to an inferred value.
    """
    theirs = traced.evaluate(Shift())
    outputs = {
        sensor: np.array([place[name] for name in names])
        for place in [{name: n for n, name in enumerate(mine.names)}]
        for (sensor, sort), names in _by_sort(mine).items()
        if sort == "output"
    }
    added = {sensor: mine.values[at] - theirs[chosen[at]] for sensor, at in outputs.items()}

    def in_use(column: str, readings: FloatArray) -> FloatArray:
        found: FloatArray = added.get(column, np.zeros_like(readings))
        return found

    return np.asarray(traced.evaluate(Shift(in_use=in_use)))


def _through_outputs(mine: Results, where: Sequence[int | None]) -> dict[int, int]:
    """Output at the point of each inferred value that the other model does not have, both by their place.

    A model with a further quantity, such as a temperature, infers nothing from a reading alone.
    """
    place = {name: n for n, name in enumerate(mine.names)}
    every = _by_sort(mine)
    found = {}
    for (sensor, sort), names in every.items():
        outputs = every.get((sensor, "output"), []) if sort == "inferred" else []
        if len(outputs) == len(names):
            pairs = ((place[name], place[output]) for name, output in zip(names, outputs, strict=True))
            found.update({n: o for n, o in pairs if where[n] is None and where[o] is not None})
    return found


def _per_output(declared: Evaluation, through: Mapping[int, int], moved: FloatArray) -> FloatArray:
    """(m,) change of each inferred value per change of the true output at its point; 1 for all other results.

    A reading of the true output is inferred by the declared model.
    """
    found = np.ones(len(moved))
    if not through:
        return found
    mine = declared.results
    least = 1e-9 * float(np.max(np.abs(mine.values[list(through.values())])))
    steps = {n: moved[n] if abs(moved[n]) > least else least for n in through}
    by_sensor = {
        sensor: np.array([steps.get(n, 0.0) for n in (mine.names.index(name) for name in names)])
        for (sensor, sort), names in _by_sort(mine).items()
        if sort == "inferred"
    }

    def in_use(column: str, readings: FloatArray) -> FloatArray:
        added: FloatArray = by_sensor.get(column, np.zeros_like(readings))
        return added

    values = declared.evaluate(Shift(in_use=in_use))
    for n, step in steps.items():
        found[n] = (values[n] - mine.values[n]) / step
    return found


def _effects_of(
    sensors: Sequence[str], effects: Mapping[str, Sequence[str]], holds: Mapping[str, Mapping[str, str]]
) -> list[str]:
    """(m,) names of the effects of each result's sensor, with the states for which results hold; of all sensors where a
    result is of several, or where the sensor itself has none.
    """
    states = {name: words for by in holds.values() for name, words in by.items()}
    every = in_state(list(dict.fromkeys(name for names in effects.values() for name in names)), states)
    return [in_state(effects.get(sensor, ()), holds.get(sensor, {})) or every for sensor in sensors]


def _moved(covariance: FloatArray, made: Sequence[Budgeted]) -> tuple[str, ...]:
    """Names of the results in which effects count."""
    size: FloatArray = np.sqrt(np.diag(covariance))
    return tuple(one.name for one, u in zip(made, size, strict=True) if u > SMALL * one.standard_uncertainty)


def _partners(mine: Results, other: Results) -> list[int | None]:
    """The same result by another model: by name, or by its order, as a model with more terms names its points anew."""
    by_name = {name: n for n, name in enumerate(other.names)}
    theirs = _by_sort(other)
    place: Mapping[str, tuple[tuple[str, str], int]] = {
        name: (sort, n) for sort, names in _by_sort(mine).items() for n, name in enumerate(names)
    }
    sizes = {sort: len(names) for sort, names in _by_sort(mine).items()}
    found: list[int | None] = []
    for name in mine.names:
        sort, n = place[name]
        same = theirs.get(sort, [])
        if name in by_name:
            found.append(by_name[name])
        else:
            found.append(by_name[same[n]] if sort[1] != "coefficient" and len(same) == sizes[sort] else None)
    return found


def _by_sort(results: Results) -> dict[tuple[str, str], list[str]]:
    """Names of results by their sensor and sort: coefficient, output, inferred."""
    found: dict[tuple[str, str], list[str]] = {}
    for name, sensor in zip(results.names, results.sensors, strict=True):
        sort = next((word for word in ("coefficient", "output", "inferred") if f" {word} " in f" {name} "), "")
        found.setdefault((sensor, sort), []).append(name)
    return found
