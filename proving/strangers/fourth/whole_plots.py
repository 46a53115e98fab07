"""Pressure transducers, cold sensor and separate electronics, in whole plots: ten causes."""
import numpy as np

from . import common as c
from .common import between, pick


class Lab:
    def __init__(self, r, needs):
        self.r = r
        plots = int(r.integers(14, 31))
        per = int(r.integers(6, 13))
        while plots * per > 300:
            per -= 1
        while plots * per < 80:
            per += 1
        self.plots, self.per, self.n = plots, per, plots * per
        self._places(r, needs)
        self._pressures(r)
        self._clock(r, needs)
        self._bridges(r)

    def _places(self, r, needs):
        k = self.plots
        style = pick(r, "three", "five", "spread", "spread", "staircase")
        if "many" in needs and style in ("three",):
            style = pick(r, "five", "spread")
        if "colder" in needs:
            style = "staircase"
        lo_s, hi_s = -130 + between(r, 0, 8), -50 - between(r, 0, 8)
        lo_e, hi_e = -40 + between(r, 0, 8), 40 - between(r, 0, 8)
        if style in ("three", "five"):
            m = 3 if style == "three" else 5
            grid = np.array([(s, e) for s in np.linspace(-1, 1, m) for e in np.linspace(-1, 1, m)])
            if m == 3:
                idx = np.r_[np.tile(np.arange(9), k // 9), r.choice(9, k % 9, replace=False)]
            else:
                idx = r.choice(25, k, replace=k > 25)
            p = grid[r.permutation(idx)]
        else:
            p = np.c_[(r.permutation(k) + r.random(k)) / k, (r.permutation(k) + r.random(k)) / k] * 2 - 1
        if style == "staircase":              # the careful way: mild first, colder and colder, with warm returns
            p = p[np.argsort(-p[:, 0] + 0.45 * r.standard_normal(k))]
        self.style = style
        self.Ts_plot = (lo_s + hi_s) / 2 + p[:, 0] * (hi_s - lo_s) / 2
        self.Te_plot = (lo_e + hi_e) / 2 + p[:, 1] * (hi_e - lo_e) / 2
        self.plot = np.repeat(np.arange(k), self.per)
        self.k = np.tile(np.arange(self.per), k)            # place of the reading in its stay
        regulate = between(r, 0.02, 0.3)
        self.Ts = np.round(self.Ts_plot[self.plot] + regulate * c.wander(r, self.n, 4), 2)
        self.Te = np.round(self.Te_plot[self.plot] + regulate * c.wander(r, self.n, 4), 2)

    def _pressures(self, r):
        self.top = pick(r, 15.0, 20.0, 30.0, 50.0, 100.0)
        low = pick(r, 0.0, 0.2, 0.05 * self.top)
        P = []
        nominal = r.random() < 0.6
        levels = np.linspace(low, self.top, self.per if r.random() < 0.6 else max(4, self.per - 3))
        for _ in range(self.plots):
            if nominal:
                extra = r.choice(levels, self.per - levels.size) if self.per > levels.size else []
                p = np.r_[levels, extra]
            else:
                p = low + (self.top - low) * (np.arange(self.per) + r.random(self.per)) / self.per
            P.append(r.permutation(p))
        P = np.concatenate(P)
        self.P = np.round(np.clip(P + 0.002 * self.top * r.uniform(-1, 1, self.n) * (P > 0), 0, None), 4)

    def _clock(self, r, needs):
        read = between(r, 100, 330)
        soak = between(r, 1800, 5400)
        self.shift = "shift" in needs or (r.random() < 0.4 and "around" not in needs)
        self.refill_hours = between(r, 5, 14)
        self.refills = "refills" in needs or r.random() < 0.3
        stop = -1
        if "stop" in needs or r.random() < 0.35:       # the campaign stops for a leak check, some days
            stop = int(r.integers(max(2, self.plots // 5), max(3, self.plots // 2) + 1))
        t, now = np.zeros(self.n), 0.0
        self.begin = np.zeros(self.plots)              # start of the stay's soak
        self.full = np.zeros(self.n)                   # coolant level
        self.stop_at = None
        filled = -between(r, 0, 0.5) * self.refill_hours * 3600
        for j in range(self.plots):
            if j == stop:
                now += between(r, 20, 50) * 3600
                if self.shift:
                    now = np.ceil(now / 86400) * 86400
                self.stop_at = now
            work = soak + read * self.per
            if self.shift and now % 86400 > 8.6 * 3600 and now % 86400 + work > between(r, 9.5, 12) * 3600:
                now = np.ceil(now / 86400) * 86400 + between(r, 0, 900)
            if self.refills and now - filled > self.refill_hours * 3600:
                now += between(r, 2400, 4200)           # filling takes its time: a longer gap
                filled = now
            elif not self.refills and now - filled > self.refill_hours * 3600:
                filled = now
            self.begin[j] = now
            now += soak * between(r, 0.85, 1.15)
            for i in range(self.per):
                row = j * self.per + i
                if i:
                    now += read * (1 + 0.25 * np.abs(r.standard_normal()))
                t[row] = now
                self.full[row] = np.clip(1 - 0.85 * (now - filled) / (self.refill_hours * 3600), 0.05, 1)
            now += between(r, 200, 600)
        self.abs_t = t                                  # from the morning the campaign began (08:00)
        self.t = np.round(t - t[0], 1)
        self.inside = t - self.begin[self.plot]         # since the temperatures were changed
        self.dt = np.diff(t, prepend=t[0] - read)
        self.read, self.soak = read, soak

    def _bridges(self, r):
        many = int(r.choice([1, 1, 2, 3]))
        self.sets = []
        fine = 10 ** between(r, -4.6, -3.4)
        x, s, e = self.P / self.top, (self.Ts + 90) / 40, self.Te / 40
        for _ in range(many):
            slope = between(r, 1.6, 2.4)
            span = slope * self.top
            q = r.standard_normal(10) * np.array([0.03, 0, 0.02, 0.004, 0.002, 0.003, 0.001, 0.01, 0.003, 0.001])
            clean = span * (x + q[0] + q[2] * s + q[3] * e + q[4] * x * x + q[5] * s * s + q[6] * e * e
                            + q[7] * x * s + q[8] * x * e + q[9] * s * e)
            reading = span * fine * between(r, 0.8, 1.25)
            self.sets.append((clean, slope, reading, 3 * reading * between(r, 0.8, 1.2)))

    def model(self):
        x, s, e = self.P / self.top, (self.Ts + 90) / 40, self.Te / 40
        return np.c_[np.ones(self.n), x, s, e, x * x, s * s, e * e, x * s, x * e, s * e]


def before(lab, start):
    """The pressure before each reading; at a stay's first the line stood at `start`."""
    p = np.r_[start, lab.P[:-1]]
    p[lab.k == 0] = start
    return p


# (lab, r) -> (rows,), any scale
def ice_in_line(lab, r):
    frost = between(r, -105, -75)
    closed = np.clip((frost - lab.Ts) / between(r, 10, 25), 0, 1)
    return closed * (before(lab, 14.7) - lab.P) * np.exp(-np.where(lab.k == 0, lab.read, lab.dt) / (between(r, 0.7, 2) * lab.read))


def residual_gas_condenses(lab, r):
    dew = between(r, -112, -72) + 273.15
    heat = pick(r, 1500.0, 2100.0, 3100.0)       # of sublimation over the gas constant, K: xenon, ethene, carbon dioxide
    T = lab.Ts + 273.15
    return -np.minimum(T / dew, np.exp(-heat * (1 / T - 1 / dew)))


def record_cold(lab, r):
    first = between(r, -85, -60)
    record = np.minimum.accumulate(lab.Ts_plot)
    cracks = np.clip(first - record, 0, None) ** between(r, 0.8, 1.6)
    return cracks[lab.plot] * (1 + between(r, -0.5, 0.5) * lab.P / lab.top)


def board_dew(lab, r):
    dew = between(r, 1, 14)
    tau = between(r, 0.3, 0.8) * lab.soak
    wet = np.zeros(lab.plots)
    for j in range(1, lab.plots):
        if lab.Te_plot[j] > dew > lab.Te_plot[j - 1]:
            wet[j] = min(1.0, 0.4 + (dew - lab.Te_plot[j - 1]) / 40)
    return -wet[lab.plot] * np.exp(-lab.inside / tau) * (between(r, 0.2, 1) + lab.P / lab.top)


def piston_spin_down(lab, r):
    every = int(r.integers(3, min(7, lab.per) + 1))
    age = np.zeros(lab.n)
    spun, count = 0.0, 0
    for i in range(lab.n):
        if lab.k[i] == 0 or count == every:       # spun at the start of each stay too
            spun, count = lab.abs_t[i], 0
        age[i] = lab.abs_t[i] - spun
        count += 1
    slow = age / (every * lab.read)
    return -slow ** between(r, 1, 2) * (between(r, 0.1, 0.4) + lab.P / lab.top)


def dewar_level(lab, r):
    return lab.full * (22 - lab.Ts) / 110 * (1 + between(r, 0, 1) * lab.P / lab.top)


def heater_ground(lab, r):
    room = between(r, 2, 22)                      # the plate's balance without the heater
    return np.sqrt(np.clip(lab.Te - room, 0, None)) * pick(r, -1, 1)


def evening_soak(lab, r):
    late = (lab.begin % 86400) / 3600 > between(r, 6.0, 8.0)     # hours after 08:00
    change = np.diff(lab.Ts_plot, prepend=lab.Ts_plot[0] if r.random() < 0.5 else 20.0)
    # the late stays are read before the gradient has gone
    tau = between(r, 0.4, 1.0) * lab.per * lab.read
    since = lab.t - lab.t[lab.plot * lab.per]
    return (late * change)[lab.plot] * np.exp(-since / tau) * (1 + between(r, 0, 0.5) * lab.P / lab.top)


def helium_after_stop(lab, r):
    after = lab.abs_t >= lab.stop_at
    out = np.zeros(lab.n)
    tau = between(r, 0.15, 0.8) * (lab.abs_t[-1] - lab.stop_at)
    steep = between(r, 15, 40)                    # degC for a factor e in permeation
    gone = 0.0
    for i in np.flatnonzero(after):
        since = min(lab.dt[i], lab.abs_t[i] - lab.stop_at)
        gone += since * np.exp((lab.Ts[i] + 90) / steep) / tau
        out[i] = -np.exp(-gone)
    return out


def oil_canning(lab, r):
    at = between(r, 0.3, 0.7) * lab.top + between(r, -0.15, 0.15) * lab.top * (lab.Ts + 90) / 40
    return np.tanh((lab.P - at) / (between(r, 0.02, 0.08) * lab.top))


EFFECTS = {f.__name__: f for f in (ice_in_line, residual_gas_condenses, record_cold, board_dew, piston_spin_down,
                                   dewar_level, heater_ground, evening_soak, helium_after_stop, oil_canning)}
NEEDS = {"residual_gas_condenses": {"many"}, "heater_ground": {"many"}, "record_cold": {"colder"}, "dewar_level": {"refills"},
         "evening_soak": {"shift"}, "helium_after_stop": {"stop"}}
PAIRS = [("ice_in_line", "residual_gas_condenses"), ("record_cold", "helium_after_stop"), ("board_dew", "heater_ground"),
         ("piston_spin_down", "dewar_level"), ("evening_soak", "oil_canning"), ("ice_in_line", "piston_spin_down")]
ABOUT = {
    "ice_in_line": "Moisture freezes in the pressure line and half closes it: the sensor still has some of the pressure before (14.7 psia at a stay's "
                   "first reading). Depends on the previous pressure_psia and the time since, sensor_temperature_degC below a frost point. Matters in cold stays only.",
    "residual_gas_condenses": "Gas left in the reference cavity: its pressure goes with absolute temperature above its condensation, below it along the vapour "
                              "pressure. Depends on sensor_temperature_degC (a kink). Matters at all pressures alike, on both sides of the kink.",
    "record_cold": "The gauge adhesive cracks a little more whenever the sensor gets colder than ever before, and stays so: offset and some slope. Depends "
                   "on the lowest sensor_temperature_degC of this and all earlier stays (order). Matters after each new record.",
    "board_dew": "Coming from below the room's dew point to above it, the electronics get wet; the leak takes part of the signal and dries. Depends on "
                 "sse_temperature_degC of this stay and the one before, time since the change, pressure_psia. Matters early in such stays.",
    "piston_spin_down": "The pressure standard's piston is spun by hand every few readings; as it slows, friction takes from the pressure. Depends on time and "
                        "count of readings since the spin (every third to seventh reading, and at the start of a stay), pressure_psia. Matters more at high pressure.",
    "dewar_level": "The coolant's level falls between fillings (longer gaps between stays), and with it a gradient that the thermometer does not see. Depends on "
                   "elapsed_s since the last filling, sensor_temperature_degC, pressure_psia. A saw tooth in time.",
    "heater_ground": "The heater of the electronics shares a ground wire; its current is the root of its power, and it only heats above the plate's balance. "
                     "Depends on sse_temperature_degC (nothing below a temperature, a root above). Matters in warm stays.",
    "evening_soak": "Stays begun late in the day are read before the sensor has settled: an error in proportion to the change of sensor temperature from the stay "
                    "before, fading within the stay. Depends on the hour (elapsed_s, days begin at 08:00), sensor_temperature_degC of two stays, time in the stay.",
    "helium_after_stop": "In the long stop the rig is leak-checked with helium, which goes into the reference cavity and comes out slowly, faster in warm stays. "
                         "Depends on elapsed_s since the longest gap, sensor_temperature_degC meanwhile. Nothing before; offset after.",
    "oil_canning": "The diaphragm has a dent that snaps through at a pressure that moves with temperature. Depends on pressure_psia (a step), "
                   "sensor_temperature_degC (where it is). Matters on both sides of the step.",
}


# each: reading errors (rows,) and stay errors (plots,), unit variance
def _in_stay(r, lab):
    rho, e = between(r, 0.3, 0.6), r.standard_normal(lab.n)
    for i in range(1, lab.n):
        if lab.k[i]:
            e[i] = rho * e[i - 1] + np.sqrt(1 - rho * rho) * e[i]
    return e


NOISES = {
    "white": lambda r, lab: (c.white(r, lab.n), c.white(r, lab.plots)),
    "student": lambda r, lab: (c.student(r, lab.n), c.white(r, lab.plots)),
    "uniform": lambda r, lab: (c.uniform(r, lab.n), c.uniform(r, lab.plots)),
    "skewed": lambda r, lab: (c.skewed(r, lab.n), c.skewed(r, lab.plots)),
    "stay_student": lambda r, lab: (c.white(r, lab.n), c.student(r, lab.plots)),
    "outliers": lambda r, lab: (c.outliers(r, lab.n), c.white(r, lab.plots)),
    "high_pressure": lambda r, lab: (c.weighted(r, 0.4 + 1.4 * lab.P / lab.top), c.white(r, lab.plots)),
    "cold_stays": lambda r, lab: (c.white(r, lab.n), c.weighted(r, 0.6 + (-50 - lab.Ts_plot) / 80)),
    "in_stay_ar": lambda r, lab: (_in_stay(r, lab), c.white(r, lab.plots)),
}


def make(effects, seed, size, noise):
    key = "+".join(effects)
    needs = set().union(*[NEEDS.get(e, set()) for e in effects]) if effects else set()
    for attempt in range(80):
        lab = Lab(c.stream(seed, "whole_plots", "lab", key, attempt), needs)
        model = lab.model()
        shapes = [EFFECTS[e](lab, c.stream(seed, "whole_plots", e, key, attempt)) for e in effects]
        lefts = [c.rms(c.left_over(s, model)) for s in shapes]
        if all(v > 0.08 * c.rms(s - s.mean()) and v > 0 for v, s in zip(lefts, shapes)):
            break
    else:
        raise RuntimeError("no laboratory for %r" % (effects,))
    row = [float(np.hypot(a, b)) for _, _, a, b in lab.sets]
    hidden, parts = np.zeros(lab.n), {}
    for e, s, left in zip(effects, shapes, lefts):
        h = s * size * row[0] / left
        parts[e] = c.rms(c.left_over(h, model)) / row[0]
        hidden = hidden + h
    columns = [("whole_plot", lab.plot + 1, "d"), ("order", np.arange(1, lab.n + 1), "d"), ("elapsed_s", lab.t, ".1f"),
               ("pressure_psia", lab.P, ".4f"), ("sensor_temperature_degC", lab.Ts, ".2f"), ("sse_temperature_degC", lab.Te, ".2f")]
    for k, (clean, slope, reading, stay) in enumerate(lab.sets):
        r = c.stream(seed, "whole_plots", "noise", key, k)
        a, b = NOISES[noise](r, lab)
        # the other bridges have the same cause in other strength
        f = 1.0 if k == 0 else row[k] / row[0] * between(c.stream(seed, "whole_plots", "share", key, k), 0.4, 1.3)
        y = clean + reading * a + stay * b[lab.plot] + f * hidden
        name = "bridge_mV" if len(lab.sets) == 1 else "bridge_%d_mV" % (k + 1)
        columns.append((name, y, ".%df" % c.digits(reading)))
    return c.Table(c.csv_text(columns), [], float(np.mean(list(parts.values()))) if parts else 0.0, hidden, parts,
                   row[0], lab.sets[0][2], {"style": lab.style, "plots": lab.plots, "shift": lab.shift, "attempt": attempt})
