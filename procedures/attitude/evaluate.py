"""Attitude sensors: fit, trace, error before and after, in JSON and in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import PurePath
from types import MappingProxyType
from typing import Any

import numpy as np

from fitter.arrays import FloatArray
from fitter.effects.entry import Entry
from fitter.effects.sizes import size_95
from fitter.errors import FitError
from fitter.quantiles import t_limit
from fitter.trace.outcome import Finding, Outcome, run_json
from procedures.attitude.data import AttitudeData
from procedures.attitude.effects import CATALOGUE, Effect
from procedures.attitude.fit import AttitudeFit, at_temperature, fit_all, fit_attitude
from procedures.attitude.gross import of_attitude
from procedures.attitude.infer import AttitudeCalibration
from procedures.attitude.infer.traced import Volts, calibrate_traced, covering_parameters
from procedures.attitude.rows import effect_figures, parameter_rows
from procedures.attitude.table import KNOWN, UNIT, attitude_data
from procedures.attitude.trace import FoundEffect, SensorTrace, Trace, trace
from procedures.blocks import Block, headline
from procedures.catalogue import with_own
from procedures.certificate import Change, Errors, certified, with_words
from procedures.effects_shown import show_confirmed
from procedures.errors import DataError
from procedures.left_out import FitSummary, LeaveOut, Searched, kept_with, search
from procedures.results import Page, PlainFitted
from procedures.table import Table
from procedures.unused import unused_in_fit
from procedures.words import doubts_of, noise_of, part, verdict

ABSOLUTE_ZERO_DEGC = -273.15


def fit_attitude_table(
    table: Table,
    *,
    traced: bool = False,
    temperature: bool | None = None,
    at_degC: float | None = None,
    leave_out: Sequence[str] = (),
    found: Trace | None = None,
    allowed: Mapping[str, Sequence[str]] = MappingProxyType({}),
    own: Sequence[Entry] = (),
) -> dict[str, Any]:
    """Fit the declared model to every sensor of a pitch-roll table; returns JSON values.

    Args:
        table: of kind pitch-roll.
        traced: whether the stored calibration includes the effects found by a trace.
        temperature: whether offset and sensitivity depend on the sensor temperature in the declared model; None for the
            setting of the table's procedure.
        at_degC: sensor temperature at which parameters are given; the run's mean if None.
        leave_out: "gross" for the rows named by the search for gross errors, or row numbers of the file.
        found: result of a trace of the table, if it exists.
        allowed: members of an effect's class that a follow-up run has left, by the effect's name in the trace; the
            first is used and the others widen its intervals. By default all members of a class.
        own: effects of the laboratory, in addition to the catalogue.

    Raises:
        DataError: columns or values are missing, or the rows do not determine the model.
    """
    every, warm = attitude_data(table), with_temperature(table, temperature)
    asked = LeaveOut.of(leave_out, table)
    _check_at(at_degC, table.source, warm=warm, traced=traced)
    try:
        searched = search(table, asked, lambda rows: of_attitude(every.take(rows)))
        data = every.take(searched.used)
        fits = fit_all(data, temperature=warm, at_degC=at_degC)
        without = searched.with_the_others(lambda rows: fit_all(every.take(rows), temperature=warm, at_degC=at_degC))
        if traced and found is None:
            found = trace(
                data, with_own(CATALOGUE, own, Effect), temperature=warm, validate=False
            )  # the left-out error is not reported
        effects, others = ({}, []) if found is None else _effects(found, allowed)
        calibration = calibrate_traced(data, effects, others, temperature=warm)
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error
    return {
        "data": {
            "points": len(data),
            "rows_left_out": searched.rows_left_out,
            "kind": "pitch-roll",
            "simulated": table.simulated,
            **table.provenance,
        },
        "sensors": {
            name: fit.to_dict() | {"gross_errors": _gross(every, searched, fit, without)} for name, fit in fits.items()
        },
        "kept": {name: _kept(calibration, name, effects, fits[name]) for name in calibration.names} if effects else {},
        "calibration": calibration.to_dict() | kept_with(searched),
        "unused": unused_in_fit(table, KNOWN, UNIT).to_json(),
    }


def _gross(
    data: AttitudeData, searched: Searched, fit: AttitudeFit, others: Mapping[str, AttitudeFit] | str | None
) -> dict[str, Any]:
    """A sensor's gross errors as JSON values; `data` are all rows of the table."""
    other = _summary(others[fit.sensor]) if isinstance(others, Mapping) else others

    def where(row: int) -> str:
        return f"order {data.order[row]} at pitch {data.pitch_deg[row]:g} deg, roll {data.roll_deg[row]:g} deg"

    return searched.of_sensor(fit.sensor, "V", where, _summary(fit), other)


