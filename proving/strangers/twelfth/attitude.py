"""Accelerometers or inclinometers on a two-axis stage."""
from types import SimpleNamespace
import numpy as np
from .common import NOISES, walk  # noqa: F401


def laboratory(r):
    reps = int(r.integers(3, 7))
    fixed = r.random() < 0.5
    sets = []
    if fixed:
        dp = float(r.choice([15.0, 20.0, 22.5, 30.0]))
        top = float(r.choice([60.0, 75.0, 90.0]))
        pitch = np.arange(-np.floor(top / dp), np.floor(top / dp) + 1) * dp
        roll = np.arange(0, 360, float(r.choice([30.0, 36.0, 45.0])))
        p, q = [v.ravel() for v in np.meshgrid(pitch, roll, indexing="ij")]
        if r.random() < 0.4:
            q = np.where(q > 180, q - 360, q)
        way = r.choice(["drawn", "snake", "same"])
        one = r.permutation(len(p))
        snake = np.array([i * len(roll) + (j if i % 2 == 0 else len(roll) - 1 - j)
                          for i in range(len(pitch)) for j in range(len(roll))])
        for k in range(reps):
            at = {"drawn": r.permutation(len(p)), "snake": snake if k % 2 == 0 else snake[::-1], "same": one}[str(way)]
            sets.append((p[at] + r.normal(0, 0.01, len(p)), q[at] + r.normal(0, 0.01, len(p))))
        low = int(np.ceil(310 / len(p)))
        while len(sets) < low:
            sets.append(sets[len(sets) % reps])
        sets = sets[:max(3, 1480 // len(p))]
    else:
        m = int(r.integers(max(80, -(-310 // reps)), 210))
        top = r.uniform(60, 88)
        for k in range(reps):
            sets.append((np.degrees(np.arcsin(r.uniform(-1, 1, m) * np.sin(np.radians(top)))), r.uniform(0, 360, m)))
    rep = np.concatenate([np.full(len(p), k + 1) for k, (p, q) in enumerate(sets)])
    pitch = np.round(np.concatenate([p for p, q in sets]), 3)
    roll = np.round(np.concatenate([q for p, q in sets]), 3)
    n = len(rep)
    new = np.r_[True, np.diff(rep) > 0]
    dwell = r.uniform(35, 110)
    gap = dwell * r.uniform(0.85, 1.25, n) + 0.15 * np.abs(np.r_[0, np.diff(pitch)]) + 0.05 * np.abs(np.r_[0, np.diff(roll)])
    pause = r.uniform(1500, 40000)
    gap[new] = pause * r.uniform(0.8, 1.3, int(new.sum()))
    gap[0] = dwell
    t = np.round(np.cumsum(gap), 1)
    temp = r.uniform(19, 26) + walk(r, t, r.uniform(3000, 12000), r.uniform(0.2, 1.2)) + \
        r.uniform(0.1, 0.8) * np.sin(2 * np.pi * t / 86400 + r.uniform(0, 6.28))
    temp = np.round(temp + r.normal(0, 0.02, n), 2)
    a, b = np.radians(pitch), np.radians(roll)
    g = np.column_stack([np.sin(a), -np.sin(b) * np.cos(a), -np.cos(b) * np.cos(a)])
    dg = np.column_stack([np.cos(a), np.sin(b) * np.sin(a), np.cos(b) * np.sin(a)])
    sensors = int(r.choice([1, 2, 3, 3]))
    axes = np.eye(3) + r.normal(0, 0.006, (3, 3))
    sens = r.uniform(0.8, 5.5) * r.uniform(0.9, 1.1, 3)
    sd = float(10 ** r.uniform(-3.7, -2.3)) * sens
    differ = r.random() < 0.5
    clean = {}
    for j, name in enumerate(("x_V", "y_V", "z_V")[:sensors]):
        c = sens[j] * np.r_[r.normal(0, 0.02), axes[j]]
        y = np.empty(n)
        for k in np.unique(rep):
            at = rep == k
            ck = c + differ * 1.5 * sd[j] * r.standard_normal(4)
            y[at] = ck[0] + g[at] @ ck[1:]
        clean[name] = y

    def error(r, draw, noise, level):
        return draw(r, n, level) * (np.sqrt(1 - 1 / 12) if noise == "rounded" else 1.0)

    columns = {"replicate": (rep, None), "order": (np.concatenate([np.arange(1, np.sum(rep == k) + 1) for k in np.unique(rep)]), None),
               "elapsed_s": (t, 1), "pitch_deg": (pitch, 3), "roll_deg": (roll, 3), "sensor_temperature_degC": (temp, 2)}
    return SimpleNamespace(columns=columns, responses=clean, error_sds=list(sd[:sensors]), options=[], groups=rep, error=error,
                           model=np.column_stack([np.ones(n), g]), g=g, dg=dg, axes=axes, sensors=sensors, t=t, new=new, a=a, b=b,
                           temp=temp, along=g @ axes.T)


def around(r, s, low, high):
    """A coefficient of the first sensor, and of its sisters of the same make."""
    c = r.uniform(low, high) * r.choice([-1, 1])
    return c * np.r_[1.0, r.uniform(0.6, 1.3, 2)][:s]


def warm_hinge(lab, r):
    body = np.empty(len(lab.t))
    tau, state = r.uniform(150, 500), lab.temp[0]
    for i in range(len(body)):
        f = np.exp(-(lab.t[i] - lab.t[i - 1]) / tau) if i else 0.0
        state = lab.temp[i] + f * (state - lab.temp[i])
        body[i] = state
    d = body - 20.0
    return (d + r.uniform(-0.02, 0.02) * d * d)[:, None] * around(r, lab.sensors, 1, 1)[None, :]


def off_centre_gap(lab, r):
    out = []
    for j, c in enumerate(around(r, lab.sensors, 0.05, 0.12)):
        s = lab.along[:, j]
        up, down = 1 / (1 - c) ** 2, 1 / (1 + c) ** 2
        k = 0.3                                   # volts for one g, in bias voltages
        # up (1 + v)^2 - down (1 - v)^2 = 4 k s
        p, q, w = up - down, 2 * (up + down), up - down - 4 * k * s
        v = -2 * w / (q + np.sqrt(q * q - 4 * p * w))
        out.append(v / k - s)
    return np.column_stack(out)


def hinge_turns(lab, r):
    out = []
    for j, k in enumerate(around(r, lab.sensors, 0.01, 0.03)):
        s = lab.along[:, j]
        turn = r.uniform(0, 2 * np.pi)
        e1, e2 = np.eye(3)[(j + 1) % 3], np.eye(3)[(j + 2) % 3]
        down = lab.g @ (np.cos(turn) * e1 + np.sin(turn) * e2)
        d = k * s
        out.append(s * np.cos(d) + down * np.sin(d) - s)
    return np.column_stack(out)


def stage_sags(lab, r):
    far, off, phase = 1.0, r.uniform(0.9, 2.0), r.uniform(0, 2 * np.pi)
    torque = far * np.cos(lab.a) - off * np.cos(lab.b + phase) * np.sin(lab.a)
    bend = -1e-3 * torque
    return bend[:, None] * (lab.dg @ lab.axes.T)[:, :lab.sensors]


def plates_take_charge(lab, r):
    out = []
    fill, empty = r.uniform(1200, 3500), r.uniform(4000, 12000)
    for j, c in enumerate(around(r, lab.sensors, 1, 1)):
        s = lab.along[:, j]
        q = np.zeros(len(s))
        state = 0.0
        for i in range(1, len(s)):
            dt = lab.t[i] - lab.t[i - 1]
            if lab.new[i]:                        # stage parked, servo off
                state *= np.exp(-dt / empty)
            else:
                for _ in range(4):
                    state += dt / 4 * (s[i] * (1 - np.sign(s[i]) * state) / fill - state / empty)
            q[i] = state
        out.append(c * (q * s + 0.3 * q))
    return np.column_stack(out)


def beams_lock_in(lab, r):
    out = []
    wide = r.uniform(0.06, 0.15)
    for j, c in enumerate(around(r, lab.sensors, 0.1, 0.4)):
        d = lab.along[:, j] - c
        beat = np.sign(d) * np.sqrt(np.maximum(d * d - wide * wide, 0.0))
        out.append(beat - d)
    return np.column_stack(out)


def weight_on_the_floor(lab, r):
    mark, sight = r.uniform(0, 2 * np.pi), np.radians(r.uniform(100, 125))
    side, where = np.empty(len(lab.t)), 1.0
    for i in range(len(side)):
        if lab.new[i]:
            where = float(r.choice([-1, 1]))
        view = mark if where > 0 else mark + np.pi
        if np.abs((lab.b[i] - view + np.pi) % (2 * np.pi) - np.pi) > sight:
            where = -where
        side[i] = where
    cross = np.column_stack([0 * lab.a, -np.cos(lab.b) * np.cos(lab.a), np.sin(lab.b) * np.cos(lab.a)])
    tilt = lab.dg + r.uniform(-0.2, 0.2) * cross
    return side[:, None] * (tilt @ lab.axes.T)[:, :lab.sensors]


def shared_plus_rail(lab, r):
    amount = r.uniform(0.7, 1.3, 3)
    turn = np.sign(r.standard_normal(3))
    drawn = np.maximum(lab.along * turn, 0.0) @ amount
    return drawn[:, None] * around(r, lab.sensors, 1, 1)[None, :]


EFFECTS = {f.__name__: f for f in (warm_hinge, off_centre_gap, hinge_turns, stage_sags, plates_take_charge, beams_lock_in,
                                   weight_on_the_floor, shared_plus_rail)}
PAIRS = [("stage_sags", "shared_plus_rail"), ("warm_hinge", "plates_take_charge"), ("off_centre_gap", "weight_on_the_floor")]
ABOUT = {
    "warm_hinge": "Everyday. The zero moves with the temperature of the hinge, which follows the recorded temperature some minutes late, "
                  "a little curved. Depends on: temperature (its change in a replication); matters when the room wanders.",
    "off_centre_gap": "Everyday. The plate of a capacitive servo stands off the middle of its gap; the two forces go with the square of "
                      "the voltages, so the balance is curved. Depends on: gravity along the sensor, an even curve; matters at large tilt.",
    "hinge_turns": "Everyday. The pendulum gives a little under its load and its sensitive axis turns towards the pendulum's own axis: "
                   "product of gravity along the sensor and across it. Depends on: gravity, pitch and roll.",
    "stage_sags": "Everyday. The arm and the pitch drive bend under the weight of the payload, which hangs beside the roll axis: the true "
                  "pitch differs by the torque. Depends on: pitch and roll.",
    "plates_take_charge": "Unlisted. The insulator of the servo plates traps charge under the servo voltage, for an hour, until full; it gives "
                          "a force with the present voltage. Depends on: gravity along the sensor in the past hour times gravity now; time, order.",
    "beams_lock_in": "Unlisted. Two vibrating beams whose frequency difference is the reading pull each other into step when they are near: "
                     "a dead band and a hyperbola around one value. Depends on: gravity along the sensor.",
    "weight_on_the_floor": "Unlisted. The observer must see the index of the roll circle and walks round the stage when it has turned away; "
                           "his weight tilts the floor to his side. He stays while he can see it. Depends on: roll (with memory), pitch, order.",
    "shared_plus_rail": "Unlisted. Each servo of the triad draws current from the plus rail only when it pushes one way; the lead's drop moves "
                        "the zero of all. Depends on: half-waves of gravity along all three sensors, seen by pitch and roll.",
}
