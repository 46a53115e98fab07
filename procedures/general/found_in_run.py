"""Findings of all sensors of a run, as a confirmation needs them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rig.fitter import ties
from rig.fitter.confirm.together import solve
from rig.fitter.trace.aliases import DELTA, NEARLY, Rival
from rig.fitter.trace.found import Explanation
from rig.fitter.trace.search import names_of
from rig.procedures.general.effects.columns import wave
from rig.procedures.general.effects.time_columns import lag
from rig.procedures.general.run_terms import RunTerm, columns_of
from rig.procedures.general.together import Remembered
from rig.procedures.general.trace import TableTrace

_SIDE = re.compile(r"\b\w+_side\b")
MOST_CONSTANTS = 3
LEAST_CYCLES = 1.5
"""Number of periods over the settings, as a cycle of a day or a year must have in a table."""


@dataclass(frozen=True, eq=False)
class FoundInRun:
    """Findings of all sensors of a run, a `rig.fitter.confirm.question.Traced`.

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
            for term in self._columns(output, trace.search.chosen, without="")
        )

    def _columns(self, output: str, terms: Sequence[int], without: str) -> Iterator[RunTerm]:
        """The columns of some terms in place of a named effect."""
        judge, chosen = self.sensors[output].search.judge, self.sensors[output].search.chosen
        candidates, declared = judge.candidates, judge.problem.declared
        others = [j for j in chosen if candidates[j].effect.name != without and j not in terms]
        model = np.column_stack([candidates[j].term.columns for j in (*terms, *others)] + [declared])
        sizes = solve(model, judge.problem.y)
        for j in terms:
            block = candidates[j].term
            width = block.columns.shape[1]
            yield from columns_of(candidates[j].effect, block, output, sizes[:width])
            sizes = sizes[width:]

    def _slow(self, output: str, rival: Rival) -> bool:
        """Whether it is a period that the settings hardly cover: such a curve is a power series, not a period."""
        terms = (self.sensors[output].search.judge.candidates[j] for j in rival.terms)
        return any(
            one.effect.kind.terms is wave and one.term.profile is not None and one.term.profile.value < LEAST_CYCLES
            for one in terms
        )

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
        return {name: self._explained(name, by_output) for name, by_output in self._rivals.items()}

    def _explained(self, named: str, by_output: Mapping[str, Mapping[str, Rival]]) -> tuple[Explanation, ...]:
        common = [
            name
            for name in next(iter(by_output.values()))
            if all(
                name in own and (name == named or not self._slow(output, own[name]))
                for output, own in by_output.items()
            )
        ]
        costs = {name: sum(own[name].sigmas ** 2 for own in by_output.values()) for name in common}
        least = min(costs.values())
        told = [
            Explanation(
                name,
                tuple(
                    term for output, own in by_output.items() for term in self._columns(output, own[name].terms, named)
                ),
                float(np.sqrt(cost - least)),
                alias=cost - least <= DELTA,
                near=DELTA < cost - least <= NEARLY and not any(own[name].refused for own in by_output.values()),
            )
            for name, cost in costs.items()
        ]
        return tuple(ties.ordered(told, key=lambda one: one.sigmas**2, unit=1.0))

    @property
    def remembered(self) -> Mapping[str, Remembered]:
        """Memory of earlier settings in the explanations, by output."""
        outputs = {**self.constants, **self.sides}
        return {name: Remembered(self.constants.get(name, ()), self.sides.get(name, ())) for name in outputs}

    @cached_property
    def constants(self) -> Mapping[str, tuple[float, ...]]:
        """Time constants of the explanations that remember earlier settings, by output."""
        found: dict[str, dict[float, None]] = {}
        for every in self.explanations.values():
            for term in (term for one in every if one.alias for term in one.terms):
                if term.effect.kind.terms is lag and term.block.profile is not None:
                    found.setdefault(term.sensor, {})[term.block.profile.value] = None
        return {output: tuple(sorted(taus)[:MOST_CONSTANTS]) for output, taus in found.items()}

    @cached_property
    def sides(self) -> Mapping[str, tuple[str, ...]]:
        """Columns with a direction of approach in the explanations, by output."""
        found: dict[str, dict[str, None]] = {}
        for term in (term for every in self.explanations.values() for one in every if one.alias for term in one.terms):
            for name in _SIDE.findall(term.block.labels[term.at]):
                found.setdefault(term.sensor, {})[name] = None
        return {output: tuple(names) for output, names in found.items()}
