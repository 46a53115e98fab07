"""The dividing head's mechanics: two axes, their encoders, and the true angle of the table.

Here an encoder's angle is counted from its mark. After power-on a controller does not know the mark until homing has
found it at 0 deg; its count is the controller's own. Errors that the encoder cannot see (hidden play, harmonics of the
head) are between encoder and table: `true_deg`.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, sqrt
from typing import Protocol

from rig.sims.physics.profile import Course, Leg, Mechanics, overshoots, stopping, towards
from rig.sims.physics.steps import Steps
from rig.sims.physics.told import Told
from rig.sims.physics.truth import HeadTruth
from rig.sims.physics.undeclared import ARCSEC, Backlash, HeadError

AXES = ("pitch", "roll")
_REMEMBERED_S = 3600.0
"""Age of moves that are discarded, seconds; every reading is shorter."""


class Now(Protocol):
    """Parts of a world that the mechanics need."""

    def now(self) -> float:
        """Virtual seconds."""
        ...


class Axis:
    """One axis: its moves and its errors.

    Attributes:
        told: called with its motion.
        turns: history of its encoder's angle: ramps from one stand to the next.
    """

    def __init__(self, world: Now, start_deg: float, mechanics: Mechanics, errors: Sequence[HeadError]) -> None:
        self._world = world
        self._mechanics = mechanics
        self._errors = tuple(errors)
        self._faithful = not errors and mechanics.hidden_play_deg == 0.0  # the table is where its encoder is
        self._deceleration = 1.0
        self._stalled_until = -inf
        self.told: Told | None = None
        self._slips: list[tuple[float, float]] = []
        self.turns = Steps(world.now(), start_deg)
        resting = Course(1.0, (), start_deg, 0.0)
        self._legs = [Leg(-inf, start_deg, start_deg, -mechanics.hidden_play_deg / 2.0, resting, mechanics)]

    def leg(self, t: float) -> Leg:
        """The leg in force at `t`."""
        last = self._legs[-1]
        if last.start <= t:  # nearly always
            return last
        for leg in reversed(self._legs):
            if leg.start <= t:
                return leg
        return self._legs[0]

    def encoder_deg(self, t: float) -> float:
        """The encoder's angle from its mark, before quantisation."""
        last = self._legs[-1]
        return (last if last.start <= t else self.leg(t)).angle(t)

    def speed_deg_per_s(self, t: float) -> float:
        """Encoder speed."""
        return self.leg(t).speed(t)

    def side(self, t: float) -> int:
        """Direction of its last approach at `t`: 1 upwards, -1 downwards."""
        return round(self.leg(t).course.direction)

    def moving(self, t: float) -> bool:
        """Whether the motion profile is still running; the creep after it does not count."""
        return t < self._legs[-1].end

    def _table(self, encoder: float, leg: Leg, t: float) -> float:
        if self._faithful and not self._slips:
            return encoder
        true = encoder + leg.trail(t)
        for error in self._errors:
            true += error.error_deg(encoder)
        for since, amount in self._slips:
            if since <= t:
                true += amount
        return true

    def true_deg(self, t: float) -> float:
        """True angle of the table, degrees."""
        leg = self.leg(t)
        return self._table(leg.angle(t), leg, t)

    def seen_deg(self, t: float) -> float:
        """The table's angle behind the lag of the pendulum, degrees."""
        last = self._legs[-1]
        leg = last if last.start <= t else self.leg(t)
        return self._table(leg.seen(t), leg, t)

    def move(self, target: float, speed: float, acceleration: float) -> None:
        """Move to an encoder angle; both speed (deg/s) and acceleration (deg/s^2) must be positive."""
        if not (speed > 0.0 and acceleration > 0.0):
            raise ValueError(f"speed {speed} and acceleration {acceleration} must be positive")
        if self.told is not None:
            self.told("target_deg", target)
        if self._world.now() < self._stalled_until:
            return
        now = self._interrupt()
        self._deceleration = acceleration
        leg = self.leg(now)
        angle, moving_at = leg.angle(now), leg.speed(now)
        if overshoots(angle, moving_at, target, acceleration):
            self._append(now, stopping(angle, moving_at, acceleration))
            leg, moving_at = self._legs[-1], 0.0
            now, angle = leg.end, leg.course.target
        m = self._mechanics
        reversing = (target - angle) * leg.course.direction < 0.0
        wait = sqrt(2.0 * m.gear_play_deg / acceleration) if reversing else 0.0
        self._append(now, towards(angle, moving_at, target, speed, acceleration, m.creep_deg, wait))
        self._turned(target)
        if self.told is not None:
            self.told("reached_deg", target, self._legs[-1].end - self._world.now())

    def stop(self, deceleration_deg_per_s2: float | None = None) -> None:
        """Stop with this deceleration, deg/s^2; by default that of the last move."""
        now = self._interrupt()
        leg = self.leg(now)
        if now < leg.end:
            angle, speed = leg.angle(now), leg.speed(now)
            deceleration = deceleration_deg_per_s2 or self._deceleration
            still = Course(leg.course.direction, (), angle, 0.0)
            self._append(now, stopping(angle, speed, deceleration) if speed else still)
            self._turned(self._legs[-1].course.target)
            if self.told is not None:
                self.told("stopped_deg", self._legs[-1].course.target)

    def stall(self, until: float) -> None:
        """Stall at the present angle until a virtual time, whatever is commanded."""
        now = self._interrupt()
        leg = self.leg(now)
        if now < leg.end:
            self._append(now, Course(leg.course.direction, (), leg.angle(now), 0.0))
            self._turned(leg.angle(now))
            if self.told is not None:
                self.told("stalled_deg", leg.angle(now))
        self._stalled_until = until

    def slip(self, amount_deg: float, *, encoder: bool) -> None:
        """The table jumps, with its encoder or relative to it; a running motion ends."""
        now = self._world.now()
        if not encoder:
            self._slips.append((now, amount_deg))
            return
        now = self._interrupt()
        leg = self.leg(now)
        self._append(now, Course(1.0 if amount_deg >= 0 else -1.0, (), leg.angle(now) + amount_deg, 0.0))
        self._turned(leg.angle(now) + amount_deg)

    def _interrupt(self) -> float:
        """Discard future moves, and very old ones; returns the time."""
        now = self._world.now()
        legs = [leg for leg in self._legs if leg.start <= now]
        while len(legs) > 1 and legs[1].start < now - _REMEMBERED_S:
            del legs[0]
        self._legs = legs
        return now

    def _turned(self, target: float) -> None:
        """Note a motion that begins now and ends with the last leg."""
        now = self._world.now()
        self.turns.cut(now, self.encoder_deg(now))
        self.turns.set(now, target, max(0.0, self._legs[-1].end - now))

    def _append(self, at: float, course: Course) -> None:
        last = self._legs[-1]
        self._legs.append(Leg(at, last.angle(at), last.seen(at), last.trail(at), course, self._mechanics))


