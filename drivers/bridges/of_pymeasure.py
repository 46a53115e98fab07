"""PyMeasure: `pymeasure:keithley.Keithley2400`. Its address is a VISA resource; `arguments` go to the class."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rig.drivers.bridges.objects import (
    Wrong,
    called,
    class_named,
    found_at,
    identity_in,
    literal,
    no_attribute,
    parent_of,
)


class _Instrument:
    """An instrument of PyMeasure; see `rig.drivers.bridges.objects.Library`."""

    def __init__(self, made: Any) -> None:
        self._made = made

    def identity(self) -> tuple[str, str, str, str]:
        """Its answer to *IDN?; the name of its class if it has no such question."""
        try:
            said = str(self._made.id)
        except (AttributeError, NotImplementedError):
            return "", "", "", ""
        return identity_in(said)

    def read(self, path: str) -> tuple[Any, str, float | None]:
        """The value of a property; PyMeasure does not say units and times."""
        return found_at(self._made, path), "", None

    def write(self, path: str, text: str) -> None:
        """Set a property. Any other attribute would be made by Python, and nothing sent."""
        of, name = parent_of(self._made, path)
        found = getattr(type(of), name, None)
        if found is None or not isinstance(found, property):
            raise no_attribute(of, name, "has no property")
        if found.fset is None:
            raise Wrong(f"{name} of {type(of).__name__} can only be read")
        setattr(of, name, literal(text))

    def call(self, path: str) -> None:
        """Carry out a call."""
        called(self._made, path)

    def close(self) -> None:
        """Close its adapter; its `shutdown` is not called, which may change settings."""
        self._made.adapter.close()


def opened(what: str, address: str, arguments: Mapping[str, Any]) -> _Instrument:
    """The instrument at a VISA resource. Raises whatever its class does."""
    from pymeasure.instruments import Instrument  # noqa: PLC0415

    return _Instrument(class_named(what, "pymeasure.instruments", Instrument)(address, **arguments))
