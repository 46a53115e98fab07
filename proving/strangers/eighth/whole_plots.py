"""Cold pressure sensors with electronics in another chamber; whole plots are pairs of temperatures."""
import numpy as np
from . import common
from .common import Table, finish, generator, texts


def plots_ar(lab, g):
    return g.standard_normal(lab.n)


NOISES = dict(common.NOISES, plots_ar=plots_ar)


def laboratory(seed):
    g = generator(seed, "whole_plots", "lab")
    lab = Table()
    m, k = int(g.integers(17, 25)), int(g.integers(7, 13))
    n = lab.n = m * k
    full = g.choice([15.0, 50.0, 100.0])
    cold = g.uniform(-130, -50, m)
    sse = g.uniform(-40, 40, m)
    pace, gap = g.uniform(110, 330), g.uniform(3500, 6500)
    levels = full * (0.05 + 0.95 * np.arange(k) / (k - 1))
    p, t, a, b, tip, plot = [], [], [], [], [], []
    now = g.uniform(300, 900)
    for i in range(m):
        p.append(g.permutation(levels) + g.normal(0, 0.0012 * full, k))
        at = now + np.cumsum(pace * g.uniform(0.8, 1.2, k))
        t.append(at)
        tip.append(at - now)
        a.append(cold[i] + np.cumsum(g.normal(0, 0.05, k)))
        b.append(sse[i] + np.cumsum(g.normal(0, 0.07, k)))
        plot.append(np.full(k, i))
        now = at[-1] + gap * g.uniform(0.85, 1.2)
    tp, lab.p = texts(np.concatenate(p), "%.3f")
    tt, lab.t = texts(np.concatenate(t), "%.0f")
    ta, lab.cold = texts(np.concatenate(a), "%.2f")
    tb, lab.sse = texts(np.concatenate(b), "%.2f")
    lab.tip, lab.plot, lab.full = np.concatenate(tip), np.concatenate(plot), full
    lab.cold_mean, lab.sse_mean, lab.m = cold, sse, m
    lab.length = float(np.mean([np.ptp(x) for x in t]))
    lab.sensors = ["bridge_1_mV", "bridge_2_mV"]
    lab.columns = {"whole_plot": ["%d" % (v + 1) for v in lab.plot], "order": ["%d" % (i + 1) for i in range(n)], "elapsed_s": tt,
                   "pressure_psia": tp, "sensor_temperature_degC": ta, "sse_temperature_degC": tb}
    lab.decimals, lab.options = 5, []
    lab.error_sd = g.uniform(0.012, 0.028)
    lab.ratio = {"bridge_1_mV": 1.0, "bridge_2_mV": g.uniform(0.8, 1.25)}
    q = [(v - v.mean()) / v.std() for v in (lab.p, lab.cold, lab.sse)]
    lab.model = np.column_stack([np.ones(n)] + q + [q[i] * q[j] for i in range(3) for j in range(i, 3)])
    lab.clean = {}
    for s in lab.sensors:
        c = g.normal(0, 1, 10) * np.array([0, 0, 0.4, 0.5, 0.02, 0.3, 0.3, 0.06, 0.05, 0.05])
        c[0], c[1] = g.uniform(9, 14), g.uniform(6.5, 9.5)
        lab.clean[s] = lab.model @ c
    lab.groups, lab.blocks, lab.plots = np.zeros(n), lab.plot, lab.plot
    lab.strength = lab.p / full
    lab.share = g.uniform(0.2, 0.35)  # sd of the error that a whole plot shares, of the sd of a row's error

    def plot_error(e, gg, noise):
        u = gg.standard_normal(m)
        if noise == "plots_ar":
            for i in range(1, m):
                u[i] = 0.5 * u[i - 1] + np.sqrt(0.75) * u[i]
        return np.sqrt(1 - lab.share ** 2) * e + lab.share * u[lab.plot]

    lab.plot_error = plot_error
    return lab


def table(effects, seed, size, noise):
    import sys
    return finish(sys.modules[__name__], "whole_plots", laboratory(seed), effects, seed, size, noise)


def both(lab, g, v):
    return {"bridge_1_mV": v, "bridge_2_mV": v * g.uniform(0.6, 1.4)}


def short_soak(lab, g):
    before = np.concatenate([[lab.cold_mean[0] + 30.0], lab.cold_mean[:-1]])
    return both(lab, g, (before - lab.cold_mean)[lab.plot] * np.exp(-lab.tip / (g.uniform(0.3, 0.8) * lab.length)))


