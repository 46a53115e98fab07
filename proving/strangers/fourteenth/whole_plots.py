"""Pressure transducers in a cold chamber, their electronics (SSE) in another; runs in whole plots of constant temperatures."""
import numpy as np
from .common import ROW_NOISES, Table, assemble, rng, row_noise

NUMBER = 2
NOISES = dict(ROW_NOISES, plots_ar="normal, and the errors of neighbouring whole plots correlate by 0.5")


def laboratory(seed):
    g = rng(NUMBER, seed, 1)
    per = int(g.integers(8, 13))
    plots = int(g.integers(15, 27))
    plots = min(plots, 300 // per)
    top = g.choice([50.0, 100.0, 150.0, 300.0])
    low = g.choice([2.0, 5.0, 10.0]) * top / 100
    if g.random() < 0.5:
        levels = np.linspace(low, top, per)
    else:
        levels = np.geomspace(low, top, per)
    cold, warm = g.uniform(-175, -110), g.uniform(-20, 25)
    ts = np.linspace(cold, warm, int(g.integers(5, 8)))
    te = np.linspace(g.uniform(-18, -3), g.uniform(40, 52), int(g.integers(5, 8)))
    a = np.concatenate([g.permutation(ts) for _ in range(6)])[:plots]
    b = np.concatenate([g.permutation(te) for _ in range(6)])[:plots]
    if g.random() < 0.4:
        a, b = a + g.uniform(-4, 4, plots), b + g.uniform(-2, 2, plots)
    plan = g.choice(["drawn", "up and down", "drawn"])
    n = plots * per
    plot = np.repeat(np.arange(plots), per)
    p = []
    for k in range(plots):
        if plan == "drawn":
            p.append(g.permutation(levels))
        else:
            half = np.concatenate([levels[::2], levels[1::2][::-1]])
            p.append(half if k % 2 == 0 else half[::-1])
    p = np.round(np.concatenate(p) * (1 + g.normal(0, 0.001, n)), 3)
    pace = g.uniform(120, 260)
    dt = pace * g.uniform(0.8, 1.25, n)
    dt[np.arange(0, n, per)] += g.uniform(2500, 6500, plots)
    t = np.round(np.cumsum(dt)).astype(int)
    inside = np.tile(np.arange(per), plots) / per
    s = np.round(a[plot] + g.normal(0, 0.15, plots)[plot] * inside + g.normal(0, 0.04, n), 2)
    e = np.round(b[plot] + g.normal(0, 0.10, plots)[plot] * inside + g.normal(0, 0.05, n), 2)
    bridges = int(g.integers(2, 4))
    full = g.choice([20.0, 30.0, 60.0, 100.0])
    sd = full * g.choice([2e-4, 5e-4, 1e-3])
    q = [(v - v.mean()) / v.std() for v in (p, s, e)]
    model = np.column_stack([np.ones(n)] + q + [q[i] * q[j] for i in range(3) for j in range(i, 3)])
    responses = []
    for j in range(bridges):
        c = np.concatenate([[g.normal(0.3, 0.1), 0.3 * g.uniform(0.8, 1.2)], g.normal(0, 0.02, 2), g.normal(0, 0.005, 6)])
        responses.append(("bridge_%d_mV" % (j + 1), full * (model @ c), sd * (g.uniform(0.8, 1.2) if j else 1.0)))
    cols = [("whole_plot", ["%d" % (v + 1) for v in plot]), ("order", ["%d" % (i + 1) for i in range(n)]),
            ("elapsed_s", ["%d" % v for v in t]), ("pressure_psia", ["%.3f" % v for v in p]),
            ("sensor_temperature_degC", ["%.2f" % v for v in s]), ("sse_temperature_degC", ["%.2f" % v for v in e])]
    forms = [0.4 + 1.6 * p / top, 0.4 + 1.6 * np.abs(p / top - g.uniform(0.3, 0.7)), np.where(s < np.median(s), 1.8, 0.7),
             0.5 + 1.6 * t / t[-1], np.where(e > np.median(e), 1.7, 0.7)]
    return Table(n=n, plot=plot, plots=plots, per=per, t=t.astype(float), p=p, s=s, e=e, top=top, responses=responses,
                 shifts=[np.zeros(n)] * bridges, columns=cols, options=[], model=model, groups=np.ones(n),
                 forms=forms, share=float(g.uniform(0.2, 0.35)))


def cold_gain(lab, g, j):
    """Piezoresistance goes with a power of the absolute temperature: much steeper in the deep cold."""
    k = (lab.s + 273.15) / 293.15
    return lab.p / lab.top * k ** -g.uniform(1.2, 2.0)


def bias_current(lab, g, j):
    """The input current of the amplifier doubles every ten degrees or so; it flows through the bridge and makes an offset."""
    return 2.0 ** ((lab.e - 25) / g.uniform(8, 11))


def board_drying(lab, g, j):
    """The circuit board dries in the dry chamber gas, faster when warm. The water that is left leaks current."""
    tau = lab.t[-1] * g.uniform(0.1, 0.22)
    water, out, last = 1.0, np.empty(lab.n), 0.0
    for i in range(lab.n):
        speed = 2 ** ((lab.e[i] - 20) / 40)
        water *= np.exp(-(lab.t[i] - last) * speed / tau)
        last = lab.t[i]
        out[i] = water
    return out


def thermal_hysteresis(lab, g, j):
    """Cement of the gauges yields a little at each change of temperature: the zero depends on whether one came from cold or warm."""
    span = np.ptp(lab.s)
    b = span * g.uniform(0.2, 0.4)
    h, last, out = 0.0, 20.0, np.empty(lab.n)
    for i in range(lab.n):
        d = lab.s[i] - last
        if abs(d) > 1.0:
            h = np.sign(d) + (h - np.sign(d)) * np.exp(-abs(d) / b)
            last = lab.s[i]
        out[i] = h
    return out


def liquid_column(lab, g, j):
    """A part of the test gas becomes liquid in the tube above the cold transducer and presses with its height."""
    k = lab.s + 273.15
    t0 = np.quantile(k, g.uniform(0.35, 0.5))
    p0 = lab.top * g.uniform(0.3, 0.5)
    sat = p0 * np.exp(-g.uniform(1000, 1800) * (1 / k - 1 / t0))
    share = np.clip(1 - sat / lab.p, 0, None)
    fill, out = 0.0, np.empty(lab.n)
    for i in range(lab.n):
        dt = lab.t[i] - (lab.t[i - 1] if i else 0)
        fill = share[i] + (fill - share[i]) * np.exp(-dt / 60.0)
        out[i] = fill
    return out


def taconis(lab, g, j):
    """Gas in a tube between warm and cold starts to sound by itself if the ratio of the temperatures is high. The sound is rectified."""
    hot, cold = lab.e + 273.15, lab.s + 273.15
    ratio = hot / cold
    best = lab.top * g.uniform(0.3, 0.7)
    harder = 1 + g.uniform(0.05, 0.10) * np.log(lab.p / best) ** 2
    over = ratio / harder
    limit = np.quantile(over, g.uniform(0.55, 0.68))
    amplitude = np.sqrt(np.clip(over / limit - 1, 0, None))
    return lab.p / lab.top * amplitude / (0.3 + amplitude)


def teflon_knee(lab, g, j):
    """The insulator of the plug at the electronics is PTFE. Its crystals change near 19 degC, it grows by a per cent and strains the pins."""
    at, width = g.uniform(18.5, 20.5), g.uniform(0.8, 2.0)
    changed = 1 / (1 + np.exp(-(lab.e - at) / width))
    return changed + 0.004 * (lab.e - at)


def carrier_beat(lab, g, j):
    """Two carrier oscillators beat slowly. The difference of their frequencies goes with the temperature of the electronics."""
    step = float(np.median(np.diff(lab.t)))
    f0 = 1 / (step * g.uniform(5, 9))
    k = f0 * g.uniform(0.3, 0.5) / (np.ptp(lab.e) / 2)
    phase, out, last = g.uniform(0, 6.28), np.empty(lab.n), 0.0
    for i in range(lab.n):
        f = f0 + k * (lab.e[i] - lab.e.mean())
        phase += 2 * np.pi * f * (lab.t[i] - last)
        last = lab.t[i]
        out[i] = np.sin(phase)
    return out


EFFECTS = {f.__name__: f for f in (cold_gain, bias_current, board_drying, thermal_hysteresis,
                                   liquid_column, taconis, teflon_knee, carrier_beat)}
PAIRS = [("bias_current", "taconis"), ("thermal_hysteresis", "carrier_beat"), ("board_drying", "liquid_column")]
ABOUT = {
    "cold_gain": "Everyday. Gain goes with a power of the absolute sensor temperature. Depends on pressure times a curve of sensor "
                 "temperature. Matters in the deep cold.",
    "bias_current": "Everyday. Input current doubles every 8 to 11 degrees. Depends on SSE temperature. Matters when the electronics are warm.",
    "board_drying": "Everyday. Water in the circuit board dries out. Depends on time, a little on the SSE temperatures so far. Matters at the "
                    "start.",
    "thermal_hysteresis": "Everyday. Zero depends on the last changes of temperature. Depends on sensor temperature and on the move from the "
                          "plot before, constant in a plot.",
    "liquid_column": "Unlisted. Part of the gas condenses above its vapour pressure and presses with its height. Depends on pressure and "
                     "sensor temperature. Matters at high pressure in the cold.",
    "taconis": "Unlisted. Thermoacoustic sound in the tube, above a ratio of absolute temperatures. Depends on sensor and SSE temperature "
               "and pressure. Matters when the sensor is cold and the electronics warm.",
    "teflon_knee": "Unlisted. PTFE changes its crystals near 19 degC: a step. Depends on SSE temperature.",
    "carrier_beat": "Unlisted. Two carriers beat; the beat's frequency goes with SSE temperature. Depends on time, and SSE temperature. Matters "
                    "always.",
}


def table(effects, seed, size, noise="white"):
    lab = laboratory(seed)
    form = lab.forms[int(rng(NUMBER, seed, 9).integers(len(lab.forms)))]

    def error(name, g, j):
        z = g.standard_normal(lab.plots)
        if name == "plots_ar":
            for k in range(1, lab.plots):
                z[k] = 0.5 * z[k - 1] + np.sqrt(0.75) * z[k]
        rows = row_noise(name, g, lab.n, form)
        return np.sqrt(1 - lab.share ** 2) * rows + lab.share * z[lab.plot]

    return assemble(lab, effects, size, noise, NUMBER, seed, EFFECTS, list(EFFECTS), NOISES, error)
