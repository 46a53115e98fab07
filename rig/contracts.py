"""Contract files (EDS, register maps) handed to both sides of a wire.

Drivers and twins may not import one another nor the contracts; the controller reads the file once and gives the
same text to both.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

_CONTRACTS = {
    "watlow-f4t": ("register_map", "watlow_f4t.toml"),
    "cia402-pair": ("eds", "cia402_drive.eds"),
    "can-daq": ("dbc", "can_daq.dbc"),
}
"""Driver name to (option that takes the text, file in `contracts/`)."""


@cache
def _text(name: str) -> str:
    return files("contracts").joinpath(name).read_text(encoding="utf-8")


def with_contracts(driver: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Options with the driver's contract filled in, unless the bench file gives its own."""
    if driver not in _CONTRACTS:
        return dict(options)
    option, name = _CONTRACTS[driver]
    return {option: _text(name), **options}
