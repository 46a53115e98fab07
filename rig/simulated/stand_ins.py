"""Stand-ins in dry runs for instruments whose drivers have no twin: tables, made of the bench file.

A reader has the channels that the bench reads, in their units. A source has the unit of its factor, and its limits. Its
lines are those of no instrument, which the run says.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, cast

from rig.bench.config import InstrumentConfig
from rig.bench.plugins import driver_class, installed, text_of
from rig.contracts.declared.instrument import STAND_IN, parse
from rig.drivers.roles import Reader, Source
from rig.errors import ConfigurationError
from rig.procedures.column_names import unit_of

if TYPE_CHECKING:
    from rig.bench.config import BenchConfig

_WIDE = (-1e6, 1e6)
"""Limits of a source for which the bench file has none."""


def lacks_twin(driver: str) -> bool:
    """Whether a driver is installed, and no twin for it: a bridge never has one."""
    if text := text_of(driver):
        return bool(parse(text).bridge)
    return driver in installed("rig.drivers") and driver not in installed("rig.twins")


def with_stand_ins(config: BenchConfig) -> BenchConfig:
    """The bench with a stand-in for each instrument without a twin.

    Raises:
        ConfigurationError: one is neither reader nor source.
    """
    lacking = [name for name, one in config.instruments.items() if lacks_twin(one.driver)]
    if not lacking:
        return config
    instruments = dict(config.instruments)
    for name in lacking:
        given = instruments[name].model_dump(include={"asset", "due", "serial", "coarse"})
        table = {"driver": _table(config, name), "address": "socket://stand-in:1", **given}
        if text := text_of(instruments[name].driver):
            table |= {"driver": _of_bridge(text), **instruments[name].options}
        instruments[name] = InstrumentConfig.model_validate(table)
    return config.model_copy(update={"instruments": instruments})


def _of_bridge(text: str) -> str:
    """The table of a bridge, as lines of text."""
    values = parse(text).model_dump(mode="json", by_alias=True, exclude_unset=True)
    reader = values.get("reader", {})
    for one in (reader, *reader.get("channels", {}).values()):
        if one.get("reading") and not one["reading"].get("answer"):
            one["reading"]["answer"] = ["{value:.9e}"]  # all readings in one form, so that a lost digit is noticed
    return json.dumps({**values, "bridge": "", "arguments": {}, "about": STAND_IN}, indent=1) + "\n"


def _table(config: BenchConfig, name: str) -> str:
    found: Any = driver_class(config.instruments[name].driver)
    cls, lines = cast(type, found), [f'maker = "{STAND_IN}"', f'model = "{name}"', f'about = "{STAND_IN}"']
    lines += ["[identity]", 'ask = "ID?"']
    reads, sets = issubclass(cls, Reader), issubclass(cls, Source)
    if not (reads or sets):
        driver = config.instruments[name].driver
        raise ConfigurationError(
            f"instruments.{name}: driver {driver!r} has no twin, and only readers and sources have stand-ins"
        )
    if reads:
        lines += ["[reader]", 'reading = "READ? {channel}"', "[reader.channels]"]
        lines += [f'{channel} = {{ unit = "{unit}" }}' for channel, unit in _channels(config, name).items()]
    if sets:
        factor = next((f for f, setter in config.setters.items() if setter == name), "level_V")
        low, high = config.limits.get(factor, _WIDE)
        lines += ["[source]", f'unit = "{unit_of(factor)}"', f"low = {low}", f"high = {high}"]
        lines += ['set = "SET {value:.9e}"', 'setpoint = "SET?"', 'read = "READ?"', "dwell_s = 1"]
        lines += ['on = "ON"', 'off = "OFF"', 'output = "ON?"', f"readback = {1e-6 * max(abs(low), abs(high), 1.0)}"]
    return "\n".join(lines) + "\n"


def _channels(config: BenchConfig, name: str) -> dict[str, str]:
    """Channels of a reader that the bench reads, with their units."""
    found = {one.channel: one.unit for one in config.sensors.values() if one.reader == name}
    for table in (config.temperatures, config.references):
        found |= {one.channel: unit_of(column) for column, one in table.items() if one.reader == name}
    return found or {"input": "V"}
