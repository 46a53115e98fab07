"""Attitude sensors: traces, error before and after, in JSON and in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rig.fitter.effects.history import NOTHING, Laboratory
from rig.fitter.effects.sizes import size_95
from rig.fitter.errors import FitError
from rig.fitter.quantiles import t_limit
from rig.fitter.trace.outcome import Finding, Outcome, run_json
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects import CATALOGUE, Effect
from rig.procedures.attitude.fit import AttitudeFit, fit_attitude
from rig.procedures.attitude.fitted import effects_of, with_temperature
from rig.procedures.attitude.infer import AttitudeCalibration
from rig.procedures.attitude.infer.traced import calibrate_traced, covering_parameters
from rig.procedures.attitude.rows import effect_figures, parameter_rows
from rig.procedures.attitude.table import attitude_data
from rig.procedures.attitude.table import unused as unused_columns
from rig.procedures.attitude.trace import FoundEffect, SensorTrace, Trace, trace
from rig.procedures.attitude.words import little_help
from rig.procedures.errors import DataError
from rig.procedures.evaluate.catalogue import with_own
from rig.procedures.evaluate.certificate import Change, Errors, certified, with_words
from rig.procedures.evaluate.results import Page
from rig.procedures.evaluate.trace_shown import in_full
from rig.procedures.present.blocks import Block
from rig.procedures.present.words import doubts_of, noise_of, part, verdict
from rig.procedures.tables.table import Table


@dataclass(frozen=True, eq=False)
class AttitudeTraced:
    """A table and its trace.

    Attributes:
        table: source of the data.
        data: the same as arrays.
        trace: findings, by sensor.
        temperature: whether the declared model has temperature.
    """

    table: Table
    data: AttitudeData
    trace: Trace
    temperature: bool = False

    @cached_property
    def declared(self) -> Mapping[str, AttitudeFit]:
        """Fit of the declared model alone, by sensor."""
        return {s: fit_attitude(self.data, s, temperature=self.temperature) for s in self.trace.sensors}

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig trace --json`."""
        data = {**self.trace.about, "simulated": self.table.simulated, **self.table.provenance}
        data["file"] = self.table.source
        unused = unused_columns(self.table).to_json()
        return run_json(data, self.outcomes, reference=self.trace.reference, unused=unused)

    @cached_property
    def outcomes(self) -> tuple[Outcome, ...]:
        """Outcome of each sensor."""
        return tuple(self._outcome(name) for name in self.trace.sensors)

    def _outcome(self, name: str) -> Outcome:
        sensor = self.trace.sensors[name]
        outcome, declared = sensor.outcome(), self.declared[name]
        return certified(
            replace(
                outcome,
                findings=tuple(_worded(self.trace, sensor, one) for one in outcome.findings),
                parameters=parameter_rows(declared, sensor, lambda: self.calibration),
                figures=effect_figures(self.data, declared, sensor, self.trace.outliers),
            ),
            attitude_sentence(name, sensor),
            _errors(sensor),
            at_degC_sentence=declared.at_words,
            depends_on=list(self.depends_on(name)),
        )

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        return in_full(self, little_help)

    def page(self) -> Page:
        """Its report."""
        from rig.procedures.attitude.report import page_of  # noqa: PLC0415 - plots take a second to import

        return page_of(self, self.data, self.trace)

    def depends_on(self, sensor: str) -> tuple[str, ...]:
        """Sentences about parameters whose value depends on the choice among several causes."""
        if not any(e.aliases for e in self.trace.sensors[sensor].added):
            return ()
        table = covering_parameters(self.calibration, sensor)
        return tuple(row["sentence"] for row in table.values() if "sentence" in row)

    @cached_property
    def calibration(self) -> AttitudeCalibration:
        """Calibration of `rig fit --traced` from the same table.

        Raises:
            rig.fitter.linear.RankError: the points do not determine the model with the effects found.
        """
        return calibrate_traced(self.data, *effects_of(self.trace, {}), temperature=self.temperature)


def _worded(found: Trace, sensor: SensorTrace, effect: Finding) -> Finding:
    """An effect or a finding about noise with intervals and a sentence."""
    if effect.kind == "unnamed":
        return effect
    of = next((e for e in sensor.added if e.effect == effect.effect), None)
    t = t_limit(0.95, sensor.fit.df if of is None else of.df)
    halves = [t * error for error in effect.stderr]
    return with_words(sensor.sensor, effect, halves, "" if of is None else _size(found, sensor, of, t))


