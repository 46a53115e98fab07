"""Plug-ins: installed objects by name, ours and those of other packages, from entry points.

Ours are in `pyproject.toml`, under `rig.drivers`, `rig.twins`, `rig.kinds` and `rig.effects`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from importlib.metadata import EntryPoint
from typing import TYPE_CHECKING, Any

from rig.errors import ConfigurationError
from rig.procedures.entry_points import entry_points

if TYPE_CHECKING:
    from rig.drivers.driver import DriverClass


def installed(group: str) -> list[str]:
    """Names of an entry-point group, sorted."""
    return sorted({point.name for point in entry_points(group)})


@cache
def driver_class(name: str) -> DriverClass:
    """The driver registered under `name`. Raises `ConfigurationError` with the known ones."""
    known = installed("rig.drivers")
    if name not in known:
        raise ConfigurationError(f"driver {name!r} is not known; installed: {', '.join(known)}")
    found: DriverClass = load("rig.drivers", name, ("Options", "wire", "contracts"))
    return found


def load(group: str, name: str, needs: Sequence[str]) -> Any:
    """The object named by an installed plug-in's entry point.

    Args:
        group: of entry points, such as "rig.drivers".
        name: one of `installed(group)`.
        needs: required attributes.

    Raises:
        ConfigurationError: two packages have one by this name, it cannot be loaded, or it lacks an attribute.
    """
    points = {point.value: point for point in entry_points(group) if point.name == name}
    what = f"the {group.removeprefix('rig.').removesuffix('s')} {name!r}"
    if len(points) > 1:
        raise ConfigurationError(f"{what} comes with {' and with '.join(map(_package, points.values()))}; keep one")
    (point,) = points.values()
    try:
        found = point.load()
    except (ImportError, AttributeError) as error:
        raise ConfigurationError(f"{what} of {_package(point)} cannot be loaded: {error}") from error
    if lacking := [need for need in needs if not hasattr(found, need)]:
        raise ConfigurationError(f"{what} of {_package(point)} lacks {', '.join(lacking)}")
    return found


def packages(group: str, names: Iterable[str]) -> dict[str, str]:
    """Versions of the packages of these plug-ins, by package; without our own."""
    wanted = set(names)
    found = (point.dist for point in entry_points(group) if point.name in wanted)
    return {dist.name: dist.version for dist in found if dist and dist.name != _OURS}


_OURS = "calibration-rig"


def _package(point: EntryPoint) -> str:
    return f"{point.dist.name} {point.dist.version}" if point.dist else point.module
