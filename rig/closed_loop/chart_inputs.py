"""What a control chart is made of: run files, calibration files and CSV tables, each with its date."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from fitter.history import Calibrated, calibrated
from fitter.history.stored import calibrated_from
from fitter.inverse import CurveCalibration
from fitter.inverse.calibrate import OFFSET, SENSITIVITY
from fitter.pressure import PressureFit
from rig.closed_loop.attitude import with_temperature
from rig.closed_loop.whole_plot import fit_whole_plots
from rig.errors import UsageError
from rig.inference import read_calibration
from rig.regular import read_regular_text
from rig.report.words import incomplete
from rig.tables import Table, attitude_data, read_table
from rig.tables.unused import Unused, sentences, unused_in_fit

_EARLIEST, _LATEST = 1900, 2200
"""Years between which a calibration may be dated; others are slips of the finger."""
_TURNED_DEG = 45.0
"""Between the sensitive axes of one sensor: no misalignment is as large, a remounted or exchanged sensor is."""
_ALIKE_DEGC = 0.5
"""Between the mean temperatures of calibrations: at 50 ppm a degC, 25 ppm."""


Sensor = Calibrated | PressureFit | CurveCalibration


@dataclass(frozen=True, eq=False)
class Given:
    """One calibration.

    Attributes:
        source: the file as it was named.
        kind: "pitch-roll", "whole-plot" or "general".
        when: middle of the calibration, UTC.
        sensors: by output column.
        effects: names of the effects fitted beside the model, by output column.
        simulated: from a simulated run.
        provenance: what is known of it.
        degC: mean sensor temperature, None where it was not recorded.
        unused: columns that play no part.

    """

    source: str
    kind: str
    when: datetime
    sensors: Mapping[str, Sensor]
    effects: Mapping[str, tuple[str, ...]]
    simulated: bool
    provenance: Mapping[str, Any]
    degC: float | None
    unused: Unused = field(default_factory=Unused)

    @property
    def corrected(self) -> bool:
        """Whether the parameters can be stated at any temperature."""
        return all(isinstance(s, Calibrated) and s.warmth is not None for s in self.sensors.values())

    @property
    def date(self) -> str:
        """Of the calibration, as 2026-01-15."""
        return f"{self.when:%Y-%m-%d}"


def read_all(sources: Sequence[str], formula: str | None = None) -> list[Given]:
    """Every calibration, in order of time.

    Args:
        sources: files; those that do not say when they were measured as FILE@2026-01-15 or FILE@2026-01-15T18:00.
        formula: whole plots: the model, a name or a formula; the full second order if None.

    Raises:
        UsageError: a file cannot be used, there are fewer than two, one is there twice, or calibrations of two kinds,
            or real and simulated ones, are mixed.

    """
    if len(sources) < 2:
        raise UsageError(
            "a chart needs at least two calibrations (three for a trend and a due date, four for a step); name more "
            "run files, calibration files or tables"
        )
    given = sorted((read(source, formula) for source in sources), key=lambda one: one.when)
    _check_once(given)
    for one in given[1:]:
        if one.kind != given[0].kind:
            raise UsageError(
                f"{given[0].source} is a {given[0].kind} calibration and {one.source} a {one.kind} one: they do not "
                f"belong on one chart"
            )
    simulated = [one for one in given if one.simulated]
    if simulated and len(simulated) < len(given):
        real = next(one for one in given if not one.simulated)
        raise UsageError(
            f"{simulated[0].source} is simulated and {real.source} is not: they do not belong on one chart; leave one "
            f"kind out"
        )
    return _at_one_temperature(given)


def _at_one_temperature(given: list[Given]) -> list[Given]:
    """Where every calibration's declared model has temperature, all at the mean of what they were taken at."""
    degC = [one.degC for one in given if one.degC is not None and one.corrected]
    if len(degC) < len(given):
        return given
    common = float(np.mean(degC))
    return [
        replace(
            one,
            sensors={name: s.at(common) if isinstance(s, Calibrated) else s for name, s in one.sensors.items()},
        )
        for one in given
    ]


