"""Interlocks: conditions of the bench file, checked whenever their quantity is read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from rig.bench.protection import InterlockConfig
from rig.drivers.roles import ChamberState, is_overload
from rig.engine.fault_classes import InterlockHold, LimitViolation


class Interlocks:
    """All interlocks of a bench.

    Args:
        rules: as in the bench file, by name.
        now: bench time.

    """

    def __init__(self, rules: Mapping[str, InterlockConfig], now: Callable[[], float] = lambda: 0.0) -> None:
        self._now = now
        self._since: dict[str, float] = {}
        self._rules: dict[str, dict[str, InterlockConfig]] = {}
        self._of_chambers: dict[str, list[str]] = {}
        for name, rule in rules.items():
            self._rules.setdefault(rule.watch, {})[name] = rule

    def watches(self, what: str) -> bool:
        """Whether an interlock of the bench file watches this quantity."""
        return what in self._rules

    def check_chamber(self, name: str, state: ChamberState) -> None:
        """Check a chamber's new readings. Raises `LimitViolation` or `InterlockHold`."""
        watched = self._of_chambers.get(name)
        if watched is None:
            names = (field.name for field in fields(state))
            watched = self._of_chambers[name] = [field for field in names if f"{name}.{field}" in self._rules]
        for field in watched:
            self.check(f"{name}.{field}", getattr(state, field))

    def check(self, what: str, value: Any) -> None:
        """Check one reading. Raises `LimitViolation` or `InterlockHold`, with the name of the interlock."""
        for name, rule in self._rules.get(what, {}).items():
            wrong = _wrong(rule, value)
            if not wrong:
                self._since.pop(name, None)
                continue
            since = self._since.setdefault(name, self._now())
            if self._now() - since < rule.for_s:
                continue
            lasted = f" for {self._now() - since:.0f} s" if rule.for_s else ""
            then = rule.why or "look at it"
            message = f"interlock {name}: {what} {wrong}{lasted}; {then}, then {_WAY_ON[rule.then]}"
            raise (InterlockHold if rule.then == "hold" else LimitViolation)(message)


_WAY_ON = {"hold": "release", "safe": "resume"}


def _wrong(rule: InterlockConfig, value: Any) -> str:
    """Defect of a reading, "" if none."""
    if rule.within is not None:
        low, high = rule.within
        if is_overload(float(value)):
            return f"cannot be read, and must be {low:g} to {high:g}"
        return "" if low <= value <= high else f"is {value:g}, and must be {low:g} to {high:g}"
    if rule.must_be is not None:
        return "" if value == rule.must_be else f"is {str(value).lower()}, and must be {str(rule.must_be).lower()}"
    return f"says {', '.join(value)}" if value else ""
