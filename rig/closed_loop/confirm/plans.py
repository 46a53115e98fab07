"""A further run as it is expected to go, and as a plan that can be carried out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fitter.confirm.compare import CARRIED_ON
from fitter.confirm.together import Together
from procedures.attitude.data import AttitudeData
from procedures.attitude.evaluate import AttitudeTraced
from procedures.attitude.model import mounting_matrix
from procedures.attitude.settings import PitchRollProcedure
from procedures.further_runs import Variation
from procedures.kind import Procedure
from procedures.pressure.data import WholePlotData
from procedures.run_list import RunList
from rig.closed_loop.confirm.first import First
from rig.config import parse_toml
from rig.plans import Plan, plan_of
from rig.toml_text import toml_text

PACKAGE_S = 1200.0
"""Time constant with which a package follows its enclosure: a run begins before the last of a change is through."""
TRAVEL_S_PER_DEG = 0.2
"""What a longer way between points costs; a head at 5 deg/s."""

Array = np.ndarray[Any, np.dtype[np.float64]]


GOES_ON = 0.0, 0.5, 1.0
"""How much of the first run's trend in temperature may go on until the further run: nobody knows the next night."""


def planned(first: First, variation: Variation, run_list: RunList) -> AttitudeData | WholePlotData:
    """A run as it is expected to go; its outputs are zero and mean nothing."""
    if isinstance(first.traced, AttitudeTraced):
        return _planned_attitude(first.traced.data, variation, run_list)
    return _planned_whole_plots(first.traced.data, run_list)


def ways(first: First, variation: Variation, run_list: RunList) -> list[Together]:
    """The first run and the further one, in the ways that may go: with temperatures that come back, or go on falling.

    One way where no explanation that is open is of time or temperature.
    """
    later = planned(first, variation, run_list)
    both = [first.beside(later, first.later_s)]
    sources = {member.terms[0].effect.source for question in first.questions for member in question.members}
    if isinstance(later, AttitudeData) and later.sensor_temperature_degC is not None and sources & {*CARRIED_ON}:
        trend = _trend(first.traced.data) * first.later_s
        for share in GOES_ON[1:]:
            degC = later.sensor_temperature_degC + share * trend
            both.append(first.beside(replace(later, sensor_temperature_degC=degC), first.later_s))
    return both


def _trend(data: AttitudeData | WholePlotData) -> float:
    """Of the temperature through a run, degC/s."""
    assert isinstance(data, AttitudeData)
    if data.temperatures is None:
        return 0.0
    elapsed, degC = data.temperatures
    return float(np.polyfit(elapsed - elapsed.mean(), degC, 1)[0]) if np.ptp(elapsed) > 0 else 0.0


def hours(first: First, variation: Variation, run_list: RunList) -> float:
    """Bench time of a run, by what the first one took."""
    data = first.traced.data
    if isinstance(data, AttitudeData):
        procedure = variation.procedure
        assert isinstance(procedure, PitchRollProcedure)
        soak = procedure.environment.dwell_s if procedure.environment is not None else 0.0
        return (len(run_list) * _point_s(data, run_list) + soak) / 3600.0
    reading, soak = _whole_plot_s(data)
    return (len(run_list) * reading + run_list.whole_plots * soak) / 3600.0


def _planned_attitude(data: AttitudeData, variation: Variation, run_list: RunList) -> AttitudeData:
    assert isinstance(variation.procedure, PitchRollProcedure)
    n = len(run_list)
    pitch, roll = _column(run_list, "pitch_deg"), _column(run_list, "roll_deg")
    elapsed = np.arange(1.0, n + 1.0) * _point_s(data, run_list) + float(data.elapsed_s.min())
    degC = None
    if data.temperatures is not None:
        enclosure = variation.procedure.environment
        soaked = np.inf if enclosure is None else enclosure.dwell_s
        late = np.exp(-(soaked + elapsed - float(data.elapsed_s.min())) / PACKAGE_S)
        degC = np.interp(elapsed, *data.temperatures) + variation.warmer_degC * (1.0 - late)
    turn = variation.procedure.mounting
    sides = np.array([p.sides for p in run_list.points])
    at = [f.name for f in run_list.factors]
    return AttitudeData(
        replicate=np.array([p.replication for p in run_list.points]),
        order=np.arange(n),
        elapsed_s=elapsed,
        pitch_deg=pitch,
        roll_deg=roll,
        sensor_temperature_degC=degC,
        outputs={name: np.zeros(n) for name in data.sensors},
        pitch_side=sides[:, at.index("pitch_deg")],
        roll_side=sides[:, at.index("roll_deg")],
        mounting=np.broadcast_to(mounting_matrix(turn.x_deg, turn.y_deg, turn.z_deg), (n, 3, 3))
        if turn.turned
        else None,
    )


