"""A traced run of any laboratory as the first of two. See `procedures.confirming.Confirming`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np

from fitter.arithmetic_text import parse_expression
from fitter.arrays import FloatArray
from fitter.confirm import Confirmation, Question
from fitter.effects.entry import Entry
from fitter.effects.hands import Done
from fitter.errors import FitError
from fitter.trace.aliases import DELTA, Rival
from fitter.trace.found import Explanation
from fitter.trace.search import names_of
from procedures.blocks import Block
from procedures.confirming import SETTLED, Confirming
from procedures.effects_shown import show_confirmed
from procedures.errors import DataError
from procedures.further_runs import Variation
from procedures.general.effects.time_columns import lag
from procedures.general.of_runs import Asked, RunFitted, RunTraced, fit_run
from procedures.general.options import FitOptions
from procedures.general.settings import GeneralProcedure
from procedures.general.together import TIME, GeneralTogether, Observations, RunTerm, columns_of
from procedures.general.trace import TableTrace
from procedures.run_list import RunList
from procedures.table import Table

MOST_CONSTANTS = 3
OWN_UNITS = "the unit of each output"


@dataclass(frozen=True, eq=False)
class FoundInRun:
    """Findings of all sensors of a run, a `fitter.confirm.question.Traced`.

    Attributes:
        sensors: by output.
    """

    sensors: Mapping[str, TableTrace]

    @cached_property
    def chosen(self) -> tuple[RunTerm, ...]:
        """Columns in the models of all sensors."""
        return tuple(
            term
            for output, trace in self.sensors.items()
            for j in trace.search.chosen
            for term in self._columns(output, (j,))
        )

    def _columns(self, output: str, terms: Sequence[int]) -> Iterator[RunTerm]:
        candidates = self.sensors[output].search.judge.candidates
        for j in terms:
            yield from columns_of(candidates[j].effect, candidates[j].term, output)

    @cached_property
    def _rivals(self) -> Mapping[str, Mapping[str, Mapping[str, Rival]]]:
        """All explanations of each effect, by effect, output, and explanation."""
        found: dict[str, dict[str, dict[str, Rival]]] = {}
        for output, trace in self.sensors.items():
            judge, chosen = trace.search.judge, trace.search.chosen
            for name in names_of(judge.candidates, chosen):
                found.setdefault(name, {})[output] = {rival.effect: rival for rival in judge.rivals(chosen, name)}
        return found

    @cached_property
    def explanations(self) -> Mapping[str, Sequence[Explanation]]:
        """Explanations of each effect that all sensors with it have in common, best first."""
        return {name: self._explained(by_output) for name, by_output in self._rivals.items()}

    def _explained(self, by_output: Mapping[str, Mapping[str, Rival]]) -> tuple[Explanation, ...]:
        common = [name for name in next(iter(by_output.values())) if all(name in own for own in by_output.values())]
        costs = {name: sum(own[name].sigmas ** 2 for own in by_output.values()) for name in common}
        least = min(costs.values())
        told = [
            Explanation(
                name,
                tuple(term for output, own in by_output.items() for term in self._columns(output, own[name].terms)),
                float(np.sqrt(cost - least)),
                alias=cost - least <= DELTA,
            )
            for name, cost in costs.items()
        ]
        return tuple(sorted(told, key=lambda one: one.sigmas))

    @cached_property
    def constants(self) -> Mapping[str, tuple[float, ...]]:
        """Time constants of the explanations that remember earlier settings, by output."""
        found: dict[str, dict[float, None]] = {}
        for every in self.explanations.values():
            for term in (term for one in every if one.alias for term in one.terms):
                if term.effect.kind.terms is lag and term.block.profile is not None:
                    found.setdefault(term.sensor, {})[term.block.profile.value] = None
        return {output: tuple(sorted(taus)[:MOST_CONSTANTS]) for output, taus in found.items()}


@dataclass(frozen=True, eq=False)
class GeneralConfirming(Confirming):
    """See `procedures.confirming.Confirming`. Errors are those of the outputs, in their own units."""

    traced: RunTraced

    per_slope = 1.0

    @cached_property
    def found(self) -> FoundInRun:
        """See `Confirming`."""
        return FoundInRun({output: one.trace for output, one in self.traced.each.items()})

    @cached_property
    def data(self) -> Observations:
        """See `Confirming`."""
        return Observations.of(self.traced.table)

    @property
    def unit(self) -> str:  # type: ignore[override]
        """Unit of all outputs, if they have one."""
        units = {output.rpartition("_")[2] for output in self.traced.each}
        return units.pop() if len(units) == 1 else OWN_UNITS

    @property
    def output_unit(self) -> str:  # type: ignore[override]
        """The same."""
        return self.unit

    @property
    def drawn(self) -> tuple[str, float]:  # type: ignore[override]
        """The same."""
        return self.unit, 1.0

    def own_words(self, *, realigned: bool) -> str:
        """See `Confirming`."""
        return "what of earlier settings was remembered at its start is its own" if self.found.constants else ""

    def later(self, table: Table) -> Observations:
        """See `Confirming`."""
        return Observations.of(table)

    def beside(self, later: Observations, after_s: float, done: Sequence[Done] = ()) -> GeneralTogether:
        """See `Confirming`."""
        roles = {output: one.roles for output, one in self.traced.each.items()}
        found = self.found
        return GeneralTogether.of(found.sensors, roles, self.data.table, later.table, after_s, done, found.constants)

    @cached_property
    def catalogue(self) -> Sequence[Entry]:
        """See `Confirming`: every effect that a sensor was searched for, once."""
        every = (c.effect for trace in self.found.sensors.values() for c in trace.search.judge.candidates)
        return tuple({effect.name: effect for effect in every}.values())

    def ways(
        self, variation: Variation, run_list: RunList, questions: Sequence[Question], later_s: float
    ) -> list[GeneralTogether]:
        """One course: other quantities go on as in the first run."""
        done = [step.done([p.replication for p in run_list.points]) for step in variation.steps]
        return [self.beside(Observations.of(self._planned(run_list, variation.wait_s)), later_s, done)]

    def hours(self, variation: Variation, run_list: RunList) -> float:
        """See `Confirming`."""
        point, soak = self._times_s
        return (len(run_list) * (point + variation.wait_s) + run_list.whole_plots * soak) / 3600.0

    def size(self, procedure: GeneralProcedure) -> str:
        """See `Confirming`."""
        return f"{len(procedure.expand()) // procedure.replications} x {procedure.replications}"

    def separated_by(self, one: Entry, other: Entry) -> str:
        """See `Confirming`."""
        return "; ".join(dict.fromkeys((one.separate_by, other.separate_by)))

    def variables(self) -> Mapping[str, tuple[str, float]]:
        """See `Confirming`."""
        scenes = [trace.variables for trace in self.found.sensors.values()]
        return {name: (name, 1.0) for variables in scenes for name in variables}

    def calibrated(
        self,
        answers: Sequence[Confirmation],
        questions: Sequence[Question],
        record: dict[str, Any],
        options: FitOptions,
    ) -> ConfirmedFit:
        """Columns of confirmed causes that are functions of the table's own columns are added to the models."""
        asked = Asked.of(self.traced.table, options.response, options.formula)
        if asked is None:
            raise DataError(f"--response {options.response} is no output of the run")
        added: dict[str, list[str]] = {}
        for answer, question, effect in zip(answers, questions, record["effects"], strict=True):
            effect["terms"] = []
            if answer.verdict not in SETTLED:
                effect["used"] = f"{effect['told']}: nothing was added to the calibration for it"
                continue
            members = {member.effect: member.terms for member in question.members}
            terms = [term for term in members.get(answer.holding[0], answer.holder) if not term.slope]
            if not all(self._usable(term) for term in terms):
                why = "it is no function of the settings: the calibration does not have it"
                effect["used"] = f"{effect['told']}; {why}"
                continue
            for term in terms:
                added.setdefault(term.sensor, []).append(f"I({term.term.name})")
            effect["terms"] = [f"{term.sensor}: I({term.term.name})" for term in terms]
        return ConfirmedFit(fit_run(asked.adding(added)), record)

    def _usable(self, term: RunTerm) -> bool:
        """Whether a column is arithmetic of factors, which are known when the sensor is used."""
        try:
            names = parse_expression(term.term.name).names
        except FitError:
            return False
        return bool(names) and set(names) <= set(self.traced.table.factors)

    @cached_property
    def _times_s(self) -> tuple[float, float]:
        """Seconds between rows of one whole plot, and the additional time of a new one."""
        steps = np.diff(self.data.table.columns[TIME])
        plots = self.data.table.columns.get("whole_plot", np.zeros(len(self.data)))
        new = np.diff(plots) != 0
        point = float(np.median(steps[~new])) if np.any(~new) else 0.0
        return point, max(float(np.median(steps[new])) - point, 0.0) if np.any(new) else 0.0

    def _planned(self, run_list: RunList, wait_s: float) -> Table:
        """The rows of a planned run with an additional wait at every point; its outputs are not used."""
        first, n = self.data.table, len(run_list)
        point, soak = self._times_s
        plots = np.array([float(p.whole_plot or 0) for p in run_list.points])
        began = np.unique(plots, return_inverse=True)[1] if run_list.whole_plots else np.zeros(n)
        elapsed = soak * began + (point + wait_s) * np.arange(1.0, n + 1.0)
        columns: dict[str, FloatArray] = {
            "replicate": np.array([float(p.replication) for p in run_list.points]),
            "order": np.arange(1.0, n + 1.0),
            TIME: elapsed + float(first.columns[TIME].min()),
            "whole_plot": plots,
            "block": np.ones(n),
        }
        for factor in run_list.factors:
            setting = np.array(run_list.column(factor.name), np.float64)
            columns |= {factor.name: setting, factor.set_name: setting}
        sides = np.array([p.sides for p in run_list.points], np.float64)
        columns |= {f"{f.axis}_side": sides[:, at] for at, f in enumerate(run_list.factors) if not f.hard}
        then, now = (t - t.min() for t in (first.columns[TIME], columns[TIME]))
        others = {name: np.interp(now, then, v) for name, v in first.columns.items() if name not in columns}
        return Table("planned", {name: {**others, **columns}[name] for name in first.columns}, True, {})


@dataclass(frozen=True)
class ConfirmedFit:
    """A calibration with terms confirmed by a further run, and their source."""

    fitted: RunFitted
    record: dict[str, Any]

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig fit --json`."""
        return self.fitted.to_json() | {"confirmed_by": self.record}

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        return chain(self.fitted.blocks(), show_confirmed(self.record))

    def page(self) -> None:
        """It has none."""
