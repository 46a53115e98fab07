"""Pressure transducers in a cold chamber, their electronics (SSE) in another; whole plots of constant temperatures."""
import numpy as np
from .common import Lab, rng, one_of, text, unit
from .common import NOISES as EIGHT

NOISES = dict(EIGHT, plots_ar="White in the rows; the errors of whole plots keep 0.5 of the plot before.")
PIECES = (50, 20, 20, 10, 5, 2, 2, 1)


def lab(seed):
    g = rng("whole_plots", seed, "lab")
    span = float(one_of(g, [30.0, 50.0, 75.0, 100.0, 150.0]))
    while True:
        levels, n_s, n_e = int(g.integers(6, 10)), int(g.integers(3, 5)), int(g.integers(3, 5))
        plots = n_s * n_e + int(g.integers(0, 7))
        extra = int(g.integers(0, 4))
        if 80 <= plots * (levels + extra) <= 300:
            break
    x = np.linspace(0.03, 1, levels) if g.random() < 0.5 else np.linspace(0.17, 1, levels) ** 1.8
    marks = np.round(100 * x).astype(int)  # hundredths of the span, put together from weights
    cold, warm = g.uniform(-125, -95), g.uniform(-55, -10)
    s_levels = np.round(np.linspace(cold, warm, n_s))
    e_levels = np.round(np.linspace(g.uniform(-25, 5), g.uniform(25, 50), n_e))
    full = [(s, e) for s in s_levels for e in e_levels]
    pick = full + [full[i] for i in g.integers(0, len(full), plots - len(full))]
    pick = [pick[i] for i in g.permutation(plots)]
    order = one_of(g, ["random", "random", "up and down"])
    pace = g.uniform(130, 320)
    plot, mark, hold, t, ts, te = [], [], [], [], [], []
    clock = g.uniform(300, 1200)
    for k, (s, e) in enumerate(pick):
        i = np.r_[np.arange(levels), g.integers(0, levels, extra)]
        if order == "random":
            i = g.permutation(i)
        else:
            i = np.sort(i)
            i = np.r_[i[::2], i[1::2][::-1]]
        m = len(i)
        h = pace * np.exp(0.4 * g.standard_normal(m))
        now = clock + np.cumsum(h)
        ts.append(s + 0.6 * g.standard_normal() + 0.15 * g.standard_normal() * np.linspace(-1, 1, m) + 0.03 * g.standard_normal(m))
        te.append(e + 0.4 * g.standard_normal() + 0.10 * g.standard_normal() * np.linspace(-1, 1, m) + 0.03 * g.standard_normal(m))
        plot.append(np.full(m, k))
        mark.append(marks[i])
        hold.append(h)
        t.append(now)
        clock = now[-1] + g.uniform(3000, 11000)
    plot, mark, hold, t, ts, te = map(np.concatenate, (plot, mark, hold, t, ts, te))
    n = len(t)
    t, ts, te = np.round(t), np.round(ts, 2), np.round(te, 2)
    p = np.round(span * mark / 100 + 0.002 * span * g.standard_normal(n), 3)
    q = [(v - v.mean()) / v.std() for v in (p, ts, te)]
    model = np.column_stack([np.ones(n)] + q + [q[i] * q[j] for i in range(3) for j in range(i, 3)])
    sensors = int(g.integers(2, 4))
    sens = g.uniform(20, 50) / span * g.uniform(0.75, 1.2, sensors)  # mV for each psi
    sens[0] = max(sens)
    error = np.zeros(sensors)
    clean = np.zeros((n, sensors))
    for s in range(sensors):
        full_scale = sens[s] * span
        c = np.array([0.1, 0.3, 0.02, 0.01, 0.004, 0.01, 0.004, 0.003, 0.001, 0.002]) * g.standard_normal(10)
        c[1] = p.std() / span
        clean[:, s] = full_scale * (model @ c)
        error[s] = full_scale * 10 ** g.uniform(-4.0, -3.2)
    names = ["bridge_%d_mV" % (s + 1) for s in range(sensors)]
    columns = {"whole_plot": ["%d" % (k + 1) for k in plot], "order": ["%d" % (i + 1) for i in range(n)], "elapsed_s": text(t, 0),
               "pressure_psia": text(p, 3), "sensor_temperature_degC": text(ts, 2), "sse_temperature_degC": text(te, 2)}
    first = np.r_[True, plot[1:] != plot[:-1]]
    return Lab(columns=columns, responses=names, clean=clean, error=error, groups=np.ones(n), runs=plot, load=unit(p), model=model,
               options=[], share=float(g.uniform(0.2, 0.35)), plot=plot, mark=mark, hold=hold, t=t, ts=ts, te=te, p=p, span=span,
               sens=sens, sensors=sensors, first=first, s_levels=s_levels, pace=pace)


