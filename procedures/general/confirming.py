"""A traced run of any laboratory as the first of two. See `rig.procedures.evaluate.confirming.Confirming`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.confirm import Confirmation, Later, Question, Together
from rig.fitter.effects.entry import Entry
from rig.fitter.errors import FitError
from rig.procedures.column_names import moves_of, read_at, spelled, unit_of, with_word
from rig.procedures.errors import DataError
from rig.procedures.evaluate.confirming import SETTLED, ConfirmedFit, Confirming, in_words, times_s
from rig.procedures.general.effects.of_others import HYSTERESIS
from rig.procedures.general.factors import RANDOM
from rig.procedures.general.for_budgets import general_evaluation
from rig.procedures.general.found_in_run import FoundInRun
from rig.procedures.general.further_runs import values_of, with_routine
from rig.procedures.general.of_runs import RunModels, RunTraced, fit_run, noted_of, recorded, without_readings
from rig.procedures.general.options import FitOptions, TraceOptions
from rig.procedures.general.own_time import TIME
from rig.procedures.general.planning import check_declared, evaluations
from rig.procedures.general.settings import GeneralProcedure
from rig.procedures.general.together import GeneralTogether, Observations
from rig.procedures.general.traced import IN_RUN, usable_term, with_effects
from rig.procedures.plan.further_runs import Variation, repeated
from rig.procedures.plan.run_list import RunList
from rig.procedures.tables.table import Table

LEAST_CANDIDATES, MOST_CANDIDATES = 5, 160
"""Numbers of units from which those of a run are chosen."""
LEAST_POINTS = 12
_COUNTS = 2, 3, 4, 5, 6, 8, 10, 12, 15, 19, 24, 30, 38, 48, 60, 76, 96, 120
WITHIN = 0.05
"""Share of a recorded quantity's variation within whole plots, or at equal hard settings, if it stays there."""
CHOSEN = "chosen by rig confirm"
"""In place of the name of a file with the points."""
OWN_UNITS = "the unit of each output"
NOT_OURS = (
    "it is no function of settings and recorded quantities, and its size in this run is not known: the calibration "
    "does not have it"
)


def cannot_confirm(table: Table, options: TraceOptions) -> str:
    """Why no further run can confirm the findings in a run; see `rig.procedures.kind.Kind.cannot_confirm`."""
    if lacks := without_readings(table):
        return f"{', '.join(lacks.values())}, since a channel failed: make the run again, and trace and confirm that"
    others = options.model_fields_set - {"response", "formula", "ignore", "quick"}
    asked = None if others else RunModels.of(table, options.response, options.formula)
    if asked is None:
        given = sorted(f"--{name.replace('_', '-')}" for name in others or {"response"})
        return (
            f"a run is confirmed with the roles of its columns, by the outputs of its sensors: leave out "
            f"{', '.join(given)}. What is not an output is traced again in another run: rig trace"
        )
    models = asked.models
    if not any(model.linear for model in models.values()):
        return (
            "its declared models are not linear in their coefficients, so nothing is traced and no run is proposed. "
            "Make the procedure again with a formula that is, such as a polynomial, in [model]; or make the same run "
            "again and compare both calibrations: rig chart"
        )
    return ""


