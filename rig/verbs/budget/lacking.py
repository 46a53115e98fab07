"""For what results hold, where the trace found effects that their model lacks: sentences and labels, by sensor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.budget import Budgeted
from rig.procedures.column_names import spelled, stem_of, unit_of
from rig.procedures.evaluate.budgeting import Evaluation
from rig.procedures.present.joined import joined
from rig.procedures.tables.table import Table
from rig.units.si import per_term

STATES = "Results hold:"
"""Begin of a sentence about states."""
NEAR = 0.02
"""Share of the range of a quantity within which a reading is at a setting."""


@dataclass(frozen=True)
class Holding:
    """For what the results of one sensor hold.

    Attributes:
        states: for which state of each effect.
        away: how far the run was away from that, in words.
        lacks: names of effects that the model of the results lacks.
    """

    states: Mapping[str, str]
    away: str = ""
    lacks: tuple[str, ...] = ()

    @property
    def of_all(self) -> str:
        """Sentences that are the same for all sensors with these effects in these states."""
        lacks = f"The model of these results lacks {', '.join(self.lacks)}. " if self.lacks else ""
        return f"{lacks}{held(self.states)}"

    def __str__(self) -> str:
        return f"{self.of_all} {self.away}".strip()

    def beside(self, other: Holding | None) -> Holding:
        """Both, for the same results."""
        if other is None:
            return self
        away = " ".join(filter(None, (self.away, other.away)))
        return Holding({**self.states, **other.states}, away, (*self.lacks, *other.lacks))


def in_state(effects: Sequence[str], holds: Mapping[str, str]) -> str:
    """Effects in words, each with the state for which results hold without it."""
    return ", ".join(f"{one} ({holds[one]})" if one in holds else one for one in effects)


def held(states: Mapping[str, str]) -> str:
    """For which state of each effect results hold, a sentence."""
    of_u = {name: ", and U is for either" if "both directions" in words else "" for name, words in states.items()}
    return f"{STATES} {'; '.join(f'of {name}, {words}{of_u[name]}' for name, words in states.items())}."


def lacking(
    table: Table,
    declared: Evaluation,
    traced: Evaluation,
    effects: Mapping[str, Sequence[str]],
    made: Sequence[Budgeted] = (),
) -> Mapping[str, Holding]:
    """Effects that the model of the results lacks, and how far it is away from the one with them, by output.

    Args:
        table: observations of the run.
        declared: the evaluation by the model of the results.
        traced: that with the effects that the model lacks.
        effects: names of these, by output.
        made: budgets of the results; their uncertainties are compared with what outputs are away at their points.
    """
    mine, theirs, holds = declared.modelled(), traced.modelled(), traced.holds()
    found = {}
    for output, names in effects.items():
        if not names:
            continue
        states = dict.fromkeys(names, "over the conditions of the run") | dict(holds.get(output, {}))
        told = ""
        if output in mine and output in theirs:
            away = _known(table, np.abs(theirs[output] - mine[output]))
            told = f"{_worst(table, output, away)}{_covered(table, declared, output, away, made)}"
        found[output] = Holding({one: states[one] for one in names}, told, tuple(names))
    return found


def left_out(table: Table, evaluation: Evaluation, made: Sequence[Budgeted]) -> Mapping[str, Holding]:
    """For which state of each effect that is left out of them results hold, and how far the run was away, by output.

    Args:
        table: observations of the run.
        evaluation: of the results.
        made: their budgets.
    """
    aside, found = evaluation.aside(), {}
    for output, states in evaluation.holds().items():
        if states:
            told = ""
            if output in aside:
                away = _known(table, np.abs(aside[output]))
                told = f"{_worst(table, output, away, WAS_AWAY)}{_covered(table, evaluation, output, away, made)}"
            found[output] = Holding(states, told)
    return found


def _known(table: Table, away: FloatArray) -> FloatArray:
    """(n,) what rows are away, zero for those whose side of approach is unknown: their part in an effect is their own.

    One reading that nothing else determines was told as the place where the run was farthest away.
    """
    sides = [values for name, values in table.columns.items() if name.endswith("_side") and np.any(values != 0.0)]
    unknown = np.any([values == 0.0 for values in sides], axis=0) if sides else np.zeros(len(away), np.bool_)
    return away if unknown.all() else np.where(unknown, 0.0, away)


WITH_THEM, WAS_AWAY = "the model with these effects is {} away", "the output was {} away from these states"


def _worst(table: Table, output: str, away: FloatArray, said: str = WITH_THEM) -> str:
    """Where in the run the model with the effects is farthest from the declared one, a sentence."""
    row, unit = int(np.argmax(away)), spelled(unit_of(output))
    place = [
        f"{stem_of(name).replace('_', ' ')} {table.columns[name][row]:.4g} {spelled(unit_of(name))}"
        for name in table.factors
        if name in table.columns
    ]
    if "elapsed_s" in table.columns:
        place.append(f"{table.columns['elapsed_s'][row] / 3600.0:.2g} h after the start")
    where = f" ({', '.join(place)})" if place else ""
    return f"At the worst place of the run{where} {said.format(f'{away[row]:.2g} {unit}')}."


def _covered(table: Table, declared: Evaluation, output: str, away: FloatArray, made: Sequence[Budgeted]) -> str:
    """Whether the uncertainties of outputs cover what they are away at their points, a sentence; "" without outputs."""
    results = declared.results
    places = results.at or ({},) * len(results.names)
    outputs = [
        (one, _near(table, away, at))
        for one, sensor, at in zip(made, results.sensors, places, strict=False)
        if sensor == output and " output " in one.name
    ]
    outside = [
        f"{one.name[one.name.index('output ') :]} has U = {one.expanded_uncertainty:.2g} {per_term(one.unit)}, and the "
        f"run was up to {most:.2g} {per_term(one.unit)} away there"
        for one, most in outputs
        if most > one.expanded_uncertainty
    ]
    if outside:
        return f" The uncertainty does not cover that: {'; '.join(outside)}."
    return " At the settings of each output it is less than U." if outputs else ""


def _near(table: Table, away: FloatArray, at: Mapping[str, float]) -> float:
    """The largest value among observations whose settings are nearest to a point."""
    chosen = np.ones(len(away), np.bool_)
    for name, value in at.items():
        column = table.columns.get(name)
        if column is not None:
            distance = np.abs(column - value)
            chosen &= distance <= np.min(distance) + NEAR * float(np.ptp(column))
    return float(np.max(away[chosen], initial=0.0))


def by_sensor(told: Mapping[str, Holding], names: Mapping[str, str]) -> Iterator[str]:
    """The sentences with the names of their sensors before them."""
    yield from joined((names.get(output, output), one.of_all) for output, one in told.items())
    yield from (f"{names.get(output, output)}: {one.away}" for output, one in told.items() if one.away)