def read(source: str, formula: str | None = None) -> Given:
    """One calibration, from a run file, a calibration file or a CSV table. Raises `UsageError` or `RunFileError`."""
    path, told = _path_and_date(source)
    if path.suffix == ".json":
        return _from_calibration_file(path, told)
    table = read_table(path)
    if formula is not None and table.kind == "pitch-roll":
        raise UsageError(
            f"{path} holds a pitch-roll calibration, whose model is its geometry; --formula is for whole plots"
        )
    if table.kind == "other":
        raise UsageError(
            f"{path} is no table of attitude sensors or pressure transducers. Make a calibration of any other table "
            f"first, rig fit {path} --response Y --formula '1 + X' --out C.json, and chart C.json@DATE"
        )
    try:
        sensors = _attitude(table) if table.kind == "pitch-roll" else fit_whole_plots(table, formula).fits
    except ValueError as error:
        raise UsageError(f"{path}: {error}") from error
    degC = table.columns.get("sensor_temperature_degC") if table.kind == "pitch-roll" else None
    warm = table.kind == "pitch-roll" and with_temperature(table, None)
    return Given(
        source=str(path),
        kind=table.kind,
        when=_when(path, table.provenance, told),
        sensors=sensors,
        effects=dict.fromkeys(sensors, (OFFSET, SENSITIVITY) if warm else ()),
        simulated=table.simulated,
        provenance=table.provenance,
        degC=None if degC is None else float(np.mean(degC)),
        unused=unused_in_fit(table),
    )


def _attitude(table: Table) -> dict[str, Calibrated]:
    data = attitude_data(table)
    return {name: calibrated(data, name, temperature=with_temperature(table, None)) for name in data.sensors}


def notes(given: Sequence[Given]) -> list[str]:
    """What changed between calibrations besides the sensors, and what they lack: a step may be due to that."""
    found = _temperature_words(given)
    for one in given:
        missing = incomplete(one.provenance)
        if missing:
            found.append(f"the calibration of {one.date} is incomplete: {missing}")
        found.extend(f"{one.source}: {text}" for text in sentences(one.unused.to_json()))
    for before, after in pairwise(given):
        between = f"between {before.date} and {after.date}"
        changes = _changes(before.provenance, after.provenance)
        found.extend(f"{between} {what}: a step there may be due to that" for what in changes)
    degC = [one.degC for one in given if one.degC is not None]
    if degC and max(degC) - min(degC) > _ALIKE_DEGC and not all(one.corrected for one in given):
        found.append(
            f"the sensors' mean temperature lay between {min(degC):.1f} and {max(degC):.1f} degC: a temperature "
            f"coefficient looks like a change over time"
        )
    return found


def _temperature_words(given: Sequence[Given]) -> list[str]:
    """At which sensor temperature the charted parameters hold."""
    known = [one.degC for one in given if one.degC is not None]
    if given[0].kind != "pitch-roll":
        return []
    if all(one.corrected for one in given) and len(known) == len(given):
        return [f"parameters are charted at {np.mean(known):.2f} degC, to which every calibration was brought"]
    if not known:
        return ["at which sensor temperature the charted parameters hold was not recorded"]
    return ["charted parameters hold at each calibration's own mean sensor temperature"]


def as_table(given: Sequence[Given], title: str) -> Table:
    """The calibrations as a table of their dates, with the provenance of all, for the report's frame."""
    days = np.array([one.when.timestamp() / 86400.0 for one in given])
    provenance = {f"{one.date}: {one.source}": _origin(one) for one in given}
    return Table(title, {"day": days - days[0]}, given[0].simulated, provenance)


def _origin(one: Given) -> str:
    p = one.provenance
    told = [f"{name} {p[name]}" for name in ("run_id", "bench", "procedure", "head") if p.get(name)]
    return "; ".join([*told, *(f"{name}: {words}" for name, words in (p.get("instruments") or {}).items())]) or "table"


def _changes(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """What is another instrument, bench or procedure; an instrument's next calibration date is no other instrument."""
    found = [
        f"the {name} changed from {before[name]} to {after[name]}"
        for name in ("bench", "procedure")
        if before.get(name) and after.get(name) and before[name] != after[name]
    ]
    old, new = before.get("instruments") or {}, after.get("instruments") or {}
    for name in (n for n in new if n in old):
        was, now = (words.partition(", calibration due")[0] for words in (old[name], new[name]))
        if was != now:
            found.append(f"the {name} changed from {was} to {now}")
    return found


def _from_calibration_file(path: Path, told: datetime | None) -> Given:
    """What `rig fit --out` wrote."""
    file = read_calibration(path)
    if isinstance(file.calibration, CurveCalibration):
        return _from_curve(path, told, file.calibration, simulated=file.simulated)
    content = json.loads(read_regular_text(path))
    data = content["data"]
    if data["kind"] != "pitch-roll":
        raise UsageError(
            f"{path} does not keep all that charting whole plots needs; give the run file or table instead"
        )
    try:
        sensors = calibrated_from(content)
        effects = {s["name"]: tuple(t["effect"] for t in s["terms"]) for s in content["calibration"]["sensors"]}
        degC, simulated = content["calibration"]["reference_degC"], bool(data["simulated"])
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
        raise UsageError(f"{path}: {error}; give the run file instead") from error
    return Given(
        source=str(path),
        kind="pitch-roll",
        when=_when(path, data, told),
        sensors=sensors,
        effects=effects,
        simulated=simulated,
        provenance=data,
        degC=degC,
    )


def _from_curve(path: Path, told: datetime | None, calibration: CurveCalibration, *, simulated: bool) -> Given:
    """A calibration of a table of any kind, which has no date of its own."""
    return Given(
        source=str(path),
        kind="general",
        when=_when(path, {}, told),
        sensors={calibration.response: calibration},
        effects={calibration.response: ()},
        simulated=simulated,
        provenance={"file": path.name},
        degC=None,
    )


def path_of(source: str) -> Path:
    """The file of FILE@2026-01-15, or of FILE."""
    path = Path(source)
    return path if path.exists() or "@" not in source else Path(source.rpartition("@")[0])


def _path_and_date(source: str) -> tuple[Path, datetime | None]:
    path = path_of(source)
    if str(path) == str(Path(source)):
        return path, None
    date = source.rpartition("@")[2]
    told = _moment(date)
    if told is None:
        raise UsageError(f"{source}: {date!r} is no date; write FILE@2026-01-15 or FILE@2026-01-15T18:00")
    return path, told


def _moment(text: object) -> datetime | None:
    """A moment of this age in UTC, which is meant where no zone is told; None for anything else."""
    try:
        moment = datetime.fromisoformat(str(text))
        moment = moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)
    except (ValueError, OverflowError):
        return None
    return moment if _EARLIEST <= moment.year <= _LATEST else None


