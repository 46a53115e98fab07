"""QCoDeS: `qcodes:qcodes.instrument_drivers.Keithley.Keithley2450`. Its address is a VISA resource."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rig.drivers.bridges.objects import Wrong, called, class_named, found_at, literal


class _Instrument:
    """An instrument of QCoDeS; see `rig.drivers.bridges.objects.Library`."""

    def __init__(self, made: Any, parameter: type) -> None:
        self._made, self._parameter = made, parameter

    def identity(self) -> tuple[str, str, str, str]:
        """Its answer to *IDN?."""
        said = self._made.get_idn()
        maker, model, serial, firmware = (str(said.get(key) or "") for key in ("vendor", "model", "serial", "firmware"))
        return maker, model, serial, firmware

    def read(self, path: str) -> tuple[Any, str, float | None]:
        """The value of a parameter, asked anew, with its unit."""
        found = found_at(self._made, path)
        if isinstance(found, self._parameter):
            return found.get(), str(getattr(found, "unit", "") or ""), None  # type: ignore[attr-defined]
        return found, "", None

    def write(self, path: str, text: str) -> None:
        """Set a parameter."""
        found = found_at(self._made, path)
        if not isinstance(found, self._parameter):
            raise Wrong(f"{path} is no parameter of {type(self._made).__name__}")
        found.set(literal(text))  # type: ignore[attr-defined]

    def call(self, path: str) -> None:
        """Carry out a call."""
        called(self._made, path)

    def close(self) -> None:
        """Close it."""
        self._made.close()


def opened(what: str, address: str, arguments: Mapping[str, Any]) -> _Instrument:
    """The instrument at a VISA resource. Raises whatever its class does."""
    from qcodes.instrument import Instrument  # noqa: PLC0415
    from qcodes.parameters import ParameterBase  # noqa: PLC0415

    made = class_named(what, "qcodes.instrument_drivers", Instrument)
    return _Instrument(made("instrument", address, **arguments), ParameterBase)
