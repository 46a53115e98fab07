"""A temperature chamber: air under a control loop, walls that follow slowly, and a body that follows both.

Between two commands the system is linear, so there is a closed form (`rig.sims.physics.modes`):

    air'  = (lab - air) / free + (wall - air) / exchange + heat
    wall' = (air - wall) / wall_time_constant
    body' = ((1 - w - l) air + w wall + l lab - body) / body_time_constant
    heat  = (2 damping / tau) (setpoint in force - air) + integral of the same / tau^2

The controller is proportional and integral; its setpoint in force moves no faster than the power allows.
"""

# ruff: noqa: N802  (a quantity's name ends in its unit, and units keep their own case)

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from rig.sims.physics.modes import Array, Response
from rig.sims.physics.pressure_truth import ChamberTruth
from rig.sims.physics.steps import Steps
from rig.sims.physics.thermal import Lab, Ramp
from rig.sims.physics.told import Told

_AIR, _WALL, _BODY, _INTEGRAL = range(4)


@dataclass(frozen=True, slots=True)
class _Stretch:
    """The chamber between two commands, or from the end of a ramp to the next command."""

    controlled: bool
    ramp: Ramp
    response: Response


class Chamber:
    """A chamber with a body in it; the same commands and queries as `rig.sims.physics.thermal.Enclosure`.

    Args:
        truth: its true parameters.
        lab: its surroundings.
        start: virtual time of its first known state, which is steady.

    Attributes:
        controlled: whether the control loop is closed.
        told: called with every command.
        temperatures: its setpoints, with a step for every change of temperature that begins a new whole plot.
    """

    def __init__(self, truth: ChamberTruth, lab: Lab, start: float) -> None:
        self._truth = truth
        self._lab = lab
        t = truth
        free, exchange, wall, body = (
            1.0 / tau
            for tau in (t.free_time_constant_s, t.wall_exchange_s, t.wall_time_constant_s, t.body_time_constant_s)
        )
        alone = np.array(
            [
                [-free - exchange, exchange, 0.0],
                [wall, -wall, 0.0],
                [body * (1.0 - t.body_sees_wall - t.body_sees_lab), body * t.body_sees_wall, -body],
            ]
        )
        self._proportional = 2.0 * t.damping / t.time_constant_s
        self._integral = 1.0 / t.time_constant_s  # integral of the error over tau, so that all states are in degrees
        closed = np.zeros((4, 4))
        closed[:3, :3] = alone
        closed[_AIR, _AIR] -= self._proportional
        closed[_AIR, _INTEGRAL] = self._integral
        closed[_INTEGRAL, _AIR] = -self._integral
        self._matrices = {False: alone, True: closed}
        self._command = np.array([self._proportional, 0.0, 0.0, self._integral])
        self._surroundings = np.array([free, 0.0, body * t.body_sees_lab, 0.0])
        self._free = free
        self.told: Told | None = None
        # rate at which the air approaches the laboratory's, per second, while the door is open
        self._door: float | None = None
        self.assume_steady(t.start_setpoint_degC, start, controlled=t.start_controlled)

    def assume_steady(self, setpoint_degC: float, now: float, *, controlled: bool = True) -> None:
        """Reset the state: at `now` this setpoint has been in force long enough for all transients to have decayed."""
        self.controlled = controlled
        self._stretches: list[_Stretch] = []
        self._append(Ramp(now, setpoint_degC, 0.0, now, setpoint_degC), now, None)
        self.temperatures = Steps(now, setpoint_degC if controlled else self.air_degC(now))

    @property
    def setpoint_degC(self) -> float:
        """The commanded setpoint, also during a ramp to it."""
        return self._stretches[-1].ramp.setpoint_degC

    def active_setpoint_degC(self, t: float) -> float:
        """The setpoint in force at `t`; on the ramp during a ramp."""
        return self._stretch(t).ramp.at(t)

    def command(
        self, now: float, setpoint_degC: float, *, controlled: bool = True, ramp_degC_per_min: float = inf
    ) -> None:
        """Command a setpoint, with control on or off, from `now` on.

        Args:
            now: virtual time.
            setpoint_degC: the new setpoint.
            controlled: whether the control loop is closed; open, the air follows the laboratory.
            ramp_degC_per_min: maximum rate; None for the chamber's own slew.
        """
        if self.told is not None:
            self.told("setpoint_degC", setpoint_degC)
            self.told("control", "on" if controlled else "off")
        air = self.air_degC(now)
        begin = self.active_setpoint_degC(now) if self._stretch(now).controlled else air
        slew = min(ramp_degC_per_min, self._truth.slew_degC_per_min) / 60.0
        away = setpoint_degC - begin
        end = now + abs(away) / slew if controlled else now
        changed = max(abs(setpoint_degC - air), abs(setpoint_degC - self.temperatures.value(now)))
        if self._door is not None:
            end = now  # without control
        elif controlled and changed > self._truth.new_draw_degC:
            self.temperatures.set(now, setpoint_degC, end - now)
        ramp = Ramp(now, begin, slew if away > 0 else -slew, end, setpoint_degC)
        state = self._stretch(now).response.state(now)[:_INTEGRAL]
        if controlled and self._door is None:
            total = self._stretch(now).response.at(_INTEGRAL, now) if self._stretch(now).controlled else 0.0
            state = np.append(state, total)
        self.controlled = controlled
        self._stretches = [s for s in self._stretches if s.response.start <= now]
        self._append(ramp, now, state)
        if end > now:
            self._append(ramp, end, self._stretches[-1].response.state(end))

    def open_door(self, now: float, time_constant_s: float) -> None:
        """Open its door: control stops, and the air approaches the laboratory's at this rate."""
        if self.told is not None:
            self.told("door", "open")
        self._door = 1.0 / time_constant_s
        self._again(now)

    def close_door(self, now: float) -> None:
        """Close its door: the last command is in force again."""
        if self.told is not None:
            self.told("door", "closed")
        self._door = None
        self._again(now)

    def _again(self, now: float) -> None:
        rate = abs(self._stretches[-1].ramp.slope) * 60.0 or inf
        self.command(now, self.setpoint_degC, controlled=self.controlled, ramp_degC_per_min=rate)

    def air_degC(self, t: float) -> float:
        """Temperature of the air, as seen by the controller's sensor."""
        return self._stretch(t).response.at(_AIR, t)

    def wall_degC(self, t: float) -> float:
        """Temperature of the walls."""
        return self._stretch(t).response.at(_WALL, t)

    def package_degC(self, t: float) -> float:
        """Temperature of the transducers or electronics in it."""
        return self._stretch(t).response.at(_BODY, t)

    def power_pct(self, t: float) -> float:
        """Control output, percent: full heating 100, full cooling -100, 0 when control is off."""
        stretch = self._stretch(t)
        if not stretch.controlled:
            return 0.0
        error = stretch.ramp.at(t) - stretch.response.at(_AIR, t)
        heat = self._proportional * error + self._integral * stretch.response.at(_INTEGRAL, t)
        full = self._truth.authority_degC / self._truth.free_time_constant_s
        return min(100.0, max(-100.0, 100.0 * heat / full))

    def drifted(self, t: float) -> bool:
        """Whether it has no control and has left its last setpoint."""
        if self._stretch(t).controlled:
            return False
        return abs(self.air_degC(t) - self.temperatures.value(t)) > self._truth.new_draw_degC

    def _append(self, ramp: Ramp, at: float, begin: Array | None) -> None:
        closed = self.controlled and self._door is None
        n = 4 if closed else 3
        matrix, surroundings = self._matrices[closed], self._surroundings[:n]
        if self._door is not None:
            matrix, surroundings = matrix.copy(), surroundings.copy()
            matrix[_AIR, _AIR] -= self._door - self._free
            surroundings[_AIR] = self._door
        slope = ramp.slope if at < ramp.end else 0.0
        response = Response(
            at,
            matrix,
            self._command[:n] if closed else np.zeros(n),
            surroundings,
            (ramp.at(at), slope),
            self._lab,
            begin,
        )
        self._stretches.append(_Stretch(closed, ramp, response))

    def _stretch(self, t: float) -> _Stretch:
        for stretch in reversed(self._stretches):
            if stretch.response.start <= t:
                return stretch
        return self._stretches[0]
