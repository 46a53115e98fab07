"""Pressure transducers in a cold chamber, their electronics in another chamber; runs of pressures at constant temperatures."""
import numpy as np
from . import common
from .common import stream


NOISES = dict(common.NOISES, plots_ar=common.white)


def laboratory(seed):
    g = stream("whole_plots", seed, "laboratory")
    lab = common.Lab()
    plots = int(g.integers(15, 25))
    per = int(g.integers(6, 13))
    per = max(per, int(np.ceil(84 / plots)))
    while plots * per > 296:
        per -= 1
    cold, warm = g.uniform(-115, -95), g.uniform(-35, -10)
    drawn = g.random() < 0.35
    ks, ke = int(g.integers(3, 6)), int(g.integers(3, 5))
    low, high = g.uniform(-15, 0), g.uniform(30, 45)
    for _ in range(200):
        if drawn:
            ts, te = g.uniform(cold, warm, plots), g.uniform(low, high, plots)
        else:
            grid = [(a, b) for a in np.linspace(cold, warm, ks) for b in np.linspace(low, high, ke)]
            while len(grid) < plots:
                grid = grid + grid
            grid = np.array(grid)
            pick = g.permutation(len(grid))[:plots]
            ts, te = np.round(grid[pick, 0]), np.round(grid[pick, 1])
        q = np.column_stack([np.ones(plots), ts, te, ts * ts, ts * te, te * te])
        q = (q - np.r_[0, q[:, 1:].mean(0)]) / np.r_[1, q[:, 1:].std(0)]
        mid = 0.5 * (cold + warm)
        falls = np.sum((ts[1:] < mid - 8) & (ts[:-1] > mid))
        inner = np.abs(ts[1:] - mid) < 0.35 * (warm - cold)
        both = min(np.sum(inner & (ts[1:] > ts[:-1] + 5)), np.sum(inner & (ts[1:] < ts[:-1] - 5)))    # come from below and from above
        if np.linalg.cond(q) < 60 and falls >= 3 and both >= 2:
            break
    top = float(g.choice([50.0, 75.0, 100.0, 150.0]))
    spaced = int(g.integers(0, 3))
    if spaced == 0:
        levels = np.linspace(0.05 * top, top, per)
    elif spaced == 1:
        levels = np.geomspace(0.05 * top, top, per)
    else:
        levels = None
    style = int(g.integers(0, 3))
    n = plots * per
    p, plot, fresh = [], [], []
    for k in range(plots):
        v = levels.copy() if levels is not None else g.uniform(0.04 * top, top, per)
        v = v + g.normal(0, 0.003 * top, per)
        if style == 0:
            v = v[g.permutation(per)]
        elif style == 1:
            v = np.sort(v)[::int(1 if g.random() < 0.5 else -1)]
        else:
            cut = int(g.integers(2, per - 1))
            v = v[g.permutation(per)]
            v = np.r_[np.sort(v[:cut]), np.sort(v[cut:])[::-1]]
        p += list(np.abs(v) + 0.3)
        plot += [k] * per
        fresh += [True] + [False] * (per - 1)
    lab.n, lab.plots, lab.plot, lab.per = n, plots, np.array(plot), per
    lab.p, lab.top = np.round(p, 3), top
    fresh = np.array(fresh)
    soak, pace = g.uniform(5400, 11000), g.uniform(130, 420)
    dt = np.where(fresh, soak * g.uniform(0.85, 1.25, n), pace * g.uniform(0.85, 1.2, n))
    dt[0] = g.uniform(400, 1500)
    lab.time = np.round(np.cumsum(dt))
    lab.hour0, lab.day0 = g.uniform(7.0, 11.0), int(g.integers(0, 3))
    lab.ts, lab.te = ts, te
    jitter = g.uniform(0.03, 0.15)
    sensor = ts[lab.plot] + g.normal(0, 1.2, plots)[lab.plot] * (not drawn) + jitter * g.standard_normal(n)
    box = te[lab.plot] + g.normal(0, 0.3, plots)[lab.plot] + jitter * g.standard_normal(n)
    lab.sensor, lab.box = np.round(sensor, 2), np.round(box, 2)
    q = [(v - v.mean()) / v.std() for v in (lab.p, lab.sensor, lab.box)]
    lab.model = np.column_stack([np.ones(n)] + q + [q[i] * q[j] for i in range(3) for j in range(i, 3)])
    lab.groups = np.ones(n)
    start = lab.time[fresh]
    lab.inside = lab.time - start[lab.plot]
    names = ["bridge_%d_mV" % (k + 1) for k in range(int(g.integers(2, 4)))]
    span = g.uniform(15, 60)
    common.resolution(lab, g, [span * g.uniform(3e-4, 1.5e-3)] * len(names))
    lab.truth, lab.drifts, lab.slope = {}, [], []
    for name in names:
        s = span * g.uniform(0.7, 1.2)
        lab.slope.append(s / top)
        b = g.normal(0, 1, 10) * s * np.array([0.1, 0, 0.02, 0.01, 0.004, 0.008, 0.004, 0.003, 0.002, 0.001])
        lab.truth[name] = s * lab.p / top + lab.model @ b
        lab.drifts.append(np.zeros(n))
    lab.share, lab.ar = g.uniform(0.2, 0.35), g.uniform(0.3, 0.7)
    lab.form = int(g.integers(0, 4))
    lab.options = []
    lab.columns = {"whole_plot": [str(k + 1) for k in lab.plot], "order": [str(i + 1) for i in range(n)],
                   "elapsed_s": common.fixed(lab.time, 0), "pressure_psia": common.fixed(lab.p, 3),
                   "sensor_temperature_degC": common.fixed(lab.sensor, 2), "sse_temperature_degC": common.fixed(lab.box, 2)}

    def spread(j):
        if lab.form == 0:    # the controller is steady in proportion
            return 0.3 + 1.6 * lab.p / top
        if lab.form == 1:    # connectors crackle in the cold
            return 0.5 + 2.0 * np.clip((mid - lab.sensor) / (mid - cold), 0, None)
        if lab.form == 2:    # the chamber's gas is still stirred at the start of a plot
            return 0.6 + 2.0 * np.exp(-lab.inside / (2.0 * pace))
        return 0.5 + 1.8 * np.abs(lab.box - 18.0) / 25.0    # the amplifier was built for 18 degC
    lab.spread = spread
    return lab


