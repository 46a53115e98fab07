"""Selection of calibrations for one chart: the others are left out, with reasons."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rig.errors import UsageError
from rig.procedures.errors import DataError
from rig.verbs.chart.inputs import Given, path_of, read


@dataclass(frozen=True)
class LeftOut:
    """A file that is not charted.

    Attributes:
        source: its name, as given.
        reason: the reason.
    """

    source: str
    reason: str


def read_together(
    sources: Sequence[str], formula: str | None = None, sensors: Sequence[str] = ()
) -> tuple[list[Given], list[LeftOut]]:
    """The calibrations that can be charted together, in order of time, and the others.

    Run files that cannot be fitted are left out. Calibrations that are not comparable with the majority are left out:
    another kind of calibration, another model, a simulated one beside real ones, a sensor with another mounting.

    Args:
        sources: files; those without a date of measurement as FILE@2026-01-15 or FILE@2026-01-15T18:00.
        formula: the requested model, for kinds that take one; the declared model if None.
        sensors: charted sensors; none for all.

    Raises:
        UsageError, DataError: a file cannot be used, fewer than two remain, or one is given twice.
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
        except (UsageError, DataError) as error:
            if path_of(source).suffix != ".sqlite" or not path_of(source).is_file() or "@" in source:
                raise
            left.append(LeftOut(source, str(error)))
    given, others = _most_alike(sorted(given, key=lambda one: one.when), sensors)
    left += others
    if len(given) < 2:
        reasons = [one.reason for one in left]
        few = "" if len(reasons) == 1 else "fewer than two calibrations remain for one chart: "
        raise UsageError(few + "; ".join(reasons))
    _check_once(given)
    return _at_one_temperature(given), left


def _most_alike(given: list[Given], sensors: Sequence[str]) -> tuple[list[Given], list[LeftOut]]:
    """The largest set of comparable calibrations; among equal sizes real ones, then the latest."""
    if not given:
        return [], []
    why = [[_why_not(one, other, sensors) for other in given] for one in given]
    counts = [(sum(not reason for reason in row), not one.of.simulated) for row, one in zip(why, given, strict=True)]
    best = max(range(len(given)), key=lambda i: (*counts[i], i))
    left = [LeftOut(one.source, reason) for one, reason in zip(given, why[best], strict=True) if reason]
    return [one for one, reason in zip(given, why[best], strict=True) if not reason], left


def _why_not(one: Given, other: Given, sensors: Sequence[str]) -> str:
    """Reason why `other` cannot be charted with `one`; "" if it can."""
    if one is other:
        return ""
    first, later = sorted((one, other), key=lambda each: each.when)
    if first.kind is not later.kind:
        return (
            f"{first.source} is a {first.kind.name} calibration and {later.source} a {later.kind.name} one: they "
            f"cannot be charted together"
        )
    if first.of.simulated != later.of.simulated:
        simulated, real = (first, later) if first.of.simulated else (later, first)
        return (
            f"{simulated.source} is simulated and {real.source} is not: they cannot be charted together; leave one "
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
    """Reason why two calibrations of one sensor cannot be compared."""
    models = [each.charting.model(each.sensors[name]) for each in (first, later)]
    if models[0] != models[1]:
        yield (
            f"{name} is {models[0]} in {first.source} and {models[1]} in {later.source}: only calibrations of one "
            f"model can be charted together"
        )
        return
    effects = [", ".join(dict.fromkeys(each.of.effects[name])) or "none" for each in (first, later)]
    if effects[0] != effects[1]:
        yield (
            f"{name} was fitted with effects beside the model in one calibration and not in the other "
            f"({first.source}: {effects[0]}; {later.source}: {effects[1]}): fit all of them with the same effects"
        )
    between = f"between {first.source} and {later.source}"
    if why := first.charting.apart(first.sensors[name], later.sensors[name], between):
        yield f"{name}: {why}"


def _at_one_temperature(given: list[Given]) -> list[Given]:
    """All calibrations converted to their mean temperature, if every model has temperature."""
    degC = [one.of.degC for one in given if one.of.degC is not None and one.of.corrected]
    if len(degC) < len(given):
        return given
    common = float(np.mean(degC))
    return [
        replace(one, of=replace(one.of, sensors={n: one.charting.at(s, common) for n, s in one.sensors.items()}))
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
        for name in before.sensors:
            if name in after.sensors:
                _check_new(name, before, after)
        if after.when == before.when:
            raise UsageError(
                f"{before.source} and {after.source} are of the same time, {after.when:%Y-%m-%d %H:%M}: one sensor is "
                f"not calibrated twice at once (dry runs begin at the `epoch` of their world file)"
            )


def _check_new(name: str, before: Given, after: Given) -> None:
    """Check that calibrations have different data."""
    if before.charting.same(before.sensors[name], after.sensors[name]):
        raise UsageError(
            f"{before.source} and {after.source} have the same data: {name} has the same coefficients to the last "
            f"digit; leave one of them out"
        )
