"""Dwells of a plan that are short beside the time constants that bench and world state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import ceil, exp, inf, log, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.bench.bench_file import check_options, playing
from rig.bench.config import FOLLOWS_S
from rig.drivers.roles import Chamber, Source
from rig.engine.pace import is_read
from rig.fitter.arithmetic_text import parse_expression
from rig.fitter.errors import FitError
from rig.procedures.column_names import spelled, stem_of, unit_of
from rig.procedures.plan.run_list import Factor, Settle
from rig.units.of_instruments import TEMPERATURE_UNIT

if TYPE_CHECKING:
    from rig.runs.plans import Plan

_OF_SPAN = {"settle.dwell_s": 1e-4, "soak.dwell_s": 1e-3}
"""Part of the range of a factor's settings that may be left of a step, by the key of the dwell, where no scatter of an
output is expected. Thermometers record how far a soaked temperature has come.
"""
_ERRORS = 0.5
"""Standard errors of a mean over the run that may be left. A trace finds two or three of them as a direction of
approach, and the scatter is often several times smaller than expected.
"""


def short_dwells(plan: Plan) -> Iterator[str]:
    """A sentence for each factor of which too much of a step is left when a point is read."""
    options = check_options(plan.bench, "bench.toml")
    for factor in plan.run_list.factors:
        setter = plan.bench.setters.get(factor.name, "")
        known = _time_constant(plan, factor, getattr(options.get(setter), "time_constant_s", None))
        values = np.array(plan.run_list.column(factor.name), np.float64)
        step = float(np.abs(np.diff(values)).max(initial=0.0))
        if known is None or step == 0.0:
            continue
        tau, of = known
        key, settle, near = _criterion(plan, factor, options.get(setter), tau, step)
        left = near * exp(-settle.dwell_s / tau)
        of_output = list(_effects(plan, factor.name, left))
        allowed = _OF_SPAN[key] * float(np.ptp(values)) / left if left else inf
        allowed = min((one[3] for one in of_output), default=allowed)
        if allowed >= 1.0:
            continue
        unit, enough = spelled(unit_of(factor.name)), ceil(settle.dwell_s - tau * log(allowed))
        outputs = ", ".join(
            f"{size:.2g} {u} of {name}, expect.sigma {sigma:g} {u}" for name, size, sigma, _, u in of_output
        )
        yield (
            f"{factor.name}: {left:.2g} {unit} of a step of {step:g} {unit} is left after the dwell"
            f"{f' ({outputs})' if outputs else ''}, by the time constant of {of}, {tau:g} s; a trace may find it as a "
            f"direction of approach or a lag: {key} = {enough:g} leaves less"
        )


def narrow_bands(plan: Plan) -> Iterator[str]:
    """A sentence for each factor whose band is narrower than what its instrument calls arrived."""
    options = check_options(plan.bench, "bench.toml")
    for factor in plan.run_list.factors:
        setter = plan.bench.setters.get(factor.name, "")
        within = getattr(options.get(setter), "tolerance", None)
        settle = plan.procedure.conduct.settled(factor.axis)
        if within and setter in playing(plan.bench, Source) and not factor.hard and settle.band < within:
            unit = spelled(unit_of(factor.name))
            yield (
                f"{factor.name}: a point waits until {setter} reads within {settle.band:g} {unit} of the setpoint, and "
                f"{setter} itself counts {within:g} {unit} as arrived: where its reading stays outside, nothing is "
                f"measured for {settle.timeout_s:g} s. factors.{factor.name}.band = {within:g} waits for the latter"
            )


def unread(plan: Plan) -> Iterator[str]:
    """A sentence for each temperature of whole plots of which nothing says that it has arrived."""
    for factor in plan.run_list.factors:
        setter = plan.bench.setters.get(factor.name, "")
        if factor.hard and unit_of(factor.name) == TEMPERATURE_UNIT and not is_read(plan.bench, factor.name):
            yield (
                f"{factor.name}: nothing reads how far it has come. A whole plot begins after soak.dwell_s alone, and "
                f"what was commanded is recorded; state `read` of instruments.{setter}, or a thermometer in "
                f"[temperatures]"
            )


def own_readings(plan: Plan) -> Iterator[str]:
    """A sentence for each temperature of whole plots that only the instrument reads which sets it."""
    bench = plan.bench
    for factor in plan.run_list.factors:
        setter = bench.setters.get(factor.name, "")
        alone = factor.name not in bench.references and not bench.thermometers(factor.name)
        reads = setter in (*playing(bench, Chamber), *playing(bench, Source)) and is_read(bench, factor.name)
        if factor.hard and unit_of(factor.name) == TEMPERATURE_UNIT and alone and reads:
            yield f"{factor.name}: no other thermometer reads it; {setter}'s own reading is used"


def _time_constant(plan: Plan, factor: Factor, own: float | None) -> tuple[float, str] | None:
    """Seconds with which what is measured follows a factor, and who states it; None if nobody does."""
    name, bench = factor.name, plan.bench
    setter = bench.setters.get(name, "")
    found: list[tuple[float, str]] = []
    if setter in playing(bench, Source):
        stated = _table(plan.truth, "sources", name).get("time_constant_s")
        found = (
            [(stated, f"sources.{name} of the world")] if stated else [(own, f"instruments.{setter}")] if own else []
        )
    elif setter in playing(bench, Chamber):
        table = f"{stem_of(name).removesuffix('_temperature')}_chamber"
        stated = _table(plan.truth, table).get("body_time_constant_s")
        found = [(stated, f"{table} of the world")] if stated else []
    thermometers = ((bench.temperatures[one].follows_s, f"temperatures.{one}") for one in bench.thermometers(name))
    found += [(seconds, of) for seconds, of in thermometers if seconds]
    comes = setter in (*playing(bench, Chamber), *playing(bench, Source))
    if not found and factor.hard and unit_of(name) == TEMPERATURE_UNIT and comes:
        found = [(FOLLOWS_S, "what is in the chamber, which is assumed")]  # as the forecast assumes it
    return max(found, default=None)


def _table(truth: Mapping[str, Any], *keys: str) -> Mapping[str, Any]:
    for key in keys:
        truth = truth.get(key, {})
    return truth


def _criterion(plan: Plan, factor: Factor, options: Any, tau: float, step: float) -> tuple[str, Settle, float]:
    """Key of the dwell, the criterion, and what may be left of a step when its dwell begins.

    A reading of its own shows the approach; a setpoint that is read back does not.
    """
    conduct = plan.procedure.conduct
    if conduct.whole_plots is not None and factor.hard and unit_of(factor.name) == TEMPERATURE_UNIT:
        soak = conduct.whole_plots.soak
        seen = bool(plan.bench.thermometers(factor.name))
        band = soak.sensor_tolerance_degC if seen else soak.tolerance_degC
        settle = Settle(band, soak.dwell_s, soak.drift_degC_per_h / 3600.0, soak.timeout_s)
        # A chamber's own display settles long before what is in it: nobody sees how far that has come. A source that
        # reads back reads what its own time constant is about.
        setter = plan.bench.setters.get(factor.name, "")
        seen = seen or (setter in playing(plan.bench, Source) and getattr(options, "read", None) is not None)
        return "soak.dwell_s", settle, min(step, _inside(settle, tau)) if seen else step
    settle = conduct.settled(factor.axis)
    within, read = getattr(options, "tolerance", None), getattr(options, "read", True) is not None
    if getattr(options, "settled", None) is not None:
        return "settle.dwell_s", settle, min(step, settle.band)
    near = (step if within is None else min(step, within)) * exp(-getattr(options, "dwell_s", 0.0) / tau)
    return "settle.dwell_s", settle, min(near, _inside(settle, tau)) if read else near


def _inside(settle: Settle, tau: float) -> float:
    """The most that is left when a dwell begins that ends as settled: inside the band, with a mean slope that is
    allowed.
    """
    gone = -np.expm1(-settle.dwell_s / tau)
    return min(settle.band, settle.drift_per_s * settle.dwell_s / gone) if gone > 0.0 else settle.band


def _effects(plan: Plan, factor: str, left: float) -> Iterator[tuple[str, float, float, float, str]]:
    """Name of every expected output, its largest change by what is left, scatter, the part that is allowed, unit."""
    expect = getattr(plan.procedure, "expect", None)
    sigmas, columns = (
        getattr(expect, "sigma", {}),
        {one.name: np.array(plan.run_list.column(one.name), np.float64) for one in plan.run_list.factors},
    )
    for name, text in getattr(expect, "output", {}).items():
        sensor = plan.bench.sensors.get(name)
        if sensor is None or name not in sigmas:
            continue
        try:
            output = parse_expression(text)
        except FitError:
            continue  # which the promised totals say
        if not {*output.names} <= {*columns}:
            continue
        with np.errstate(all="ignore"):
            moved = output.value({**columns, factor: columns[factor] + left}) - output.value(columns)
        size, sigma = float(np.nanmax(np.abs(moved))), sigmas[name]
        if size:
            yield name, size, sigma, _ERRORS * sigma / sqrt(len(plan.run_list)) / size, spelled(sensor.unit)
