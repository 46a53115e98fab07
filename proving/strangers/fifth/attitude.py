"""Accelerometers and inclinometers on a dividing head."""
import numpy as np

from . import common as c

NOISES = {
    "white": c.white, "student": c.student, "skewed": c.skewed, "contaminated": c.contaminated, "ar1": c.ar1,
    "flicker": c.flicker, "quantized": c.white, "by_tilt": c.by_level, "by_replicate": c.by_block,
}


def design(seed):
    r = c.stream("attitude", "design", seed)
    while True:
        reps = int(r.integers(3, 6))
        n_roll = int(r.choice([4, 6, 8, 12]))
        n_pitch = int(r.integers(13, 38))
        if 100 <= n_roll * n_pitch <= 300 and 300 <= reps * n_roll * n_pitch <= 1500:
            break
    pitch = np.linspace(-90, 90, n_pitch) if r.random() < 0.7 else np.linspace(-175, 175, n_pitch)
    if r.random() < 0.5:
        pitch = np.round(pitch)                            # whole degrees, as a careful person has it
    rolls = np.arange(n_roll) * 360.0 / n_roll + r.choice([0.0, 7.5, 10.0])
    way = r.choice(["sweep", "shuffled", "loops"])
    step, every = r.uniform(18, 55), r.uniform(0.1, 0.4)
    a, R, rep, t = [], [], [], []
    now = 0.0
    for k in range(reps):
        seq = []
        if way == "shuffled":
            seq = [(p, q) for p in pitch for q in rolls]
            seq = [seq[i] for i in r.permutation(len(seq))]
        else:
            for j, q in enumerate(r.permutation(rolls) if r.random() < 0.5 else rolls):
                if way == "sweep":
                    ps = pitch if (j + k) % 2 == 0 else pitch[::-1]
                else:
                    ps = np.concatenate([pitch[::2], pitch[1::2][::-1]])
                seq += [(p, q) for p in ps]
        for p, q in seq:
            a.append(p), R.append(q), rep.append(k + 1), t.append(now)
            now += step * (1 + every * r.exponential()) + (r.uniform(300, 900) if r.random() < 0.004 else 0)
        now += r.uniform(1200, 7200)
    n = len(a)
    t = np.array(t)
    jit = r.choice([0.0, 0.002, 0.01])
    a = np.array(a) + jit * r.standard_normal(n)
    R = np.array(R) + jit * r.standard_normal(n)
    span = r.uniform(1.0, 4.0)
    ph = r.uniform(0, 2 * np.pi, 2)
    T = (r.uniform(19, 26) + span * np.sin(2 * np.pi * t / r.uniform(9e3, 2.5e4) + ph[0])
         + 0.3 * span * np.sin(2 * np.pi * t / r.uniform(2.5e3, 6e3) + ph[1]) + 0.05 * r.standard_normal(n))
    cols = {"replicate": c.text(rep, 0), "order": c.text(np.arange(1, n + 1), 0), "elapsed_s": c.text(t, 1),
            "pitch_deg": c.text(a, 4), "roll_deg": c.text(R, 4), "sensor_temperature_degC": c.text(T, 2)}
    d = {k: np.asarray(v[0], float) for k, v in cols.items()}
    a, R = np.radians(d["pitch_deg"]), np.radians(d["roll_deg"])
    d["g"] = np.stack([np.sin(a), -np.sin(R) * np.cos(a), -np.cos(R) * np.cos(a)], axis=1)
    d["dg"] = np.stack([np.cos(a), np.sin(R) * np.sin(a), np.cos(R) * np.sin(a)], axis=1)   # d g / d pitch
    rp = d["replicate"]
    d["first"] = np.r_[True, rp[1:] != rp[:-1]]
    d["cols"] = cols
    axes = 1 if r.random() < 0.55 else 3
    m = np.zeros((axes, 3))
    for i in range(axes):
        m[i] = 0.02 * r.standard_normal(3)
        m[i, i] += 1.0
        m[i] *= r.uniform(1, 5) * r.choice([1, 1, 1, -1])
    d["m"] = m
    d["b"] = r.uniform(-0.1, 0.1, (axes, 1)) + 1e-4 * r.standard_normal((axes, reps))
    d["sigma"] = 10 ** r.uniform(-4.6, -3.7) * abs(m[0, 0])
    return d


def own(d):
    """The gravity that each sensor feels along its own axis, in g."""
    return [d["g"] @ (v / np.linalg.norm(v)) for v in d["m"]]


