"""Accelerometers or inclinometers on a two-axis stage in Earth's gravity."""
import numpy as np
from .common import Lab, NOISES, rng, one_of, turn, text, lagged  # noqa: F401


def lab(seed):
    g = rng("attitude", seed, "lab")
    drawn = g.random() < 0.45
    reps = int(g.integers(3, 7))
    while True:
        n_p, n_r = int(g.integers(6, 12)), int(g.integers(8, 17))
        per = int(g.integers(90, 290)) if drawn else n_p * n_r
        if 300 <= per * reps <= 1500:
            break
    top = float(g.uniform(45, 85))
    order = one_of(g, ["random", "blocks", "there and back"])
    signed = g.random() < 0.4
    jitter = 0.0 if g.random() < 0.5 else 0.03
    digits = int(g.integers(2, 4))
    rep, p, r, gap = [], [], [], []
    pace = float(g.uniform(35, 110))
    for k in range(reps):
        if drawn:
            a = np.degrees(np.arcsin(g.uniform(-1, 1, per) * np.sin(np.radians(top))))
            b = g.uniform(0, 360, per)
        else:
            ps, rs = np.round(np.linspace(-top, top, n_p), 1), np.arange(n_r) * 360.0 / n_r
            if order == "random":
                i = g.permutation(per)
                a, b = np.repeat(ps, n_r)[i], np.tile(rs, n_p)[i]
            else:
                a, b = [], []
                for x in g.permutation(ps):
                    if order == "blocks":
                        way = g.permutation(rs)
                    else:
                        way = np.concatenate([rs[::2], rs[1::2][::-1]])
                        way = way if g.random() < 0.5 else way[::-1]
                    a += [x] * n_r
                    b += list(way)
                a, b = np.array(a), np.array(b)
        a = a + jitter * g.standard_normal(per)
        b = b + jitter * g.standard_normal(per)
        b = (b + 180) % 360 - 180 if signed else b % 360
        p.append(np.round(a, digits))
        r.append(np.round(b, digits))
        gap.append(pace * np.exp(0.3 * g.standard_normal(per)))
        rep.append(np.full(per, k + 1))
    rep, p, r, gap = map(np.concatenate, (rep, p, r, gap))
    n = len(rep)
    first = np.r_[True, rep[1:] != rep[:-1]]
    pause = np.where(first, g.uniform(3600, 50000, n), 0.0)
    pause[0] = 0
    t = np.round(np.cumsum(gap + pause), 1)
    t0 = np.array([t[rep == k][0] for k in range(1, reps + 1)])[rep - 1]
    # temperature of the case: room by day, and what the air conditioning does
    wander = np.zeros(n)
    for i in range(1, n):
        keep = np.exp(-gap[i] / 4000.0)
        wander[i] = keep * wander[i - 1] + np.sqrt(1 - keep ** 2) * g.standard_normal()
    temp = (g.uniform(18, 28) + g.uniform(0.3, 1.2) * np.sin(2 * np.pi * t / 86400 + g.uniform(0, 6.28))
            + g.uniform(0.2, 0.7) * wander + 0.03 * g.standard_normal(n))
    temp = np.round(temp, 2)
    a, b = np.radians(p), np.radians(r)
    sa, ca, sb, cb = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
    up = np.column_stack([sa, -sb * ca, -cb * ca])
    ahead = np.column_stack([ca, sb * sa, cb * sa])
    aside = np.column_stack([0 * sa, cb, -sb])
    sensors = int(g.integers(2, 4))
    axes = np.eye(3)[:sensors] + 0.01 * g.standard_normal((sensors, 3))
    sens = g.uniform(1.5, 6) * g.uniform(0.93, 1.07, sensors)
    offset = 0.05 * g.standard_normal(sensors) * sens
    error = sens * 10 ** g.uniform(-4.4, -3.3) * g.uniform(0.8, 1.25, sensors)
    clean = offset + (up @ axes.T) * sens
    own = turn(seed, 2, "parameters of replicates") == 1
    if own:
        for s in range(sensors):
            d = 1.5 * error[s] * g.standard_normal((reps, 4))
            clean[:, s] += d[rep - 1, 0] + np.sum(d[rep - 1, 1:] * up, axis=1)
    names = ["x_V", "y_V", "z_V"][:sensors]
    columns = {"replicate": ["%d" % k for k in rep], "order": ["%d" % (i + 1) for i in range(n)], "elapsed_s": text(t, 1),
               "pitch_deg": text(p, max(digits, 4)), "roll_deg": text(r, max(digits, 4)), "sensor_temperature_degC": text(temp, 2)}
    return Lab(columns=columns, responses=names, clean=clean, error=error, groups=rep, runs=rep, load=np.abs(up[:, 0]),
               model=np.column_stack([np.ones(n), up]), options=[], rep=rep, p=a, r=b, t=t, since=t - t0, gap=gap, first=first,
               temp=temp, up=up, ahead=ahead, aside=aside, axes=axes, sens=sens, offset=offset, sensors=sensors, own=own)