def _summary(fit: AttitudeFit) -> FitSummary:
    linear = fit.linear
    return FitSummary.of({"sigma_E": linear.sigma}, "V", linear.names, linear.coefficients, linear.stderr)


def _kept(
    calibration: AttitudeCalibration, name: str, effects: Mapping[str, Mapping[str, FloatArray]], fit: AttitudeFit
) -> dict[str, Any]:
    """A sensor in the stored calibration, if it differs from the declared model alone."""
    parameters, misfit = covering_parameters(calibration, name), calibration.misfits[name]
    return {
        "effects": [effect for effect, by in effects.items() if name in by],
        "parameters": at_temperature(parameters, fit.at_degC),
        "at_degC_sentence": fit.at_words,
        "depends_on": [row["sentence"] for row in parameters.values() if "sentence" in row],
        "lack_of_fit": misfit.to_dict() | {"sentence": misfit.sentence(name)},
    }


def _check_at(at_degC: float | None, source: str, *, warm: bool, traced: bool) -> None:
    """Refuse a temperature to which parameters cannot be converted."""
    if at_degC is None:
        return
    if not warm:
        raise DataError(
            f"--at-degC: the declared model of {source} has no temperature in it, so its parameters hold at the run's "
            f"own temperature alone; fit with --temperature"
        )
    if traced:
        raise DataError(
            "--at-degC gives the declared model's parameters; with effects beside it (--traced) they are given at the "
            "run's mean temperature: leave one of the two away"
        )
    if not np.isfinite(at_degC) or at_degC < ABSOLUTE_ZERO_DEGC:
        raise DataError(f"--at-degC {at_degC:g} is no temperature")


def with_temperature(table: Table, asked: bool | None) -> bool:
    """Whether the declared model has temperature: as requested, or by the table's procedure, or not."""
    return bool(table.declared.get("temperature", False)) if asked is None else asked


Others = list[tuple[str, str, Volts]]


def traced_effects(data: AttitudeData, *, temperature: bool) -> tuple[Volts, Others]:
    """Effects that a trace of the catalogue finds, and all of them with another member of a class in place of one.

    Raises:
        FitError: the run cannot be traced.
    """
    return _effects(trace(data, CATALOGUE, temperature=temperature, validate=False), {})


def _effects(found: Trace, allowed: Mapping[str, Sequence[str]]) -> tuple[Volts, Others]:
    """Contribution of each effect to the observations, volts, by effect and sensor; and of every alternative.

    An effect occurs in the sensors in which it is reported; its contribution to others is negligible.
    """
    named: dict[str, dict[str, FloatArray]] = {}
    for sensor in found.sensors.values():
        for one in sensor.effects:
            named.setdefault(one.effect, {})[sensor.sensor] = one.columns_V
    shown = {sensor for by in named.values() for sensor in by}
    full = {
        (other.named, other.member): {
            e: {s: v for s, v in by.items() if s in shown}
            for e, by in other.effects.items()
            if e in named or e == other.member  # without smooth terms that have no cause
        }
        for other in found.alternatives
        if other.named in named
    }
    classes = {name: _members(name, [m for n, m in full if n == name], allowed) for name in named}
    own: dict[tuple[str, str], Volts] = {
        (name, member): {member: volts[member]} for (name, member), volts in full.items()
    }
    own |= {(name, name): {name: by} for name, by in named.items()}
    kept = {e: by for name, members in classes.items() for e, by in own[name, members[0]].items()}
    as_named = all(members[0] == name for name, members in classes.items())
    others: Others = []
    for name, (first, *rest) in classes.items():
        beside = {e: by for e, by in kept.items() if e != first}
        others += [(first, m, full[name, m] if as_named else {**beside, **own[name, m]}) for m in rest]
    return kept, others


