"""Pressure transducers in a cold chamber, their electronics in another; temperatures are held for a whole plot."""
import math
import numpy as np
from . import common

NOISES = dict(common.NOISES, plots_ar="white, and the errors of neighbouring whole plots correlate by 0.5")


def laboratory(seed):
    g = common.rng("whole_plots", "lab", seed)
    lab = common.Lab()
    sensors = int(g.integers(2, 4))
    presses = int(g.integers(6, 11))
    plots = int(g.integers(16, 29))
    plots = min(plots, 290 // presses)
    cold, warm = g.uniform(-115, -80), g.uniform(-5, 35)
    ts_levels = np.linspace(cold, warm, int(g.integers(4, 7)))
    te_levels = np.linspace(g.uniform(-25, 5), g.uniform(25, 50), int(g.integers(3, 5)))
    cells = [(a, b) for a in ts_levels for b in te_levels]
    pick = []
    while len(pick) < plots:
        pick += list(g.permutation(len(cells)))
    pick = pick[:plots]
    if g.random() < 0.4:                            # sensor temperature harder to change than the other
        pick = sorted(pick, key=lambda i: (i // len(te_levels) % 2, i // len(te_levels), g.random()))
    top = g.choice([30.0, 50.0, 100.0, 150.0])
    low = top * g.uniform(0.02, 0.06)
    levels = np.linspace(low, top, presses) if g.random() < 0.6 else np.geomspace(low, top, presses)
    way = g.choice(["random", "random", "up", "updown"])
    gap = g.uniform(120, 300)
    plot, p, ts, te, t, inside = [], [], [], [], [], []
    now = 0.0
    for k, i in enumerate(pick):
        now += g.uniform(3600, 9000) if k else g.uniform(500, 1500)
        if now % 86400 > 43200 and k:
            now += 86400 - now % 86400 + g.uniform(0, 1800)
        start = now
        seq = np.array(levels)
        if way == "random":
            seq = g.permutation(seq)
        elif way == "updown":
            seq = np.concatenate([seq[::2], seq[1::2][::-1]])
        d, e, w = g.normal(0, 0.4), g.normal(0, 0.2), g.uniform(1500, 5000)
        for x in seq:
            now += gap * g.uniform(0.6, 1.5)
            plot.append(k + 1)
            p.append(x * (1 + g.normal(0, 0.001)))
            ts.append(cells[i][0] + d * math.exp(-(now - start) / w) + g.normal(0, 0.03))
            te.append(cells[i][1] + e * math.exp(-(now - start) / w) + g.normal(0, 0.03))
            t.append(now)
            inside.append(now - start)
    n = len(t)
    lab.plot = np.array(plot)
    lab.t = common.shown(t, 0)
    lab.inside = np.array(inside)
    lab.clock = 8.0 + lab.t / 3600
    lab.p, lab.ts, lab.te = common.shown(p, 3), common.shown(ts, 2), common.shown(te, 2)
    lab.gap, lab.top, lab.low = gap, top, low
    lab.columns = [("whole_plot", [str(k) for k in plot]), ("order", [str(i + 1) for i in range(n)]),
                   ("elapsed_s", common.text(t, 0)), ("pressure_psia", common.text(p, 3)),
                   ("sensor_temperature_degC", common.text(ts, 2)), ("sse_temperature_degC", common.text(te, 2))]
    lab.responses = ["bridge_%d_mV" % (j + 1) for j in range(sensors)]
    lab.options = []
    full = g.uniform(10, 60)
    lab.gain = full / top * g.uniform(0.85, 1.15, sensors)
    a, b, x = lab.ts / 100, lab.te / 100, lab.p / top
    base = []
    for j in range(sensors):
        c = full * g.normal(0, 1, 9) * [0.06, 0.02, 0.01, 0.01, 0.02, 0.01, 0.004, 0.004, 0.004]
        base.append(lab.gain[j] * lab.p + c[0] + c[1] * a + c[2] * b + c[3] * x * x + c[4] * x * a + c[5] * x * b
                    + c[6] * a * a + c[7] * b * b + c[8] * a * b)
    lab.base = np.column_stack(base)
    lab.sd = full * 10 ** g.uniform(-4.2, -3.2) * g.uniform(0.85, 1.2, sensors)
    q = [(v - v.mean()) / v.std() for v in (lab.p, lab.ts, lab.te)]
    lab.model = np.column_stack([np.ones(n)] + q + [q[i] * q[j] for i in range(3) for j in range(i, 3)])
    lab.groups = np.ones(n)
    lab.share = float(g.uniform(0.2, 0.35))

    def errors(h, noise, j):
        z = h.standard_normal(plots)
        if noise == "plots_ar":
            for k in range(1, plots):
                z[k] = 0.5 * z[k - 1] + math.sqrt(0.75) * z[k]
        row = common.unit_errors(h, noise, n, lab.p / top)
        return lab.share * z[lab.plot - 1] + math.sqrt(1 - lab.share ** 2) * row
    lab.errors = errors
    return lab


def before(lab):
    """The pressure before this row; a plot begins where the last one ended."""
    return np.concatenate([[lab.top * 0.5], lab.p[:-1]])


def cold_gauge(lab, g):
    # carriers in the silicon gauges freeze out: below a knee the gauge factor turns up (or down) ever faster
    out = []
    for j in range(lab.base.shape[1]):
        kelvin = lab.ts + 273.15
        active = 1 / (1 + 0.6 * np.exp(g.uniform(600, 900) / kelvin - 3.0))
        mobility = (kelvin / 250.0) ** -1.2
        factor = mobility * (1 + 0.8 * (1 - active))
        out.append(1e-3 * lab.gain[j] * lab.p * factor)
    return np.column_stack(out)


def reference_ageing(lab, g):
    # the voltage reference of the excitation is new and settles, fast at first; it was switched on some hours before
    fall = np.log1p((lab.t + g.uniform(600, 3000)) / g.uniform(2000, 9000))
    return -1e-4 * lab.base * fall[:, None] * g.choice([-1, 1])


def compression_heat(lab, g):
    # gas pressed into the cavity warms it, gas let out cools it; the diaphragm gets its share before the case
    tau = g.uniform(0.5, 1.1) * lab.gap
    prev = before(lab)
    heat, out = 0.0, np.empty(len(lab.t))
    for i in range(len(lab.t)):
        dt = lab.t[i] - lab.t[i - 1] if i and lab.plot[i] == lab.plot[i - 1] else lab.gap
        jump = (lab.ts[i] + 273.15) * (lab.p[i] - prev[i]) / (0.5 * (lab.p[i] + prev[i]) + 0.3 * lab.top)
        heat = (heat + jump) * math.exp(-dt / tau)
        out[i] = heat
    k = lab.base.shape[1]
    return np.column_stack([1e-5 * out * lab.gain[j] * lab.top * s for j, s in enumerate(g.uniform(0.6, 1.4, k))])


def bit_weights(lab, g):
    # the converter sets its bits one by one, and the weights of the high ones are a little wrong
    full, zero = 1.25 * np.max(lab.base), min(0.0, 1.1 * np.min(lab.base))
    code = np.clip((lab.base - zero) / (full - zero), 0, 1 - 1e-9)
    wrong = g.choice([-1, 1], 5) * g.uniform(0.5, 1.0, 5) * np.array([1.0, 0.9, 0.7, 0.5, 0.35])
    out = np.zeros_like(code)
    for b in range(5):
        bit = np.floor(code * 2 ** (b + 1)).astype(int) % 2
        out += 1e-4 * wrong[b] * bit
    return out * full


def getter_reference(lab, g):
    # gas in the sealed reference cavity: walls give it off when warm and take it back when cold, the slower the colder
    out = []
    for j in range(lab.base.shape[1]):
        goes, pace = g.uniform(25, 40), g.uniform(30, 50)
        tau0 = g.uniform(1.0, 3.0) * 3600
        ts = np.clip(lab.ts, -120, 40)
        gas, q = 1.0, np.empty(len(lab.t))
        for i in range(len(lab.t)):
            dt = lab.t[i] - lab.t[i - 1] if i else 7200.0
            rest, tau = math.exp(ts[i] / goes), tau0 * math.exp(-ts[i] / pace) * math.exp(-0.3)
            gas = rest + (gas - rest) * math.exp(-dt / tau)
            q[i] = gas
        out.append(-1e-4 * lab.gain[j] * lab.top * q)
    return np.column_stack(out)


def tin_pest(lab, g):
    # solder of pure tin turns to grey powder in the cold, fastest some tens of degrees below zero; each grain seeds the next
    rate = np.exp(-0.5 * ((lab.ts + g.uniform(35, 50)) / 28.0) ** 2) * (lab.ts < 13)
    dt = np.diff(lab.t, prepend=0.0)
    spent = np.cumsum(rate * dt)
    spent /= spent[-1]
    out = []
    for j in range(lab.base.shape[1]):
        seeds = g.uniform(0.01, 0.03)
        reach = g.uniform(5.5, 8.0)
        grey = seeds * np.exp(reach * spent) / (1 - seeds + seeds * np.exp(reach * spent))
        out.append(-1e-3 * lab.gain[j] * lab.p * grey * g.uniform(0.7, 1.3))
    return np.column_stack(out)


def stopped_piston(lab, g):
    # the piston of the pressure balance is spun by hand when a plot begins; as it slows down it sticks short of each new pressure
    spans = [lab.inside[lab.plot == k].max() for k in np.unique(lab.plot)]
    slow = g.uniform(0.3, 0.5) * np.median(spans)
    spin = np.exp(-lab.inside / (slow * g.uniform(0.85, 1.15, lab.plot.max())[lab.plot - 1]))
    sticks = 1 / (1 + (spin / 0.25) ** 2)
    short = -np.sign(lab.p - before(lab)) * sticks * (1 + g.uniform(0.0, 0.5) * lab.p / lab.top)
    return 1e-4 * lab.top * np.outer(short, lab.gain)


def shared_pump(lab, g):
    # the neighbours rough out their furnace with the pump that holds our vacuum; low pressures are then held too high
    load, t0 = np.zeros(len(lab.t)), g.uniform(0, 9000)
    while t0 < lab.t[-1]:
        tau = g.uniform(4000, 10000)
        run = (lab.t >= t0) & (lab.t < t0 + 3 * tau)
        load[run] += g.uniform(0.6, 1.3) * np.exp(-(lab.t[run] - t0) / tau)
        t0 += g.uniform(10000, 24000)
    exhaust = 1 / (1 + (lab.p / (0.15 * lab.top)) ** 2)
    return 1e-3 * lab.top * np.outer(load * exhaust, lab.gain)


EFFECTS = {f.__name__: f for f in (cold_gauge, reference_ageing, compression_heat, bit_weights,
                                   getter_reference, tin_pest, stopped_piston, shared_pump)}
PAIRS = [("cold_gauge", "tin_pest"), ("reference_ageing", "stopped_piston"), ("bit_weights", "getter_reference")]
ABOUT = {
    "cold_gauge": "Everyday. Carriers in the gauges freeze out, the sensitivity bends with temperature more than a square does; "
                  "depends on pressure times a curve in sensor temperature; matters at the cold end.",
    "reference_ageing": "Everyday. The new voltage reference of the excitation settles, fast at first, and takes the whole output with it; "
                        "depends on time (like a logarithm) times pressure.",
    "compression_heat": "Everyday. Gas that is pressed in warms the diaphragm, gas let out cools it, and it fades in minutes; "
                        "depends on the move since the row before and the time since then.",
    "bit_weights": "Everyday. The high bits of the converter have wrong weights, the reading jumps where they switch; "
                   "depends on the output, so on pressure (steps), shifted by the temperatures.",
    "getter_reference": "Unlisted. Walls of the sealed reference cavity give gas off when warm and take it back when cold, very slowly in the cold; "
                        "depends on sensor temperature now and in the plots before, and on time.",
    "tin_pest": "Unlisted. Solder of pure tin turns grey in the cold, each grain seeds the next, leads lose conductance for good; "
                "depends on pressure times an S-shaped growth with the time spent in the cold.",
    "stopped_piston": "Unlisted. The piston of the pressure balance, spun by hand at the start of a plot, slows down and then sticks short of each new "
                      "pressure; depends on the direction of the move and the time in the plot.",
    "shared_pump": "Unlisted. Neighbours rough out a furnace with the vacuum pump that we use, low pressures are then held too high; "
                   "depends on time (spells that fade) at low pressure only.",
}
