"""Doubts about the units of a plan, before it is run: units that nobody knows, and outputs that cannot be in theirs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from rig.errors import UsageError
from rig.fitter.errors import FitError
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.errors import DataError
from rig.procedures.kinds import kind_of
from rig.units.of_instruments import VOLT, per_volt, scale
from rig.units.si import si_unit

if TYPE_CHECKING:
    from rig.runs.plans import Plan

_OTHERS = (
    "Nm", "degC", "degF", "psi", "psid", "pct", "percent", "rpm", "RH", "rh", "count", "counts",
    "digit", "digits", "ue", "dB", "dBm", "pH", "t", "lb", "ft", "inch", "Torr", "VA", "var", "eV", "Ah", "Wh", "ppb",
    "Gal", "cP",
)  # fmt: skip
"""Units beside those of the Digital SI."""
_USUAL = ("Nm", "kNm", "kN", "mN", "V", "mV", "uV", "mA", "A", "degC", "K", "deg", "kPa", "hPa", "Pa", "bar", "mbar",
          "psi", "mm", "um", "kg", "g", "ohm", "kohm", "Hz", "kHz", "W", "mV_per_V")  # fmt: skip
"""Units that a misspelt one may be meant for."""
_LEAST_OF_RANGE, _MOST_OF_RANGE = 1 / 500, 1.2


def unit_doubts(plan: Plan) -> Iterator[str]:
    """Sentences, each about one unit or one sensor."""
    names: dict[str, list[str]] = {}
    for factor in plan.run_list.factors:
        names.setdefault(unit_of(factor.name), []).append(factor.name)
    for name, sensor in plan.bench.sensors.items():
        names.setdefault(sensor.unit, []).append(f"sensors.{name}")
    for unit, users in names.items():
        if not _known(unit):
            near = [one for one in _USUAL if one.lower() == unit.lower()]
            meant = f"; {near[0]} is meant?" if near else ""
            of = ", ".join(users)
            yield f"{spelled(unit)} is no unit that this program knows ({of}): it is taken as a name{meant}"
        volts = per_volt(unit)
        if volts is not None and volts < 1e-3:
            yield f"{unit} ({', '.join(users)}) is {1 / volts:g} V; m{unit[1:]} is a thousandth of a volt"
    yield from _outputs(plan)


def _known(unit: str) -> bool:
    """Whether every part of a unit is known: `mV_per_V`, `m3_per_h`, `kNm`."""
    return all(_part_known(part) for part in unit.split("_per_"))


def _part_known(part: str) -> bool:
    if any(scale(part, one) is not None for one in _OTHERS):
        return True
    try:
        si_unit(part)
    except UsageError:
        return False
    return True


def _outputs(plan: Plan) -> Iterator[str]:
    """Expected outputs that are beyond the measuring range of their channel, or next to nothing in it."""
    sensors = {f"{name}_{sensor.unit}": sensor.axis or "" for name, sensor in plan.bench.sensors.items()}
    try:
        table = kind_of(plan.procedure).expected(plan.procedure, plan.run_list, sensors).table
    except (DataError, FitError):
        return  # nothing is expected, which is said elsewhere
    for name, sensor in plan.bench.sensors.items():
        values = table.columns.get(f"{name}_{sensor.unit}")
        if values is None:
            continue
        most = float(np.abs(values).max())
        for span, unit, least, greatest in _ranges(plan, sensor.reader, sensor.channel):
            per = scale(unit, sensor.unit)
            share = 1.0 if per is None else most / per / span
            if not least <= share <= greatest:
                own = spelled(sensor.unit)
                yield (
                    f"{name}: its expected output goes to {most:.3g} {own}, {100 * share:.2g} % of the range of "
                    f"{sensor.reader}, {span:g} {spelled(unit)}: is it in {own}, the unit of sensors.{name}?"
                )


def _ranges(plan: Plan, reader: str, channel: str) -> Iterator[tuple[float, str, float, float]]:
    """Declared ranges of a channel: size, unit, and the smallest and largest part of it that an output should use."""
    options = plan.bench.instruments[reader].options
    ranges = options.get("ranges")
    found = ranges.get(channel) if isinstance(ranges, dict) else None
    found = options.get("range_V") if found is None else found
    if isinstance(found, int | float):
        yield float(found), VOLT, _LEAST_OF_RANGE, _MOST_OF_RANGE
    if isinstance(end := options.get("overload"), int | float):
        yield float(end), str(options.get("unit", VOLT)), 0.0, 1.0
