"""Pressure transducers in one chamber, their electronics (SSE) in another, in whole plots of constant temperatures."""

import numpy as np

from . import common
from .common import Table, assemble, play, rng, row_noise

NUMBER = 2
NOISES = dict(common.NOISES)

# sensor from, to; electronics from, to (degC)
PLACES = [(-180, 15, -15, 45), (-55, 125, -20, 60), (-40, 85, 5, 45), (20, 150, 15, 70), (-90, 30, -10, 40)]


def spread(g, low, high, plots):
    """A temperature for each whole plot: a few levels in turn, or all different."""
    if g.random() < 0.5:
        levels = np.linspace(low, high, int(g.integers(4, 8)))
        return np.concatenate([g.permutation(levels) for _ in range(6)])[:plots]
    return low + (high - low) * (g.permutation(plots) + g.uniform(0.2, 0.8, plots)) / plots


def laboratory(seed):
    g = rng(NUMBER, seed, 1)
    plots, per = int(g.integers(6, 21)), int(g.integers(8, 15))
    per = max(per, 11 if plots < 9 else 8)
    n = plots * per
    plot = np.repeat(np.arange(plots), per)
    inside = np.tile(np.arange(per), plots) / per
    top = float(g.choice([15.0, 30.0, 100.0, 250.0, 500.0]))
    low = top * g.uniform(0.02, 0.1)
    levels = np.linspace(low, top, per) if g.random() < 0.6 else np.geomspace(low, top, per)
    place = PLACES[int(g.integers(len(PLACES)))]
    a, b = spread(g, place[0], place[1], plots), spread(g, place[2], place[3], plots)
    plan = str(g.choice(["drawn", "drawn", "up", "loop"]))
    p = []
    for k in range(plots):
        if plan == "drawn":
            p.append(g.permutation(levels))
        elif plan == "up":
            p.append(levels if k % 2 == 0 else levels[::-1])
        else:
            p.append(np.concatenate([levels[::2], levels[1::2][::-1]]))
    p = np.round(np.concatenate(p) * (1 + g.normal(0, 0.0008, n)), 4 if top < 50 else 3)
    dt = g.uniform(90, 240) * g.uniform(0.8, 1.3, n)
    dt[np.arange(0, n, per)] += g.uniform(1800, 6000, plots)
    t = np.round(np.cumsum(dt))
    s = np.round(a[plot] + g.normal(0, 0.2, plots)[plot] * inside + g.normal(0, 0.04, n), 2)
    e = np.round(b[plot] + g.normal(0, 0.1, plots)[plot] * inside + g.normal(0, 0.04, n), 2)
    bridges = int(g.integers(1, 5))
    full = float(g.choice([10.0, 25.0, 50.0, 100.0]))
    sd = full * float(g.choice([1e-4, 3e-4, 8e-4]))
    q = [(v - v.mean()) / v.std() for v in (p, s, e)]
    model = np.column_stack([np.ones(n)] + q + [q[i] * q[j] for i in range(3) for j in range(i, 3)])
    responses, slopes = [], []
    for j in range(bridges):
        c = np.concatenate([[g.normal(0.45, 0.05), 0.28 * g.uniform(0.8, 1.2)], g.normal(0, 0.015, 2)])
        c = np.concatenate([c, g.normal(0, 0.004, 6)])
        name = "bridge_mV" if bridges == 1 else "bridge_%d_mV" % (j + 1)
        responses.append((name, full * (model @ c), sd * (g.uniform(0.7, 1.4) if j else 1.0)))
        slopes.append(full * c[1] / p.std())
    columns = [
        ("whole_plot", ["%d" % (v + 1) for v in plot]),
        ("order", ["%d" % (i + 1) for i in range(n)]),
        ("elapsed_s", ["%d" % v for v in t]),
        ("pressure_psia", ["%.*f" % (4 if top < 50 else 3, v) for v in p]),
        ("sensor_temperature_degC", ["%.2f" % v for v in s]),
        ("sse_temperature_degC", ["%.2f" % v for v in e]),
    ]
    return Table(
        n=n, plot=plot, plots=plots, per=per, t=t, p=p, s=s, e=e, top=top, responses=responses, slopes=slopes,
        shifts=[np.zeros(n)] * bridges, columns=columns, options=[], model=model, groups=np.ones(n),
        share=float(g.uniform(0.2, 0.4)),
    )  # fmt: skip


def stiff_membrane(lab, g, j):
    """A deflected diaphragm stretches and stiffens: deflection w + c w^3 = pressure. It is softer when warm."""
    c = g.uniform(0.05, 0.3) * (1 + 4e-4 * (lab.s - 20))
    u = lab.p / lab.top
    w = u.copy()
    for _ in range(40):
        w = w - (w + c * w**3 - u) / (1 + 3 * c * w**2)
    return w - u


def pressure_memory(lab, g, j):
    """Grains of the diaphragm slip under stress, each with its own slack: a loop between rising and falling pressure
    that is inside the last one."""
    weights = g.uniform(0.3, 1.0, 5)
    out = np.zeros(lab.n)
    for w, width in zip(weights, (0.03, 0.08, 0.16, 0.28, 0.42), strict=True):
        out += w * (play(lab.p, width * lab.top, 0.0) - lab.p)
    return out


