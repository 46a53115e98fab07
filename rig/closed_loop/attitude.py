"""Attitude sensors: fit, trace, error before and after, in JSON and in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fitter import AttitudeData, fit_all, fit_attitude
from fitter.arrays import FloatArray
from fitter.calibration import AttitudeFit, at_temperature, parameter_table
from fitter.gross import of_attitude
from fitter.inverse import AttitudeCalibration, calibrate_package
from fitter.quantiles import t_limit
from fitter.trace import SensorTrace, Trace, trace
from fitter.trace.result import FoundEffect
from rig.closed_loop.certificate import Change, Errors, certificate, size_95, with_words
from rig.closed_loop.gross import FitSummary, LeaveOut, Searched, kept_with, search
from rig.effects import attitude_catalogue
from rig.errors import UsageError
from rig.report.words import part
from rig.tables import Table, attitude_data
from rig.tables.unused import unused_in_fit

ABSOLUTE_ZERO_DEGC = -273.15


def fit_attitude_table(
    table: Table,
    *,
    traced: bool = False,
    temperature: bool | None = None,
    at_degC: float | None = None,
    leave_out: Sequence[str] = (),
) -> dict[str, Any]:
    """Fit the declared model to every sensor of a pitch-roll table; JSON-ready.

    Args:
        table: of kind pitch-roll.
        traced: have the effects that a trace finds in the calibration that is kept.
        temperature: whether offset and sensitivity follow the sensor temperature in the declared model; as the table's
            procedure has it if None.
        at_degC: sensor temperature at which parameters are given; the run's mean if None.
        leave_out: "gross" for the rows that the search for gross errors names, or row numbers of the file.

    Raises:
        UsageError: the table lacks something, or its rows do not determine the model.

    """
    every, warm = attitude_data(table), with_temperature(table, temperature)
    asked = LeaveOut.of(leave_out, table.source, len(every))
    _check_at(at_degC, table.source, warm=warm, traced=traced)
    try:
        searched = search(len(every), asked, lambda rows: of_attitude(every.take(rows)))
        data = every.take(searched.used)
        fits = fit_all(data, temperature=warm, at_degC=at_degC)
        others = searched.with_the_others(lambda rows: fit_all(every.take(rows), temperature=warm, at_degC=at_degC))
        effects = _effects(trace(data, attitude_catalogue(), temperature=warm)) if traced else {}
        calibration = calibrate_package(data, effects=effects, temperature=warm)
    except ValueError as error:
        raise UsageError(f"{table.source}: {error}") from error
    return {
        "data": {
            "points": len(data),
            "rows_left_out": searched.rows_left_out(len(every)),
            "kind": "pitch-roll",
            "simulated": table.simulated,
            **table.provenance,
        },
        "sensors": {
            name: fit.to_dict() | {"gross_errors": _gross(every, searched, fit, others)} for name, fit in fits.items()
        },
        "kept": {name: _kept(calibration, name, effects, fits[name]) for name in calibration.names} if effects else {},
        "calibration": calibration.to_dict() | kept_with(searched, len(every)),
        "unused": unused_in_fit(table).to_json(),
    }


def _gross(
    data: AttitudeData, searched: Searched, fit: AttitudeFit, others: Mapping[str, AttitudeFit] | str | None
) -> dict[str, Any]:
    """A sensor's gross errors for JSON; `data` are all rows of the table."""
    fits: tuple[FitSummary, FitSummary | str] | None = None
    if isinstance(others, str):
        fits = _summary(fit), others
    elif others is not None:
        own, other = _summary(fit), _summary(others[fit.sensor])
        fits = (other, own) if searched.left_out.gross else (own, other)

    def where(row: int) -> str:
        return f"order {data.order[row]} at pitch {data.pitch_deg[row]:g} deg, roll {data.roll_deg[row]:g} deg"

    return searched.of_sensor(fit.sensor, "V", where, fits)


def _summary(fit: AttitudeFit) -> FitSummary:
    linear = fit.linear
    values = zip(linear.coefficients.tolist(), linear.stderr.tolist(), strict=True)
    return FitSummary({"sigma_E": linear.sigma}, "V", dict(zip(linear.names, values, strict=True)))


def _kept(
    calibration: AttitudeCalibration, name: str, effects: Mapping[str, Mapping[str, FloatArray]], fit: AttitudeFit
) -> dict[str, Any]:
    """A sensor as the calibration has it, where that is not what the declared model alone gives."""
    parameters, df = calibration.parameters(name)
    return {
        "effects": [effect for effect, by in effects.items() if name in by],
        "parameters": at_temperature(parameter_table(parameters, df), fit.at_degC),
        "at_degC_sentence": fit.at_words,
    }


