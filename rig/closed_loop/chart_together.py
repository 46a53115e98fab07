"""Which calibrations belong on one chart: the others are left out, with the reason."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from procedures.attitude.history import Calibrated
from procedures.general.infer.curve import CurveCalibration
from rig.closed_loop.chart_inputs import Given, Sensor, path_of, read
from rig.errors import UsageError

_TURNED_DEG = 45.0
"""Between the sensitive axes of one sensor: no misalignment is as large, a remounted or exchanged sensor is."""


@dataclass(frozen=True)
class LeftOut:
    """A file that is not charted.

    Attributes:
        source: as it was named.
        reason: why.

    """

    source: str
    reason: str


def read_all(sources: Sequence[str], formula: str | None = None) -> list[Given]:
    """Every calibration that can be charted, in order of time; see `read_together`."""
    return read_together(sources, formula)[0]


def read_together(
    sources: Sequence[str], formula: str | None = None, sensors: Sequence[str] = ()
) -> tuple[list[Given], list[LeftOut]]:
    """The calibrations that can be charted together, in order of time, and the others.

    Run files that cannot be fitted are left out, and so is what cannot be compared with the most others: another
    kind of calibration, another model, a simulated one beside real ones, a sensor that is mounted otherwise.

    Args:
        sources: files; those that do not say when they were measured as FILE@2026-01-15 or FILE@2026-01-15T18:00.
        formula: whole plots: the model, a name or a formula; the full second order if None.
        sensors: that are charted; none for all.

    Raises:
        UsageError: a file cannot be used, fewer than two remain, or one is there twice.

    """
    if len(sources) < 2:
        raise UsageError(
            "a chart needs at least two calibrations (three for a trend and a due date, four for a step); name more "
            "run files, calibration files or tables"
        )
    given, left = [], []
    for source in sources:
        try:
            given.append(read(source, formula))
        except UsageError as error:
            if path_of(source).suffix != ".sqlite" or not path_of(source).is_file() or "@" in source:
                raise
            left.append(LeftOut(source, str(error)))
    given, others = _most_alike(sorted(given, key=lambda one: one.when), sensors)
    left += others
    if len(given) < 2:
        reasons = [one.reason for one in left]
        few = "" if len(reasons) == 1 else "fewer than two calibrations are left to be charted together: "
        raise UsageError(few + "; ".join(reasons))
    _check_once(given)
    return _at_one_temperature(given), left


def _most_alike(given: list[Given], sensors: Sequence[str]) -> tuple[list[Given], list[LeftOut]]:
    """The calibrations that can be compared with the one that most can be; of as many, real ones, then the latest."""
    if not given:
        return [], []
    why = [[_why_not(one, other, sensors) for other in given] for one in given]
    counts = [(sum(not reason for reason in row), not one.simulated) for row, one in zip(why, given, strict=True)]
    best = max(range(len(given)), key=lambda i: (*counts[i], i))
    left = [LeftOut(one.source, reason) for one, reason in zip(given, why[best], strict=True) if reason]
    return [one for one, reason in zip(given, why[best], strict=True) if not reason], left


def _why_not(one: Given, other: Given, sensors: Sequence[str]) -> str:
    """Why `other` cannot be charted with `one`; "" if it can."""
    if one is other:
        return ""
    first, later = sorted((one, other), key=lambda each: each.when)
    if first.kind != later.kind:
        return (
            f"{first.source} is a {first.kind} calibration and {later.source} a {later.kind} one: they do not belong "
            f"on one chart"
        )
    if first.simulated != later.simulated:
        simulated, real = (first, later) if first.simulated else (later, first)
        return (
            f"{simulated.source} is simulated and {real.source} is not: they do not belong on one chart; leave one "
            f"kind out"
        )
    wanted = [name for name in sensors if name in one.sensors]
    if missing := [name for name in wanted if name not in other.sensors]:
        return f"{other.source} has no sensor {missing[0]}; it has {', '.join(other.sensors)}"
    common = wanted or [name for name in one.sensors if name in other.sensors]
    if not common:
        return f"no sensor is in both {first.source} ({', '.join(first.sensors)}) and {later.source}"
    return next((reason for name in common for reason in _differ(name, first, later)), "")


def _differ(name: str, first: Given, later: Given) -> Iterator[str]:
    """Why two calibrations of one sensor cannot be compared."""
    models = [_model(each.sensors[name]) for each in (first, later)]
    if models[0] != models[1]:
        yield (
            f"{name} is {models[0]} in {first.source} and {models[1]} in {later.source}: only calibrations of one "
            f"model can be charted together"
        )
        return
    effects = [", ".join(dict.fromkeys(each.effects[name])) or "none" for each in (first, later)]
    if effects[0] != effects[1]:
        yield (
            f"{name} was fitted with effects beside the model in one calibration and not in the other "
            f"({first.source}: {effects[0]}; {later.source}: {effects[1]}): fit all of them alike"
        )
    old, new = first.sensors[name], later.sensors[name]
    if not (isinstance(old, Calibrated) and isinstance(new, Calibrated)):
        return
    a, b = old.coefficients[1:], new.coefficients[1:]
    turned = np.degrees(np.arccos(np.clip(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)), -1.0, 1.0)))
    if turned > _TURNED_DEG:
        yield (
            f"{name}: its sensitive axis was turned by {turned:.0f} deg between {first.source} and {later.source}: it "
            f"was mounted otherwise, or is another sensor; chart them apart"
        )


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
            _check_new(name, before, after)
        if after.when == before.when:
            raise UsageError(
                f"{before.source} and {after.source} are of the same time, {after.when:%Y-%m-%d %H:%M}: one sensor is "
                f"not calibrated twice at once (dry runs begin at the `epoch` of their world file)"
            )


def _check_new(name: str, before: Given, after: Given) -> None:
    """A calibration is another one, not the same data again."""
    old, new = before.sensors[name], after.sensors[name]
    known = Calibrated, CurveCalibration
    if isinstance(old, known) and isinstance(new, known) and np.array_equal(old.coefficients, new.coefficients):
        raise UsageError(
            f"{before.source} and {after.source} are of the same data: {name} has the same coefficients to the last "
            f"digit; leave one of them out"
        )


def _model(sensor: Sensor) -> str:
    return sensor.model if isinstance(sensor, Calibrated) else str(sensor.formula)