def _when(path: Path, provenance: Mapping[str, Any], told: datetime | None) -> datetime:
    began = provenance.get("began_utc")
    if began is None:
        if told is None:
            raise UsageError(f"{path} does not say when it was measured: write {path}@2026-01-15")
        return told
    if told is not None:
        raise UsageError(f"{path} says itself when it was measured, {began}: leave @ and the date away")
    first, last = _moment(began), _moment(provenance.get("last_observation_utc", began))
    if first is None or last is None:
        raise UsageError(f"{path} does not say when it was measured: {began!r} is no date")
    return first + (last - first) / 2


def _check_another(name: str, before: Given, after: Given) -> None:
    """A calibration is another one of the same sensor: not the same data again, nor a sensor that was turned."""
    old, new = before.sensors[name], after.sensors[name]
    if isinstance(old, CurveCalibration) and isinstance(new, CurveCalibration):
        if np.array_equal(old.coefficients, new.coefficients):
            raise UsageError(f"{before.source} and {after.source} are of the same data: leave one of them out")
        return
    if not (isinstance(old, Calibrated) and isinstance(new, Calibrated)):
        return
    if old.coefficients.shape != new.coefficients.shape:
        return
    if np.array_equal(old.coefficients, new.coefficients):
        raise UsageError(
            f"{before.source} and {after.source} are of the same data: {name} has the same coefficients to the last "
            f"digit; leave one of them out"
        )
    a, b = old.coefficients[1:], new.coefficients[1:]
    turned = np.degrees(np.arccos(np.clip(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)), -1.0, 1.0)))
    if turned > _TURNED_DEG:
        raise UsageError(
            f"{name}: its sensitive axis was turned by {turned:.0f} deg between {before.source} and {after.source}: it "
            f"was mounted otherwise, or is another sensor; chart them apart"
        )


def _check_once(given: Sequence[Given]) -> None:
    runs: dict[str, str] = {}
    for one in given:
        run = one.provenance.get("run_id")
        if run is not None and run in runs:
            raise UsageError(f"{runs[run]} and {one.source} are the same run, {run}: leave one of them out")
        if run is not None:
            runs[run] = one.source
    for before, after in pairwise(given):
        for name in before.sensors.keys() & after.sensors.keys():
            _check_another(name, before, after)
        if after.when == before.when:
            raise UsageError(
                f"{before.source} and {after.source} are of the same time, {after.when:%Y-%m-%d %H:%M}: one sensor is "
                f"not calibrated twice at once (dry runs begin at the `epoch` of their world file)"
            )


def check_alike(name: str, given: Sequence[Given]) -> None:
    """Refuse calibrations of one sensor by different models. Raises `UsageError`."""
    first = given[0]
    for one in given[1:]:
        models = [_model(each.sensors[name]) for each in (first, one)]
        if models[0] != models[1]:
            raise UsageError(
                f"{name} is {models[0]} in {first.source} and {models[1]} in {one.source}: only calibrations of one "
                f"model can be charted together"
            )
        effects = [", ".join(dict.fromkeys(each.effects[name])) or "none" for each in (first, one)]
        if effects[0] != effects[1]:
            raise UsageError(
                f"{name} was fitted with effects beside the model in one calibration and not in the other "
                f"({first.source}: {effects[0]}; {one.source}: {effects[1]}): fit all of them alike"
            )


def _model(sensor: Sensor) -> str:
    return sensor.model if isinstance(sensor, Calibrated) else str(sensor.formula)