def same(lab, psi):
    """An error of the pressure itself is seen by all transducers."""
    return psi[:, None] * lab.sens


def membrane_stretch(lab, g):
    """A thin membrane stretches as it bends: deflection w + k w^3 = load; what it lacks of a straight line is hidden. Each transducer has its own k."""
    x = lab.p / lab.span
    out = np.empty((len(x), lab.sensors))
    for s, k in enumerate(g.uniform(0.05, 0.2, lab.sensors)):
        w = x.copy()
        for _ in range(40):
            w -= (w + k * w ** 3 - x) / (1 + 3 * k * w ** 2)
        out[:, s] = (w - x) * lab.span * lab.sens[s]
    return out


def narrow_line(lab, g):
    """The gauge stands at the pump; a long thin tube leads into the chamber. The flow through it goes with the mean pressure, so at
    low pressure the transducers still feel some of the pressure before. Between plots the line is open to the room."""
    tau = lab.pace * g.uniform(0.25, 0.45)
    at = np.empty(len(lab.p))
    now = 14.7
    for i, p in enumerate(lab.p):
        if lab.first[i]:
            now = 14.7
        for _ in range(20):
            mean = 0.5 * (p + now) / (0.35 * lab.span) + 0.05
            now = p + (now - p) * np.exp(-lab.hold[i] / 20 / (tau / mean))
        at[i] = now
    return same(lab, at - lab.p)


def valve_leak(lab, g):
    """The valve to the pump is shut while a point is held. A fitting past it leaks to or from the room: the longer the hold, the more."""
    room = g.uniform(14.2, 14.8)
    return same(lab, -(lab.p - room) * lab.hold)


def amplifier_clips(lab, g):
    """Near the top of the range the amplifier comes close to its rail and bends; with warm electronics earlier."""
    x, w = lab.p / lab.span, g.uniform(0.02, 0.04)
    warm = (lab.te - lab.te.mean()) / (np.ptp(lab.te) + 1e-9)
    edge = g.uniform(0.72, 0.85) - 0.15 * warm
    out = np.empty((len(x), lab.sensors))
    for s in range(lab.sensors):
        u = (x * lab.sens[s] / lab.sens[0] - edge) / w
        out[:, s] = -np.logaddexp(0, u)
    return out


def light_weight(lab, g):
    """Pressure comes from a piston with weights. One weight is chipped, so the points that need it are low."""
    use = np.zeros((len(lab.p), len(PIECES)))
    for i, m in enumerate(lab.mark):
        rest = int(m)
        for j, w in enumerate(PIECES):
            if w <= rest:
                rest -= w
                use[i, j] = 1
    part = use.mean(axis=0)
    fit = [j for j in range(len(PIECES)) if 0.25 <= part[j] <= 0.75 and PIECES[j] < 50]
    j = one_of(g, fit) if fit else int(np.argmin(np.abs(part - 0.5)))
    return same(lab, -use[:, j])


