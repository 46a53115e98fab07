"""Motion of one axis in closed form: trapezoidal speed, then a creep to the target.

A leg never turns back. It is a list of phases of constant acceleration and then an exponential creep, so that
angle, speed, and angle behind a first-order lag (the sensors' pendulum) are closed forms of time. Angles are in
degrees, speeds in degrees per second.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, sqrt


@dataclass(frozen=True, slots=True)
class Mechanics:
    """What shapes an axis's motion.

    Attributes:
        lag_s: time constant of the pendulum that watches.
        creep_deg: how far before the target the last phase ends.
        creep_s: time constant of the creep.
        gear_play_deg: the motor crosses this on a reversal while the axis waits.
        hidden_play_deg: play behind the encoder; the table trails the encoder by half of it.

    """

    lag_s: float
    creep_deg: float
    creep_s: float
    gear_play_deg: float
    hidden_play_deg: float


@dataclass(frozen=True, slots=True)
class Course:
    """Where a leg goes.

    Attributes:
        direction: +1 upwards, -1 downwards.
        phases: (duration, speed, acceleration) of each phase, along the direction.
        target: where it comes to rest.
        creep: how far before the target, along the direction, the phases end.

    """

    direction: float
    phases: Sequence[tuple[float, float, float]]
    target: float
    creep: float


@dataclass(frozen=True, slots=True)
class _Phase:
    """angle + speed dt + bend dt^2 from `start` on; `seen` is the lagged angle at `start`."""

    start: float
    angle: float
    speed: float
    bend: float
    seen: float

    def angle_at(self, t: float) -> float:
        dt = t - self.start
        return self.angle + (self.speed + self.bend * dt) * dt

    def seen_at(self, t: float, lag: float) -> float:
        """A first-order lag's answer to the parabola: its steady response, and what fades of the past."""
        dt = t - self.start
        steady = self.angle + self.speed * (dt - lag) + self.bend * (dt * (dt - 2.0 * lag) + 2.0 * lag * lag)
        at_start = self.angle - self.speed * lag + 2.0 * self.bend * lag * lag
        return steady + (self.seen - at_start) * exp(-dt / lag)


class Leg:
    """Motion in one direction, from `start` until the next leg begins.

    Args:
        start: when it begins.
        angle: encoder angle at that moment.
        seen: lagged angle at that moment.
        trail: table minus encoder at that moment, by the play between them.
        course: where to.
        mechanics: of the axis.

    """

    __slots__ = ("_angle", "_creep", "_m", "_phases", "_seen_creep", "_seen_fading", "_trail", "course", "end", "start")

    def __init__(
        self, start: float, angle: float, seen: float, trail: float, course: Course, mechanics: Mechanics
    ) -> None:
        self.start = start
        self.course = course
        self._angle = angle
        self._trail = trail
        self._m = mechanics
        lag, sign = mechanics.lag_s, course.direction
        phases = []
        for duration, speed, acceleration in course.phases:
            phase = _Phase(start, angle, sign * speed, sign * acceleration / 2.0, seen)
            phases.append(phase)
            start += duration
            angle, seen = phase.angle_at(start), phase.seen_at(start, lag)
        self._phases = tuple(phases)
        self.end = start
        self._creep = -sign * course.creep
        self._seen_creep = self._creep / (1.0 - lag / mechanics.creep_s)
        self._seen_fading = seen - course.target - self._seen_creep

    def _phase(self, t: float) -> _Phase:
        for phase in reversed(self._phases):
            if phase.start <= t:
                return phase
        return self._phases[0]

    def angle(self, t: float) -> float:
        """Encoder angle."""
        if t >= self.end:
            return self.course.target + self._creep * exp((self.end - t) / self._m.creep_s)
        return self._phase(t).angle_at(t)

    def speed(self, t: float) -> float:
        """Encoder speed; the creep counts as standing."""
        if t >= self.end:
            return 0.0
        phase = self._phase(t)
        return phase.speed + 2.0 * phase.bend * (t - phase.start)

    def seen(self, t: float) -> float:
        """Encoder angle behind the pendulum's lag."""
        if t >= self.end:
            gone = self.end - t
            creeping = self._seen_creep * exp(gone / self._m.creep_s)
            return self.course.target + creeping + self._seen_fading * exp(gone / self._m.lag_s)
        return self._phase(t).seen_at(t, self._m.lag_s)

    def trail(self, t: float) -> float:
        """Table minus encoder: the table stays until the play is taken up, then trails by half of it."""
        play = self._m.hidden_play_deg
        if play == 0.0:
            return 0.0
        sign = self.course.direction
        return sign * max(sign * self._trail - abs(self.angle(t) - self._angle), -play / 2.0)


def stopping(angle: float, speed: float, acceleration: float) -> Course:
    """Come to a stop from a speed, at a deceleration."""
    sign = 1.0 if speed > 0 else -1.0
    distance = speed * speed / (2.0 * acceleration)
    return Course(sign, [(abs(speed) / acceleration, abs(speed), -acceleration)], angle + sign * distance, 0.0)


def overshoots(angle: float, speed: float, target: float, acceleration: float) -> bool:
    """Whether an axis at this speed can no longer stop before the target, or moves away from it."""
    return speed != 0.0 and (target - stopping(angle, speed, acceleration).target) * speed < 0.0


def towards(
    angle: float, speed: float, target: float, cruise: float, acceleration: float, creep: float, wait: float
) -> Course:
    """Accelerate, cruise, decelerate, creep in.

    Args:
        angle: where the axis is.
        speed: its speed, not away from the target and not too fast to stop before it (see `overshoots`).
        target: where it shall rest.
        cruise: speed it may reach.
        acceleration: of both ramps.
        creep: how far before the target the creep begins, if there is so much way.
        wait: seconds of standing before anything moves.

    """
    sign = 1.0 if target >= angle else -1.0
    v = abs(speed)
    creep = min(creep, abs(target - angle) - v * v / (2.0 * acceleration))
    way = abs(target - angle) - creep
    phases = [(wait, 0.0, 0.0)] if wait else []
    if v > cruise:
        phases.append(((v - cruise) / acceleration, v, -acceleration))
        way -= (v * v - cruise * cruise) / (2.0 * acceleration)
        v = cruise
    peak = min(cruise, sqrt(acceleration * way + v * v / 2.0))
    flat = way - (2.0 * peak * peak - v * v) / (2.0 * acceleration)
    if peak > 0.0:
        phases.append(((peak - v) / acceleration, v, acceleration))
        phases.append((max(0.0, flat) / peak, peak, 0.0))
        phases.append((peak / acceleration, peak, -acceleration))
    return Course(sign, phases, target, creep)
