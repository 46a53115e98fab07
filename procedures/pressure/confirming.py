"""A traced whole-plot run as the first of two. A traced run of whole plots, as the first of two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rig.fitter.arrays import IntArray
from rig.fitter.confirm import Confirmation, Later, Question, Together
from rig.fitter.effects.entry import Entry
from rig.procedures.evaluate.confirming import SETTLED, ConfirmedFit, Confirming, times_s
from rig.procedures.plan.further_runs import Variation, repeated
from rig.procedures.plan.run_list import RunList
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.effects.scene import PressureEffect
from rig.procedures.pressure.effects.separation import separate_pressure
from rig.procedures.pressure.evaluate import WholePlotTraced
from rig.procedures.pressure.fitted import fit_whole_plots
from rig.procedures.pressure.for_budgets import pressure_evaluation
from rig.procedures.pressure.options import FitOptions
from rig.procedures.pressure.settings import WholePlotProcedure
from rig.procedures.pressure.table import whole_plot_data
from rig.procedures.pressure.together import WholePlotTogether
from rig.procedures.tables.table import Table

_NOT_OURS = "it is no function of pressure and temperatures: the calibration does not have it"


@dataclass(frozen=True, eq=False)
class WholePlotConfirming(Confirming):
    """See `rig.procedures.evaluate.confirming.Confirming`."""

    traced: WholePlotTraced

    unit = "psi"
    output_unit = "mV"
    per_slope = 1.0
    drawn = "mpsi", 1e3
    counts = 1, 2, 3, 4, 5, 6, 8, 10, 13, 16
    caution = (
        "of the standard errors between two explanations of whole plots about two thirds came in simulated worlds "
        "(half of them 0.5 to 0.9, docs/how_to/confirm.md): count on that much"
    )

    def own_words(self, *, realigned: bool) -> str:
        """Parameters estimated from the further run itself for its prediction, in words; "" if there are none."""
        return "an offset of each whole plot is taken out, as by a zero in flight"

    def later(self, table: Table) -> WholePlotData:
        """Observations of a later run."""
        return whole_plot_data(table)

    def together(self, later: Sequence[Later]) -> WholePlotTogether:
        """This run and later ones. Raises `FitError`."""
        return WholePlotTogether.of(self.found, self.data, later)

    @property
    def catalogue(self) -> Sequence[Entry]:
        """Effects that the trace looked for."""
        return PRESSURE_CATALOGUE

    def whole(self, group: Sequence[Variation], times: int) -> Variation:
        """The run of a group with all points that can be chosen, so many times each; None if points are not chosen:
        every pair of temperatures twice in a replication.
        """
        largest = max(group, key=lambda variation: len(set(variation.procedure.design.pairs())))
        design = largest.procedure.design
        pairs = 2 * sorted(set(design.pairs()))
        procedure = largest.procedure.model_copy(
            update={"design": design.model_copy(update={"temperatures_degC": pairs})}
        )
        return repeated(replace(largest, procedure=procedure), times)

    def units(self, run_list: RunList) -> IntArray:
        """(n,) number of the unit of each point of a run with all of them: units are chosen together: a visit to a pair
        of temperatures, in all replications.
        """
        at = [(p.replication, p.setpoints[1:], p.whole_plot) for p in run_list.points]
        numbers: dict[tuple[Any, ...], int] = {}
        for replication in sorted({key[0] for key in at}):
            plots = sorted({key[1:] for key in at if key[0] == replication})
            numbers |= {(replication, *plot): number for number, plot in enumerate(plots)}
        return np.array([numbers[key] for key in at], np.int64)

    def chosen(self, whole: Variation, units: Sequence[int]) -> Variation:
        """The run with these units only."""
        pairs = sorted(whole.procedure.design.pairs())
        design = whole.procedure.design.model_copy(update={"temperatures_degC": [pairs[unit] for unit in units]})
        return replace(whole, procedure=whole.procedure.model_copy(update={"design": design}))

    def ways(
        self, variation: Variation, run_list: RunList, questions: Sequence[Question], later_s: float
    ) -> list[Together]:
        """One course: the chamber sets the temperatures."""
        done = [step.done([p.replication for p in run_list.points]) for step in variation.steps]
        return [self.beside(self._planned(run_list), later_s, done)]

    def hours(self, variation: Variation, run_list: RunList) -> float:
        """Bench time of a run, hours, from that of this run."""
        reading, soak = _whole_plot_s(self.data)
        return (len(run_list) * reading + run_list.whole_plots * soak) / 3600.0

    def size(self, procedure: WholePlotProcedure) -> str:
        """Points and replications, for a table."""
        design = procedure.design
        plots = len(design.pairs()) * procedure.replications
        return f"{plots} whole plots x {len(design.pressures_psia) + len(design.repeated_psia)} points"

    def separated_by(self, one: Entry, other: Entry) -> str:
        """The measurement that would separate two effects."""
        assert isinstance(one, PressureEffect)
        assert isinstance(other, PressureEffect)
        return separate_pressure(one, other)

    def variables(self) -> Mapping[str, tuple[str, float]]:
        """Fields of observations for plots of residuals: label and scale."""
        return {
            "sensor_temperature_degC": ("sensor temperature / degC", 1.0),
            "sse_temperature_degC": ("electronics temperature / degC", 1.0),
            "pressure_psia": ("pressure / psia", 1.0),
        }

    def calibrated(
        self,
        answers: Sequence[Confirmation],
        questions: Sequence[Question],
        record: dict[str, Any],
        options: FitOptions,
    ) -> ConfirmedFit:
        """The terms of the causes confirmed by a further run are added to the declared model."""
        given = options.model_dump(exclude_none=True, exclude={"formula"})
        terms = list(given.get("add", ()))
        for answer, effect in zip(answers, record["effects"], strict=True):
            effect["terms"] = _terms(questions, answer) if answer.verdict in SETTLED else []
            terms += [term for term in effect["terms"] if term not in terms]
            if answer.verdict not in SETTLED:
                effect["used"] = f"{effect['told']}: nothing was added to the calibration for it"
            elif not effect["terms"]:
                effect["used"] = f"{effect['told']}; {_NOT_OURS}"
        model = options.formula or self.traced.table.declared.get("formula") or "full"
        fitted = fit_whole_plots(self.traced.table, model, **{**given, "add": tuple(terms)})
        plain = set(given) <= {"add", "exclude_zero"} and not options.exclude_zero
        return ConfirmedFit(
            fitted,
            record,
            (lambda at, _: pressure_evaluation(self.traced.table, model, at, extra=terms)) if plain else None,
            tuple(
                one.effect for one, e in zip(answers, record["effects"], strict=True) if e["used"].endswith(_NOT_OURS)
            ),
        )

    def _planned(self, run_list: RunList) -> WholePlotData:
        reading, soak = _whole_plot_s(self.data)
        plots = np.array([p.whole_plot for p in run_list.points])
        n = len(run_list)
        elapsed = soak * np.unique(plots, return_inverse=True)[1] + reading * np.arange(1.0, n + 1.0)
        planned = WholePlotData(
            whole_plot=plots,
            order=np.arange(n),
            elapsed_s=elapsed + float(self.data.elapsed_s.min()),
            pressure_psia=np.array(run_list.column("pressure_psia")),
            sensor_temperature_degC=np.array(run_list.column("sensor_temperature_degC")),
            sse_temperature_degC=np.array(run_list.column("sse_temperature_degC")),
            outputs={name: np.zeros(n) for name in self.data.transducers},
            replicate=np.array([p.replication for p in run_list.points]),
        )
        sides = np.array([p.sides[0] for p in run_list.points])
        return replace(planned, pressure_side=np.where(sides != 0, sides, planned.pressure_side))


def _terms(questions: Sequence[Question], answer: Confirmation) -> list[str]:
    """Formulas of the confirmed cause, for `rig fit --add`; [] if it has none."""
    question = next(q for q in questions if q.effect == answer.effect)
    members = {member.effect: member.terms for member in question.members}
    terms = members.get(answer.holding[0], answer.holder)
    formulas = [str(getattr(candidate.term, "formula", "")) for candidate in terms]
    return list(dict.fromkeys(formulas)) if all(formulas) else []


def _whole_plot_s(data: WholePlotData) -> tuple[float, float]:
    """Seconds between readings of one whole plot, and the additional time of a new one."""
    executed = np.argsort(data.order)
    return times_s(data.elapsed_s[executed], np.diff(data.whole_plot_index[executed]) != 0)