def frost_flap(lab, g):
    """Moist gas: below some temperature frost grows in the port, hour by hour, and goes in a warm plot. A crystal lets gas in but is drawn onto the
    hole when gas goes out, and part of the old pressure stays for a while."""
    edge = 0.5 * (lab.s_levels[-1] + lab.s_levels[-2])
    tau = lab.pace * g.uniform(0.8, 2.5)
    frost, now = 0.0, lab.p[0]
    at = np.empty(len(lab.p))
    for i, p in enumerate(lab.p):
        gap = lab.t[i] - lab.t[i - 1] if i else 3600.0
        if lab.first[i]:
            now = p
        if lab.ts[i] < edge:
            frost += gap / 3600 * (edge - lab.ts[i]) / 40
        else:
            frost = 0.0
        closed = frost / (1 + frost)
        now = p + closed * (now - p) * np.exp(-lab.hold[i] / tau) if now > p else p
        at[i] = now
    return same(lab, at - lab.p)


def thin_gas(lab, g):
    """Current heats the gauges; the gas above the membrane cools them, less so when thin. The zero goes with their own heat."""
    dense = lab.p / (lab.ts + 273.15)
    dense = dense / dense.max()
    out = np.empty((len(dense), lab.sensors))
    for s in range(lab.sensors):
        out[:, s] = 1 / (1 + g.uniform(5, 10) * np.sqrt(dense) * (1 + 3 * dense))
    return out * lab.span * lab.sens


def guard_radio(lab, g):
    """A guard with a radio passes the rack on his round. The amplifiers rectify what it sends; a warm one more."""
    period, width = g.uniform(1500, 2600), g.uniform(0.5, 0.8) * lab.pace
    hit = np.zeros(len(lab.t))
    at = g.uniform(0, period)
    while at < lab.t[-1] + period:
        hit += np.exp(-0.5 * ((lab.t - at - 40 * g.standard_normal()) / width) ** 2)
        at += period
    warm = 1 + 0.3 * (lab.te - lab.te.mean()) / (np.ptp(lab.te) + 1e-9)
    c = np.r_[1.0, g.uniform(0.2, 1.2, lab.sensors - 1)] * one_of(g, [-1, 1])
    return (hit * warm)[:, None] * c


EFFECTS = {f.__name__: f for f in (membrane_stretch, narrow_line, valve_leak, amplifier_clips, light_weight, frost_flap, thin_gas,
                                   guard_radio)}
PAIRS = [("membrane_stretch", "guard_radio"), ("narrow_line", "light_weight"), ("valve_leak", "thin_gas")]
ABOUT = {
    "membrane_stretch": "Everyday. The membrane stiffens as it bends. Depends on pressure alone, mostly its third power. Matters over the full span.",
    "narrow_line": "Everyday. A thin line delays the pressure, most at low pressure. Depends on the move from the pressure before, on pressure and on"
                   " the time since the row before. Matters after big steps down.",
    "valve_leak": "Everyday. The shut line leaks to the room during the hold. Depends on pressure less that of the room, times the time since"
                  " the row before (for the first row of a plot the hold is not in the table). Matters with uneven holds.",
    "amplifier_clips": "Everyday. The amplifier bends near its rail. Depends on pressure near the top and on the SSE temperature, which moves the"
                       " edge. Transducers with less output may be free of it.",
    "light_weight": "Unlisted. One weight of the piston gauge is chipped. Depends on which pressures need that weight: a step up or down from level to"
                    " level. The same in psi for all transducers.",
    "frost_flap": "Unlisted. Frost in the port lets gas in but not out. Depends on steps down in pressure, in plots with a cold sensor, the more the"
                  " longer it has been cold.",
    "thin_gas": "Unlisted. Gauges heat themselves and thin gas cools them badly. Depends on pressure, at the low end, and weakly on the"
                " sensor temperature.",
    "guard_radio": "Unlisted. A radio passes by at nearly regular times. Depends on time (pulses of a few minutes, with a period) and a"
                   " little on the SSE temperature.",
}
