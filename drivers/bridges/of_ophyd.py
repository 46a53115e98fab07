"""EPICS process variables through ophyd: `ophyd:LAB:BATH`, and suffixes of it as attributes.

`value` is the process variable itself; `:T` and `.DRVH` are added to its name; any other attribute is a whole name. A
value whose alarm says that it is invalid is refused, and a reading has to be newer than the question.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rig.drivers.bridges.objects import Wrong, literal

_WAIT_S = 5.0  # for a connection, a value, and the end of a setting; below our own wait; chosen
_INVALID = 3  # severity of an alarm: the value is not valid (EPICS Application Developer's Guide, alarm severity)


class _Variables:
    """Process variables; see `rig.drivers.bridges.objects.Library`."""

    def __init__(self, begin: str, paths: Sequence[str], *, passive: bool) -> None:
        self._begin, self._paths, self._passive = begin, paths, passive
        self._signals: dict[str, Any] = {}

    def _signal(self, path: str) -> Any:
        from ophyd import EpicsSignal  # noqa: PLC0415

        name = self._begin if path == "value" else f"{self._begin}{path}" if path[:1] in ".:" else path
        if name not in self._signals:
            made = EpicsSignal(name, name="signal", string=False)
            made.wait_for_connection(timeout=_WAIT_S)
            self._signals[name] = made
        return self._signals[name]

    def identity(self) -> tuple[str, str, str, str]:
        """EPICS says nothing about who is behind variables: only that all are there."""
        for path in self._paths or ["value"]:
            self._signal(path)
        return "EPICS", self._begin, "", ""

    def read(self, path: str) -> tuple[Any, str, float | None]:
        """A value, its unit (EGU) and when it was processed. Raises `Wrong` if its alarm says that it is invalid."""
        signal = self._signal(path)
        value = signal.get(use_monitor=False, timeout=_WAIT_S, connection_timeout=_WAIT_S)
        found = signal._read_pv.get_ctrlvars(timeout=_WAIT_S) or {}
        if signal.alarm_severity is not None and int(signal.alarm_severity) >= _INVALID:
            raise Wrong(f"{signal.pvname} is {value}, and its alarm says that this is invalid ({signal.alarm_status})")
        stamp = None if self._passive else float(signal.timestamp)
        return value, str(found.get("units") or ""), stamp

    def write(self, path: str, text: str) -> None:
        """Put a value, and wait until the record has been processed."""
        signal = self._signal(path)
        signal.set(literal(text), timeout=_WAIT_S).wait(timeout=_WAIT_S + 1.0)

    def call(self, path: str) -> None:
        """Variables have no calls."""
        raise Wrong(f"{path} is no setting; write {path} = VALUE")

    def close(self) -> None:
        """Disconnect."""
        for signal in self._signals.values():
            signal.destroy()


def opened(what: str, address: str, arguments: Mapping[str, Any]) -> _Variables:
    """The variables that begin with a name. `passive = true`: they are not processed by themselves."""
    unknown = arguments.keys() - {"passive", "variables"}
    if unknown:
        raise Wrong(f"its only argument is passive, not {', '.join(sorted(unknown))}")
    return _Variables(what, arguments["variables"], passive=bool(arguments.get("passive", False)))
