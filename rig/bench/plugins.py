"""Plug-ins: installed objects by name, ours and those of other packages, from entry points.

Ours are in `pyproject.toml`, under `rig.drivers`, `rig.twins`, `rig.instruments`, `rig.kinds` and `rig.effects`. An
entry point of `rig.instruments` names a package with files: each is an instrument, by the name of its file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache, partial
from importlib.metadata import EntryPoint
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from rig.contracts.declared.beside import with_dbc
from rig.errors import ConfigurationError
from rig.procedures.entry_points import entry_points

if TYPE_CHECKING:
    from rig.drivers.driver import DriverClass


def installed(group: str) -> list[str]:
    """Names of an entry-point group, sorted."""
    return sorted({point.name for point in entry_points(group)})


@cache
def declared() -> Mapping[str, str]:
    """Texts of the files of declared instruments, by driver name."""
    found: dict[str, str] = {}
    for package in (_OURS_DECLARED, *(point.module for point in entry_points("rig.instruments"))):
        for file in files(package).iterdir():
            if file.name.endswith(".toml"):
                text = with_dbc(file.read_text(encoding="utf-8"), partial(_bytes_in, package))
                found[file.name.removesuffix(".toml").replace("_", "-")] = text
    return dict(sorted(found.items()))


def _bytes_in(package: str, name: str) -> bytes:
    return files(package).joinpath(name).read_bytes()


def drivers() -> list[str]:
    """Names of all drivers, in Python and declared, sorted."""
    return sorted({*installed("rig.drivers"), *declared()})


def is_file(driver: str) -> bool:
    """Whether a driver is named by the path of its instrument's file."""
    return driver.endswith(".toml") and "\n" not in driver


def text_of(driver: str) -> str:
    """The file of a declared instrument: itself, where the text stands in place of the name; "" of a Python driver."""
    return driver if "\n" in driver else declared().get(driver, "")


def short(driver: str) -> str:
    """A driver for messages: its name; of a file's text maker and model."""
    return driver if "\n" not in driver else driver_class(driver).__name__  # type: ignore[attr-defined]  # of a class


@cache
def driver_class(name: str) -> DriverClass:
    """The driver registered under `name`, or that of a declared instrument's text. Raises `ConfigurationError`."""
    if text := text_of(name):
        from rig.drivers.declared import driver_of  # noqa: PLC0415 - few benches have one

        try:
            return driver_of(text, own="\n" in name)
        except ValueError as error:
            raise ConfigurationError(f"the instrument's file is wrong: {error}") from None
    if is_file(name):
        raise ConfigurationError(f"{name} is read beside the bench file, and there is none here")
    if name not in installed("rig.drivers"):
        raise ConfigurationError(f"driver {name!r} is not known; installed: {', '.join(drivers())}")
    found: DriverClass = load("rig.drivers", name, ("Options", "wire", "contracts"))
    return found


def may_repeat(driver: str) -> bool:
    """Whether readings of a driver's instrument have a declared step, so that they may repeat to the last digit."""
    try:
        return bool(getattr(driver_class(driver), "coarse", False))
    except ConfigurationError:  # it is not installed here
        return False


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
_OURS_DECLARED = "rig.drivers.declared"


def _package(point: EntryPoint) -> str:
    return f"{point.dist.name} {point.dist.version}" if point.dist else point.module