def _planned_whole_plots(data: WholePlotData, run_list: RunList) -> WholePlotData:
    reading, soak = _whole_plot_s(data)
    plots = np.array([p.whole_plot for p in run_list.points])
    n = len(run_list)
    elapsed = soak * np.unique(plots, return_inverse=True)[1] + reading * np.arange(1.0, n + 1.0)
    return WholePlotData(
        whole_plot=plots,
        order=np.arange(n),
        elapsed_s=elapsed + float(data.elapsed_s.min()),
        pressure_psia=_column(run_list, "pressure_psia"),
        sensor_temperature_degC=_column(run_list, "sensor_temperature_degC"),
        sse_temperature_degC=_column(run_list, "sse_temperature_degC"),
        outputs={name: np.zeros(n) for name in data.transducers},
        replicate=np.array([p.replication for p in run_list.points]),
    )


def _column(run_list: RunList, factor: str) -> Array:
    at = [f.name for f in run_list.factors].index(factor)
    return np.array([p.setpoints[at] for p in run_list.points])


def _point_s(data: AttitudeData, run_list: RunList) -> float:
    """Seconds a point will take: as in the first run, and what the way is longer."""
    executed = np.argsort(data.order)
    seconds = float(np.median(np.diff(data.elapsed_s[executed])))
    usual = _travel(np.column_stack([data.pitch_deg, data.roll_deg])[executed])
    return seconds + TRAVEL_S_PER_DEG * max(_travel(np.array([p.setpoints for p in run_list.points])) - usual, 0.0)


def _travel(angles: Array) -> float:
    """Mean way between points of the axis that has further to go, degrees."""
    return float(np.mean(np.max(np.abs(np.diff(angles, axis=0)), axis=1))) if len(angles) > 1 else 0.0


def _whole_plot_s(data: WholePlotData) -> tuple[float, float]:
    """Seconds between readings of one whole plot, and what a new one takes beside."""
    executed = np.argsort(data.order)
    steps = np.diff(data.elapsed_s[executed])
    new = np.diff(data.whole_plot_index[executed]) != 0
    reading = float(np.median(steps[~new])) if np.any(~new) else 0.0
    return reading, max(float(np.median(steps[new])) - reading, 0.0) if np.any(new) else 0.0


def procedure_text(procedure: Procedure) -> str:
    """A procedure as its file."""
    values = procedure.model_dump(mode="json", exclude_none=True)
    design = procedure.design.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    return toml_text(values | {"design": design})  # a type of design refuses what another type needs


def plan_for(
    first: First, variation: Variation, *, dry: bool, bench: str | None = None, world: str | None = None
) -> Plan:
    """The plan of a further run on the first run's bench, or on another file of the same bench; texts of files."""
    documents = dict(first.documents) | {"procedure.toml": procedure_text(variation.procedure)}
    documents |= {name: text for name, text in (("bench.toml", bench), ("world.toml", world)) if text is not None}
    if not dry:
        documents.pop("world.toml", None)
    if dry and variation.by_weather:
        truth = parse_toml(documents.get("world.toml", ""), "world.toml")
        documents["world.toml"] = toml_text(_warmer(truth, variation.warmer_degC))
    return plan_of(documents, dry=dry)


def _warmer(truth: Mapping[str, Any], by: float) -> dict[str, Any]:
    """The world on a night when it is warmer, in the laboratory and around the package."""
    lab, enclosure = dict(truth.get("lab", {})), dict(truth.get("enclosure", {}))
    lab["mean_degC"] = lab.get("mean_degC", 21.5) + by
    enclosure["start_setpoint_degC"] = enclosure.get("start_setpoint_degC", 23.0) + by
    return {**truth, "lab": lab, "enclosure": enclosure}
