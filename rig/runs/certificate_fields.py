"""Fields that a certificate needs and that only the laboratory's settings have, whatever the run is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rig.bench.config import parse_toml, read_text

SETTINGS = "certificate.toml"
NEEDED: Mapping[str, tuple[str, str]] = {
    "country": ("the country of the laboratory", 'country = "GB" in {}'),
    "item": ("what the items are", 'item = "..." in {}'),
    "method.name": ("the calibration method", "method.name in {}"),
    "approved_by": ("who approves", "approved_by in {}, or --approved-by"),
}
"""By key: what it is, and where to add it."""


def lacking(values: Mapping[str, str], where: str) -> Iterator[str]:
    """Needed fields that are empty or not there, one sentence each.

    Args:
        values: by key.
        where: name of the settings.
    """
    for key, (what, add) in NEEDED.items():
        if not values.get(key, "").strip():
            yield f"{what} is missing: add {add.format(where)}"


def lacking_beside(bench: Path) -> tuple[str, ...]:
    """The same of the settings beside a bench file. Raises `ConfigurationError` if they cannot be read."""
    path = bench.parent / SETTINGS
    if not path.exists():
        fields = ", ".join(what for what, _ in NEEDED.values())
        return (f"there is no {SETTINGS} beside the bench file, which says {fields}",)
    given: dict[str, Any] = parse_toml(read_text(path, "certificate"), str(path))
    method = given.get("method")
    given["method.name"] = method.get("name", "") if isinstance(method, Mapping) else ""
    return tuple(lacking({key: str(given.get(key, "")) for key in NEEDED}, SETTINGS))