def among(lab, g, v):
    return [v * s / lab.slope[0] * (1.0 if j == 0 else g.uniform(0.5, 1.2)) for j, s in enumerate(lab.slope)]


def between(values, low, high):
    """The middle of the widest gap between the values from one quantile to another."""
    v = np.unique(np.round(values, 0))
    a, b = np.quantile(values, [low, high])
    v = v[(v >= a - 1) & (v <= b + 1)]
    if len(v) < 2:
        return float(np.mean([a, b]))
    k = int(np.argmax(np.diff(v)))
    return float(0.5 * (v[k] + v[k + 1]))


def clock(lab):
    h = lab.hour0 + lab.time / 3600.0
    return h % 24, (lab.day0 + np.floor(h / 24)).astype(int)


def morning_barometer(lab, g):
    step = 600.0
    m = int(lab.time[-1] / step) + 3
    keep, lag = np.exp(-step / g.uniform(40000, 90000)), np.exp(-step / 12000.0)
    e = g.standard_normal(m + 200)
    air, smooth = 0.0, 0.0
    track = np.empty(m)
    for i in range(m + 200):
        air = keep * air + e[i]
        smooth = lag * smooth + (1 - lag) * air
        if i >= 200:
            track[i - 200] = smooth
    at = np.arange(m) * step
    h, _ = clock(lab)
    hours = lab.hour0 + lab.time / 3600.0
    morning = np.floor((hours - 8.0) / 24.0) * 24.0 + 8.0
    typed = np.maximum(0.0, (morning - lab.hour0) * 3600.0)
    return among(lab, g, np.interp(lab.time, at, track) - np.interp(typed, at, track))


def frost_heater(lab, g):
    hold = np.quantile(lab.te, g.uniform(0.45, 0.6))
    band = g.uniform(1.5, 4.0)
    d = (lab.box - hold) / band
    inside = hold + band * np.logaddexp(0.0, d)    # the heater holds the amplifier, above it the chamber does
    return among(lab, g, (inside - hold) * (lab.p / lab.top + 0.1))


def solder_yield(lab, g):
    span = np.ptp(lab.ts)
    width = span * g.uniform(0.12, 0.24)
    stress, last = 0.0, 20.0    # made without stress at room temperature
    out = np.empty(lab.plots)
    for k in range(lab.plots):
        t = lab.ts[k]
        stress = float(np.clip(stress + (last - t), -width, width))    # elastic, then it flows
        out[k] = stress
        last = t
    return among(lab, g, out[lab.plot])


