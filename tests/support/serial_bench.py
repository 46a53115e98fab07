"""A fake plant and a plugged-in twin, for tests of serial drivers and twins."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from functools import partial
from types import SimpleNamespace

from rig.drivers.wires import Wires
from rig.sims.wires.serial_line import SerialCable, register
from rig.sims.world import World

_keys = itertools.count(1)


class FakeHead:
    """Axes that move at constant speed; encoder zero is where `at` says home is."""

    def __init__(self, world: World, at: Mapping[str, float]) -> None:
        self._world = world
        self._legs = {axis: (0.0, angle, angle, 1.0) for axis, angle in at.items()}
        self.commands: list[tuple[str, float, float, float]] = []
        self.axes = {
            axis: SimpleNamespace(
                **{name: partial(getattr(self, name), axis) for name in ("move", "stop", "encoder_deg", "moving")}
            )
            for axis in at
        }

    def move(self, axis: str, target_deg: float, speed: float, accel: float) -> None:
        now = self._world.now()
        self.commands.append((axis, target_deg, speed, accel))
        self._legs[axis] = (now, self.encoder_deg(axis, now), target_deg, speed)

    def stop(self, axis: str) -> None:
        now = self._world.now()
        here = self.encoder_deg(axis, now)
        self._legs[axis] = (now, here, here, 1.0)

    def encoder_deg(self, axis: str, t: float) -> float:
        began, start, target, speed = self._legs[axis]
        gone = min((t - began) * speed, abs(target - start))
        return start + gone if target > start else start - gone

    def moving(self, axis: str, t: float) -> bool:
        return self.encoder_deg(axis, t) != self._legs[axis][2]


class FakePlant:
    """Constant voltages and temperatures by channel, and a head."""

    truth = SimpleNamespace(seed=7)

    def __init__(self, world: World, volts: Mapping[str, float] | None = None, degC: float = 23.0) -> None:
        self.head = FakeHead(world, {"pitch": 31.25, "roll": -12.5})
        self.volts = dict(volts or {})
        self.degC = degC
        self.windows: list[tuple[str, float, float]] = []

    def channel_V(self, instrument: str, channel: str, t0: float, t1: float) -> float:
        self.windows.append((channel, t0, t1))
        return self.volts[channel]

    def channel_degC(self, instrument: str, channel: str, t: float) -> float:
        return self.degC


def plug_in(world: World, twin: object) -> str:
    """A `sim://` address with the twin at its other end."""
    place = f"test{next(_keys)}/{twin.name}"
    register(place, SerialCable(world, twin))
    return f"sim://{place}"


class Recorder:
    """A tap that keeps what went over the wire."""

    def __init__(self) -> None:
        self.log: list[tuple[str, bytes]] = []

    def __call__(self, who: str, direction: str, data: bytes) -> None:
        self.log.append((direction, data))

    def sent(self) -> list[bytes]:
        return [data for direction, data in self.log if direction == "tx"]


def wires(world: World) -> tuple[Wires, Recorder]:
    recorder = Recorder()
    return Wires(world, tap=recorder), recorder