@dataclass(frozen=True, eq=False)
class GeneralConfirming(Confirming):
    """A traced run of outputs, as the first of two. Errors are those of the outputs, in their own units."""

    traced: RunTraced

    per_slope = 1.0
    passes = 1, 2, 4

    @cached_property
    def found(self) -> FoundInRun:
        """The findings, a `rig.fitter.confirm.question.Traced`."""
        return FoundInRun({output: one.trace for output, one in self.traced.each.items()})

    @cached_property
    def data(self) -> Observations:
        """Observations of the run."""
        return Observations.of(self.traced.table)

    @property
    def unit(self) -> str:  # type: ignore[override]
        """Unit of all outputs, if they have one."""
        units = {unit_of(output) for output in self.traced.each}
        return units.pop() if len(units) == 1 else OWN_UNITS

    def unit_for(self, output: str) -> str:
        """Unit in which errors of one output are said. Its own."""
        return spelled(unit_of(output))

    @property
    def output_unit(self) -> str:  # type: ignore[override]
        """Unit of all outputs, as `unit`: here errors are those of outputs."""
        return self.unit

    @property
    def drawn(self) -> tuple[str, float]:  # type: ignore[override]
        """Unit of drawn errors, and its factor: outputs are drawn in their own unit."""
        return self.unit, 1.0

    def own_words(self, *, realigned: bool) -> str:
        """Parameters estimated from the further run itself for its prediction, in words; "" if there are none."""
        return (
            "what was remembered of earlier settings when the further run began is fitted to that run"
            if self.found.remembered
            else ""
        )

    def later(self, table: Table) -> Observations:
        """Observations of a later run. Raises `DataError`."""
        return Observations.of(table)

    def together(self, later: Sequence[Later]) -> GeneralTogether:
        """This run and later ones. Raises `FitError`."""
        roles = {output: one.roles for output, one in self.traced.each.items()}
        return GeneralTogether.of(self.found.sensors, roles, self.data.table, later, self.found.remembered)

    @cached_property
    def catalogue(self) -> Sequence[Entry]:
        """Effects that the trace looked for: every effect that a sensor was searched for, once."""
        every = (c.effect for trace in self.found.sensors.values() for c in trace.search.judge.candidates)
        return tuple({effect.name: effect for effect in every}.values())

    def suits(self, variation: Variation, first: GeneralProcedure, questions: Sequence[Question]) -> bool:
        """Whether all explanations say what they are in a run; a run of which one does not is not proposed. A
        hysteresis is a loop over the whole range, whose factor has to go up and down again where it did before.
        """
        loops = {
            term.effect.columns[-1]
            for question in questions
            for member in question.members
            for term in member.terms
            if term.effect.kind.name == HYSTERESIS.name
        }
        run: GeneralProcedure = variation.procedure
        swept = [name for name in loops if name in run.factors and first.factors[name].order != RANDOM]
        return all(run.factors[name].order != RANDOM for name in swept)

    def whole(self, group: Sequence[Variation], times: int) -> Variation | None:
        """The run of a group with all points that can be chosen, so many times each; None if points are not chosen. The
        largest grid, if it has enough points to choose from.
        """
        largest = max(group, key=lambda variation: len(variation.procedure.expand()))
        bare = GeneralProcedure.model_validate(values_of(largest.procedure))  # its steps have no places in fewer plots
        whole = repeated(replace(largest, procedure=bare), times)
        whole = replace(whole, procedure=with_routine(whole.procedure, largest.procedure))
        count = int(self.units(whole.procedure.expand()).max()) + 1
        return whole if LEAST_CANDIDATES <= count <= MOST_CANDIDATES else None

    @cached_property
    def counts(self) -> Sequence[int]:  # type: ignore[override]
        """Numbers of units to try: with fewer points a run would not show whether a model fits."""
        columns = self.data.table.columns
        rows = len(self.data) / max(len(set(columns["whole_plot"].tolist())), 1) if "whole_plot" in columns else 1.0
        return tuple(count for count in _COUNTS if count * rows >= LEAST_POINTS and count > 1)

    def units(self, run_list: RunList) -> IntArray:
        """(n,) number of the unit of each point of a run with all of them: units are chosen together. A setting, or all
        settings at those of the factors that are hard to change.
        """
        keys = _unit_keys(run_list)
        numbers = {key: number for number, key in enumerate(sorted(set(keys)))}
        return np.array([numbers[key] for key in keys], np.int64)

    def chosen(self, whole: Variation, units: Sequence[int]) -> Variation:
        """The run with these units only; with as many more units as the declared models need."""
        run: GeneralProcedure = whole.procedure
        run_list = run.expand()
        keys = _unit_keys(run_list)
        ordered = sorted(set(keys))
        settings: dict[tuple[float, ...], list[tuple[float, ...]]] = {}
        for key, point in zip(keys, run_list.points, strict=True):
            if point.setpoints not in settings.setdefault(key, []):
                settings[key].append(point.setpoints)
        wanted = [ordered[unit] for unit in units]
        for key in (None, *_from_the_ends([key for key in ordered if key not in wanted])):
            wanted += [] if key is None else [key]
            rows = [list(point) for one in ordered if one in wanted for point in settings[one]]
            procedure = _of_points(run, rows)
            if _determined(procedure):
                break
        return replace(whole, procedure=procedure)

    def ways(
        self, variation: Variation, run_list: RunList, questions: Sequence[Question], later_s: float
    ) -> list[Together]:
        """One course: other quantities go on as in the first run."""
        done = [step.done([p.replication for p in run_list.points]) for step in variation.steps]
        return [self.beside(Observations.of(self._planned(run_list, variation.wait_s)), later_s, done)]

    def hours(self, variation: Variation, run_list: RunList) -> float:
        """Bench time of a run, hours, from that of this run."""
        point, soak = self._times_s
        settling = self.settling_s(variation)
        return (len(run_list) * (point + variation.wait_s) + run_list.whole_plots * soak + settling) / 3600.0

    def size(self, procedure: GeneralProcedure) -> str:
        """Points and replications, for a table."""
        return in_words(len(procedure.expand()) // procedure.replications, procedure.replications)

    def separated_by(self, one: Entry, other: Entry) -> str:
        """The measurement that would separate two effects."""
        return "; ".join(dict.fromkeys((one.separate_by, other.separate_by)))

    def variables(self) -> Mapping[str, tuple[str, float]]:
        """Fields of observations for plots of residuals: label and scale."""
        scenes = [trace.variables for trace in self.found.sensors.values()]
        return {name: (name, 1.0) for variables in scenes for name in variables}

    def calibrated(
        self,
        answers: Sequence[Confirmation],
        questions: Sequence[Question],
        record: dict[str, Any],
        options: FitOptions,
    ) -> ConfirmedFit:
        """Columns of confirmed causes that are functions of the table's own columns are added to the models. Others, of
        time or memory, are taken off the outputs, as by `rig fit --traced`.
        """
        asked = RunModels.of(self.traced.table, options.response, options.formula)
        if asked is None:
            raise DataError(f"--response {options.response} is no output of the run")
        added: dict[str, list[str]] = {}
        off: dict[str, str] = {}
        for answer, question, effect in zip(answers, questions, record["effects"], strict=True):
            effect["terms"] = []
            if answer.verdict not in SETTLED:
                effect["used"] = f"{effect['told']}: nothing was added to the calibration for it"
                continue
            members = {member.effect: member.terms for member in question.members}
            terms = [term for term in members.get(answer.holding[0], answer.holder) if not term.slope]
            known = (*self.traced.table.factors, *recorded(self.traced.table))
            usable = {term: usable_term(term.term.name, known) for term in terms}
            if not all(usable.values()):
                off[answer.effect] = answer.holding[0]
                continue
            for term in terms:
                added.setdefault(term.sensor, []).append(f"I({usable[term]})")
            effect["terms"] = [f"{term.sensor}: I({usable[term]})" for term in terms]
        run = with_effects(asked, self.traced, only=off)
        every = [note for notes in run.notes.values() for note in notes]
        for answer, effect in zip(answers, record["effects"], strict=True):
            if answer.effect in off:
                told = [note for note in every if note.startswith(f"{off[answer.effect]} ")] or [NOT_OURS]
                same, in_run, _ = told[0].partition(IN_RUN)
                sizes = in_run + ", ".join(note.partition(IN_RUN)[2] for note in told)  # one for each sensor
                effect["used"] = f"{effect['told']}; {same}{sizes}"
        covered = with_effects(asked, self.traced, only=off, covered=True)
        with_all = replace(covered, asked=run.asked.adding(added))
        plain = options.response is None and options.formula is None
        return ConfirmedFit(
            noted_of(fit_run(with_all.asked), run.notes),
            record,
            (lambda at, _: general_evaluation(self.traced.table, at, found=with_all)) if plain else None,
        )

    @cached_property
    def _times_s(self) -> tuple[float, float]:
        """Seconds between rows of one whole plot, and the additional time of a new one."""
        plots = self.data.table.columns.get("whole_plot", np.zeros(len(self.data)))
        return times_s(self.data.table.columns[TIME], np.diff(plots) != 0)

    def _read_at(self, set_name: str, setting: FloatArray) -> Mapping[str, FloatArray]:
        """(n,) what a standard will read of a quantity that is set in another unit, by the first run."""
        first = self.data.table
        found: dict[str, FloatArray] = {}
        for name in (name for name, own in first.set_in.items() if own == set_name):
            nominal = with_word(name, "set")
            levels, at = np.unique(first.columns[set_name], return_index=True)
            value = np.interp(setting, levels, first.columns[nominal][at])
            found |= {name: value, nominal: value}
        return found

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
            columns |= {factor.name: setting, factor.set_name: setting, **self._read_at(factor.set_name, setting)}
            since, start = moves_of(factor.name)
            if since in first.columns:
                stood = float(np.median(first.columns[since])) + wait_s
                columns |= {since: np.full(n, stood), start: np.concatenate([setting[:1], setting[:-1]])}
        for own in (own for own in map(read_at, first.outputs) if own in first.columns):
            columns[own] = columns[TIME] + float(np.median(first.columns[own] - first.columns[TIME]))
        sides = np.array([p.sides for p in run_list.points], np.float64)
        columns |= {f"{f.axis}_side": sides[:, at] for at, f in enumerate(run_list.factors) if f in run_list.sided}
        then, now = (t - t.min() for t in (first.columns[TIME], columns[TIME]))
        near = _nearest(run_list, first)
        recorded = {name: v for name, v in first.columns.items() if name not in columns}
        others = {name: np.interp(now, then, v) for name, v in recorded.items()}
        if near is not None:
            of_plot, within = _means(now, plots)[1], first.columns["whole_plot"]
            others |= {name: np.interp(of_plot, then, v) for name, v in recorded.items() if _stays(v, within)}
            others |= {name: _means(v, near[1])[0][near[0]] for name, v in recorded.items() if _stays(v, near[1])}
        return Table("planned", {name: {**others, **columns}[name] for name in first.columns}, True, {})


def _nearest(run_list: RunList, first: Table) -> tuple[IntArray, IntArray] | None:
    """(n,) the hard settings of the first run that are nearest to those of each planned row, by their number, and (m,)
    the numbers of those of its own rows; None without whole plots.
    """
    hard = [f for f in run_list.hard if f.name in first.columns]
    if not hard or "whole_plot" not in first.columns:
        return None
    there = np.column_stack([first.columns[f.set_name if f.set_name in first.columns else f.name] for f in hard])
    asked = np.column_stack([np.array(run_list.column(f.name), np.float64) for f in hard])
    kinds, own = np.unique(there, axis=0, return_inverse=True)
    span = np.where(np.ptp(there, axis=0) > 0.0, np.ptp(there, axis=0), 1.0)
    apart = np.sum(((asked[:, None] - kinds) / span) ** 2, axis=2)
    return np.argmin(apart, axis=1), own.reshape(-1)


def _means(v: FloatArray, group: FloatArray | IntArray) -> tuple[FloatArray, FloatArray]:
    """Means of the groups, ascending, and (n,) that of each row."""
    index = np.unique(group, return_inverse=True)[1].reshape(-1)
    means = np.bincount(index, v) / np.bincount(index)
    return means, means[index]


def _stays(v: FloatArray, group: FloatArray | IntArray) -> bool:
    """Whether a recorded quantity hardly varies within groups of rows, and differs between them."""
    return bool(np.sum((v - _means(v, group)[1]) ** 2) < WITHIN * np.sum((v - v.mean()) ** 2))


def _unit_keys(run_list: RunList) -> list[tuple[float, ...]]:
    """Settings that identify the unit of each point: those of the hard factors, or without any the whole setting."""
    hard = [at for at, factor in enumerate(run_list.factors) if factor.hard]
    return [tuple(p.setpoints[at] for at in hard) if hard else tuple(p.setpoints) for p in run_list.points]


def _from_the_ends(keys: Sequence[Any]) -> Iterator[Any]:
    """The first, the last, the middle, and so on to the rest."""
    yield from sorted(keys, key=lambda key: (min(keys.index(key), len(keys) - 1 - keys.index(key)), keys.index(key)))


def _of_points(run: GeneralProcedure, rows: list[list[float]]) -> GeneralProcedure:
    """The run with these settings in place of a grid."""
    values = values_of(run)
    factors = {name: {k: v for k, v in one.items() if k != "levels"} for name, one in values["factors"].items()}
    for name, factor in run.factors.items():  # defaults that follow from the levels stay those of the first run
        factors[name] |= {"band": factor.band, "tolerance": factor.tolerance, "near": factor.near}
        factors[name] = {k: v for k, v in factors[name].items() if v is not None}
    design = {"type": "file", "points": CHOSEN, "rows": rows}
    return with_routine(GeneralProcedure.model_validate({**values, "factors": factors, "design": design}), run)


def _determined(procedure: GeneralProcedure) -> bool:
    """Whether the settings of a procedure determine the declared models, and the error between whole plots beside."""
    run_list = procedure.expand()
    try:
        check_declared(procedure, run_list)
    except FitError:
        return False
    freedom = (found.freedom.whole_plots for _, _, found in evaluations(procedure, run_list))
    return all(df is None or df > 0 for df in freedom)