def _errors(sensor: SensorTrace) -> Errors:
    left_out, rms, pure_V = None, (sensor.cv_rms_before, sensor.cv_rms_after), sensor.after.sigma_pr
    if rms[0] is not None and rms[1] is not None:
        left_out = _change("the error at replications left out of search and fit", rms[0], rms[1], sensor)
    return Errors(
        [_change("the standard error of one observation", sensor.before.sigma_E, sensor.after.sigma_E, sensor)],
        left_out,
        floor=_degrees(pure_V, sensor.S_V) if np.isfinite(pure_V) else "",
    )


def _change(of: str, before_V: float, after_V: float, sensor: SensorTrace) -> Change:
    before, after = (float(np.degrees(volts / sensor.S_V)) for volts in (before_V, after_V))
    return Change(of, before, after, "deg")


def _size(found: Trace, sensor: SensorTrace, effect: FoundEffect, t: float) -> str:
    """95 % interval of an effect's size in words."""
    known = dict(zip(effect.terms, effect.stderr, strict=True))
    values: dict[str, float] = {}
    halves: dict[str, float] = {}
    of = next(candidate.effect for candidate in found.chosen if candidate.effect.name == effect.effect)
    for candidate, gamma in zip(found.chosen, found.gamma.tolist(), strict=True):
        if candidate.effect.name == effect.effect and candidate.sensor in (None, sensor.sensor):
            formula, factor = candidate.term.as_formula(found.scene, sensor.sensor)
            values[candidate.term.name] = gamma
            if formula in known and factor:
                halves[candidate.term.name] = t * known[formula] / abs(factor)
    if not halves:
        return ""
    widest = max(halves.values())  # a term with hardly any effect in this sensor has no separate error
    return size_95(of.size, values, {n: halves.get(n, widest) for n in values}, sensor.S_V)


def trace_attitude_table(
    table: Table,
    *,
    temperature: bool | None = None,
    unnamed: bool = False,
    own: Laboratory = NOTHING,
    validate: bool = True,
) -> AttitudeTraced:
    """Find effects missing in the declared model of a pitch-roll table; arguments and errors as for
    `fit_attitude_table`, `validate` as for `trace`.
    """
    data, warm = attitude_data(table), with_temperature(table, temperature)
    try:
        found = trace(data, with_own(CATALOGUE, own, Effect), temperature=warm, unnamed=unnamed, validate=validate)
        for name, sensor in found.sensors.items():
            if not np.isfinite(sensor.before.sigma_E):
                raise FitError(
                    f"{name}: {len(table)} observations leave nothing to estimate the error of the declared model "
                    f"({sensor.declared}) from; measure more points than it has coefficients"
                )
        return AttitudeTraced(table, data, found, warm)
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error


def attitude_sentence(name: str, found: SensorTrace) -> str:
    """Summary of the findings in one sensor."""
    before, after = (_degrees(side.sigma_E, found.S_V) for side in (found.before, found.after))
    noise = [finding.cause for finding in found.noise]
    if not found.added:
        told = verdict(found.verdict, noise)
        return f"{name}: the declared model ({found.declared}) leaves a standard error of {before}; {told}."
    effects = " and ".join(f"{e.effect} ({part(e.share)} of the error beyond scatter)" for e in found.added)
    alike = "; ".join(f"{e.effect} from {', '.join(e.aliases)}" for e in found.added if e.aliases)
    told = f"; these data cannot tell {alike}" if alike else ""
    told += doubts_of({e.effect: e.doubtful for e in found.added})
    text = (
        f"{name}: the declared model ({found.declared}) leaves a standard error of {before}; it lacks {effects}{told}. "
        f"With that the standard error is {after}"
    )
    if found.cv_rms_before is not None and found.cv_rms_after is not None:
        errors = (_degrees(rms, found.S_V) for rms in (found.cv_rms_before, found.cv_rms_after))
        text += ", and the error at replications that were left out goes from {} to {}".format(*errors)
    return text + noise_of(noise) + "."


def _degrees(volts: float, sensitivity: float) -> str:
    return f"{np.degrees(volts / sensitivity):.3g} deg"
