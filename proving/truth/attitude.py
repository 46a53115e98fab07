"""A bench for pitch and roll: gravity, rotations and physical causes, none of the fitter's formulas.

Follows appendix A of NASA/TP-1999-209835: a package is turned by pitch, then by roll; a sensor is turned in the
package by its azimuth and coning angle and reads the component of gravity along its own axis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.procedures.attitude.data import AttitudeData

Array = NDArray[np.float64]
Outputs = dict[str, Array]
"""Volts by column name."""

GRAVITY = np.array([0.0, 0.0, -1.0])
LEVEL_FIELD = np.array([0.8, 0.6, 0.0])


def turn_pitch(a: Array) -> Array:
    """(n, 3, 3), eq. (110); radians."""
    c, s, o, i = np.cos(a), np.sin(a), np.zeros_like(a), np.ones_like(a)
    return np.stack([np.stack([c, o, -s], -1), np.stack([o, i, o], -1), np.stack([s, o, c], -1)], -2)


def turn_roll(r: Array) -> Array:
    """(n, 3, 3), eq. (111); radians."""
    c, s, o, i = np.cos(r), np.sin(r), np.zeros_like(r), np.ones_like(r)
    return np.stack([np.stack([i, o, o], -1), np.stack([o, c, s], -1), np.stack([o, -s, c], -1)], -2)


def turn_yaw(y: Array) -> Array:
    """(n, 3, 3), eq. (112); radians."""
    c, s, o, i = np.cos(y), np.sin(y), np.zeros_like(y), np.ones_like(y)
    return np.stack([np.stack([c, s, o], -1), np.stack([-s, c, o], -1), np.stack([o, o, i], -1)], -2)


@dataclass(frozen=True)
class Sensor:
    """True sensor; the sign of a temperature coefficient or drift is the sign it has in the output."""

    axis: str
    b: float = 0.002
    S: float = 5.0
    Omega_deg: float = 0.6
    A_deg: float = 70.0
    b_per_degC: float = 0.0
    S_per_degC: float = 0.0
    b_per_h: float = 0.0
    S_per_h: float = 0.0
    quadratic: float = 0.0
    cubic: float = 0.0
    cross: float = 0.0
    b_step: float = 0.0
    """At the recorded interruption."""
    S_step: float = 0.0
    b_unrecorded: float = 0.0
    """From `Bench.unrecorded_h` on."""
    Omega_deg_per_degC: float = 0.0
    b_per_lagged_degC: float = 0.0
    b_per_degC_per_h: float = 0.0
    b_daily: float = 0.0
    b_pitch_side: float = 0.0
    """From one side of approach to the other."""
    b_roll_side: float = 0.0
    creep: float = 0.0
    """Share of the change of acceleration since the point before that is still to come."""

    asymmetry: float = 0.0
    """By which the sensitivity is larger for positive acceleration than the mean of both."""
    sticks_g: float = 0.0
    """Half of the zone about null in which it does not answer."""
    saturates: float = 0.0
    """Share of the sensitivity that is missing beyond 0.8 g."""
    magnetic_V: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Answer to the level field of the laboratory along the axes of the package."""
    S_since: float = 0.0
    """Change of sensitivity from replication `Bench.since` on."""

    def bent(self, u: Array) -> Array:
        """(n,) g that it makes of the acceleration along its axis, by stiction, asymmetry and saturation."""
        out: Array = u + self.asymmetry * np.abs(u)
        if self.sticks_g:
            out = out - np.clip(u, -self.sticks_g, self.sticks_g)
        return out - self.saturates * np.sign(u) * np.clip(np.abs(u) - 0.8, 0.0, None)

    def gravity_along(self, g: Array, warmth: Array | float = 0.0) -> Array:
        """(n,) component along the sensitive axis, in g; eqs. (114) to (116)."""
        if self.Omega_deg_per_degC:
            aside: Array = replace(self, Omega_deg=self.Omega_deg + 1.0, Omega_deg_per_degC=0.0).gravity_along(g)
            still = replace(self, Omega_deg_per_degC=0.0).gravity_along(g)
            return still + (aside - still) * self.Omega_deg_per_degC * warmth
        A, Om = np.radians(np.array([self.A_deg])), np.radians(np.array([self.Omega_deg]))
        if self.axis == "x":
            turned = turn_yaw(Om) @ turn_roll(A)
        elif self.axis == "y":
            turned = turn_roll(Om) @ turn_pitch(A)
        else:
            turned = turn_pitch(Om) @ turn_yaw(A)
        along: Array = g @ turned[0]["xyz".index(self.axis)]
        return along