def tilt(d, angle):
    """A small error of pitch: what each sensor feels of it (volts per radian, as volts)."""
    return [angle * (d["dg"] @ v) for v in d["m"]]


def pendulum_curvature(d, r):
    k2, k3 = r.uniform(0.3, 1.0), r.uniform(-1, 1)
    return [k2 * u ** 2 + k3 * u ** 3 for u in own(d)]


def temperature_gain(d, r):
    T = d["sensor_temperature_degC"] - 20
    kb, ks, q = r.uniform(-1, 1), r.choice([-1, 1]) * r.uniform(0.6, 1.5), r.uniform(-0.03, 0.03)
    return [(T + q * T ** 2) * (kb + ks * u) for u in own(d)]


def worm_period(d, r):
    P = r.choice([2.0, 3.0, 4.0, 5.0, 9.0])
    x = 2 * np.pi * d["pitch_deg"] / P + r.uniform(0, 2 * np.pi)
    return tilt(d, np.sin(x) + r.uniform(0, 0.4) * np.sin(2 * x + r.uniform(0, 6)))


def lost_motion(d, r):
    s = np.empty(len(d["g"]))
    last = 1.0
    p = d["pitch_deg"]
    for i in range(len(s)):
        if d["first"][i]:
            last = 1.0
        elif abs(p[i] - p[i - 1]) > 0.1:
            last = np.sign(p[i] - p[i - 1])
        s[i] = last
    return tilt(d, s)


def tape_creep(d, r):
    n = r.standard_normal(3) * [1.0, 0.6, 0.6]
    n /= np.linalg.norm(n)
    s = c.low_pass(d["g"] @ n, d["elapsed_s"], r.uniform(400, 1800), 0.0, d["first"])
    return tilt(d, s)


def cable_tug(d, r):
    step = np.diff(d["roll_deg"], prepend=d["roll_deg"][0])
    step = (step + 180) % 360 - 180
    step[np.abs(step + 180) < 0.5] = 180                   # half a turn is always taken the same way
    w = np.zeros(len(step))
    for i in range(1, len(w)):
        w[i] = 0.0 if d["first"][i] else w[i - 1] + step[i]
    slack = np.quantile(np.abs(w), r.uniform(0.35, 0.65))
    pull = np.sign(w) * np.maximum(np.abs(w) - slack, 0) / 90
    return tilt(d, 3 * np.tanh(pull / 3))


def coil_memory(d, r):
    tau = r.uniform(60, 400)
    return [u * c.low_pass(u ** 2, d["elapsed_s"], tau, 0.0, d["first"]) for u in own(d)]


def damper_bubble(d, r):
    T = d["sensor_temperature_degC"]
    edge = np.quantile(T, r.uniform(0.4, 0.8))
    v = np.maximum(edge - T, 0)
    ang, w = r.uniform(-0.7, 0.7), r.uniform(0.05, 0.3)
    out = []
    for i in range(len(d["m"])):
        side = np.cos(ang) * d["g"][:, i] + np.sin(ang) * d["g"][:, (i + 2) % 3]
        out.append(v * np.tanh(side / w))
    return out


def chiller_rectification(d, r):
    P, duty = r.uniform(1100, 3600), r.uniform(0.25, 0.6)
    on = ((d["elapsed_s"] / P + r.uniform()) % 1.0 < duty).astype(float)
    k = r.uniform(0.2, 0.8)
    return [on * (1 - k * u ** 2) for u in own(d)]


def hole_miscount(d, r):
    turn = r.choice([9.0, 6.0, 4.0])
    frac = (d["pitch_deg"] / turn) % 1.0
    many = (frac > r.uniform(0.35, 0.55)) & (frac < 0.98)
    shift = r.uniform(5400, 14400)
    novice = np.floor(d["elapsed_s"] / shift + r.uniform()) % 2 == 1
    return tilt(d, (many & novice).astype(float))


EFFECTS = {f.__name__: f for f in (
    pendulum_curvature, temperature_gain, worm_period, lost_motion, tape_creep, cable_tug, coil_memory, damper_bubble,
    chiller_rectification, hole_miscount)}

PAIRS = [("pendulum_curvature", "temperature_gain"), ("worm_period", "lost_motion"), ("tape_creep", "coil_memory"),
         ("cable_tug", "hole_miscount"), ("damper_bubble", "chiller_rectification"), ("worm_period", "tape_creep"),
         ("temperature_gain", "cable_tug")]

