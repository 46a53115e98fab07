"""One axis of the simulated ESP301: its settings, and a count relative to its position at power-on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from rig.sims.world import World

ENCODER_DEG = 1e-4
"""Encoder resolution; positions are answered in whole counts."""

_MOMENT_S = 1e-3


class Mechanics(Protocol):
    """One axis of the mechanics behind this controller (`rig.sims.physics.head`)."""

    def move(self, target: float, speed: float, acceleration: float) -> None:
        """Start a motion profile; angle in deg, speed in deg/s, acceleration in deg/s^2."""
        ...

    def stop(self) -> None:
        """Decelerate to rest."""
        ...

    def encoder_deg(self, t: float) -> float:
        """Encoder angle."""
        ...

    def moving(self, t: float) -> bool:
        """Whether a profile is under way."""
        ...


class Head(Protocol):
    """The mechanics of all axes."""

    @property
    def axes(self) -> Mapping[str, Mechanics]:
        """By name, "pitch" and "roll"."""
        ...


@dataclass(frozen=True)
class Parameter:
    """A numeric setting.

    Attributes:
        default: value at power-on.
        low, high: range.
        ceiling: parameter that is its upper limit, "" if none.
        ceiling_error: axis error above that limit.
        hexadecimal: whether it is a configuration word.
    """

    default: float
    low: float = 0.0
    high: float = 1e9
    ceiling: str = ""
    ceiling_error: int = 0
    hexadecimal: bool = False


PARAMETERS = {
    "VA": Parameter(4.0, ceiling="VU", ceiling_error=10),
    "VU": Parameter(40.0),
    "AC": Parameter(16.0, ceiling="AU", ceiling_error=11),
    "AG": Parameter(16.0, ceiling="AU", ceiling_error=11),
    "AU": Parameter(160.0),
    "OH": Parameter(4.0, ceiling="VU", ceiling_error=10),
    "OL": Parameter(0.5, ceiling="VU", ceiling_error=10),
    "JH": Parameter(4.0, ceiling="VU", ceiling_error=10),
    "JW": Parameter(1.0, ceiling="VU", ceiling_error=10),
    "SH": Parameter(0.0, low=-1e6, high=1e6),
    "SL": Parameter(-360.0, low=-1e6, high=1e6),
    "SR": Parameter(360.0, low=-1e6, high=1e6),
    "SN": Parameter(7, low=0, high=11),
    "FP": Parameter(4, low=0, high=7),
    "SU": Parameter(ENCODER_DEG),
    "FE": Parameter(1.0),
    "AE": Parameter(160.0),
    "VB": Parameter(0.0),
    "QM": Parameter(4, low=0, high=4),
    "ZA": Parameter(0x123, high=0xFFFF, hexadecimal=True),
    "ZB": Parameter(0x300, high=0xFFFF, hexadecimal=True),
    "ZE": Parameter(0x3, high=0xFFFF, hexadecimal=True),
    "ZF": Parameter(0x3, high=0xFFFF, hexadecimal=True),
    "ZH": Parameter(0x24, high=0xFFFF, hexadecimal=True),
    "ZS": Parameter(0x5, high=0xFFFF, hexadecimal=True),
}
"""Speeds in deg/s, accelerations in deg/s^2, angles in degrees; SN 7 means degrees, QM 4 a brushless motor.

The configuration words of these stages, and FE and AE, are not from the manual [?]: ZB's bits 8 and 9 mean an encoder,
ZH's bit 0 means limit switches.
"""

_POWER_ON = {name: parameter.default for name, parameter in PARAMETERS.items()}


class Axis:
    """One axis of the controller: its settings, and the origin of its count."""

    def __init__(self, name: str, head: Head, world: World) -> None:
        self.name = name
        self._mechanics = head.axes[name]
        self._world = world
        self.switch_on()

    def switch_on(self) -> None:
        """Settings at power-on: motor off, counting from the present position."""
        self.values = dict(_POWER_ON)
        self.powered = False
        self.homing = False
        self.target = 0.0
        self.zero = self._mechanics.encoder_deg(self._world.now())

    def position(self) -> float:
        """The count, in degrees."""
        return round((self._mechanics.encoder_deg(self._world.now()) - self.zero) / ENCODER_DEG) * ENCODER_DEG

    def speed(self) -> float:
        """Its speed, deg/s."""
        if not self.driving():
            return 0.0
        now = self._world.now()
        here, there = (self._mechanics.encoder_deg(t) for t in (now, now + _MOMENT_S))
        return (there - here) / _MOMENT_S

    def driving(self) -> bool:
        """Whether a motion profile is under way."""
        return self._mechanics.moving(self._world.now())

    def moving(self) -> bool:
        """Whether motion is not done, homing included."""
        return self.homing or self.driving()

    def told_position(self, t: float) -> str:
        """The answer to TP? at a time."""
        return f"{round((self._mechanics.encoder_deg(t) - self.zero) / ENCODER_DEG) * ENCODER_DEG:.4f}"

    def told_done(self, t: float) -> str:
        """The answer to MD? at a time."""
        return "0" if self.homing or self._mechanics.moving(t) else "1"

    def told_power(self, t: float) -> str:
        """The answer to MO?."""
        return "1" if self.powered else "0"

    def go(self, target: float, speed: float) -> None:
        """Start a move to `target`, in this count."""
        self.target = target
        self._mechanics.move(target + self.zero, speed, min(self.values["AC"], self.values["AG"]))

    def stop(self) -> None:
        """Decelerate to rest."""
        self._mechanics.stop()