def _check_at(at_degC: float | None, source: str, *, warm: bool, traced: bool) -> None:
    """Refuse a temperature that parameters cannot be brought to."""
    if at_degC is None:
        return
    if not warm:
        raise UsageError(
            f"--at-degC: the declared model of {source} has no temperature in it, so its parameters hold at the run's "
            f"own temperature alone; fit with --temperature"
        )
    if traced:
        raise UsageError(
            "--at-degC gives the declared model's parameters; with effects beside it (--traced) they are given at the "
            "run's mean temperature: leave one of the two away"
        )
    if not np.isfinite(at_degC) or at_degC < ABSOLUTE_ZERO_DEGC:
        raise UsageError(f"--at-degC {at_degC:g} is no temperature")


def with_temperature(table: Table, asked: bool | None) -> bool:
    """Whether the declared model has temperature in it: as asked, else as the table's procedure says, else not."""
    return bool(table.declared.get("temperature", False)) if asked is None else asked


def _effects(found: Trace) -> dict[str, dict[str, FloatArray]]:
    """Volts that each effect adds to the observations, by effect and sensor."""
    effects: dict[str, dict[str, FloatArray]] = {}
    for name, sensor in found.sensors.items():
        for effect in sensor.effects:
            effects.setdefault(effect.effect, {})[name] = effect.contribution_V
    return effects


@dataclass(frozen=True, eq=False)
class AttitudeTraced:
    """A table and what was traced in it.

    Attributes:
        table: where the data come from.
        data: the same as arrays.
        trace: what was found, by sensor.
        temperature: whether the declared model has temperature in it.

    """

    table: Table
    data: AttitudeData
    trace: Trace
    temperature: bool = False

    def at_words(self, sensor: str) -> str:
        """At which temperature a sensor's parameters hold, in words."""
        return fit_attitude(self.data, sensor, temperature=self.temperature).at_words

    def to_json(self) -> dict[str, Any]:
        """What `rig trace --json` prints."""
        result: dict[str, Any] = self.trace.to_json(self.table.source)
        result["data"] |= {"simulated": self.table.simulated, **self.table.provenance, "file": self.table.source}
        for name, sensor in self.trace.sensors.items():
            shown = result["sensors"][name]
            shown["sentence"] = attitude_sentence(name, sensor)
            shown["effects"] = [_worded(self.trace, sensor, effect) for effect in shown["effects"]]
            shown["at_degC_sentence"] = self.at_words(name)
            shown["certificate"] = certificate(name, shown, _errors(sensor))
        return {**result, "unused": unused_in_fit(self.table).to_json()}


def _worded(found: Trace, sensor: SensorTrace, effect: dict[str, Any]) -> dict[str, Any]:
    """An effect's JSON with intervals and a sentence."""
    of = next((e for e in sensor.effects if e.effect == effect["effect"]), None)
    t = t_limit(0.95, sensor.fit.df)
    if effect["stratum"] == "replication" and of is not None:
        t = t_limit(0.95, max(found.scene.data.replicates.size - 2, 1))
    halves = [None if error is None else t * error for error in effect["stderr"]]
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
    widest = max(halves.values())  # a term that hardly shows in this sensor has no error of its own here
    return size_95(of.size, values, {n: halves.get(n, widest) for n in values}, sensor.S_V)


def trace_attitude_table(table: Table, *, temperature: bool | None = None, unnamed: bool = False) -> AttitudeTraced:
    """Trace what the declared model lacks in a pitch-roll table; arguments and errors as for `fit_attitude_table`."""
    data, warm = attitude_data(table), with_temperature(table, temperature)
    try:
        found = trace(data, attitude_catalogue(), temperature=warm, unnamed=unnamed)
        for name, sensor in found.sensors.items():
            if not np.isfinite(sensor.before.sigma_E):
                raise ValueError(
                    f"{name}: {len(table)} observations leave nothing to estimate the error of the declared model "
                    f"({sensor.declared}) from; measure more points than it has coefficients"
                )
        return AttitudeTraced(table, data, found, warm)
    except ValueError as error:
        raise UsageError(f"{table.source}: {error}") from error


def attitude_sentence(name: str, found: SensorTrace) -> str:
    """What was found in one sensor, in brief."""
    before, after = (_degrees(side.sigma_E, found.S_V) for side in (found.before, found.after))
    if not found.effects:
        return f"{name}: the declared model ({found.declared}) leaves a standard error of {before}; {found.verdict}."
    effects = " and ".join(f"{e.effect} ({part(e.share)} of the excess over scatter)" for e in found.effects)
    alike = "; ".join(f"{e.effect} from {', '.join(e.aliases)}" for e in found.effects if e.aliases)
    told = f"; these data cannot tell {alike}" if alike else ""
    text = (
        f"{name}: the declared model ({found.declared}) leaves a standard error of {before}; it lacks {effects}{told}. "
        f"With that the standard error is {after}"
    )
    if found.cv_rms_before is not None and found.cv_rms_after is not None:
        errors = (_degrees(rms, found.S_V) for rms in (found.cv_rms_before, found.cv_rms_after))
        text += ", and the error at replications that were left out goes from {} to {}".format(*errors)
    return text + "."


def _degrees(volts: float, sensitivity: float) -> str:
    return f"{np.degrees(volts / sensitivity):.3g} deg"
