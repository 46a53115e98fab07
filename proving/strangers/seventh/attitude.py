"""Accelerometers on a two-axis table: tumbles in gravity."""
import math

import numpy as np

from ._core import NOISES, Lab, record, stream

__all__ = ["NOISES", "EFFECTS", "PAIRS", "ABOUT", "laboratory"]


def laboratory(seed):
    rng = stream("attitude", seed, "laboratory")
    style = ("shuffled", "swept", "sphere")[int(rng.integers(3))]
    reps = int(rng.integers(3, 7))
    pitches = np.arange(-75, 76, 15) if rng.random() < 0.5 else np.arange(-80, 81, 20)
    rolls = np.arange(0, 360, 30.0 if rng.random() < 0.5 else 22.5)
    per = int(rng.integers(100, 180))
    pace = rng.uniform(35, 100)
    n_sensor = int(rng.integers(2, 4))
    rest = rng.uniform(1500, 40000)
    rep, t, pitch, roll = [], [], [], []
    clock = 0.0
    for k in range(reps):
        if style == "sphere":
            p = np.degrees(np.arcsin(rng.uniform(-0.99, 0.99, per)))
            r = rng.uniform(0, 359.9, per)
            decimals = 2
        else:
            p, r = [], []
            for i, v in enumerate(pitches):
                p += [float(v)] * len(rolls)
                r += list(rolls if i % 2 == 0 else rolls[::-1])
            p, r = np.array(p), np.array(r)
            if style == "shuffled":
                at = rng.permutation(len(p))
                p, r = p[at], r[at]
            elif k % 2:
                p, r = p[::-1], r[::-1]
            p = p + rng.normal(0, 0.02, len(p))
            r = np.mod(r + rng.normal(0, 0.02, len(r)), 359.99)
            decimals = 4
        for a, b in zip(p, r):
            clock += pace * rng.uniform(0.8, 1.3)
            rep.append(k + 1), t.append(clock), pitch.append(a), roll.append(b)
        clock += rest * rng.uniform(0.7, 1.3)
    n = len(t)
    rep, t = np.array(rep), record(t, 1)
    pitch, roll = record(pitch, decimals), record(roll, decimals)
    temperature = rng.uniform(19, 32) + rng.uniform(0.2, 1.5) * np.sin(2 * math.pi * t / 86400 + rng.uniform(0, 6.28))
    since = np.concatenate([t[rep == k] - t[rep == k][0] for k in range(1, reps + 1)])
    temperature = record(temperature + rng.uniform(0.3, 2.5) * (1 - np.exp(-since / 4000)) + rng.normal(0, 0.04, n), 2)
    a, b = np.radians(pitch), np.radians(roll)
    g = np.column_stack([np.sin(a), -np.sin(b) * np.cos(a), -np.cos(b) * np.cos(a)])
    clean, sd, scale = {}, {}, {}
    for i, name in enumerate(("x_V", "y_V", "z_V")[:n_sensor]):
        scale[name] = s = rng.uniform(2.5, 4.9)
        axis = rng.normal(0, 0.01, 3)
        axis[i] = 1.0
        axis /= np.linalg.norm(axis)
        sd[name] = s * 10 ** rng.uniform(-5.0, -3.9)
        offsets = rng.normal(0, 20 * sd[name], reps)
        gains = 1 + rng.normal(0, 3 * sd[name] / s, reps)
        clean[name] = rng.normal(0, 0.04) + offsets[rep - 1] + s * gains[rep - 1] * (g @ axis)
    return Lab("attitude",
               {"replicate": (rep, 0), "order": (np.arange(1, n + 1), 0), "elapsed_s": (t, 1), "pitch_deg": (pitch, 4),
                "roll_deg": (roll, 4), "sensor_temperature_degC": (temperature, 2)},
               clean, sd, np.column_stack([np.ones(n), g]), rep, rep, 0.0, [],
               {"rep": rep, "t": t, "p": a, "r": b, "g": g, "pace": pace, "since": since, "scale": scale})


def _by_pitch(lab, error):
    """Readings when the pitch differs by error (rad) from what is recorded."""
    m = lab.more
    p, r = m["p"], m["r"]
    d = (np.cos(p), np.sin(r) * np.sin(p), np.cos(r) * np.sin(p))
    return {n: m["scale"][n] * v * error for n, v in zip(lab.clean, d)}


# ---- everyday

def one_sided(lab, rng):
    a = lab.more["g"][:, 0]
    return {"x_V": lab.more["scale"]["x_V"] * np.abs(a) * rng.choice([-1, 1])}


def gear_lash(lab, rng):
    gap = math.radians(rng.uniform(0.5, 3))
    p, rep = lab.more["p"], lab.more["rep"]
    error = np.empty(lab.n)
    for i in range(lab.n):
        if i == 0 or rep[i] != rep[i - 1]:
            behind = p[i] - gap / 2
        behind = min(max(behind, p[i] - gap / 2), p[i] + gap / 2)
        error[i] = (behind - p[i]) / gap
    return _by_pitch(lab, error)


def warming_gain(lab, rng):
    m = lab.more
    tau = rng.uniform(0.1, 0.3) * m["since"].max()
    fade = np.exp(-m["since"] / tau)
    own = [1.0] + list(rng.uniform(0.4, 1.3, 2))
    return {n: m["scale"][n] * own[i] * m["g"][:, i] * fade for i, n in enumerate(lab.clean)}