ABOUT = {
    "pendulum_curvature": "Everyday. The pendulum's restoring force is not straight: a square and a cube of the gravity along "
        "the sensitive axis (recorded: pitch_deg; roll_deg for y and z). At all rows, most near +-1 g.",
    "temperature_gain": "Everyday. Zero and scale factor follow sensor_temperature_degC, slightly curved; scale times the "
        "gravity along the axis (pitch_deg). Matters because the room wanders inside a replication.",
    "worm_period": "Everyday. The worm of the pitch axis is eccentric: an angle error periodic in pitch_deg (2, 3, 4, 5 or 9 "
        "degrees a turn, a second harmonic), felt as its error times the cosine of pitch. With coarse grids it is aliased.",
    "lost_motion": "Everyday. Backlash: the true pitch differs by a constant with the sign of the last change of pitch_deg "
        "(order). A move in roll only leaves the flank as it was. The first row of a replication is approached from below.",
    "tape_creep": "Unlisted. The sensor is held by double-sided tape that creeps: a pitch error that is the slow memory (7 to 30 "
        "minutes of elapsed_s) of the gravity component along a fixed direction of the tape at earlier positions; fresh tape "
        "at every replication. It is felt as that state times d g/d pitch.",
    "cable_tug": "Unlisted. The head always turns the short way and nobody unwinds the cable within a replication: the sum of the "
        "short-way roll steps is the twist; beyond a slack, the cable pulls the block in pitch in the sense of the twist, "
        "saturating slowly. Depends on the whole history of roll_deg in the replication and on pitch_deg.",
    "coil_memory": "Unlisted. The torquer coil and its magnet warm with the square of the restoring current; the magnet weakens, so "
        "the scale factor follows a memory (1 to 7 minutes of elapsed_s) of earlier g squared along the axis: product of the "
        "present g and of that state. The recorded temperature sees nothing of it.",
    "damper_bubble": "Unlisted. The damping oil shrinks when cool: below an edge of sensor_temperature_degC a bubble opens, its volume "
        "as the degrees below; it lies at whichever end of the case is higher and pushes by a fixed amount: nearly a sign of "
        "a slanted gravity component (pitch_deg, roll_deg), times the bubble. Nothing above the edge.",
    "chiller_rectification": "Unlisted. A chiller on the roof runs part of every 18 to 60 minutes (square wave of elapsed_s, never "
        "recorded); its vibration is rectified by the pendulum, most where the axis lies level: on times (1 - k g^2).",
    "hole_miscount": "Unlisted, human. Pitch is set by whole turns of a crank (9, 6 or 4 degrees) and holes of an index plate. One of two "
        "operators, who change every 1.5 to 4 hours of elapsed_s, counts the starting hole when there are many holes: a "
        "constant pitch error on the rows of that shift whose pitch_deg is past about half a turn of the crank.",
}


def table(effects, seed, size, noise):
    d = design(seed)
    sigma, n, m = d["sigma"], len(d["g"]), d["m"]
    rep = d["replicate"].astype(int)
    model = np.column_stack([np.ones(n), d["g"]])
    hidden = np.zeros((len(m), n))
    sizes, shares = {}, {}
    for e in effects:
        share, shapes = c.draw(lambda r: EFFECTS[e](d, r), ("attitude", e, seed), model, rep)
        k = size * sigma / c.rms(c.residual(shapes[0], model, rep)) * c.stream("attitude", "sign", e, seed).choice([-1, 1])
        h = k * np.array(shapes)
        hidden += h
        sizes[e], shares[e] = c.rms(c.residual(h[0], model, rep)) / sigma, share
    cols = dict(d["cols"])
    names = ["x_V", "y_V", "z_V"][:len(m)]
    for i, name in enumerate(names):
        z = NOISES[noise](c.stream("attitude", "noise", noise, seed, name), n, level=np.sqrt(np.clip(1 - d["g"][:, i] ** 2, 0, 1)),
                          block=rep)
        q = 1.0 if noise == "quantized" else 0.0
        y = d["b"][i][rep - 1] + d["g"] @ m[i] + hidden[i] + sigma * z * np.sqrt(1 - q * q / 12)
        if q:
            y = np.round(y / (q * sigma)) * (q * sigma)
        cols[name] = c.text(y, c.decimals(sigma))
    return c.Table("attitude", effects, seed, noise, cols, [], names, hidden[0], sizes, sigma, rep, model, shares)
