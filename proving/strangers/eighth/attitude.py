"""Inclinometer sensors on a stage of two axes: pitch carries roll carries the sensors."""
import numpy as np
from .common import NOISES, Table, finish, generator, lag, texts  # noqa: F401


def laboratory(seed):
    g = generator(seed, "attitude", "lab")
    lab = Table()
    reps, per = int(g.integers(3, 7)), int(g.integers(105, 190))
    n = lab.n = reps * per
    three = g.random() < 0.5
    pace = g.uniform(50, 95)
    p0 = np.degrees(np.arcsin(np.sin(np.radians(81)) * (2 * (np.arange(per) + g.random(per)) / per - 1)))
    r0 = (360.0 * (np.arange(per) + g.random(per)) / per)
    g.shuffle(r0)
    same = g.random() < 0.3
    first = g.permutation(per)
    pitch, roll, t, temp, rep, tr = [], [], [], [], [], []
    now = 0.0
    for k in range(reps):
        o = first if same else g.permutation(per)
        pitch.append(p0[o] + g.normal(0, 0.4, per))
        roll.append((r0[o] + g.normal(0, 0.4, per)) % 359.99)
        dt = pace * g.uniform(0.75, 1.3, per)
        at = now + np.cumsum(dt)
        t.append(at)
        tr.append(at - now)
        x = (at - now) / (at[-1] - now)
        temp.append(g.uniform(19, 28) + g.uniform(-0.4, 1.1) * x + g.uniform(-0.2, 0.2) * np.sin(3 * x) + g.normal(0, 0.05, per))
        rep.append(np.full(per, k + 1))
        now = at[-1] + g.choice([3600.0, 9000.0, 50000.0]) * g.uniform(0.8, 1.3)
    tp, lab.pitch = texts(np.concatenate(pitch), "%.2f")
    tq, lab.roll = texts(np.concatenate(roll), "%.2f")
    tt, lab.t = texts(np.concatenate(t), "%.1f")
    tk, lab.temp = texts(np.concatenate(temp), "%.2f")
    lab.rep, lab.tr = np.concatenate(rep), np.concatenate(tr)
    lab.p, lab.r = np.radians(lab.pitch), np.radians(lab.roll)
    lab.dt = np.diff(np.concatenate([[0.0], lab.t]))
    for k in range(1, reps + 1):
        i = np.argmax(lab.rep == k)
        lab.dt[i] = lab.tr[i]
    lab.g = {"x_V": np.sin(lab.p), "y_V": -np.sin(lab.r) * np.cos(lab.p), "z_V": -np.cos(lab.r) * np.cos(lab.p)}
    # what a small nod in the plane of pitch does to each sensor
    lab.nod = {"x_V": np.cos(lab.p), "y_V": np.sin(lab.r) * np.sin(lab.p), "z_V": np.cos(lab.r) * np.sin(lab.p)}
    lab.sensors = ["x_V", "y_V"] + (["z_V"] if three else [])
    lab.columns = {"replicate": ["%d" % v for v in lab.rep], "order": ["%d" % (i + 1) for i in range(n)], "elapsed_s": tt,
                   "pitch_deg": ["%.4f" % float(v) for v in tp], "roll_deg": ["%.4f" % float(v) for v in tq],
                   "sensor_temperature_degC": tk}
    lab.decimals, lab.options = 7, []
    lab.error_sd = g.uniform(1.1e-4, 4e-4)
    lab.ratio = {s: (1.0 if s == "x_V" else g.uniform(0.8, 1.3)) for s in lab.sensors}
    gv = np.column_stack([np.ones(n), lab.g["x_V"], lab.g["y_V"], lab.g["z_V"]])
    drift = g.choice([0.0, 1.5])
    lab.clean = {}
    for s in lab.sensors:
        gain = g.uniform(2.6, 4.9) * np.array([1.0 if c == s else 0.0 for c in ("x_V", "y_V", "z_V")]) + g.normal(0, 0.008, 3)
        c = np.concatenate([[g.normal(0, 0.03)], gain])
        own = c + drift * lab.error_sd * g.standard_normal((reps, 4))
        lab.clean[s] = np.sum(gv * own[lab.rep - 1], axis=1)
    lab.model, lab.groups, lab.blocks, lab.plots = gv, lab.rep, lab.rep, None
    lab.strength = np.abs(lab.g["x_V"])
    return lab


def table(effects, seed, size, noise):
    import sys
    return finish(sys.modules[__name__], "attitude", laboratory(seed), effects, seed, size, noise)


def three_jaw_lobing(lab, g):
    nod = np.cos(3 * lab.r + g.uniform(0, 2 * np.pi))
    return {s: nod * lab.nod[s] for s in lab.sensors}


def one_sided_gain(lab, g):
    return {"x_V": g.choice([-1, 1]) * np.maximum(0.0, lab.g["x_V"])}