def autorange(lab, rng):
    v = lab.clean["x_V"]
    gain, zero = rng.uniform(0.5, 1) * rng.choice([-1, 1]), rng.uniform(0.5, 1) * rng.choice([-1, 1])
    fine, out = False, np.zeros(lab.n)
    for i in range(lab.n):
        fine = abs(v[i]) < (1.2 if fine else 1.0)
        out[i] = zero + gain * v[i] if fine else 0.0
    return {"x_V": out}


# ---- unlisted

def bearing_flop(lab, rng):
    p, r = lab.more["p"], lab.more["r"]
    arm = rng.uniform(-0.35, 0.35)
    phase = rng.uniform(0, 2 * math.pi)
    torque = arm * np.cos(p) + np.cos(r - phase) * np.sin(p) + rng.uniform(-0.15, 0.15)
    return _by_pitch(lab, np.tanh(torque / 0.04))


def oil_bubble(lab, rng):
    g, rep = lab.more["g"], lab.more["rep"]
    pockets = rng.normal(size=(5, 3))
    pockets /= np.linalg.norm(pockets, axis=1)[:, None]
    pull = pockets @ np.array([1.0, 0.3, -0.2]) + rng.normal(0, 0.7, 5)
    grip = rng.uniform(0.2, 0.5)
    out = np.empty(lab.n)
    for i in range(lab.n):
        lift = pockets @ g[i]
        best = int(np.argmax(lift))
        if i == 0 or rep[i] != rep[i - 1] or lift[best] > lift[at] + grip:
            at = best
        out[i] = pull[at]
    return {"x_V": out}


def drive_slip(lab, rng):
    p, rep = lab.more["p"], lab.more["rep"]
    every = int(rng.integers(28, 48))
    out, slipped, count = np.zeros(lab.n), 0.0, 0
    for i in range(lab.n):
        if i == 0 or rep[i] != rep[i - 1] or count == every:
            slipped, count = 0.0, 0
        else:
            rise = max(0.0, p[i] - p[i - 1])
            slipped += rise * (1 + 0.6 * math.cos(0.5 * (p[i] + p[i - 1])))
        count += 1
        out[i] = -slipped
    return _by_pitch(lab, out)


def press_next_door(lab, rng):
    m = lab.more
    period = rng.uniform(16, 45) * m["pace"]
    duty = rng.uniform(0.3, 0.6)
    holds = (np.mod(m["t"] / period + rng.random(), 1.0) < duty).astype(float)
    out = _by_pitch(lab, holds * rng.uniform(0.7, 1))
    across = holds * rng.uniform(-0.7, 0.7)
    for n, f in zip(("y_V", "z_V"), (np.cos(m["r"]), -np.sin(m["r"]))):
        if n in out:
            out[n] = out[n] + m["scale"][n] * across * f
    return out


EFFECTS = {"one_sided": one_sided, "gear_lash": gear_lash, "warming_gain": warming_gain, "autorange": autorange,
           "bearing_flop": bearing_flop, "oil_bubble": oil_bubble, "drive_slip": drive_slip, "press_next_door": press_next_door}
PAIRS = [("one_sided", "press_next_door"), ("gear_lash", "oil_bubble"), ("warming_gain", "drive_slip")]
ABOUT = {
    "one_sided": "Everyday: the push-pull halves of the x sensor have different scale factors, so that its output has a part in |gravity along x|. "
                 "Depends on gravity along x (sin pitch). Always; only x.",
    "gear_lash": "Everyday: play in the pitch gear; the table stays behind by half the play, on the side from which the pitch was approached. "
                 "Depends on the direction of the last pitch move, times the slope of each sensor in pitch (cos pitch for x). Always; all sensors.",
    "warming_gain": "Everyday: the scale factor settles exponentially after switching on at the start of each replicate. "
                    "Depends on the time since the replicate began, times gravity along each sensor. Mostly in the first third of a replicate; all sensors.",
    "autorange": "Everyday: the voltmeter of x changes to its 1 V range below 1.0 V and leaves it above 1.2 V; this range has a zero and a gain of its own. "
                 "Depends on the reading of x (gravity along x), and between 1.0 and 1.2 V on the row before. Near level only; only x.",
    "bearing_flop": "Unlisted: the pitch shaft rests on one or the other side of its bearing clearance, by the sign of the unbalance torque of the payload. "
                    "Depends on pitch and roll (sign of a cos pitch + cos(roll - phase) sin pitch + c), times the slope of each sensor in pitch. Sudden; all sensors.",
    "oil_bubble": "Unlisted: a bubble in the damping oil of the x sensor sits in the highest of five pockets and pushes the proof mass by where it is; "
                  "it leaves a pocket only when another is higher by a threshold. Depends on the direction of gravity in the body (pitch, roll) and on the attitudes before. Sudden; only x.",
    "drive_slip": "Unlisted: the friction drive of the pitch axis slips when it lifts the payload, never when it lowers it; the slip adds up until the axis is "
                  "homed, every so many rows. Depends on the sum of the upward pitch moves since homing, times the slope in pitch. All sensors.",
    "press_next_door": "Unlisted: a press in the next hall holds its load for part of each cycle, and the floor and the table's base tilt while it does. "
                       "Depends on time (square wave), times cos pitch for x and the lateral slopes for y and z. All sensors.",
}
