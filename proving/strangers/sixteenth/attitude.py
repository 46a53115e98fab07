"""Accelerometers in one package, pitched and rolled in the gravity of the Earth."""

import numpy as np

from .common import NOISES, Lab, Output, Register, World, chance, held, make, ramped, walk

NUMBER = 1
__all__ = ["ABOUT", "EFFECTS", "NOISES", "PAIRS", "table"]


def in_package(v, pitch, roll):
    """A vector of the room (ahead, right, down) in the axes of a package that is pitched up and then rolled."""
    p, r = np.deg2rad(pitch), np.deg2rad(roll)
    ahead = np.cos(p) * v[0] - np.sin(p) * v[2]
    down = np.sin(p) * v[0] + np.cos(p) * v[2]
    return np.stack([ahead, np.cos(r) * v[1] + np.sin(r) * down, np.cos(r) * down - np.sin(r) * v[1]], axis=1)


def upward(pitch, roll):
    """What accelerometers at rest feel: one g upwards."""
    return in_package((0.0, 0.0, -1.0), pitch, roll)


def across(g, axis):
    """A unit vector at right angles to an axis."""
    v = np.cross(axis, g.standard_normal(3))
    return v / np.linalg.norm(v)


def plan(g, style, many, reach):
    k = np.arange(many)
    if style == "scattered":
        return g.uniform(-reach, reach, many), g.uniform(0.0, 360.0, many)
    if style == "meridians":  # some rolls, at each a sweep of pitch up or down
        rolls = int(g.integers(7, 12))
        sweep = -(-many // rolls)
        place = (k % sweep + g.uniform(0.15, 0.85, many)) / sweep * 2 - 1
        turn = k // sweep
        order = g.permutation(rolls)
        return reach * place * np.where(turn % 2, -1, 1), (order[turn] + g.random()) * 360.0 / rolls % 360
    high = np.sin(np.deg2rad(reach)) * (1 - (2 * k + 1) / many)  # evenly over the sphere, in any order
    mix = g.permutation(many)
    return np.rad2deg(np.arcsin(high))[mix], (g.uniform(0, 360) + k * 137.50776)[mix] % 360


def laboratory(seed):
    g = chance(NUMBER, seed, 0)
    times = int(g.integers(3, 6))
    many = int(g.integers(110, 1300 // times if times > 4 else 260))
    reach = float(g.choice([42.0, 50.0, 60.0, 75.0, 85.0]))
    style = str(g.choice(["scattered", "meridians", "even"]))
    parts = [plan(g, style, many, reach) for _ in range(times)]
    resolution = int(g.integers(2, 5))
    pitch = np.round(np.concatenate([p for p, _ in parts]), resolution)
    roll = np.round(np.concatenate([r for _, r in parts]), resolution) % 360
    n = times * many
    rep = np.arange(n) // many
    opens = np.arange(n) % many == 0
    gaps = g.uniform(35, 90) * g.uniform(0.85, 1.4, n) + 0.15 * np.abs(np.diff(pitch, prepend=pitch[0]))
    gaps[opens] += 3600 * g.uniform(1.0, 9.0, times)
    t = np.round(np.cumsum(gaps), 1)
    clock = np.arange(0.0, t[-1] + 120, 60.0)
    room = g.uniform(0.6, 1.8) * np.cos(2 * np.pi * (clock / 86400 - g.random()))
    room = room + g.uniform(0.2, 0.5) * walk(g, clock, 3600 * g.uniform(0.5, 1.2))
    celsius = np.interp(t, clock, ramped(g.uniform(19.5, 25) + room, clock, 900.0))
    feel = upward(pitch, roll)
    sensors = 1 + int(g.choice(3, p=[0.45, 0.25, 0.3]))
    if g.random() < 0.5:  # along the package, with small errors; the first is across the roll axis
        axes = np.eye(3)[[1, 0, 2] if g.random() < 0.5 else [2, 0, 1]] * g.choice([-1.0, 1.0], 3)[:, None]
        axes = axes + g.normal(0, 0.012, (3, 3))
    else:
        axes = np.linalg.qr(g.standard_normal((3, 3)))[0]
        while np.abs(axes).min() < 0.15:
            axes = np.linalg.qr(g.standard_normal((3, 3)))[0]
    axes = axes / np.linalg.norm(axes, axis=1)[:, None]
    volts = float(g.choice([0.6, 1.25, 2.5, 6.0]))
    sd = volts * float(g.choice([6e-5, 1.5e-4, 5e-4]))
    restless = float(g.choice([0.0, 1.0]))  # may each replication have parameters of its own?
    outputs, gains = [], []
    for j in range(sensors):
        gains.append(volts * g.uniform(0.92, 1.08))
        own = sd * (1.0 if j == 0 else g.uniform(0.75, 1.35))
        new = restless * g.normal(0, own, (times, 4))[rep]
        shift = new[:, 0] + (new[:, 1:] * feel).sum(axis=1)
        outputs.append(Output("xyz"[j] + "_V", volts * g.normal(0, 0.01) + gains[j] * feel @ axes[j], own, shift))
    columns = [
        ("replicate", ["%d" % k for k in rep + 1]),
        ("order", ["%d" % k for k in range(1, n + 1)]),
        ("elapsed_s", ["%.1f" % v for v in t]),
        ("pitch_deg", ["%.*f" % (resolution, v) for v in pitch]),
        ("roll_deg", ["%.*f" % (resolution, v) for v in roll]),
        ("sensor_temperature_degC", ["%.3f" % v for v in celsius + g.normal(0, 0.003, n)]),
    ]
    world = World(
        n=n, rep=rep, times=times, many=many, t=t, pitch=pitch, roll=roll, feel=feel, axes=axes, gains=gains,
        celsius=celsius, usual=float(np.median(np.diff(t))),
    )  # fmt: skip
    return Lab(columns, outputs, np.column_stack([feel, np.ones(n)]), rep, t, world)


EFFECTS = Register()


@EFFECTS(
    "Everyday. The sensor's pendulum gives way under the acceleration that it measures, and so turns its own sensitive"
    " axis towards its pendulum axis. Depends on pitch and roll: gravity along the sensor times gravity along one"
    " direction across it. Matters between the axes, and not where either of the two is zero.",
    both=True,
)
def pendulum_swing(w, g, j):
    hanging = across(g, w.axes[j])
    return w.gains[j] * (w.feel @ w.axes[j]) * (w.feel @ hanging)


@EFFECTS(
    "Everyday. The graduated circle of the roll axis is not centred, and has one reading head: the roll is wrong by a"
    " sine with one period in a turn. Depends on roll, and on pitch as the sensor sees roll (less at large pitch)."
    " Matters for sensors across the roll axis.",
    bench=True,
)
def circle_off_centre(w, g, j):
    wrong = 0.01 * np.sin(np.deg2rad(w.roll - g.uniform(0, 360)))
    return w.gains[j] * (upward(w.pitch, w.roll + wrong) - w.feel) @ w.axes[j]


@EFFECTS(
    "Everyday. The magnet of the sensor weakens or the flexure softens as it warms: the sensitivity goes with"
    " temperature. Depends on the sensor temperature times gravity along the sensor. Matters while the room changes"
    " within a replication.",
    both=True,
)
def warm_magnet(w, g, j):
    return w.gains[j] * (w.feel @ w.axes[j]) * (w.celsius - 22.0)


@EFFECTS(
    "Everyday. The reading begins before the suspension has come to rest: a part of the attitude before is still in it,"
    " the less the longer the wait. Depends on the change of gravity along the sensor since the row before (move of"
    " pitch and roll) and on the time between the rows. Matters after large moves and short waits.",
)
def short_rest(w, g, j):
    along = w.feel @ w.axes[j]
    return w.gains[j] * (held(along, w.t, w.usual * g.uniform(0.35, 0.8)) - along)


@EFFECTS(
    "Everyday. In one replication the package slips in its clamp at a large move, and stays so: all sensors are turned"
    " by the same small rotation from then on. Depends on time (before and after one row) times pitch and roll."
    " Matters in that replication only, as each has its own parameters.",
    bench=True,
)
def clamp_slips(w, g, j):
    begin = int(g.integers(w.times)) * w.many
    window = np.arange(begin + int(0.35 * w.many), begin + int(0.65 * w.many))
    change = np.linalg.norm(w.feel[window] - w.feel[window - 1], axis=1)
    row = window[np.argmax(change)]
    rotation = across(g, w.axes[0]) + g.uniform(-0.5, 0.5) * w.axes[0]
    return np.where(np.arange(w.n) >= row, w.gains[j] * w.feel @ np.cross(rotation, w.axes[j]), 0.0)


@EFFECTS(
    "Unlisted. The motor of the pitch axis holds the unbalanced arm by its current. Its heat, the square of the moment,"
    " comes through the bracket to one side of the sensor some minutes late, where the thermometer is not. Depends on"
    " pitch (squared cosine about a slightly turned level), on the pitches before, and on time. Matters where the arm"
    " stays level, or comes from there.",
    both=True,
)
def motor_holds(w, g, j):
    moment = np.cos(np.deg2rad(w.pitch - g.uniform(-15, 15)))
    warm, tau = np.empty(w.n), w.usual * g.uniform(2.0, 5.0)
    for k in range(w.times):
        rows = slice(k * w.many, (k + 1) * w.many)
        warm[rows] = held(moment[rows] ** 2, w.t[rows], tau, begin=0.0)
    return warm


@EFFECTS(
    "Unlisted. The restoring magnet of the sensor is not shielded. The field of the Earth, which dips into the ground"
    " towards north, adds a force by its part along one direction in the package. Its vertical part looks like gravity,"
    " its horizontal part does not. Depends on pitch and roll: cosine of pitch, cosine and sine of roll, and these"
    " times the sine of pitch. Matters always.",
)
def earth_magnet(w, g, j):
    dip, north = np.deg2rad(g.uniform(50, 72)), g.uniform(0, 2 * np.pi)
    field = (np.cos(dip) * np.cos(north), np.cos(dip) * np.sin(north), np.sin(dip))
    moment = g.standard_normal(3)
    return in_package(field, w.pitch, w.roll) @ (moment / np.linalg.norm(moment))


@EFFECTS(
    "Unlisted. A bubble in the damping oil goes to the higher of two ends of the cell and lifts that side of the"
    " pendulum. It sticks until the cell is tilted enough. Depends on the sign of gravity along one direction across"
    " the sensor (pitch and roll); near its balance on where it was before (move). Matters always: two values.",
    both=True,
)
def bubble(w, g, j):
    tilt = w.feel @ across(g, w.axes[j])
    sticks = g.uniform(0.1, 0.3)
    end, ends = np.sign(tilt[0]), np.empty(w.n)
    for i, high in enumerate(tilt):
        if abs(high) > sticks:
            end = np.sign(high)
        ends[i] = end
    return ends


ABOUT = EFFECTS.about
PAIRS = [("circle_off_centre", "warm_magnet"), ("pendulum_swing", "clamp_slips"), ("short_rest", "earth_magnet")]


def table(effects, seed, size, noise="white"):
    return make(NUMBER, laboratory(seed), EFFECTS, effects, seed, size, noise)
