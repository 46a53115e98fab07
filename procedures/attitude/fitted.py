"""Attitude sensors: calibrations, in JSON and in words."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.fitter.effects.history import NOTHING, Laboratory
from rig.fitter.errors import FitError
from rig.procedures.attitude.fit import AttitudeFit, at_temperature, fit_all
from rig.procedures.attitude.gross import of_attitude
from rig.procedures.attitude.infer.traced import Volts, calibrate_traced, covering_parameters
from rig.procedures.attitude.shown import show_attitude_fit, show_attitude_fit_in_short
from rig.procedures.attitude.table import attitude_data
from rig.procedures.attitude.table import unused as unused_columns
from rig.procedures.errors import DataError
from rig.procedures.evaluate.catalogue import with_own
from rig.procedures.evaluate.fit_in_short import MANY
from rig.procedures.evaluate.left_out import FitSummary, LeaveOut, Searched, kept_with, search
from rig.procedures.evaluate.results import PlainFitted
from rig.procedures.present.blocks import Block, headline

if TYPE_CHECKING:
    from rig.fitter.arrays import FloatArray
    from rig.procedures.attitude.data import AttitudeData
    from rig.procedures.attitude.infer import AttitudeCalibration
    from rig.procedures.attitude.settings import PitchRollProcedure
    from rig.procedures.attitude.trace import Trace
    from rig.procedures.tables.table import Table
from rig.procedures.evaluate.acceptance import Verdict, gross_words
from rig.procedures.tables.table import Table


def judge(procedure: PitchRollProcedure, table: Table) -> list[Verdict]:
    """Every sensor's standard error compared with its limit; [] without one."""
    limit = procedure.acceptance.sigma_E_deg
    if limit is None:
        return []
    words = f"sigma_E up to {limit:g} deg"
    verdicts = []
    for name, sensor in fit_attitude_table(table)["sensors"].items():
        sigma = sensor["sigma_E_deg"]
        shown = "unknown" if sigma is None else f"{sigma:.3g} deg"
        inside = sigma is not None and sigma <= limit
        said = f"sigma_E {shown}, limit {limit:g} deg{gross_words(sensor['gross_errors'])}"
        verdicts.append(Verdict(name, said, words, inside))
    return verdicts


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
    own: Laboratory = NOTHING,
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
            found = _trace_of(data, own, temperature=warm)
        effects, others = ({}, []) if found is None else effects_of(found, allowed)
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
        "unused": unused_columns(table).to_json(),
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
    return effects_of(_trace_of(data, NOTHING, temperature=temperature), {})


def _trace_of(data: AttitudeData, own: Laboratory, *, temperature: bool) -> Trace:
    """A trace for its effects, without the left-out error, which is not reported."""
    from rig.procedures.attitude.effects import CATALOGUE, Effect  # noqa: PLC0415 - few fits need a trace
    from rig.procedures.attitude.trace import trace  # noqa: PLC0415

    return trace(data, with_own(CATALOGUE, own, Effect), temperature=temperature, validate=False)


def effects_of(found: Trace, allowed: Mapping[str, Sequence[str]]) -> tuple[Volts, Others]:
    """Contribution of each effect to the observations, volts, by effect and sensor; and of every alternative.

    An effect occurs in the sensors in which it is reported; its contribution to others is negligible.
    """
    named: dict[str, dict[str, FloatArray]] = {}
    for sensor in found.sensors.values():
        for one in sensor.added:
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


@dataclass(frozen=True)
class AttitudeFitted(PlainFitted):
    """A table and its calibration as JSON values."""

    table: Table

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        yield headline(PurePath(self.table.source).name, self.table)
        yield from show_attitude_fit(self.result)

    def short(self) -> Iterable[Block]:
        """Blocks for one screen; up to three sensors have all."""
        if len(self.result["sensors"]) <= MANY:
            return self.blocks()
        return (headline(PurePath(self.table.source).name, self.table), *show_attitude_fit_in_short(self.result))