def volts(lab, vector):
    """Signal of the sensors for a gravity vector (rows, 3) in g."""
    return (vector @ lab.axes.T) * lab.sens


def only_first(lab, v):
    out = np.zeros((len(v), lab.sensors))
    out[:, 0] = v * lab.sens[0]
    return out


def span_heat(lab, g):
    """The magnet's or spring's temperature lags the case's; sensitivity goes with it, each sensor by its own coefficient."""
    inner = np.empty(len(lab.t))
    tau = g.uniform(200, 700)
    for k in np.unique(lab.rep):
        at = lab.rep == k
        inner[at] = lagged(lab.temp[at], lab.gap[at], tau, lab.temp[at][0])
    c = np.r_[1.0, g.uniform(0.4, 1.4, lab.sensors - 1)] * one_of(g, [-1, 1])
    return volts(lab, lab.up) * (inner - inner.mean())[:, None] * c


def foot_creep(lab, g):
    """Levelled at the start of a replication; then one foot sinks into its rubber pad, as the logarithm of time."""
    d = np.log1p(lab.since / g.uniform(300, 1500)) * one_of(g, [-1, 1])
    w = g.uniform(-1, 1)
    return volts(lab, (lab.ahead * np.cos(w) + lab.aside * np.sin(w)) * d[:, None])


def battery(lab, g):
    """Sensors are fed, and give a voltage in proportion, from a battery charged before each replication: a slope, then the knee."""
    out = np.empty(len(lab.t))
    slope, knee = g.uniform(0.3, 0.7), g.uniform(0.06, 0.15)
    for k in np.unique(lab.rep):
        at = lab.rep == k
        x = lab.since[at] / lab.since[at].max() * g.uniform(0.75, 1.0)
        out[at] = -(slope * x + np.exp((x - 1) / knee))
    return volts(lab, lab.up) * out[:, None]


def circle_eccentric(lab, g):
    """The divided circle of the pitch axis is centred badly: the angle that it shows is off by one wave a turn."""
    d = np.sin(lab.p - g.uniform(0, 2 * np.pi))
    return volts(lab, lab.ahead * d[:, None])


def cable_wind(lab, g):
    """The cable winds round the roll axis, for the stage goes the short way. Past its slack it pulls the pitch frame down.
    When it is wound too far, the operator goes back to where it hangs free."""
    slack, limit = g.uniform(0.25, 0.4), g.uniform(1.8, 2.6)
    pull = np.empty(len(lab.t))
    wind = 0.0
    for i in range(len(pull)):
        if lab.first[i]:
            wind = ((lab.r[i] / (2 * np.pi) + 0.5) % 1) - 0.5
        else:
            wind += (((lab.r[i] - lab.r[i - 1]) / (2 * np.pi) + 0.5) % 1) - 0.5
        if abs(wind) > limit:
            wind = ((wind + 0.5) % 1) - 0.5
        pull[i] = max(0.0, abs(wind) - slack)
    return volts(lab, -lab.ahead * pull[:, None])


def loose_grain(lab, g):
    """A grain of solder in the first sensor's case slides across when the case tips enough. In one corner it lies against the
    proof mass and its weight counts along the sensor; in the other it does nothing. It stays until tipped the other way."""
    w, tip = g.uniform(0, 2 * np.pi), g.uniform(0.25, 0.5)
    across = lab.up[:, 1] * np.cos(w) + lab.up[:, 2] * np.sin(w)
    there = np.empty(len(across))
    s = 0.0
    for i, a in enumerate(across):
        s = 1.0 if a > tip else 0.0 if a < -tip else s
        there[i] = s
    return only_first(lab, there * (lab.up[:, 0] + g.uniform(0.2, 0.5)))


