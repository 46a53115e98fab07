"""Inertial sensors on a dividing head: ten causes."""
import numpy as np

from . import common as c
from .common import between, pick


class Lab:
    """One laboratory: design, clock, temperature, sensors. `needs` are features an effect cannot do without."""

    def __init__(self, r, needs):
        self.r = r
        n_rep = int(r.integers(3, 7))
        low = max(300 // n_rep + 1, 60)
        n_each = int(r.integers(low, min(1500 // n_rep, low * 3) + 1))
        style = pick(r, "grid", "sweep", "sphere", "teeth", "teeth")
        if "teeth" in needs:
            style = "teeth"
        elif "no_sphere" in needs and style == "sphere":
            style = "grid"
        self.style = style
        self.tooth = pick(r, 1.0, 2.0, 3.0, 5.0)
        # how the roll axis is driven; where the cable is unwound
        self.forward = bool(r.random() < 0.4)
        self.most_turns = between(r, 4, 12)
        pitch, roll, rep = [], [], []
        fresh = r.random() < 0.7
        first = None
        for k in range(n_rep):
            if first is None or fresh:
                p, q = self._attitudes(r, n_each)
                first = (p, q)
            else:
                p, q = first if k % 2 == 0 else (first[0][::-1], first[1][::-1])
            pitch.append(p)
            roll.append(q)
            rep.append(np.full(p.size, k + 1))
        self.pitch, self.roll = np.concatenate(pitch), np.concatenate(roll)
        self.rep = np.concatenate(rep)
        self.n = self.pitch.size
        a, R = np.radians(self.pitch), np.radians(self.roll)
        self.g = np.c_[np.sin(a), -np.sin(R) * np.cos(a), -np.cos(R) * np.cos(a)]
        self.h1 = np.c_[np.cos(a), np.sin(R) * np.sin(a), np.cos(R) * np.sin(a)]   # table tipped in the plane of pitch
        self.h2 = np.c_[0 * R, np.cos(R), -np.sin(R)]                               # table tipped across
        self._clock(r, needs)
        self._temperature(r, needs)
        self._sensors(r, needs)

    def _attitudes(self, r, n):
        if self.style == "sphere":
            p = np.degrees(np.arcsin(r.uniform(-1, 1, n)))
            return np.round(p, 4), np.round(r.uniform(-180, 180, n), 4)
        if self.style == "teeth":
            step = self.tooth
            levels = np.arange(np.ceil(-90 / step), np.floor(90 / step) + 1) * step
            p = r.choice(levels, n)
            return p, r.choice(np.arange(0, 360, pick(r, 15.0, 20.0, 30.0)), n)
        # grid, sweep: levels of pitch times levels of roll
        n_roll = int(r.choice([8, 12, 16, 18, 24]))
        n_pitch = max(4, int(round(n / n_roll)))
        top = pick(r, 60.0, 80.0, 90.0)
        levels = np.round(np.linspace(-top, top, n_pitch), 2)
        around = np.arange(n_roll) * 360.0 / n_roll
        if self.style == "grid":
            p, q = [v.ravel() for v in np.meshgrid(levels, around)]
            order = r.permutation(p.size)
            return p[order], q[order]
        p, q = [], []
        for i, v in enumerate(levels if r.random() < 0.6 else r.permutation(levels)):
            p.append(np.full(n_roll, v))
            q.append(around if self.forward or i % 2 == 0 else around[::-1])
        return np.concatenate(p), np.concatenate(q)

    def _clock(self, r, needs):
        n = self.n
        dp = np.abs(np.diff(self.pitch, prepend=self.pitch[0]))
        dq = np.abs((np.diff(self.roll, prepend=self.roll[0]) + 180) % 360 - 180)
        dt = between(r, 12, 60) * (1 + 0.15 * np.abs(r.standard_normal(n))) + (dp + dq) / between(r, 3, 20)
        if "long" in needs and dt.sum() < 12 * 3600:
            dt *= between(r, 12, 26) * 3600 / dt.sum()
        self.pause = np.zeros(n)
        if "pauses" in needs or r.random() < 0.5:
            many = int(r.integers(5, 15)) if "pauses" in needs or r.random() < 0.5 else int(r.integers(1, 4))
            where = r.choice(np.arange(8, n), many, replace=False)
            self.pause[where] = r.uniform(1200, 9000, many)
        if r.random() < 0.6:        # a break between replications
            for k in np.flatnonzero(np.diff(self.rep)):
                self.pause[k + 1] += between(r, 600, 5400)
        dt = dt + self.pause
        dt[0] = 0.0
        self.t = np.round(np.cumsum(dt), 1)
        self.dt = np.diff(self.t, prepend=self.t[0] - np.median(dt))

    def _temperature(self, r, needs):
        hours = self.t / 3600
        swing = between(r, 3, 8) if "swing" in needs else pick(r, 0.3, 1.0, 3.0, 6.0) * between(r, 0.7, 1.3)
        line = np.sin(2 * np.pi * hours / between(r, 5, 24) + between(r, 0, 6.28)) + 0.5 * c.wander(r, self.n, self.n / 8)
        self.T = np.round(between(r, 18, 26) + 0.5 * swing * line + 0.02 * r.standard_normal(self.n), 2)

    def _sensors(self, r, needs):
        k = 3 if "three" in needs else int(r.choice([1, 1, 2, 3, 3]))
        self.m, self.b, self.sigma = [], [], []
        fine = 10 ** between(r, -5.2, -3.8)
        for i in range(k):
            v = between(r, 1, 5)
            m = 0.02 * v * r.uniform(-1, 1, 3)
            m[i] = v
            self.m.append(m)
            self.b.append(between(r, -0.3, 0.3))
            self.sigma.append(v * fine * between(r, 0.7, 1.4))
        # mounting anew: offset and sensitivities of each replication a little different (the declared model has them in each)
        self.anew = between(r, 0.5, 3) if r.random() < 0.5 else 0.0

    def unwound(self):
        """Net turns of the roll axis since the cable was unwound: at the start of each replication, and when there are too many."""
        turns = np.zeros(self.n)
        for i in range(1, self.n):
            if self.rep[i] != self.rep[i - 1]:
                continue
            d = (self.roll[i] - self.roll[i - 1]) % 360
            if not self.forward and d > 180:
                d -= 360
            turns[i] = turns[i - 1] + d / 360
            if abs(turns[i]) > self.most_turns:
                turns[i] = 0.0
        return turns


# Each effect: (lab, r) -> list over channels of (rows,) in volts, any overall scale. First channel decides the scale.
def cable_turns(lab, r):
    turns = lab.unwound()
    tip, across = 1.0, between(r, -0.6, 0.6)
    # the twisted cable pulls the package over in its own axes: about package y, and a little about package z
    return [turns * (m[0] * (tip * lab.g[:, 2] + across * lab.g[:, 1]) - m[2] * tip * lab.g[:, 0] - m[1] * across * lab.g[:, 0])
            for m in lab.m]


def oil_bubble(lab, r):
    tau = between(r, 0.6, 3) * np.median(lab.dt)
    full = np.quantile(lab.T, between(r, 0.55, 0.95))   # above this the oil fills the case
    volume = np.clip(full - lab.T, 0, None)
    up = -lab.g
    u = up.copy()
    for i in range(1, lab.n):
        u[i] = up[i] + (u[i - 1] - up[i]) * np.exp(-lab.dt[i] / tau)
    side = between(r, -0.3, 0.3)
    out = []
    for k, m in enumerate(lab.m):
        out.append(m[k] * volume * (u[:, k] + side * u[:, (k + 1) % 3]))
    return out


def sun_on_pier(lab, r):
    hour = between(r, 7, 11) + lab.t / 3600 - between(r, 1.5, 3.5)     # the wall follows the sun by some hours
    day = np.pi * ((hour % 24) - 6) / 13
    up = np.where((day > 0) & (day < np.pi), np.sin(day), 0.0)
    east = np.where(up > 0, np.cos(day), 0.0) * up
    north, west = 1.0, between(r, 0.5, 1.5)
    tip = north * up[:, None] * lab.h1 + west * east[:, None] * lab.h2
    if r.random() < 0.5:          # the head stands across the meridian
        tip = west * east[:, None] * lab.h1 + north * up[:, None] * lab.h2
    return [tip @ m for m in lab.m]


def film_after_pause(lab, r):
    moves = between(r, 5, 20)
    hold = between(r, 1800, 6000)
    film, sunk = np.zeros(lab.n), 1.0           # before the start it stood overnight
    for i in range(lab.n):
        if i:
            sunk *= np.exp(-1 / moves)
        if lab.pause[i] > 0:
            sunk = sunk + (1 - sunk) * (1 - np.exp(-lab.pause[i] / hold))
        film[i] = sunk
    tip = film[:, None] * (lab.h1 + between(r, -0.5, 0.5) * lab.h2)
    return [tip @ m for m in lab.m]


def dmm_autorange(lab, r):
    out = []
    shift, gain = between(r, -1, 1), between(r, -1, 1)
    frac = between(r, 0.35, 0.7)
    for k, m in enumerate(lab.m):
        v = lab.b[k] + lab.g @ m
        up = frac * np.abs(v).max()
        down = up * between(r, 0.75, 0.9)
        low, was = np.zeros(lab.n), abs(v[0]) < up
        for i in range(lab.n):
            was = abs(v[i]) < (up if was else down)
            low[i] = was
        out.append(low * (shift * m[k] * 0.5 + gain * v))
    return out


def wax_creep(lab, r):
    tau = between(r, 0.05, 0.4) * lab.t[-1] / lab.rep[-1]
    rate = 2.0 ** ((lab.T - np.median(lab.T)) / between(r, 3, 6))     # wax softens
    lean = np.zeros((lab.n, 3))
    for i in range(1, lab.n):
        f = np.exp(-lab.dt[i] * rate[i] / tau)
        load = lab.g[i - 1] if lab.pause[i] > 0 else lab.g[i]          # in a pause it hangs where it was left
        lean[i] = load + (lean[i - 1] - load) * f
    y, z = lean[:, 1], lean[:, 2] * between(r, 0.4, 1.0)
    # the package leans toward its load: a small rotation, about z by y and about y by z
    return [m[0] * (y * lab.g[:, 1] + z * lab.g[:, 2]) - lab.g[:, 0] * (m[1] * y + m[2] * z) for m in lab.m]


def mux_memory(lab, r):
    outs = np.array([lab.b[k] + lab.g @ m for k, m in enumerate(lab.m)])
    last = pick(r, 2, 2, 1)                          # the channel scanned last
    tau = between(r, 0.3, 2) * np.median(lab.dt)     # dielectric absorption leaks away between scans
    keep = np.exp(-np.minimum(lab.dt, 20 * tau) / tau)
    charge = np.r_[0.0, outs[last][:-1]] * keep
    # x is scanned first, after `last` of the row before; the others after their neighbour of the same row
    rest = [0.5 * np.exp(-0.5) * outs[k - 1] for k in range(1, len(lab.m))]
    return [charge] + rest


def side_load_friction(lab, r):
    stroke = between(r, 0.05, 0.4)                   # of g, until the pivot slides
    out = []
    for k, m in enumerate(lab.m):
        along = lab.g[:, k]
        side = np.sqrt(np.clip(1 - along ** 2, 0, None))
        f = np.zeros(lab.n)
        for i in range(1, lab.n):
            f[i] = np.clip(f[i - 1] + (along[i] - along[i - 1]) / stroke, -1, 1)
        out.append(-m[k] * side * f)
    return out


def floor_reach(lab, r):
    centre, half = between(r, 0, 360), between(r, 60, 110)
    far = (np.abs((lab.roll - centre + 180) % 360 - 180) < half).astype(float)
    tip = far[:, None] * (lab.h1 + between(r, -1, 1) * lab.h2)
    return [tip @ m for m in lab.m]


def every_third_tooth(lab, r):
    number = np.round(lab.pitch / lab.tooth).astype(int) % 3
    cut = r.standard_normal(3)
    cut -= cut.mean()
    tip = cut[number][:, None] * lab.h1
    return [tip @ m for m in lab.m]


EFFECTS = {f.__name__: f for f in (cable_turns, oil_bubble, sun_on_pier, film_after_pause, dmm_autorange,
                                   wax_creep, mux_memory, side_load_friction, floor_reach, every_third_tooth)}
NEEDS = {"oil_bubble": {"swing"}, "sun_on_pier": {"long"}, "film_after_pause": {"pauses"}, "mux_memory": {"three"},
         "every_third_tooth": {"teeth"}, "wax_creep": set()}
PAIRS = [("cable_turns", "sun_on_pier"), ("oil_bubble", "dmm_autorange"), ("film_after_pause", "floor_reach"),
         ("wax_creep", "mux_memory"), ("side_load_friction", "every_third_tooth"), ("sun_on_pier", "mux_memory"),
         ("cable_turns", "film_after_pause")]
ABOUT = {
    "cable_turns": "The sensor's cable winds up on the roll axis and pulls the package over on its bracket, in proportion to the net turns "
                   "since it was unwound: at the start of the replication, and when there are too many, 4 to 12 (roll driven the shorter way, in some laboratories always forward). "
                   "Depends on roll_deg summed over the rows before, times gravity across (pitch, roll). Matters where turns accumulate.",
    "oil_bubble": "A gas bubble in the damping oil floats to the top with a delay of about a move, and pushes the proof mass; the oil's "
                  "expansion closes the bubble above a temperature. Depends on pitch and roll now and in the row before, elapsed time since then, "
                  "sensor_temperature_degC. Matters in the cool part of the run.",
    "sun_on_pier": "The sun on the wall tips the pier, some hours late, first one way and then the other; nothing at night. "
                   "Depends on elapsed_s (hour of the day) times pitch and roll (a tilt in laboratory axes). Matters in runs of half a day and more.",
    "film_after_pause": "The oil film of the head's bearing is squeezed out in a pause (longer pause, more) and comes back with moves, not with "
                        "time. Depends on gaps of elapsed_s, the count of rows since the gap, pitch and roll (a tilt). Matters after pauses and at the start.",
    "dmm_autorange": "The voltmeter changes its range by itself, up at one level and down at a lower one; its lower range has another zero and "
                     "gain. Depends on the level |x_V|, between the two levels on the row before. Matters everywhere; a step in level.",
    "wax_creep": "The wax under the package creeps toward the load and relaxes, over many rows, faster when warm. Depends on pitch and roll of many "
                 "rows before (weighted by elapsed time and sensor_temperature_degC) times pitch and roll now. Matters in sweeps and after pauses.",
    "mux_memory": "The multiplexer's capacitance keeps a little of the channel scanned last (z, or y) in the row before, and gives it to x; "
                  "it leaks away with time between scans. Depends on z_V (or y_V) of the row before and the time since. Matters with quick scans.",
    "side_load_friction": "The pendulum's pivot drags with the side load: against the direction of the last change of the axial component, in full "
                          "after a stroke. Depends on the change of pitch (axial gravity) from the row before, times gravity across. Matters with axis level.",
    "floor_reach": "For part of the roll circle the operator must stand on the other side of the pier to clamp, and the floor tips under his weight. "
                   "Depends on roll_deg (inside an arc or not) times pitch and roll (a tilt). Matters inside the arc.",
    "every_third_tooth": "The pitch coupling was ground with three passes: tooth numbers 0, 1, 2 modulo 3 sit differently. Depends on pitch_deg divided by "
                         "the tooth, modulo 3, times cos pitch. Matters where pitch is set in single teeth.",
}


def setting(r, lab):
    """Errors of setting the head: a sensor sees the pitch error times cos pitch."""
    return c.weighted(r, np.sqrt(0.15 + 0.85 * lab.h1[:, 0] ** 2))


NOISES = {
    "white": lambda r, lab: c.white(r, lab.n), "student": lambda r, lab: c.student(r, lab.n),
    "uniform": lambda r, lab: c.uniform(r, lab.n), "skewed": lambda r, lab: c.skewed(r, lab.n),
    "outliers": lambda r, lab: c.outliers(r, lab.n), "ar1": lambda r, lab: c.ar1(r, lab.n),
    "setting": setting, "bursts": lambda r, lab: c.bursts(r, lab.n), "flicker": lambda r, lab: c.flicker(r, lab.n),
}


def make(effects, seed, size, noise):
    key = "+".join(effects)
    needs = set().union(*[NEEDS.get(e, set()) for e in effects]) if effects else set()
    for attempt in range(60):
        lab = Lab(c.stream(seed, "attitude", "lab", key, attempt), needs)
        if not 300 <= lab.n <= 1500:
            continue
        model = np.c_[np.ones(lab.n), lab.g]
        shapes, lefts = [], []
        for e in effects:
            s = EFFECTS[e](lab, c.stream(seed, "attitude", e, key, attempt))
            left = c.rms(c.left_over(s[0], model, lab.rep))
            shapes.append(s)
            lefts.append(left)
        if all(v > 0.08 * c.rms(s[0] - s[0].mean()) and v > 0 for v, s in zip(lefts, shapes)):
            break
    else:
        raise RuntimeError("no laboratory for %r" % (effects,))
    parts = {}
    hidden = [np.zeros(lab.n) for _ in lab.m]
    for e, s, left in zip(effects, shapes, lefts):
        f = size * lab.sigma[0] / left
        parts[e] = c.rms(c.left_over(f * s[0], model, lab.rep)) / lab.sigma[0]
        for k in range(len(lab.m)):
            hidden[k] = hidden[k] + f * s[k]
    columns = [("replicate", lab.rep, "d"), ("order", np.arange(1, lab.n + 1), "d"), ("elapsed_s", lab.t, ".1f"),
               ("pitch_deg", lab.pitch, ".4f"), ("roll_deg", lab.roll, ".4f"), ("sensor_temperature_degC", lab.T, ".2f")]
    for k, m in enumerate(lab.m):
        r = c.stream(seed, "attitude", "noise", key, k)
        e = lab.sigma[k] * NOISES[noise](r, lab)
        r = c.stream(seed, "attitude", "anew", key, k)
        n_rep = lab.rep.max() + 1
        b = lab.b[k] + lab.anew * lab.sigma[k] * r.standard_normal(n_rep)
        mm = m + 0.4 * lab.anew * lab.sigma[k] * r.standard_normal((n_rep, 3))
        v = b[lab.rep] + (mm[lab.rep] * lab.g).sum(1) + hidden[k] + e
        columns.append(("xyz"[k] + "_V", v, ".%df" % c.digits(lab.sigma[k])))
    return c.Table(c.csv_text(columns), [], float(np.mean(list(parts.values()))) if parts else 0.0, hidden[0], parts,
                   lab.sigma[0], lab.sigma[0], {"style": lab.style, "tooth": lab.tooth, "forward": lab.forward, "attempt": attempt})