def _members(name: str, others: Sequence[str], allowed: Mapping[str, Sequence[str]]) -> list[str]:
    """Remaining members of an effect's class, the used one first: the named one, if it remains."""
    every = [name, *others]
    return [member for member in every if member in allowed.get(name, every)] or every


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

    def at_words(self, sensor: str) -> str:
        """Reference temperature of a sensor's parameters, in words."""
        return self.declared[sensor].at_words

    @cached_property
    def declared(self) -> Mapping[str, AttitudeFit]:
        """Fit of the declared model alone, by sensor."""
        return {s: fit_attitude(self.data, s, temperature=self.temperature) for s in self.trace.sensors}

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig trace --json`."""
        data = {**self.trace.about, "simulated": self.table.simulated, **self.table.provenance}
        data["file"] = self.table.source
        unused = unused_in_fit(self.table, KNOWN, UNIT).to_json()
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
            at_degC_sentence=self.at_words(name),
            depends_on=list(self.depends_on(name)),
        )

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        from procedures.attitude.shown import show_attitude_trace  # noqa: PLC0415 - which needs this class

        return show_attitude_trace(self)

    def summary(self) -> Iterator[Block]:
        """All of it: there are few sensors."""
        return self.blocks()

    def page(self) -> Page:
        """Its report."""
        from procedures.attitude.report import trace_page  # noqa: PLC0415 - plots take a second to import

        return trace_page(self)

    def depends_on(self, sensor: str) -> tuple[str, ...]:
        """Sentences about parameters whose value depends on the choice among several causes."""
        if not any(e.aliases for e in self.trace.sensors[sensor].effects):
            return ()
        table = covering_parameters(self.calibration, sensor)
        return tuple(row["sentence"] for row in table.values() if "sentence" in row)

    @cached_property
    def calibration(self) -> AttitudeCalibration:
        """Calibration of `rig fit --traced` from the same table.

        Raises:
            fitter.linear.RankError: the points do not determine the model with the effects found.
        """
        return calibrate_traced(self.data, *_effects(self.trace, {}), temperature=self.temperature)


def _worded(found: Trace, sensor: SensorTrace, effect: Finding) -> Finding:
    """An effect or a finding about noise with intervals and a sentence."""
    if effect.kind == "unnamed":
        return effect
    of = next((e for e in sensor.effects if e.effect == effect.effect), None)
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
    table: Table, *, temperature: bool | None = None, unnamed: bool = False, own: Sequence[Entry] = ()
) -> AttitudeTraced:
    """Find effects missing in the declared model of a pitch-roll table; arguments and errors as for
    `fit_attitude_table`.
    """
    data, warm = attitude_data(table), with_temperature(table, temperature)
    try:
        found = trace(data, with_own(CATALOGUE, own, Effect), temperature=warm, unnamed=unnamed)
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
    if not found.effects:
        told = verdict(found.verdict, noise)
        return f"{name}: the declared model ({found.declared}) leaves a standard error of {before}; {told}."
    effects = " and ".join(f"{e.effect} ({part(e.share)} of the error beyond scatter)" for e in found.effects)
    alike = "; ".join(f"{e.effect} from {', '.join(e.aliases)}" for e in found.effects if e.aliases)
    told = f"; these data cannot tell {alike}" if alike else ""
    told += doubts_of({e.effect: e.doubtful for e in found.effects})
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


@dataclass(frozen=True)
class AttitudeFitted(PlainFitted):
    """A table and its calibration as JSON values."""

    table: Table

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        from procedures.attitude.shown import show_attitude_fit  # noqa: PLC0415 - which needs this module

        yield headline(PurePath(self.table.source).name, self.table)
        yield from show_attitude_fit(self.result)
        if "confirmed_by" in self.result:
            yield from show_confirmed(self.result["confirmed_by"])
