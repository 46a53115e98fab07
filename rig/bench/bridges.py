"""Bridges in a bench file: `driver = "pymeasure:keithley.Keithley2400"`, with keys of an instrument's file beside it.

Such a table becomes the text of an instrument's file, which stands in place of the driver's name, as that of
`driver = "./my_bath.toml"` does.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from rig.contracts.declared.bridges import bridged, is_bridge
from rig.errors import ConfigurationError

_OWN = ("address", "asset", "due", "serial", "coarse")


def with_bridges(values: Mapping[str, Any], where: str) -> Mapping[str, Any]:
    """A bench file, in which the driver of a bridge is the text of its file, at the address that its name says.

    Raises:
        ConfigurationError: the name of a bridge is wrong.
    """
    instruments = values.get("instruments")
    if not isinstance(instruments, Mapping) or not any(map(_of_bridge, instruments.values())):
        return values
    made = {}
    for name, one in instruments.items():
        try:
            made[name] = _with_bridge(one) if _of_bridge(one) else one
        except ValueError as error:
            raise ConfigurationError(f"{where}: instruments.{name}.driver: {error}") from None
    return {**values, "instruments": made}


def _of_bridge(given: Any) -> bool:
    return isinstance(given, Mapping) and isinstance(given.get("driver"), str) and is_bridge(given["driver"])


def _with_bridge(given: Mapping[str, Any]) -> Mapping[str, Any]:
    driver: str = given["driver"]
    from rig.contracts.declared.instrument import Instrument  # noqa: PLC0415 - few benches have one

    found = bridged(driver)
    keys = [key for key in given if key in Instrument.model_fields and key not in _OWN]
    table = {"bridge": driver, **{key: given[key] for key in keys}}
    own = {key: value for key, value in given.items() if key not in keys}
    own["driver"] = json.dumps(table, indent=1) + "\n"
    return own if own.get("address") else {**own, "address": found.address}
