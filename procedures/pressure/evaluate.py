"""Pressure transducers in whole plots: traces, error before and after, in JSON and in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from rig.fitter.effects.history import NOTHING, Laboratory
from rig.fitter.effects.sizes import size_95
from rig.fitter.errors import FitError
from rig.fitter.trace.outcome import Finding, Outcome, run_json
from rig.procedures.errors import DataError
from rig.procedures.evaluate.catalogue import with_own
from rig.procedures.evaluate.certificate import Change, Errors, certified, with_words
from rig.procedures.evaluate.results import Page
from rig.procedures.evaluate.trace_shown import in_full
from rig.procedures.present.blocks import Block
from rig.procedures.present.words import doubts_of, noise_of, verdict
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.declared import Declared
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.effects.scene import PressureEffect
from rig.procedures.pressure.figures import effect_figures
from rig.procedures.pressure.table import unused as unused_columns
from rig.procedures.pressure.table import usable
from rig.procedures.pressure.trace import FoundPressureEffect, TransducerTrace, WholePlotTrace, trace_whole_plots
from rig.procedures.tables.file_rows import rows_of_file
from rig.procedures.tables.table import Table


@dataclass(frozen=True, eq=False)
class WholePlotTraced:
    """A table and its trace.

    Attributes:
        table: source of the data.
        data: the same as arrays.
        trace: findings, by transducer.
        dead: reasons for left-out transducers, by output.
        declared: the model, and its source.
    """

    table: Table
    data: WholePlotData
    trace: WholePlotTrace
    dead: Mapping[str, str]
    declared: Declared

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig trace --json`."""
        data = {**self.trace.about, "simulated": self.table.simulated, **self.table.provenance}
        data |= {"file": self.table.source, "model": self.declared.to_dict()}
        beside = {"left_out": dict(self.dead), "unused": unused_columns(self.table).to_json()}
        return run_json(data, self.outcomes, reference=self.trace.reference, **beside)

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        return in_full(self)

    def page(self) -> Page:
        """Its report."""
        from rig.procedures.pressure.report import page_of  # noqa: PLC0415 - plots take a second to import

        return page_of(self, self.data, self.trace)

    @cached_property
    def outcomes(self) -> tuple[Outcome, ...]:
        """Outcome of each transducer."""
        return tuple(self._outcome(found) for found in self.trace.sensors.values())

    def _outcome(self, found: TransducerTrace) -> Outcome:
        outcome, sentence = found.outcome(), whole_plot_sentence(found.sensor, found)
        worded = (_worded(self.trace, found, effect) for effect in found.effects)
        figures = effect_figures(self.data, self.trace, found)
        told = replace(outcome, findings=(*worded, *outcome.unnamed), figures=figures)
        return certified(told, sentence, _errors(found))


def _worded(trace: WholePlotTrace, found: TransducerTrace, effect: FoundPressureEffect) -> Finding:
    """An effect or a finding about noise with intervals and a sentence."""
    size, entry = "", next((c.effect for c in trace.chosen if c.effect.name == effect.effect), None)
    if entry is not None:
        values = dict(zip(effect.terms, effect.coefficients, strict=True))
        halves = dict(zip(effect.terms, effect.half_width_95, strict=True))
        size = size_95(entry.size, values, halves, found.sensitivity)
    return with_words(found.sensor, effect, effect.half_width_95, size)


_HIDES = "the whole plots' own errors included, which effects within them do not change"


def _errors(found: TransducerTrace) -> Errors:
    before, after = found.before, found.after
    left_out = None
    if before.cv_rms is not None and after.cv_rms is not None:
        of = "the error at whole plots left out of search and fit"
        left_out = Change(of, before.cv_rms, after.cv_rms, "mV")
    within = "the error within whole plots", before.fit.sigma_subplot, after.fit.sigma_subplot
    between = "that between them", before.fit.sigma_wholeplot, after.fit.sigma_wholeplot
    tells = any(effect.stratum == "whole-plot" for effect in found.effects)
    return Errors([Change(*within, "mV"), Change(*between, "mV")], left_out, "" if tells else _HIDES)


def trace_whole_plot_table(
    table: Table, model: str | None = None, own: Laboratory = NOTHING, *, validate: bool = True
) -> WholePlotTraced:
    """Find effects missing in the declared model of a whole-plot table; errors as for `fit_whole_plots`.

    Args:
        table: the run.
        model: as there.
        own: effects of the laboratory.
        validate: as for `trace_whole_plots`.
    """
    data, dead = usable(table)
    declared = Declared.of(table, model, data)
    try:
        with rows_of_file(table):
            catalogue = with_own(PRESSURE_CATALOGUE, own, PressureEffect)
            found = trace_whole_plots(data, declared.model, catalogue, validate=validate)
        return WholePlotTraced(table, data, found, dead, declared)
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error


def whole_plot_sentence(name: str, found: TransducerTrace) -> str:
    """Summary of the findings in one transducer."""
    before, after = (
        f"{side.fit.sigma_subplot:.3g} mV within whole plots and {side.fit.sigma_wholeplot:.3g} mV between them"
        for side in (found.before, found.after)
    )
    noise = [e.cause for e in found.effects if e.stratum == "noise"]
    if not found.added:
        told = verdict(found.verdict, noise)
        return f"{name}: the declared model ({found.declared}) leaves errors of {before}; {told}."
    causes = [f"{e.effect} ({e.peak_psi:.2g} psi at most)" for e in found.added]
    text = (
        f"{name}: the declared model ({found.declared}) leaves errors of {before}; it lacks {' and '.join(causes)}. "
        f"With that the errors are {after}"
    )
    rms = found.before.cv_rms, found.after.cv_rms
    if rms[0] is not None and rms[1] is not None:
        text += f", and the error at whole plots that were left out goes from {rms[0]:.3g} to {rms[1]:.3g} mV"
    return text + doubts_of({e.effect: e.doubtful for e in found.added}) + noise_of(noise) + "."