def standard_swapped(lab, g):
    k = int(round(lab.plots * g.uniform(0.35, 0.65)))
    after = lab.plot >= k
    gain, zero = g.choice([-1, 1]) * g.uniform(0.7, 1.3), g.normal(0, 0.3)
    return among(lab, g, after * (zero + gain * lab.p / lab.top))


def frozen_pressure(lab, g):
    glass = between(lab.ts, 0.35, 0.7)
    flow = g.uniform(6e4, 2e5)
    held, frozen = 14.7, False
    value = 0.0
    out = np.zeros(lab.n)
    for k in range(lab.plots):
        at = lab.plot == k
        cold = lab.ts[k] < glass
        if cold and not frozen:
            value, since = held, lab.time[at][0]
        frozen = bool(cold)
        if frozen:
            out[at] = (value - 0.5 * lab.top) * np.exp(-(lab.time[at] - since) / flow)
        held = lab.p[at][-1]
    return among(lab, g, out / lab.top)


def o_ring_glass(lab, g):
    glass, wide = between(lab.ts, 0.3, 0.75), g.uniform(2.5, 5.0)
    hard = 1 / (1 + np.exp((lab.sensor - glass) / wide))
    return among(lab, g, hard * (lab.p / lab.top - 0.15))


def growing_crack(lab, g):
    opens = np.quantile(lab.ts, g.uniform(0.55, 0.75))
    power, rate = g.uniform(1.5, 2.5), g.uniform(0.25, 0.6)
    length, last = 0.2, 20.0
    out = np.empty(lab.n)
    for k in range(lab.plots):
        fall = max(0.0, last - lab.ts[k])
        length += rate * (fall / 40.0) ** power if k else 0.0
        last = lab.ts[k]
        at = lab.plot == k
        out[at] = length * np.maximum(0.0, opens - lab.sensor[at]) / 30.0
    return among(lab, g, out)


def factory_hours(lab, g):
    h, day = clock(lab)
    shift = np.zeros(lab.n)
    edge = 0.1
    second = g.uniform(0.4, 1.0)
    for a, b, w in ((6.0, 14.0, 1.0), (14.0, 22.0, second)):
        shift += w / (1 + np.exp(-(h - a) / edge)) / (1 + np.exp((h - b) / edge))
    shift *= day % 7 < 5
    return among(lab, g, -shift * lab.p / lab.top)


EFFECTS = {"morning_barometer": morning_barometer, "frost_heater": frost_heater, "solder_yield": solder_yield,
           "standard_swapped": standard_swapped, "frozen_pressure": frozen_pressure, "o_ring_glass": o_ring_glass,
           "growing_crack": growing_crack, "factory_hours": factory_hours}
PAIRS = [("solder_yield", "standard_swapped"), ("frost_heater", "o_ring_glass"), ("morning_barometer", "growing_crack")]
ABOUT = {
    "morning_barometer": "Everyday. The controller is a gauge instrument; the barometer is typed in at eight in the morning and the weather "
                         "goes on: an error of pressure that grows and starts anew each morning. Depends on time.",
    "frost_heater": "Everyday. A heater keeps the amplifier above a set temperature while the thermometer shows the chamber: its span follows "
                    "only above a bend. Depends on sse_temperature times pressure.",
    "solder_yield": "Everyday. Thermal hysteresis of the zero: the solder of the cell is elastic over a width of temperature and then flows. "
                    "Depends on sensor_temperature of this and of the earlier plots (move, order).",
    "standard_swapped": "Everyday. Between two plots the reference gauge goes away and another takes its place: from then on another span "
                        "and zero. Depends on time (order) and pressure.",
    "frozen_pressure": "Unlisted. The oil behind the membrane turns to glass in the cold and keeps the pressure that stood during the cooling "
                       "(the last one of the plot before) until it thaws. Depends on sensor_temperature, order and earlier pressure.",
    "o_ring_glass": "Unlisted. The rubber ring under the cell turns to glass within some degrees; hard, it passes the push of the pressure on "
                    "to the body. Depends on sensor_temperature (a step) times pressure.",
    "growing_crack": "Unlisted. A crack in a joint of the bridge opens in the cold, and every cooling makes it longer, great ones by far "
                     "more. Depends on sensor_temperature and on order (sum of the coolings).",
    "factory_hours": "Unlisted. The supply of the bridges sags with the mains while the factory next door works, two shifts on weekdays. "
                     "Depends on time of day times pressure.",
}