def power_up(lab, g):
    tau = g.uniform(0.1, 0.25) * lab.tr.max()
    amount = 1 + 0.15 * g.standard_normal(lab.rep.max())
    sign = {s: (g.choice([-1, 1]) * g.uniform(0.6, 1.4)) for s in lab.sensors}
    return {s: sign[s] * amount[lab.rep - 1] * np.exp(-lab.tr / tau) for s in lab.sensors}


def flexure_after_effect(lab, g):
    tau = g.uniform(0.35, 0.8) * np.median(lab.dt)
    out = {}
    for s in lab.sensors:
        v = np.empty(lab.n)
        for k in np.unique(lab.rep):
            at = lab.rep == k
            rest = {"x_V": 0.0, "y_V": 0.0, "z_V": -1.0}[s]
            v[at] = lag(lab.g[s][at], lab.dt[at], tau, rest) - lab.g[s][at]
        out[s] = v
    return out


def lazy_bubble(lab, g):
    threshold, state, out = g.uniform(8, 18), 1.0, np.empty(lab.n)
    for k in range(lab.n):
        if abs(lab.pitch[k]) > threshold:
            state = np.sign(lab.pitch[k])
        out[k] = state
    return {"x_V": out * g.choice([-1, 1])}


def fan_rectification(lab, g):
    period, duty, phase = g.uniform(1100, 2600), g.uniform(0.35, 0.6), g.random()
    on = ((lab.t / period + phase) % 1.0 < duty).astype(float)
    k2 = {s: g.uniform(0.6, 1.4) for s in lab.sensors}
    return {s: k2[s] * on * lab.g[s] ** 2 for s in lab.sensors}


def parked_trolley(lab, g):
    load = np.zeros(lab.n)
    reps = g.permutation(np.unique(lab.rep))[:2]
    for k in reps:
        at = lab.rep == k
        a = g.uniform(0.15, 0.5)
        x = lab.tr / lab.tr[at].max()
        load[at & (x > a) & (x < a + g.uniform(0.25, 0.45))] = 1.0
    return {s: load * lab.nod[s] * 1.0 for s in lab.sensors}


def holding_brake_heat(lab, g):
    phi, tau = g.uniform(-0.7, 0.7), g.uniform(5, 14) * np.median(lab.dt)
    torque2 = np.sin(lab.p - phi) ** 2
    a = {s: g.choice([-1, 1]) * g.uniform(0.6, 1.4) for s in lab.sensors}
    v = np.empty(lab.n)
    for k in np.unique(lab.rep):
        at = lab.rep == k
        v[at] = lag(torque2[at], lab.dt[at], tau, np.sin(phi) ** 2)
    return {s: a[s] * v for s in lab.sensors}


EFFECTS = {f.__name__: f for f in (three_jaw_lobing, one_sided_gain, power_up, flexure_after_effect, lazy_bubble, fan_rectification,
                                   parked_trolley, holding_brake_heat)}
PAIRS = [("power_up", "lazy_bubble"), ("three_jaw_lobing", "fan_rectification"), ("one_sided_gain", "parked_trolley")]
ABOUT = {
    "three_jaw_lobing": "Everyday: the ring of the roll bearing is clamped by three jaws and is three-lobed; the roll axis nods in the plane of "
                        "pitch by cos(3 roll + phase), so the first sensor errs by cos(pitch) of it. Pitch and roll; always.",
    "one_sided_gain": "Everyday: the output stage has another gain for positive than for negative acceleration, in the first sensor only. Gravity "
                      "along the sensor; for positive values.",
    "power_up": "Everyday: sensors are switched on at the start of each replicate and their zeros approach the end value exponentially. Time since "
                "the replicate began; its first quarter.",
    "flexure_after_effect": "Everyday: the flexure creeps to its new deflection and is read before it is there: a lag of gravity along each "
                            "sensor. The move since the row before and the time between rows; always.",
    "lazy_bubble": "Unlisted: an air bubble in the damping oil of the first sensor lies at one end and goes to the other only when the pitch is "
                   "beyond a threshold on that side; the zero has two values, with memory. Pitch and its history.",
    "fan_rectification": "Unlisted: the fan of the air conditioning runs part of each cycle of about half an hour; its vertical vibration is "
                         "rectified by each sensor by the square of gravity along it. Time (on and off) and gravity along the sensor.",
    "parked_trolley": "Unlisted: someone leaves a heavy trolley next to the pier for a while, in two of the replicates, and the floor tilts in "
                      "the plane of pitch: a step that goes away again, times cos(pitch). Time and pitch.",
    "holding_brake_heat": "Unlisted: the pitch motor holds an unbalanced load; its heat goes with the square of the torque and reaches "
                          "the sensors' zeros late, so the pitch of the last ten minutes matters. History of pitch.",
}