def overload_stop(lab, g):
    return both(lab, g, -np.maximum(0.0, lab.p / lab.full - g.uniform(0.68, 0.84)))


def play_hysteresis(lab, g):
    v = np.zeros(lab.n)
    for w in lab.full * g.uniform(0.5, 1.5) * np.array([0.06, 0.14, 0.25]):
        s = 0.0
        for k in range(lab.n):
            if k == 0 or lab.plot[k] != lab.plot[k - 1]:
                s = 0.0
            s = min(max(s, lab.p[k] - w), lab.p[k] + w)
            v[k] += s - lab.p[k]
    return both(lab, g, v)


def autorange_step(lab, g):
    up = g.uniform(0.35, 0.65) * lab.full
    down, high, v = up - g.uniform(0.1, 0.2) * lab.full, False, np.empty(lab.n)
    for k in range(lab.n):
        if k == 0 or lab.plot[k] != lab.plot[k - 1]:
            high = False
        high = lab.p[k] > (down if high else up)
        v[k] = float(high)
    return {"bridge_1_mV": v * g.choice([-1, 1])}


def dewar_sawtooth(lab, g):
    period, at, v = g.uniform(3.0, 7.0) * 3600.0, [], np.empty(lab.n)
    x = -g.random() * period
    while x < lab.t[-1] + 2 * period:
        at.append(x)
        x += period * g.uniform(0.94, 1.06)
    at = np.array(at)
    i = np.searchsorted(at, lab.t, side="right") - 1
    v = (lab.t - at[i]) / (at[i + 1] - at[i])
    return both(lab, g, v)


def kaiser_adhesive(lab, g):
    coldest = np.minimum.accumulate(lab.cold)
    return {"bridge_1_mV": g.choice([-1, 1]) * np.maximum(0.0, -45.0 - coldest)}


def stale_compensation(lab, g):
    before = np.concatenate([[20.0], lab.sse_mean[:-1]])
    return both(lab, g, lab.p / lab.full * (before[lab.plot] - lab.sse))


def dew_after_cold(lab, g):
    before = np.concatenate([[20.0], lab.sse_mean[:-1]])
    depth = np.where((before < -3) & (lab.sse_mean > 3), np.minimum(-before, 25.0), 0.0)
    if np.sum(depth > 0) < 2:
        rise = lab.sse_mean - before
        depth = np.where(rise > np.sort(rise)[-4], rise, 0.0)
    return both(lab, g, -depth[lab.plot] * np.exp(-lab.tip / (g.uniform(0.4, 1.2) * lab.length)))


EFFECTS = {f.__name__: f for f in (short_soak, overload_stop, play_hysteresis, autorange_step, dewar_sawtooth, kaiser_adhesive,
                                   stale_compensation, dew_after_cold)}
PAIRS = [("play_hysteresis", "dewar_sawtooth"), ("overload_stop", "stale_compensation"), ("short_soak", "kaiser_adhesive")]
ABOUT = {
    "short_soak": "Everyday: readings begin before the sensor is in equilibrium at its new temperature; what is left of the last change of "
                  "sensor temperature decays within the plot. Time in plot and sensor temperature of the plot before.",
    "overload_stop": "Everyday: near full scale the diaphragm touches its overload stop and the signal flattens. Pressure; above about 3/4 of "
                     "full scale.",
    "play_hysteresis": "Everyday: friction in the clamping of the diaphragm: the strain stays behind the pressure on either side (play of three "
                       "widths), vented between plots. Pressure and its history (the move).",
    "autorange_step": "Everyday: the voltmeter of the first bridge changes its range above a threshold and goes back only well below it; the two "
                      "ranges have different zeros. Pressure and its history; first bridge only.",
    "dewar_sawtooth": "Unlisted: the level in the nitrogen dewar falls and is refilled every few hours; the gradient along the sensor follows "
                      "it, a sawtooth in time. Time.",
    "kaiser_adhesive": "Unlisted: the glue of the first bridge gives a little whenever it is colder than ever before; the zero follows the "
                       "coldest temperature so far and never returns. History of sensor temperature; first bridge only.",
    "stale_compensation": "Unlisted: the software corrects the span with the temperature of the electronics that it has stored in the plot "
                          "before. Pressure times the change of electronics temperature from the plot before.",
    "dew_after_cold": "Unlisted: when the electronics go from below freezing to above it, dew forms on the connector and leaks until it has dried; "
                      "never the other way. Time in plot and electronics temperature of this plot and the one before.",
}