@dataclass(frozen=True)
class Bench:
    """What is true of head, package and room."""

    sensors: tuple[Sensor, ...] = (Sensor("x"), Sensor("y", b=-0.003, S=5.1), Sensor("z", b=0.001, S=4.9))
    sigma_deg: float = 1.5e-4
    offset_sd: float = 0.0
    """Of each replication's own offset, in units of the reading's standard deviation."""
    offset_walk: bool = False
    wander: float = 0.0
    """Of each sensor's offset through the run: sd of a random walk at its end, in readings' standard deviations."""
    jitter_deg: float = 0.0
    """Of the head's angles from one point to the next; all sensors see it."""
    compliance: Mapping[tuple[str, str], float] = field(default_factory=dict)
    """Degrees the package turns about an axis for 1 g along another: {("y", "x"): 4e-4}."""
    pitch_backlash_deg: float = 0.0
    roll_backlash_deg: float = 0.0
    pitch_error_deg: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """Of the head's own scale: sin, cos once per turn, sin, cos twice per turn."""
    roll_error_deg: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    pitch_gear_deg: tuple[float, float] = (0.0, 0.0)
    """Sine and cosine of `pitch_teeth` periods a turn."""
    pitch_teeth: float = 5.0
    roll_gear_deg: tuple[float, float] = (0.0, 0.0)
    roll_teeth: float = 4.0
    pitch_zero_deg: float = 0.0
    lean_deg: float = 0.0
    """Of the pitch axis out of the level."""
    not_square_deg: float = 0.0
    """Of the roll axis to the pitch axis."""
    wobble_deg: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """Pitch error: sin, cos once per turn of roll, sin, cos twice."""
    pitch_unsettled: float = 0.0
    """Share of the last move that is still to come."""
    roll_unsettled: float = 0.0
    slip_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Turn of the package about its axes from replication `since` on."""
    pitch_shift_deg: float = 0.0
    """Of the head's zero, from replication `since` on."""
    slip_unrecorded_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Turn of the package about its axes from `unrecorded_h` on."""
    scale_per_g: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Share by which all outputs grow for 1 g along each axis of the package."""
    cable_deg: tuple[float, float] = (0.0, 0.0)
    """Error of roll and of pitch for a whole turn of roll that winds up the cable."""
    backlash_deg_per_degC: tuple[float, float] = (0.0, 0.0)
    """Of pitch and of roll, about the mean temperature."""
    tilt_deg_per_h: tuple[float, float] = (0.0, 0.0)
    """Of the base of the head, along pitch and sideways."""
    tilt_daily_deg: tuple[float, float] = (0.0, 0.0)
    """Amplitude of the same over a day."""
    since: int = 4
    range_V: tuple[float, float] = (0.0, 0.0)
    """Zero and gain that the voltmeter's upper range has beside those of the lower, up at 1.2 V, down at 1 V."""
    v_squared: float = 0.0
    v_cubed: float = 0.0
    meter_per_h: tuple[float, float] = (0.0, 0.0)
    """Drift of the voltmeter's zero, V/h, and gain, 1/h."""
    unrecorded_h: float = 17.3
    lag_h: float = 1.2
    degC_daily: float = 0.5
    degC_phase: float = 0.9
    hours: float = 28.0

    def temperature(self, hours: Array) -> Array:
        """Of the room, degC."""
        degC: Array = 23.0 + self.degC_daily * np.sin(2 * np.pi * hours / 24.0 + self.degC_phase)
        return degC

    def lagged(self, hours: Array) -> Array:
        """What a body of one time constant has of it, at rest at the start; solved by hand for a sine."""
        w, tau = 2 * np.pi / 24.0, self.lag_h
        behind = self.degC_daily / np.hypot(1, w * tau) * np.sin(w * hours + self.degC_phase - np.arctan(w * tau))
        start = self.degC_daily * np.sin(self.degC_phase)
        first = self.degC_daily / np.hypot(1, w * tau) * np.sin(self.degC_phase - np.arctan(w * tau))
        degC: Array = 23.0 + behind + (start - first) * np.exp(-hours / tau)
        return degC

    def outputs(
        self,
        pitch_deg: Array,
        roll_deg: Array,
        temperature: Array,
        hours: Array,
        pitch_side: Array,
        roll_side: Array,
        block: NDArray[Any],
        before: Sequence[Array] | None = None,
        replicate: NDArray[Any] | None = None,
    ) -> Outputs:
        """Noise-free outputs in volts, by column name; `before` are pitch and roll of the points before."""
        replicate = np.ones_like(pitch_deg) if replicate is None else replicate
        pitch_before, roll_before = (pitch_deg, roll_deg) if before is None else before
        late = (replicate >= self.since).astype(float)
        still = pitch_deg + self.pitch_unsettled * (pitch_before - pitch_deg) + self.pitch_shift_deg * late
        turned = roll_deg + self.roll_unsettled * (roll_before - roll_deg)
        a = _head(still, self.pitch_error_deg) - np.radians(self.pitch_backlash_deg) * pitch_side / 2
        r = _head(turned, self.roll_error_deg) - np.radians(self.roll_backlash_deg) * roll_side / 2
        a = a + _teeth(pitch_deg, self.pitch_teeth, self.pitch_gear_deg)
        r = r + _teeth(roll_deg, self.roll_teeth, self.roll_gear_deg)
        a = a + np.radians(self.pitch_zero_deg) + _head(roll_deg, self.wobble_deg) - np.radians(roll_deg)
        warm, passed = temperature - temperature.mean(), (hours >= self.unrecorded_h).astype(float)
        a = a - np.radians(self.backlash_deg_per_degC[0]) * warm * pitch_side / 2
        r = r - np.radians(self.backlash_deg_per_degC[1]) * warm * roll_side / 2
        r, a = (one + np.radians(c) * roll_deg / 360.0 for one, c in zip((r, a), self.cable_deg, strict=True))
        day = np.sin(np.pi / 12 * hours + 1.1)
        ahead, sideways = (
            np.radians(drift * (hours - 14.0) + daily * day)
            for drift, daily in zip(self.tilt_deg_per_h, self.tilt_daily_deg, strict=True)
        )
        a = a + ahead
        down = turn_roll(np.radians(self.lean_deg) + sideways) @ GRAVITY
        square = turn_yaw(np.array([np.radians(self.not_square_deg)]))[0]
        g = np.einsum("nij,jk,nkl,nl->ni", turn_roll(r), square, turn_pitch(a), down)
        field = np.einsum("nij,jk,nkl,l->ni", turn_roll(r), square, turn_pitch(a), LEVEL_FIELD)
        rotation = np.radians(np.array(self.slip_deg)) * late[:, None]
        rotation += np.radians(np.array(self.slip_unrecorded_deg)) * passed[:, None]
        for (about, along), degrees in self.compliance.items():
            rotation["xyz".index(about) == np.arange(3)[None, :].repeat(len(g), 0)] += (
                np.radians(degrees) * g[:, "xyz".index(along)]
            )
        g = g - np.cross(rotation, g)
        back = np.einsum(
            "nij,njk,k->ni", turn_roll(np.radians(roll_before)), turn_pitch(np.radians(pitch_before)), GRAVITY
        )
        out = {}
        for s in self.sensors:
            dt = temperature - 23.0
            u = s.gravity_along(g, dt)
            i = "xyz".index(s.axis)
            if s.creep:
                u = u + s.creep * (s.gravity_along(back) - u)
            gain = s.S * (1 + s.S_per_degC * dt + s.S_per_h * (hours - 14.0))
            gain = (gain + s.S_step * (block > 0) + s.S_since * late) * (1 + g @ np.array(self.scale_per_g))
            straight = s.bent(u)
            straight = straight + s.quadratic * u**2 + s.cubic * u**3
            v = np.full_like(dt, s.b)
            for part in (
                s.b_per_degC * dt,
                s.b_per_lagged_degC * (self.lagged(hours) - 23.0),
                s.b_per_degC_per_h * self.degC_daily * np.pi / 12 * np.cos(np.pi / 12 * hours + self.degC_phase),
                s.b_daily * np.sin(np.pi / 12 * hours + 2.5),
                s.b_per_h * (hours - 14.0),
                s.b_step * (block > 0),
                s.b_unrecorded * (hours >= self.unrecorded_h),
                s.b_pitch_side * pitch_side / 2,
                s.b_roll_side * roll_side / 2,
                field @ np.array(s.magnetic_V),
                gain * (straight + s.cross * g[:, (i + 1) % 3] * g[:, (i + 2) % 3]),
            ):
                v += part
            out[f"{s.axis}_V"] = self._read(v, hours)
        return out

    def _read(self, v: Array, hours: Array) -> Array:
        """What the voltmeter makes of them, in the order they are read."""
        upper, state = np.zeros_like(v), 0.0
        for k, size in enumerate(np.abs(v)):
            state = 1.0 if size > 1.2 else 0.0 if size < 1.0 else state
            upper[k] = state
        zero, gain = self.range_V
        drift = self.meter_per_h[0] * (hours - 14.0) + self.meter_per_h[1] * (hours - 14.0) * v
        return v + upper * (zero + gain * v) + self.v_squared * v**2 + self.v_cubed * v**3 + drift