class HeadMechanics:
    """Both axes of the head, by name ("pitch", "roll").

    Args:
        world: its `now()` is the time at which a command takes effect.
        truth: the head's ordinary mechanics.
        backlash: play behind the encoders.
        errors: harmonics of the head.
        pendulum_s: time constant of the sensors' pendulum.
    """

    def __init__(
        self, world: Now, truth: HeadTruth, backlash: Backlash, errors: Sequence[HeadError], pendulum_s: float
    ) -> None:
        creep_s = truth.creep_time_constant_s
        if abs(creep_s - pendulum_s) < 1e-6 * pendulum_s:  # the closed form of the lag divides by their difference
            creep_s *= 1.0 + 1e-6
        starts = {"pitch": truth.start_pitch_deg, "roll": truth.start_roll_deg}
        self.axes = {
            axis: Axis(
                world,
                starts[axis],
                Mechanics(
                    pendulum_s,
                    truth.creep_arcsec * ARCSEC,
                    creep_s,
                    truth.backlash_arcsec * ARCSEC,
                    backlash.play_deg(axis),
                ),
                [error for error in errors if error.axis == axis],
            )
            for axis in AXES
        }

    def move(self, axis: str, target_deg: float, speed: float, accel: float) -> None:
        """Start moving to an encoder angle at up to `speed` deg/s with `accel` deg/s^2."""
        self.axes[axis].move(target_deg, speed, accel)

    def stop(self, axis: str, decel: float | None = None) -> None:
        """Stop with `decel` deg/s^2; by default the last move's acceleration."""
        self.axes[axis].stop(decel)

    def encoder_deg(self, axis: str, t: float) -> float:
        """Encoder angle from its mark, before quantisation."""
        return self.axes[axis].encoder_deg(t)

    def speed_deg_per_s(self, axis: str, t: float) -> float:
        """Encoder speed; zero during the creep."""
        return self.axes[axis].speed_deg_per_s(t)

    def true_deg(self, axis: str, t: float) -> float:
        """True angle of the table, with head errors and hidden play."""
        return self.axes[axis].true_deg(t)

    def moving(self, axis: str, t: float) -> bool:
        """Whether the motion profile is running; the creep after it does not count."""
        return self.axes[axis].moving(t)