def reference_ageing(lab, g, j):
    """The voltage reference of the bridge supply was changed just before. It ages with the logarithm of the time, and
    all outputs with it."""
    tau = lab.t[-1] * g.uniform(0.02, 0.1)
    return lab.responses[j][1] * np.log1p(lab.t / tau)


def soak_too_short(lab, g, j):
    """The thermometer on the case has settled, the diaphragm has not: it is still on its way from the whole plot
    before. Zero and sensitivity are those of its own temperature."""
    length = float(np.median([np.ptp(lab.t[lab.plot == k]) for k in range(lab.plots)]))
    tau = length * g.uniform(0.25, 0.6)
    late, last, out = 22.0 - lab.s[0], 22.0, np.empty(lab.n)
    for i in range(lab.n):
        if i and lab.plot[i] != lab.plot[i - 1]:
            late = out[i - 1] + last - lab.s[i]
            begun = lab.t[i] - 1500.0
        elif i == 0:
            begun = lab.t[0] - 1500.0
        out[i] = late * np.exp(-(lab.t[i] - begun) / tau)
        last = lab.s[i]
    return out * (1 + g.uniform(0.3, 0.8) * lab.p / lab.top)


def bandgap_bow(lab, g, j):
    """The supply's bandgap reference is highest at one temperature of the electronics and falls to both sides, faster
    when cold. All outputs go with it."""
    d = (lab.e - g.uniform(18, 32)) / 40
    return lab.responses[j][1] * -(d**2 - g.uniform(0.1, 0.4) * d**3)


def grease_plug(lab, g, j):
    """Grease in the port stiffens below its pour point. It gives way only to a difference of pressure, the greater the
    colder; what is less is not passed on."""
    pour = np.quantile(lab.s, g.uniform(0.55, 0.75))
    depth = np.clip((pour - lab.s) / (pour - lab.s.min()), 0, None)
    return play(lab.p, lab.top * g.uniform(0.05, 0.12) * depth**0.8, 0.0) - lab.p


def compressor_on(lab, g, j):
    """The compressor of the sensors' chamber runs and rests. Its current lifts the ground of the bridges. The colder
    the chamber the longer it runs in each period."""
    period = float(np.median(np.diff(lab.t))) * g.uniform(3.2, 6.5)
    cold = (lab.s.max() - lab.s) / np.ptp(lab.s)
    duty = 0.25 + 0.45 * cold
    phase = (lab.t + g.uniform(0, period)) % period / period
    start = np.exp(-phase * g.uniform(2, 5))
    return np.where(phase < duty, 1 + 0.8 * start, 0.0)


def two_gauges(lab, g, j):
    """The controller has a gauge for low and one for high pressure, which differ by a step and a slope. It changes over
    at a higher pressure when rising than when falling."""
    change = lab.top * g.uniform(0.35, 0.55)
    up, down = 1.2 * change, 0.8 * change
    high, out = False, np.empty(lab.n)
    for i in range(lab.n):
        high = lab.p[i] > (down if high else up)
        out[i] = high
    return lab.slopes[j] * out * (1 + g.uniform(-0.6, 0.6) * (lab.p - change) / lab.top)


EFFECTS = {
    f.__name__: f
    for f in (
        stiff_membrane, pressure_memory, reference_ageing, soak_too_short,
        bandgap_bow, grease_plug, compressor_on, two_gauges,
    )
}  # fmt: skip
COMMON = ("reference_ageing", "bandgap_bow", "two_gauges", "compressor_on")
SIGNED = ("reference_ageing", "soak_too_short", "two_gauges", "compressor_on")
PAIRS = [
    ("stiff_membrane", "compressor_on"),
    ("reference_ageing", "grease_plug"),
    ("soak_too_short", "two_gauges"),
]
ABOUT = {
    "stiff_membrane": "Everyday. The diaphragm stiffens as it stretches: cubic in pressure, very little less when"
    " cold. Depends on pressure. Matters at full pressure.",
    "pressure_memory": "Everyday. Hysteresis of pressure, with branches. Depends on pressure and on the pressures"
    " before (move).",
    "reference_ageing": "Everyday. Gain (with the zero output) drifts with the logarithm of time. Depends on time times"
    " pressure. Matters in the first hours.",
    "soak_too_short": "Everyday. The diaphragm lags behind the thermometer after each change of temperature. Depends on"
    " time in the plot times the change of sensor temperature from the plot before; more at high pressure.",
    "bandgap_bow": "Everyday. Gain has a parabola (and some cube) over SSE temperature. Depends on SSE temperature"
    " times pressure. Matters at the ends of its range.",
    "grease_plug": "Unlisted. Cold grease in the port holds back a part of each change of pressure. Depends on sensor"
    " temperature (below a threshold), pressure and the move of pressure.",
    "compressor_on": "Unlisted. The compressor of the chamber is on or off; on for longer when cold. Depends on time"
    " (pulses of 3 to 7 rows) and on sensor temperature (their length).",
    "two_gauges": "Unlisted. The controller's gauge changes with the range, at two pressures by direction. Depends on"
    " pressure (a step in the middle) and, near it, on the move of pressure.",
}


def table(effects, seed, size, noise="white"):
    lab = laboratory(seed)

    def error(name, g, j):
        rows = row_noise(name, g, lab.t, lab.responses[j][1])
        shared = g.standard_normal(lab.plots)[lab.plot]
        return np.sqrt(1 - lab.share**2) * rows + lab.share * shared

    return assemble(NUMBER, seed, lab, effects, size, noise, globals(), error)