def _teeth(angle_deg: Array, teeth: float, sin_cos: tuple[float, float]) -> Array:
    t = np.radians(angle_deg * teeth)
    error: Array = np.radians(sin_cos[0] * np.sin(t) + sin_cos[1] * np.cos(t))
    return error


def _head(angle_deg: Array, error_deg: tuple[float, float, float, float]) -> Array:
    t = np.radians(angle_deg)
    s1, c1, s2, c2 = error_deg
    turned: Array = t + np.radians(s1 * np.sin(t) + c1 * np.cos(t) + s2 * np.sin(2 * t) + c2 * np.cos(2 * t))
    return turned


@dataclass(frozen=True)
class Plan:
    """Grid, replications, and the order they are run in: "abba", "same" or "random"."""

    pitch_deg: Array
    roll_deg: Array
    replications: int = 6
    order: str = "abba"
    up_and_down: bool = False


def D1(pitch_max: float, pitch_count: int, roll_count: int = 13, **kw: Any) -> Plan:  # noqa: N802 - the paper's name
    """A grid over +-`pitch_max` deg and the whole turn of roll; the rest is as in `Plan`."""
    return Plan(np.linspace(-pitch_max, pitch_max, pitch_count), np.linspace(-180, 180, roll_count), **kw)


def rows_of(plan: Plan, rng: np.random.Generator) -> Array:
    """pitch, roll, pitch side, roll side, replicate, in executed order."""
    rows = []
    for rep in range(plan.replications):
        path = []
        for i, p in enumerate(plan.pitch_deg):
            rolls = plan.roll_deg if i % 2 == 0 else plan.roll_deg[::-1]
            path += [(p, r, 1, 1 if i % 2 == 0 else -1) for r in rolls]
        if plan.up_and_down:
            path += [(p, r, -ps, -rs) for p, r, ps, rs in reversed(path)]
        if plan.order == "abba" and rep % 4 in (1, 2):
            path = [(p, r, -ps, -rs) for p, r, ps, rs in reversed(path)]
        if plan.order == "random":
            path = [(p, r, *rng.choice([-1, 1], 2)) for p, r, _, _ in (path[k] for k in rng.permutation(len(path)))]
        rows += [(*row, rep + 1) for row in path]
    return np.array(rows, float).T