def mux_soakage(lab, g):
    """Between rows the scanner rests on its last channel. The hold capacitor's foil soaks up that voltage during the wait and gives
    some back into the first channel of the next scan."""
    last = lab.offset[-1] + volts(lab, lab.up)[:, -1]
    soak = np.r_[0.0, last[:-1]] * (1 - np.exp(-lab.gap / g.uniform(0.6, 2.0) / np.mean(lab.gap)))
    soak[lab.first] = 0
    return only_first(lab, soak / lab.sens[0])


def sun_patch(lab, g):
    """For part of the day the sun comes through the window. The face of the case that looks at it warms up, with a lag, and the
    bias follows the difference across the case."""
    face, sign = int(g.integers(1, 3)), one_of(g, [-1, 1])
    height, tau = np.radians(g.uniform(20, 45)), g.uniform(400, 1200)
    heat = np.zeros(len(lab.t))
    for k in np.unique(lab.rep):
        at = lab.rep == k
        x = lab.since[at]
        a = g.uniform(0.05, 0.25) * x.max()
        b = g.uniform(0.65, 0.95) * x.max()
        az = np.radians(g.uniform(-60, 60)) + 2 * np.pi * x / 86400
        s = (np.cos(height) * (np.cos(az) * lab.ahead[at, face] + np.sin(az) * lab.aside[at, face]) + np.sin(height) * lab.up[at, face])
        clear = np.ones(len(x))
        for _ in range(3):
            c = g.uniform(a, b)
            clear[(x > c) & (x < c + 0.06 * x.max())] = 0.25
        shine = ((x > a) & (x < b)) * clear * np.maximum(0, sign * s)
        heat[at] = lagged(shine, lab.gap[at], tau, 0.0)
    c = np.r_[1.0, g.uniform(-0.8, 0.8, lab.sensors - 1)]
    return heat[:, None] * c * lab.sens


EFFECTS = {f.__name__: f for f in (span_heat, foot_creep, battery, circle_eccentric, cable_wind, loose_grain, mux_soakage, sun_patch)}
PAIRS = [("battery", "loose_grain"), ("foot_creep", "mux_soakage"), ("circle_eccentric", "sun_patch")]
ABOUT = {
    "span_heat": "Everyday. Sensitivity follows the temperature inside, which lags the case by some minutes. Depends on gravity along the sensor"
                 " times temperature. Matters when the room is not held steady.",
    "foot_creep": "Everyday. The stage is level at the start of each replication, then a foot sinks with the logarithm of time. Depends on"
                  " the cosine of pitch (other sensors: on pitch and roll) times time in the replication. Matters with soft pads and long runs.",
    "battery": "Everyday. A battery feeds the sensors and falls during each replication, with a knee at its end. Depends on gravity along the"
               " sensor times time in the replication. Matters in long replications.",
    "circle_eccentric": "Everyday. The pitch circle sits off its centre. Depends on pitch alone for the first sensor (one wave a turn, times the"
                        " cosine of pitch), on pitch and roll for others. Matters with one reading head.",
    "cable_wind": "Unlisted. The cable winds round the roll axis and, past its slack, pulls the pitch frame. Depends on the cosine of pitch"
                  " times the turns gathered by all roll moves since the start of the replication. Matters in wide roll moves.",
    "loose_grain": "Unlisted. A loose grain in the first sensor leans on the proof mass or not, as the last strong tip left it. Depends on"
                   " pitch and roll of this row and of rows before (gravity across the sensor), times gravity along it.",
    "mux_soakage": "Unlisted. The hold capacitor remembers the last channel of the scan before. The first sensor depends on pitch and roll"
                   " of the row before, and a little on the wait. Matters where the attitude changes much from row to row.",
    "sun_patch": "Unlisted. Sun through a window warms one face of the case in part of each replication. Depends on pitch, roll and time, with"
                 " a lag of some minutes. The thermometer does not see it.",
}
