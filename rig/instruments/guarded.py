"""An independent check of every command, at the drivers' boundary.

Every command to an instrument passes this check, whatever the caller has checked. A value outside the bench's
`[limits]`, or one that is not a number, is refused before the driver receives it. This module reads the limits from the
bench file itself and shares no code with its callers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from operator import attrgetter
from typing import Any

from rig.drivers.roles import (
    Chamber,
    ChamberState,
    Head,
    Instrument,
    PressureController,
    PressureState,
    Source,
    SourceState,
    plays,
)
from rig.errors import BenchFault
from rig.units.of_instruments import PRESSURE

Limits = Mapping[str, tuple[float, float]]


class Refused(BenchFault):
    """A command was refused at the drivers' boundary; the instrument has not received it."""


class _Guarded:
    """Guard of one instrument; everything but commands passes unchanged."""

    def __init__(self, name: str, instrument: Any, limits: Limits, factors: Sequence[str]) -> None:
        self._guarded_name, self._guarded, self._guarded_limits = name, instrument, limits
        self._guarded_factors = factors

    def __getattr__(self, attribute: str) -> Any:
        return getattr(self._guarded, attribute)

    def _check(self, quantity: str, value: float) -> None:
        low, high = self._guarded_limits.get(quantity, (-math.inf, math.inf))
        if not (math.isfinite(value) and low <= value <= high):
            raise Refused(
                f"{quantity} = {value:g} was commanded to {self._guarded_name}, outside {low:g} to "
                f"{high:g} (bench limits); it was not sent. This is a fault of the program: please report it"
            )

    @property
    def _guarded_quantity(self) -> str:
        """What it sets, with a unit: its first factor; "" without one."""
        return next(iter(self._guarded_factors), "")

    def _check_factors(self, value: float, *others: str) -> None:
        """Check a value against the limits of the factors that the instrument sets, and of these quantities."""
        for quantity in dict.fromkeys((*others, *self._guarded_factors)) or (self._guarded_name,):
            self._check(quantity, value)


class _GuardedHead(_Guarded):
    def move(self, targets_deg: Mapping[str, float]) -> None:
        for axis, target in targets_deg.items():
            self._check(f"{axis}_deg", target)
        self._guarded.move(targets_deg)


class _GuardedChamber(_Guarded):
    def set_temperature(self, degC: float) -> None:
        self._check_factors(degC, f"{self._guarded_name}_degC")
        self._guarded.set_temperature(degC)


class _GuardedPressure(_Guarded):
    def set_pressure(self, psia: float) -> None:
        self._check_factors(psia, PRESSURE)
        self._guarded.set_pressure(psia)


class _GuardedSource(_Guarded):
    def set(self, value: float) -> None:
        self._check_factors(value)
        self._guarded.set(value)


def watch_readbacks(instrument: Instrument, note: Callable[[str, float], None]) -> None:
    """Call `note` with quantity and value whenever a guarded instrument reads back what it sets; others stay as are."""
    if not isinstance(instrument, _Guarded):
        return
    read, own, name = instrument._guarded.read, instrument._guarded_quantity, instrument._guarded_name

    def noted() -> Any:
        state = read()
        match state:
            case ChamberState():
                note(own or f"{name}_degC", state.temperature_degC)
            case PressureState():
                note(own or PRESSURE, state.pressure_psia)
            case SourceState():
                note(own or name, state.value)
            case dict():  # of a head
                for axis, one in state.items():
                    note(f"{axis}_deg", one.position_deg)
        return state

    instrument._guarded.read = noted


_GUARDED: tuple[tuple[type, type[_Guarded]], ...] = (
    (Head, _GuardedHead),
    (Chamber, _GuardedChamber),
    (PressureController, _GuardedPressure),
    (Source, _GuardedSource),
)


def guarded(name: str, instrument: Instrument, limits: Limits, factors: Sequence[str] = ()) -> Instrument:
    """An instrument with checked commands; an instrument without commands is returned unchanged.

    Args:
        name: the bench's name, also the name of a chamber's limits.
        instrument: a driver's instance.
        limits: (low, high) by quantity, as in the bench file.
        factors: names of the factors that it sets.
    """
    if isinstance(instrument, _Guarded):
        return instrument
    bases = tuple(guard for role, guard in _GUARDED if plays(instrument, role))
    if not bases:
        return instrument
    wrapped: Instrument = _class_for(type(instrument), bases)(name, instrument, limits, factors)
    return wrapped


@cache
def _class_for(driver: type, bases: tuple[type[_Guarded], ...]) -> Any:
    """A guard with all methods of its driver, because roles are recognised by the methods of a class."""
    own = {name for base in bases for name in dir(base)}
    names = [n for n in dir(driver) if not n.startswith("_") and n not in own and callable(getattr(driver, n))]
    forwarded = {name: property(attrgetter(f"_guarded.{name}")) for name in names}
    return type(f"Guarded{driver.__name__}", bases, forwarded)