def volts(bench: Bench, pitch_deg: Array, roll_deg: Array, names: Sequence[str] = ("x_V", "y_V", "z_V")) -> Array:
    """(n, sensors) outputs without noise at rest, at 23 degC."""
    zero = np.zeros_like(pitch_deg)
    out = bench.outputs(pitch_deg, roll_deg, zero + 23.0, zero + 14.0, zero, zero, zero)
    return np.column_stack([out[name] for name in names])


def without_noise(bench: Bench, plan: Plan) -> tuple[AttitudeData, Array]:
    """A run without noise, and its (n, 3) outputs."""
    pitch, roll, _, _, replicate = rows_of(plan, np.random.default_rng(0))
    exact = volts(bench, pitch, roll)
    n = len(pitch)
    outputs = dict(zip(("x_V", "y_V", "z_V"), exact.T, strict=True))
    return AttitudeData(replicate, np.arange(n), np.arange(float(n)), pitch, roll, None, outputs), exact


def simulate(
    bench: Bench, plan: Plan, seed: int, *, break_at: float | None = None, drop: float = 0.0
) -> tuple[AttitudeData, Outputs]:
    """(data, noise-free outputs) of one run; `break_at` starts a second block at that fraction of the run."""
    rng = np.random.default_rng(seed)
    pitch, roll, pitch_side, roll_side, replicate = rows_of(plan, rng)
    n = pitch.size
    hours = np.linspace(0, bench.hours, n)
    block = np.zeros(n, int) if break_at is None else (np.arange(n) >= break_at * n).astype(int)
    temperature = bench.temperature(hours)
    before = [np.concatenate([angle[:1], angle[:-1]]) for angle in (pitch, roll)]
    truth = bench.outputs(pitch, roll, temperature, hours, pitch_side, roll_side, block, before, replicate)
    shaken = bench.outputs(
        pitch + rng.normal(0, bench.jitter_deg, n),
        roll + rng.normal(0, bench.jitter_deg, n),
        temperature,
        hours,
        pitch_side,
        roll_side,
        block,
        before,
        replicate,
    )
    noisy = {}
    for s in bench.sensors:
        sigma = np.radians(bench.sigma_deg) * s.S
        walk = np.cumsum(rng.normal(0, bench.wander * sigma / np.sqrt(n), n))
        offsets = rng.normal(0, bench.offset_sd * sigma, plan.replications)
        if bench.offset_walk:
            offsets = np.cumsum(offsets)
        noisy[f"{s.axis}_V"] = (
            shaken[f"{s.axis}_V"] + walk + rng.normal(0, sigma, n) + offsets[replicate.astype(int) - 1]
        )
    keep = rng.random(n) >= drop
    data = AttitudeData(
        replicate=replicate,
        order=np.arange(n),
        elapsed_s=hours * 3600.0,
        pitch_deg=pitch,
        roll_deg=roll,
        sensor_temperature_degC=temperature,
        outputs=noisy,
        pitch_side=pitch_side,
        roll_side=roll_side,
        block=block,
    )
    return data.take(np.flatnonzero(keep)), {name: v[keep] for name, v in truth.items()}


def told_the_truth(bench: Bench, without: Sequence[Bench], data: AttitudeData, sensor: str) -> Array:
    """(n,) outputs predicted by least squares that knows the true shape of every effect, and only has to size it.

    `without` are the same bench with one of its effects taken out, each; the difference is that effect's shape.
    """
    hours, degC = data.elapsed_s / 3600.0, data.sensor_temperature_degC
    assert degC is not None
    side = data.pitch_side.astype(float), data.roll_side.astype(float)
    recorded = (data.pitch_deg, data.roll_deg, degC, hours, *side, data.block)
    before = data.previous_pitch_deg, data.previous_roll_deg
    full, *less = (b.outputs(*recorded, before, data.replicate)[sensor] for b in (bench, *without))
    a, r = np.radians(data.pitch_deg), np.radians(data.roll_deg)
    model = [np.ones_like(a), np.sin(a), np.cos(a) * np.sin(r), np.cos(a) * np.cos(r)]
    shapes = [full - one for one in less]
    columns = np.column_stack(model + [s / np.linalg.norm(s) for s in shapes if np.linalg.norm(s) > 0])
    predicted: Array = columns @ np.linalg.lstsq(columns, data.outputs[sensor], rcond=None)[0]
    return predicted
