"""Pressure transducers in two temperature chambers: causes in line, seals, chambers, weights, weather, wiring."""
from types import SimpleNamespace

import numpy as np

from .common import noises, registry, relax, residual, rms

EFFECTS, ABOUT, effect = registry()
NOISES = noises()
WEIGHTS = np.array([20, 20, 10, 5, 2, 2, 1])   # in fiftieths of the range


def laboratory(rng, needs):
    full = float(rng.choice([5, 30]))
    while True:
        m, npr, nt = int(rng.integers(16, 31)), int(rng.integers(8, 15)), int(rng.integers(1, 3))
        sens = np.round(np.linspace(-120, 40, rng.integers(4, 7)))
        sse = np.round(np.linspace(-20, 50, rng.integers(3, 6)))
        cells = [(x, y) for x in sens for y in sse]
        cells = [c for _ in range(m // len(cells) + 1) for c in [cells[i] for i in rng.permutation(len(cells))]][:m]
        cells = np.array([cells[i] for i in rng.permutation(m)])
        if len(np.unique(cells[:, 0])) == len(sens) and len(np.unique(cells[:, 1])) == len(sse):
            break
    units = np.unique(np.r_[0, np.round(np.linspace(0, 50, npr)[1:] + rng.integers(-1, 2, npr - 1)), 50].clip(0, 50)).astype(int)
    updown = rng.random() < 0.35
    plot, P, t, begun, now = [], [], [], [], 0.0
    for j in range(m):
        jump = np.abs(cells[j] - (cells[j - 1] if j else np.array([20.0, 20.0]))).max()
        begun.append(now)
        now += jump / rng.uniform(1.5, 3) * 60 + 7200
        seq = np.r_[units[::2], units[1::2][::-1]] if updown else rng.permutation(units)
        for p in seq:
            now += rng.uniform(150, 330)
            plot.append(j), P.append(p * full / 50), t.append(now)
    plot, P, t = np.array(plot), np.array(P), np.round(t, 1)
    n = len(plot)
    T, E = cells[plot, 0], cells[plot, 1]
    x, y, z = P / full, T / 100, E / 50
    X = np.c_[np.ones(n), x, y, z, x * x, y * y, z * z, x * y, x * z, y * z]
    S = rng.uniform(1.9, 2.1, nt)
    beta = np.stack([np.r_[rng.normal(0, 0.3), 0, rng.normal(0, 0.1, 2), full * s * rng.normal(0, [2e-3]), rng.normal(0, 0.03, 2),
                           full * s * rng.normal(0, 0.01, 2), rng.normal(0, 0.02)] for s in S], 1)
    lab = SimpleNamespace(n=n, m=m, nt=nt, plot=plot, P=P, t=t, T=T, E=E, cells=cells, begun=np.array(begun), full=full, S=S, X=X, x=x,
                          sub=np.full(nt, rng.uniform(2e-3, 6e-3)), whole=np.full(nt, rng.uniform(5e-3, 20e-3)),
                          clock=rng.uniform(6, 20), units=np.round(P * 50 / full).astype(int), decimals=5, options=[])
    lab.truth = X @ beta + P[:, None] * S
    lab.columns = dict(whole_plot=plot + 1, order=np.arange(1, n + 1), elapsed_s=t, pressure_psia=np.round(P, 4),
                       sensor_temperature_degC=np.round(T + rng.normal(0, 0.02, n), 3), sse_temperature_degC=np.round(E + rng.normal(0, 0.02, n), 3))
    lab.responses = ["bridge_mV"] if nt == 1 else ["bridge_1_mV", "bridge_2_mV"]
    return lab


def ruler(lab, h, sd=False):
    r = residual(h, lab.X)
    mean = np.bincount(lab.plot, r) / np.bincount(lab.plot)
    inside = np.var(r - mean[lab.plot]) >= 0.5 * np.var(r)
    ref = lab.sub[0] if inside else np.hypot(lab.sub[0], lab.whole[0])
    return ref if sd else (r, rms(r) / ref)


def errors(lab, noise, rng):
    out = np.empty((lab.n, lab.nt))
    one = np.arange(lab.m)
    for j in range(lab.nt):
        whole = noise(rng, np.abs(lab.cells[:, 0]) / 120, one // 4)
        out[:, j] = lab.sub[j] * noise(rng, lab.x, lab.plot) + lab.whole[j] * whole[lab.plot]
    return out


def on_grid(lab, fun):
    """fun(fine times, plot in progress at each) evaluated on a one-minute grid and read at the rows."""
    s = np.arange(0, lab.t[-1] + 60, 60.0)
    return np.interp(lab.t, s, fun(s, np.searchsorted(lab.begun, s, side="right") - 1))


@effect("""The gas in the pressure line is not dry; below -40 degC its water freezes in the capillary before the sensor, hour by hour, and is gone after a warm plot. The pressure then reaches the
diaphragm late: the sensor still sees part of the previous pressure. Depends on the step from the previous row's pressure and on the cold hours
since the last warm whole plot; sharply, as conductance goes with the fourth power of the bore.""")
def frost_in_line(lab, rng, k):
    ice, cold = np.zeros(lab.m), 0.0
    length = np.diff(np.r_[lab.begun, lab.t[-1]]) / 3600
    for j, (T, _) in enumerate(lab.cells):
        cold = 0.0 if T > 5 else cold + (length[j] if T < -40 else 0.0)
        ice[j] = cold
    bore = np.maximum(1 - k * rng.uniform(0.01, 0.03) * ice, 0.05)
    tau = rng.uniform(4, 8) / bore ** 4
    wait, p, out = rng.uniform(70, 120), lab.P[0], np.zeros(lab.n)
    for i in range(lab.n):
        p = lab.P[i] + (p - lab.P[i]) * np.exp(-wait / tau[lab.plot[i]])
        out[i] = p - lab.P[i]
    return out[:, None] * lab.S


@effect("""Tube and seals near the sensor give off vapour, by Arrhenius more when warm. At high pressure it is swept away unnoticed, near vacuum the
capillary's conductance is molecular and the stream makes a pressure above the gauge's. Depends on pressure only in the lowest points and on
the sensor's temperature (nothing when cold).""")
def line_outgasses(lab, rng, k):
    Q = 3e-3 * np.exp(-rng.uniform(2500, 5500) * (1 / (lab.T + 273.15) - 1 / 293.15))
    dP = k * Q / (1 + lab.P / (lab.full * rng.uniform(0.01, 0.05)))
    return dP[:, None] * lab.S * np.array([1.0, rng.uniform(0.5, 1.5)])[:lab.nt]


@effect("""The cold chamber's evaporator is defrosted by a timer every three to seven hours for a quarter or half an hour; warm gas makes the sensor's body rise and come
back within the hour, while the controller's thermometer in the air hides it. Depends on elapsed_s (the timer's phase), only with the sensor chamber cold;
on zero and span.""")
def defrost_cycle(lab, rng, k):
    every, last, first = rng.uniform(3, 7) * 3600, rng.uniform(800, 1800), rng.uniform(0, 18000)
    tau, cold = rng.uniform(1500, 3600), np.clip((-10 - lab.cells[:, 0]) / 100, 0, None)

    def warm(s, j):
        return relax(s, (((s - first) % every) < last) * (s > first) * cold[j], tau, 0.0)
    theta = k * rng.uniform(4, 10) * on_grid(lab, warm)
    return theta[:, None] * (rng.uniform(4e-3, 12e-3, lab.nt) + rng.normal(0, 2e-4, lab.nt) * lab.P[:, None])


@effect("""A cold electronics chamber is followed by a warmer setting: room air drawn in through the cable port dews on the board, and the film shunts the bridge's
output until it dries, sooner when warm. Depends on the previous whole plot's electronics temperature (below the dew point), the
present one, and the time within the whole plot.""")
def dew_on_board(lab, rng, k):
    dew = rng.uniform(4, 13)
    before = np.r_[20.0, lab.cells[:-1, 1]]
    water = np.where(lab.cells[:, 1] > before, np.maximum(0, dew - before), 0.0) / 20
    start = np.array([lab.t[lab.plot == j][0] for j in range(lab.m)])
    tau = rng.uniform(1500, 3500) * 2 ** ((20 - lab.E) / 25)
    film = k * water[lab.plot] * np.exp(-(lab.t - start[lab.plot]) / tau)
    return -film[:, None] * (rng.uniform(0.01, 0.05, lab.nt) + 2e-3 * rng.uniform(0.5, 2) * lab.P[:, None])


@effect("""A contact of the sense lead in the feed-through opens when the shell shrinks away below some -80 degC, and closes only when warmed some
forty degrees above. Without remote sensing the bridge gets less by the leads' drop: a fixed ratio of the span, and a piece of zero. Depends on the sequence of sensor temperatures of
the whole plots.""")
def sense_lead_opens_cold(lab, rng, k):
    opens = rng.uniform(-100, -65)
    closes, state, is_open = opens + rng.uniform(25, 65), False, np.zeros(lab.m)
    for j, (T, _) in enumerate(lab.cells):
        state = T < opens or (state and T < closes)
        is_open[j] = state
    loss = k * rng.uniform(1e-3, 3e-3) * is_open[lab.plot]
    return -loss[:, None] * (lab.S * lab.P[:, None] + rng.normal(0, 0.5, lab.nt))


@effect("""The O-ring of the port is glass below its transition near -45 degC and no longer fills its groove, each cool-down a little differently. Air leaks in, choked
below half an atmosphere, out above an atmosphere; the flow drops pressure along the line from the gauge. Depends on sensor temperature (a switch), pressure against
atmosphere, and the luck of each whole plot.""")
def cold_seal_leak(lab, rng, k):
    stiff = 1 / (1 + np.exp((lab.T - rng.uniform(-65, -30)) / 4))
    ratio = lab.P / 14.6
    inward = np.sqrt(np.clip(1 - (np.clip(ratio - 0.53, 0, None) / 0.47) ** 2, 0, None))
    outward = np.sqrt(np.clip(1 - (np.clip(1 / np.maximum(ratio, 1e-3) - 0.53, 0, None) / 0.47) ** 2, 0, None)) * ratio
    seat = rng.uniform(0.2, 1.8, lab.m)[lab.plot]
    dP = k * 1e-2 * stiff * seat * np.where(ratio < 1, inward, -outward)
    return dP[:, None] * lab.S


@effect("""One disc of the piston gauge's set carries another disc's mass in the table (or chewing gum). Pressures are composed of discs from the largest down,
so exactly those pressures are wrong whose sum uses that disc; the same in every whole plot. Depends on pressure by the arithmetic of 20, 20, 10, 5, 2, 2, 1.""")
def one_wrong_weight(lab, rng, k):
    used, left = np.zeros((lab.n, len(WEIGHTS))), lab.units.copy()
    for j, w in enumerate(WEIGHTS):
        used[:, j] = left >= w
        left = left - w * (left >= w)
    share = used.mean(0)
    disc = rng.choice(np.flatnonzero((share > 0.15) & (share < 0.85)))
    return k * rng.choice([-1, 1]) * 3e-3 * used[:, disc, None] * lab.S


@effect("""The gauge measures against the room, and absolute pressure is made by adding the barometer, which is read and typed in only at the start of the shift. Between readings the
weather goes on. Depends on elapsed_s: the barometer's change since the last full eight or twenty-four hours, the same for all pressures
and transducers.""")
def barometer_once_a_shift(lab, rng, k):
    per = np.exp(rng.uniform(np.log(10), np.log(90), 7)) * 3600
    amp, ph = 0.04 * per / per.max() * rng.uniform(0.5, 1.5, 7), rng.uniform(0, 2 * np.pi, 7)
    every, off = rng.choice([8, 24]) * 3600, (lab.clock - 7) * 3600

    def weather(s):
        return (amp * np.sin(2 * np.pi * s[:, None] / per + ph)).sum(1)
    read = np.floor((lab.t + off) / every) * every - off
    return 0.3 * k * (weather(lab.t) - weather(read))[:, None] * lab.S


@effect("""The electronics are potted; the middle of the block needs hours, longer to warm than to cool since frozen foam around it, so that two hours of soak do not do.
Depends on the previous whole plots' electronics temperatures, on warming or cooling, and dies away along each whole plot;
acts on zero and a little on span.""")
def potting_late(lab, rng, k):
    tau = rng.uniform(3000, 7000)

    def core(s, j):
        target, out, now = lab.cells[j, 1], np.empty(len(s)), 20.0
        for i in range(len(s)):
            now += (target[i] - now) * (1 - np.exp(-60 / (tau * (1.7 if target[i] > now else 1.0))))
            out[i] = now
        return out
    theta = k * (on_grid(lab, core) - lab.E)
    return theta[:, None] * (rng.uniform(2e-3, 6e-3, lab.nt) * rng.choice([-1, 1]) + rng.normal(0, 1e-4, lab.nt) * lab.P[:, None])


PAIRS = [["frost_in_line", "barometer_once_a_shift"], ["line_outgasses", "sense_lead_opens_cold"], ["defrost_cycle", "one_wrong_weight"],
         ["dew_on_board", "cold_seal_leak"], ["potting_late", "line_outgasses"], ["barometer_once_a_shift", "one_wrong_weight"]]
