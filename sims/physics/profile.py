"""Motion of one axis in closed form: a trapezoidal speed profile, then creep to the target.

A leg never turns back. It is a list of phases of constant acceleration and then an exponential creep. So angle, speed,
and the angle behind a first-order lag (the sensors' pendulum) are closed forms of time. Angles are in degrees, speeds
in degrees per second.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, sqrt


@dataclass(frozen=True, slots=True)
class Mechanics:
    """Parameters of an axis's motion.

    Attributes:
        lag_s: time constant of the sensors' pendulum.
        creep_deg: distance from the target at which the last phase ends.
        creep_s: time constant of the creep.
        gear_play_deg: play that the motor crosses on a reversal while the axis waits.
        hidden_play_deg: play behind the encoder; the table trails the encoder by half of it.
    """

    lag_s: float
    creep_deg: float
    creep_s: float
    gear_play_deg: float
    hidden_play_deg: float


@dataclass(frozen=True, slots=True)
class Course:
    """Course of a leg.

    Attributes:
        direction: +1 upwards, -1 downwards.
        phases: (duration, speed, acceleration) of each phase, along the direction.
        target: final angle.
        creep: distance from the target, along the direction, at the end of the phases.
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
        """Response of a first-order lag to the parabola: its steady response and a decaying transient."""
        dt = t - self.start
        steady = self.angle + self.speed * (dt - lag) + self.bend * (dt * (dt - 2.0 * lag) + 2.0 * lag * lag)
        at_start = self.angle - self.speed * lag + 2.0 * self.bend * lag * lag
        return steady + (self.seen - at_start) * exp(-dt / lag)


class Leg:
    """Motion in one direction, from `start` until the next leg begins.

    Args:
        start: its begin, virtual time.
        angle: encoder angle at its begin.
        seen: lagged angle at its begin.
        trail: table minus encoder at its begin, by the play between them.
        course: its course.
        mechanics: parameters of the axis.
    """

    __slots__ = (
        "_angle",
        "_creep",
        "_creep_s",
        "_lag_s",
        "_phases",
        "_play",
        "_seen_creep",
        "_seen_fading",
        "_target",
        "_trail",
        "course",
        "end",
        "start",
    )

    def __init__(
        self, start: float, angle: float, seen: float, trail: float, course: Course, mechanics: Mechanics
    ) -> None:
        self.start = start
        self.course = course
        self._angle = angle
        self._trail = trail
        self._target, self._play = course.target, mechanics.hidden_play_deg
        self._creep_s, self._lag_s = mechanics.creep_s, mechanics.lag_s
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
            return self._target + self._creep * exp((self.end - t) / self._creep_s)
        return self._phase(t).angle_at(t)

    def speed(self, t: float) -> float:
        """Encoder speed; zero during the creep."""
        if t >= self.end:
            return 0.0
        phase = self._phase(t)
        return phase.speed + 2.0 * phase.bend * (t - phase.start)

    def seen(self, t: float) -> float:
        """Encoder angle behind the pendulum's lag."""
        if t >= self.end:
            gone = self.end - t
            creeping = self._seen_creep * exp(gone / self._creep_s)
            return self._target + creeping + self._seen_fading * exp(gone / self._lag_s)
        return self._phase(t).seen_at(t, self._lag_s)

    def trail(self, t: float) -> float:
        """Table minus encoder: the table stays until the play is taken up, then trails by half of it."""
        play = self._play
        if play == 0.0:
            return 0.0
        sign = self.course.direction
        return sign * max(sign * self._trail - abs(self.angle(t) - self._angle), -play / 2.0)


def stopping(angle: float, speed: float, acceleration: float) -> Course:
    """Stop from a speed, with a deceleration."""
    sign = 1.0 if speed > 0 else -1.0
    distance = speed * speed / (2.0 * acceleration)
    return Course(sign, [(abs(speed) / acceleration, abs(speed), -acceleration)], angle + sign * distance, 0.0)


def overshoots(angle: float, speed: float, target: float, acceleration: float) -> bool:
    """Whether an axis at this speed cannot stop before the target, or moves away from it."""
    return speed != 0.0 and (target - stopping(angle, speed, acceleration).target) * speed < 0.0


def towards(
    angle: float, speed: float, target: float, cruise: float, acceleration: float, creep: float, wait: float
) -> Course:
    """Accelerate, cruise, decelerate, creep in.

    Args:
        angle: where the axis is.
        speed: its speed, not away from the target and not too fast to stop before it (see `overshoots`).
        target: final angle.
        cruise: maximum speed.
        acceleration: acceleration of both ramps.
        creep: distance from the target at which the creep begins, at most the whole distance.
        wait: seconds before the motion begins.
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
